"""The attitude algorithms: observed orders, exactness and equivariance."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trihedron.fmus import components
from trihedron.fmus.in_process import instantiate, references
from trihedron.models.attitude import ALGORITHMS

COMPUTER = components()["AttitudeComputer"]
AT = references(COMPUTER)

# Angular rate as a cubic polynomial of time [rad/s]: increments are exact, and no symmetry flatters an algorithm.
RATES = np.array([[0.9, -0.4, 0.7], [0.5, 1.1, -0.6], [-1.2, 0.3, 0.8], [0.4, -0.9, 0.5]])


def increments(count: int) -> np.ndarray:
    """Increments (count, 3) of the polynomial rate over equal parts of one second."""
    times = np.linspace(0.0, 1.0, count + 1)
    powers = np.array([times ** (k + 1) / (k + 1) for k in range(4)]).T
    return np.diff(powers @ RATES, axis=0)


def carry(gammas: np.ndarray, step: float, algorithm: int, initial=(1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    """Attitude after all increments."""
    model = instantiate(COMPUTER)
    model.set(AT["algorithm"], float(algorithm))
    for i, value in enumerate(initial):
        model.set(AT[f"initial_attitude[{i + 1}]"], float(value))
    assert model.initialise(0.0) == 0
    for k, gamma in enumerate(gammas):
        for i in range(3):
            model.set(AT[f"increment[{i + 1}]"], float(gamma[i]))
        assert model.do_step(k * step, step) == 0
    assert model.get(AT["updated"]) == 1.0
    return np.array([model.get(AT[f"attitude[{i + 1}]"]) for i in range(4)])


def distance(p: np.ndarray, q: np.ndarray) -> float:
    """Angle between two attitudes [rad]."""
    return (Rotation.from_quat(p, scalar_first=True).inv() * Rotation.from_quat(q, scalar_first=True)).magnitude()


@pytest.fixture(scope="module")
def truth() -> np.ndarray:
    """Attitude after one second, from the kinematic equation by DOP853."""
    from scipy.integrate import solve_ivp

    def derivative(t, q):
        w = np.array([1.0, t, t**2, t**3]) @ RATES
        return 0.5 * np.array(
            [
                -q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                q[0] * w[2] + q[1] * w[1] - q[2] * w[0],
            ]
        )

    run = solve_ivp(derivative, (0.0, 1.0), [1.0, 0.0, 0.0, 0.0], method="DOP853", rtol=1e-13, atol=1e-15)
    return run.y[:, -1] / np.linalg.norm(run.y[:, -1])


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_observed_order_is_the_one_that_is_stated(algorithm, truth):
    errors = [distance(carry(increments(n), 1.0 / n, algorithm.number), truth) for n in (32, 64, 128)]
    orders = [math.log2(a / b) for a, b in itertools.pairwise(errors)]
    assert orders[-1] == pytest.approx(algorithm.order, abs=0.1)


@given(st.tuples(*[st.floats(-0.05, 0.05)] * 3), st.integers(0, 1000))
def test_turning_the_body_frame_turns_the_answer(axis, seed):
    """Increments seen in a frame turned by r give the attitude turned by r."""
    r = Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
    gammas = increments(8) + np.array(axis)
    plain = Rotation.from_quat(carry(gammas, 0.125, 1), scalar_first=True)
    turned = Rotation.from_quat(carry(r.inv().apply(gammas), 0.125, 1), scalar_first=True)
    assert (turned.inv() * (r.inv() * plain * r)).magnitude() < 1e-14


@pytest.mark.parametrize("algorithm", ALGORITHMS, ids=lambda a: a.name)
def test_running_back_returns(algorithm):
    """The reversed increments undo the run: both algorithms are symmetric in time."""
    gammas = increments(40)
    there_and_back = np.vstack((gammas, -gammas[::-1]))
    assert distance(carry(there_and_back, 0.025, algorithm.number), np.array([1.0, 0.0, 0.0, 0.0])) < 1e-14


def test_one_update_by_hand():
    """Equation (22) with γ' = (0.1, 0, 0), γ'' = (0, 0.2, 0)."""
    x = np.array([(0.25 + 0.01 / 48) * 0.1, (0.25 + 0.04 / 48) * 0.2, 0.1 * 0.2 / 6])
    expected = np.array([1 - x @ x, *(2 * x)]) / (1 + x @ x)
    assert carry(np.array([[0.1, 0, 0], [0, 0.2, 0]]), 1.0, 1) == pytest.approx(expected, abs=2e-16)


def test_a_constant_rate_is_exact_for_the_mean_rate_algorithm():
    gamma = np.array([0.3, -0.4, 1.2])
    q = carry(np.tile(gamma, (50, 1)), 0.1, 2)
    assert distance(q, Rotation.from_rotvec(50 * gamma).as_quat(scalar_first=True)) < 1e-13


def test_tiny_and_zero_increments_leave_a_unit_quaternion():
    for size in (0.0, 5e-324, 1e-300, 1e-160, 1e-9):
        for algorithm in ALGORITHMS:
            q = carry(np.full((4, 3), size), 0.1, algorithm.number)
            assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-15)
            assert q[1] == pytest.approx(2 * size, rel=1e-12, abs=1e-320)
