"""What changes once, at a time that is found between two rows.

bias_step, scale_step
    the bias, the scale factor of an accelerometer is another one from a time on
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..restricted import HOURS, Vector
from .definition import EffectParameter, EffectPlace, accelerometer_column, last_stage_effect, own_input
from .last_stage import LAST_HOUR, variant
from .rows import Rows, Variant

LARGEST_OF_BIAS = LARGEST_OF_SCALE = 1e-1
FEWEST_ROWS = 2
"""So many rows on each side of a step; what only one row shows is an outlier."""


def bias_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add the size to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size


def scale_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add size n_p to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size * n[p]


def bias_step_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """Each time between two rows with enough rows before it and after it."""
    return _steps(place, rows, accelerometer_column(place, np.ones(len(rows.hours))), LARGEST_OF_BIAS)


def scale_step_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """As of a step of the bias."""
    return _steps(place, rows, accelerometer_column(place, own_input(place, rows)), LARGEST_OF_SCALE)


def _steps(place: EffectPlace, rows: Rows, columns: NDArray[np.float64], largest: float) -> list[Variant]:
    """What adds columns (N, 3, 1) after each time between two rows with enough rows before it and after it."""
    found = []
    times = np.unique(rows.hours)
    for before, after in pairwise(times):
        later = rows.hours > before
        if min(later.sum(), (~later).sum()) >= FEWEST_ROWS:
            found.append(_step(place, columns * later[:, None, None], largest, (float(before), float(after))))
    return found


def _step(place: EffectPlace, columns: NDArray[np.float64], largest: float, gap: tuple[float, float]) -> Variant:
    def values(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
        return float(coefficients[0]), 0.5 * (gap[0] + gap[1])

    def undecided(others: Rows, sigma: float) -> NDArray[np.bool_]:
        within = (others.hours > gap[0]) & (others.hours < gap[1])
        return accelerometer_column(place, within.astype(float))[..., 0] > 0.0

    return variant(
        columns.shape[:2],
        ((-largest, largest), gap),
        columns=columns,
        low=np.array([-largest]),
        high=np.array([largest]),
        values=values,
        undecided=undecided,
    )


BIAS_STEP = last_stage_effect(
    bias_step,
    (
        EffectParameter("size", "g", "by how much the bias changes", LARGEST_OF_BIAS),
        EffectParameter("start", "h", "time after which it is another one", LAST_HOUR, smallest=0.0),
    ),
    bias_step_variants,
    "the bias of accelerometer {p} changes by {size:+.2e} g at {start:.4g} h",
    stage="reading_effects",
    formula="Δf_{p}/g = {size} 'from' t = {start} 'on'",
)

SCALE_STEP = last_stage_effect(
    scale_step,
    (
        EffectParameter("size", "1", "by how much the scale factor changes", LARGEST_OF_SCALE),
        EffectParameter("start", "h", "time after which it is another one", LAST_HOUR, smallest=0.0),
    ),
    scale_step_variants,
    "the scale factor of accelerometer {p} changes by {size:+.2e} at {start:.4g} h",
    stage="reading_effects",
    degree=1,
    formula="Δf_{p}/g = {size} n_{p} 'from' t = {start} 'on'",
)

EFFECTS = (BIAS_STEP, SCALE_STEP)
