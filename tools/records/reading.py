"""Records from files: recognised by their columns, checked, in SI and radians."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from trihedron.errors import InputError
from trihedron.records.checks import checked
from trihedron.records.columns import (
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
from trihedron.records.csv_table import read_csv
from trihedron.records.kinds import PositionRecord, RawRecord, StrapdownRecord
from trihedron.records.parquet_table import MAGIC, read_parquet
from trihedron.records.rests import Rest, average_rests, find_rests


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
    record = _read(Path(path), TABLE_KINDS)
    if isinstance(record, StrapdownRecord):
        what = "is a strapdown record; a position record or a raw record (alpha_deg, beta_deg) is needed"
        raise refusal(record.path, None, None, what)
    if isinstance(record, RawRecord):
        rests = find_rests(record)
        return TableRun(average_rests(record, rests), record, tuple(rests))
    return TableRun(record)


def _read(path: Path, kinds: Sequence[Kind]) -> PositionRecord | RawRecord | StrapdownRecord:
    data = _contents(path)
    if data.startswith(MAGIC):
        columns = read_parquet(path, data, lambda names, row: recognise(path, names, row, kinds))
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
            raise InputError(f"{path}: no such file")
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
        row=row,
        path=path,
    )


def _attitude(columns: Columns) -> np.ndarray | None:
    """Unit quaternions; NaN rows where the attitude is not known."""
    if QUATERNION[0] not in columns.numbers:
        return None
    quaternion = columns.group(QUATERNION)
    return quaternion / np.sqrt(np.square(quaternion).sum(axis=1, keepdims=True))
