"""The noise bound from a record covers the true one, and is not given without evidence; Allan deviation."""

import math
from fractions import Fraction

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.runs import PROGRAMME, Bench
from trihedron.tools.records import NoiseBound, PositionRecord, allan_deviation, deviation_at_dwell, noise_bound_from
from trihedron.tools.records import position_record_of as averaged
from trihedron.tools.records.sigma import Fitted, pooled_deviation

SIGMA = 1e-5


def record_with(rng, alpha, beta, noise=SIGMA, mounting=None, **fields) -> PositionRecord:
    """Return a block with scale errors and biases of 1e-3 at these angles, errors uniform within ±noise."""
    alpha, beta = np.asarray(alpha, dtype=float), np.asarray(beta, dtype=float)
    up = np.stack([np.sin(alpha) * np.sin(beta), np.sin(alpha) * np.cos(beta), np.cos(alpha)], axis=1)
    block = np.eye(3) + rng.uniform(-1e-3, 1e-3, (3, 3))
    force = up @ block.T + rng.uniform(-1e-3, 1e-3, 3) + rng.uniform(-noise, noise, up.shape)
    count = np.arange(1, len(alpha) + 1)
    return PositionRecord(count, 30.0 * count, alpha, beta, GRAVITY * force, mounting=mounting, **fields)


def bound_of(record: PositionRecord) -> NoiseBound:
    bound = noise_bound_from(record)
    assert bound is not None
    return bound


ALPHA = np.deg2rad([20 + 45 * k for k in range(8)] * 3)
BETA = np.deg2rad(np.repeat([25, 145, 265], 8))


@pytest.mark.acceptance
def test_the_bound_from_repeats_covers_the_true_one():
    covered, values = 0, []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        repeated = np.concatenate([np.arange(24), [0, 5, 9, 14]])
        bound = bound_of(record_with(rng, ALPHA[repeated], BETA[repeated]))
        covered += bound.value >= SIGMA
        assert "8 visits to 4 repeated positions" in bound.basis
        values.append(bound.value)
    # uniform errors need no more than their bound
    assert covered >= 190
    assert np.median(values) < 2.2 * SIGMA


def test_repeats_may_differ_by_arcseconds():
    repeated = np.concatenate([np.arange(24), np.arange(24)])
    values = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        off = rng.uniform(-20, 20, (2, 48)) * np.deg2rad(1 / 3600)
        bound = bound_of(record_with(rng, ALPHA[repeated] + off[0], BETA[repeated] + off[1]))
        values.append(bound.value)
    # uncorrected, 40 arcsec would be 2e-4
    assert max(values) < 2.0 * SIGMA
    assert min(values) > SIGMA


def test_repeats_are_found_a_whole_turn_apart_and_across_zero():
    rng = np.random.default_rng(4)
    alpha = np.append(ALPHA, [ALPHA[0] + 2 * np.pi, ALPHA[3] - 2 * np.pi])
    beta = np.append(BETA, [BETA[0], BETA[3] + 2 * np.pi])
    bound = bound_of(record_with(rng, alpha, beta))
    assert "4 visits to 2 repeated positions" in bound.basis
    alpha[[0, 24]] = [1e-6, 2 * np.pi - 1e-6]
    bound = bound_of(record_with(rng, alpha, beta))
    assert "4 visits to 2 repeated positions" in bound.basis


def test_another_mounting_is_no_repeat():
    alpha, beta = np.tile(ALPHA, 2), np.tile(BETA, 2)
    rng = np.random.default_rng(5)
    assert noise_bound_from(record_with(rng, alpha, beta, mounting=("a",) * 24 + ("b",) * 24)) is None
    assert noise_bound_from(record_with(rng, alpha, beta, mounting=("a",) * 48)) is not None


def test_few_positions_still_give_a_bound_that_covers():
    rng = np.random.default_rng(6)
    bound = bound_of(record_with(rng, [0.3, 0.3, 0.3], [0.5, 0.5, 0.5]))
    assert bound.value > SIGMA
    assert "1 repeated position;" in bound.basis


