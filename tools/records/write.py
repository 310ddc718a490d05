"""Records to CSV files, whole or not at all."""

import csv
import io
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import whole_file
from .columns import QUATERNION
from .kinds import PositionRecord, RawRecord, StrapdownRecord


def write_record(record: PositionRecord | RawRecord | StrapdownRecord, path: Path, decimals: int | None = None) -> None:
    """Write a record as CSV; an attitude that is not known is an empty field.

    Parameters
    ----------
    record : PositionRecord, RawRecord or StrapdownRecord
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
    texts: dict[str, list[str]] = {}
    for name, values in record.columns().items():
        if not isinstance(values, np.ndarray) or values.dtype == np.int64:
            texts[name] = [str(value) for value in values]
            continue
        finite = np.isfinite(values)
        if name not in QUATERNION and not finite.all():
            raise InputError(f"{path}: not written: {name} holds a number that is not finite")
        said = [repr(v) if decimals is None else f"{v:z.{decimals}f}" for v in values.tolist()]
        texts[name] = [text if known else "" for text, known in zip(said, finite.tolist(), strict=True)]
    time = np.array([float(text) for text in texts["time_s"]])
    if np.any(time[1:] <= time[:-1]):
        raise InputError(f"{path}: not written: time_s does not grow from row to row as it would be written")
    if Path(path).suffix.lower() == ".parquet":
        raise InputError(f"{path}: records are written as CSV; give a name that ends with .csv")
    table = io.StringIO()
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(texts)
    writer.writerows(zip(*texts.values(), strict=True))
    with whole_file(Path(path)) as beside:
        beside.write_text(table.getvalue(), encoding="utf-8", newline="")
