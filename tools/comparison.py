"""Compare two runs or records column by column: size and time of the differences."""

import hashlib
import io
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import polars as pl
from numpy.typing import NDArray
from pydantic import Field

from .errors import InputError, nearest
from .files import MAGIC, advice_on, bytes_of, fault_of_parquet
from .quantity import Quantity
from .records.columns import INCREMENT
from .records.decisions import Decisions, read_decisions
from .records.read import table_in_memory
from .result import Result

PERIODS = {"deg": 360.0, "rad": math.tau, "arcmin": 21_600.0, "arcsec": 1_296_000.0}
"""Unit behind the name of an angle -> a whole turn."""
UNIT_LENGTH = 1e-3
"""Four columns are a quaternion where their squares sum to 1 within this in every row."""
TIME, POSITION = "time_s", "position"
LARGEST = float(np.finfo(float).max)
RUNS = ("run.parquet", "run.csv")
"""Files of records in the folder of a run."""


class Difference(Result):
    """Difference of a column, second minus first, in the unit of its name.

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
        true if the largest is within the limit and no value is missing
    """

    column: Annotated[str, Quantity("column")]
    largest: Annotated[float, Quantity("largest difference", "", "up", 3)]
    rms: Annotated[float, Quantity("root mean square", "", "nearest")]
    time_s: Annotated[float, Quantity("at", "s", "exact", 9)]
    first: Annotated[float, Quantity("first", "", "nearest", 6)]
    second: Annotated[float, Quantity("second", "", "nearest", 6)]
    one_only: int
    within: bool


