"""Cross coupling Kip, Kio, Kpo: an accelerometer responds to the product of two inputs."""

from ..restricted import Vector
from .definition import ACCELEROMETERS, EffectParameter, EffectPlace, accelerometer_effect


def cross_product(context: Vector, n: Vector, p: int, i: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_i n_j to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[i] * n[j]


EFFECT = accelerometer_effect(
    cross_product,
    EffectParameter("coefficient", "1/g", "c of c n_i n_j: response to the product of two inputs", 1e-2),
    lambda place, rows: rows.n[:, place.axes[0] - 1] * rows.n[:, place.axes[1] - 1],
    "accelerometer {p} responds to the product of the inputs {i} and {j}: {coefficient:+.2e} n{i} n{j} (n in g)",
    places=tuple(
        EffectPlace("cross-product", where, axes=axes) for where in ACCELEROMETERS for axes in ((1, 2), (1, 3), (2, 3))
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i} n_{j}",
)
