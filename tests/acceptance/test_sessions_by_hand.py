"""Two hundred simulated sessions of each kind without a table: truth inside, errors right, bounds nearly attained."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import linprog

import trihedron as th
from by_hand import GRAVITY, NAMES, Instrument, present
from hand_sessions import directions, ferraris, hand_moved, poses, truth
from trihedron.tools.motion.determinacy import UNSEEN, slopes_of
from trihedron.tools.motion.norm import norm_equations

pytestmark = pytest.mark.acceptance
SESSIONS = 200
SD = 4e-4


def well_spread(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return the best of some draws of directions (count, 3)."""
    drawn = [directions(rng, count) for _ in range(60 if count < 20 else 5)]
    return max(drawn, key=lambda up: float(np.linalg.svd(slopes_of(up), compute_uv=False)[-1]))


@pytest.mark.parametrize(("count", "bound"), [(9, 1e-3), (12, 1e-3), (20, 1e-3), (40, 1e-3), (20, 5e-3)])
def test_truth_is_inside_of_the_guaranteed_ends_and_these_are_nearly_attained(count: int, bound: float) -> None:
    attained = []
    for seed in range(SESSIONS):
        rng = np.random.default_rng(1000 * count + seed)
        instrument = Instrument(seed)
        # Errors at their bounds as often as between: the hardest that a bound allows.
        errors = rng.uniform(-bound, bound, (count, 3))
        at_bound = rng.random((count, 3)) < 0.5
        errors = np.where(at_bound, bound * np.sign(errors), errors)
        table = poses(instrument, well_spread(rng, count), errors)
        result = th.calibrate(table, noise_bound=bound, gravity=GRAVITY)
        assert result.verdict != "falsified"
        for symbol in NAMES:
            p = result[symbol]
            if p.low is not None and p.high is not None:
                assert p.low <= truth(instrument)[symbol] <= p.high, (seed, symbol)
        if seed % 20 == 0 and result["bias_1"].low is not None:
            attained.append(_attained(result, table, bound))
    assert np.median(attained) > (0.95 if bound <= 1e-3 else 0.85)


def _attained(result: Any, table: Any, bound: float) -> float:
    """Return the part of the interval of bias 1 that parameters within the bounds attain, by another programme."""
    reading = np.column_stack([table[f"f{axis}_mps2"] for axis in (1, 2, 3)]) / GRAVITY
    ends = []
    for sense in (1.0, -1.0):
        x = np.array([result[symbol].least_squares for symbol in NAMES])
        for _ in range(25):
            residual, slopes, back = norm_equations(x, reading)
            allowed = bound * np.abs(back).sum(axis=1)
            weights = np.zeros(9)
            weights[6] = -sense
            rows = np.vstack([slopes, -slopes])
            ends_of_rows = np.concatenate([allowed - residual, allowed + residual])
            step = linprog(weights, A_ub=rows, b_ub=ends_of_rows, bounds=[(-0.02, 0.02)] * 9).x
            x = x + step
            if np.abs(step).max() < 1e-9:
                break
        ends.append(x[6])
    return (ends[0] - ends[1]) / (result["bias_1"].high - result["bias_1"].low)


def test_standard_errors_of_free_poses_are_right_within_ten_percent() -> None:
    ratios, of_poses = [], []
    for seed in range(SESSIONS):
        rng = np.random.default_rng(seed)
        instrument = Instrument(seed)
        table = poses(instrument, directions(rng, 16), rng.normal(0.0, SD, (16, 3)))
        result = th.calibrate(table, noise_sd=SD, gravity=GRAVITY)
        known = truth(instrument)
        for symbol in NAMES:
            ratios.append((present(result[symbol].estimate) - known[symbol]) / present(result[symbol].standard_error))
        fitted = np.array([result[symbol].estimate for symbol in NAMES])
        readings = instrument.readings(GRAVITY * UNSEEN) / GRAVITY
        of_poses.append(
            np.abs(norm_equations(fitted, readings)[0]).max() / present(present(result.by_hand).pose_error).worst
        )
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=0.1)
    assert np.quantile(of_poses, 0.9) < 3.0


def test_gyros_of_hand_moved_blocks_are_within_their_errors() -> None:
    ratios = []
    for seed in range(60):
        instrument, table = hand_moved(seed, 16)
        result = th.calibrate(table, gravity=GRAVITY)
        for p in result.parameters:
            if p.symbol.startswith("M"):
                ratios.append((present(p.estimate) - truth(instrument)[p.symbol]) / present(p.standard_error))
    # Real instruments leave 0.3 mg, which this simulation does not have: the errors are on the safe side.
    size = np.sqrt(np.mean(np.square(ratios)))
    assert 0.2 < size < 1.1
    assert np.abs(ratios).max() < 5.0


def test_three_turns_and_six_faces_hold_the_truth() -> None:
    ratios = []
    for seed in range(40):
        instrument, table = ferraris(seed)
        result = th.calibrate(table, gravity=GRAVITY)
        for symbol in (*NAMES, "M11", "M22", "M33"):
            ratios.append(
                (present(result[symbol].estimate) - truth(instrument)[symbol]) / present(result[symbol].standard_error)
            )
    assert np.abs(ratios).max() < 4.5