class Compared(Result):
    """Two runs or records held against each other.

    Attributes
    ----------
    verdict : str
        "same" if every column is within its limit, and both have the same columns
    first, second : str
        their names
    rows : int
        number of rows compared
    matched : str
        by what rows belong together: "rows" of the same times, "position" numbers, or "time", the second interpolated
    columns : list of Difference
    only_first, only_second, not_compared : list of str
        columns that only one has, and those that are no numbers
    differences : polars.DataFrame
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

    def to_polars(self) -> pl.DataFrame:
        """A row for each column, with the fields of `Difference`."""
        return pl.DataFrame([difference.to_json() for difference in self.columns])


def compare(first: Any, second: Any, within: Sequence[str]) -> Compared:
    """Compare two runs or records column by column; see `trihedron.compare`."""
    first_name, left = table_of_run(first)
    second_name, right = table_of_run(second)
    numbers, not_compared = _columns_of_both(left, right)
    if not numbers:
        raise InputError(f"{second_name}: has no column of numbers in common with {first_name}")
    limits = limits_of(within, numbers)
    rows, places, matched = _matched(first_name, left, second_name, right)
    time = left[TIME].to_numpy()[rows].astype(float)
    quaternions = _quaternions(numbers, left, right)
    values_of_first = {column: left[column].cast(pl.Float64).to_numpy()[rows] for column in numbers}
    values_of_second = _values_at(right, numbers, quaternions, places, by_time=matched == "time")
    for names in quaternions:
        _turn_to(names, values_of_first, values_of_second)
    columns, differences = [], {TIME: time}
    for column in numbers:
        of_first, of_second = values_of_first[column], values_of_second[column]
        difference = _difference(of_first, of_second, _period(column))
        columns.append(_judged(column, time, (of_first, of_second, difference), limits[column]))
        differences[column] = difference
    only_first, only_second = _only(left, right), _only(right, left)
    same_rows = len(rows) == left.height == right.height
    same = same_rows and not only_first and not only_second and all(column.within for column in columns)
    return Compared(
        verdict="same" if same else "different",
        first=first_name,
        second=second_name,
        rows=len(rows),
        matched=matched,
        columns=columns,
        only_first=only_first,
        only_second=only_second,
        not_compared=not_compared,
        differences=pl.DataFrame(differences),
    )


def _columns_of_both(left: pl.DataFrame, right: pl.DataFrame) -> tuple[list[str], list[str]]:
    """Return the columns of both tables except times and positions: numeric ones, and the others."""
    numbers, words = [], []
    for column in left.columns:
        if column in right.columns and column not in (TIME, POSITION):
            kinds = left.schema[column], right.schema[column]
            numeric = all(kind.is_numeric() or kind == pl.Boolean for kind in kinds)
            (numbers if numeric else words).append(column)
    return numbers, words


def _only(table: pl.DataFrame, partner: pl.DataFrame) -> list[str]:
    """Columns that the partner has not, but times and positions."""
    return [column for column in table.columns if column not in (*partner.columns, TIME, POSITION)]


def _period(column: str) -> float | None:
    """A whole turn in the unit of a column of angles; None of others, and of increments, which add up."""
    unit = re.search(r"(?:_|\[|\()([a-z]+)[\])]?$", column)
    if unit is None or column in INCREMENT:
        return None
    return PERIODS.get(unit[1])


def _quaternions(columns: Sequence[str], left: pl.DataFrame, right: pl.DataFrame) -> list[tuple[str, ...]]:
    """Names of four columns that are numbered in a row and have unit length in all rows of both tables."""
    stems: dict[str, list[str]] = {}
    for column in columns:
        numbered = re.fullmatch(r"(.*?)\[?([0-4])\]?", column)
        if numbered:
            stems.setdefault(numbered[1], []).append(column)
    quaternions = []
    for names in stems.values():
        if len(names) == 4 and _has_unit_length(left.select(names)) and _has_unit_length(right.select(names)):
            quaternions.append(tuple(names))
    return quaternions


def _has_unit_length(table: pl.DataFrame) -> bool:
    squares = np.square(table.cast(pl.Float64).to_numpy()).sum(axis=1)
    known = squares[np.isfinite(squares)]
    return bool(known.size) and bool(np.all(np.abs(known - 1.0) <= UNIT_LENGTH))


def _values_at(
    table: pl.DataFrame, columns: Sequence[str], quaternions: Sequence[Sequence[str]], places: NDArray, *, by_time: bool
) -> dict[str, NDArray]:
    """Values of the second in its rows, or at times: angles and quaternions are made steady before they are."""
    values = {column: table[column].cast(pl.Float64).to_numpy() for column in columns}
    if not by_time:
        return {column: of_column[places] for column, of_column in values.items()}
    for names in quaternions:
        steady = _steady(np.column_stack([values[name] for name in names]))
        values.update(zip(names, steady.T, strict=True))
    time = table[TIME].to_numpy()
    at_times = {}
    for column, of_column in values.items():
        period = _period(column)
        if period is not None:
            known = np.isfinite(of_column)
            of_column = of_column.copy()
            of_column[known] = np.unwrap(of_column[known], period=period)
        at_times[column] = np.interp(places, time, of_column)
    return at_times


def _steady(quaternions: NDArray) -> NDArray:
    """The same attitudes (N, 4), each with the sign that is nearer to the row before."""
    agree = np.sum(quaternions[1:] * quaternions[:-1], axis=1)
    signs = np.cumprod(np.where(agree < 0.0, -1.0, 1.0))
    return quaternions * np.concatenate([[1.0], signs])[:, None]


def _turn_to(names: Sequence[str], first: Mapping[str, NDArray], second: dict[str, NDArray]) -> None:
    """Give quaternions of the second the sign of the first: q and -q are one attitude."""
    agree = sum(first[name] * second[name] for name in names)
    sign = np.where(agree < 0.0, -1.0, 1.0)
    for name in names:
        second[name] = sign * second[name]


def _difference(first: NDArray, second: NDArray, period: float | None = None) -> NDArray:
    """The second less the first, of angles the shorter way round; NaN where either has no finite value."""
    with np.errstate(over="ignore", invalid="ignore"):
        # Numbers near the largest have differences that are none.
        difference = np.clip(second - first, -LARGEST, LARGEST)
        if period is not None:
            difference -= period * np.round(difference / period)
    difference[~(np.isfinite(first) & np.isfinite(second))] = np.nan
    return difference


def _judged(column: str, time: NDArray, values: tuple[NDArray, NDArray, NDArray], limit: float) -> Difference:
    """Return the difference of a column, from the values of both sources and their difference."""
    first, second, difference = values
    finite = np.isfinite(difference)
    one_only = int(np.count_nonzero(np.isfinite(first) != np.isfinite(second)))
    if not finite.any():
        zero = {"largest": 0.0, "rms": 0.0, "time_s": float(time[0]), "first": 0.0, "second": 0.0}
        return Difference(column=column, **zero, one_only=one_only, within=one_only == 0)
    size = np.where(finite, np.abs(difference), -1.0)
    at = int(np.argmax(size))
    largest = size[at]
    return Difference(
        column=column,
        largest=float(largest),
        rms=float(largest * np.sqrt(np.mean(np.square(size[finite] / (largest or 1.0))))),
        time_s=float(time[at]),
        first=float(first[at]),
        second=float(second[at]),
        one_only=one_only,
        within=bool(largest <= limit) and one_only == 0,
    )


def limits_of(within: Sequence[str], columns: list[str]) -> dict[str, float]:
    """Return the allowed difference of each column: NUMBER for all, COLUMN=NUMBER for one, 0 by default."""
    general = 0.0
    limits: dict[str, float] = {}
    for text in within:
        column, equals, number = text.rpartition("=")
        try:
            value = float(number)
        except ValueError:
            value = -1.0
        if not 0.0 <= value < np.inf:
            raise InputError(f"--within {text}: write a number that is not below 0, as 1e-6, or f1_mps2=1e-6")
        if equals and column not in columns:
            raise InputError(f"--within {text}: {column} is not a column of both; {nearest(column, columns)}")
        if equals:
            limits[column] = value
        else:
            general = value
    return dict.fromkeys(columns, general) | limits


def _matched(
    first_name: str, left: pl.DataFrame, second_name: str, right: pl.DataFrame
) -> tuple[NDArray, NDArray, Literal["rows", "position", "time"]]:
    """Rows of the first that are compared; for each of them the row of the second (int), or the time [s] (float)."""
    if POSITION in left.columns and POSITION in right.columns:
        numbers = right[POSITION].to_list()
        pairs = []
        for row, number in enumerate(left[POSITION].to_list()):
            if number in numbers:
                pairs.append((row, numbers.index(number)))
        if not pairs:
            raise InputError(f"{second_name}: has no position in common with {first_name}")
        rows, places = np.array(pairs, dtype=int).T
        return rows, places, "position"
    times, second_times = left[TIME].to_numpy().astype(float), right[TIME].to_numpy().astype(float)
    if np.array_equal(times, second_times):
        return np.arange(left.height), np.arange(left.height), "rows"
    rows = np.flatnonzero((times >= second_times[0]) & (times <= second_times[-1]))
    if not rows.size:
        raise InputError(f"{second_name}: has no time in common with {first_name}")
    return rows, times[rows], "time"


def table_of_run(source: Any) -> tuple[str, pl.DataFrame]:
    """Return name and table of a run or record: a run's folder, a file, a table in memory, a record, a simulation.

    An InputError where it is none, has no times, or they run back.
    """
    if isinstance(source, str | Path):
        path = Path(source)
        files = [path / run for run in RUNS if (path / run).exists()]
        table, decisions = _of_file(files[0] if files else path)
        name = f"{path} ({decisions})" if decisions else str(path)
    elif hasattr(source, "to_polars"):
        name = str(getattr(source, "path", None) or getattr(source, "title", "") or "a run")
        table = source.to_polars()
    else:
        name, table = "a table", table_in_memory(source)
        if not table.width:
            raise InputError(f"a run or a record is needed, not {type(source).__name__}")
    if TIME not in table.columns or not table.schema[TIME].is_numeric() or not table.height:
        raise InputError(f"{name}: has no times (column time_s); a run or a record is needed")
    time = table[TIME].to_numpy().astype(float)
    if not np.isfinite(time).all() or np.any(time[1:] < time[:-1]):
        raise InputError(f"{name}: time_s runs back, or is not known in every row")
    return name, table


def _of_file(path: Path) -> tuple[pl.DataFrame, Decisions | None]:
    """Return the table of a file, without the positions that are left out, and the decisions beside it."""
    data = bytes_of(path, "a run or the file of a record is needed")
    if data.startswith(MAGIC):
        if fault := fault_of_parquet(data):
            raise InputError(f"{path}: {fault}")
        return _decided(path, data, pl.read_parquet(io.BytesIO(data)))
    advice = advice_on(path, data, "record")
    if advice:
        raise InputError(f"{path}: is not a table of a run or a record{advice}")
    try:
        data.decode("utf-8")
        table = pl.read_csv(io.BytesIO(data), comment_prefix="#", infer_schema_length=None)
    except (UnicodeDecodeError, pl.exceptions.PolarsError) as error:
        raise InputError(f"{path}: is not a table of a run or a record ({str(error).splitlines()[0][:100]})") from error
    return _decided(path, data, table.rename({column: column.strip() for column in table.columns}))


def _decided(path: Path, data: bytes, table: pl.DataFrame) -> tuple[pl.DataFrame, Decisions | None]:
    decisions = read_decisions(path, hashlib.sha256(data).hexdigest())
    if decisions and "position" in table.columns:
        table = table.filter(~pl.col("position").is_in(decisions.left_out))
    return table, decisions
