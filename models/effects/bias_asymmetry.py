"""Bias asymmetry K0': the bias depends on the sign of the input."""

import numpy as np

from ..restricted import Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def bias_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c sign(n_p) to the reading of accelerometer p."""
    if n[p] > 0.0:
        added[p] = added[p] + coefficient
    if n[p] < 0.0:
        added[p] = added[p] - coefficient


EFFECT = accelerometer_effect(
    bias_asymmetry,
    EffectParameter("coefficient", "g", "c of c sign(n): half of the difference of the biases", 1e-2),
    lambda place, rows: np.sign(own_input(place, rows)),
    "the bias of accelerometer {p} depends on the sign of its input: {coefficient:+.2e} g for a positive one, "
    "the opposite for a negative one",
    formula="Δf_{p}/g = {coefficient} sign(n_{p})",
)
