"""Bias that depends on the temperature."""

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


def temperature_bias(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE)


EFFECT = Effect(
    name="temperature-bias",
    places=on_accelerometers("temperature-bias"),
    parameters=(
        EffectParameter("coefficient", "g/K", "c of c (T - 20 degC): change of the bias with temperature", 1e-3),
    ),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=temperature_bias,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, above_nominal(rows)),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the bias of accelerometer {place.index + 1} changes by {values['coefficient']:+.2e} g per kelvin"
    ),
    needs=("temperature",),
    open_argument=lambda place, rows: rows.temperature_resolution,
    formula="Δf_{p}/g = {coefficient} (T − 20 °C)",
)
