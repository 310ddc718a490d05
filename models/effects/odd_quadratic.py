"""Odd quadratic term Koq of an accelerometer's response."""

import math

import numpy as np

from ..restricted import Vector
from .definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def odd_quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p |n_p| to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * math.fabs(n[p])


EFFECT = Effect(
    name="odd-quadratic",
    places=on_accelerometers("odd-quadratic"),
    parameters=(
        EffectParameter("coefficient", "1/g", "c of c n |n|: response to the signed square of the input", 1e-2),
    ),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=odd_quadratic,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, rows.n[:, place.index] * np.abs(rows.n[:, place.index])),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} responds to the signed square of its input: "
        f"{values['coefficient']:+.2e} n |n| (n in g)"
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p} |n_{p}|",
)
