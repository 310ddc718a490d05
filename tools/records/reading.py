"""Records from files: recognised by their columns, checked, in SI and radians."""

import hashlib
import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import polars as pl

from ..errors import InputError, nearest_file
from .checks import checked
from .columns import (
    APPROACH,
    FORCE,
    INCREMENT,
    KINDS,
    MOUNTING,
    POSITION,
    QUATERNION,
    RATE,
    RAW,
    TABLE_KINDS,
    TEMPERATURE,
    Columns,
    Kind,
    extra_warning,
    recognise,
    refusal,
)
from .csv_table import read_csv
from .kinds import PositionRecord, RawRecord, StrapdownRecord
from .parquet_table import MAGIC, read_parquet
from .rests import Rest, average_rests, find_rests

ROUNDED_ANGLE = 1e-5
"""Half a last digit [deg] of angles up to which their digits are roundings."""


def read_record(path: Path) -> PositionRecord | RawRecord | StrapdownRecord:
    """Read a record from a CSV or a Parquet file.

    Parameters
    ----------
    path : Path
        the kind of record is recognised by its columns, the kind of file by its first bytes

    Raises
    ------
    InputError
        when it cannot be used: the file, the row (as an editor counts lines) and the column are named
    """
    return _read(Path(path), KINDS)


@dataclass(frozen=True)
class TableRun:
    """A position record with what it was made from: a raw record and its rests, or nothing."""

    record: PositionRecord
    raw: RawRecord | None = None
    rests: tuple[Rest, ...] = ()


def read_position_record(path: Path) -> PositionRecord:
    """Read a position record; a raw record is taken too; arguments and errors as `read_table_run`."""
    return read_table_run(path).record


def read_table_run(path: Path) -> TableRun:
    """Read a position record, or a raw record, of which the rests are found and averaged.

    Raises
    ------
    InputError
        as `read_record`, and when it is a record without table angles or no rest can be found in it
    """
    return _averaged(_read(Path(path), TABLE_KINDS))


def measured_run_of(
    source: "Path | str | pl.DataFrame | PositionRecord | RawRecord | StrapdownRecord",
) -> TableRun | StrapdownRecord:
    """A strapdown record, or the position record, of a file, a table in memory or a record.

    What has the angles of a table is a record of the table, gyros or not.

    Raises
    ------
    InputError
        as `read_record`, and where no rest can be found in a raw record
    """
    if isinstance(source, StrapdownRecord):
        return source
    if isinstance(source, PositionRecord | RawRecord):
        return table_run_of(source)
    if isinstance(source, pl.DataFrame):
        found = _parsed(Path("table"), _parquet(source), TABLE_KINDS, ours=True)
    else:
        found = _read(Path(source), TABLE_KINDS)
    return found if isinstance(found, StrapdownRecord) else _averaged(found)


def _averaged(record: PositionRecord | RawRecord | StrapdownRecord) -> TableRun:
    if isinstance(record, StrapdownRecord):
        what = "is a strapdown record; a position record or a raw record (alpha_deg, beta_deg) is needed"
        raise refusal(record.path, None, None, what)
    if isinstance(record, RawRecord):
        rests = find_rests(record)
        return TableRun(average_rests(record, rests), record, tuple(rests))
    return TableRun(record)


def record_of(table: pl.DataFrame) -> PositionRecord | RawRecord | StrapdownRecord:
    """A record from a table in memory, with the columns that a file would have; rows count from 1.

    Raises
    ------
    InputError
        as `read_record`
    """
    return _parsed(Path("table"), _parquet(table), KINDS, ours=True)


def table_run_of(source: "Path | str | pl.DataFrame | PositionRecord | RawRecord") -> TableRun:
    """The position record of a file, a table in memory or a record; a raw one is averaged over its rests.

    Raises
    ------
    InputError
        as `read_table_run`
    """
    if isinstance(source, PositionRecord):
        return TableRun(source)
    if isinstance(source, RawRecord):
        return _averaged(source)
    if isinstance(source, pl.DataFrame):
        return _averaged(_parsed(Path("table"), _parquet(source), TABLE_KINDS, ours=True))
    return read_table_run(Path(source))


def _parquet(table: pl.DataFrame) -> bytes:
    written = io.BytesIO()
    table.write_parquet(written)
    return written.getvalue()


def _read(path: Path, kinds: Sequence[Kind]) -> PositionRecord | RawRecord | StrapdownRecord:
    return _parsed(path, _contents(path), kinds)


def _parsed(
    path: Path, data: bytes, kinds: Sequence[Kind], *, ours: bool = False
) -> PositionRecord | RawRecord | StrapdownRecord:
    if data.startswith(MAGIC):
        columns = read_parquet(path, data, lambda names, row: recognise(path, names, row, kinds), ours=ours)
    elif path.suffix.lower() == ".parquet":
        raise refusal(path, None, None, "is not a Parquet file (it does not begin with PAR1)")
    else:
        columns = read_csv(path, data, lambda names, row: recognise(path, names, row, kinds))
    warnings = extra_warning(path, columns.layout) + checked(columns)
    return replace(_record(columns), warnings=warnings, sha256=hashlib.sha256(data).hexdigest())


def _contents(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a directory; the file of a record is needed")
        if not path.exists():
            raise InputError(f"{path}: no such file{nearest_file(path)}")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file; the file of a record is needed")
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    if not data:
        raise InputError(f"{path}: is empty; a header and at least one row are needed")
    return data


def _record(columns: Columns) -> PositionRecord | RawRecord | StrapdownRecord:
    time, force = columns.numbers["time_s"], columns.group(FORCE)
    temperature = columns.optional(TEMPERATURE)
    path, row = columns.path, columns.row
    if columns.layout.kind not in (POSITION, RAW):
        return StrapdownRecord(
            time_s=time,
            rate=columns.group(RATE) if RATE[0] in columns.numbers else None,
            increment=columns.group(INCREMENT) if INCREMENT[0] in columns.numbers else None,
            specific_force=force,
            attitude=_attitude(columns),
            temperature=temperature,
            path=path,
            row=row,
        )
    alpha, beta = np.deg2rad(columns.numbers["alpha_deg"]), np.deg2rad(columns.numbers["beta_deg"])
    if columns.layout.kind is RAW:
        return RawRecord(time, alpha, beta, force, temperature, path, row, (), columns.resolution)
    return PositionRecord(
        position=columns.numbers["position"].astype(np.int64),
        time_s=time,
        alpha=alpha,
        beta=beta,
        specific_force=force,
        temperature=temperature,
        approach_alpha=columns.optional(APPROACH[0]),
        approach_beta=columns.optional(APPROACH[1]),
        mounting=columns.texts.get(MOUNTING),
        resolution=columns.resolution,
        angle_resolution=_angle_resolution(columns),
        temperature_resolution=columns.temperature_resolution,
        row=row,
        path=path,
    )


def _angle_resolution(columns: Columns) -> float:
    """Half a last digit of the angles [rad]; 0 where they have few digits: settings, which the encoders reached."""
    return float(np.deg2rad(columns.angle_resolution)) if columns.angle_resolution <= ROUNDED_ANGLE else 0.0


def _attitude(columns: Columns) -> np.ndarray | None:
    """Unit quaternions; NaN rows where the attitude is not known."""
    if QUATERNION[0] not in columns.numbers:
        return None
    quaternion = columns.group(QUATERNION)
    return quaternion / np.sqrt(np.square(quaternion).sum(axis=1, keepdims=True))
