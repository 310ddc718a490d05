"""Two runs or records held against each other, column by column: by how much they differ, and when."""

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field

from .errors import InputError, nearest
from .files import bytes_of
from .parquet import MAGIC, fault_of_parquet
from .records.read import table_of
from .result import Result

TIME, POSITION = "time_s", "position"
LARGEST = float(np.finfo(float).max)
RUNS = ("run.parquet", "run.csv")
"""What a run's folder holds."""


class Difference(Result):
    """How a column differs, the second less the first, in the unit of its name.

    Attributes
    ----------
    column : str
    largest, rms : float
        of the sizes of the differences
    time_s : float
        when it is largest, by the first
    first, second : float
        the values then
    one_only : int
        rows where only one of both has a value
    within : bool
        whether the largest is within what was asked for, and no value is missing
    """

    column: str
    largest: float
    rms: float
    time_s: float
    first: float
    second: float
    one_only: int
    within: bool


class Compared(Result):
    """Two runs or records held against each other.

    Attributes
    ----------
    verdict : str
        "same" where every column is within what was asked for, and both have the same columns
    first, second : str
        what they are called
    rows : int
        that were compared
    matched : str
        by what rows belong together: "rows" of the same times, "position" numbers, or "time", the second interpolated
    columns : list of Difference
    only_first, only_second, not_compared : list of str
        columns that only one has, and those that are no numbers
    differences, both : polars.DataFrame
        over `time_s`; not published
    """

    schema_: Literal["trihedron.comparison/1"] = Field(default="trihedron.comparison/1", alias="schema")
    verdict: Literal["same", "different"]
    first: str
    second: str
    rows: int
    matched: Literal["rows", "position", "time"]
    columns: list[Difference]
    only_first: list[str]
    only_second: list[str]
    not_compared: list[str]
    differences: pl.DataFrame = Field(default=None, exclude=True, repr=False)  # pyright: ignore[reportAssignmentType]
    both: pl.DataFrame = Field(default=None, exclude=True, repr=False)  # pyright: ignore[reportAssignmentType]

    def to_polars(self) -> pl.DataFrame:
        """A row for each column, with the fields of `Difference`."""
        return pl.DataFrame([difference.to_json() for difference in self.columns])


def compare(first: Any, second: Any, within: Sequence[str]) -> Compared:
    """Hold two runs or records against each other; `trihedron.compare` says more."""
    (name, table), (other, before) = read_table(first), read_table(second)
    shared = [column for column in table.columns if column in before.columns and column not in (TIME, POSITION)]
    numbers = [c for c in shared if all(t.schema[c].is_numeric() or t.schema[c] == pl.Boolean for t in (table, before))]
    if not numbers:
        raise InputError(f"{other}: has no column of numbers in common with {name}")
    limits = limits_of(within, numbers)
    kept, places, matched = _matched(name, table, other, before)
    time = table[TIME].to_numpy()[kept].astype(float)
    found, differences, both = [], {TIME: time}, {TIME: time}
    for column in numbers:
        one = table[column].cast(pl.Float64).to_numpy()[kept]
        values = before[column].cast(pl.Float64).to_numpy()
        two = values[places] if places.dtype.kind == "i" else np.interp(places, before[TIME].to_numpy(), values)
        with np.errstate(over="ignore", invalid="ignore"):
            # Numbers near the largest have differences that are none.
            left = np.clip(two - one, -LARGEST, LARGEST)
        left[~(np.isfinite(one) & np.isfinite(two))] = np.nan
        found.append(_difference(column, time, (one, two, left), limits[column]))
        differences[column] = left
        both |= {f"first {column}": one, f"second {column}": two}
    apart = [
        [c for c in t.columns if c not in (*u.columns, TIME, POSITION)] for t, u in ((table, before), (before, table))
    ]
    same = all(d.within for d in found) and not any(apart) and len(kept) == table.height == before.height
    return Compared(
        verdict="same" if same else "different",
        first=name,
        second=other,
        rows=len(kept),
        matched=matched,
        columns=found,
        only_first=apart[0],
        only_second=apart[1],
        not_compared=[column for column in shared if column not in numbers],
        differences=pl.DataFrame(differences),
        both=pl.DataFrame(both),
    )


