"""Bias that grows with time."""

from ..restricted import HOURS, Vector
from .definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def bias_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS]


EFFECT = Effect(
    name="bias-drift",
    places=on_accelerometers("bias-drift"),
    parameters=(EffectParameter("rate", "g/h", "growth of the bias with time", 1e-1),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=bias_drift,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, rows.hours),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the bias of accelerometer {place.index + 1} drifts by {values['rate']:+.2e} g an hour"
    ),
    formula="Δf_{p}/g = {rate} t, t 'in hours'",
)
