"""Sets of effects and outliers that a linear fit allows, with proof that it refuses all others.

The proofs are lower bounds of the Chebyshev radius by weighted least squares.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². With the
columns that are always there projected out once, that minimum costs a few small numbers for each set of further
columns: this is what settles a hundred thousand sets in seconds. Lawson's algorithm (weights grow where residuals are
large) makes the bound sharp.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from .compiled_bounds import ACCEPTED, REFUSED, bounds_of, settle, surviving_sets
from .programmes import chebyshev_radius

DETERMINED = 1e-8
"""Directions whose singular value is below this part of the largest are not determined."""
SAME_SPACE = 1e-7
"""Largest sine of an angle between two spaces that are called the same."""
IMITATED = 1e-7
"""Columns of which so little is left, relatively, are imitated."""
DEPENDENT = 1e-9
"""A direction of columns, each of size one, that is so small is none."""
MAX_SET = 3
MOST_OUTLIERS = 2
FEW = 32
"""For so few sets their own bounds cost less than another projection."""
ROUNDS_AT_FIRST = (2, 6, 12)
"""Rounds of Lawson's algorithm for the nominal model, one after the other: every set is tried with their weights."""


def least_squares(matrix: NDArray, target: NDArray) -> NDArray[np.float64]:
    """The x (n,) of least sum of squares of target (M,) - matrix (M, n) x; what is not determined stays at zero.

    The units of the matrix's columns do not matter.
    """
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    u, values, directions = np.linalg.svd(matrix / size, full_matrices=False)
    kept = values > DETERMINED * values.max(initial=0.0)
    return (directions[kept].T @ ((u[:, kept].T @ target) / values[kept])) / size


def column_space(columns: NDArray) -> NDArray[np.float64]:
    """Orthonormal basis of the space that columns span; their units do not matter."""
    size = np.linalg.norm(columns, axis=0)
    u, values, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return u[:, values > DEPENDENT * values.max(initial=0.0)] if values.max(initial=0.0) > 0.0 else u[:, :0]


def spaces_beyond(imitated: NDArray, blocks: Sequence[NDArray]) -> list[NDArray[np.float64]]:
    """What blocks of columns (M, k) add to the space of other columns (M, P), as orthonormal columns."""
    base = column_space(imitated)
    spaces = []
    for block in blocks:
        left = block - base @ (base.T @ block)
        left[:, np.linalg.norm(left, axis=0) < IMITATED * np.linalg.norm(block, axis=0)] = 0.0
        spaces.append(column_space(left))
    return spaces


def same_space(a: NDArray, b: NDArray) -> bool:
    """Whether two orthonormal bases span the same space."""
    return a.shape == b.shape and float(np.linalg.norm(a - b @ (b.T @ a), 2)) < SAME_SPACE


def cosine(a: NDArray, b: NDArray) -> float:
    """Cosine of the least angle between the spaces of two orthonormal bases; 0 where one is empty."""
    return min(1.0, float(np.linalg.norm(a.T @ b, 2))) if a.shape[1] and b.shape[1] else 0.0


def spread_directions(count: int, steps: int) -> list[NDArray[np.float64]]:
    """Unit vectors (count,) spread over all directions; of opposite ones one is enough."""
    if count == 1:
        return [np.ones(1)]
    if count == 2:
        angles = math.pi * np.arange(steps) / steps
        return [np.array([math.cos(angle), math.sin(angle)]) for angle in angles]
    vectors = np.random.default_rng(0).normal(size=(4 * steps, count))
    return list(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))


