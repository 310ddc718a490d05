"""Records that leave something open: too few positions, inputs without a certain sign."""

import numpy as np
import pytest

from simulated_bench import ALPHA, BETA, guaranteed, misses, random_bench, simulated
from trihedron.models.bench import ELEMENTARY, target_values
from trihedron.tools.calibration import calibrate, fit_record
from trihedron.tools.calibration.model import Positions, predicted_input

SIGMA = 1e-5
IDENTITY = np.eye(3)


INSUFFICIENT = {
    "one position": ([0.3], [0.4]),
    "beta all equal": (ALPHA, np.full(24, 0.7)),
    "beta all zero": (ALPHA, np.zeros(24)),
    "alpha all equal": (np.full(24, 0.3), BETA),
    "alpha all zero": (np.zeros(24), BETA),
    "five positions": (ALPHA[:5], BETA[:5]),
    "one position many times": (np.full(12, 0.3), np.full(12, 0.4)),
    "inner axis at two opposite angles": (ALPHA, np.where(np.arange(24) % 2, 0.0, np.pi)),
    "encoder errors about one angle": (ALPHA, 0.7 + 5e-6 * np.sin(np.arange(24.0))),
}


@pytest.mark.parametrize("plan", INSUFFICIENT)
def test_too_little_is_insufficient_what_is_known_is_right_and_the_positions_mend_it(plan):
    alpha, beta = (np.asarray(angles) for angles in INSUFFICIENT[plan])
    for seed in range(5):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        truth = target_values(bench, IDENTITY)
        noise = rng.uniform(-SIGMA, SIGMA, (len(alpha), 3))
        result = calibrate(simulated(bench, alpha, beta, noise), noise_bound=SIGMA)
        assert result.verdict == "insufficient"
        missing = {gap.symbol for gap in result.missing}
        assert missing
        for e, x in zip(result.parameters, truth, strict=True):
            if e.symbol in missing:
                assert (e.estimate, e.guaranteed_error, e.low, e.high) == (None, None, None, None)
            else:
                assert e.low <= x <= e.high
                assert abs(e.estimate - x) <= e.guaranteed_error
        more = result.next_positions
        assert 1 <= len(more) <= 8
        mended_alpha = np.append(alpha, np.radians([p["alpha_deg"] for p in more]))
        mended_beta = np.append(beta, np.radians([p["beta_deg"] for p in more]))
        mended = calibrate(simulated(bench, mended_alpha, mended_beta), noise_bound=SIGMA)
        assert mended.verdict == "consistent"
        assert max(guaranteed(e) for e in mended.parameters) < 10 * SIGMA


def positions_with_inputs_at_zero(bench, rng) -> tuple[np.ndarray, np.ndarray]:
    """Outer angles at which one input is zero to 3e-5, so that its sign stays open."""
    from scipy.optimize import brentq

    here = fit_record(simulated(bench), noise_bound=SIGMA)
    angles = []
    for k in range(9):
        beta = rng.uniform(0, 2 * np.pi)
        low, high = ((-0.7, 0.7), (-0.7, 0.7), (0.8, 2.3))[k % 3]

        def component(alpha, beta=beta, axis=k % 3):
            at = Positions(np.array([alpha]), np.array([beta]), np.array([0]))
            return float(predicted_input(here.parametrisation, here.point, at)[0, axis])

        if component(low) * component(high) < 0:
            angles.append((brentq(component, low, high) + rng.uniform(-3e-5, 3e-5), beta))
    alpha, beta = np.array(angles).T
    return alpha, beta


def test_readings_with_open_signs_are_kept_and_do_not_deceive():
    opened = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        for axis in (1, 2, 3):
            bench[ELEMENTARY.index(f"scale_error_plus_{axis}")] = sign = rng.choice([-9e-3, 9e-3])
            bench[ELEMENTARY.index(f"scale_error_minus_{axis}")] = -sign
        alpha, beta = positions_with_inputs_at_zero(bench, rng)
        alpha, beta = np.append(ALPHA, alpha), np.append(BETA, beta)
        noise = SIGMA * np.sign(rng.uniform(-1, 1, (len(alpha), 3)))
        result = calibrate(simulated(bench, alpha, beta, noise), noise_bound=SIGMA)
        assert misses(result, target_values(bench, IDENTITY)) == []
        assert len(result.linearised.bound) == 3 * len(alpha)
        widened = result.linearised.bound[72:] > SIGMA * (1 + 1e-6)
        assert (result.linearised.bound[:72] == SIGMA).all()
        assert result.linearised.bound.max() < 2 * SIGMA
        opened += widened.sum()
    assert opened >= 12 * 5


def test_positions_on_the_axes_use_signs_that_the_estimate_gives():
    alpha, beta = (np.radians(g.ravel()) for g in np.meshgrid(np.arange(0, 360, 45), np.arange(0, 360, 45)))
    for seed in range(5):
        rng = np.random.default_rng(seed)
        bench = random_bench(rng)
        noise = rng.uniform(-SIGMA, SIGMA, (64, 3))
        result = calibrate(simulated(bench, alpha, beta, noise), noise_bound=SIGMA)
        assert misses(result, target_values(bench, IDENTITY)) == []
