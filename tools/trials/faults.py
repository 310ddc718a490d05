"""Hidden faults of a record: a wrong row or a break. They are drawn, done to a measured record, and compared."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats
from ...models.bench import elementary_reading
from ...models.effects import EffectPlace
from ...models.effects.definition import ACCELEROMETERS
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import chebyshev_radius
from ..calibration.model import PRESETS
from ..diagnosis.result import Explanation
from ..records import PositionRecord
from ..result import ABSENT, Told
from .bench import NOISE_BOUND, TrialBench, true_elementary
from .sizes import KnownBench

VISIBLE = 20.0
"""Least error of a wrong row, in bounds."""
TRIES = 20
SHIFTS_DEG = (0.1, 0.4, 1.0, 3.0, 10.0, 60.0)
"""Errors of a written angle."""
DISTURBED = (8.0, 60.0)
"""Least and largest error of each reading of a disturbed rest, in bounds."""
SIZES = (2.0, 4.0)
"""Least and largest size of a break, relative to that of sure detection."""
MIDDLE = (0.2, 0.8)
"""Part of the record in which a break lies."""
MOUNTING_ANGLES = tuple(f"mounting_{k}_rad" for k in (1, 2, 3))
BREAKS: Mapping[str, tuple[str, ...]] = {
    "zero of the outer axis": ("alpha_zero_rad",),
    "zero of the inner axis": ("beta_zero_rad",),
    "biases": ("bias_1_g", "bias_2_g", "bias_3_g"),
    "scale factors": ("scale_factor_1", "scale_factor_2", "scale_factor_3"),
    "biases and mounting": (
        *(f"bias_{p}_g" for p in (1, 2, 3)),
        *MOUNTING_ANGLES,
    ),
}
"""Changes at a break, as the diagnosis names them. That of one bias, one scale factor or the mounting is an effect."""
UNIT = 1e-6
"""A small change, for derivatives."""


class Fault(Told):
    """A wrong row, or a break before a row.

    Attributes
    ----------
    kind : str
        "rows" or "break"
    what : str
        the fault in words
    row : int
        the wrong row, or the first row after the break, from 1
    change : mapping
        sizes of a break
    numbers : tuple of float
        numbers of a wrong row: axis and shift of an angle [deg], channels, the copied row, errors of the readings [g]
    """

    kind: Literal["rows", "break"]
    what: str
    row: int
    change: dict[str, float] = ABSENT
    numbers: tuple[float, ...] = ABSENT

    @property
    def title(self) -> str:
        """The fault as a title."""
        place = "row" if self.kind == "rows" else "before row"
        return f"{self.what}, {place} {self.row}"

    def done_to(self, record: PositionRecord, bench: TrialBench) -> PositionRecord:
        """Return the record of a bench with the fault."""
        if self.kind == "rows":
            return SPOILED[self.what](record, self.row - 1, self.numbers or ())
        after = np.arange(len(record)) >= self.row - 1
        change = self.change or {}
        added = STANDARD_GRAVITY * (readings_of(_changed(bench, change)) - readings_of(bench))
        decimals = bench.decimals
        force = record.specific_force + added * after[:, None]
        return replace(
            record,
            specific_force=force if decimals is None else np.round(force, decimals),
            alpha=record.alpha + after * change.get("alpha_zero_rad", 0.0),
            beta=record.beta + after * change.get("beta_zero_rad", 0.0),
        )

    def has_part(self, named: "NamedBreak") -> bool:
        """Return true if a named break is this one, or of some of its parts."""
        return named.first < self.row <= named.last and named.parts <= set(self.change or ())

    def is_break(self, named: "NamedBreak") -> bool:
        """Return true if a named break is this one: its place in time, and everything that changes there."""
        return named.first < self.row <= named.last and named.parts == set(self.change or ())


@dataclass(frozen=True)
class NamedBreak:
    """A break that an explanation names: between two rows, with the parts that change."""

    first: int
    last: int
    parts: frozenset[str]

    @property
    def listed(self) -> EffectPlace | None:
        """The effect of the catalogue that the break is; None if it is none."""
        places = [EffectPlace("mounting-slip", MOUNTING)]
        for where in ACCELEROMETERS:
            places += [EffectPlace("bias-step", where), EffectPlace("scale-step", where)]
        return next((place for place in places if parts_of(place) == self.parts), None)


def parts_of(place: EffectPlace) -> frozenset[str]:
    """Return the parts that change at a step of the catalogue, as the diagnosis names them; empty of other effects."""
    if place.effect == "mounting-slip":
        return frozenset(MOUNTING_ANGLES)
    number = place.where[-1]
    names = {"bias-step": f"bias_{number}_g", "scale-step": f"scale_factor_{number}"}
    return frozenset({names[place.effect]}) if place.effect in names else frozenset()


def breaks_of(explanation: Explanation) -> list[NamedBreak]:
    """Return the breaks that an explanation names, in the order of time; later ones have their row in their keys."""
    if explanation.kind != "break" or explanation.between_rows is None:
        return []
    parts: dict[str, set[str]] = {}
    for key in explanation.change or ():
        part, _, later = key.partition("_from_r")
        parts.setdefault(later, set()).add(part)
    breaks = []
    for later, names in parts.items():
        first, last = explanation.between_rows
        if later:
            last = int(later.rpartition("_")[2])
            first = last - 1
        breaks.append(NamedBreak(first, last, frozenset(names)))
    return breaks


def readings_of(bench: TrialBench) -> Floats:
    """Return the readings (N, 3) [g] of a bench without noise and effects."""
    readings = np.zeros((len(bench.alpha), 3))
    for k, name in enumerate(bench.mountings):
        rows = bench.mounting == k
        parameters = true_elementary(bench.truth, bench.mounting_errors[k])
        readings[rows] = elementary_reading(parameters, bench.alpha[rows], bench.beta[rows], PRESETS[name])
    return readings


def _changed(bench: TrialBench, change: Mapping[str, float]) -> TrialBench:
    """Return a bench with other biases, scale factors and mounting errors."""
    block: dict[str, Any] = dict(bench.truth["AccelerometerBlock"])
    errors = np.array(bench.mounting_errors)
    for k in range(3):
        factor = change.get(f"scale_factor_{k + 1}", 0.0)
        for name, size in (
            ("bias", change.get(f"bias_{k + 1}_g", 0.0)),
            ("scale_error_plus", factor),
            ("scale_error_minus", factor),
        ):
            block[name] = [value + size * (k == p) for p, value in enumerate(block[name])]
        errors[:, k] += change.get(f"mounting_{k + 1}_rad", 0.0)
    truth = {**bench.truth, "AccelerometerBlock": block}
    return replace(bench, truth=truth, mounting_errors=tuple(map(tuple, errors.tolist())))


# Wrong rows

Spoil = Callable[[PositionRecord, int, tuple[float, ...]], PositionRecord]


def _angle(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    axis = ("alpha", "beta")[int(numbers[0])]
    return replace(
        record, **{axis: _with(getattr(record, axis), row, getattr(record, axis)[row] + np.radians(numbers[1]))}
    )


def _sign(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    axis = ("alpha", "beta")[int(numbers[0])]
    return replace(record, **{axis: _with(getattr(record, axis), row, -getattr(record, axis)[row])})


def _angles_exchanged(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    alpha, beta = record.alpha[row], record.beta[row]
    return replace(record, alpha=_with(record.alpha, row, beta), beta=_with(record.beta, row, alpha))


def _channels_exchanged(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    i, j = map(int, numbers)
    order = np.arange(3)
    order[[i, j]] = j, i
    return replace(record, specific_force=_with(record.specific_force, row, record.specific_force[row, order]))


def _copied(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    return replace(record, specific_force=_with(record.specific_force, row, record.specific_force[int(numbers[0])]))


def _disturbed(record: PositionRecord, row: int, numbers: tuple[float, ...]) -> PositionRecord:
    added = STANDARD_GRAVITY * np.array(numbers)
    return replace(record, specific_force=_with(record.specific_force, row, record.specific_force[row] + added))


def _with(values: NDArray, row: int, value: Any) -> Floats:
    changed = values.copy()
    changed[row] = value
    return changed


SPOILED: Mapping[str, Spoil] = {
    "an angle": _angle,
    "the sign of an angle": _sign,
    "α and β exchanged": _angles_exchanged,
    "two readings exchanged": _channels_exchanged,
    "a copied row": _copied,
    "a disturbed rest": _disturbed,
}


# Drawing


def draw_fault(rng: np.random.Generator, known: KnownBench, bench: TrialBench, record: PositionRecord) -> Fault | None:
    """Draw a wrong row or a break of a bench, given its faultless record and its model; None if none is possible."""
    if rng.random() < 0.5:
        return _draw_row(rng, record)
    return _draw_break(rng, known, bench)


def _draw_row(rng: np.random.Generator, record: PositionRecord) -> Fault | None:
    for _ in range(TRIES):
        what, row = str(rng.choice(list(SPOILED))), int(rng.integers(len(record)))
        axis, other = int(rng.integers(2)), int(rng.integers(len(record)))
        numbers = {
            "an angle": (float(axis), float(rng.choice([-1.0, 1.0]) * rng.choice(SHIFTS_DEG))),
            "the sign of an angle": (float(axis),),
            "two readings exchanged": tuple(map(float, rng.choice(3, 2, replace=False))),
            "a copied row": (float(other),),
            "a disturbed rest": tuple((NOISE_BOUND * rng.choice([-1.0, 1.0], 3) * rng.uniform(*DISTURBED, 3)).tolist()),
        }.get(what, ())
        fault = Fault(kind="rows", what=what, row=row + 1, numbers=numbers)
        spoiled = SPOILED[what](record, row, numbers)
        moved = _predicted(spoiled, row) - _predicted(record, row)
        error = (spoiled.specific_force - record.specific_force)[row] / STANDARD_GRAVITY - moved
        if what == "a disturbed rest" or np.abs(error).max() > VISIBLE * NOISE_BOUND:
            return fault
    return None


def _predicted(record: PositionRecord, row: int) -> Floats:
    """Return the readings (3,) [g] of an ideal bench at the angles of a row."""
    mounting = PRESETS[record.mounting[row] if record.mounting else "identity"]
    at = slice(row, row + 1)
    return elementary_reading(true_elementary({}, (0.0, 0.0, 0.0)), record.alpha[at], record.beta[at], mounting)[0]


def _draw_break(rng: np.random.Generator, known: KnownBench, bench: TrialBench) -> Fault | None:
    what = str(rng.choice(list(BREAKS)))
    names, count = BREAKS[what], len(bench.alpha)
    row = int(rng.integers(round(MIDDLE[0] * count), round(MIDDLE[1] * count) + 1)) + 1
    direction = rng.normal(size=len(names))
    direction /= np.linalg.norm(direction)
    unit = dict(zip(names, (UNIT * direction).tolist(), strict=True))
    moved = replace(
        bench, alpha=bench.alpha - unit.get("alpha_zero_rad", 0.0), beta=bench.beta - unit.get("beta_zero_rad", 0.0)
    )
    after = (np.arange(count) >= row - 1)[:, None]
    change = ((readings_of(_changed(moved, unit)) - readings_of(bench)) * after).ravel() / UNIT
    radius, _, _ = chebyshev_radius(known.model.jacobian, change, np.ones(len(change)))
    if radius < UNIT:
        return None
    size = float(rng.uniform(*SIZES)) * 2.0 * NOISE_BOUND / radius
    return Fault(kind="break", what=what, row=row, change={name: size * unit[name] / UNIT for name in names})
