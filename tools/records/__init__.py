"""Measured data in: position, raw and strapdown records; read, checked, averaged over the rests, written."""

from .kinds import PositionRecord, RawRecord, StrapdownRecord
from .read import Source, read_record
from .write import write_record

__all__ = ["PositionRecord", "RawRecord", "Source", "StrapdownRecord", "read_record", "write_record"]
