"""The calibration against simulated benches: intervals, guaranteed errors, the verdict."""

import numpy as np
import pytest

from simulated_bench import ALPHA, BETA, GRAVITY, guaranteed, half_width, misses, random_bench, record, simulated
from trihedron.models.bench import TARGETS, elementary_reading, target_reading, target_values
from trihedron.tools.bounded.programmes import Polytope, chebyshev_radius
from trihedron.tools.calibration import calibrate, fit_record

SIGMA = 1e-5
IDENTITY = np.eye(3)


@pytest.mark.parametrize("block", range(8))
def test_truth_is_in_every_interval(block):
    for seed in range(25 * block, 25 * block + 25):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        uniform = rng.uniform(-SIGMA, SIGMA, (24, 3))
        noise = uniform if seed % 2 else SIGMA * np.sign(uniform)
        result = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA)
        assert misses(result, target_values(bench, IDENTITY)) == [], seed


def test_without_noise_estimates_are_exact_and_intervals_as_wide_as_guaranteed():
    for seed in range(5):
        bench = random_bench(np.random.default_rng(seed))
        result = calibrate(simulated(bench), noise_bound=SIGMA)
        assert [e.symbol for e in result.parameters] == list(TARGETS)
        estimates = np.array([e.estimate for e in result.parameters])
        np.testing.assert_allclose(estimates, target_values(bench, IDENTITY), rtol=0, atol=1e-9 * SIGMA)
        assert result.radius < 1e-9
        fine = calibrate(simulated(bench), noise_bound=1e-8)
        for e in fine.parameters:
            assert half_width(e) == pytest.approx(e.guaranteed_error, rel=1e-6)


def test_guaranteed_errors_are_those_of_the_linear_model_for_small_errors():
    result = calibrate(simulated(np.zeros(24)), noise_bound=SIGMA)
    costs = {e.symbol: guaranteed(e) / SIGMA for e in result.parameters}
    assert costs["X3"] == pytest.approx(1.27, abs=0.01)
    assert costs["X18"] == pytest.approx(2.1, abs=0.05)
    scale = [costs[symbol] for symbol in ("X4", "X5", "X9", "X10", "X14", "X15")]
    assert min(scale) == pytest.approx(2.7, abs=0.05)
    assert max(scale) == pytest.approx(3.5, abs=0.05)
    assert max(costs[s] for s in ("X4", "X5", "X9", "X10", "X14", "X15")) < 3.55


def test_a_worst_case_noise_attains_the_guaranteed_error():
    """Readings that belong to another bench as well: no estimator can tell the two apart.

    The noise is small so that the curvature of the model, (σ·cost)² against σ·cost, is below what is asked.
    """
    sigma = 1e-7
    truth = target_values(random_bench(np.random.default_rng(2)), IDENTITY)
    reading = target_reading(truth, ALPHA, BETA, IDENTITY)
    here = fit_record(record(reading), noise_bound=sigma)
    programme = Polytope(here.jacobian, here.bound)
    programme.confine(-here.bound, here.bound)
    for k in range(18):
        guaranteed, step, weights = programme.maximise(np.eye(18)[k])
        noise = (here.jacobian @ step).reshape(-1, 3)
        carrying = np.abs(weights.reshape(-1, 3)) > 1e-9
        np.testing.assert_allclose(noise[carrying], sigma * np.sign(weights.reshape(-1, 3)[carrying]), rtol=1e-8)
        assert np.abs(noise).max() <= sigma * (1 + 1e-9)
        result = calibrate(record(reading + noise), noise_bound=sigma)
        estimate = result.parameters[k]
        assert abs(estimate.estimate - truth[k]) == pytest.approx(guaranteed, rel=1e-6), estimate.symbol
        assert all(e.low <= x <= e.high for e, x in zip(result.parameters, truth, strict=True))


@pytest.mark.parametrize("noise_bound", [1e-10, 1e-7, 1e-3, 1e-2])
def test_intervals_hold_for_noise_of_any_size(noise_bound):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        noise = rng.uniform(-noise_bound, noise_bound, (24, 3))
        noise = noise if seed % 2 else noise_bound * np.sign(noise)
        result = calibrate(simulated(bench, noise=noise), noise_bound=noise_bound)
        assert result.verdict == "consistent"
        truth = target_values(bench, IDENTITY)
        assert all(e.low <= x <= e.high for e, x in zip(result.parameters, truth, strict=True))


def test_scale_factors_wrong_by_five_percent_and_a_crooked_mounting_converge():
    bench = random_bench(np.random.default_rng(4), u=0.02, v=0.15)
    assert np.abs(target_values(bench, IDENTITY)).max() > 0.05
    result = calibrate(simulated(bench), noise_bound=SIGMA)
    estimates = np.array([e.estimate for e in result.parameters])
    np.testing.assert_allclose(estimates, target_values(bench, IDENTITY), rtol=0, atol=1e-13)
    noise = np.random.default_rng(5).uniform(-SIGMA, SIGMA, (24, 3))
    noisy = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA)
    assert misses(noisy, target_values(bench, IDENTITY)) == []


def test_rounded_readings_stay_consistent_and_their_intervals_hold():
    rng = np.random.default_rng(1)
    bench = random_bench(rng)
    f = (elementary_reading(bench, ALPHA, BETA, IDENTITY) + SIGMA * np.sign(rng.uniform(-1, 1, (24, 3)))) * GRAVITY
    result = calibrate(record(np.round(f, 5) / GRAVITY, resolution=5e-6), noise_bound=SIGMA)
    assert 1.0 < result.radius < 1.0 + 5e-6 / GRAVITY / SIGMA
    assert result.verdict == "consistent"
    assert all(e.low <= x <= e.high for e, x in zip(result.parameters, target_values(bench, IDENTITY), strict=True))


def test_an_outlier_is_proven_by_its_witness_alone():
    bench = random_bench(np.random.default_rng(3))
    noise = np.random.default_rng(4).uniform(-SIGMA, SIGMA, (24, 3))
    noise[7, 1] += 3e-4
    result = calibrate(simulated(bench, noise=noise), noise_bound=SIGMA)
    assert result.verdict == "falsified"
    assert result.radius > 2
    proof = {(reading.position, reading.accelerometer) for reading in result.witness}
    assert (8, 2) in proof
    assert 2 <= len(result.witness) <= 19
    assert all(e.low is None and e.high is None and e.estimate is not None for e in result.parameters)
    here = result.linearised
    pairs = zip(here.position + 1, here.accelerometer, strict=True)
    rows = np.array([pair in proof for pair in pairs])
    alone, _, _ = chebyshev_radius(here.jacobian[rows], here.residual[rows], here.bound[rows])
    assert alone > 1
    assert alone == pytest.approx(result.radius, rel=1e-4)


@pytest.mark.parametrize("size", [1.0, 10.0])
def test_a_gross_error_is_falsified_and_not_a_failure(size):
    noise = np.zeros((24, 3))
    noise[7, 1] = size
    result = calibrate(simulated(random_bench(np.random.default_rng(3)), noise=noise), noise_bound=SIGMA)
    assert result.verdict == "falsified"
    assert result.radius > 1e3
