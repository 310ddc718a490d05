"""The smallest sets of effects that make a record consistent, proven smallest."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from trihedron.diagnosis.lawson import (
    Problem,
    Projection,
    is_refused,
    project,
    sharp_weights,
    sharpened,
    squares_with_one_more,
    squares_without_one,
    squares_without_two,
)

MAX_SET = 3


@dataclass(frozen=True, order=True)
class EffectSet:
    """Effects by their numbers among the candidates, and readings that are left out as outliers."""

    effects: tuple[int, ...]
    outliers: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.effects) + len(self.outliers)


Judge = Callable[[EffectSet], bool]
Track = Callable[[Sequence[int]], Iterable[int]]


def smallest_sets(
    problem: Problem, slack: float, judge: Judge, most: int = MAX_SET, track: Track = iter
) -> list[EffectSet]:
    """All sets of the smallest size that the judge accepts; at most two outliers in each.

    A set is refused when a lower bound of its radius is above one and the slack; what no bound refuses is judged
    exactly. So no smaller set, and no other set of that size, makes the record consistent.

    Parameters
    ----------
    problem : Problem
        the nominal model and the candidates, linear at its fit
    slack : float
        what the linearisation may be wrong by, in units of the bounds
    judge : callable
        set -> whether the exact model with it keeps every residual within its bound
    most : int
        largest size that is tried
    track : callable
        wraps the longest loop, for a progress bar

    Returns
    -------
    list of EffectSet
        sorted; empty when no set of up to `most` will do
    """
    limit = (1.0 + slack) ** 2
    count = len(problem.blocks)
    uniform = np.full(len(problem.residual), 1.0 / len(problem.residual))
    base = project(problem, sharp_weights(problem, uniform, (), 3))

    def settle(found: Iterable[tuple[EffectSet, NDArray]]) -> list[EffectSet]:
        return sorted(
            candidate
            for candidate, weights in found
            if not is_refused(problem, weights, candidate.effects, candidate.outliers, limit) and judge(candidate)
        )

    def settle_all(sets: Iterable[EffectSet], weights: NDArray) -> list[EffectSet]:
        return settle((candidate, weights) for candidate in sets)

    ones = settle_all([*grown(base, problem, (), limit), *one_out(base, (), limit)], base.weights)
    if ones or most < 2:
        return ones
    singles = [project(problem, sharp_weights(problem, base.weights, (i,), 4), (i,)) for i in track(range(count))]
    twos = settle_all(two_out(base, (), limit), base.weights)
    for i, single in enumerate(singles):
        twos += settle_all([*grown(single, problem, (i,), limit), *one_out(single, (i,), limit)], single.weights)
    if twos or most < 3:
        return sorted(twos)
    threes: list[EffectSet] = []
    for i in track(range(count)):
        single = singles[i]
        threes += settle_all(two_out(single, (i,), limit), single.weights)
        for j in range(i + 1, count):
            pair = project(problem, pair_weights(problem, single, (i, j)), (i, j))
            sets = [*grown(pair, problem, (i, j), limit), *one_out(pair, (i, j), limit)]
            threes += settle_all(sets, pair.weights)
    return sorted(threes)


def pair_weights(problem: Problem, single: Projection, pair: tuple[int, int]) -> NDArray:
    """Weights for two effects, from those of the first: one round of Lawson's algorithm."""
    columns = single.columns[:, problem.columns_of(pair[1:])]
    solution = np.linalg.lstsq(columns, single.residual, rcond=1e-9)[0]
    misfit = (single.residual - columns @ solution) / np.sqrt(np.maximum(single.weights, 1e-300))
    return sharpened(single.weights, misfit)


def grown(projection: Projection, problem: Problem, chosen: tuple[int, ...], limit: float) -> list[EffectSet]:
    """Sets that add a later effect and are not refused by the bound."""
    first = chosen[-1] + 1 if chosen else 0
    others = range(first, len(problem.blocks))
    if not others:
        return []
    bounds = squares_with_one_more(projection, problem, others)
    return [EffectSet((*chosen, other)) for other, bound in zip(others, bounds, strict=True) if bound <= limit]


def one_out(projection: Projection, chosen: tuple[int, ...], limit: float) -> list[EffectSet]:
    """Sets that leave out one reading and are not refused by the bound."""
    bounds = squares_without_one(projection)
    return [EffectSet(chosen, (int(i),)) for i in np.flatnonzero(bounds <= limit)]


def two_out(projection: Projection, chosen: tuple[int, ...], limit: float) -> list[EffectSet]:
    """Sets that leave out two readings and are not refused by the bound."""
    first, second = np.nonzero(np.triu(squares_without_two(projection) <= limit, 1))
    return [EffectSet(chosen, (int(i), int(j))) for i, j in zip(first, second, strict=True)]
