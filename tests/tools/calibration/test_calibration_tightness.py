"""Guaranteed bounds are nearly attained: some admissible truth reaches the bound, and none goes beyond."""

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.stands import ALPHA, BETA, random_bench, record
from trihedron.models.bench import TARGETS, target_reading, target_values
from trihedron.tools.bounded import Polytope, chebyshev_radius
from trihedron.tools.calibration import (
    Correction,
    Linearisation,
    Positions,
    calibrate,
    corners,
    corrected,
    correction_of,
    error_bounds,
    error_weights,
    face_readings,
    fit_record,
    levelling,
    linearise,
    parametrise,
    remaining_error,
    widening,
)

SIGMA = 1e-7
"""Small, so that the curvature of the model, (σ·cost)² against σ·cost, is below the tolerance."""
IDENTITY = np.eye(3)
BOUNDS = (3e-3, 1e-2)


def fitted(seed: int, noise: np.ndarray | float = 0.0) -> tuple[np.ndarray, np.ndarray, Linearisation]:
    """Return a bench's targets, its readings with noise (24, 3), and the fit."""
    truth = target_values(random_bench(np.random.default_rng(seed)), IDENTITY)
    reading = target_reading(truth, ALPHA, BETA, IDENTITY) + noise
    return truth, reading, fit_record(record(reading), noise_bound=SIGMA)


@pytest.mark.acceptance
def test_a_worst_case_noise_attains_the_guaranteed_error():
    """The readings belong to another bench as well: no estimator can separate the two."""
    truth, reading, linearised = fitted(2)
    programme = Polytope(linearised.jacobian, linearised.bound)
    programme.confine(-linearised.bound, linearised.bound)
    for k in range(18):
        _, step, weights = programme.maximise(np.eye(18)[k])
        noise = (linearised.jacobian @ step).reshape(-1, 3)
        carrying = np.abs(weights.reshape(-1, 3)) > 1e-9
        np.testing.assert_allclose(noise[carrying], SIGMA * np.sign(weights.reshape(-1, 3)[carrying]), rtol=1e-8)
        assert np.abs(noise).max() <= SIGMA * (1 + 1e-9)
        result = calibrate(record(reading + noise), noise_bound=SIGMA)
        estimate = result.parameters[k]
        assert estimate.a_priori is not None
        assert abs(estimate.a_priori - truth[k]) == pytest.approx(estimate.guaranteed_error, rel=1e-6)
        assert all(e.low <= x <= e.high for e, x in zip(result.parameters, truth, strict=True))


@pytest.mark.parametrize("resolution", [0.0, 2e-7])
def test_a_bench_at_the_end_of_an_interval_explains_the_readings(resolution):
    """The misfit of noisy readings at that bench is σ and half a last digit, no more."""
    noise = np.random.default_rng(5).uniform(-SIGMA, SIGMA, (24, 3))
    _, reading, linearised = fitted(3, noise)
    result = calibrate(record(reading, resolution=resolution * GRAVITY), noise_bound=SIGMA, targets=["X4-X5"])
    room = linearised.bound + resolution
    programme = Polytope(linearised.jacobian, linearised.bound)
    programme.confine(linearised.residual - room, linearised.residual + room)
    for e, weights in zip(result.parameters, [*np.eye(18), np.eye(18)[3] - np.eye(18)[4]], strict=True):
        assert e.low is not None
        assert e.high is not None
        for end, sense in ((e.low, -1.0), (e.high, 1.0)):
            bench = linearised.point + programme.maximise(sense * weights)[1]
            assert np.abs(linearised.residual_at(bench) / room).max() <= 1 + 1e-4
            beyond = sense * (float(weights @ bench) - end)
            assert -1e-5 * (e.high - e.low) <= beyond <= 0.0, e.symbol


