"""Drift of every algorithm under coning against the analytic rate, in multiple precision."""

from collections.abc import Sequence
from fractions import Fraction

import mpmath
import pytest
from mpmath import mpf

from attitude_kernels import product, updater
from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm, adaptive
from trihedron.models.attitude_algorithms.definition import SUM

PHASES = ("0.05", "0.1", "0.2", "0.4", "0.8", "1.571")
BY_NAME = {a.name: a for a in ALGORITHMS}


@pytest.fixture(autouse=True)
def _fifty_digits():
    with mpmath.workdps(50):
        yield


def coning(cone: mpf, time: mpf) -> list:
    """Return the attitude of a body whose axis moves round a cone of half-angle `cone` at 1 rad/s."""
    half = cone / 2
    return [mpmath.cos(half), mpmath.sin(half) * mpmath.cos(time), mpmath.sin(half) * mpmath.sin(time), mpf(0)]


def coning_increments(cone: mpf, begin: mpf, sample: mpf, count: int) -> list:
    """Return integrals of ω = (-sin a sin t, sin a cos t, cos a - 1)."""
    g = []
    for m in range(count):
        a, b = begin + m * sample, begin + (m + 1) * sample
        g += [
            mpmath.sin(cone) * (mpmath.cos(b) - mpmath.cos(a)),
            mpmath.sin(cone) * (mpmath.sin(b) - mpmath.sin(a)),
            (mpmath.cos(cone) - 1) * (b - a),
        ]
    return g


def conjugate(q: Sequence) -> list:
    return [q[0], -q[1], -q[2], -q[3]]


def relative_drift(algorithm: Algorithm, sample: mpf, cone: mpf) -> mpf:
    """Return the error of the drift about the cone's axis, divided by the coning rate 1 - cos a.

    Coning repeats itself from step to step except for a turn about that axis, so one update gives the drift.
    """
    update, span = updater(algorithm), sample * algorithm.samples
    g = coning_increments(cone, mpf(0), sample, algorithm.samples)
    computed = product(coning(cone, mpf(0)), update(g, coning_increments(cone, -span, sample, algorithm.samples)))
    error = product(computed, conjugate(coning(cone, span)))
    length = mpmath.sqrt(error[1] ** 2 + error[2] ** 2 + error[3] ** 2)
    return 2 * mpmath.atan2(length, error[0]) * error[3] / length / (span * (1 - mpmath.cos(cone)))


def polynomial_products(count: int) -> dict[tuple[int, int], Fraction]:
    """Return coefficients of γi × γj (i < j) in ½∫ α × ω dt for the polynomial through `count` increments, exactly."""

    def times(p: list, q: list) -> list:
        r = [Fraction(0)] * (len(p) + len(q) - 1)
        for i, a in enumerate(p):
            for j, b in enumerate(q):
                r[i + j] += a * b
        return r

    angles = []
    for sample in range(count):
        # The angle of increment `sample` alone: 0 before its end, 1 from there on, at the whole numbers.
        total = [Fraction(0)] * (count + 1)
        for m in range(sample + 1, count + 1):
            basis = [Fraction(1)]
            for k in range(count + 1):
                if k != m:
                    basis = times(basis, [Fraction(-k, m - k), Fraction(1, m - k)])
            total = [a + b for a, b in zip(total, basis, strict=True)]
        angles.append(total)
    rates = [[k * c for k, c in enumerate(p)][1:] for p in angles]
    result = {}
    for i in range(count):
        for j in range(i + 1, count):
            integrand = [a - b for a, b in zip(times(angles[i], rates[j]), times(angles[j], rates[i]), strict=True)]
            result[i, j] = (
                sum((c * Fraction(count) ** (k + 1) / (k + 1) for k, c in enumerate(integrand)), Fraction(0)) / 2
            )
    return result


def products_of(algorithm: Algorithm) -> dict[int, Fraction]:
    """Return coefficients of the vector products by the distance of their increments."""
    products = {(i, j): k for i, j, k in algorithm.products}
    if not products and algorithm.samples > 1:
        products = polynomial_products(algorithm.samples)
    by_distance: dict[int, Fraction] = {}
    for (i, j), value in products.items():
        # A product with the sum of earlier increments is one with each of them.
        for first in range(j) if i == SUM else [i]:
            by_distance[j - first] = by_distance.get(j - first, Fraction(0)) + value
    return by_distance


