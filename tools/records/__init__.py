"""Measured data in: position, raw and strapdown records; read, checked, averaged over the rests, written."""

from .kinds import PositionRecord, RawRecord, StrapdownRecord
from .output import write_position_record, write_raw_record, write_strapdown_record
from .reading import read_position_record, read_record

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
