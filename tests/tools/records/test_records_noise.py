"""The noise bound taken from a record: it covers the true bound, and is not taken where nothing shows it."""

import numpy as np
import pytest

from trihedron.tools.records import PositionRecord
from trihedron.tools.records.noise import noise_bound_from, uniform_range_quantile

GRAVITY = 9.80665
SIGMA = 1e-5


def record_with(rng, alpha, beta, noise=SIGMA, mounting=None, **more) -> PositionRecord:
    """A block with scale errors and biases of 1e-3 at these angles, errors uniform within ±noise."""
    alpha, beta = np.asarray(alpha, dtype=float), np.asarray(beta, dtype=float)
    up = np.stack([np.sin(alpha) * np.sin(beta), np.sin(alpha) * np.cos(beta), np.cos(alpha)], axis=1)
    block = np.eye(3) + rng.uniform(-1e-3, 1e-3, (3, 3))
    force = up @ block.T + rng.uniform(-1e-3, 1e-3, 3) + rng.uniform(-noise, noise, up.shape)
    count = np.arange(1, len(alpha) + 1)
    return PositionRecord(count, 30.0 * count, alpha, beta, GRAVITY * force, mounting=mounting, **more)


ALPHA = np.deg2rad([20 + 45 * k for k in range(8)] * 3)
BETA = np.deg2rad(np.repeat([25, 145, 265], 8))


def test_the_bound_from_repeats_covers_the_true_one_as_often_as_it_says():
    covered, values = 0, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        repeated = np.concatenate([np.arange(24), [0, 5, 9, 14]])
        bound = noise_bound_from(record_with(rng, ALPHA[repeated], BETA[repeated]))
        assert bound is not None
        covered += bound.value >= SIGMA
        assert "8 visits to 4 repeated positions" in bound.basis
        values.append(bound.value)
    # 95 % with a standard deviation of 1.5 %
    assert covered >= 181
    assert np.median(values) < 2 * SIGMA


def test_repeats_may_differ_by_arcseconds():
    repeated = np.concatenate([np.arange(24), np.arange(24)])
    values = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        off = rng.uniform(-20, 20, (2, 48)) * np.deg2rad(1 / 3600)
        bound = noise_bound_from(record_with(rng, ALPHA[repeated] + off[0], BETA[repeated] + off[1]))
        assert bound is not None
        values.append(bound.value)
    # uncorrected, 40 arcsec would be 2e-4
    assert max(values) < 1.3 * SIGMA
    # 95 % with a standard deviation of 3 %
    assert np.mean(np.array(values) >= SIGMA) > 0.86


def test_repeats_are_found_a_whole_turn_apart_and_across_zero():
    rng = np.random.default_rng(4)
    alpha = np.append(ALPHA, [ALPHA[0] + 2 * np.pi, ALPHA[3] - 2 * np.pi])
    beta = np.append(BETA, [BETA[0], BETA[3] + 2 * np.pi])
    bound = noise_bound_from(record_with(rng, alpha, beta))
    assert bound is not None
    assert "4 visits to 2 repeated positions" in bound.basis
    alpha[[0, 24]] = [1e-6, 2 * np.pi - 1e-6]
    bound = noise_bound_from(record_with(rng, alpha, beta))
    assert bound is not None
    assert "4 visits to 2 repeated positions" in bound.basis


def test_another_mounting_is_no_repeat():
    alpha, beta = np.tile(ALPHA, 2), np.tile(BETA, 2)
    rng = np.random.default_rng(5)
    assert noise_bound_from(record_with(rng, alpha, beta, mounting=("a",) * 24 + ("b",) * 24)) is None
    assert noise_bound_from(record_with(rng, alpha, beta, mounting=("a",) * 48)) is not None


def test_few_positions_still_give_a_bound_that_covers():
    rng = np.random.default_rng(6)
    bound = noise_bound_from(record_with(rng, [0.3, 0.3, 0.3], [0.5, 0.5, 0.5]))
    assert bound is not None
    assert bound.value > SIGMA
    assert "1 repeated position:" in bound.basis


def test_without_repeats_and_scatter_there_is_none():
    assert noise_bound_from(record_with(np.random.default_rng(7), ALPHA, BETA)) is None
    sweep = np.deg2rad(np.arange(2000) / 100)
    assert noise_bound_from(record_with(np.random.default_rng(7), sweep, np.zeros(2000))) is None


def test_scatter_alone_says_what_it_does_not_show():
    scatter = np.full((24, 3), 2e-6 * GRAVITY)
    bound = noise_bound_from(record_with(np.random.default_rng(8), ALPHA, BETA, scatter=scatter))
    assert bound is not None
    assert bound.value == pytest.approx(6e-6, rel=1e-12)
    assert "does not show" in bound.basis


def test_repeats_outweigh_a_smaller_scatter():
    repeated = np.concatenate([np.arange(24), np.arange(24)])
    scatter = np.full((48, 3), 1e-7 * GRAVITY)
    bound = noise_bound_from(record_with(np.random.default_rng(9), ALPHA[repeated], BETA[repeated], scatter=scatter))
    assert bound is not None
    assert "repeated positions" in bound.basis
    assert bound.value > SIGMA


def test_a_record_without_errors_has_no_bound_but_its_last_digit():
    alpha, beta = np.full(4, 0.3), np.full(4, 0.5)
    exact = record_with(np.random.default_rng(10), alpha, beta, noise=0.0)
    assert noise_bound_from(exact) is None
    written = record_with(np.random.default_rng(10), alpha, beta, noise=0.0, resolution=5e-6)
    bound = noise_bound_from(written)
    assert bound is not None
    assert bound.value == pytest.approx(5e-6 / GRAVITY, rel=1e-12)
    assert "last digit" in bound.basis


@pytest.mark.parametrize("counts", [[2], [2, 2, 2], [5], [2, 3, 8, 8]])
def test_the_quantile_of_ranges_against_simulation(counts):
    rng = np.random.default_rng(11)
    half_ranges = [0.5 * np.ptp(rng.uniform(-1, 1, (20_000, count)), axis=1) for count in counts]
    below = np.mean(np.max(half_ranges, axis=0) < uniform_range_quantile(np.array(counts), 0.05))
    # four standard deviations of a share of 5 % in 20 000
    assert below == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 20_000))
