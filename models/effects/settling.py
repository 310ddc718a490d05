"""Effects that settle with a time constant that a diagnosis searches.

warm_up
    the bias of an accelerometer settles exponentially after the start
thermal_lag
    the bias of an accelerometer depends on a temperature that follows the measured one through a first-order lag
"""

import math

from ..restricted import HOURS, KEPT, TEMPERATURE, Vector
from .accelerometer import NOMINAL_TEMPERATURE
from .columns import TIME_CONSTANT
from .definition import EffectParameter, accelerometer_effect
from .last_stage import LAST_HOUR

LARGEST_OF_BIAS = 1e-1
LARGEST_PER_KELVIN = 1e-3


def warm_up(context: Vector, n: Vector, p: int, size: float, time_constant: float, added: Vector) -> None:
    """Add size (1 − e^(−t/τ)) to the reading of accelerometer p; a time constant of 0 means none."""
    if time_constant > 0.0:
        added[p] = added[p] + size * (1.0 - math.exp(-context[HOURS] / time_constant))


def thermal_lag(
    context: Vector, n: Vector, p: int, coefficient: float, settling: float, time_constant: float, added: Vector
) -> None:
    """Add c (T_lag − 20) + s e^(−t/τ) to the reading of accelerometer p; T_lag comes from `lagging_temperature`."""
    added[p] = added[p] + coefficient * (context[KEPT + p] - NOMINAL_TEMPERATURE)
    if time_constant > 0.0:
        added[p] = added[p] + settling * math.exp(-context[HOURS] / time_constant)


def lagging_temperature(
    context: Vector, before: Vector, p: int, coefficient: float, settling: float, time_constant: float, kept: Vector
) -> None:
    """Update the memory of temperature for accelerometer p: τ T_lag' = T − T_lag.

    `before` are hours and temperature [degC] of the step before. The temperature is taken as linear in time between,
    for which this is exact. It begins with the temperature at the start: another beginning is the part that settles.
    """
    temperature = context[TEMPERATURE]
    hours = context[HOURS] - before[0]
    if time_constant > 0.0 and hours > 0.0:
        left = math.exp(-hours / time_constant)
        behind = time_constant * (temperature - before[1]) / hours
        kept[p] = temperature - behind + (kept[p] - before[1] + behind) * left
    elif time_constant <= 0.0 or context[HOURS] <= 0.0:
        kept[p] = temperature


WARM_UP = accelerometer_effect(
    warm_up,
    (
        EffectParameter("size", "g", "by how much the bias changes until it has settled", LARGEST_OF_BIAS),
        EffectParameter("time_constant", "h", "τ of 1 − e^(−t/τ)", LAST_HOUR, smallest=0.0),
    ),
    "the bias of accelerometer {p} settles after the start: it changes by {size:+.2e} g with a time constant of "
    "{time_constant:.3g} h",
    searched=TIME_CONSTANT,
    contains=("bias-drift",),
    formula="Δf_{p}/g = {size} (1 − exp(−t/{time_constant}))",
)

THERMAL_LAG = accelerometer_effect(
    thermal_lag,
    (
        EffectParameter("coefficient", "g/K", "c of c (T_lag - 20 degC)", LARGEST_PER_KELVIN),
        EffectParameter("settling", "g", "what fades of a lag that begins at another temperature", LARGEST_OF_BIAS),
        EffectParameter("time_constant", "h", "τ of the lag", LAST_HOUR, smallest=0.0),
    ),
    "the bias of accelerometer {p} follows the temperature with a lag of {time_constant:.3g} h: {coefficient:+.2e} g "
    "per kelvin; {settling:+.2e} g of it, from before the first row, fade",
    searched=TIME_CONSTANT,
    memory=lagging_temperature,
    contains=("temperature-bias", "bias-drift"),
    formula="Δf_{p}/g = {coefficient} (T_lag − 20 °C) + {settling} e^(−t/{time_constant}), "
    "{time_constant} dT_lag/dt = T − T_lag",
)

EFFECTS = (WARM_UP, THERMAL_LAG)
