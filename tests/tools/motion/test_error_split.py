"""An error over time splits into its drift and what repeats with the motion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.models.attitude_algorithms import ALGORITHMS
from trihedron.tools.errors import InputError
from trihedron.tools.motion.attitude_error import angle_errors, attitude_error, split_error
from trihedron.tools.motion.compare import run_algorithm, sample_motion
from trihedron.tools.papers.attitude import EXACT, paper_motion

BY_NAME = {a.name: a for a in ALGORITHMS}


@settings(max_examples=25, deadline=None)
@given(
    st.floats(0.5, 4.0),
    st.floats(0.0, 6.0),
    st.tuples(st.floats(-1e-3, 1e-3), st.floats(-1e-3, 1e-3)),
    st.floats(0.1, 1.0),
)
def test_a_line_and_a_wave_come_apart(period: float, phase: float, drift: tuple, amplitude: float) -> None:
    time = np.arange(0.0, 100.0, 0.04)
    wave = amplitude * np.sin(2 * np.pi * time / period + phase)
    error = np.column_stack((drift[0] * time + wave, 1.0 + drift[1] * time + 0.3 * wave))
    for given_period in (period, None):
        split = split_error(time, error, given_period)
        assert split.period == pytest.approx(period, rel=1e-3)
        np.testing.assert_allclose(split.rate, drift, rtol=0, atol=5e-5 * amplitude)
        np.testing.assert_allclose(split.amplitude, [amplitude, 0.3 * amplitude], rtol=5e-3)
        np.testing.assert_allclose(split.slow + split.periodic, error, rtol=0, atol=1e-12)


def test_the_period_of_the_paper_is_two_seconds() -> None:
    """Harmonics of 1 Hz beside a weaker one of 0.5 Hz: what repeats is the 2 s of ϑ, as the paper says."""
    time = np.arange(0.0, 60.0, 0.01)
    error = 2e-6 * time + np.sin(2 * np.pi * time) + 0.3 * np.sin(np.pi * time)
    assert split_error(time, error).period == pytest.approx(2.0, rel=1e-3)


def test_the_drift_of_an_algorithm_is_the_growth_between_equal_phases() -> None:
    """The first motion repeats every 2 s, so the error's growth over whole periods is the drift, exactly."""
    algorithm = BY_NAME["mean-rate"]
    taken = sample_motion(paper_motion("1", EXACT), 0.01, 6000)
    attitudes = run_algorithm(algorithm, taken.increments, renormalise=True)
    true = run_algorithm(BY_NAME["functional-iteration-8"], taken.increments, renormalise=True)
    error = attitude_error(attitudes[7::8], true)
    time = 0.08 * (1 + np.arange(len(error)))
    split = split_error(time, error, 2.0)
    expected = (error[700] - error[75]) / (time[700] - time[75])
    np.testing.assert_allclose(split.rate, expected, rtol=1e-3, atol=1e-9)
    # The largest error that the paper prints is drift and wave together.
    largest = angle_errors(attitudes, taken.angles_at_steps(algorithm), normalised=True)
    assert np.linalg.norm(largest) <= 1.2 * np.linalg.norm(np.abs(split.slow).max(axis=0) + split.amplitude)


def test_what_does_not_grow_has_no_drift_and_what_only_grows_has_no_wave() -> None:
    time = np.arange(0.0, 50.0, 0.05)
    still = split_error(time, np.zeros_like(time))
    assert still.rate[0] == 0.0
    assert still.amplitude[0] == 0.0
    growing = split_error(time, 3e-4 * time)
    assert growing.rate[0] == pytest.approx(3e-4, rel=1e-9)
    assert growing.amplitude[0] < 1e-12


@pytest.mark.parametrize(
    ("time", "error", "period", "said"),
    [
        (np.arange(5.0), np.zeros(5), None, "at least eight"),
        (np.arange(20.0), np.full(20, np.nan), None, "finite"),
        (np.zeros(20), np.zeros(20), None, "growing"),
        (np.arange(20.0), np.zeros(20), 10.0, "shorter than two periods"),
        (np.arange(20.0), np.zeros(20), 0.0, "shorter than two periods"),
    ],
)
def test_what_cannot_be_split_is_refused(time: np.ndarray, error: np.ndarray, period: float | None, said: str) -> None:
    with pytest.raises(InputError, match=said):
        split_error(time, error, period)
