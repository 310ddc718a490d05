"""Unknowns of single positions: the programme without them has the radius of the dense one."""

import numpy as np
import pytest

import trihedron as th
from generator import SIGMA
from generator.positions import drawn_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.elimination import eliminated, settled_beside
from trihedron.tools.bounded.programmes import chebyshev_radius
from trihedron.tools.bounded.set_bounds import ACCEPTED, REFUSED

POSITIONS, PARAMETERS = 30, 7


@pytest.mark.parametrize("rows", [1, 2, 3], ids=["accelerometer", "two rows", "axis"])
@pytest.mark.parametrize("seed", range(4))
def test_radius_is_that_of_the_dense_programme(rows: int, seed: int):
    rng = np.random.default_rng([seed, rows])
    system = rng.normal(size=(3 * POSITIONS, PARAMETERS + 1))
    free = np.zeros((3 * POSITIONS, POSITIONS))
    for position in range(POSITIONS):
        free[3 * position : 3 * position + rows, position] = rng.normal(size=rows) * 10.0 ** rng.uniform(-3.0, 3.0)
    remaining = eliminated(system, free)
    assert remaining is not None
    dense = np.hstack((system[:, :-1], free / np.linalg.norm(free, axis=0)))
    expected = chebyshev_radius(dense, system[:, -1], np.ones(len(dense)))[0]
    radius = chebyshev_radius(remaining[:, :-1], remaining[:, -1], np.ones(len(remaining)))[0]
    assert radius == pytest.approx(expected, rel=1e-8)
    assert expected > 0.1


def test_an_unknown_of_many_rows_and_rows_of_two_unknowns_stay_dense():
    system = np.random.default_rng(1).normal(size=(12, 3))
    assert eliminated(system, np.ones((12, 1))) is None
    assert eliminated(system, np.ones((12, 2))) is None


@pytest.mark.parametrize("seed", range(4))
def test_rests_in_a_chain_are_refused_and_accepted_as_by_the_dense_programme(seed: int):
    """Each rest has a row of its own, and one with each of the three rests after it."""
    rng = np.random.default_rng(seed)
    rests = [(k, k + apart) for apart in range(4) for k in range(40 - apart)]
    free = np.zeros((len(rests), 40))
    for row, (before, after) in enumerate(rests):
        free[row, before] += rng.normal()
        free[row, after] += rng.normal()
    system = np.column_stack((np.ones(len(rests)), rng.normal(size=(len(rests), PARAMETERS))))
    # The unknowns of the rests imitate one parameter.
    system[:, 1] = free @ rng.normal(size=40)
    weights = np.full(len(rests), 1.0 / len(rests))
    radius = chebyshev_radius(np.hstack((system[:, :-1], free)), system[:, -1], np.ones(len(rests)))[0]
    assert settled_beside(system, free, weights, 0.9 * radius) == REFUSED
    assert settled_beside(system, free, weights, 1.1 * radius) == ACCEPTED


@pytest.mark.acceptance
def test_an_effect_among_a_hundred_positions_is_named_at_its_place():
    record = drawn_record(6, [(EffectPlace("cubic", "accelerometer-1"), (6e-4,))], 100)
    result = th.diagnose(record, noise_bound=SIGMA)
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [EffectPlace("cubic", "accelerometer-1")]
