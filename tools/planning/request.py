"""What is asked of a common set of positions."""

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
"""More searches, cuts or positions would not end within days."""
ACCURACY_UNITS = {"": 1.0, "arcsec": math.pi / 648000.0, "urad": 1e-6, "ug": 1e-6, "ppm": 1e-6}
"""What a wanted error may be written in, in rad, g or 1."""
UNITS_OF = {"rad": ("arcsec", "urad"), "g": ("ug",), "1": ("ppm",)}
"""Which of them are of an angle, of a specific force, of a scale factor."""
Groups = tuple[tuple[str, ...], ...]
"""Targets whose errors are taken together, as the root of the sum of their squares."""
FACES: Groups = (
    *(("X17+X6+X8", "X18+X7+X12"), ("X17-X6-X8", "X18-X7-X12")),
    *(("X16", "X18+X11+X13"), ("X16", "X18-X11-X13"), ("X16", "X17")),
)
"""What two accelerometers read too much while the axis of the third is vertical: axes 1 and 2 up and down, axis 3."""
GOALS = {"levelling": "rad", "gyrocompass": "rad"}
"""What errors of the corrections are."""


@dataclass(frozen=True)
class Request:
    """What a user asks of a common set of positions, angles in degrees: the options of `library.plan_positions`."""

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
    mountings: Sequence[Mapping[str, ArrayLike] | str, ...] = ("identity",)
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
        """Whether any number of positions may do: for targets of one's own, or beside what is measured."""
        return bool(self.targets or self.goal or self.measured)

    @property
    def latitude(self) -> float:
        """That of the gyrocompass [deg]."""
        return 55.75 if self.latitude_deg is None else self.latitude_deg

    @property
    def magnified(self) -> float:
        """How many times the error of the level that of the goal is: tan of the latitude for an azimuth."""
        return abs(math.tan(math.radians(self.latitude))) if self.goal == "gyrocompass" else 1.0

    @property
    def groups(self) -> Groups:
        """The targets of the goal, in groups whose errors are taken together; none without a goal."""
        return () if self.goal is None else FACES

    @property
    def expressions(self) -> tuple[str, ...]:
        """Targets as they are written, those of the goal where there is one; none: all of the convention."""
        return tuple(self.targets) or tuple(dict.fromkeys(symbol for group in self.groups for symbol in group))

    @property
    def alike(self) -> bool:
        """Whether the largest error counts, not each to its own optimum."""
        return self.goal is not None or self.accuracy is not None

    @property
    def wanted(self) -> float:
        """The wanted error [σ]; an InputError for what is none."""
        try:
            number = float((self.accuracy or "").removesuffix(self.unit)) * ACCURACY_UNITS[self.unit]
        except ValueError:
            number = math.nan
        if not 0.0 < number < math.inf:
            units = ", ".join(filter(None, ACCURACY_UNITS))
            raise InputError(f"--accuracy {self.accuracy!r}: must be a positive number, alone or of {units}: 7arcsec")
        return number / self.noise_bound

    def check_unit(self, own: str) -> None:
        """An InputError where the wanted error is written in a unit of something else than rad, g or 1."""
        if self.unit and own in UNITS_OF and self.unit not in UNITS_OF[own]:
            raise InputError(
                f"--accuracy {self.accuracy}: the error is one of {own}; write it in {' or '.join(UNITS_OF[own])}"
            )

    @property
    def unit(self) -> str:
        """That of `ACCURACY_UNITS` in which the wanted error is written."""
        return next((unit for unit in ACCURACY_UNITS if unit and (self.accuracy or "").endswith(unit)), "")

    def told(self, error: float, shown: Callable[..., str] = upwards) -> str:
        """An error [σ] in the unit of the wanted one, rounded up or as `shown` does."""
        return f"{shown(error * self.noise_bound / ACCURACY_UNITS[self.unit], 4)} {self.unit}".strip()

    def check(self) -> None:
        """Refuse options that no plan can fulfil: an InputError of one line that names the option."""
        for name, value, known in (
            ("criterion", self.criterion, ("worst", "mean")),
            ("order", self.order, ("tour", "random")),
            ("convention", self.convention, ("A1", "A2")),
            ("baseline", self.baseline, ("asymmetric", "symmetric")),
        ):
            if value not in known:
                raise InputError(f"--{name} {value}: must be one of {', '.join(known)}")
        if not 0.0 <= self.reserve_deg <= 10.0:
            raise InputError(f"--reserve {self.reserve_deg:g}: must be between 0 and 10 degrees")
        if self.resolution_deg is not None and not 1e-6 <= self.resolution_deg <= 30.0:
            raise InputError(f"--resolution {self.resolution_deg:g}: must be between 1e-6 and 30 degrees")
        for name, number, least, most in (
            ("starts", self.starts, 1, MOST_STARTS),
            ("cuts", self.cuts, 0, MOST_CUTS),
            ("extra", self.extra, 0, MOST_EXTRA),
            ("seed", self.seed, 0, 2**31 - 1),
        ):
            if not least <= number <= most:
                raise InputError(f"--{name} {number}: must be from {least} to {most}")
        if self.goal is not None and self.goal not in GOALS:
            raise InputError(f"--goal {self.goal}: must be one of {', '.join(GOALS)}")
        for name, value, most in (
            ("noise-bound", self.noise_bound, 1e-2),
            ("rate-dps", self.rate_dps, 1e4),
            ("acceleration-dps2", self.acceleration_dps2, 1e6),
        ):
            if value is not None and not 0.0 < value <= most:
                raise InputError(f"--{name} {value:g}: must be positive, and at most {most:g}")
        if self.latitude_deg is not None and self.goal != "gyrocompass":
            raise InputError("--latitude-deg: goes with --goal gyrocompass")
        if not abs(self.latitude) <= 89.0:
            raise InputError(f"--latitude-deg {self.latitude:g}: must be from -89 to 89")
        if self.goal is not None and self.targets:
            raise InputError("--goal and --target: give one of the two")
        for text in self.keep_out:
            parsed_keep_out(text)

    def parametrisation(self) -> Parametrisation:
        """The parameters with all mountings; an InputError for one that is unusable, comes twice or names no file."""
        found: dict[str, NDArray] = {}
        for given in self.mountings:
            for name, matrix in mountings_of(given).items():
                if name in found:
                    raise InputError(f"--mountings: {name} is given twice")
                if not name.replace("-", "").replace("_", "").isalnum():
                    raise InputError(f"--mountings: '{name}' cannot name files; use letters, digits, - and _")
                found[name] = matrix
        return parametrise(found, symmetric=self.baseline == "symmetric")


def parsed_keep_out(text: str) -> tuple[int, float, float]:
    """Axis, low and high [rad] of a keep-out as a person writes it: "alpha:100:150".

    An InputError for what is not an axis and two angles, the second above the first, less than a turn apart.
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
