"""The estimate of a calibration for the number of readings of a long campaign."""

import numpy as np
import pytest

from calibration_checks import misses, tilt_left
from generator import G as GRAVITY
from generator.stands import random_bench, simulated
from trihedron.models.bench import target_reading, target_values
from trihedron.tools.calibration import calibrate, correction_of

SIGMA = 1e-5


@pytest.mark.acceptance
def test_ten_thousand_positions(capsys: pytest.CaptureFixture[str]) -> None:
    """Each estimate is within its interval, all are possible together, and the error has shrunk with the intervals."""
    rng = np.random.default_rng(8)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, 10_000))
    measured = simulated(bench, alpha, beta, rng.uniform(-SIGMA, SIGMA, (10_000, 3)))
    result, truth = calibrate(measured, noise_bound=SIGMA), target_values(bench, np.eye(3))
    assert misses(result, truth) == []
    assert result.estimator == "analytic centre"
    estimate, a_priori, squares = (
        np.array([getattr(e, key) for e in result.parameters]) for key in ("estimate", "a_priori", "least_squares")
    )
    remaining = measured.specific_force / GRAVITY - target_reading(estimate, alpha, beta, np.eye(3))
    assert np.abs(remaining).max() <= SIGMA * (1.0 + 1e-8)
    errors = [float(np.sqrt(np.mean((x - truth) ** 2))) / SIGMA for x in (estimate, a_priori, squares)]
    tilt = np.degrees(tilt_left(correction_of(result.to_json(), "here"), truth)) * 3600.0
    with capsys.disabled():
        print(f"\n10,000 positions, rms errors in σ: {errors}, tilt of corrected readings {tilt:.4f} arcsec")
    assert sum(not e.possible(e.a_priori) for e in result.parameters) >= 16
    assert errors[0] < 0.002
    assert errors[0] < 0.1 * errors[2] < 0.1 * errors[1]
    assert tilt < 0.01