@dataclass(frozen=True)
class Problem:
    """A linear fit in units of the bounds, with the columns of candidate effects.

    `residual` (M,), `nominal` (M, P): columns that are always there; `columns` (M, C): of all candidates, `blocks`: the
    columns of each.
    """

    residual: NDArray
    nominal: NDArray
    columns: NDArray
    blocks: tuple[slice, ...]

    @staticmethod
    def of(residual: NDArray, nominal: NDArray, columns: Sequence[NDArray]) -> "Problem":
        """The problem with the columns (M, k) of each candidate."""
        ends = np.cumsum([0, *(block.shape[1] for block in columns)]).tolist()
        blocks = tuple(slice(start, stop) for start, stop in pairwise(ends))
        return Problem(residual, nominal, np.hstack([np.zeros((len(residual), 0)), *columns]), blocks)

    def columns_of(self, chosen: Sequence[int]) -> NDArray:
        """Numbers of the columns of some candidates."""
        parts = [np.arange(self.blocks[i].start, self.blocks[i].stop) for i in chosen]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=int)

    @property
    def starts(self) -> NDArray:
        """First columns (n,) of the candidates."""
        return np.array([block.start for block in self.blocks], dtype=np.int64)

    @property
    def sizes(self) -> NDArray:
        """Numbers of columns (n,) of the candidates."""
        return np.array([block.stop - block.start for block in self.blocks], dtype=np.int64)

    @cached_property
    def system(self) -> tuple[NDArray, NDArray, int, NDArray, NDArray]:
        """The problem as compiled code takes it: all columns (M, P + C), nominal ones first, where others are."""
        matrix = np.ascontiguousarray(np.hstack((self.nominal, self.columns)))
        return matrix, self.residual, self.nominal.shape[1], self.starts, self.sizes


@dataclass(frozen=True)
class Projection:
    """A problem under weights (M,), with the nominal columns projected out.

    `basis` (M, p) is orthonormal, of the weighted nominal columns; `residual` (M,) and `columns` (M, C), of all
    candidates, are weighted and projected; `gram` (C, C) and `product` (C,) are the columns' products with each other
    and with the residual.
    """

    weights: NDArray
    basis: NDArray
    residual: NDArray
    columns: NDArray
    gram: NDArray
    product: NDArray

    @property
    def square(self) -> float:
        """Squared bound of the nominal model alone."""
        return float(self.residual @ self.residual)


def project(problem: Problem, weights: NDArray) -> Projection:
    """Weigh the rows, by weights (M,) that are not negative, and project out the nominal columns."""
    root = np.sqrt(weights)
    basis, residual = without_nominal(problem, root)
    columns = root[:, None] * problem.columns
    before = np.linalg.norm(columns, axis=0)
    columns = columns - basis @ (basis.T @ columns)
    columns[:, np.linalg.norm(columns, axis=0) < 1e-7 * before] = 0.0
    return Projection(weights, basis, residual, columns, columns.T @ columns, columns.T @ residual)


def without_nominal(problem: Problem, root: NDArray) -> tuple[NDArray, NDArray]:
    """Basis (M, p) of the nominal columns and the residual (M,) without them, rows multiplied by `root` (M,)."""
    basis = np.ascontiguousarray(column_space(root[:, None] * problem.nominal))
    residual = root * problem.residual
    return basis, residual - basis @ (basis.T @ residual)


def sharpened(weights: NDArray, misfit: NDArray) -> NDArray:
    """Lawson's update: weights grow where the misfit is large; none vanishes for good."""
    grown = weights * np.abs(misfit)
    total = grown.sum()
    if not total > 0.0:
        return weights
    return 0.99 * grown / total + 0.01 / len(weights)


def sharp_weights(problem: Problem, weights: NDArray, rounds: int) -> NDArray:
    """Weights after some rounds for the nominal model alone."""
    for _ in range(rounds):
        root = np.sqrt(np.maximum(weights, 1e-300))
        weights = sharpened(weights, without_nominal(problem, root)[1] / root)
    return weights


@dataclass(frozen=True, order=True)
class EffectSet:
    """Effects by their numbers among the candidates, and readings that are left out as outliers."""

    effects: tuple[int, ...]
    outliers: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.effects) + len(self.outliers)


