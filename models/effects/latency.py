"""Latency: the gyros read the rate of a while ago."""

import math

from ..restricted import PREVIOUS_RATE, PREVIOUS_STEPS, STEP_LENGTH, Vector
from .definition import EffectParameter, gyro_effect


def latency(context: Vector, rate: Vector, delay: float, added: Vector) -> None:
    """Read the mean rate over a step that ended `delay` ago: the rates hold over the steps before.

    Exact for delays of up to eight steps; beyond, and for gyros that lead, the rate is carried on in a straight line.
    """
    steps = delay / context[STEP_LENGTH]
    back = 0
    if steps > 0.0:
        back = int(math.floor(steps))
    if back > PREVIOUS_STEPS - 1:
        back = PREVIOUS_STEPS - 1
    for p in range(3):
        late = context[PREVIOUS_RATE + 3 * back + p]
        if steps > 1.0 * PREVIOUS_STEPS:
            added[p] = added[p] + (late - rate[p]) * (steps / PREVIOUS_STEPS)
        else:
            near = rate[p]
            if back > 0:
                near = context[PREVIOUS_RATE + 3 * back - 3 + p]
            added[p] = added[p] + (near - rate[p]) + (late - near) * (steps - back)


EFFECT = gyro_effect(
    latency,
    EffectParameter("delay", "s", "by which the gyros lag; negative: they lead", 0.2),
    lambda place, rows: ((rows.rate_before - rows.rate) / rows.step[:, None])[..., None],
    lambda place, values: (
        f"the gyros lag by {1e3 * values['delay']:.3f} ms"
        if values["delay"] >= 0.0
        else f"the gyros lead by {-1e3 * values['delay']:.3f} ms"
    ),
    formula="ω_read(t) = ω(t − ({delay}) 's')",
)
