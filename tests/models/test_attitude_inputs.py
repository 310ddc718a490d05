"""Rates and mixed inputs of the attitude computer: orders in multiple precision, the computer, refusals."""

from fractions import Fraction

import mpmath
import numpy as np
import pytest
from mpmath import mpf
from test_attitude_order import HALF, HIGH, attitude, increments

from attitude_kernels import angle_between, precise_kernels, product, updater
from named import Named
from trihedron.models.attitude_algorithms import ALGORITHMS, INPUT_KINDS, Algorithm, order_with
from trihedron.models.attitude_algorithms.computer import MIXED, RATES, all_weights, weights_of

BY_NAME = {a.name: a for a in ALGORITHMS}
QUICK = ("mean-rate", "one-sample-rodrigues", "two-sample-rodrigues", "three-sample-uncompressed", "panov")
QUICK += ("four-sample-coning", "five-sample-coning", "functional-iteration-4", "adaptive-degree")
FALLEN = [pytest.param(a, marks=() if a.name in QUICK else pytest.mark.acceptance, id=a.name) for a in ALGORITHMS]


@pytest.fixture(autouse=True)
def _fifty_digits():
    with mpmath.workdps(50):
        yield


def rate_at(time: mpf) -> list:
    return [sum((c[i] * time**k for k, c in enumerate(HIGH)), mpf(0)) for i in range(3)]


def taken(algorithm: Algorithm, kind: str, begin: mpf, step: mpf) -> list:
    """Return increments of a step by the kernel, from exact inputs."""
    samples = algorithm.samples
    number = samples // 2 if kind == "mixed" else samples
    part = step / number
    inputs = [part * x for x in rate_at(begin)]
    for k in range(1, number + 1):
        if kind == "mixed":
            inputs += increments(HIGH, begin + (k - 1) * part, part, 1)
        inputs += [part * x for x in rate_at(begin + k * part)]
    exact = [x for mixed in (False, True) for n in range(1, 9) for x in _rows(n, mixed)]
    g = [mpf(0)] * (3 * samples)
    kernels = precise_kernels()
    kernels["increments_of_inputs"](MIXED if kind == "mixed" else RATES, samples, inputs, exact, g)
    return g


def _rows(samples: int, mixed: bool) -> list:
    if mixed and samples % 2:
        return [mpf(0)] * (samples * (samples + 1))
    return [mpf(x.numerator) / x.denominator for row in weights_of(samples, mixed) for x in row]


@pytest.mark.first(2)
@pytest.mark.parametrize("kind", INPUT_KINDS[1:])
@pytest.mark.parametrize("algorithm", FALLEN)
def test_order_with_rates_and_mixed_inputs_is_what_is_stated(algorithm: Algorithm, kind: str) -> None:
    stated = order_with(kind, algorithm)
    if stated is None:
        assert kind == "mixed"
        assert algorithm.samples % 2
        return
    begin, errors = mpf(1) / 8, []
    for step in (HALF**8, HALF**9):
        start = attitude(HIGH, begin)
        true = product([start[0], -start[1], -start[2], -start[3]], attitude(HIGH, begin + step))
        before = taken(algorithm, kind, begin - step, step)
        errors.append(angle_between(updater(algorithm)(taken(algorithm, kind, begin, step), before), true))
    assert float(mpmath.log(errors[0] / errors[1], 2)) == pytest.approx(stated + 1, abs=0.06)


def test_weights_are_those_of_known_rules() -> None:
    """Compare sums over the step: trapezoid, Simpson, 3/8, Boole; a half of a sample between two rates by hand."""
    sums = {n: [sum(column) for column in zip(*weights_of(n, False), strict=True)] for n in (1, 2, 3, 4)}
    assert sums[1] == [Fraction(1, 2)] * 2
    assert [3 * x for x in sums[2]] == [1, 4, 1]
    assert [Fraction(8, 3) * x for x in sums[3]] == [1, 3, 3, 1]
    assert [Fraction(45, 2) * x for x in sums[4]] == [7, 32, 12, 32, 7]
    eighth, half = Fraction(1, 8), Fraction(1, 2)
    assert weights_of(2, True) == [[eighth, half, -eighth], [-eighth, half, eighth]]
    assert len(all_weights()) == 2 * 8 * 9 * 10 // 3


def carried(name: str, kind: int, steps: int, span: float = 2.0) -> np.ndarray:
    """Return the attitude behind a turn about moving axes, from rates (cos t, sin 2t, t/2) and their integral."""
    h = span / steps
    model = Named("AttitudeComputer", algorithm=BY_NAME[name].number, input_kind=kind, sample_period=h)
    model.put(rate=(1.0, 0.0, 0.0)).begin()
    for k in range(steps):
        t = h * (k + 1)
        angle = np.diff([(np.sin(x), -0.5 * np.cos(2.0 * x), 0.25 * x * x) for x in (t - h, t)], axis=0)[0]
        model.put(increment=angle, rate=(np.cos(t), np.sin(2.0 * t), 0.5 * t)).step(h * k, h)
    assert model["updated"] == 1.0
    return model["attitude"]


@pytest.mark.parametrize("name", ["two-sample-rodrigues", "functional-iteration-4"])
def test_the_computer_converges_from_rates_and_from_both(name: str) -> None:
    true = carried("functional-iteration-8", 1, 320)
    order = BY_NAME[name].order
    for kind in (2, 3):
        errors = [np.abs(carried(name, kind, steps) - true).max() for steps in (40, 80)]
        assert errors[0] < 1e-5
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.5)


def test_a_rate_within_a_sample_does_not_count_and_odd_numbers_are_not_mixed() -> None:
    model = Named("AttitudeComputer", algorithm=2, input_kind=2, sample_period=0.1).put(rate=(1.0, 0.0, 0.0)).begin()
    model.put(rate=(7.0, 3.0, 0.0)).step(0.0, 0.05)
    model.put(rate=(2.0, 0.0, 0.0)).step(0.05, 0.05)
    assert model["attitude"] == pytest.approx([np.cos(0.075), np.sin(0.075), 0.0, 0.0], abs=1e-15)
    assert "even number" in Named("AttitudeComputer", algorithm=17, input_kind=3).refuses_to_begin()
    fast = Named("AttitudeComputer", algorithm=1, input_kind=3, sample_period=1.0).begin().put(rate=(4.0, 0.0, 0.0))
    assert "half a turn" in fast.refuses_step(0.0, 1.0)


@pytest.mark.parametrize(
    ("name", "order"),
    [
        ("two-sample-rotation-vector", 4),
        ("three-sample-coning", 4),
        ("four-sample-coning", 6),
        ("five-sample-coning", 6),
    ],
)
def test_order_under_coning_is_that_of_the_inputs_at_most(name: str, order: int) -> None:
    """Use two rates a quarter of a turn apart as the parts of exp(ixu): the result turns, and its mean is the drift."""
    algorithm, errors = BY_NAME[name], []
    n = algorithm.samples
    for x in (0.1, 0.2):
        g = np.array(weights_of(n, False), dtype=float) @ np.exp(1j * x * np.arange(n + 1))
        errors_made = sum(float(k) * (g[i].conjugate() * g[j]).imag for i, j, k in algorithm.products)
        # The increments of whole steps turn, too: each with half the sum of the earlier ones.
        drift = errors_made + 0.25 * abs(g.sum()) ** 2 / np.tan(0.5 * n * x)
        errors.append(drift / (0.5 * n / x) - 1.0)
    assert np.log2(errors[1] / errors[0]) == pytest.approx(order, abs=0.7)
