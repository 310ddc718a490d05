"""The velocity computer: orders and drift under sculling of every algorithm, in multiple precision; exactness."""

import math
from collections.abc import Sequence
from functools import cache
from itertools import pairwise

import mpmath
import numpy as np
import pytest
from mpmath import mpf
from scipy.special import j1
from test_attitude_coning import analytic_drift
from test_attitude_order import HALF, HIGH, attitude_series, increments, rates_for

from attitude_kernels import precise_kernels, product, tables
from named import Named
from trihedron.models.attitude_algorithms import ALGORITHMS, Algorithm
from trihedron.models.attitude_algorithms.computer import STEP_SIZE
from trihedron.models.attitude_algorithms.iteration import SPACE_SIZE
from trihedron.models.attitude_algorithms.velocity import FORMS
from trihedron.models.effects import EffectPlace

JOINT, CLASSIC, FIRST_ORDER = (float(k + 1) for k in range(len(FORMS)))
FORCE = [[row[2], row[0] + 1, -row[1]] for row in HIGH]


@pytest.fixture(autouse=True)
def _fifty_digits():
    with mpmath.workdps(50):
        yield


def gained(algorithm: Algorithm, g: list, v: list, before: Sequence[list], form: float = JOINT) -> list:
    """Return the velocity of a step, by the computer's own kernel."""
    empty = [mpf(0)] * STEP_SIZE
    filled = [[*x, *empty][:STEP_SIZE] for x in (before[0], g, before[1], v)]
    work = [[mpf(0)] * size for size in (SPACE_SIZE, 4, 4, 4)]
    result = [mpf(0)] * 3
    kernel = precise_kernels("VelocityComputer")["velocity_of_step"]
    assert kernel(mpf(algorithm.number), form, mpf(1), *filled, tables(algorithm), *work, result) == 0
    return result


@cache
def force_series(high: bool, terms: int = 30) -> list:
    """Return the power series of the specific force in the reference, about 0: λ ∘ f ∘ λ*."""
    attitude = attitude_series(high)
    total = []
    for n in range(terms):
        term = [mpf(0)] * 4
        for k, force in enumerate(FORCE[: n + 1]):
            for j in range(n - k + 1):
                q = attitude[n - k - j]
                turned = product(product(attitude[j], [mpf(0), *force]), [q[0], -q[1], -q[2], -q[3]])
                term = [a + b for a, b in zip(term, turned, strict=True)]
        total.append(term[1:])
    return total


def true_gain(rates: list, step: mpf) -> list:
    """Return the velocity over (0, step] in the body at 0."""
    series = force_series(rates is HIGH)
    return [sum((c[i] * step ** (k + 1) / (k + 1) for k, c in enumerate(series)), mpf(0)) for i in range(3)]


def local_order(algorithm: Algorithm, form: float = JOINT) -> float:
    rates, errors = rates_for(algorithm), []
    for step in (HALF**9, HALF**10):
        g, v = (increments(of, mpf(0), step, algorithm.samples) for of in (rates, FORCE))
        before = tuple(increments(of, -step, step, algorithm.samples) for of in (rates, FORCE))
        orders = gained(algorithm, g, v, before, form)
        errors.append(mpmath.norm([a - b for a, b in zip(orders, true_gain(rates, step), strict=True)]))
    return float(mpmath.log(errors[0] / errors[1], 2))


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_velocity_has_the_order_of_the_attitude(algorithm: Algorithm) -> None:
    """Some formulas lose an order of the attitude for another reason than their products; the velocity has it."""
    order = local_order(algorithm) - 1
    assert order > algorithm.order - 0.05
    if algorithm.kernel.__name__.startswith(("by_products", "functional", "adaptive")) and algorithm.constant_rate:
        assert order == pytest.approx(algorithm.order, abs=0.05)


