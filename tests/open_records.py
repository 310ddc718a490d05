"""Position records whose approaches leave some senses open, with faults in and outside the catalogue."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from simulated_bench import GRAVITY, random_bench, record
from trihedron.models.bench import ELEMENTARY, elementary_reading
from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord

SIGMA = 1e-5


@dataclass(frozen=True)
class Fault:
    """What is hidden: a change of the readings (N, 3) [g], and the effect that it is, if the catalogue has it."""

    change: NDArray
    place: EffectPlace | None = None
    value: float = 0.0


Hidden = Callable[[np.random.Generator, NDArray, NDArray], Fault]
"""Generator, inputs (N, 3) [g], hours (N,) -> the fault."""


def on(p: int | np.integer, values: NDArray) -> NDArray:
    """Values (N,) in the readings of one accelerometer."""
    return values[:, None] * (np.arange(3) == p)


def step(rng: np.random.Generator, n: NDArray, hours: NDArray) -> Fault:
    """A bias that steps somewhere in the middle."""
    later = np.arange(len(hours)) >= rng.uniform(0.3, 0.7) * len(hours)
    return Fault(on(rng.integers(3), later * rng.uniform(4.0, 6.0) * SIGMA))


def fifth_power(rng: np.random.Generator, n: NDArray, hours: NDArray) -> Fault:
    """A response to the fifth power of the input."""
    p = rng.integers(3)
    return Fault(on(p, rng.uniform(1e-4, 2e-4) * n[:, p] ** 5))


def drift(rng: np.random.Generator, n: NDArray, hours: NDArray) -> Fault:
    """A bias that drifts by so many σ over the record."""
    p, rate = int(rng.integers(3)), rng.choice([-1.0, 1.0]) * rng.uniform(6.0, 9.0) * SIGMA / hours[-1]
    return Fault(on(p, rate * hours), EffectPlace("bias-drift", f"accelerometer-{p + 1}"), rate)


def outlier(rng: np.random.Generator, n: NDArray, hours: NDArray) -> Fault:
    """One reading that went wrong."""
    row, p, size = int(rng.integers(len(n))), int(rng.integers(3)), rng.uniform(7.0, 12.0) * SIGMA
    where = EffectPlace("outlier", f"position-{row + 1}", axes=(p + 1,))
    return Fault(on(p, size * (np.arange(len(n)) == row)), where, size)


def open_record(seed: int, hidden: Hidden, count: int = 16) -> tuple[PositionRecord, Fault]:
    """A record at random positions, each approached at random, with noise within σ; and what is hidden in it."""
    rng = np.random.default_rng(seed)
    bench, none = random_bench(rng), np.zeros(len(ELEMENTARY))
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    n = elementary_reading(none, alpha, beta, np.eye(3))
    made = record(elementary_reading(bench, alpha, beta, np.eye(3)), alpha, beta)
    hours = (made.time_s - made.time_s[0]) / 3600.0
    fault = hidden(rng, n, hours)
    change = fault.change + rng.uniform(-SIGMA, SIGMA, n.shape)
    sides = rng.choice([-1.0, 1.0], (2, count))
    force = made.specific_force + GRAVITY * change
    return replace(made, specific_force=force, approach_alpha=sides[0], approach_beta=sides[1]), fault
