"""Scale factor that grows with time."""

from ..restricted import HOURS, Vector
from .definition import (
    Effect,
    EffectParameter,
    accelerometer_column,
    accelerometer_number,
    on_accelerometers,
    only_coefficient,
)


def scale_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours·n_p to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS] * n[p]


EFFECT = Effect(
    name="scale-drift",
    places=on_accelerometers("scale-drift"),
    parameters=(EffectParameter("rate", "1/h", "growth of the scale factor with time", 1e-1),),
    component="AccelerometerBlock",
    stage="reading_effects",
    kernel=scale_drift,
    place_numbers=accelerometer_number,
    signature=lambda place, rows: accelerometer_column(place, rows.hours * rows.n[:, place.index]),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the scale factor of accelerometer {place.index + 1} drifts by {values['rate']:+.2e} an hour"
    ),
    degree=1,
    formula="Δf_{p}/g = {rate} t n_{p}, t 'in hours'",
)
