"""Saturation: an accelerometer reads no more than a level."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import EffectParameter, EffectPlace, all_coefficients, last_stage_effect
from .rows import Rows, Variant, at_readings, variant

LEAST_LEVEL, LARGEST_LEVEL = 0.5, 10.0


def saturation(context: Vector, own: Vector, p: int, level: float, reading: Vector) -> None:
    """Clip the reading of accelerometer p at ±level; a level of 0 stands for none."""
    if level > 0.0:
        if reading[p] > level:
            reading[p] = level
        if reading[p] < -level:
            reading[p] = -level


def variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """Readings at the level agree within the noise and are the largest; of those, the k with the largest prediction.

    A clipped reading is ±level, whatever the bench, so its change is linear in the level.
    """
    p = place.index
    size = np.abs(reading[:, p])
    largest = float(size.max(initial=0.0))
    room = sigma + rows.resolution
    low, high = max(LEAST_LEVEL, largest - room), min(LARGEST_LEVEL, largest + room)
    if low > high:
        return []
    band = np.flatnonzero(size >= largest - 2.0 * room)
    order = band[np.argsort(-np.abs(rows.prediction[band, p]), kind="stable")]
    return [_variant(p, rows, np.sort(order[:count]), reading, (low, high), sigma) for count in range(1, len(band) + 1)]


def _variant(
    p: int,
    rows: Rows,
    chosen: NDArray[np.int_],
    reading: NDArray[np.float64],
    limits: tuple[float, float],
    sigma: float,
) -> Variant:
    fixed = at_readings(rows.n.shape, chosen, p)

    def stands(there: Rows, coefficients: NDArray[np.float64]) -> bool:
        size = np.abs(there.prediction[:, p])
        others = np.delete(size, chosen).max(initial=0.0)
        return bool(size[chosen].min() >= coefficients[0] - sigma and others <= coefficients[0] + sigma)

    return variant(
        rows.n.shape,
        (limits,),
        offset=np.where(fixed, -rows.prediction, 0.0),
        columns=np.where(fixed, np.sign(reading), 0.0)[..., None],
        low=np.array([limits[0]]),
        high=np.array([limits[1]]),
        values=all_coefficients,
        fixed=fixed,
        stands=stands,
    )


EFFECT = last_stage_effect(
    saturation,
    EffectParameter("level", "g", "largest reading", LARGEST_LEVEL, smallest=LEAST_LEVEL),
    variants,
    "accelerometer {p} saturates at {level:.5f} g",
    formula="|f_{p}|/g ≤ {level}",
)
