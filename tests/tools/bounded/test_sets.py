"""Smallest sets of effects: the bounds are valid, and the search agrees with exhaustive search."""

from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.tools.bounded import (
    ACCEPTED,
    REFUSED,
    EffectSet,
    Problem,
    Work,
    bounds_of,
    linear_radius,
    parts,
    project,
    sets_of_size,
    settle,
    sharp_weights,
    standing_in_some_rows,
    surviving_sets,
)
from trihedron.tools.bounded.work import Budget, CutOff, shared_budget


def random_problem(seed: int, rows: int = 40, effects: int = 7) -> Problem:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 3, effects)
    ends = np.cumsum(sizes)
    blocks = tuple(slice(int(e - s), int(e)) for s, e in zip(sizes, ends, strict=True))
    residual = rng.uniform(-1.0, 1.0, rows)
    return Problem(residual, rng.normal(size=(rows, 5)), rng.normal(size=(rows, int(ends[-1]))), blocks)


def as_row(candidate: EffectSet) -> list[int]:
    effects, outliers = list(candidate.effects), list(candidate.outliers)
    return effects + [-1] * (3 - len(effects)) + outliers + [-1] * (2 - len(outliers))


def every_set(size: int, effects: int, rows: int) -> list[EffectSet]:
    return [
        EffectSet(chosen, outliers)
        for out in range(min(size, 2) + 1)
        for chosen in combinations(range(effects), size - out)
        for outliers in combinations(range(rows), out)
    ]


@settings(max_examples=25)
@given(st.integers(0, 10**6), st.integers(0, 4), st.integers(0, 3))
def test_bounds_never_exceed_the_radius(seed, rounds, size):
    problem = random_problem(seed)
    projection = project(problem, sharp_weights(problem, np.full(40, 1 / 40), rounds))
    rng = np.random.default_rng(seed)
    sets = every_set(size, 7, 40)
    some = [sets[int(i)] for i in rng.choice(len(sets), size=min(12, len(sets)), replace=False)]
    rows = np.array([as_row(candidate) for candidate in some])
    bounds = bounds_of(rows, parts(problem, projection))
    for candidate, bound in zip(some, bounds, strict=True):
        assert bound <= linear_radius(problem, candidate) ** 2 * (1 + 1e-9)


