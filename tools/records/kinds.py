"""The kinds of record as values: SI and radians, a numpy array for each group of columns; and written as CSV."""

import csv
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Self, cast

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..files import whole_file
from ..memory import once
from .channels import Channels
from .columns import (
    ANGLES,
    APPROACH,
    CORRECTED_WITHIN,
    FACE,
    FORCE,
    INCREMENT,
    MOUNTING,
    PART,
    QUATERNION,
    RATE,
    TEMPERATURE,
    TEXTS,
    TURN,
    UP,
    VELOCITY,
    comment_lines,
    knocks_of,
)
from .decisions import Decisions
from .steps import AngleSteps, angle_steps

if TYPE_CHECKING:
    from polars import DataFrame


@dataclass(frozen=True)
class DwellNoise:
    """Allan deviation of the three accelerometers [m/s²] at the averaging time of a rest [s]."""

    dwell_s: float
    deviation: tuple[float, float, float]


@dataclass(frozen=True)
class Rest:
    """A rest of the table in a raw record; rows are indices into the record's arrays, both ends included.

    The table stands from `first` to `last`; averaged are the rows kept: settled, and not next to a move. `refused` says
    why the rest is not used, `trends` what still changes linearly over the rows kept, with its size.
    """

    first: int
    last: int
    kept_first: int
    kept_last: int
    refused: str | None = None
    trends: tuple[str, ...] = ()

    @property
    def kept(self) -> slice:
        """The rows that are averaged."""
        return slice(self.kept_first, self.kept_last + 1)


def _no_rows() -> NDArray:
    return np.zeros(0, dtype=np.int64)


def degrees_that_read_back(angle: NDArray) -> NDArray:
    """Return degrees with the fewest decimals whose conversion to radians gives the same doubles.

    Not every double in radians has such a degree (the spacing of doubles is wider in degrees for one in ten);
    there it is the nearest.
    """
    result = np.rad2deg(angle)
    nearest = result.copy()
    open_ = np.ones(angle.shape, dtype=bool)
    rounded = [np.round(nearest, decimals) for decimals in range(14)]
    rounded += [nearest, np.nextafter(nearest, np.inf), np.nextafter(nearest, -np.inf)]
    for candidate in rounded:
        hit = open_ & (np.deg2rad(candidate) == angle)
        result[hit] = candidate[hit]
        open_ &= ~hit
    return result


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class _Origin:
    """Source of a record, and the way it was read.

    Attributes
    ----------
    path : Path
        source of the record
    row : ndarray of int, shape (N,)
        line of the file, as an editor counts; 1, 2, ... when the record has no file
    warnings : tuple of str
        warnings for a person
    sha256 : str
        SHA-256 of the file's bytes, in hexadecimal; empty when the record has no file
    about : dict
        key -> value of the comment lines of its file: serial number, operator, date
    channels : Channels or None
        channel assignment of the file, where given
    aside : ndarray of bool, shape (N,), or None
        rows of a series that are not used
    decisions : Decisions or None
        a person's decisions about its rows or rests
    """

    path: Path = Path("record")
    row: NDArray = field(default_factory=_no_rows)
    warnings: tuple[str, ...] = ()
    sha256: str = ""
    about: Mapping[str, str] = field(default_factory=dict)
    channels: Channels | None = None
    aside: NDArray | None = None
    decisions: Decisions | None = None


