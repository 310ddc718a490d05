"""Observed orders of every attitude algorithm, in multiple precision: the original kernels, fifty digits."""

import random
from dataclasses import replace
from fractions import Fraction
from functools import cache
from itertools import pairwise

import mpmath
import pytest
from mpmath import mpf

from attitude_kernels import angle_between, product, updater
from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm

HALF = mpf(1) / 2

# Angular rate as a cubic polynomial of time [rad/s], and one of degree 12: only this one shows the order of an
# algorithm that represents a cubic rate exactly.
CUBIC = [[mpf(x) / 10 for x in row] for row in ((9, -4, 7), (5, 11, -6), (-12, 3, 8), (4, -9, 5))]
_DRAW = random.Random(3)
HIGH = CUBIC + [[mpf(_DRAW.randint(-20, 20)) / 10 for _ in range(3)] for _ in range(9)]


@pytest.fixture(autouse=True)
def _fifty_digits():
    with mpmath.workdps(50):
        yield


def rates_for(algorithm: Algorithm) -> list:
    return (
        HIGH
        if algorithm.kernel.__name__ in ("functional_iteration", "rodrigues_iteration", "adaptive_degree")
        else CUBIC
    )


@cache
def attitude_series(high: bool, terms: int = 90) -> list[list]:
    """Return coefficients of the power series of the attitude from the identity at 0, by the kinematic equation."""
    rates = HIGH if high else CUBIC
    series = [[mpf(1), mpf(0), mpf(0), mpf(0)]]
    for k in range(terms):
        total = [mpf(0)] * 4
        for j, rate in enumerate(rates[: k + 1]):
            total = [a + b for a, b in zip(total, product(series[k - j], [mpf(0), *rate]), strict=True)]
        series.append([a / (2 * (k + 1)) for a in total])
    return series


def attitude(rates: list, time: mpf) -> list:
    """Return the attitude at `time` from the identity at 0: the power series, summed to its end."""
    value = [mpf(0)] * 4
    for coefficient in reversed(attitude_series(rates is HIGH)):
        value = [a * time + b for a, b in zip(value, coefficient, strict=True)]
    return value


def increments(rates: list, begin: mpf, length: mpf, count: int) -> list:
    """Return flat exact increments over `count` equal parts."""

    def angle(time: mpf, axis: int) -> mpf:
        return sum((rate[axis] * time ** (k + 1) / (k + 1) for k, rate in enumerate(rates)), mpf(0))

    moments = [begin + length * m / count for m in range(count + 1)]
    return [angle(b, i) - angle(a, i) for a, b in pairwise(moments) for i in range(3)]


def local_order(algorithm: Algorithm) -> float:
    """Return the power of the step in the error of one update, with the previous step known."""
    rates, update, begin = rates_for(algorithm), updater(algorithm), mpf(1) / 8
    errors = []
    for step in (HALF**7, HALF**8):
        start = attitude(rates, begin)
        true = product([start[0], -start[1], -start[2], -start[3]], attitude(rates, begin + step))
        g = increments(rates, begin, step, algorithm.samples)
        errors.append(angle_between(update(g, increments(rates, begin - step, step, algorithm.samples)), true))
    return float(mpmath.log(errors[0] / errors[1], 2))


def run(algorithm: Algorithm, steps: int, span: mpf) -> list:
    """Return the attitude after `steps` updates over `span`, not renormalised."""
    rates, update = rates_for(algorithm), updater(algorithm)
    attitude, before = [mpf(1), mpf(0), mpf(0), mpf(0)], None
    for k in range(steps):
        g = increments(rates, k * span / steps, span / steps, algorithm.samples)
        attitude, before = product(attitude, update(g, before)), g
    return attitude


def global_orders(algorithm: Algorithm) -> tuple[float, float | None]:
    """Return powers of the step in the attitude's error over a fixed time and in the norm's, None for rounding."""
    span = mpf(1) / 8
    true = attitude(rates_for(algorithm), span)
    coarse, fine = (run(algorithm, steps, span) for steps in (4, 8))
    errors = [angle_between(q, true) for q in (coarse, fine)]
    defects = [abs(sum(x * x for x in q) - 1) for q in (coarse, fine)]
    norm = float(mpmath.log(defects[0] / defects[1], 2)) if min(defects) > mpf(10) ** -45 else None
    return float(mpmath.log(errors[0] / errors[1], 2)), norm


@pytest.mark.first(3)
@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_observed_orders_are_those_that_are_stated(algorithm: Algorithm) -> None:
    assert local_order(algorithm) == pytest.approx(algorithm.order + 1, abs=0.05)
    attitude_order, norm_order = global_orders(algorithm)
    assert attitude_order == pytest.approx(algorithm.order, abs=0.05)
    if algorithm.norm_order is None:
        # A functional iteration leaves the sphere by less than its own method error.
        assert norm_order is None or norm_order > algorithm.order + 1
    else:
        assert norm_order == pytest.approx(algorithm.norm_order, abs=0.05)


@pytest.mark.parametrize(
    "wrong",
    [
        pytest.param({22: Fraction(32, 45), 32: Fraction(22, 45)}, id="swapped"),
        pytest.param({22: Fraction(22, 45), 32: Fraction(32, 55)}, id="32/55"),
    ],
)
def test_panov_with_wrong_constants_is_second_order(wrong: dict) -> None:
    panov = next(a for a in ALGORITHMS if a.name == "panov")
    products = tuple((i, j, wrong[(45 * k).numerator]) for i, j, k in panov.products)
    assert local_order(replace(panov, products=products)) == pytest.approx(3.0, abs=0.05)


def test_23_differs_from_22_by_the_picard_term_that_it_leaves_out() -> None:
    """x of (23) less x of (22) is s × (γ' × γ'')/48 with s = γ' + γ''; (22) is the third Picard iterate."""
    by_name = {a.name: a for a in ALGORITHMS}
    first, second = [mpf(3), mpf(-1), mpf(2)], [mpf(4), mpf(1), mpf(-2)]
    x = []
    for name in ("two-sample-rodrigues", "two-sample-rodrigues-second-iterate"):
        q = updater(by_name[name])([v / 1000 for v in first + second], None)
        x.append([q[i] / (1 + q[0]) for i in (1, 2, 3)])

    def cross(p: list, q: list) -> list:
        return [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]

    total = [a + b for a, b in zip(first, second, strict=True)]
    expected = [v / mpf(10) ** 9 / 48 for v in cross(total, cross(first, second))]
    for i in range(3):
        assert abs(x[1][i] - x[0][i] - expected[i]) < mpf(10) ** -40


def test_the_23_of_the_paper_is_third_order_and_the_722_fourth() -> None:
    """The paper calls (23) a fourth-order algorithm and (7.22) a third-order one."""
    by_source = {a.source: a.order for a in ALGORITHMS}
    assert by_source["Chelnokov et al. 2016, (23)"] == 3
    assert by_source["Chelnokov et al. 2016, (7.22)"] == 4
