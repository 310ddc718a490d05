"""Cross coupling Kpp, Koo: an accelerometer responds to the square of another one's input."""

from ..restricted import Vector
from .definition import (
    ACCELEROMETERS,
    Effect,
    EffectParameter,
    EffectPlace,
    accelerometer_column,
    only_coefficient,
)


def cross_square(context: Vector, n: Vector, p: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_j² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[j] * n[j]


EFFECT = Effect(
    name="cross-square",
    places=tuple(
        EffectPlace("cross-square", where, axes=(j,))
        for p, where in enumerate(ACCELEROMETERS, start=1)
        for j in (1, 2, 3)
        if j != p
    ),
    parameters=(EffectParameter("coefficient", "1/g", "c of c n_j²: response to the square of another input", 1e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=cross_square,
    place_numbers=lambda place: (place.index, place.axes[0] - 1),
    signature=lambda place, rows: accelerometer_column(place, rows.n[:, place.axes[0] - 1] ** 2),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} responds to the square of the input of accelerometer {place.axes[0]}: "
        f"{values['coefficient']:+.2e} n{place.axes[0]}² (n in g)"
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i}²",
)
