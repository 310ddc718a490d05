"""Scale-factor asymmetry: the scale factor depends on the sign of the input."""

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


def scale_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c |n_p| to the reading of accelerometer p; c = (Γ⁺ - Γ⁻)/2."""
    added[p] = added[p] + coefficient * math.fabs(n[p])


EFFECT = Effect(
    name="scale-asymmetry",
    places=on_accelerometers("scale-asymmetry"),
    parameters=(EffectParameter("coefficient", "1", "c of c |n|: half of Γ⁺ - Γ⁻", 2e-2),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=scale_asymmetry,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, np.abs(rows.n[:, place.index])),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the scale factor of accelerometer {place.index + 1} differs between the signs of its input: "
        f"{values['coefficient']:+.2e} |n|"
    ),
    within="asymmetric",
    degree=1,
    formula="Δf_{p}/g = {coefficient} |n_{p}|",
)
