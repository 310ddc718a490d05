"""Bias asymmetry K0': the bias depends on the sign of the input."""

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


def bias_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c sign(n_p) to the reading of accelerometer p."""
    if n[p] > 0.0:
        added[p] = added[p] + coefficient
    if n[p] < 0.0:
        added[p] = added[p] - coefficient


EFFECT = Effect(
    name="bias-asymmetry",
    places=on_accelerometers("bias-asymmetry"),
    parameters=(EffectParameter("coefficient", "g", "c of c sign(n): half of the difference of the biases", 1e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=bias_asymmetry,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, np.sign(rows.n[:, place.index])),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the bias of accelerometer {place.index + 1} depends on the sign of its input: "
        f"{values['coefficient']:+.2e} g for a positive one, the opposite for a negative one"
    ),
    formula="Δf_{p}/g = {coefficient} sign(n_{p})",
)