def test_the_classic_form_is_of_third_order_and_the_first_order_one_of_second() -> None:
    for algorithm in ALGORITHMS:
        if algorithm.name in ("two-sample-rotation-vector", "panov", "one-sample-rodrigues"):
            assert local_order(algorithm, CLASSIC) == pytest.approx(4.0, abs=0.05)
            assert local_order(algorithm, FIRST_ORDER) == pytest.approx(3.0, abs=0.05)


def sculling_drift(algorithm: Algorithm, phase: mpf, form: float = JOINT) -> tuple[mpf, mpf]:
    """Return the relative error of the velocity for a small turn θ = A sin Ωt about x and a force f = B sin Ωt along y.

    Its mean is A B/2 along z. It is averaged over a period, which the steps divide; the phase in a sample is returned,
    too.
    """
    n, a = algorithm.samples, mpf(10) ** -12
    steps = int(mpmath.nint(2 * mpmath.pi / (phase * n)))
    x = 2 * mpmath.pi / (steps * n)
    g, v, total = [], [], mpf(0)
    for begin, end in pairwise([m * x for m in range(-n, steps * n + 1)]):
        g += [a * (mpmath.sin(end) - mpmath.sin(begin)), mpf(0), mpf(0)]
        v += [mpf(0), mpmath.cos(begin) - mpmath.cos(end), mpf(0)]
    for k in range(1, steps + 1):
        now, last = slice(3 * n * k, 3 * n * (k + 1)), slice(3 * n * (k - 1), 3 * n * k)
        angle = a * mpmath.sin((k - 1) * n * x)
        u = gained(algorithm, g[now], v[now], (g[last], v[last]), form)
        total += u[2] * mpmath.cos(angle) + u[1] * mpmath.sin(angle)
    return total / (mpmath.pi * a) - 1, x


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_drift_under_sculling_is_that_of_coning(algorithm: Algorithm) -> None:
    for phase in ("0.2", "0.8"):
        drift, x = sculling_drift(algorithm, mpf(phase))
        expected = analytic_drift(algorithm, x)
        assert abs(drift - expected) < mpf("1e-3") * abs(expected)


def test_forms_differ_in_the_rotation_alone() -> None:
    algorithm = next(a for a in ALGORITHMS if a.name == "four-sample-coning")
    drifts = [sculling_drift(algorithm, mpf("0.4"), form)[0] for form in (JOINT, CLASSIC, FIRST_ORDER)]
    assert max(abs(d / drifts[0] - 1) for d in drifts) < mpf(10) ** -6


def computer(algorithm: Algorithm, **values: float | tuple) -> Named:
    return Named("VelocityComputer", algorithm=algorithm.number, sample_period=0.01, **values).begin()


def feed(model: Named, increments: np.ndarray, velocities: np.ndarray) -> Named:
    for k, (gamma, upsilon) in enumerate(zip(increments, velocities, strict=True)):
        model.put(increment=gamma, velocity_increment=upsilon).step(0.01 * k, 0.01)
    return model


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_a_constant_rate_and_force_are_exact_where_a_rate_is(algorithm: Algorithm) -> None:
    """Compare with the velocity of a body that turns by φ about an axis under a force fixed in it."""
    count = 2 * algorithm.samples
    gamma, upsilon = 0.9 * algorithm.max_increment * np.array([0.0, 0.0, 1.0]), np.array([0.2, 0.0, 0.1])
    model = feed(computer(algorithm), np.tile(gamma, (count, 1)), np.tile(upsilon, (count, 1)))
    turn = count * gamma[2]
    expected = np.array([0.2 * math.sin(turn), 0.2 * (1.0 - math.cos(turn)), 0.1 * turn]) * count / turn
    error = np.abs(model["velocity"] - expected).max()
    assert error < 2e-13 if algorithm.constant_rate else error < 2e-2


