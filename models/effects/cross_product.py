"""Cross coupling Kip, Kio, Kpo: an accelerometer responds to the product of two inputs."""

from ..restricted import Vector
from .definition import (
    ACCELEROMETERS,
    Effect,
    EffectParameter,
    EffectPlace,
    accelerometer_column,
    only_coefficient,
)


def cross_product(context: Vector, n: Vector, p: int, i: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_i n_j to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[i] * n[j]


EFFECT = Effect(
    name="cross-product",
    places=tuple(
        EffectPlace("cross-product", where, axes=axes) for where in ACCELEROMETERS for axes in ((1, 2), (1, 3), (2, 3))
    ),
    parameters=(EffectParameter("coefficient", "1/g", "c of c n_i n_j: response to the product of two inputs", 1e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=cross_product,
    place_numbers=lambda place: (place.index, place.axes[0] - 1, place.axes[1] - 1),
    signature=lambda place, rows: accelerometer_column(
        place, rows.n[:, place.axes[0] - 1] * rows.n[:, place.axes[1] - 1]
    ),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} responds to the product of the inputs {place.axes[0]} and {place.axes[1]}: "
        f"{values['coefficient']:+.2e} n{place.axes[0]} n{place.axes[1]} (n in g)"
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i} n_{j}",
)
