"""Sets of effects and outliers that a linear fit allows, with proof that it refuses all others.

The proofs are lower bounds of the Chebyshev radius by weighted least squares.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². The columns that
are always there are projected out once. The minimum then costs a few small numbers for each set of further columns, so
a hundred thousand sets take seconds. Lawson's algorithm (weights grow where residuals are large) makes the bound sharp.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from .programmes import SolverError, any_centre, column_space
from .set_bounds import ACCEPTED, REFUSED, UNDECIDED, bounds_of, settle, surviving_sets
from .work import Work

MAX_SET = 3
MOST_OUTLIERS = 2
MANY_CANDIDATES, SOME_ROWS = 2000, 300
"""Number of candidates from which they are first judged by part of the rows, and number of these rows: a refusal by
some rows is a refusal by all."""
FEW = 32
"""Number of sets below which their own bounds cost less than another projection."""
ROUNDS_AT_FIRST = (2, 6, 12)
"""Rounds of Lawson's algorithm for the nominal model, one after the other: every set is tried with their weights."""


@dataclass(frozen=True)
class Problem:
    """A linear fit in units of the bounds, with the columns of candidate effects.

    `residual` (M,); `nominal` (M, P): permanent columns; `columns` (M, C): those of all candidates; `blocks`: the
    columns of each candidate. A set has at most one of the last `alike` candidates: they are one effect at different
    times.
    """

    residual: NDArray
    nominal: NDArray
    columns: NDArray
    blocks: tuple[slice, ...]
    alike: int = 0

    @staticmethod
    def of(residual: NDArray, nominal: NDArray, columns: Iterable[NDArray], alike: int = 0) -> "Problem":
        """Return the problem with the columns (M, k) of each candidate, which are taken one after the other."""
        blocks, stop, rows = [], 0, np.empty((0, len(residual)))
        for of_candidate in columns:
            start, stop = stop, stop + of_candidate.shape[1]
            if stop > len(rows):
                # It grows in its place: two of them might not find room.
                rows.resize((max(stop, len(rows) + len(rows) // 8), len(residual)), refcheck=False)
            rows[start:stop] = of_candidate.T
            blocks.append(slice(start, stop))
        rows.resize((stop, len(residual)), refcheck=False)
        return Problem(residual, nominal, rows.T, tuple(blocks), alike)

    @cached_property
    def layout(self) -> tuple[NDArray, NDArray]:
        """First columns (n,) of the candidates, and their numbers of columns (n,)."""
        starts, sizes = np.zeros((2, len(self.blocks)), dtype=np.int64)
        for k, block in enumerate(self.blocks):
            starts[k], sizes[k] = block.start, block.stop - block.start
        return starts, sizes

    def choices(self, size: int) -> NDArray[np.int64]:
        """Return every choice (n, 3) of this number of candidates that may be in one set; -1 is an empty place."""
        apart = len(self.blocks) - self.alike
        every = _combinations(apart, size)
        if self.alike and size:
            fewer = _combinations(apart, size - 1)
            with_alike = np.repeat(fewer, self.alike, axis=0)
            with_alike[:, size - 1] = np.tile(np.arange(apart, len(self.blocks)), len(fewer))
            every = np.concatenate((every, with_alike))
        return every

    def with_some(self, some: Sequence[int], step: int = 1) -> "Problem":
        """Return the problem with some of the candidates (indices, in order), and every `step`-th row."""
        columns = [self.columns[::step, self.blocks[k]] for k in some]
        apart = len(self.blocks) - self.alike
        alike = int(np.count_nonzero(np.asarray(some) >= apart))
        return Problem.of(self.residual[::step].copy(), self.nominal[::step], columns, alike)

    def of_some_rows(self) -> tuple["Problem", list[list[int]]]:
        """Return a problem of rows spread evenly, with one candidate for all that are the same in them, and their
        indices.

        A set that these rows refuse is refused; a set that stands in all rows is in a set of at least its size here.
        """
        step = max(1, len(self.residual) // SOME_ROWS)
        # Rows may be of three channels in turn.
        step += step % 3 == 0
        groups: list[list[int]] = [[k] for k in range(self.beside_others)]
        same: dict[bytes, list[int]] = {}
        for k in range(len(groups), len(self.blocks)):
            key = self.columns[::step, self.blocks[k]].tobytes()
            if key not in same:
                same[key] = []
                groups.append(same[key])
            same[key].append(k)
        return self.with_some([group[0] for group in groups], step), groups

    @property
    def beside_others(self) -> int:
        """Number of first candidates that are not alike if others are; 0 if none are."""
        if not self.alike:
            return 0
        return len(self.blocks) - self.alike

    @property
    def size_of_projection(self) -> float:
        """The work of one projection."""
        rows, columns = self.columns.shape
        return 200.0 + 2e-2 * rows * columns

    @property
    def without_candidates(self) -> "Problem":
        """Return the problem without any candidate, as for sets of outliers alone."""
        return Problem.of(self.residual, self.nominal, ())

    @property
    def together(self) -> int:
        """Number of first columns whose candidates may be in a set with others."""
        if not self.alike:
            return self.columns.shape[1]
        return int(self.blocks[-self.alike].start)

    @cached_property
    def system(self) -> tuple[NDArray, NDArray, int, NDArray, NDArray]:
        """The problem for compiled code: all columns (M, P + C), nominal ones first, and the places of the others."""
        matrix = np.ascontiguousarray(np.hstack((self.nominal, self.columns)))
        return matrix, self.residual, self.nominal.shape[1], *self.layout


@dataclass(frozen=True)
class Projection:
    """A problem under weights (M,), with the nominal columns projected out.

    `basis` (p, M) is orthonormal, of the weighted nominal columns; `residual` (M,) and `columns` (C, M), of all
    candidates, are weighted and projected. `gram` (C, A) holds the products with the A columns of candidates that may
    be in a set with others; `own` (C, K) those with the columns of the same candidate; `product` (C,) those with the
    residual.
    """

    weights: NDArray
    basis: NDArray
    residual: NDArray
    columns: NDArray
    gram: NDArray
    own: NDArray
    product: NDArray


def project(problem: Problem, weights: NDArray, together: bool = True) -> Projection:
    """Weight the rows by nonnegative weights (M,), and project out the nominal columns.

    `together`: for sets of several candidates, else for candidates one at a time.
    """
    root = np.sqrt(weights)
    basis, residual = without_nominal(problem, root)
    basis = np.ascontiguousarray(basis.T)
    columns = np.multiply(problem.columns.T, root, order="C")
    before = np.einsum("cm,cm->c", columns, columns)
    columns -= (columns @ basis.T) @ basis
    after = np.einsum("cm,cm->c", columns, columns)
    columns[after < 1e-14 * before] = 0.0
    after[after < 1e-14 * before] = 0.0
    width = 0
    if together:
        width = problem.together
    gram, squares = columns @ columns[:width].T, _own_products(columns, after, problem)
    return Projection(weights, basis, residual, columns, gram, squares, columns @ residual)


def _own_products(columns: NDArray, squares: NDArray, problem: Problem) -> Floats:
    """Return the products (C, K) of columns (C, M) with known squares (C,) with those of the same candidate."""
    starts, sizes = problem.layout
    products = np.zeros((len(columns), sizes.max(initial=0)))
    for width in np.unique(sizes):
        places = starts[sizes == width, None] + np.arange(width)
        if width == 1:
            products[places[:, 0], 0] = squares[places[:, 0]]
        elif width > 1:
            of_each = columns[places]
            products[places, :width] = of_each @ of_each.transpose(0, 2, 1)
    return products


def without_nominal(problem: Problem, root: NDArray) -> tuple[NDArray, NDArray]:
    """Return a basis (M, p) of the nominal columns and the residual (M,) without them, rows multiplied by `root`
    (M,)."""
    basis = np.ascontiguousarray(column_space(root[:, None] * problem.nominal))
    residual = root * problem.residual
    return basis, residual - basis @ (basis.T @ residual)


def sharpened(weights: NDArray, misfit: NDArray) -> NDArray:
    """Return Lawson's update: weights grow where the misfit is large; none vanishes permanently."""
    grown = weights * np.abs(misfit)
    total = grown.sum()
    if not total > 0.0:
        return weights
    return 0.99 * grown / total + 0.01 / len(weights)


def sharp_weights(problem: Problem, weights: NDArray, rounds: int) -> NDArray:
    """Return the weights after some rounds for the nominal model alone."""
    for _ in range(rounds):
        root = np.sqrt(np.maximum(weights, 1e-300))
        weights = sharpened(weights, without_nominal(problem, root)[1] / root)
    return weights


@dataclass(frozen=True, order=True)
class EffectSet:
    """Effects by their numbers among the candidates, and readings that are left out as outliers."""

    effects: tuple[int, ...]
    outliers: tuple[int, ...] = ()


def sets_of_size(
    problem: Problem, size: int, slack: float, most_outliers: int = MOST_OUTLIERS, work: Work | None = None
) -> Iterator[EffectSet]:
    """Yield all sets of a size that keep every residual of the linear model within its bound, to the slack.

    A set is refused if some weights prove that its radius is above one and the slack. The weights that refuse one set
    are tried on all others; a linear programme decides sets that no bound refuses. The most promising come
    approximately first.

    The problem is linear at the nominal model's fit. `size`, 0 to 3, counts effects and outliers together. `slack` is
    the largest error of the linearisation, in units of the bounds. At most `most_outliers`, 0 to 2, are outliers:
    enough of them explain anything. The cost is added to the work.
    """
    work = work or Work()
    if not size:
        problem = problem.without_candidates
    if len(problem.blocks) > MANY_CANDIDATES:
        some = standing_in_some_rows(problem, size, slack, most_outliers, work)
        for effect_set in _sets_of_size(problem.with_some(some), size, slack, most_outliers, work):
            yield EffectSet(tuple(some[k] for k in effect_set.effects), effect_set.outliers)
        return
    yield from _sets_of_size(problem, size, slack, most_outliers, work)


def _sets_of_size(problem: Problem, size: int, slack: float, most_outliers: int, work: Work) -> Iterator[EffectSet]:
    limit = (1.0 + slack) ** 2
    weights = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections: list[Projection] = []

    def projection(number: int) -> Projection:
        """Return a projection; the first ones are made at their first use: one alone may refuse all sets."""
        nonlocal weights
        for rounds in ROUNDS_AT_FIRST[len(projections) : number + 1]:
            weights = sharp_weights(problem, weights, rounds)
            projections.append(project(problem, weights, size > 1))
            work.add(problem.size_of_projection)
        return projections[number]

    for outliers in range(min(size, most_outliers) + 1):
        rows, choices = len(problem.residual), problem.choices(size - outliers)
        # Only a few pairs of left-out readings are examined.
        work.add(len(choices) * (0.3, 0.005 * rows, 0.04 * rows + 5e-5 * rows**2)[outliers])
        sets = surviving_sets(choices, outliers, limit, parts(problem, projection(0)))
        open_sets = OpenSets(sets, np.zeros(len(sets)), np.zeros(len(sets), dtype=int))
        for number in range(len(ROUNDS_AT_FIRST)):
            if len(open_sets):
                work.add(0.3 * len(open_sets))
                open_sets = open_sets.tried(problem, projection(number), number, limit)
        yield from decided(problem, projections, open_sets, slack, work, together=size > 1)


def standing_in_some_rows(problem: Problem, size: int, slack: float, most_outliers: int, work: Work) -> list[int]:
    """Return candidates (indices) that stand in any set by some of the rows, and all of those that are not alike."""
    fewer, groups = problem.of_some_rows()
    standing = set(range(problem.beside_others))
    for effect_set in _sets_of_size(fewer, size, slack, most_outliers, work):
        for effect in effect_set.effects:
            standing.update(groups[effect])
        if len(standing) == len(problem.blocks):
            break
    return sorted(standing)


@dataclass(frozen=True)
class OpenSets:
    """Sets (n, 5) that no projection has refused, their best squared bounds (n,), and the projections of these (n,)."""

    sets: NDArray
    bound: NDArray
    source: NDArray

    def __len__(self) -> int:
        return len(self.sets)

    def without(self, pick: int) -> "OpenSets":
        """Return all sets but one."""
        return OpenSets(np.delete(self.sets, pick, 0), np.delete(self.bound, pick), np.delete(self.source, pick))

    def tried(self, problem: Problem, projection: Projection, number: int, limit: float) -> "OpenSets":
        """Return the sets that one more projection does not refuse either."""
        bounds = bounds_of(self.sets, parts(problem, projection))
        source, bound = np.where(bounds > self.bound, number, self.source), np.maximum(bounds, self.bound)
        is_open = bound <= limit
        return OpenSets(self.sets[is_open], bound[is_open], source[is_open])


def decided(
    problem: Problem,
    projections: Sequence[Projection],
    open_sets: OpenSets,
    slack: float,
    work: Work,
    *,
    together: bool = True,
) -> Iterator[EffectSet]:
    """Decide the sets that no projection has refused; `together` as for `project`."""
    limit = (1.0 + slack) ** 2
    weights = [projection.weights for projection in projections]
    wait, pause = 0, 0
    while len(open_sets):
        pick = int(np.argmin(open_sets.bound))
        chosen = open_sets.sets[pick]
        work.add(50.0 + 2.0 * len(problem.residual) + 0.001 * len(open_sets))
        verdict, sharp = settle(problem.system, chosen, weights[open_sets.source[pick]], limit)
        open_sets = open_sets.without(pick)
        if verdict != REFUSED:
            effects, outliers = chosen[:3], chosen[3:]
            candidate = EffectSet(tuple(effects[effects >= 0].tolist()), tuple(outliers[outliers >= 0].tolist()))
            if verdict == UNDECIDED:
                work.programme(2 * len(problem.residual), problem.nominal.shape[1] + 3)
            if verdict == ACCEPTED or linear_radius(problem, candidate) <= 1.0 + slack:
                yield candidate
        elif wait > 0:
            wait -= 1
        elif len(open_sets) > FEW:
            before = len(open_sets)
            work.add(problem.size_of_projection + 0.3 * before)
            weights.append(sharp)
            open_sets = open_sets.tried(problem, project(problem, sharp, together), len(weights) - 1, limit)
            # Weights that refuse few others cost more than they save: leave more sets to themselves.
            pause = min(2 * pause + FEW, 1024)
            if before - len(open_sets) >= FEW:
                pause = 0
            wait = pause


def parts(problem: Problem, projection: Projection) -> tuple[NDArray, ...]:
    """Return a projection of a problem for compiled code."""
    p = projection
    return (p.weights, p.basis, p.residual, p.columns, p.gram, p.own, p.product, *problem.layout)


def linear_radius(problem: Problem, candidate: EffectSet) -> float:
    """Return the Chebyshev radius of a set by a linear programme; 0 if it is not solved, which refuses nothing."""
    rows = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    blocks = [problem.columns[:, problem.blocks[effect]] for effect in candidate.effects]
    columns = np.hstack([problem.nominal, *blocks])[rows]
    try:
        return any_centre(columns, problem.residual[rows], np.ones(len(rows)))[0]
    except SolverError:
        return 0.0


def _combinations(count: int, size: int) -> NDArray[np.int64]:
    """Return every choice (n, 3) of `size` of `count` candidates; -1 is an empty place."""
    every = np.array(list(combinations(range(count), size)), dtype=np.int64)
    sets = np.full((len(every), 3), -1)
    sets[:, :size] = every.reshape(len(every), size)
    return sets