def _difference(column: str, time: NDArray, values: tuple[NDArray, NDArray, NDArray], limit: float) -> Difference:
    one, two, left = values
    known = np.isfinite(left)
    one_only = int(np.count_nonzero(np.isfinite(one) != np.isfinite(two)))
    if not known.any():
        zero = {"largest": 0.0, "rms": 0.0, "time_s": float(time[0]), "first": 0.0, "second": 0.0}
        return Difference(column=column, **zero, one_only=one_only, within=one_only == 0)
    size = np.where(known, np.abs(left), -1.0)
    at = int(np.argmax(size))
    return Difference(
        column=column,
        largest=float(size[at]),
        rms=float(size[at] * np.sqrt(np.mean(np.square(size[known] / (size[at] or 1.0))))),
        time_s=float(time[at]),
        first=float(one[at]),
        second=float(two[at]),
        one_only=one_only,
        within=bool(size[at] <= limit) and one_only == 0,
    )


def limits_of(within: Sequence[str], columns: list[str]) -> dict[str, float]:
    """What each column may differ by: NUMBER for all, COLUMN=NUMBER for one; 0 where nothing is said."""
    limits: dict[str, float] = dict.fromkeys(columns, 0.0)
    own: dict[str, float] = {}
    for text in within:
        column, named, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = -1.0
        if not 0.0 <= value < np.inf:
            raise InputError(f"--within {text}: write a number that is not below 0, as 1e-6, or f1_mps2=1e-6")
        if named and column not in limits:
            raise InputError(f"--within {text}: {column} is no column of both; {nearest(column, columns)}")
        own |= {column: value} if named else {}
        limits = limits if named else dict.fromkeys(columns, value)
    return limits | own


def _matched(
    name: str, table: pl.DataFrame, other: str, before: pl.DataFrame
) -> tuple[NDArray, NDArray, Literal["rows", "position", "time"]]:
    """Rows of the first that are compared; for each of them the row of the second (int), or the time [s] (float)."""
    if POSITION in table.columns and POSITION in before.columns:
        numbers = before[POSITION].to_list()
        pairs = [(k, numbers.index(n)) for k, n in enumerate(table[POSITION].to_list()) if n in numbers]
        if not pairs:
            raise InputError(f"{other}: has no position in common with {name}")
        kept, places = np.array(pairs, dtype=int).T
        return kept, places, "position"
    times = [t[TIME].to_numpy().astype(float) for t in (table, before)]
    if np.array_equal(times[0], times[1]):
        return np.arange(table.height), np.arange(table.height), "rows"
    kept = np.flatnonzero((times[0] >= times[1][0]) & (times[0] <= times[1][-1]))
    if not kept.size:
        raise InputError(f"{other}: has no time in common with {name}")
    return kept, times[0][kept], "time"


def read_table(source: Any) -> tuple[str, pl.DataFrame]:
    """A run or a record and what it is called: the folder of a run, a file, a table in memory, a record, a simulation.

    An InputError where it is none, has no times, or they run back.
    """
    if isinstance(source, str | Path):
        given = Path(source)
        name, table = str(given), _of_file(next((given / run for run in RUNS if (given / run).exists()), given))
    elif hasattr(source, "to_polars"):
        name, table = str(getattr(source, "path", None) or getattr(source, "title", "") or "a run"), source.to_polars()
    else:
        name, table = "a table", table_of(source)
        if not table.width:
            raise InputError(f"a run or a record is needed, not {type(source).__name__}")
    if TIME not in table.columns or not table.schema[TIME].is_numeric() or not table.height:
        raise InputError(f"{name}: has no times (column time_s); a run or a record is needed")
    time = table[TIME].to_numpy().astype(float)
    if not np.isfinite(time).all() or np.any(time[1:] < time[:-1]):
        raise InputError(f"{name}: time_s runs back, or is not known in every row")
    return name, table


def _of_file(path: Path) -> pl.DataFrame:
    data = bytes_of(path, "a run or the file of a record is needed")
    if data.startswith(MAGIC):
        if fault := fault_of_parquet(data):
            raise InputError(f"{path}: {fault}")
        return pl.read_parquet(io.BytesIO(data))
    try:
        data.decode("utf-8")
        table = pl.read_csv(io.BytesIO(data), comment_prefix="#", infer_schema_length=None)
    except (UnicodeDecodeError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{path}: is no table of a run or a record ({str(error).splitlines()[0][:100]})") from error
    return table.rename({column: column.strip() for column in table.columns})