@pytest.mark.parametrize("size", [0, 1, 2, 3])
def test_a_bound_is_the_least_weighted_mean_square_of_the_readings_that_are_kept(size):
    """The bound is that value and not less: a linear programme has to make up for any loss, set by set."""
    problem = random_problem(5, rows=24, effects=5)
    weights = sharp_weights(problem, np.full(24, 1 / 24), 3)
    sets = every_set(size, 5, 24)[:: 1 + 4 * size]
    bounds = bounds_of(np.array([as_row(candidate) for candidate in sets]), parts(problem, project(problem, weights)))
    for candidate, bound in zip(sets, bounds, strict=True):
        rows = np.setdiff1d(np.arange(24), candidate.outliers)
        root = np.sqrt(weights[rows] / weights[rows].sum())
        columns = np.hstack(
            [problem.nominal, *(problem.columns[:, problem.blocks[effect]] for effect in candidate.effects)]
        )
        right = root * problem.residual[rows]
        residual = right - (weighted := root[:, None] * columns[rows]) @ np.linalg.lstsq(weighted, right, rcond=None)[0]
        assert bound == pytest.approx(residual @ residual, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("size", [0, 1, 2, 3])
def test_the_scan_keeps_exactly_the_sets_within_the_limit(size):
    problem = random_problem(7, rows=20, effects=5)
    projection = project(problem, sharp_weights(problem, np.full(20, 1 / 20), 2))
    sets = every_set(size, 5, 20)
    bounds = bounds_of(np.array([as_row(s) for s in sets]), parts(problem, projection))
    limit = float(np.median(bounds)) * (1 + 1e-12)
    rows = {tuple(as_row(s)) for s, bound in zip(sets, bounds, strict=True) if bound <= limit}
    projection_parts = parts(problem, projection)
    survivors = [
        surviving_sets(problem.choices(size - out), out, limit, projection_parts) for out in range(min(size, 2) + 1)
    ]
    assert {tuple(int(i) for i in row) for part in survivors for row in part} == rows


@pytest.mark.parametrize("size", [0, 1, 2, 3])
def test_of_candidates_that_are_alike_a_set_has_one_at_most(size):
    problem = replace(random_problem(7, rows=20, effects=6), alike=2)
    expected = {chosen for chosen in combinations(range(6), size) if not {4, 5} <= set(chosen)}
    choices = problem.choices(size)
    assert len(choices) == len(expected)
    assert {tuple(int(i) for i in row if i >= 0) for row in choices} == expected


@pytest.mark.parametrize("alike", [0, 30])
def test_many_candidates_are_judged_by_some_rows_first_and_what_stands_is_the_same(alike, monkeypatch):
    """Steps that are the same in those rows are one there, and each of them is judged in all rows."""
    rng = np.random.default_rng(2)
    rows, hidden = 90, (3, 25)
    columns = [rng.normal(size=(rows, 1)) for _ in range(10)]
    columns += [np.where(np.arange(rows)[:, None] > 20 + 2 * k, 1.0, 0.0) for k in range(30)]
    residual = 30 * columns[hidden[0]][:, 0] + 20 * columns[hidden[1]][:, 0] + rng.uniform(-1, 1, rows)
    residual[40] += 9.0
    problem = Problem.of(residual, np.ones((rows, 1)), columns, alike)
    expected = {size: set(sets_of_size(problem, size, 0.0)) for size in (1, 2, 3)}
    assert EffectSet(hidden, (40,)) in expected[3]
    monkeypatch.setattr("trihedron.tools.bounded.sets.MANY_CANDIDATES", 20)
    monkeypatch.setattr("trihedron.tools.bounded.sets.SOME_ROWS", 18)
    fewer, groups = problem.of_some_rows()
    assert len(fewer.residual) < 25
    assert len(groups) < len(problem.blocks)
    assert {size: set(sets_of_size(problem, size, 0.0)) for size in (1, 2, 3)} == expected
    few = len(standing_in_some_rows(problem, 3, 0.0, 2, Work()))
    assert few < len(problem.blocks)


def test_columns_that_depend_on_others_change_nothing():
    """Test the same column twice, a zero column, a column of the nominal model: no division by zero, the same
    bounds."""
    plain = random_problem(11, effects=3)
    twice = np.hstack((plain.columns, plain.columns[:, :1], np.zeros((40, 1)), plain.nominal[:, 1:2]))
    last = plain.blocks[-1].stop
    repeated = tuple(slice(last + k, last + k + 1) for k in range(3))
    problem = Problem(plain.residual, plain.nominal, twice, (*plain.blocks, *repeated))
    projection = project(problem, np.full(40, 1 / 40))
    rows = np.array([as_row(EffectSet(e)) for e in ((0, 1), (0, 1, 3), (0, 1, 4), (0, 1, 5))])
    bounds = bounds_of(rows, parts(problem, projection))
    if plain.blocks[0].stop - plain.blocks[0].start == 1:
        assert bounds[1] == pytest.approx(bounds[0], rel=1e-9)
    assert bounds[2:] == pytest.approx(np.full(2, bounds[0]), rel=1e-9)


def test_lawsons_algorithm_makes_the_bound_sharp():
    small = random_problem(3)
    problem = Problem(3.0 * small.residual, small.nominal, small.columns, small.blocks)
    exact = linear_radius(problem, EffectSet((1,)))
    start = np.full(40, 1 / 40)
    candidate = np.array(as_row(EffectSet((1,))))
    verdict, weights = settle(problem.system, candidate, start, (0.97 * exact) ** 2)
    assert verdict == REFUSED
    assert weights.sum() == pytest.approx(1.0)
    assert settle(problem.system, candidate, start, (1.001 * exact) ** 2)[0] != REFUSED
    scaled = Problem(problem.residual / (1.3 * exact), problem.nominal, problem.columns, problem.blocks)
    assert settle(scaled.system, candidate, start, 1.0)[0] == ACCEPTED


@pytest.mark.first(1)
@pytest.mark.parametrize("seed", [0, 1, 2, *(pytest.param(k, marks=pytest.mark.acceptance) for k in range(3, 8))])
def test_the_search_finds_exactly_the_sets_that_will_do(seed):
    """Compare with exhaustive search by linear programmes over every set of up to three."""
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, rows=24, effects=5)
    true = EffectSet(
        tuple(sorted(rng.choice(5, size=rng.integers(0, 2), replace=False).tolist())),
        tuple(sorted(rng.choice(24, size=rng.integers(1, 3), replace=False).tolist())),
    )
    residual = 0.6 * problem.residual
    for index in (k for effect in true.effects for k in range(problem.columns.shape[1])[problem.blocks[effect]]):
        residual = residual + 4.0 * problem.columns[:, index]
    for row in true.outliers:
        residual[row] += 30.0
    problem = Problem(residual, problem.nominal, problem.columns, problem.blocks)
    assert not list(sets_of_size(problem, 0, 0.0))
    nominal = EffectSet(())
    beyond = linear_radius(problem, nominal) - 1.0
    assert list(sets_of_size(problem, 0, beyond + 1e-6)) == [nominal]
    assert list(sets_of_size(problem, 0, beyond - 1e-6)) == []
    for size in (1, 2, 3):
        radii = {candidate: linear_radius(problem, candidate) for candidate in every_set(size, 5, 24)}
        for slack in (0.0, 0.3):
            expected = [candidate for candidate, radius in radii.items() if radius <= 1.0 + slack]
            assert sorted(sets_of_size(problem, size, slack)) == sorted(expected)
        if min(radii.values()) <= 1.0:
            break


def test_a_shared_budget_ends_limited_searches_and_keeps_their_names():
    with shared_budget(Budget(10.0)) as budget:
        first, second, needed = Work(8.0, "first"), Work(8.0, "second"), Work()
        first.add(6.0)
        with pytest.raises(CutOff):
            second.add(6.0)
        needed.add(6.0)
    assert (budget.done, budget.cut_off) == (18.0, ["second"])
    Work(8.0).add(6.0)