def test_without_repeats_and_scatter_there_is_none():
    assert noise_bound_from(record_with(np.random.default_rng(7), ALPHA, BETA)) is None
    sweep = np.deg2rad(np.arange(2000) / 100)
    assert noise_bound_from(record_with(np.random.default_rng(7), sweep, np.zeros(2000))) is None


def test_scatter_alone_says_what_it_does_not_show():
    scatter = np.full((24, 3), 2e-6 * GRAVITY)
    bound = bound_of(record_with(np.random.default_rng(8), ALPHA, BETA, scatter=scatter))
    assert bound.value == pytest.approx(Fitted(24).factor(24) * 2e-6, rel=1e-12)
    assert 2.5 < Fitted(24).factor(24) < 3.1
    assert "does not show" in bound.basis


def test_repeats_outweigh_a_smaller_scatter():
    repeated = np.concatenate([np.arange(24), np.arange(24)])
    scatter = np.full((48, 3), 1e-7 * GRAVITY)
    bound = bound_of(record_with(np.random.default_rng(9), ALPHA[repeated], BETA[repeated], scatter=scatter))
    assert "repeated positions" in bound.basis
    assert bound.value > SIGMA


def test_a_record_without_errors_has_no_bound_but_its_last_digit():
    alpha, beta = np.full(4, 0.3), np.full(4, 0.5)
    exact = record_with(np.random.default_rng(10), alpha, beta, noise=0.0)
    assert noise_bound_from(exact) is None
    written = record_with(np.random.default_rng(10), alpha, beta, noise=0.0, resolution=5e-6)
    bound = bound_of(written)
    assert bound.value == pytest.approx(5e-6 / GRAVITY, rel=1e-12)
    assert "last digit" in bound.basis


def test_readings_that_rounding_makes_equal_have_half_a_last_digit_for_their_bound_and_it_is_nearly_attained():
    digit = 1e-5
    alpha, beta = np.full(4, 0.3), np.full(4, 0.5)
    true = record_with(np.random.default_rng(10), alpha, beta, noise=0.0)
    force = digit * (np.floor(true.specific_force[:1] / digit) + 0.4999) * np.ones((4, 1))
    written = np.round(force / digit) * digit
    bound = bound_of(PositionRecord(true.position, true.time_s, alpha, beta, written, resolution=0.5 * digit))
    assert 0.99 * bound.value < np.abs(written - force).max() / GRAVITY <= bound.value


# N, D50, D99, and σ over a standard deviation from 2, 4 and 20 repeats, for a model of 18 parameters
TABLE = [
    (24, 1.64, 2.46, 4.68, 3.41, 2.62),
    (36, 1.83, 2.60, 5.12, 3.69, 2.80),
    (48, 1.96, 2.70, 5.41, 3.89, 2.92),
    (100, 2.26, 2.94, 6.13, 4.37, 3.21),
    (300, 2.65, 3.26, 7.11, 5.03, 3.63),
    (1000, 3.04, 3.59, 8.08, 5.69, 4.05),
]


@pytest.mark.parametrize("row", TABLE)
def test_sigma_by_a_standard_deviation_against_a_table(row):
    fitted = Fitted(row[0])
    factors = [fitted.factor(3 * repeats) for repeats in (2, 4, 20)]
    assert [fitted.usual, fitted.largest, *factors] == pytest.approx(list(row[1:]), abs=0.006)


def test_few_positions_have_a_wider_quantile():
    # the normal quantiles of 1/10 and 1/144
    assert [Fitted(12).usual, Fitted(12).largest] == pytest.approx([1.2816, 2.4601], abs=1e-3)
    assert Fitted(2).usual < Fitted(2).largest