def test_half_a_last_digit_and_no_more_is_allowed_to_the_radius():
    resolution = 0.2 * SIGMA
    _, _, linearised = fitted(4, np.random.default_rng(6).uniform(-SIGMA, SIGMA, (24, 3)))
    duals = chebyshev_radius(linearised.jacobian, linearised.residual, linearised.bound)[2]
    # errors of one size at all readings of the duals: no parameters do better than the truth
    pattern = np.sign(np.where(np.abs(duals) * SIGMA > 1e-9, duals, 0.0)).reshape(-1, 3)
    exact = fitted(4)[1]
    for part, verdict in ((0.99, "consistent"), (1.01, "falsified")):
        written = record(exact + (SIGMA + part * resolution) * pattern, resolution=resolution * GRAVITY)
        result = calibrate(written, noise_bound=SIGMA)
        assert result.radius == pytest.approx(1 + 0.2 * part, rel=1e-5)
        assert result.verdict == verdict


def test_the_bound_of_a_reading_whose_sign_is_open_is_what_an_asymmetric_block_does():
    """At one position, with the input of accelerometer 1 nominally at zero, only (1.7) bounds input and asymmetry."""
    u, v = BOUNDS
    alpha, beta = np.array([0.9]), np.array([0.0])
    at = Positions(alpha, beta, np.array([0]))
    p = parametrise({"identity": IDENTITY})
    reading = target_reading(np.zeros(18), alpha, beta, IDENTITY)
    linearised = linearise(p, at, reading, np.zeros(18), np.full(3, SIGMA))
    certain = np.array([[False, True, True]])
    extra = widening(linearised, certain, SIGMA, BOUNDS)
    assert extra[1:].tolist() == [0.0, 0.0]
    # every parameter that moves the input is at the end of its range, every other is zero
    x = dict.fromkeys(TARGETS, 0.0) | {"X4": v, "X5": -v}
    x |= {"X1": u, "X3": u, "X8": -v, "-X12": v}
    truths = [dict(x, **{name: sense * x[name] for name in ("X1", "X3", "X8", "-X12")}) for sense in (-1.0, 1.0)]
    changes = []
    for truth in truths:
        values = np.array([truth[name] for name in TARGETS])
        wrong = [
            target_reading(values, alpha, beta, IDENTITY, np.array([[sign, 1.0, 1.0]]))[0, 0] for sign in (-1.0, 1.0)
        ]
        changes.append(abs(wrong[1] - wrong[0]))
    assert 0.97 * extra[0] <= max(changes) <= extra[0]


def uncertain_block(size: float) -> tuple[Correction, np.ndarray]:
    """Return the correction of a block whose zero errors are known to `size` each, and all extreme true blocks (K,
    18)."""
    weights = error_weights(parametrise({"identity": IDENTITY}))
    uncertain = np.flatnonzero(np.abs(weights).max(axis=0))
    benches = np.zeros((2 ** len(uncertain), 18))
    benches[:, uncertain] = size * (2.0 * ((np.arange(len(benches))[:, None] >> np.arange(len(uncertain))) & 1) - 1.0)
    ends = np.full((2, 3, 3, 3, 3), np.nan)
    for (p, n), row in zip(corners(), weights, strict=True):
        ends[(slice(None), p - 1, *(x + 1 for x in n))] = -size * np.abs(row).sum(), size * np.abs(row).sum()
    return Correction(GRAVITY, np.ones(3), np.ones(3), np.zeros((3, 3)), np.zeros(3), ends[0], ends[1]), benches


