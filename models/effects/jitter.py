"""Jitter: the time stamps of a record jitter, the sampling does not, so rates count over wrong intervals."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import INTERVAL, STEP_LENGTH, Vector
from .definition import EffectParameter, EffectPlace, MotionRows, gyro_effect


def jitter(context: Vector, rate: Vector, share: float, added: Vector) -> None:
    """Add to each reading what it gains when its interval by the time stamps stands for the step, or for several.

    The share is 1 where the sampling is regular and all jitter is the log's, 0 where the sampling itself jitters.
    """
    steps = context[INTERVAL] / context[STEP_LENGTH]
    whole = math.floor(steps + 0.5) + 0.0
    if whole < 1.0:
        whole = 1.0
    for p in range(3):
        added[p] = added[p] + share * rate[p] * (steps - whole)


def signature(place: EffectPlace, rows: MotionRows) -> NDArray[np.float64]:
    """Signature (N, 3, 1): the rates times the part of each interval that is not whole nominal periods.

    Over the interval that is an angle of the rate times interval less whole periods, as the kernel's over a step.
    """
    if rows.period <= 0.0:
        return np.zeros((*rows.rate.shape, 1))
    steps = rows.step / rows.period
    away = 1.0 - np.maximum(np.floor(steps + 0.5), 1.0) / steps
    return (rows.rate * away[:, None])[..., None]


EFFECT = gyro_effect(
    jitter,
    EffectParameter("share", "1", "part of the time stamps' jitter that the sampling does not have", 1.5, smallest=0.0),
    signature,
    lambda place, values: (
        f"the time stamps jitter more than the sampling: {100.0 * values['share']:.0f} % of their jitter is the log's"
    ),
    formula="Δω = {share} ω (τ/T − k), τ 'the interval by the time stamps, of' k 'whole periods' T",
)
