"""Parquet with the same column names, read the same way; its rows are counted from 1."""

import io
import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import polars as pl

from ..errors import InputError
from . import parquet_probe
from .columns import FORCE, QUATERNION, Columns, Layout, refusal, shown

MAGIC = b"PAR1"


def read_parquet(
    path: Path, data: bytes, recognise: Callable[[Sequence[str], None], Layout], *, ours: bool = False
) -> Columns:
    """Read the columns that `recognise` asks for from the bytes of a Parquet file.

    Parameters
    ----------
    path : Path
        for messages
    data : bytes
        the whole file
    recognise : callable
        (names of the columns, None) -> Layout
    ours : bool
        whether the bytes were made by this process, so that they cannot be corrupt

    Raises
    ------
    InputError
        for a corrupt file, and for everything that is not a table of finite numbers
    """
    if not ours:
        _probe(path, data)
    try:
        names = list(pl.read_parquet_schema(io.BytesIO(data)))
        layout = recognise(names, None)
        frame = pl.read_parquet(io.BytesIO(data), columns=list(layout.present))
    except (pl.exceptions.PolarsError, OSError, ValueError, OverflowError) as error:
        raise _unreadable(path, str(error)) from error
    if frame.height == 0:
        raise refusal(path, None, None, "has no rows; at least one is needed")
    numbers = {name: _numbers(path, frame[name]) for name in layout.numbers}
    texts = {name: _names(path, frame[name]) for name in layout.texts}
    return Columns(path, layout, numbers, texts, np.arange(1, frame.height + 1), _resolution(frame))


def _probe(path: Path, data: bytes) -> None:
    """Let another process read the file first: a corrupt one may end the process that reads it."""
    done = subprocess.run([sys.executable, "-I", parquet_probe.__file__], input=data, capture_output=True, check=False)
    if done.returncode:
        raise _unreadable(path, done.stdout.decode("utf-8", "replace"))


def _unreadable(path: Path, reason: str) -> InputError:
    lines = reason.strip().splitlines() or ["it is corrupt"]
    return refusal(path, None, None, f"is not a readable Parquet file ({lines[0][:120]})")


def _numbers(path: Path, series: pl.Series) -> np.ndarray:
    if not series.dtype.is_numeric():
        raise refusal(path, None, series.name, f"holds {series.dtype}; numbers are needed")
    empty = series.is_null().to_numpy()
    if empty.any() and series.name not in QUATERNION:
        raise refusal(path, _first(empty), series.name, "the field is empty; a number is needed")
    values = np.array(series.cast(pl.Float64).to_numpy())
    wrong = ~np.isfinite(values) & ~empty
    if wrong.any():
        row = _first(wrong)
        what = f"{values[row - 1]} is not a finite number; a finite number is needed"
        raise refusal(path, row, series.name, what)
    return values


def _names(path: Path, series: pl.Series) -> tuple[str, ...]:
    if series.dtype not in (pl.String, pl.Categorical, pl.Enum):
        raise refusal(path, None, series.name, f"holds {series.dtype}; names are needed")
    names = [(name or "").strip() for name in series.cast(pl.String).to_list()]
    for row, name in enumerate(names, 1):
        if not name:
            raise refusal(path, row, series.name, "the field is empty; a name is needed")
        if not name.isprintable():
            raise refusal(path, row, series.name, f"{shown(name)} is not a name; letters and digits are needed")
    return tuple(names)


def _resolution(frame: pl.DataFrame) -> float:
    """Half a last binary digit [m/s²] of readings that are kept in single precision; 0 for doubles."""
    if all(frame[name].dtype != pl.Float32 for name in FORCE):
        return 0.0
    largest = max(float(np.abs(frame[name].to_numpy()).max()) for name in FORCE)
    return 0.5 * float(np.spacing(np.float32(largest)))


def _first(mask: np.ndarray) -> int:
    return int(np.flatnonzero(mask)[0]) + 1
