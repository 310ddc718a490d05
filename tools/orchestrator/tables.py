"""Tables of numbers that drive inputs: read strictly, so that no field is guessed."""

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl

from ..errors import InputError, nearest


@dataclass(frozen=True)
class NumberTable:
    """Columns of finite numbers.

    Attributes
    ----------
    label : str
        as the user wrote it
    columns : dict
        name to (N,) float64
    lines : (N,) int
        where each row stands, as an editor counts lines
    """

    label: str
    columns: dict[str, np.ndarray]
    lines: np.ndarray

    def row(self, index: int) -> str:
        """The file and the row, for a message."""
        return f"{self.label}, row {int(self.lines[index])}"


def _number_table(label: str, frame: pl.DataFrame, lines: np.ndarray) -> NumberTable:
    columns = {}
    for name in frame.columns:
        text = frame[name]
        if text.dtype == pl.String:
            text = text.str.strip_chars()
        elif not text.dtype.is_numeric() and text.dtype != pl.Boolean and text.dtype != pl.Null:
            raise InputError(f"{label}, column '{name}': holds {text.dtype}, not numbers")
        numbers = text.cast(pl.Float64, strict=False)
        bad = numbers.is_null() | ~numbers.is_finite().fill_null(False)
        if bad.any():
            index = int(bad.arg_true()[0])
            written = frame[name][index]
            what = "is empty" if written is None or written == "" else f"'{written}' is not a finite number"
            raise InputError(f"{label}, row {int(lines[index])}, column '{name}': {what}")
        columns[name] = np.ascontiguousarray(numbers.to_numpy(), dtype=np.float64)
    if frame.height == 0:
        raise InputError(f"{label}: has no rows")
    return NumberTable(label, columns, lines)


def _chosen(label: str, header: Sequence[str], wanted: Sequence[str] | None) -> list[str]:
    """The columns that are wanted (all of them where none are named), each there exactly once."""
    if wanted is None:
        wanted = header
    for name in wanted:
        if name not in header:
            raise InputError(f"{label}: has no column '{name}'; {nearest(name, list(header))}")
        if header.count(name) > 1:
            raise InputError(f"{label}: column '{name}' is there {header.count(name)} times")
    return list(dict.fromkeys(wanted))


def _read_csv(content: bytes, label: str, wanted: Sequence[str] | None) -> NumberTable:
    if b"\0" in content:
        raise InputError(f"{label}: is a binary file; a CSV file is needed")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        row = content[: error.start].count(b"\n") + 1
        raise InputError(f"{label}, row {row}: is not UTF-8 text") from error
    kept = [
        (number, line)
        for number, line in enumerate(text.replace("\r\n", "\n").split("\n"), start=1)
        if line.strip() and not line.startswith("#")
    ]
    if not kept:
        raise InputError(f"{label}: is empty; a header line with the columns' names is needed")
    try:
        header = [name.strip() for name in next(csv.reader([kept[0][1]], strict=True))]
    except (csv.Error, StopIteration) as error:
        raise InputError(f"{label}, row {kept[0][0]}: is not a header line ({error})") from error
    names = _chosen(label, header, wanted)
    lines = np.array([number for number, _ in kept[1:]], dtype=np.int64)
    body = "\n".join(line for _, line in kept[1:])
    for number, line in kept[1:]:
        fields = line.count(",") + 1
        if fields != len(header) and '"' not in line:
            raise InputError(f"{label}, row {number}: has {fields} fields; the header has {len(header)}")
    if not body:
        raise InputError(f"{label}: has no rows")
    try:
        frame = pl.read_csv(io.BytesIO(body.encode()), has_header=False, infer_schema=False)
    except pl.exceptions.PolarsError as error:
        raise InputError(f"{label}: is not a readable CSV file ({str(error).splitlines()[0]})") from error
    if frame.width != len(header) or frame.height != len(lines):
        raise InputError(f"{label}: rows and header do not have the same number of fields")
    frame.columns = [str(i) for i in range(len(header))]
    chosen = frame.select(pl.col(str(header.index(name))).alias(name) for name in names)
    return _number_table(label, chosen, lines)


def read_table(path: Path, label: str, wanted: Sequence[str] | None) -> tuple[NumberTable, bytes]:
    """Read columns of numbers from a CSV file, or from a Parquet file (by its name's ending).

    Parameters
    ----------
    path : Path
        the file
    label : str
        what to call it in messages
    wanted : sequence of str or None
        names of the columns; None: every column

    Returns
    -------
    table : NumberTable
    content : bytes
        the file's bytes

    Raises
    ------
    InputError
        not a file, not UTF-8, a column missing, a field that is empty or no finite number (row and column named)
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"{label}: cannot be read ({error.strerror}; looked for {path})") from error
    if path.suffix.lower() != ".parquet":
        return _read_csv(content, label, wanted), content
    try:
        frame = pl.read_parquet(io.BytesIO(content))
    except (pl.exceptions.PolarsError, OSError) as error:
        raise InputError(f"{label}: is not a readable Parquet file ({str(error).splitlines()[0]})") from error
    return table_from(frame, label, wanted), content


def table_from(frame: pl.DataFrame, label: str, wanted: Sequence[str] | None) -> NumberTable:
    """Columns of numbers from a table in memory; rows count from 1."""
    names = _chosen(label, frame.columns, wanted)
    return _number_table(label, frame.select(names), np.arange(1, frame.height + 1))
