"""Steps of readings: the grid on which the angles of a table, or the readings of accelerometers, stand.

An encoder with steps reads the nearest of its multiples, so that its error is up to half a step. Angles on a grid may
also be settings at which a table stands exactly: the grid alone does not tell.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats

SETTINGS_DEG = 0.5
"""Angles on a grid as wide as this are settings."""
DECIMALS = 9
"""Decimals of a degree in which angles are written at most."""
CLEAR = 8.0
"""A grid is seen where its step is at least this multiple of a last digit."""
FEWEST = 6
"""Fewer readings show no grid."""
SAME = 1e-3
"""Largest distance of a reading from its grid, in steps."""
MOST_PARTS = 10
"""Most steps in the least difference of two readings."""


def _grids() -> Floats:
    """Return the steps of encoders [deg], the widest first: decimals, minutes and seconds of arc, counts of a turn."""
    steps = [360.0 / 2**bits for bits in range(10, 21)]
    for unit in (1.0, 0.1, 0.01, 0.001):
        steps += [0.5 * unit, 0.2 * unit, 0.1 * unit]
    for unit in (1.0 / 60.0, 1.0 / 3600.0):
        steps += [
            30.0 * unit,
            20.0 * unit,
            10.0 * unit,
            5.0 * unit,
            2.0 * unit,
            unit,
            0.5 * unit,
            0.2 * unit,
            0.1 * unit,
        ]
    # numpy.unique would load masked arrays.
    return np.array(sorted(set(steps), reverse=True))


GRIDS_DEG = _grids()


@dataclass(frozen=True)
class AngleSteps:
    """Steps of the encoders of the outer and the inner axis [rad]; 0 where an axis shows none."""

    outer: float = 0.0
    inner: float = 0.0

    @property
    def error(self) -> float:
        """The largest change of a reading by half a step of both axes, a fraction of gravity.

        The axes are at right angles: a component changes by √(h₁² + h₂²) at most, with half steps h.
        """
        return 0.5 * math.hypot(self.outer, self.inner)

    @property
    def degrees(self) -> tuple[float, float]:
        """The steps [deg], without digits of rounding."""
        outer, inner = (float(f"{math.degrees(step):.6g}") for step in (self.outer, self.inner))
        return outer, inner

    def __str__(self) -> str:
        texts = [in_words(step) for step in self.degrees if step]
        return " and ".join(dict.fromkeys(texts))


def in_words(step_deg: float) -> str:
    """Return a step [deg] as a laboratory writes it: 0.1°, 1', 10"."""
    minutes, seconds = 60.0 * step_deg, 3600.0 * step_deg
    if abs(step_deg - round(step_deg, 4)) < 1e-9:
        return f"{step_deg:g}°"
    if abs(minutes - round(minutes, 2)) < 1e-4:
        return f"{round(minutes, 2):g}'"
    if abs(seconds - round(seconds, 2)) < 1e-3:
        return f'{round(seconds, 2):g}"'
    return f"{step_deg:.4g}°"


def angle_steps(alpha: Floats, beta: Floats) -> AngleSteps:
    """Return the steps on which encoder angles (N,) [rad] stand; an axis on wide settings has those of the other."""
    steps = [_step_of(np.degrees(angle)) for angle in (alpha, beta)]
    known = [step for step in steps if step is not None]
    if not known:
        return AngleSteps()
    outer, inner = (max(known) if step is None else step for step in steps)
    return AngleSteps(math.radians(outer), math.radians(inner))


def _step_of(angle: NDArray) -> float | None:
    """Return the step of angles (N,) [deg]; 0 where they show none, None where they are settings."""
    if len(angle) < FEWEST:
        return 0.0
    digit = 10.0**-DECIMALS
    for decimals in range(DECIMALS):
        scaled = angle * 10.0**decimals
        if np.abs(scaled - np.round(scaled)).max() < 1e-6:
            digit = 10.0**-decimals
            break
    # Grids that are no decimals are written rounded to the last digit.
    near = max(0.51 * digit, digit if digit < 1e-8 else 0.0)
    if np.abs(angle - SETTINGS_DEG * np.round(angle / SETTINGS_DEG)).max() <= min(near, 1e-6):
        return None
    for step in GRIDS_DEG.tolist():
        parts = step / digit
        is_decimal = abs(parts - round(parts)) < 1e-6 and parts > 0.5
        allowed = 1e-6 * step if is_decimal else near
        if (is_decimal or parts >= CLEAR) and np.abs(angle - step * np.round(angle / step)).max() <= allowed:
            return step
    return 0.0


def reading_step(values: Floats) -> float:
    """Return the step on which all readings (N, 3) stand, in their unit; 0 where they show none."""
    step = 0.0
    for channel in values.T:
        step = max(step, _step_of_channel(np.unique(channel)))
    return step


def _step_of_channel(distinct: NDArray) -> float:
    """Return the widest step of different values (n,), sorted; 0 where there is none."""
    if len(distinct) < FEWEST:
        return 0.0
    differences = distinct - distinct[0]
    least = float(np.diff(distinct).min())
    if differences[-1] > least / np.finfo(float).eps:
        # Doubles cannot count as many steps.
        return 0.0
    for parts in range(1, MOST_PARTS + 1):
        steps = parts * (differences / least)
        if np.abs(steps - np.round(steps)).max() <= SAME:
            return least / parts
    return 0.0