class _Record(_Origin):
    """Common base of the kinds: arrays of one length, columns of a file, a line for a person."""

    word: ClassVar[str]
    groups: ClassVar[dict[str, tuple[str, ...]]]
    """Field -> its columns in a file, in their order; one column is an array (N,), several are (N, columns)."""
    time_s: NDArray
    specific_force: NDArray

    def __post_init__(self) -> None:
        count = len(self)
        if self.row.size == 0:
            object.__setattr__(self, "row", np.arange(1, count + 1))
        if np.size(getattr(self, "numbers", self.row)) != count:
            # Rows put together from several records count anew.
            object.__setattr__(self, "numbers", np.arange(1, count + 1))
        for name, columns in {**self.groups, "scatter": FORCE, "row": ("row",), "numbers": ("numbers",)}.items():
            value = getattr(self, name, None)
            if value is None:
                continue
            if columns[0] in TEXTS:
                if len(value) != count:
                    raise ValueError(f"{len(value)} words of {name} for {count} rows")
                continue
            if name in ("position", "row", "numbers"):
                number_type = np.int64
            else:
                number_type = np.float64
            array = np.asarray(value, dtype=number_type)
            if len(columns) == 1:
                shape = (count,)
            else:
                shape = (count, len(columns))
            if array.shape != shape:
                raise ValueError(f"{name} has the shape {array.shape}, where the record has {count} rows")
            object.__setattr__(self, name, array)

    def __len__(self) -> int:
        return len(self.specific_force)

    @cached_property
    def knocks(self) -> NDArray:
        """Rows (N,) with readings beyond 10 times gravity, or set aside; no rest or move with them is used."""
        knocks = once(knocks_of, self.specific_force)
        return knocks if self.aside is None else knocks | self.aside

    def read_with(self, channels: Channels) -> Self:
        """The record as its file is read with these channels; an InputError for channels that it does not have."""
        usual = Channels()
        if not hasattr(self, "rate") and (channels.degrees or channels.gyros != usual.gyros):
            raise InputError(f"--channels w=...: {self.path} has no gyros")
        if not hasattr(self, "alpha") and (channels.radians or channels.alpha < 0 or channels.beta < 0):
            raise InputError(f"--channels alpha=-1, beta=-1 or angles=rad: {self.path} has no angles of a table")
        of_forces, of_gyros = channels.of_accelerometers, channels.of_gyros
        matrices = {
            "specific_force": of_forces,
            "velocity_increment": of_forces,
            "scatter": np.abs(of_forces),
            "rate": of_gyros,
            "increment": of_gyros,
        }
        size = 180.0 / math.pi if channels.radians else 1.0
        factors = {
            "alpha": channels.alpha * size,
            "beta": channels.beta * size,
            "angle_resolution": size,
            "approach_alpha": channels.alpha,
            "approach_beta": channels.beta,
        }
        changed: dict[str, Any] = {}
        for name, matrix in matrices.items():
            if getattr(self, name, None) is not None:
                changed[name] = getattr(self, name) @ matrix.T
        for name, factor in factors.items():
            if getattr(self, name, None) is not None:
                changed[name] = factor * getattr(self, name)
        if isinstance(noise := getattr(self, "dwell_noise", None), DwellNoise):
            changed["dwell_noise"] = replace(noise, deviation=tuple((np.abs(of_forces) @ noise.deviation).tolist()))
        options = f"{self.path}: read as it stands, as said"
        if channels.options:
            options = f"{self.path}: read with {channels}"
        if isinstance(raw := getattr(self, "raw", None), RawRecord):
            changed["raw"] = raw.read_with(channels)
        warnings = []
        for line in self.warnings:
            if not (channels.radians and "are they radians?" in line):
                warnings.append(line)
        changed |= {"warnings": (*warnings, options), "channels": channels.after(self.channels or Channels())}
        return replace(cast("Any", self), **changed)

    def selected(self, index: NDArray) -> Self:
        """The same record with the rows that a mask or an index array selects, in that order."""
        index = np.arange(len(self))[index]
        changed: dict[str, Any] = {}
        for column in fields(cast("Any", self)):
            value = getattr(self, column.name)
            if isinstance(value, np.ndarray):
                changed[column.name] = value[index]
            elif value is not None and self.groups.get(column.name, ("",))[0] in TEXTS:
                changed[column.name] = tuple(value[k] for k in index)
        return replace(cast("Any", self), **changed)

    def __str__(self) -> str:
        span = ""
        if len(self) and self.time_s is not None:
            span = f", {self.time_s[-1] - self.time_s[0]:.6g} s"
        lines = (f"warning: {text}" for text in self.warnings)
        return "\n".join([f"{self.path}: {self.word} of {len(self)} rows{span}", *lines])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return self.to_polars()._repr_html_()

    def columns(self) -> dict[str, Any]:
        """The columns that its file has, by their names: angles in degrees, NaN where an attitude is not known."""
        table: dict[str, Any] = {}
        for name, columns in self.groups.items():
            value = getattr(self, name)
            if value is None:
                continue
            if name in ("alpha", "beta"):
                value = degrees_that_read_back(value)
            elif columns[0] in APPROACH:
                value = value.astype(np.int64)
            elif columns == QUATERNION:
                value = np.where(np.isfinite(value).all(axis=1, keepdims=True), value, np.nan)
            single = len(columns) == 1
            table |= {column: value if single else value[:, axis] for axis, column in enumerate(columns)}
        return table

    def to_polars(self) -> "DataFrame":
        """Its `columns` as a table; an attitude that is not known is null."""
        import polars as pl

        table = pl.DataFrame({k: list(v) if k in TEXTS else v for k, v in self.columns().items()})
        quaternion = [name for name in QUATERNION if name in table.columns]
        if quaternion:
            return table.with_columns(pl.col(quaternion).fill_nan(None))
        return table


