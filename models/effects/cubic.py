"""Cubic term K3 of an accelerometer's response."""

from ..restricted import Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def cubic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p³ to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p] * n[p]


EFFECT = accelerometer_effect(
    cubic,
    EffectParameter("coefficient", "1/g2", "c of c n³: response to the cube of the input", 1e-2),
    lambda place, rows: own_input(place, rows) ** 3,
    "accelerometer {p} responds to the cube of its input: {coefficient:+.2e} n³ (n in g)",
    degree=3,
    formula="Δf_{p}/g = {coefficient} n_{p}³",
)
