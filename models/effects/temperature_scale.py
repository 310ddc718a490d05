"""Scale factor that depends on the temperature."""

from ..restricted import TEMPERATURE, Vector
from .definition import NOMINAL_TEMPERATURE, EffectParameter, above_nominal, accelerometer_effect, own_input


def temperature_scale(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) n_p to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE) * n[p]


EFFECT = accelerometer_effect(
    temperature_scale,
    EffectParameter("coefficient", "1/K", "c of c (T - 20 degC) n: change of the scale factor with temperature", 1e-3),
    lambda place, rows: above_nominal(rows) * own_input(place, rows),
    "the scale factor of accelerometer {p} changes by {coefficient:+.2e} per kelvin",
    needs=("temperature",),
    open_argument=lambda place, rows: rows.temperature_resolution,
    degree=1,
    formula="Δf_{p}/g = {coefficient} (T − 20 °C) n_{p}",
)
