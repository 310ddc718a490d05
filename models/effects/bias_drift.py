"""Bias that grows with time."""

from ..restricted import HOURS, Vector
from .definition import EffectParameter, accelerometer_effect


def bias_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS]


EFFECT = accelerometer_effect(
    bias_drift,
    EffectParameter("rate", "g/h", "growth of the bias with time", 1e-1),
    lambda place, rows: rows.hours,
    "the bias of accelerometer {p} drifts by {rate:+.2e} g an hour",
    formula="Δf_{p}/g = {rate} t, t 'in hours'",
)
