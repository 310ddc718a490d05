"""Changes of the gyros in time, and delays.

gyro_scale_drift
    scale factors grow with time
gyro_bias_step, gyro_scale_step, latency_step
    biases, scale factors, the lag of the gyros change at a time
gyro_warm_up
    biases settle as an exponential of time
lag
    each gyro follows its rate through a low-pass of the first order
"""

import math
from collections.abc import Mapping

from ..restricted import HOURS, PREVIOUS_RATE, PREVIOUS_STEPS, RESPONSE, STEP_LENGTH, Vector
from .columns import ONSET, TIME_CONSTANT
from .definition import EffectParameter, EffectPlace, Sentence, gyro_effect
from .gyro import gyro_bias, latency, listed, of_each_gyro, sentence_of
from .last_stage import LAST_HOUR

START = EffectParameter("start", "h", "time after which it is so", LAST_HOUR, smallest=0.0)


def gyro_scale_drift(context: Vector, rate: Vector, rate_1: float, rate_2: float, rate_3: float, added: Vector) -> None:
    """Add rate·hours·ω_p to the reading of each gyro p; the rates are in 1/h."""
    added[0] = added[0] + rate_1 * context[HOURS] * rate[0]
    added[1] = added[1] + rate_2 * context[HOURS] * rate[1]
    added[2] = added[2] + rate_3 * context[HOURS] * rate[2]


SCALE_DRIFT = gyro_effect(
    gyro_scale_drift,
    of_each_gyro("rate", "1/h", "growth of the scale factor", 5.0),
    sentence_of("the scale factors of the gyros drift", "an hour"),
    formula="Δω = ({rate_1} ω_1, {rate_2} ω_2, {rate_3} ω_3) t, t 'in hours'",
)


def changed(words: str, unit: str) -> Sentence:
    """Return a sentence on the quantity, size and time of a change."""

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        *sizes, start = values.values()
        return f"{words} change by {listed(sizes)}" + (f" {unit}" if unit else "") + f" at {3600.0 * start:.5g} s"

    return say


def gyro_bias_step(
    context: Vector, rate: Vector, size_1: float, size_2: float, size_3: float, start: float, added: Vector
) -> None:
    """Add a constant [rad/s] to each gyro's reading after `start` hours."""
    if context[HOURS] > start:
        gyro_bias(context, rate, size_1, size_2, size_3, added)


BIAS_STEP = gyro_effect(
    gyro_bias_step,
    (*of_each_gyro("size", "rad/s", "change of the bias", 0.2), START),
    changed("the biases of the gyros", "rad/s"),
    searched=ONSET,
    contains=("gyro-bias",),
    formula="Δω = ({size_1}, {size_2}, {size_3}) 'rad/s from' t = {start} 'h on'",
)


def gyro_warm_up(
    context: Vector, rate: Vector, size_1: float, size_2: float, size_3: float, time_constant: float, added: Vector
) -> None:
    """Add to each gyro's reading a bias [rad/s] that fades with a time constant [h]."""
    if time_constant > 0.0:
        part = math.exp(-context[HOURS] / time_constant)
        gyro_bias(context, rate, size_1 * part, size_2 * part, size_3 * part, added)


def warm_up_sentence(place: EffectPlace, values: Mapping[str, float]) -> str:
    """Sizes, and the time constant in seconds."""
    *sizes, time = values.values()
    return f"the biases of the gyros settle from {listed(sizes)} rad/s with a time constant of {3600.0 * time:.4g} s"


WARM_UP = gyro_effect(
    gyro_warm_up,
    (
        *of_each_gyro("size", "rad/s", "bias at the beginning", 0.2),
        EffectParameter("time_constant", "h", "of the exponential", LAST_HOUR, smallest=0.0),
    ),
    warm_up_sentence,
    searched=TIME_CONSTANT,
    contains=("gyro-bias", "gyro-bias-drift"),
    formula="Δω = ({size_1}, {size_2}, {size_3}) e^(−t / ({time_constant} 'h')) 'rad/s'",
)


def gyro_scale_step(
    context: Vector, rate: Vector, size_1: float, size_2: float, size_3: float, start: float, added: Vector
) -> None:
    """Add size·ω_p to the reading of each gyro p after `start` hours."""
    if context[HOURS] > start:
        added[0] = added[0] + size_1 * rate[0]
        added[1] = added[1] + size_2 * rate[1]
        added[2] = added[2] + size_3 * rate[2]


SCALE_STEP = gyro_effect(
    gyro_scale_step,
    (*of_each_gyro("size", "1", "change of the scale factor", 0.2), START),
    changed("the scale factors of the gyros", ""),
    searched=ONSET,
    formula="Δω = ({size_1} ω_1, {size_2} ω_2, {size_3} ω_3) 'from' t = {start} 'h on'",
)


def latency_step(context: Vector, rate: Vector, change: float, start: float, added: Vector) -> None:
    """Read the rate of an earlier time, from `start` hours on."""
    if context[HOURS] > start:
        latency(context, rate, change, added)


LATENCY_STEP = gyro_effect(
    latency_step,
    (EffectParameter("change", "s", "of the gyros' lag", 0.2), START),
    lambda place, values: (
        f"the lag of the gyros changes by {1e3 * values['change']:+.4g} ms at {3600.0 * values['start']:.5g} s"
    ),
    searched=ONSET,
    contains=("latency",),
    formula="ω_read(t) = ω(t − ({change}) 's') 'from' t = {start} 'h on'",
)


def lag_of(context: Vector, rate: Vector, p: int, time: float, added: Vector) -> None:
    """Add the difference of gyro p behind a low-pass of the first order with a time constant [s].

    Its inputs are the rates in the gyros' own response. Exact for rates that hold over the steps, up to eight steps
    back; older rates continue in a straight line.
    """
    if time > 0.0:
        steps = time / context[STEP_LENGTH]
        kept = math.exp(-1.0 / steps)
        # The state of the low-pass at the beginning of the step, from the oldest rate on.
        for q in range(3):
            newest = context[PREVIOUS_RATE + q]
            state = context[PREVIOUS_RATE + 3 * (PREVIOUS_STEPS - 1) + q]
            growth = (newest - state) / (PREVIOUS_STEPS - 1)
            state = state - growth * kept / (1.0 - kept)
            for k in range(PREVIOUS_STEPS - 1):
                past = context[PREVIOUS_RATE + 3 * (PREVIOUS_STEPS - 2 - k) + q]
                state = past + (state - past) * kept
            response = context[RESPONSE + 3 * p + q]
            added[p] = added[p] + response * (state - rate[q]) * steps * (1.0 - kept)


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
    lag_sentence,
    contains=("latency",),
    formula="ω_read + ({time_1}, {time_2}, {time_3}) 's' dω_read/dt = ω",
)

EFFECTS = (SCALE_DRIFT, BIAS_STEP, SCALE_STEP, LATENCY_STEP, WARM_UP, LAG)
