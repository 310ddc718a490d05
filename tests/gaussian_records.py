"""Clean records of positions with Gaussian, heavy-tailed or uniform errors, and their verdicts."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

import trihedron as th
from generator.positions import Session
from trihedron.tools.records import PositionRecord

DEVIATION = 5e-6
"""Standard deviation of an averaged reading [g]."""
ERRORS: Mapping[str, Callable[[np.random.Generator, tuple[int, int]], Any]] = {
    "Gaussian": lambda rng, shape: rng.normal(size=shape),
    "t(5)": lambda rng, shape: rng.standard_t(5, size=shape) / np.sqrt(5.0 / 3.0),
    "uniform": lambda rng, shape: rng.uniform(-np.sqrt(3.0), np.sqrt(3.0), shape),
}
"""Errors with a standard deviation of one."""


def clean_record(seed: int, count: int, errors: str, repeated: int = 0) -> PositionRecord:
    """Return a record of this number of positions with `repeated` of them visited twice."""
    rng = np.random.default_rng([seed, count])
    session = Session.drawn(rng, count)
    order = rng.permutation(count)
    first, again = order[:repeated], order[repeated : 2 * repeated]
    session.alpha[again], session.beta[again] = session.alpha[first], session.beta[first]
    return session.record(error=DEVIATION * ERRORS[errors](rng, (count, 3)))


def false_alarms(seeds: range, count: int, errors: str, repeated: int = 0) -> int:
    """Return the number of clean records that a calibration falsifies, with σ by repeats, or by the standard
    deviation."""
    deviation = None if repeated else DEVIATION
    verdicts = []
    for seed in seeds:
        verdicts.append(th.calibrate(clean_record(seed, count, errors, repeated), noise_sd=deviation).verdict)
    return verdicts.count("falsified")
