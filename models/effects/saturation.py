"""Saturation: an accelerometer reads no more than a level."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import (
    Effect,
    EffectParameter,
    EffectPlace,
    accelerometer_number,
    all_coefficients,
    no_coefficients,
    no_signature,
    on_accelerometers,
)
from .rows import Rows, Variant, at_readings

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

    return Variant(
        offset=np.where(fixed, -rows.prediction, 0.0),
        columns=np.where(fixed, np.sign(reading), 0.0)[..., None],
        widening=np.zeros_like(rows.n),
        low=np.array([limits[0]]),
        high=np.array([limits[1]]),
        values=all_coefficients,
        limits=(limits,),
        lost=np.zeros_like(fixed),
        fixed=fixed,
        stands=stands,
    )


EFFECT = Effect(
    name="saturation",
    places=on_accelerometers("saturation"),
    parameters=(EffectParameter("level", "g", "largest reading", LARGEST_LEVEL, smallest=LEAST_LEVEL),),
    component="AccelerometerBlock",
    stage="final_effects",
    kernel=saturation,
    place_numbers=accelerometer_number,
    signature=no_signature,
    from_coefficients=no_coefficients,
    sentence=lambda place, values: f"accelerometer {place.index + 1} saturates at {values['level']:.5f} g",
    variants=variants,
    formula="|f_{p}|/g ≤ {level}",
)
