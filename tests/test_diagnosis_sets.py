"""Smallest sets of effects: the bounds are bounds, and the search finds what exhaustive search finds."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.calibration.programmes import chebyshev_radius
from trihedron.diagnosis.lawson import (
    Problem,
    is_refused,
    project,
    sharp_weights,
    squares_with_one_more,
    squares_without_one,
    squares_without_two,
)
from trihedron.diagnosis.sets import EffectSet, smallest_sets


def random_problem(seed: int, rows: int = 40, effects: int = 7) -> Problem:
    rng = np.random.default_rng(seed)
    sizes = rng.integers(1, 3, effects)
    ends = np.cumsum(sizes)
    blocks = tuple(slice(int(e - s), int(e)) for s, e in zip(sizes, ends, strict=True))
    residual = rng.uniform(-1.0, 1.0, rows)
    return Problem(residual, rng.normal(size=(rows, 5)), rng.normal(size=(rows, int(ends[-1]))), blocks)


def exact_radius(problem: Problem, candidate: EffectSet) -> float:
    kept = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    matrix = np.hstack((problem.nominal, problem.columns[:, problem.columns_of(candidate.effects)]))
    return chebyshev_radius(matrix[kept], problem.residual[kept], np.ones(len(kept)))[0]


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(0, 4))
def test_bounds_never_exceed_the_radius(seed, rounds):
    problem = random_problem(seed)
    weights = sharp_weights(problem, np.full(40, 1 / 40), (), rounds)
    base = project(problem, weights)
    assert base.square <= exact_radius(problem, EffectSet(())) ** 2 * (1 + 1e-9)
    for other, bound in enumerate(squares_with_one_more(base, problem, range(7))):
        assert bound <= exact_radius(problem, EffectSet((other,))) ** 2 * (1 + 1e-9)
    single = project(problem, weights, (2,))
    for other, bound in zip(range(3, 7), squares_with_one_more(single, problem, range(3, 7)), strict=True):
        assert bound <= exact_radius(problem, EffectSet((2, other))) ** 2 * (1 + 1e-9)
    without = squares_without_one(single)
    for row in (0, 17, 39):
        assert without[row] <= exact_radius(problem, EffectSet((2,), (row,))) ** 2 * (1 + 1e-9)
    pairs = squares_without_two(single)
    for rows in ((0, 1), (5, 30)):
        assert pairs[rows] <= exact_radius(problem, EffectSet((2,), rows)) ** 2 * (1 + 1e-9)


def test_lawsons_algorithm_makes_the_bound_sharp():
    small = random_problem(3)
    problem = Problem(3.0 * small.residual, small.nominal, small.columns, small.blocks)
    exact = exact_radius(problem, EffectSet((1,)))
    weights = sharp_weights(problem, np.full(40, 1 / 40), (1,), 60)
    assert project(problem, weights, (1,)).square == pytest.approx(exact**2, rel=0.05)
    start = np.full(40, 1 / 40)
    assert is_refused(problem, start, (1,), (), (0.9 * exact) ** 2)
    assert not is_refused(problem, start, (1,), (), (1.001 * exact) ** 2)


@pytest.mark.parametrize("seed", range(12))
def test_the_search_finds_exactly_the_smallest_sets(seed):
    """Against exhaustive search by linear programmes over every set of up to three."""
    rng = np.random.default_rng(seed)
    problem = random_problem(seed, rows=24, effects=5)
    true = EffectSet(
        tuple(sorted(rng.choice(5, size=rng.integers(0, 2), replace=False).tolist())),
        tuple(sorted(rng.choice(24, size=rng.integers(1, 3), replace=False).tolist())),
    )
    residual = 0.6 * problem.residual
    for index in problem.columns_of(true.effects):
        residual = residual + 4.0 * problem.columns[:, index]
    for row in true.outliers:
        residual[row] += 30.0
    problem = Problem(residual, problem.nominal, problem.columns, problem.blocks)

    def judged(candidate: EffectSet) -> bool:
        return exact_radius(problem, candidate) <= 1.0

    assert not judged(EffectSet(()))
    expected: list[EffectSet] = []
    for size in (1, 2, 3):
        for out in range(min(size, 2) + 1):
            for effects in combinations(range(5), size - out):
                for outliers in combinations(range(24), out):
                    candidate = EffectSet(effects, outliers)
                    if judged(candidate):
                        expected.append(candidate)
        if expected:
            break
    assert smallest_sets(problem, 0.0, judged) == sorted(expected)
