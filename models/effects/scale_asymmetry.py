"""Scale-factor asymmetry: the scale factor depends on the sign of the input."""

import math

import numpy as np

from ..restricted import Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def scale_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c |n_p| to the reading of accelerometer p; c = (Γ⁺ - Γ⁻)/2."""
    added[p] = added[p] + coefficient * math.fabs(n[p])


EFFECT = accelerometer_effect(
    scale_asymmetry,
    EffectParameter("coefficient", "1", "c of c |n|: half of Γ⁺ - Γ⁻", 2e-2),
    lambda place, rows: np.abs(own_input(place, rows)),
    "the scale factor of accelerometer {p} differs between the signs of its input: {coefficient:+.2e} |n|",
    within="asymmetric",
    degree=1,
    formula="Δf_{p}/g = {coefficient} |n_{p}|",
)
