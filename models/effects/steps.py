"""What changes once, at a time that is found between two rows.

bias_step, scale_step
    the bias, the scale factor of an accelerometer is another one from a time on
mounting_slip
    the block turns on the table, so that its mounting error is another one from a time on
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..restricted import HOURS, Vector
from .columns import Rows
from .definition import (
    EffectParameter,
    EffectPlace,
    accelerometer_column,
    last_stage_effect,
)
from .last_stage import LAST_HOUR
from .variants import Variant, variant

LARGEST_OF_BIAS = LARGEST_OF_SCALE = 1e-1
LARGEST_SLIP = 1e-2
FEWEST_ROWS = 2
"""So many rows on each side of a step; what only one row shows is an outlier."""
Columns = Callable[[Rows], NDArray[np.float64]]
"""What a unit of each coefficient does to the readings (N, 3, K) at rows after the time."""


def bias_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add the size to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size


def scale_step(context: Vector, n: Vector, p: int, size: float, start: float, added: Vector) -> None:
    """Add size n_p to the reading of accelerometer p after `start` hours."""
    if context[HOURS] > start:
        added[p] = added[p] + size * n[p]


def mounting_slip(
    context: Vector, angles: Vector, theta_1: float, theta_2: float, theta_3: float, start: float, turns: Vector
) -> None:
    """Turn the block further on the table, by a rotation vector in its axes, after `start` hours."""
    if context[HOURS] > start:
        turns[4] = turns[4] + theta_1
        turns[5] = turns[5] + theta_2
        turns[6] = turns[6] + theta_3


def bias_step_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """Each time between two rows with enough rows before it and after it."""
    return _steps(rows, lambda at_rows: accelerometer_column(place, np.ones(len(at_rows.hours))), LARGEST_OF_BIAS)


def scale_step_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """As of a step of the bias."""
    return _steps(rows, lambda at_rows: accelerometer_column(place, at_rows.n[:, place.index]), LARGEST_OF_SCALE)


def mounting_slip_variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """As of a step of the bias."""
    ways = _steps(rows, lambda at_rows: at_rows.by_slip, LARGEST_SLIP)
    return [replace(way, slipped=rows.hours > way.limits[-1][0]) for way in ways]


def _steps(rows: Rows, columns: Columns, largest: float) -> list[Variant]:
    """What adds columns (N, 3, K) after each time between two rows with enough rows before it and after it."""
    ways, every = [], columns(rows)
    times = np.unique(rows.hours)
    for before, after in pairwise(times):
        later = rows.hours > before
        if min(later.sum(), (~later).sum()) >= FEWEST_ROWS:
            way = _step(every * later[:, None, None], largest, (float(before), float(after)))
            ways.append(replace(way, elsewhere=columns))
    return ways


def _step(columns: NDArray[np.float64], largest: float, gap: tuple[float, float]) -> Variant:
    count, acted_on = columns.shape[2], np.any(columns != 0.0, axis=(0, 2))

    def values(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
        return *(float(value) for value in coefficients), 0.5 * (gap[0] + gap[1])

    def undecided(further: Rows, sigma: float) -> NDArray[np.bool_]:
        within = (further.hours > gap[0]) & (further.hours < gap[1])
        return within[:, None] & acted_on

    return variant(
        columns.shape[:2],
        (*[(-largest, largest)] * count, gap),
        columns=columns,
        low=np.full(count, -largest),
        high=np.full(count, largest),
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

MOUNTING_SLIP = last_stage_effect(
    mounting_slip,
    (
        *(EffectParameter(f"theta_{k}", "rad", f"turn about axis {k} of the block", LARGEST_SLIP) for k in (1, 2, 3)),
        EffectParameter("start", "h", "time after which the block stands so", LAST_HOUR, smallest=0.0),
    ),
    mounting_slip_variants,
    "the block slips on the table at {start:.4g} h: it turns by {theta_1_arcsec:+.4g}, {theta_2_arcsec:+.4g} and "
    "{theta_3_arcsec:+.4g} arcsec about its axes",
    component="TurntableMotion",
    stage="geometry_effects",
    places=(EffectPlace("mounting-slip", "mounting"),),
    sets_in=True,
    formula="Δθ = ({theta_1}, {theta_2}, {theta_3}) 'rad from' t = {start} 'on'",
)

EFFECTS = (BIAS_STEP, SCALE_STEP, MOUNTING_SLIP)
