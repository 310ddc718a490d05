"""Predicted errors of unseen poses equal the errors of fits, and proposed poses determine open parameters."""

import numpy as np
import pytest

from trihedron.tools.motion.determinacy import (
    LEAST_SD,
    OPEN,
    PRIOR_SD,
    UNSEEN,
    Determinacy,
    candidate_poses,
    closing_poses,
    slopes_of,
)
from trihedron.tools.motion.norm import norm_block, norm_equations


def drawn_poses(rng: np.random.Generator, count: int) -> np.ndarray:
    up = rng.normal(size=(count, 3))
    return up / np.linalg.norm(up, axis=1, keepdims=True)


def fitted(reading: np.ndarray, sd: float, prior_sd: np.ndarray) -> np.ndarray:
    """Return the nine parameters by least squares with a prior: an independent fit, by stacked rows."""
    x = np.zeros(9)
    for _ in range(20):
        residual, slopes, _ = norm_equations(x, reading)
        rows = np.vstack([slopes / sd, np.diag(1.0 / prior_sd)])
        right = np.concatenate([-residual / sd, -x / prior_sd])
        x = x + np.linalg.lstsq(rows, right, rcond=None)[0]
    return x


def test_slopes_are_those_of_the_norm_equations():
    up = drawn_poses(np.random.default_rng(1), 20)
    np.testing.assert_allclose(slopes_of(up), norm_equations(np.zeros(9), up)[1], atol=1e-15)


@pytest.mark.parametrize("count", [5, 9, 30])
def test_predicted_errors_are_the_errors_of_fits_in_unseen_poses(count):
    """Errors over predicted standard errors: 68 % within one, all within four, for few and for many poses."""
    sd, prior_sd, ratios = 5e-4, 0.2 * PRIOR_SD, []
    for seed in range(20):
        rng = np.random.default_rng([count, seed])
        truth = prior_sd * rng.normal(size=9)
        matrix, bias = norm_block(truth)
        up, unseen = drawn_poses(rng, count), drawn_poses(rng, 50)
        reading = up @ matrix.T + bias + sd * rng.normal(size=(count, 3))
        x = fitted(reading, sd, prior_sd)
        error = norm_equations(x, unseen @ matrix.T + bias)[0]
        determined = Determinacy.of(slopes_of(up), sd, prior_sd)
        ratios.append(error / determined.pose_errors(unseen))
    size = np.abs(np.concatenate(ratios))
    assert 0.5 < np.mean(size < 1.0) < 0.85
    assert np.mean(size < 3.0) > 0.98


def test_one_more_rest_is_the_same_by_rank_one_and_anew():
    up = drawn_poses(np.random.default_rng(2), 12)
    sd = np.linspace(3e-4, 9e-4, 12)
    whole = Determinacy.of(slopes_of(up), sd)
    stepwise = Determinacy.before()
    for direction, deviation in zip(up, sd, strict=True):
        stepwise = stepwise.with_pose(direction, float(deviation))
    np.testing.assert_allclose(stepwise.covariance, whole.covariance, rtol=1e-5, atol=1e-12)


def test_six_faces_leave_the_misalignments_open_and_three_edges_close_them():
    faces = np.array([up for words, up in candidate_poses().items() if "45" not in words])
    determined = Determinacy.of(slopes_of(faces), LEAST_SD)
    assert len(determined.open) == 3
    assert np.abs(determined.open[:, [0, 2, 5, 6, 7, 8]]).max() < 1e-6
    assert determined.worst > 1e-2
    poses = closing_poses(determined, 1e-3)
    assert len(poses) == 3
    assert all("45" in pose.words for pose in poses)
    assert poses[-1].after.worst <= 1e-3
    assert len(poses[-1].after.open) == 0


def test_poses_from_nothing_reach_what_they_promise():
    poses = closing_poses(Determinacy.before(), 1e-3)
    assert 9 <= len(poses) <= 12
    again = Determinacy.of(slopes_of(np.array([pose.up for pose in poses])), LEAST_SD)
    assert again.worst == pytest.approx(poses[-1].after.worst, rel=1e-4)
    assert again.worst <= 1e-3
    worst = [pose.after.worst for pose in poses]
    assert worst == sorted(worst, reverse=True)


def test_open_directions_are_those_of_which_the_prior_says_most():
    determined = Determinacy.of(slopes_of(np.eye(3)[:1]), LEAST_SD)
    assert len(determined.open) == 8
    largest = np.linalg.eigvalsh(determined.covariance / np.outer(PRIOR_SD, PRIOR_SD))
    assert np.sum(largest > OPEN) == 8
    np.testing.assert_allclose(np.linalg.norm(UNSEEN, axis=1), 1.0, rtol=1e-14)
