"""Records to CSV files, whole or not at all."""

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..writing import whole_file
from .columns import (
    ANGLES,
    APPROACH,
    FORCE,
    INCREMENT,
    MOUNTING,
    QUATERNION,
    RATE,
    TEMPERATURE,
)
from .kinds import PositionRecord, RawRecord, StrapdownRecord


def write_position_record(record: PositionRecord, path: Path, decimals: int | None = None) -> None:
    """Write a position record as CSV.

    Parameters
    ----------
    record : PositionRecord
        what it has; row numbers, warnings and scatter are not written
    path : Path
        appears whole or not at all
    decimals : int or None
        decimals of every number but the integers; None: the shortest that read back to the same double

    Raises
    ------
    InputError
        when the record could not be read again (a number that is not finite, a time that repeats once it is
        rounded), or the file cannot be written
    """
    columns: dict[str, Sequence[str]] = {"position": [str(k) for k in record.position]}
    columns.update(_table_columns(path, record, decimals))
    for name, values in zip(APPROACH, (record.approach_alpha, record.approach_beta), strict=True):
        if values is not None:
            columns[name] = [str(int(value)) for value in values]
    if record.mounting is not None:
        columns[MOUNTING] = record.mounting
    _write(path, columns)


def write_raw_record(record: RawRecord, path: Path, decimals: int | None = None) -> None:
    """Write a raw record as CSV; parameters and errors as in `write_position_record`."""
    _write(path, _table_columns(path, record, decimals))


def write_strapdown_record(record: StrapdownRecord, path: Path, decimals: int | None = None) -> None:
    """Write a strapdown record as CSV; an attitude that is not known is an empty field; as `write_position_record`."""
    numbers = {"time_s": record.time_s}
    for names, values in ((RATE, record.rate), (INCREMENT, record.increment), (FORCE, record.specific_force)):
        if values is not None:
            numbers |= {name: values[:, axis] for axis, name in enumerate(names)}
    if record.temperature is not None:
        numbers[TEMPERATURE] = record.temperature
    columns: dict[str, Sequence[str]] = dict(_number_texts(path, numbers, decimals))
    if record.attitude is not None:
        known = np.atleast_1d(np.isfinite(record.attitude).all(axis=1))
        for axis, name in enumerate(QUATERNION):
            texts = _texts(record.attitude[:, axis], decimals)
            columns[name] = [text if there else "" for text, there in zip(texts, known.tolist(), strict=True)]
    _write(path, columns)


def degrees_that_read_back(angle: np.ndarray) -> np.ndarray:
    """Degrees with as few decimals as possible whose conversion to radians gives the same doubles.

    Not every double in radians has such a degree (the spacing of doubles is wider in degrees for one in ten);
    there it is the nearest.

    Parameters
    ----------
    angle : ndarray
        [rad]

    Returns
    -------
    ndarray
        [deg], the same shape
    """
    result = np.rad2deg(angle)
    nearest = result.copy()
    open_ = np.ones(angle.shape, dtype=bool)
    tried = [np.round(nearest, decimals) for decimals in range(14)]
    tried += [nearest, np.nextafter(nearest, np.inf), np.nextafter(nearest, -np.inf)]
    for candidate in tried:
        hit = open_ & (np.deg2rad(candidate) == angle)
        result[hit] = candidate[hit]
        open_ &= ~hit
    return result


def _table_columns(path: Path, record: PositionRecord | RawRecord, decimals: int | None) -> dict[str, list[str]]:
    numbers = {"time_s": record.time_s}
    angles = (record.alpha, record.beta)
    numbers |= {name: degrees_that_read_back(a) for name, a in zip(ANGLES, angles, strict=True)}
    numbers |= {name: record.specific_force[:, axis] for axis, name in enumerate(FORCE)}
    if record.temperature is not None:
        numbers[TEMPERATURE] = record.temperature
    return _number_texts(path, numbers, decimals)


def _number_texts(path: Path, numbers: Mapping[str, np.ndarray], decimals: int | None) -> dict[str, list[str]]:
    for name, values in numbers.items():
        if not np.isfinite(values).all():
            raise InputError(f"{path}: not written: {name} holds a number that is not finite")
    texts = {name: _texts(values, decimals) for name, values in numbers.items()}
    written = np.array([float(text) for text in texts["time_s"]])
    if np.any(written[1:] <= written[:-1]):
        raise InputError(f"{path}: not written: time_s does not grow from row to row as it would be written")
    return texts


def _texts(values: np.ndarray, decimals: int | None) -> list[str]:
    if decimals is None:
        return [repr(value) for value in values.tolist()]
    return [f"{value:z.{decimals}f}" for value in values.tolist()]


def _write(path: Path, columns: Mapping[str, Sequence[str]]) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*columns.values(), strict=True))
    if Path(path).suffix.lower() == ".parquet":
        raise InputError(f"{path}: records are written as CSV; give a name that ends with .csv")
    with whole_file(Path(path)) as beside:
        beside.write_text(text.getvalue(), encoding="utf-8", newline="")
