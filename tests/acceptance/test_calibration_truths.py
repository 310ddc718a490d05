"""Truth in every interval: 500 random benches at the paper's bounds, three kinds of noise."""

import numpy as np
import pytest

from simulated_bench import ALPHA, BETA, guaranteed, interval, random_bench, simulated
from trihedron.models.bench import target_values
from trihedron.tools.bounded.programmes import Polytope
from trihedron.tools.calibration import calibrate, fit_record

SIGMA = 1e-5


def adversarial(bench: np.ndarray, k: int, sense: float) -> np.ndarray:
    """The noise (24, 3) within σ that drives the estimate of target k furthest from its truth."""
    here = fit_record(simulated(bench), noise_bound=SIGMA)
    programme = Polytope(here.jacobian, here.bound)
    programme.confine(-here.bound, here.bound)
    weights = programme.maximise(sense * np.eye(18)[k])[2]
    return SIGMA * np.sign(weights).reshape(-1, 3)


@pytest.mark.acceptance
def test_truth_is_in_every_interval_whatever_the_noise(capsys: pytest.CaptureFixture[str]) -> None:
    missed, biased, beyond = [], 0.0, -np.inf
    for seed in range(500):
        rng = np.random.default_rng(10_000 + seed)
        bench = random_bench(rng)
        truth = target_values(bench, np.eye(3))
        exact = calibrate(simulated(bench), noise_bound=SIGMA)
        biased = max(biased, float(np.abs(np.array([e.estimate for e in exact.parameters]) - truth).max()))
        for kind, noise in (
            ("uniform", rng.uniform(-SIGMA, SIGMA, (24, 3))),
            ("two-valued", SIGMA * rng.choice([-1.0, 1.0], (24, 3))),
            ("adversarial", adversarial(bench, seed % 18, 1.0 if seed % 36 < 18 else -1.0)),
        ):
            result = calibrate(simulated(bench, ALPHA, BETA, noise), noise_bound=SIGMA)
            assert result.verdict == "consistent"
            for e, x in zip(result.parameters, truth, strict=True):
                low, high = interval(e)
                assert e.estimate is not None
                excess = abs(e.estimate - x) - guaranteed(e)
                beyond = max(beyond, excess)
                # the guaranteed error is of the linear programme; adversarial noise attains it, and what is then
                # beyond it is the curvature of the model over that very distance
                if not low <= x <= high or excess > guaranteed(e) ** 2:
                    missed.append((seed, kind, e.symbol))
    with capsys.disabled():
        print(
            f"\n1500 records: {len(missed)} of 27000 intervals missed; estimates beyond the guaranteed error by "
            f"{beyond / SIGMA:.1e} σ at most; without noise wrong by {biased / SIGMA:.1e} σ at most"
        )
    assert missed == []
    assert biased <= 1e-9 * SIGMA
