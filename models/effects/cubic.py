"""Cubic term K3 of an accelerometer's response."""

from ..restricted import Vector
from .definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def cubic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p³ to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p] * n[p]


EFFECT = Effect(
    name="cubic",
    places=on_accelerometers("cubic"),
    parameters=(EffectParameter("coefficient", "1/g2", "c of c n³: response to the cube of the input", 1e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=cubic,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, rows.n[:, place.index] ** 3),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} responds to the cube of its input: {values['coefficient']:+.2e} n³ (n in g)"
    ),
    degree=3,
    formula="Δf_{p}/g = {coefficient} n_{p}³",
)
