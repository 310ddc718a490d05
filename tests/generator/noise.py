"""Time series of noise processes, and static records of them, made without the code under test."""

import math
from collections.abc import Mapping
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from trihedron.tools.records import StrapdownRecord

GRAVITY = 9.80665
Value = TypeVar("Value")


def known(value: Value | None) -> Value:
    """Return a value that must not be missing."""
    assert value is not None
    return value


def noise_series(
    rows: int, step: float, sizes: Mapping[str, float], seed: int, correlation_time: float = 20.0
) -> NDArray[np.float64]:
    """Return readings (rows,) with the processes of these coefficients: N, Q, B, K, M and R, in their letters.

    Flicker is a sum of first-order Markov processes, four a decade, from a tenth of a step to a hundred records.
    """
    draws = np.random.default_rng(seed)
    values = sizes.get("N", 0.0) / math.sqrt(step) * draws.standard_normal(rows)
    if "Q" in sizes:
        values += np.diff(sizes["Q"] * draws.standard_normal(rows + 1)) / step
    if "K" in sizes:
        values += np.cumsum(sizes["K"] * math.sqrt(step) * draws.standard_normal(rows))
    if "M" in sizes:
        values += sizes["M"] * _markov(rows, step / correlation_time, draws)
    if "R" in sizes:
        values += sizes["R"] * step * np.arange(rows)
    if "B" in sizes:
        ratio = 10.0**0.25
        times = np.geomspace(0.1 * step, 100.0 * rows * step, 1 + round(math.log(1000.0 * rows) / math.log(ratio)))
        spread = sizes["B"] * math.sqrt(math.log(ratio) / math.pi)
        for time in times:
            values += spread * _markov(rows, step / time, draws)
    return values


def _markov(rows: int, rate: float, draws: np.random.Generator) -> NDArray[np.float64]:
    """Return a stationary first-order Markov process of standard deviation one; `rate`: steps over correlation time."""
    decay = math.exp(-rate)
    drive = math.sqrt(-math.expm1(-2.0 * rate)) * draws.standard_normal(rows)
    drive[0] = draws.standard_normal()
    return np.asarray(lfilter([1.0], [1.0, -decay], drive))


def static_record(
    rows: int, step: float, gyro: Mapping[str, float], accelerometer: Mapping[str, float], seed: int
) -> StrapdownRecord:
    """Return a record of a block that stands still, axis 3 up, with the same processes on each axis of a sensor."""
    rates = [noise_series(rows, step, gyro, 10 * seed + axis) for axis in range(3)]
    forces = [noise_series(rows, step, accelerometer, 10 * seed + 3 + axis) for axis in range(3)]
    force = np.stack(forces, axis=1) + np.array([0.0, 0.0, GRAVITY])
    return StrapdownRecord(
        time_s=step * np.arange(rows), rate=np.stack(rates, axis=1), increment=None, specific_force=force
    )
