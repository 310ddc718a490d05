"""Comparison of a calibration's promises with the truth."""

from collections.abc import Iterable

import numpy as np

from generator import G
from trihedron.models.bench import TARGETS
from trihedron.tools.calibrated import Calibration, Parameter
from trihedron.tools.calibration import Correction, corrected


def interval(estimate: Parameter) -> tuple[float, float]:
    """Return both ends of an estimate's interval."""
    assert estimate.low is not None
    assert estimate.high is not None
    return estimate.low, estimate.high


def half_width(estimate: Parameter) -> float:
    """Return half the width of an estimate's interval."""
    low, high = interval(estimate)
    return (high - low) / 2


def guaranteed(estimate: Parameter) -> float:
    """Return an estimate's guaranteed error."""
    assert estimate.guaranteed_error is not None
    return estimate.guaranteed_error


def misses(result: Calibration, truth: Iterable[float]) -> list[str]:
    """Return the symbols with a broken promise: interval, error bound, guaranteed error."""
    assert result.verdict == "consistent"
    missed = []
    for e, x in zip(result.parameters, truth, strict=True):
        low, high = interval(e)
        assert e.estimate is not None
        assert e.error_bound is not None
        assert e.a_priori is not None
        inside = low <= x <= high and low <= e.estimate <= high
        if not (inside and abs(e.estimate - x) <= e.error_bound and abs(e.a_priori - x) <= guaranteed(e)):
            missed.append(e.symbol)
    return missed


def tilt_left(correction: Correction, truth: Iterable[float], seed: int = 1) -> float:
    """Return the error of the vertical [rad], root mean square over attitudes, of the true block's corrected
    readings."""
    n = np.random.default_rng(seed).normal(size=(500, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    x = dict(zip(TARGETS, truth, strict=True))
    scale = np.where(n > 0, [x["X4"], x["X9"], x["X14"]], [x["X5"], x["X10"], x["X15"]])
    reading = n * (1.0 + scale) + [x["X16"], x["X17"], x["X18"]]
    reading[:, 1] += x["X6+X8"] * n[:, 0]
    reading[:, 2] += x["X7+X12"] * n[:, 0] + x["X11+X13"] * n[:, 1]
    better = corrected(correction, G * reading) / G
    return float(np.sqrt(np.mean(np.sum(np.cross(better, n) ** 2, axis=1))))
