"""The Allan deviation within rests, and the noise bound that follows from it."""

import numpy as np
import pytest

from table_runs import GRAVITY, PROGRAMME, Bench, averaged
from trihedron.tools.records.noise import allan_deviation, deviation_at_dwell, noise_bound_from


def test_the_deviation_by_its_definition():
    rng = np.random.default_rng(1)
    pieces = [rng.normal(size=(n, 2)) for n in (10, 17, 3)]
    squares = [
        (piece[k + 3 : k + 6].mean(axis=0) - piece[k : k + 3].mean(axis=0)) ** 2
        for piece in pieces
        for k in range(len(piece) - 5)
    ]
    found = allan_deviation(pieces, 3)
    assert found is not None
    np.testing.assert_allclose(found, np.sqrt(np.mean(squares, axis=0) / 2), rtol=1e-12)
    assert allan_deviation(pieces, 9) is None


@pytest.mark.parametrize("rows", [40, 41, 400])
def test_white_noise_at_the_dwell_is_its_deviation_over_the_root_of_the_rows(rows):
    rng = np.random.default_rng(2)
    found = deviation_at_dwell([rng.normal(size=(rows, 3)) for _ in range(200)])
    assert found is not None
    np.testing.assert_allclose(found, rows**-0.5, rtol=0.12)


def test_flicker_and_walks_do_not_average_out():
    rng = np.random.default_rng(3)
    walks = [np.cumsum(rng.normal(size=(400, 1)), axis=0) for _ in range(100)]
    # the deviation of a walk over τ rows grows as sqrt(τ/3)
    found = deviation_at_dwell(walks)
    assert found is not None
    np.testing.assert_allclose(found, (400 / 3) ** 0.5, rtol=0.15)


def test_too_short_or_equal_readings():
    assert deviation_at_dwell([]) is None
    assert deviation_at_dwell([np.zeros((3, 3))] * 5) is None
    equal = deviation_at_dwell([np.full((9, 3), 0.1)] * 5)
    assert equal is not None
    assert equal.tolist() == [0.0, 0.0, 0.0]


def test_the_noise_bound_of_a_run_without_repeats_names_it():
    bound = noise_bound_from(averaged(Bench(white=5e-6).run(PROGRAMME)[0]))
    assert bound is not None
    assert not bound.complete
    # 5e-6 / sqrt(3) of 198 rows, three times; the largest of three that 24 pairs of halves tell
    assert 0.8 < bound.value / (3 * 5e-6 / 3**0.5 / 198**0.5) < 1.6
    assert "scatter within 24 rests: 3 times the Allan deviation at their dwell of 19.8 s" in bound.basis


def test_many_rests_tell_the_noise_of_a_mean():
    record = averaged(Bench(white=5e-6).run(PROGRAMME * 6)[0])
    assert record.dwell_noise is not None
    assert record.dwell_noise.dwell_s == pytest.approx(19.8)
    np.testing.assert_allclose(np.array(record.dwell_noise.deviation) / GRAVITY, 5e-6 / 3**0.5 / 198**0.5, rtol=0.2)
