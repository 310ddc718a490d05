"""Read NovAtel's raw IMU logs in ASCII: %RAWIMUSA, #RAWIMUA, %RAWIMUSXA, #RAWIMUXA, with their checksums.

Their order is z, -y, x; counts are increments of velocity and angle over a sample. Source: OEM7 Commands and Logs.
"""

import re
import zlib
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path

import polars as pl

from ..errors import InputError
from .sheet import HeaderFacts, Sheet

LINE = re.compile(r"[%#]RAWIMU(?P<short>S?)(?P<extended>X?)A,")
NAMES = ("week", "time", "dvel z", "dvel y", "dvel x", "dtheta z", "dtheta y", "dtheta x")
UNITS = ("", "ns", "LSB", "LSB", "LSB", "LSB", "LSB", "LSB")


def is_novatel(lines: Sequence[str]) -> bool:
    """Return True if one of the first lines is a raw IMU log."""
    return any(LINE.match(line) for line in lines[:100])


def novatel_sheet(path: Path, lines: Sequence[str]) -> Sheet:
    """Return the raw IMU logs of a file as columns of counts with x, y, z and the time since the first GPS week [ns].

    Raises InputError for a line whose checksum is wrong, or that ends too early.
    """
    rows: list[list[int]] = []
    for number, line in enumerate(lines, 1):
        form = LINE.match(line)
        if not form:
            continue
        content, star, checksum = line[1:].strip().rpartition("*")
        if not star or checksum.lower() != f"{block_checksum(content.encode()):08x}":
            raise InputError(f"{path}: row {number}: its checksum is wrong, or it is cut short; remove the line")
        fields = content.partition(";")[2].split(",")
        before = 2 if form["extended"] else 0
        if len(fields) != before + 9:
            raise InputError(f"{path}: row {number}: has {len(fields)} fields; {before + 9} are needed")
        try:
            week, nanoseconds = int(fields[before]), int(Decimal(fields[before + 1]) * 10**9)
            counts = [int(field) for field in fields[before + 3 :]]
        except (ValueError, InvalidOperation) as error:
            raise InputError(f"{path}: row {number}: holds something that is not a number ({error})") from error
        z, minus_y, x, turn_z, minus_turn_y, turn_x = counts
        rows.append([week, week * 604800 * 10**9 + nanoseconds, z, -minus_y, x, turn_z, -minus_turn_y, turn_x])
    frame = pl.DataFrame(rows, schema=list(NAMES), orient="row")
    stated = HeaderFacts(header_row=1, first_row=2, units=UNITS)
    return Sheet(path, name="raw IMU logs", stated=stated, frame=frame)


def block_checksum(content: bytes) -> int:
    """Return NovAtel's CRC-32, which begins with 0 and is not inverted."""
    return zlib.crc32(content, 0xFFFFFFFF) ^ 0xFFFFFFFF
