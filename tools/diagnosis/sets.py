"""Sets of effects and outliers that the linear model of a record allows, with proof that it refuses all others."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..calibration.programmes import chebyshev_radius
from .lawson import Problem, Projection, project, sharp_weights
from .set_bounds import bounds_of, surviving_sets
from .set_settling import ACCEPTED, REFUSED, settle

MAX_SET = 3
MOST_OUTLIERS = 2
FEW = 32
"""For so few sets their own bounds cost less than another projection."""
ROUNDS_AT_FIRST = (2, 6, 12)
"""Rounds of Lawson's algorithm for the nominal model, one after the other: every set is tried with their weights."""


@dataclass(frozen=True, order=True)
class EffectSet:
    """Effects by their numbers among the candidates, and readings that are left out as outliers."""

    effects: tuple[int, ...]
    outliers: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.effects) + len(self.outliers)


def sets_of_size(problem: Problem, size: int, slack: float) -> Iterator[EffectSet]:
    """All sets of a size that keep every residual of the linear model within its bound, to the slack.

    A set is refused when some weights prove that its radius is above one and the slack; the weights that refuse one set
    are tried on all others, and what no bound refuses is decided by a linear programme.

    Parameters
    ----------
    problem : Problem
        the nominal model and the candidates, linear at its fit
    size : int
        effects and outliers together, 0 to 3; at most two outliers
    slack : float
        what the linearisation may be wrong by, in units of the bounds

    Yields
    ------
    EffectSet
        about the most promising first
    """
    limit = (1.0 + slack) ** 2
    weights = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections = []
    for rounds in ROUNDS_AT_FIRST:
        weights = sharp_weights(problem, weights, rounds)
        projections.append(project(problem, weights))
    starts, sizes = problem.starts, problem.sizes
    for outliers in range(min(size, MOST_OUTLIERS) + 1):
        if size - outliers > len(problem.blocks):
            continue
        sets = surviving_sets(size - outliers, outliers, limit, *parts(projections[0]), starts, sizes)
        bound, source = np.zeros(len(sets)), np.zeros(len(sets), dtype=int)
        for number, projection in enumerate(projections):
            sets, bound, source = tried(problem, projection, number, sets, bound, source, limit)
        yield from settled(problem, projections, sets, bound, source, slack)


def settled(
    problem: Problem, projections: list[Projection], sets: NDArray, bound: NDArray, source: NDArray, slack: float
) -> Iterator[EffectSet]:
    """Decide the sets (n, 5) that no projection has refused; `source` is the projection of each one's best bound."""
    limit = (1.0 + slack) ** 2
    starts, sizes = problem.starts, problem.sizes
    weights = [projection.weights for projection in projections]
    wait, pause = 0, 0
    while len(sets):
        pick = int(np.argmin(bound))
        chosen = sets[pick]
        verdict, sharp = settle(
            problem.matrix,
            problem.residual,
            problem.nominal.shape[1],
            starts,
            sizes,
            chosen,
            weights[source[pick]],
            limit,
        )
        sets, bound, source = np.delete(sets, pick, 0), np.delete(bound, pick), np.delete(source, pick)
        if verdict != REFUSED:
            candidate = EffectSet(
                tuple(int(i) for i in chosen[:3] if i >= 0), tuple(int(i) for i in chosen[3:] if i >= 0)
            )
            if verdict == ACCEPTED or linear_radius(problem, candidate) <= 1.0 + slack:
                yield candidate
        elif wait > 0:
            wait -= 1
        elif len(sets) > FEW:
            before = len(sets)
            weights.append(sharp)
            sets, bound, source = tried(problem, project(problem, sharp), len(weights) - 1, sets, bound, source, limit)
            # Weights that refuse few others cost more than they save: leave more sets to themselves.
            pause = 0 if before - len(sets) >= FEW else min(2 * pause + FEW, 1024)
            wait = pause


def tried(
    problem: Problem,
    projection: Projection,
    number: int,
    sets: NDArray,
    bound: NDArray,
    source: NDArray,
    limit: float,
) -> tuple[NDArray, NDArray, NDArray]:
    """The sets that one more projection does not refuse, with their best bounds and where these are from."""
    found = bounds_of(sets, *parts(projection), problem.starts, problem.sizes)
    source = np.where(found > bound, number, source)
    bound = np.maximum(found, bound)
    kept = bound <= limit
    return sets[kept], bound[kept], source[kept]


def parts(projection: Projection) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray, NDArray]:
    """A projection as compiled code takes it."""
    return (
        projection.weights,
        projection.basis,
        projection.residual,
        projection.columns,
        projection.gram,
        projection.product,
    )


def linear_radius(problem: Problem, candidate: EffectSet) -> float:
    """Chebyshev radius that a set leaves, by a linear programme."""
    kept = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    columns = np.hstack((problem.nominal, problem.columns[:, problem.columns_of(candidate.effects)]))[kept]
    return chebyshev_radius(columns, problem.residual[kept], np.ones(len(kept)))[0]
