"""Scale factor that depends on the temperature."""

from ..restricted import TEMPERATURE, Vector
from .definition import (
    NOMINAL_TEMPERATURE,
    Effect,
    EffectParameter,
    above_nominal,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def temperature_scale(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) n_p to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE) * n[p]


EFFECT = Effect(
    name="temperature-scale",
    places=on_accelerometers("temperature-scale"),
    parameters=(
        EffectParameter(
            "coefficient", "1/K", "c of c (T - 20 degC) n: change of the scale factor with temperature", 1e-3
        ),
    ),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=temperature_scale,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, above_nominal(rows) * rows.n[:, place.index]),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the scale factor of accelerometer {place.index + 1} changes by {values['coefficient']:+.2e} per kelvin"
    ),
    needs=("temperature",),
    open_argument=lambda place, rows: rows.temperature_resolution,
    degree=1,
    formula="Δf_{p}/g = {coefficient} (T − 20 °C) n_{p}",
)