def analytic_drift(algorithm: Algorithm, x: mpf) -> mpf:
    """Return the relative drift for a vanishing cone: (Σ K_p 4 sin²(x/2) sin(p x) - (N x - sin N x)/2) / (N x/2)."""
    count = algorithm.samples
    factors = {p: mpf(k.numerator) / k.denominator for p, k in products_of(algorithm).items()}
    if algorithm.name == "adaptive-degree" and x > 0.6:
        count, factors = 1, {p: mpf(repr(getattr(adaptive, f"C_{p}"))) for p in range(1, 9)}
    drift = sum(k * 4 * mpmath.sin(x / 2) ** 2 * mpmath.sin(p * x) for p, k in factors.items())
    return (drift - (count * x - mpmath.sin(count * x)) / 2) / (count * x / 2)


FIXED = [a for a in ALGORITHMS if a.name != "adaptive-degree"]


@pytest.mark.first(1)
@pytest.mark.parametrize("algorithm", FIXED, ids=lambda a: a.name)
def test_drift_is_the_analytic_one(algorithm: Algorithm) -> None:
    for phase in PHASES:
        x = mpf(phase)
        drift = relative_drift(algorithm, x, mpf(10) ** -12)
        assert drift == pytest.approx(analytic_drift(algorithm, x), rel=1e-9)


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_drift_falls_with_the_stated_power(algorithm: Algorithm) -> None:
    fine, coarse = (relative_drift(algorithm, mpf(x), mpf(10) ** -12) for x in ("0.02", "0.04"))
    assert mpmath.log(coarse / fine, 2) == pytest.approx(algorithm.coning_order, abs=0.05)


def test_products_of_polynomial_rates_are_those_of_the_polynomial() -> None:
    for name, count in (("two-sample-rotation-vector", 2), ("four-sample-rotation-vector", 4)):
        assert {(i, j): k for i, j, k in BY_NAME[name].products} == polynomial_products(count)


ONE_DEGREE = {
    # Published values at half-angle 1 degree.
    "mean-rate": (-4.17e-04, -1.67e-03, -6.65e-03, -2.65e-02, -1.03e-01, -3.63e-01),
    "one-sample-rodrigues": (-2.08e-07, -3.33e-06, -5.31e-05, -8.37e-04, -1.27e-02, -1.51e-01),
    "two-sample-quaternion": (-2.08e-07, -3.33e-06, -5.30e-05, -8.36e-04, -1.26e-02, -1.51e-01),
    "two-sample-rodrigues": (-2.08e-07, -3.33e-06, -5.31e-05, -8.37e-04, -1.27e-02, -1.51e-01),
    "panov": (None, -1.34e-08, -8.48e-07, -5.21e-05, -2.85e-03, -9.49e-02),
    "four-sample-rotation-vector": (None, 2.03e-08, 1.28e-06, 7.76e-05, 3.93e-03, 7.75e-02),
    "three-sample-coning": (None, None, -4.56e-07, -2.88e-05, -1.67e-03, -6.66e-02),
    "four-sample-coning": (None, None, -8.06e-08, -3.83e-06, -3.06e-04, -3.02e-02),
}


@pytest.mark.parametrize("name", ONE_DEGREE)
def test_drift_on_a_cone_of_one_degree(name: str) -> None:
    for phase, expected in zip(PHASES, ONE_DEGREE[name], strict=True):
        if expected is not None:
            drift = relative_drift(BY_NAME[name], mpf(phase), mpmath.radians(1))
            assert float(drift) == pytest.approx(expected, rel=1e-2)


def test_the_adaptive_one_carries_a_cone_of_any_phase() -> None:
    """Compare eight at a time while the differences fall; above that, the error without the products with the eight
    before."""
    cone, fixed = BY_NAME["adaptive-degree"], BY_NAME["functional-iteration-8"]
    assert relative_drift(cone, mpf("0.5"), mpf(10) ** -6) == relative_drift(fixed, mpf("0.5"), mpf(10) ** -6)
    for phase in ("0.65", "0.8", "1.0", "1.2", "1.571", "1.8"):
        drift = relative_drift(cone, mpf(phase), mpf(10) ** -6)
        assert drift == pytest.approx(analytic_drift(cone, mpf(phase)), abs=1e-9)
        assert abs(drift) < 4.1e-5