def test_a_noisy_channel_counts_by_itself():
    assert pooled_deviation(np.array([10.0, 12.0, 14.0]), 12) == pytest.approx((1.0, 36))
    assert pooled_deviation(np.array([12.0, 300.0, 12.0]), 12) == pytest.approx((5.0, 12))
    assert pooled_deviation(np.zeros(3), 2) == (0.0, 6)


def test_the_deviation_by_its_definition():
    rng = np.random.default_rng(1)
    pieces = [rng.normal(size=(n, 2)) for n in (10, 17, 3)]
    squares = [
        (piece[k + 3 : k + 6].mean(axis=0) - piece[k : k + 3].mean(axis=0)) ** 2
        for piece in pieces
        for k in range(len(piece) - 5)
    ]
    deviation = allan_deviation(pieces, 3)
    assert deviation is not None
    np.testing.assert_allclose(deviation, np.sqrt(np.mean(squares, axis=0) / 2), rtol=1e-12)
    assert allan_deviation(pieces, 9) is None


@pytest.mark.parametrize("level", [0.0, 1.0, 1e3])
@pytest.mark.parametrize("size", [1, 7, 60, 150])
def test_allan_deviation_is_that_of_exact_sums(level, size):
    """Fractions lose no digit: a level far above the noise costs none either."""
    piece = level + 1e-4 * np.cumsum(np.random.default_rng(5).normal(size=400))
    sums = [Fraction(0)]
    for value in piece.tolist():
        sums.append(sums[-1] + Fraction(value))
    squares = []
    for first in range(len(sums) - 2 * size):
        squares.append((sums[first + 2 * size] - 2 * sums[first + size] + sums[first]) ** 2)
    exact = math.sqrt(sum(squares) / (2 * size**2 * len(squares)))
    deviation = allan_deviation([piece[:, None]], size)
    assert deviation is not None
    assert deviation[0] == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("rows", [40, 41, 400])
def test_white_noise_at_the_dwell_is_its_deviation_over_the_root_of_the_rows(rows):
    rng = np.random.default_rng(2)
    deviation = deviation_at_dwell([rng.normal(size=(rows, 3)) for _ in range(200)])
    assert deviation is not None
    np.testing.assert_allclose(deviation, rows**-0.5, rtol=0.12)


def test_flicker_and_walks_do_not_average_out():
    rng = np.random.default_rng(3)
    walks = [np.cumsum(rng.normal(size=(400, 1)), axis=0) for _ in range(100)]
    # the deviation of a walk over τ rows grows as sqrt(τ/3)
    deviation = deviation_at_dwell(walks)
    assert deviation is not None
    np.testing.assert_allclose(deviation, (400 / 3) ** 0.5, rtol=0.15)


def test_too_short_or_equal_readings():
    assert deviation_at_dwell([]) is None
    assert deviation_at_dwell([np.zeros((3, 3))] * 5) is None
    equal = deviation_at_dwell([np.full((9, 3), 0.1)] * 5)
    assert equal is not None
    assert equal.tolist() == [0.0, 0.0, 0.0]


def test_the_noise_bound_of_a_run_without_repeats_names_it():
    bound = bound_of(averaged(Bench(white=5e-6).run(PROGRAMME)[0]))
    assert not bound.complete
    # 5e-6 / sqrt(3) of 198 rows; the largest of three that 24 pairs of halves tell
    factor = Fitted(24).factor(24)
    assert 0.8 < bound.value / (factor * 5e-6 / 3**0.5 / 198**0.5) < 1.6
    assert f"scatter within 24 rests: {factor:.2f} times the Allan deviation at their dwell of 19.8 s" in bound.basis


@pytest.mark.acceptance
def test_many_rests_tell_the_noise_of_a_mean():
    record = averaged(Bench(white=5e-6).run(PROGRAMME * 6)[0])
    assert record.dwell_noise is not None
    assert record.dwell_noise.dwell_s == pytest.approx(19.8)
    np.testing.assert_allclose(np.array(record.dwell_noise.deviation) / GRAVITY, 5e-6 / 3**0.5 / 198**0.5, rtol=0.2)
