"""Benches and records for the tests of the calibration, made with the model of elementary parameters."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trihedron.models.bench import ELEMENTARY, TARGETS, elementary_reading
from trihedron.tools.calibration import Calibration
from trihedron.tools.calibration.correction import Correction, corrected
from trihedron.tools.calibration.result import Estimate
from trihedron.tools.records import PositionRecord

GRAVITY = 9.80665
ALPHA, BETA = (np.radians(grid.ravel()) for grid in np.meshgrid(20 + 45 * np.arange(8), [25, 145, 265], indexing="ij"))
"""24 positions at which the signs of all inputs are certain."""


def random_bench(rng: np.random.Generator, u: float = 3e-3, v: float = 1e-2) -> NDArray:
    """Elementary parameters (24,) of case (A1) for which every X of the paper keeps within u and v."""
    reach = dict.fromkeys(ELEMENTARY, v / 3)
    reach |= {"kappa": u, "epsilon": u, "alpha_offset": u / 2, "alpha_star": u / 2}
    reach |= {name: 2 * v / 3 for name in ELEMENTARY if name.startswith("scale")}
    reach |= {"gamma_12": 0.0, "gamma_13": 0.0, "gamma_23": 0.0, "bias_1": v, "bias_2": v, "bias_3": v}
    size = np.array([reach[name] for name in ELEMENTARY])
    return rng.uniform(-size, size)


def record(
    reading: NDArray,
    alpha: ArrayLike = ALPHA,
    beta: ArrayLike = BETA,
    mounting: Sequence[str] | None = None,
    resolution: float = 0.0,
) -> PositionRecord:
    """The position record of readings (N, 3) in g."""
    count = len(reading)
    return PositionRecord(
        position=np.arange(1, count + 1),
        time_s=30.0 * np.arange(count),
        alpha=np.asarray(alpha, dtype=float),
        beta=np.asarray(beta, dtype=float),
        specific_force=reading * GRAVITY,
        mounting=None if mounting is None else tuple(mounting),
        resolution=resolution,
    )


def simulated(
    bench: NDArray,
    alpha: ArrayLike = ALPHA,
    beta: ArrayLike = BETA,
    noise: ArrayLike = 0.0,
    mounting: ArrayLike | None = None,
) -> PositionRecord:
    """The record of a bench with noise (N, 3) [g], in one mounting."""
    q = np.eye(3) if mounting is None else mounting
    return record(elementary_reading(bench, alpha, beta, q) + noise, alpha, beta)


def interval(estimate: Estimate) -> tuple[float, float]:
    """Both ends of an estimate's interval."""
    assert estimate.low is not None
    assert estimate.high is not None
    return estimate.low, estimate.high


def half_width(estimate: Estimate) -> float:
    """Half the width of an estimate's interval."""
    low, high = interval(estimate)
    return (high - low) / 2


def guaranteed(estimate: Estimate) -> float:
    """An estimate's guaranteed error."""
    assert estimate.guaranteed_error is not None
    return estimate.guaranteed_error


def misses(result: Calibration, truth: Iterable[float]) -> list[str]:
    """Symbols of which something that was promised does not hold: interval, error bound, guaranteed error."""
    assert result.verdict == "consistent"
    missed = []
    for e, x in zip(result.parameters, truth, strict=True):
        low, high = interval(e)
        assert e.estimate is not None
        assert e.error_bound is not None
        assert e.a_priori is not None
        held = low <= x <= high and low <= e.estimate <= high
        if not (held and abs(e.estimate - x) <= e.error_bound and abs(e.a_priori - x) <= guaranteed(e)):
            missed.append(e.symbol)
    return missed


def tilt_left(correction: Correction, truth: Iterable[float], seed: int = 1) -> float:
    """Error of the vertical [rad], root mean square over attitudes, that corrected readings of the true block give."""
    n = np.random.default_rng(seed).normal(size=(500, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    x = dict(zip(TARGETS, truth, strict=True))
    scale = np.where(n > 0, [x["X4"], x["X9"], x["X14"]], [x["X5"], x["X10"], x["X15"]])
    reading = n * (1.0 + scale) + [x["X16"], x["X17"], x["X18"]]
    reading[:, 1] += x["X6+X8"] * n[:, 0]
    reading[:, 2] += x["X7+X12"] * n[:, 0] + x["X11+X13"] * n[:, 1]
    better = corrected(correction, GRAVITY * reading) / GRAVITY
    return float(np.sqrt(np.mean(np.sum(np.cross(better, n) ** 2, axis=1))))
