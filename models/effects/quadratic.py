"""Quadratic term K2 of an accelerometer's response."""

from ..restricted import Vector
from .definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p]


EFFECT = Effect(
    name="quadratic",
    places=on_accelerometers("quadratic"),
    parameters=(EffectParameter("coefficient", "1/g", "c of c n²: response to the square of the input", 1e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=quadratic,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, rows.n[:, place.index] ** 2),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} responds to the square of its input: {values['coefficient']:+.2e} n² (n in g)"
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p}²",
)
