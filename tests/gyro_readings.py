"""Readings of the gyro block, extended by effects, over a lively motion with uneven steps."""

from collections.abc import Sequence

import numpy as np

from named import Named
from trihedron.models.effects import EffectPlace, MotionRows

G = 9.80665
PERIOD = 0.01
STEPS = 60


def lively_motion(*, even: bool = False) -> MotionRows:
    """Return mean rates, inputs and temperature over steps of 10 ms, uneven by up to a fifth unless `even`."""
    rng = np.random.default_rng(5)
    step = PERIOD * (np.ones(STEPS) if even else rng.uniform(0.8, 1.2, STEPS))
    time = np.cumsum(step)
    phase = np.array([0.3, 1.1, 2.0])
    rate = np.sin(np.outer(time, [7.0, 5.0, 9.0]) + phase) * [2.0, -3.0, 1.5] + [0.2, 0.0, -0.4]
    force = np.cos(np.outer(time, [3.0, 4.0, 2.0]) + phase)
    return MotionRows(
        rate=rate,
        rate_before=np.vstack([rate[:1], rate[:-1]]),
        specific_force=force,
        hours=time / 3600.0,
        step=step,
        temperature=20.0 + 5.0 * np.sin(time),
        period=PERIOD,
    )


def gyro_readings(
    effects: Sequence[tuple[EffectPlace, Sequence[float] | np.ndarray]],
    rows: MotionRows,
    name: str = "GyroBlock",
    *,
    regular: bool = False,
    **settings,
) -> np.ndarray:
    """Return rates (N, 3) [rad/s] of a gyro component driven with increments and their circumstances.

    Parameters
    ----------
    effects : sequence of (place, values)
        effects composed into the component
    rows : MotionRows
        the motion
    name : str
        GyroBlock, or GyroCompensation: then the rows are readings
    regular : bool
        True if the steps are the nominal period, and the lengths in the rows are time stamps
    settings
        parameters of the component
    """
    model = Named(name, {place: list(values) for place, values in effects}, **settings)
    rates = np.zeros_like(rows.rate)
    source, out = ("increment", "rate_reading") if name == "GyroBlock" else ("increment_reading", "rate")
    steps = np.full_like(rows.step, rows.period) if regular else rows.step
    warm = np.full_like(steps, 20.0) if rows.temperature is None else rows.temperature
    time = 0.0
    for k in range(-1, len(rates)):
        n = max(k, 0)
        model.put(**{source: rows.rate[n] * steps[n]}, interval=rows.step[n], temperature=warm[n])
        model.put(specific_force=G * rows.specific_force[n])
        if k < 0:
            model.begin()
            continue
        model.step(time, steps[k])
        time += steps[k]
        rates[k] = model[out]
    return rates
