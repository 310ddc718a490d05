"""Bias that depends on the temperature."""

from ..restricted import TEMPERATURE, Vector
from .definition import NOMINAL_TEMPERATURE, EffectParameter, above_nominal, accelerometer_effect


def temperature_bias(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE)


EFFECT = accelerometer_effect(
    temperature_bias,
    EffectParameter("coefficient", "g/K", "c of c (T - 20 degC): change of the bias with temperature", 1e-3),
    lambda place, rows: above_nominal(rows),
    "the bias of accelerometer {p} changes by {coefficient:+.2e} g per kelvin",
    needs=("temperature",),
    open_argument=lambda place, rows: rows.temperature_resolution,
    formula="Δf_{p}/g = {coefficient} (T − 20 °C)",
)
