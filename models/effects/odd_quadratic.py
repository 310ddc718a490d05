"""Odd quadratic term Koq of an accelerometer's response."""

import math

import numpy as np

from ..restricted import Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def odd_quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p |n_p| to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * math.fabs(n[p])


EFFECT = accelerometer_effect(
    odd_quadratic,
    EffectParameter("coefficient", "1/g", "c of c n |n|: response to the signed square of the input", 1e-2),
    lambda place, rows: own_input(place, rows) * np.abs(own_input(place, rows)),
    "accelerometer {p} responds to the signed square of its input: {coefficient:+.2e} n |n| (n in g)",
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p} |n_{p}|",
)
