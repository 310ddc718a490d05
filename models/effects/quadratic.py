"""Quadratic term K2 of an accelerometer's response."""

from ..restricted import Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p]


EFFECT = accelerometer_effect(
    quadratic,
    EffectParameter("coefficient", "1/g", "c of c n²: response to the square of the input", 1e-2),
    lambda place, rows: own_input(place, rows) ** 2,
    "accelerometer {p} responds to the square of its input: {coefficient:+.2e} n² (n in g)",
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p}²",
)
