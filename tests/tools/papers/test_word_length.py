"""32-bit words: the gain of carrying 1 - λ0*, of compensation and of error feedback."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from trihedron.tools.motion import (
    ARITHMETICS,
    ROUNDINGS,
    algorithm_named,
    angle_between,
    rounded_increments,
    run_algorithm,
    run_single,
)
from trihedron.tools.papers import DOUBLE, INCOMMENSURATE, REPEATING, word_length_errors


def degrees(errors):
    return {(e.motion, e.rounding, e.arithmetic): float(np.degrees(e.error)) for e in errors.errors}


@pytest.mark.acceptance
def test_thirty_seconds():
    errors = degrees(word_length_errors(30.0, motions=(REPEATING,)))
    for rounding in ROUNDINGS:
        assert errors[REPEATING, rounding, "single"] > 1e-4
        assert errors[REPEATING, rounding, "compensated"] < 1e-5
    floor = errors[REPEATING, "independently", DOUBLE]
    assert errors[REPEATING, "independently", "pairs"] == pytest.approx(floor, rel=0.05)
    assert errors[REPEATING, "feedback", "pairs"] < 1e-8 < 100 * errors[REPEATING, "feedback", "pairs"] < floor
    assert errors[REPEATING, "pairs", "pairs"] < 2e-9
    assert errors[REPEATING, "pairs", DOUBLE] < 1e-12


@pytest.mark.acceptance
@given(st.lists(st.floats(-0.01, 0.01), min_size=3, max_size=60))
def test_error_feedback_loses_nothing_for_good(values):
    """The sum of the rounded increments is the sum of the increments, except for the last rounding."""
    increments = np.array(values[: len(values) // 3 * 3]).reshape(-1, 3)
    high, low = rounded_increments(increments, "feedback")
    assert (low == 0.0).all()
    apart = np.abs(high.astype(np.float64).sum(axis=0) - increments.sum(axis=0))
    assert (apart <= 2.0**-25 * (0.02 + 1e-9)).all()


@pytest.mark.acceptance
@pytest.mark.parametrize("arithmetic", ARITHMETICS)
def test_short_words_run_the_same_algorithm(arithmetic):
    """On a few steps every arithmetic is (22) to its own rounding."""
    increments = np.random.default_rng(7).normal(size=(40, 3)) * 0.003
    high, low = rounded_increments(increments, "pairs")
    expected = run_algorithm(algorithm_named("two-sample-rodrigues"), increments)
    bound = 1e-11 if arithmetic == "pairs" else 3e-6
    assert angle_between(run_single(high, low, arithmetic), expected).max() < bound


def test_angle_between_is_right_for_small_and_large_angles():
    for angle in (0.0, 1e-12, 1e-3, 2.0, 3.1):
        p = Rotation.from_rotvec([0.3, -1.2, 0.4])
        q = p * Rotation.from_rotvec(angle * np.array([0.6, 0.0, 0.8]))
        pair = [2.0 * r.as_quat(scalar_first=True)[None] for r in (p, q)]
        assert angle_between(*pair)[0] == pytest.approx(angle, rel=1e-9, abs=1e-15)


@pytest.mark.acceptance
def test_ten_minutes():
    """600 s, variant 1, 1 kHz: below 1e-6 degrees with feedback or pairs; the floor of independent rounding."""
    errors = word_length_errors()
    print(errors)
    errors = degrees(errors)
    for rounding in ROUNDINGS:
        assert 1e-3 < errors[REPEATING, rounding, "single"] < 2e-2
        assert 2.0 < errors[REPEATING, rounding, "single"] / errors[REPEATING, rounding, "carried"] < 7.0
        assert errors[REPEATING, rounding, "compensated"] < 1.5e-4
    assert errors[REPEATING, "independently", DOUBLE] == pytest.approx(4.7e-5, rel=0.02)
    assert errors[REPEATING, "independently", "pairs"] == pytest.approx(4.7e-5, rel=0.02)
    assert errors[REPEATING, "feedback", "pairs"] < 1e-7
    assert errors[REPEATING, "pairs", "pairs"] < 5e-8
    # Rounding errors that do not repeat with the motion do not add up.
    assert errors[INCOMMENSURATE, "independently", DOUBLE] < 3e-6
