"""What the gyros do otherwise as time goes on, and with what delay.

gyro_scale_drift
    scale factors grow with time
lag
    each gyro follows its rate through a low-pass of the first order
"""

import math
from collections.abc import Mapping

from ..restricted import HOURS, PREVIOUS_RATE, PREVIOUS_STEPS, STEP_LENGTH, Vector
from .definition import EffectParameter, EffectPlace, gyro_effect
from .gyro import gyro_columns, of_each_gyro, sentence_of


def gyro_scale_drift(context: Vector, rate: Vector, rate_1: float, rate_2: float, rate_3: float, added: Vector) -> None:
    """Add rate·hours·ω_p to the reading of each gyro p; the rates are in 1/h."""
    added[0] = added[0] + rate_1 * context[HOURS] * rate[0]
    added[1] = added[1] + rate_2 * context[HOURS] * rate[1]
    added[2] = added[2] + rate_3 * context[HOURS] * rate[2]


SCALE_DRIFT = gyro_effect(
    gyro_scale_drift,
    of_each_gyro("rate", "1/h", "growth of the scale factor", 5.0),
    lambda place, rows: gyro_columns(rows.rate * rows.hours[:, None]),
    sentence_of("the scale factors of the gyros drift", "an hour"),
    formula="Δω = ({rate_1} ω_1, {rate_2} ω_2, {rate_3} ω_3) t, t 'in hours'",
)


def lag_of(context: Vector, rate: Vector, p: int, time: float, added: Vector) -> None:
    """Add what gyro p lacks that follows its rate through a low-pass of the first order with a time constant [s].

    Exact for rates that hold over the steps, but for what is older than eight steps: there they go on in a straight
    line.
    """
    if time > 0.0:
        steps = time / context[STEP_LENGTH]
        kept = math.exp(-1.0 / steps)
        # The state of the low-pass at the beginning of the step, from the oldest rate on.
        newest = context[PREVIOUS_RATE + p]
        state = context[PREVIOUS_RATE + 3 * (PREVIOUS_STEPS - 1) + p]
        growth = (newest - state) / (PREVIOUS_STEPS - 1)
        state = state - growth * kept / (1.0 - kept)
        for k in range(PREVIOUS_STEPS - 1):
            past = context[PREVIOUS_RATE + 3 * (PREVIOUS_STEPS - 2 - k) + p]
            state = past + (state - past) * kept
        added[p] = added[p] + (state - rate[p]) * steps * (1.0 - kept)


def lag(context: Vector, rate: Vector, time_1: float, time_2: float, time_3: float, added: Vector) -> None:
    """Follow each rate through a low-pass of the first order with a time constant of its own [s]."""
    lag_of(context, rate, 0, time_1, added)
    lag_of(context, rate, 1, time_2, added)
    lag_of(context, rate, 2, time_3, added)


def lag_sentence(place: EffectPlace, values: Mapping[str, float]) -> str:
    """Time constants in milliseconds."""
    constants = ", ".join(f"{1e3 * value:.4g}" for value in values.values())
    return f"the gyros follow the rate through a low-pass of the first order, time constants {constants} ms"


LAG = gyro_effect(
    lag,
    tuple(EffectParameter(f"time_{p}", "s", f"time constant of gyro {p}", 0.2, smallest=0.0) for p in (1, 2, 3)),
    lambda place, rows: gyro_columns((rows.rate_before - rows.rate) / rows.step[:, None]),
    lag_sentence,
    contains=("latency",),
    formula="ω_read + ({time_1}, {time_2}, {time_3}) 's' dω_read/dt = ω",
)

EFFECTS = (SCALE_DRIFT, LAG)
