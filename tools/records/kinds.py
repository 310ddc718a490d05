"""The three kinds of record as values: SI and radians, a numpy array for each group of columns."""

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..shown import Shown

if TYPE_CHECKING:
    from polars import DataFrame


@dataclass(frozen=True)
class DwellNoise:
    """Allan deviation of the three accelerometers [m/s²] at the averaging time of a rest [s]."""

    dwell_s: float
    deviation: tuple[float, float, float]


def _no_rows() -> np.ndarray:
    return np.zeros(0, dtype=np.int64)


def _shaped(record: Any, shapes: dict[str, tuple[int, ...]]) -> None:
    """Make the fields arrays of N rows and the shapes given; number the rows where they are not numbered."""
    count = len(record.time_s)
    if record.row.size == 0:
        object.__setattr__(record, "row", np.arange(1, count + 1))
    for name, shape in {**shapes, "row": ()}.items():
        value = getattr(record, name)
        if value is None:
            continue
        kind = np.int64 if name in ("position", "row") else np.float64
        array = np.asarray(value, dtype=kind)
        if array.shape != (count, *shape):
            raise ValueError(f"{name} has the shape {array.shape}, where time_s asks for {(count, *shape)}")
        object.__setattr__(record, name, array)


def _lines(record: Any, kind: str) -> list[str]:
    span = f", {record.time_s[-1] - record.time_s[0]:.6g} s" if len(record) else ""
    return [f"{record.path}: {kind} of {len(record)} rows{span}", *(f"warning: {text}" for text in record.warnings)]


@dataclass(frozen=True, eq=False, repr=False)
class PositionRecord(Shown):
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
    row : ndarray of int, shape (N,)
        line of the file, as an editor counts; 1, 2, ... when the record has no file
    path : Path
        where it came from
    warnings : tuple of str
        what a person should be told
    scatter : ndarray, shape (N, 3), or None
        for a record made from rests: standard error of each mean, from the scatter within its rest [m/s²]
    dwell_noise : DwellNoise or None
        for a record made from rests, where they are long enough to tell
    sha256 : str
        of the file's bytes, in hexadecimal; empty when the record has no file
    """

    position: np.ndarray
    time_s: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    specific_force: np.ndarray
    temperature: np.ndarray | None = None
    approach_alpha: np.ndarray | None = None
    approach_beta: np.ndarray | None = None
    mounting: tuple[str, ...] | None = None
    resolution: float = 0.0
    angle_resolution: float = 0.0
    temperature_resolution: float = 0.0
    row: np.ndarray = field(default_factory=_no_rows)
    path: Path = Path("record")
    warnings: tuple[str, ...] = ()
    scatter: np.ndarray | None = None
    dwell_noise: DwellNoise | None = None
    sha256: str = ""

    def __post_init__(self) -> None:
        columns = ("position", "alpha", "beta", "temperature", "approach_alpha", "approach_beta", "time_s")
        _shaped(self, {**dict.fromkeys(columns, ()), "specific_force": (3,), "scatter": (3,)})
        if self.mounting is not None and len(self.mounting) != len(self.time_s):
            raise ValueError(f"{len(self.mounting)} names of mountings for {len(self.time_s)} rows")

    def written_to(self, gravity: float) -> float:
        """By how much rounding on paper may move a reading and the input of its two angles, fractions of `gravity`."""
        return self.resolution / gravity + 2.0 * self.angle_resolution

    def lines(self) -> list[str]:
        """What it is, and what a person should be told of it."""
        return _lines(self, "position record")

    def to_polars(self) -> "DataFrame":
        """The columns that its file has, angles in degrees."""
        from .frames import frame_of

        record: Any = self
        return frame_of(record)

    def __len__(self) -> int:
        return len(self.position)

    def selected(self, index: np.ndarray) -> "PositionRecord":
        """The same record with the rows that a mask or an index array selects, in that order."""
        index = np.arange(len(self))[index]
        changed: dict[str, Any] = {}
        for column in fields(self):
            value = getattr(self, column.name)
            if isinstance(value, np.ndarray):
                changed[column.name] = value[index]
        if self.mounting is not None:
            changed["mounting"] = tuple(self.mounting[k] for k in index)
        return replace(self, **changed)


@dataclass(frozen=True, eq=False, repr=False)
class RawRecord(Shown):
    """The time series of a table run, slews included.

    Attributes
    ----------
    time_s, alpha, beta : ndarray, shape (N,)
        [s]; encoder readings of the outer (α) and the inner axis (β) [rad]
    specific_force : ndarray, shape (N, 3)
        readings of the three accelerometers, block frame [m/s²]
    temperature : ndarray, shape (N,), or None
        [°C]
    path, row, warnings, resolution, sha256
        as in PositionRecord
    """

    time_s: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    specific_force: np.ndarray
    temperature: np.ndarray | None = None
    path: Path = Path("record")
    row: np.ndarray = field(default_factory=_no_rows)
    warnings: tuple[str, ...] = ()
    resolution: float = 0.0
    sha256: str = ""

    def __post_init__(self) -> None:
        _shaped(self, {"time_s": (), "alpha": (), "beta": (), "temperature": (), "specific_force": (3,)})

    def lines(self) -> list[str]:
        """What it is, and what a person should be told of it."""
        return _lines(self, "raw record")

    def to_polars(self) -> "DataFrame":
        """The columns that its file has, angles in degrees."""
        from .frames import frame_of

        record: Any = self
        return frame_of(record)

    def __len__(self) -> int:
        return len(self.time_s)


@dataclass(frozen=True, eq=False, repr=False)
class StrapdownRecord(Shown):
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
    attitude : ndarray, shape (N, 4), or None
        true attitude, unit quaternion, scalar first, body to reference; a row of NaN where it is not known
    temperature : ndarray, shape (N,), or None
        [°C]
    path, row, warnings, sha256
        as in PositionRecord
    """

    time_s: np.ndarray
    rate: np.ndarray | None
    increment: np.ndarray | None
    specific_force: np.ndarray
    attitude: np.ndarray | None = None
    temperature: np.ndarray | None = None
    path: Path = Path("record")
    row: np.ndarray = field(default_factory=_no_rows)
    warnings: tuple[str, ...] = ()
    sha256: str = ""

    def __post_init__(self) -> None:
        if (self.rate is None) == (self.increment is None):
            raise ValueError("a strapdown record has either rates or increments")
        shapes = {"rate": (3,), "increment": (3,), "specific_force": (3,), "attitude": (4,)}
        _shaped(self, {"time_s": (), "temperature": (), **shapes})

    def lines(self) -> list[str]:
        """What it is, and what a person should be told of it."""
        return _lines(self, "strapdown record")

    def to_polars(self) -> "DataFrame":
        """The columns that its file has, angles in degrees."""
        from .frames import frame_of

        record: Any = self
        return frame_of(record)

    def __len__(self) -> int:
        return len(self.time_s)
