"""Cross coupling Kpp, Koo: an accelerometer responds to the square of another one's input."""

from ..restricted import Vector
from .definition import ACCELEROMETERS, EffectParameter, EffectPlace, accelerometer_effect


def cross_square(context: Vector, n: Vector, p: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_j² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[j] * n[j]


EFFECT = accelerometer_effect(
    cross_square,
    EffectParameter("coefficient", "1/g", "c of c n_j²: response to the square of another input", 1e-2),
    lambda place, rows: rows.n[:, place.axes[0] - 1] ** 2,
    "accelerometer {p} responds to the square of the input of accelerometer {i}: {coefficient:+.2e} n{i}² (n in g)",
    places=tuple(
        EffectPlace("cross-square", where, axes=(j,))
        for p, where in enumerate(ACCELEROMETERS, start=1)
        for j in (1, 2, 3)
        if j != p
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i}²",
)