@dataclass(frozen=True, eq=False, repr=False)
class RawRecord(_Record):
    """The time series of a table run, slews included.

    Attributes
    ----------
    time_s, alpha, beta : ndarray, shape (N,)
        [s]; encoder readings of the outer (α) and the inner axis (β) [rad]
    specific_force : ndarray, shape (N, 3)
        readings of the three accelerometers, block frame [m/s²]
    temperature : ndarray, shape (N,), or None
        [°C]
    resolution
        as in PositionRecord
    path, row, warnings, sha256, about, channels
        source of the record, and the way it was read
    """

    word = "raw record"
    groups: ClassVar = {
        "time_s": ("time_s",),
        "alpha": ANGLES[:1],
        "beta": ANGLES[1:],
        "specific_force": FORCE,
        "temperature": (TEMPERATURE,),
    }

    time_s: NDArray
    alpha: NDArray
    beta: NDArray
    specific_force: NDArray
    temperature: NDArray | None = None
    resolution: float = 0.0


@dataclass(frozen=True, eq=False, repr=False)
class BenchRecord(RawRecord):
    """A raw record with gyros; exactly one of `rate` and `increment` is given.

    Attributes
    ----------
    rate, increment : ndarray, shape (N, 3), or None
        as in StrapdownRecord
    others
        as in RawRecord
    """

    word = "bench record"
    groups: ClassVar = {**RawRecord.groups, "rate": RATE, "increment": INCREMENT}

    rate: NDArray | None = None
    increment: NDArray | None = None

    def __post_init__(self) -> None:
        if (self.rate is None) == (self.increment is None):
            raise ValueError("a bench record has either rates or increments")
        super().__post_init__()

    @property
    def gyros(self) -> "StrapdownRecord":
        """Return the readings of gyros and accelerometers, without the angles."""
        shared = {of.name: getattr(self, of.name) for of in fields(StrapdownRecord) if hasattr(self, of.name)}
        return StrapdownRecord(**shared)


@dataclass(frozen=True, eq=False, repr=False)
class PositionRecord(_Record):
    """One averaged row for each rest of the table.

    Attributes
    ----------
    position : ndarray of int, shape (N,)
        counts the positions in the order of measurement, from 1
    time_s : ndarray, shape (N,)
        middle of the averaging interval [s]
    alpha, beta : ndarray, shape (N,)
        encoder readings of the outer (α) and the inner axis (β) [rad]
    specific_force : ndarray, shape (N, 3)
        averaged readings of the three accelerometers, block frame [m/s²]
    temperature : ndarray, shape (N,), or None
        [°C]
    approach_alpha, approach_beta : ndarray, shape (N,), or None
        +1 or -1: sense of the last move of that axis
    mounting : tuple of str or None
        name of the mounting in each row
    resolution : float
        half a last digit of the readings as they were written [m/s²]; 0 where they are exact doubles
    angle_resolution : float
        half a last digit of the angles as they were written [rad]; 0 where they are exact
    temperature_resolution : float
        half a last digit of the temperature as it was written [K]
    steps : AngleSteps
        steps of the encoders whose rounding is in the bounds; none by default
    path, row, warnings, sha256, about, channels
        source of the record, and the way it was read
    scatter : ndarray, shape (N, 3), or None
        for a record made from rests: standard error of each mean, from the scatter within its rest [m/s²]
    dwell_noise : DwellNoise or None
        for a record made from rests, where they are long enough to tell
    raw : RawRecord or None
        its raw record, with all the `rests` of the table, refused ones too
    numbers : ndarray of int, shape (N,)
        number of each row among the rows of readings in the file, from 1: answers name rows by it
    """

    word = "position record"
    groups: ClassVar = {
        "position": ("position",),
        "time_s": ("time_s",),
        "alpha": ANGLES[:1],
        "beta": ANGLES[1:],
        "specific_force": FORCE,
        "temperature": (TEMPERATURE,),
        "approach_alpha": APPROACH[:1],
        "approach_beta": APPROACH[1:],
        "mounting": (MOUNTING,),
    }

    position: NDArray
    time_s: NDArray
    alpha: NDArray
    beta: NDArray
    specific_force: NDArray
    temperature: NDArray | None = None
    approach_alpha: NDArray | None = None
    approach_beta: NDArray | None = None
    mounting: tuple[str, ...] | None = None
    resolution: float = 0.0
    angle_resolution: float = 0.0
    temperature_resolution: float = 0.0
    steps: AngleSteps = field(default_factory=AngleSteps)
    scatter: NDArray | None = None
    dwell_noise: DwellNoise | None = None
    raw: RawRecord | None = None
    rests: tuple[Rest, ...] = ()
    numbers: NDArray = field(default_factory=_no_rows)

    def bounds_with(self, noise_bound: float, gravity: float) -> NDArray:
        """Return the bound of each reading's error (3 N,), fractions of `gravity`.

        It is σ, the limit of a correction, and half a step of the encoders.
        """
        text = self.about.get(CORRECTED_WITHIN, "0 0 0")
        within = np.array([float(number) for number in text.split()])
        if self.channels is not None:
            within = np.full(3, within.max())
        return np.tile(noise_bound + self.steps.error + within / gravity, len(self))

    @property
    def poses(self) -> "PoseRecord":
        """The readings without the table's angles."""
        names = [each.name for each in fields(PoseRecord) if hasattr(self, each.name)]
        return PoseRecord(**{name: getattr(self, name) for name in names})

    @property
    def with_steps(self) -> Self:
        """The record with the rounding of its encoders in the bounds, if their steps show in its angles."""
        return replace(self, steps=angle_steps(self.alpha, self.beta))

    def written_to(self, gravity: float) -> float:
        """Return the largest effect of rounding on paper on a reading and its two angles, fractions of `gravity`."""
        return self.resolution / gravity + 2.0 * self.angle_resolution


