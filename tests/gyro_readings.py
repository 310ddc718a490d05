"""What the gyro block, extended by effects, reads over a lively motion with uneven steps."""

from collections.abc import Sequence

import numpy as np

from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.fmus.source import instantiate, references
from trihedron.models.effects import CATALOGUE, EffectPlace, MotionRows, parameter_name

G = 9.80665
PERIOD = 0.01
STEPS = 60


def lively_motion(*, even: bool = False) -> MotionRows:
    """Mean rates, inputs and temperature over steps of 10 ms, uneven by up to a fifth unless they are even."""
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
    """Rates (N, 3) [rad/s] that a component of gyros puts out when it is fed with increments and what goes with them.

    Parameters
    ----------
    effects : sequence of (place, values)
        composed into the component
    rows : MotionRows
    name : str
        GyroBlock, or GyroCompensation: then the rows are readings
    regular : bool
        the steps are the nominal period, and the lengths in the rows are what the time stamps say
    settings
        of the component's parameters
    """
    component = extend(components()[name], [place for place, _ in effects])
    at = references(component)
    model = instantiate(component)

    def give(variable: str, values: np.ndarray | float) -> None:
        for i, value in enumerate(np.ravel(values)):
            model.set(at[f"{variable}[{i + 1}]" if np.ndim(values) else variable], float(value))

    for variable, values in settings.items():
        give(variable, values)
    for place, values in effects:
        for parameter, value in zip(CATALOGUE[place.effect].at(place).parameters, values, strict=True):
            give(parameter_name(place, parameter.name), value)
    shown = np.zeros_like(rows.rate)
    given, out = ("increment", "rate_reading") if name == "GyroBlock" else ("increment_reading", "rate")
    steps = np.full_like(rows.step, rows.period) if regular else rows.step
    time = 0.0
    for k in range(-1, len(shown)):
        n = max(k, 0)
        give(given, rows.rate[n] * steps[n])
        give("interval", rows.step[n])
        give("specific_force", G * rows.specific_force[n])
        give("temperature", 20.0 if rows.temperature is None else rows.temperature[n])
        if k < 0:
            assert model.initialise(0.0) == 0
            continue
        assert model.do_step(time, steps[k]) == 0
        time += steps[k]
        shown[k] = [model.get(at[f"{out}[{i + 1}]"]) for i in range(3)]
    return shown
