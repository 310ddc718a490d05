"""A user's request for a common set of positions, and its checks."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..calibration.model import Parametrisation, mountings_of, parametrise
from ..errors import InputError
from ..rounding import upwards
from .forms import DEFAULT_BOUNDS

MOST_STARTS, MOST_CUTS, MOST_EXTRA = 100_000, 100_000, 1000
"""Limits beyond which a search would take days: searches, cuts, extra positions."""
ERROR_UNITS = {"arcsec": math.pi / 648000.0, "urad": 1e-6, "ug": 1e-6, "ppm": 1e-6}
"""Units in which a user writes an accuracy, in rad, g or 1."""
UNITS_OF = {"rad": ("arcsec", "urad"), "g": ("ug",), "1": ("ppm",)}
"""Units of an angle, a specific force, a scale factor."""
FACES = (
    ("X17+X6+X8", "X18+X7+X12"),
    ("X17-X6-X8", "X18-X7-X12"),
    ("X16", "X18+X11+X13"),
    ("X16", "X18-X11-X13"),
    ("X16", "X17"),
)
"""Errors of the two horizontal accelerometers while the third axis is vertical: axes 1 and 2 up and down, axis 3."""
GOALS = {"levelling": "rad", "gyrocompass": "rad"}
"""Unit of the error of each correction."""
LATITUDE_DEG = 55.75


@dataclass(frozen=True)
class Request:
    """A user's request for a common set of positions, angles in degrees: the options of `library.plan_positions`."""

    criterion: str = "worst"
    reserve_deg: float = 0.0
    resolution_deg: float | None = None
    keep_out: Sequence[str] = ()
    order: str = "tour"
    repeat: int = 0
    detect: Sequence[str] = ()
    extra: int = 6
    seed: int = 0
    starts: int = 30
    cuts: int = 40
    admissible: str = "paper"
    bounds: tuple[float, float] = DEFAULT_BOUNDS
    convention: str = "A1"
    baseline: str = "asymmetric"
    mountings: Sequence[Mapping[str, ArrayLike] | str] = ("identity",)
    targets: Sequence[str] = ()
    goal: str | None = None
    measured: str | Path | None = None
    accuracy: str | None = None
    noise_bound: float = 1e-5
    latitude_deg: float | None = None
    rate_dps: float | None = None
    acceleration_dps2: float | None = None

    @property
    def any_number(self) -> bool:
        """True if any number of positions may do: for the user's own targets, or beside a measurement."""
        return bool(self.targets or self.goal or self.measured)

    @property
    def latitude(self) -> float:
        """Latitude of the gyrocompass [deg]."""
        return LATITUDE_DEG if self.latitude_deg is None else self.latitude_deg

    @property
    def magnified(self) -> float:
        """Ratio of the goal's error to the level's error: tan of the latitude for an azimuth."""
        if self.goal != "gyrocompass":
            return 1.0
        return abs(math.tan(math.radians(self.latitude)))

    @property
    def expressions(self) -> tuple[str, ...]:
        """The user's targets, or those of the goal; empty for all targets of the convention."""
        if self.goal is None:
            return tuple(self.targets)
        return tuple(dict.fromkeys(np.ravel(FACES).tolist()))

    @property
    def unit(self) -> str:
        """Unit in which the accuracy is written; empty without one."""
        text = self.accuracy or ""
        return next((unit for unit in ERROR_UNITS if text.endswith(unit)), "")

    @property
    def largest_error(self) -> float:
        """Return the accuracy as an error [σ].

        Raises InputError for a text that is not an accuracy.
        """
        text = self.accuracy or ""
        try:
            error = float(text.removesuffix(self.unit)) * ERROR_UNITS.get(self.unit, 1.0)
        except ValueError:
            error = math.nan
        if not 0.0 < error < math.inf:
            units = ", ".join(ERROR_UNITS)
            raise InputError(f"--accuracy {text!r}: must be a positive number, alone or of {units}: 7arcsec")
        return error / self.noise_bound

    def check_unit(self, physical: str) -> None:
        """Refuse an accuracy that is not in a unit of rad, g or 1."""
        fitting = UNITS_OF.get(physical, ())
        if self.unit and fitting and self.unit not in fitting:
            raise InputError(
                f"--accuracy {self.accuracy}: the error is one of {physical}; write it in {' or '.join(fitting)}"
            )

    def error_text(self, error: float, rounded: Callable[..., str] = upwards) -> str:
        """Return an error [σ] in the unit of the accuracy, rounded up or by `rounded`."""
        return f"{rounded(error * self.noise_bound / ERROR_UNITS.get(self.unit, 1.0), 4)} {self.unit}".strip()

    def check(self) -> None:
        """Refuse options that no plan can fulfil.

        Raises InputError of one line that names the option.
        """
        self._check_words()
        self._check_numbers()
        if self.latitude_deg is not None and self.goal != "gyrocompass":
            raise InputError("--latitude-deg: goes with --goal gyrocompass")
        if self.goal is not None and self.targets:
            raise InputError("--goal and --target: give one of the two")
        for text in self.keep_out:
            parsed_keep_out(text)

    def _check_words(self) -> None:
        # values that a plan's file may contain; other values come from options with a list of choices
        for name, words in {"convention": ("A1", "A2"), "baseline": ("asymmetric", "symmetric")}.items():
            word = getattr(self, name)
            if word not in words:
                raise InputError(f"--{name} {word}: must be one of {', '.join(words)}")

    def _check_numbers(self) -> None:
        if not 0.0 <= self.reserve_deg <= 10.0:
            raise InputError(f"--reserve {self.reserve_deg:g}: must be between 0 and 10 degrees")
        if self.resolution_deg is not None and not 1e-6 <= self.resolution_deg <= 30.0:
            raise InputError(f"--resolution {self.resolution_deg:g}: must be between 1e-6 and 30 degrees")
        if not abs(self.latitude) <= 89.0:
            raise InputError(f"--latitude-deg {self.latitude:g}: must be from -89 to 89")
        ranges = {
            "starts": (1, MOST_STARTS),
            "cuts": (0, MOST_CUTS),
            "extra": (0, MOST_EXTRA),
            "seed": (0, 2**31 - 1),
        }
        for name, (least, most) in ranges.items():
            number = getattr(self, name)
            if not least <= number <= most:
                raise InputError(f"--{name} {number}: must be from {least} to {most}")
        for name, most in {"noise_bound": 1e-2, "rate_dps": 1e4, "acceleration_dps2": 1e6}.items():
            number = getattr(self, name)
            if number is not None and not 0.0 < number <= most:
                option = name.replace("_", "-")
                raise InputError(f"--{option} {number:g}: must be positive, and at most {most:g}")

    def parametrisation(self) -> Parametrisation:
        """Return the parameters with all mountings.

        Raises InputError for a mounting that is unusable, occurs twice or names no file.
        """
        matrices: dict[str, NDArray] = {}
        for mounting in self.mountings:
            for name, matrix in mountings_of(mounting).items():
                if name in matrices:
                    raise InputError(f"--mountings: {name} is given twice")
                if not name.replace("-", "").replace("_", "").isalnum():
                    raise InputError(f"--mountings: '{name}' cannot name files; use letters, digits, - and _")
                matrices[name] = matrix
        return parametrise(matrices, symmetric=self.baseline == "symmetric")


def parsed_keep_out(text: str) -> tuple[int, float, float]:
    """Return axis, low and high [rad] of a keep-out in a user's notation: "alpha:100:150".

    Raises InputError unless it is an axis and two angles, the second above the first, less than a turn apart.
    """
    where, parts = f"--keep-out {text!r}", text.split(":")
    if len(parts) != 3 or parts[0] not in ("alpha", "beta"):
        raise InputError(f"{where}: write alpha:LOW:HIGH or beta:LOW:HIGH, in degrees")
    try:
        low, high = float(parts[1]), float(parts[2])
    except ValueError:
        raise InputError(f"{where}: LOW and HIGH must be numbers of degrees") from None
    if not (np.isfinite([low, high]).all() and 0.0 < high - low < 360.0):
        raise InputError(f"{where}: HIGH must be above LOW by less than 360")
    return ("alpha", "beta").index(parts[0]), float(np.radians(low)), float(np.radians(high))