@dataclass(frozen=True, eq=False, repr=False)
class StrapdownRecord(_Record):
    """Gyros and accelerometers of one block; exactly one of `rate` and `increment` is given.

    Attributes
    ----------
    time_s : ndarray, shape (N,)
        [s]
    rate : ndarray, shape (N, 3), or None
        angular rate, block frame [rad/s]
    increment : ndarray, shape (N, 3), or None
        integral of the rate over the interval that ends at `time_s` [rad]
    specific_force : ndarray, shape (N, 3)
        block frame [m/s²]
    velocity_increment : ndarray, shape (N, 3), or None
        beside `increment`: integral of the specific force over the same interval [m/s]
    attitude : ndarray, shape (N, 4), or None
        true attitude, unit quaternion, scalar first, body to reference; a row of NaN where it is not known
    temperature : ndarray, shape (N,), or None
        [°C]
    face, turn, part : tuple of str, or None
        axis of the case that points up in a row, as +1; known turn, as 1:360; or either by the name of a section
    path, row, warnings, sha256, about, channels
        source of the record, and the way in which it was read
    """

    word = "strapdown record"
    groups: ClassVar = {
        "time_s": ("time_s",),
        "rate": RATE,
        "increment": INCREMENT,
        "velocity_increment": VELOCITY,
        "specific_force": FORCE,
        "temperature": (TEMPERATURE,),
        "attitude": QUATERNION,
        "face": (FACE,),
        "turn": (TURN,),
        "part": (PART,),
    }

    time_s: NDArray
    rate: NDArray | None
    increment: NDArray | None
    specific_force: NDArray
    attitude: NDArray | None = None
    temperature: NDArray | None = None
    velocity_increment: NDArray | None = None
    face: tuple[str, ...] | None = None
    turn: tuple[str, ...] | None = None
    part: tuple[str, ...] | None = None

    def __post_init__(self) -> None:
        if (self.rate is None) == (self.increment is None):
            raise ValueError("a strapdown record has either rates or increments")
        super().__post_init__()