@pytest.mark.acceptance
def test_strong_sculling_has_the_velocity_of_its_bessel_function() -> None:
    """θ = A sin Ωt, f = B sin Ωt across the axis: the mean velocity across both grows by B J1(A)."""
    a, count = 0.5, 64
    time = 2.0 * math.pi * np.arange(8 * count + 1) / count
    theta, speed = a * np.diff(np.sin(time)), -np.diff(np.cos(time))
    zero = np.zeros_like(theta)
    for algorithm in ALGORITHMS:
        if algorithm.name in ("functional-iteration-8", "adaptive-degree"):
            gammas, speeds = np.column_stack((theta, zero, zero)), np.column_stack((zero, speed, zero))
            model = feed(computer(algorithm), gammas, speeds)
            assert model["velocity"][2] == pytest.approx(time[-1] * j1(a), rel=1e-9)


def test_gravitation_start_and_parts_of_samples() -> None:
    algorithm = next(a for a in ALGORITHMS if a.name == "two-sample-rotation-vector")
    start = {"initial_velocity": (1.0, 2.0, 3.0), "gravitation": (0.0, 0.0, -9.8)}
    rng = np.random.default_rng(1)
    gammas, velocities = rng.normal(scale=0.05, size=(2, 8, 3))
    complete, parts = feed(computer(algorithm, **start), gammas, velocities), computer(algorithm, **start)
    free = feed(computer(algorithm), gammas, velocities)
    assert complete["velocity"] == pytest.approx(free["velocity"] + [1.0, 2.0, 3.0 - 9.8 * 0.08], abs=1e-14)
    for k in range(16):
        parts.put(increment=gammas[k // 2] / 2, velocity_increment=velocities[k // 2] / 2).step(0.005 * k, 0.005)
    assert parts["velocity"] == pytest.approx(complete["velocity"], abs=1e-14)
    # The gained velocity is in body axes; the attitude is that of the attitude computer.
    still = Named("AttitudeComputer", algorithm=algorithm.number, sample_period=0.01).begin()
    for k, gamma in enumerate(gammas):
        still.put(increment=gamma).step(0.01 * k, 0.01)
    assert complete["attitude"].tolist() == still["attitude"].tolist()


@pytest.mark.parametrize("bad", [math.nan, math.inf, 2e6])
def test_what_is_no_velocity_increment_is_refused_and_changes_nothing(bad: float) -> None:
    model = computer(ALGORITHMS[1])
    assert "velocity_increment is not finite" in model.put(velocity_increment=(0.0, bad, 0.0)).refuses_step(0.0, 0.01)
    assert feed(model, np.zeros((1, 3)), np.ones((1, 3)))["velocity"].tolist() == [1.0, 1.0, 1.0]


def test_an_effect_in_motion_reaches_the_velocity() -> None:
    """A block off the centre of a steady turn senses ω × (ω × r): its velocity is that of a point on a circle."""
    arm, rate, period, count = 0.2, 0.5, 0.01, 400
    effects = {EffectPlace("lever-arm", f"accelerometer-{p}"): (arm, 0.0, 0.0) for p in (1, 2)}
    block = Named("AccelerometerBlock", effects, rate=(0.0, 0.0, rate)).begin()
    model = computer(next(a for a in ALGORITHMS if a.name == "two-sample-rotation-vector"))
    for k in range(count):
        block.put(rate=(0.0, 0.0, rate)).step(period * k, period)
        assert block["increment_reading"] == pytest.approx(period * block["reading"], abs=1e-15)
        model.put(increment=(0.0, 0.0, rate * period), velocity_increment=block["increment_reading"])
        model.step(period * k, period)
    turn = rate * period * count
    expected = arm * rate * np.array([-math.sin(turn), math.cos(turn) - 1.0, 0.0])
    assert model["velocity"] == pytest.approx(expected, abs=1e-12)


def test_increments_of_the_accelerometers_are_the_trapezoid_of_their_readings() -> None:
    block = Named("AccelerometerBlock", specific_force=(1.0, 2.0, 3.0), bias=(1e-3, 0.0, 0.0)).begin()
    before = block["reading"]
    block.put(specific_force=(3.0, 2.0, 1.0)).step(0.0, 0.1)
    assert block["increment_reading"] == pytest.approx(0.05 * (before + block["reading"]), rel=1e-15)
