"""Quantisation of the gyros: they read in steps."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import GYRO_BLOCK, EffectParameter, EffectPlace, last_stage_effect
from .quantisation import LARGEST_STEP, common_step
from .rows import MotionRows, Variant, variant

LEAST_STEP = 1e-7
FINEST = 1e-9
"""Digits of a rate [rad/s] finer than this are rounding."""
MOST = 3000
"""So many readings of a gyro are looked at, spread over the record."""


def gyro_quantisation(context: Vector, own: Vector, step: float, reading: Vector) -> None:
    """Round each gyro's reading to a multiple of the step; a step of 0 stands for none."""
    if step > 0.0:
        for p in range(3):
            reading[p] = step * math.floor(reading[p] / step + 0.5)


def variants(place: EffectPlace, rows: MotionRows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """The largest step of which the readings (N, 3) [rad/s] are multiples; they lie within half a step of the truth.

    `sigma` [rad/s] is the noise of a reading; a step far below it widens no bound that matters.
    """
    every = reading[:: max(1, len(reading) // MOST)]
    steps = [common_step(every[:, p], FINEST, max(LEAST_STEP, 0.2 * sigma, 20.0 * FINEST)) for p in range(3)]
    found = [step for step in steps if step is not None]
    if not found:
        return []
    step = max(found)
    widening = np.tile([0.0 if own is None else 0.5 * own for own in steps], (len(reading), 1))
    limits = ((step - FINEST, step + FINEST),)
    return [variant(reading.shape, limits, widening=widening, values=lambda coefficients: (step,))]


EFFECT = last_stage_effect(
    gyro_quantisation,
    EffectParameter("step", "rad/s", "readings are multiples of it", LARGEST_STEP, smallest=LEAST_STEP),
    variants,
    "the gyros read in steps of {step:.3e} rad/s",
    places=(EffectPlace("gyro-quantisation", GYRO_BLOCK),),
    component="GyroBlock",
    in_motion=True,
)