@dataclass(frozen=True, eq=False, repr=False)
class ForceRecord(_Record):
    """Accelerometers of a block alone, in time, in any poses.

    Attributes
    ----------
    time_s : ndarray, shape (N,)
        [s]
    specific_force : ndarray, shape (N, 3)
        block frame [m/s²]
    temperature : ndarray, shape (N,), or None
        [°C]
    face, turn, part : tuple of str, or None
        as of StrapdownRecord
    path, row, warnings, sha256, about, channels
        source of the record, and the way it was read
    """

    word = "accelerometer record"
    groups: ClassVar = {
        "time_s": ("time_s",),
        "specific_force": FORCE,
        "temperature": (TEMPERATURE,),
        "face": (FACE,),
        "turn": (TURN,),
        "part": (PART,),
    }

    time_s: NDArray
    specific_force: NDArray
    temperature: NDArray | None = None
    face: tuple[str, ...] | None = None
    turn: tuple[str, ...] | None = None
    part: tuple[str, ...] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class PoseRecord(_Record):
    """One averaged row of accelerometers for each pose, without a table's angles.

    Attributes
    ----------
    position : ndarray of int, shape (N,)
        counts the poses, from 1
    specific_force : ndarray, shape (N, 3)
        averaged readings, block frame [m/s²]
    time_s : ndarray, shape (N,), or None
        [s]
    temperature : ndarray, shape (N,), or None
        [°C]
    face : tuple of str, or None
        axis of the case that points up, as +1
    up : ndarray, shape (N, 3), or None
        the vertical in the axes of the case, NaN where it is not known
    scatter : ndarray, shape (N, 3), or None
        standard error of each mean [m/s²]
    path, row, warnings, sha256, about, channels
        source of the record, and the way it was read
    numbers : ndarray of int, shape (N,)
        as of PositionRecord
    """

    word = "pose record"
    groups: ClassVar = {
        "position": ("position",),
        "time_s": ("time_s",),
        "specific_force": FORCE,
        "temperature": (TEMPERATURE,),
        "face": (FACE,),
        "up": UP,
    }

    position: NDArray
    specific_force: NDArray
    time_s: NDArray | None = None  # type: ignore[assignment]
    temperature: NDArray | None = None
    face: tuple[str, ...] | None = None
    up: NDArray | None = None
    scatter: NDArray | None = None
    numbers: NDArray = field(default_factory=_no_rows)


LONG = 500_000
"""Rows from which a record is written in columns."""


def write_record(
    record: "PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord",
    path: Path,
    decimals: int | None = None,
) -> None:
    """Write a record as CSV with its metadata as comment lines; unknown attitudes are empty fields.

    Parameters
    ----------
    record : record of any kind
        the record to write; row numbers, warnings and scatter are not written
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
    if len(record) > LONG and decimals is None and _written_long(record, path):
        return
    texts: dict[str, list[str]] = {}
    for name, values in record.columns().items():
        if not isinstance(values, np.ndarray) or values.dtype == np.int64:
            texts[name] = [str(value) for value in values]
            continue
        finite = np.isfinite(values)
        if name not in (*QUATERNION, *UP) and not finite.all():
            raise InputError(f"{path}: not written: {name} holds a number that is not finite")
        written = [repr(v) if decimals is None else f"{v:z.{decimals}f}" for v in values.tolist()]
        texts[name] = [text if is_known else "" for text, is_known in zip(written, finite.tolist(), strict=True)]
    time = np.array([float(text) for text in texts.get("time_s", ())])
    if np.any(time[1:] <= time[:-1]):
        raise InputError(f"{path}: not written: time_s does not grow from row to row as it would be written")
    if Path(path).suffix.lower() == ".parquet":
        raise InputError(f"{path}: records are written as CSV; give a name that ends with .csv")
    table = io.StringIO()
    table.write(comment_lines(record.about))
    writer = csv.writer(table, lineterminator="\n")
    writer.writerow(texts)
    writer.writerows(zip(*texts.values(), strict=True))
    with whole_file(Path(path)) as file:
        file.write_text(table.getvalue(), encoding="utf-8", newline="")


def _written_long(
    record: "PositionRecord | RawRecord | StrapdownRecord | ForceRecord | PoseRecord", path: Path
) -> bool:
    """Write a long series of numbers that are all known, in columns; return False for any other record."""
    import polars as pl

    columns = record.columns()
    for values in columns.values():
        if not isinstance(values, np.ndarray) or values.dtype != np.float64 or not np.isfinite(values).all():
            return False
    if Path(path).suffix.lower() != ".csv" or np.any(np.diff(columns.get("time_s", np.zeros(1))) <= 0.0):
        return False
    with whole_file(Path(path)) as file, file.open("wb") as out:
        out.write(comment_lines(record.about).encode())
        pl.DataFrame(columns).write_csv(out)
    return True
