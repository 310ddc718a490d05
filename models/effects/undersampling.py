"""Undersampling: what the coning within a step adds to the increment is left out."""

import numpy as np

from ..restricted import Vector
from .definition import EffectParameter, EffectPlace, gyro_effect


def undersampling(before: Vector, increment: Vector, coefficient: float, added: Vector) -> None:
    """Add c γ' × γ to an increment γ, with γ' the one before; c is 1/12 where the rate is linear in time.

    Source: P. Savage, "Strapdown inertial navigation integration algorithm design", part 1, 1998: the second-order term
    of the coning correction from the increment before.
    """
    added[0] = added[0] + coefficient * (before[1] * increment[2] - before[2] * increment[1])
    added[1] = added[1] + coefficient * (before[2] * increment[0] - before[0] * increment[2])
    added[2] = added[2] + coefficient * (before[0] * increment[1] - before[1] * increment[0])


EFFECT = gyro_effect(
    undersampling,
    EffectParameter("coefficient", "1", "c of c γ' × γ: what the increments lack, by those before them", 1.0),
    # The attitude computer adds what the readings lack.
    lambda place, rows: -(np.cross(rows.rate_before, rows.rate) * rows.step[:, None])[..., None],
    "the attitude computer leaves coning out: {coefficient:+.3f} of the product of two increments",
    places=(EffectPlace("undersampling", "attitude-computer"),),
    component="AttitudeComputer",
    stage="increment_effects",
    formula="Δγ = {coefficient} γ_before × γ",
)
