"""Measured data in: position, raw and strapdown records; read, checked, averaged over the rests, written."""

from trihedron.records.kinds import PositionRecord, RawRecord, StrapdownRecord
from trihedron.records.output import write_position_record, write_raw_record, write_strapdown_record
from trihedron.records.reading import read_position_record, read_record

__all__ = [
    "PositionRecord",
    "RawRecord",
    "StrapdownRecord",
    "read_position_record",
    "read_record",
    "write_position_record",
    "write_raw_record",
    "write_strapdown_record",
]
