"""The harmonic motion: angles, rates, increments and attitude belong together."""

import math
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from named import Named
from trihedron.models.harmonic_motion import move_harmonically


def motion(parameters: dict[str, float]) -> Named:
    return Named("HarmonicMotion", **parameters).begin()


def rotation(angle: np.ndarray) -> Rotation:
    """Return ψ about the second axis, then ϑ about the third, then γ about the first, by scipy."""
    return Rotation.from_euler("YZX", angle)


FAST = {
    "psi_amplitude[1]": 0.3,
    "psi_frequency[1]": 1.0,
    "psi_amplitude[2]": 0.01,
    "psi_frequency[2]": 40.0,
    "psi_phase[2]": 1.0,
    "theta_amplitude[1]": -0.5,
    "theta_frequency[1]": 0.7,
    "theta_phase[1]": 0.4,
    "gamma_amplitude[1]": 2.0,
    "gamma_frequency[1]": 1.5,
    "gamma_amplitude[4]": 0.002,
    "gamma_frequency[4]": 90.0,
}


def test_angles_and_attitude_are_what_the_harmonics_say() -> None:
    model = motion(FAST)
    for k in range(40):
        model.step(0.037 * k, 0.037)
        t = 0.037 * (k + 1)
        expected = [
            0.3 * math.sin(2 * math.pi * t) + 0.01 * math.sin(80 * math.pi * t + 1.0),
            -0.5 * math.sin(1.4 * math.pi * t + 0.4),
            2.0 * math.sin(3 * math.pi * t) + 0.002 * math.sin(180 * math.pi * t),
        ]
        np.testing.assert_allclose(model["angle"], expected, rtol=0, atol=1e-12)
        attitude = Rotation.from_quat(np.roll(model["attitude"], -1))
        assert (attitude.inv() * rotation(np.array(expected))).magnitude() < 1e-12
        up = attitude.inv().apply([0.0, 9.80665, 0.0])
        np.testing.assert_allclose(model["specific_force"], up, rtol=0, atol=1e-13)


def moment(model: Named, time: float) -> tuple[np.ndarray, np.ndarray]:
    """Return angles and body rate of a motion at any time, by the kernel of outputs and increments."""
    angle, rate = [0.0] * 3, [0.0] * 3
    move_harmonically(time, model.model.memory["harmonics"], angle, [0.0] * 3, rate)
    return np.array(angle), np.array(rate)


def test_the_rate_is_the_derivative_of_the_attitude() -> None:
    h, model = 1e-5, motion(FAST)
    for t in 0.11 * np.arange(20):
        before, after = (rotation(moment(model, float(t) + side)[0]) for side in (-h, h))
        expected = (before.inv() * after).as_rotvec() / (2 * h)
        np.testing.assert_allclose(moment(model, float(t))[1], expected, rtol=0, atol=1e-4)
        model.step(float(t) - 0.001, 0.001)
        np.testing.assert_allclose(model["rate"], expected, rtol=0, atol=1e-4)


@pytest.mark.acceptance
@settings(max_examples=20)
@given(st.floats(0.0, 60.0), st.floats(1e-4, 0.1))
def test_the_increment_is_the_integral_of_the_rate(begin: float, step: float) -> None:
    """Compare with Gauss's rule of forty nodes on pieces of a millisecond."""
    model = motion(FAST)
    nodes, weights = np.polynomial.legendre.leggauss(40)
    pieces = 1 + int(step / 1e-3)
    edges = np.linspace(begin, begin + step, pieces + 1)
    expected = np.zeros(3)
    for remainder, right in pairwise(edges):
        half = 0.5 * (right - remainder)
        for node, weight in zip(nodes, weights, strict=True):
            expected += half * weight * moment(model, remainder + half * (1 + node))[1]
    model.step(begin, step)
    np.testing.assert_allclose(model["increment"], expected, rtol=0, atol=2e-13)


def test_the_trapezoid_lies_over_the_whole_step() -> None:
    """M = 21 nodes over two increments are ten intervals in each, and the error is that of the trapezoid rule."""
    plain = motion(FAST)
    model = motion({**FAST, "trapezoid_nodes": 21.0, "step_samples": 2.0})
    rates = [moment(plain, 0.3 + 0.001 * node)[1] for node in range(11)]
    model.step(0.3, 0.01)
    expected = 0.001 * (np.sum(rates, axis=0) - 0.5 * (rates[0] + rates[-1]))
    np.testing.assert_allclose(model["increment"], expected, rtol=0, atol=1e-14)
    plain.step(0.3, 0.01)
    assert np.abs(plain["increment"] - expected).max() > 1e-8


@pytest.mark.parametrize(("nodes", "samples"), [(2.0, 2.0), (22.0, 2.0), (1.0, 1.0), (21.0, 3.0)])
def test_nodes_that_do_not_fit_are_refused(nodes: float, samples: float) -> None:
    assert "whole number" in Named("HarmonicMotion", trapezoid_nodes=nodes, step_samples=samples).refuses_to_begin()


def test_a_step_of_too_many_periods_is_refused() -> None:
    model = motion({"psi_amplitude[1]": 1e-3, "psi_frequency[1]": 1e9})
    assert "1e6 rad" in model.refuses_step(0.0, 1.0)


def test_another_pi_moves_the_frequencies() -> None:
    """Over 600 s the paper's 3.141592 is 2.5e-4 of a period at 1 Hz short."""
    model = motion({"pi": 3.141592})
    model.step(599.0, 1.0)
    assert model["angle"][0] == pytest.approx(math.radians(15.0) * math.sin(2 * 3.141592 * 600.0), rel=1e-9, abs=1e-12)
    assert abs(model["angle"][0]) > 2e-4