def true_inputs(benches: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return the inputs (K, 3) at which blocks read `reading` (3,) [g]."""
    x = dict(zip(TARGETS, benches.T, strict=True))
    cross = [np.zeros(len(benches))] * 3
    n = np.zeros((len(benches), 3))
    for p, (plus, minus, bias) in enumerate((("X4", "X5", "X16"), ("X9", "X10", "X17"), ("X14", "X15", "X18"))):
        cross[1] = x["X6+X8"] * n[:, 0]
        cross[2] = x["X7+X12"] * n[:, 0] + x["X11+X13"] * n[:, 1]
        along_axis = reading[p] - x[bias] - cross[p]
        n[:, p] = along_axis / (1.0 + np.where(along_axis > 0.0, x[plus], x[minus]))
    return n


@pytest.mark.parametrize("size", [1e-3, 0.05])
def test_no_true_input_is_further_from_the_corrected_one_than_said_and_some_is_nearly_as_far(size):
    correction, benches = uncertain_block(size)
    nearest = np.inf
    for reading in ([1.0, 0.0, 0.0], [-0.6, 0.8, 0.0], [0.5, -0.5, 0.7], [0.0, 0.0, -1.0], [0.01, -1.0, 0.0]):
        n = corrected(correction, GRAVITY * np.array([reading])) / GRAVITY
        least, most = remaining_error(correction, n)
        error = true_inputs(benches, np.array(reading)) - n
        assert np.all((least <= error) & (error <= most))
        nearest = min(nearest, *(1 - error.max(axis=0) / most[0]), *(1 - error.min(axis=0) / least[0]))
    # it is attained to first order
    assert nearest <= 6 * size


@pytest.mark.parametrize("size", [1e-3, 0.1, 0.3])
def test_the_bound_of_corrected_readings_is_attained_by_a_scale_factor(size):
    """With only the scale factor of accelerometer 1 known to `size`, the input for a reading of 1 g is at most 1/(1
    − size)."""
    ends = np.zeros((2, 3, 3, 3, 3))
    ends[0, 0, [0, 2], 1, 1], ends[1, 0, [0, 2], 1, 1] = -size, size
    block = Correction(GRAVITY, np.ones(3), np.ones(3), np.zeros((3, 3)), np.zeros(3), ends[0], ends[1])
    least, most = remaining_error(block, np.array([[1.0, 0.0, 0.0]]))
    assert most[0, 0] == pytest.approx(1 / (1 - size) - 1, rel=1e-12)
    assert least[0, 0] == pytest.approx(-most[0, 0], rel=1e-12)


def test_errors_at_the_corners_are_attained_by_benches_that_explain_the_readings():
    _, reading, linearised = fitted(2, np.random.default_rng(1).uniform(-SIGMA, SIGMA, (24, 3)))
    result = calibrate(record(reading), noise_bound=SIGMA)
    correction = correction_of(result.to_json(), "here")
    low, high = error_bounds(correction, np.array([n for _, n in corners()], dtype=float))
    programme = Polytope(linearised.jacobian, linearised.bound)
    programme.confine(linearised.residual - linearised.bound, linearised.residual + linearised.bound)
    for k, (entry, weights) in enumerate(
        zip(result.reading_errors, error_weights(linearised.parametrisation), strict=True)
    ):
        p = entry.accelerometer - 1
        assert (entry.low, entry.high) == pytest.approx((low[k, p], high[k, p]), abs=1e-15)
        for end, sense in ((low[k, p], -1.0), (high[k, p], 1.0)):
            attained = float(weights @ (linearised.point + programme.maximise(sense * weights)[1]))
            assert -1e-5 * (high[k, p] - low[k, p]) <= sense * (attained - end) <= 0.0


def test_own_errors_of_readings_turn_the_vertical_as_far_as_said():
    noise = 1e-5
    none = np.zeros((3, 3, 3, 3))
    exact = Correction(GRAVITY, np.ones(3), np.ones(3), np.zeros((3, 3)), np.zeros(3), none, none)
    reading = face_readings(exact)[1]
    after = levelling(exact, reading, noise).after
    across = np.where(reading == 0.0, 1.0, 0.0)
    truth = reading * (1 - noise) + noise * across
    angle = np.arctan2(np.linalg.norm(np.cross(reading, truth), axis=1), np.einsum("ij,ij->i", reading, truth))
    assert after is not None
    np.testing.assert_allclose(after, angle, rtol=1e-9)