def sets_of_size(problem: Problem, size: int, slack: float, most_outliers: int = MOST_OUTLIERS) -> Iterator[EffectSet]:
    """All sets of a size that keep every residual of the linear model within its bound, to the slack.

    A set is refused when some weights prove that its radius is above one and the slack; the weights that refuse one set
    are tried on all others, and what no bound refuses is decided by a linear programme. About the most promising come
    first.

    The problem is linear at the nominal model's fit; its `size`, 0 to 3, counts effects and outliers together; `slack`
    is what the linearisation may be wrong by, in units of the bounds; of outliers, 0 to 2, enough explain anything.
    """
    limit = (1.0 + slack) ** 2
    weights = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections = []
    for rounds in ROUNDS_AT_FIRST:
        weights = sharp_weights(problem, weights, rounds)
        projections.append(project(problem, weights))
    for outliers in range(min(size, most_outliers) + 1):
        if size - outliers > len(problem.blocks):
            continue
        sets = surviving_sets(size - outliers, outliers, limit, parts(problem, projections[0]))
        open_sets = OpenSets(sets, np.zeros(len(sets)), np.zeros(len(sets), dtype=int))
        for number, projection in enumerate(projections):
            open_sets = open_sets.tried(problem, projection, number, limit)
        yield from settled(problem, projections, open_sets, slack)


@dataclass(frozen=True)
class OpenSets:
    """Sets (n, 5) that no projection has refused, their best squared bounds (n,), and the projections of these (n,)."""

    sets: NDArray
    bound: NDArray
    source: NDArray

    def __len__(self) -> int:
        return len(self.sets)

    def without(self, pick: int) -> "OpenSets":
        """All but one."""
        return OpenSets(np.delete(self.sets, pick, 0), np.delete(self.bound, pick), np.delete(self.source, pick))

    def tried(self, problem: Problem, projection: Projection, number: int, limit: float) -> "OpenSets":
        """Those that one more projection does not refuse, either."""
        found = bounds_of(self.sets, parts(problem, projection))
        source, bound = np.where(found > self.bound, number, self.source), np.maximum(found, self.bound)
        kept = bound <= limit
        return OpenSets(self.sets[kept], bound[kept], source[kept])


def settled(problem: Problem, projections: Sequence[Projection], left: OpenSets, slack: float) -> Iterator[EffectSet]:
    """Decide the sets that no projection has refused."""
    limit = (1.0 + slack) ** 2
    weights = [projection.weights for projection in projections]
    wait, pause = 0, 0
    while len(left):
        pick = int(np.argmin(left.bound))
        chosen = left.sets[pick]
        verdict, sharp = settle(problem.system, chosen, weights[left.source[pick]], limit)
        left = left.without(pick)
        if verdict != REFUSED:
            candidate = EffectSet(
                tuple(int(i) for i in chosen[:3] if i >= 0), tuple(int(i) for i in chosen[3:] if i >= 0)
            )
            if verdict == ACCEPTED or linear_radius(problem, candidate) <= 1.0 + slack:
                yield candidate
        elif wait > 0:
            wait -= 1
        elif len(left) > FEW:
            before = len(left)
            weights.append(sharp)
            left = left.tried(problem, project(problem, sharp), len(weights) - 1, limit)
            # Weights that refuse few others cost more than they save: leave more sets to themselves.
            pause = 0 if before - len(left) >= FEW else min(2 * pause + FEW, 1024)
            wait = pause


def parts(problem: Problem, projection: Projection) -> tuple[NDArray, ...]:
    """A projection of a problem as compiled code takes it."""
    p = projection
    return (p.weights, p.basis, p.residual, p.columns, p.gram, p.product, problem.starts, problem.sizes)


def linear_radius(problem: Problem, candidate: EffectSet) -> float:
    """Chebyshev radius that a set leaves, by a linear programme."""
    kept = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    columns = np.hstack((problem.nominal, problem.columns[:, problem.columns_of(candidate.effects)]))[kept]
    return chebyshev_radius(columns, problem.residual[kept], np.ones(len(kept)))[0]
