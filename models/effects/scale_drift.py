"""Scale factor that grows with time."""

from ..restricted import HOURS, Vector
from .definition import EffectParameter, accelerometer_effect, own_input


def scale_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours·n_p to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS] * n[p]


EFFECT = accelerometer_effect(
    scale_drift,
    EffectParameter("rate", "1/h", "growth of the scale factor with time", 1e-1),
    lambda place, rows: rows.hours * own_input(place, rows),
    "the scale factor of accelerometer {p} drifts by {rate:+.2e} an hour",
    degree=1,
    formula="Δf_{p}/g = {rate} t n_{p}, t 'in hours'",
)
