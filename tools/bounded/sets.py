"""Sets of effects and outliers that a linear fit allows, with proof that it refuses all others.

The proofs are lower bounds of the Chebyshev radius by weighted least squares.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². With the
columns that are always there projected out once, that minimum costs a few small numbers for each set of further
columns: this is what settles a hundred thousand sets in seconds. Lawson's algorithm (weights grow where residuals are
large) makes the bound sharp.

A set is for compiled code a row of five whole numbers: up to three candidates, then up to two readings that are left
out; -1 stands for none. Deleting reading a of weight w_a, residual r and leverage h takes r²/(1 - h) off the weighted
sum of squares, and the others' weights then sum to 1 - w_a; two readings have a formula of order two.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled_and_kept
from .programmes import chebyshev_radius, column_space

MAX_SET = 3
MOST_OUTLIERS = 2
FEW = 32
"""For so few sets their own bounds cost less than another projection."""
ROUNDS_AT_FIRST = (2, 6, 12)
"""Rounds of Lawson's algorithm for the nominal model, one after the other: every set is tried with their weights."""
WIDTH = 5
MOST_COLUMNS = 32
"""An effect has at most nine columns, a set at most three effects."""
REFUSED, ACCEPTED, UNDECIDED = 0, 1, 2
ROUNDS = 30
"""Rounds before a set is handed to a linear programme."""


class CutOff(Exception):
    """A search has done as much work as it may."""


class Work:
    """What a search has done and may do, in units of about a microsecond of one processor.

    It is counted by the sizes of what is solved, not by a clock: the same search ends at the same set everywhere.
    """

    def __init__(self, limit: float = np.inf) -> None:
        self.limit, self.done = limit, 0.0

    def add(self, amount: float) -> None:
        """Count so much more; CutOff where it is too much."""
        self.done += amount
        if self.done > self.limit:
            raise CutOff

    def programme(self, rows: int, columns: int) -> None:
        """Count a linear programme, its model included."""
        self.add(1000.0 + 1.2 * rows * columns)


@dataclass(frozen=True)
class Problem:
    """A linear fit in units of the bounds, with the columns of candidate effects.

    `residual` (M,), `nominal` (M, P): columns that are always there; `columns` (M, C): of all candidates, `blocks`: the
    columns of each. Of the last `alike` candidates a set has one at most: they are one effect at different times.
    """

    residual: NDArray
    nominal: NDArray
    columns: NDArray
    blocks: tuple[slice, ...]
    alike: int = 0

    @staticmethod
    def of(residual: NDArray, nominal: NDArray, columns: Sequence[NDArray], alike: int = 0) -> "Problem":
        """The problem with the columns (M, k) of each candidate."""
        ends = np.cumsum([0, *(block.shape[1] for block in columns)]).tolist()
        blocks = tuple(slice(start, stop) for start, stop in pairwise(ends))
        return Problem(residual, nominal, np.hstack([np.zeros((len(residual), 0)), *columns]), blocks, alike)

    @cached_property
    def layout(self) -> tuple[NDArray, NDArray]:
        """First columns (n,) of the candidates, and their numbers of columns (n,)."""
        ends = np.array([(block.start, block.stop) for block in self.blocks], dtype=np.int64).reshape(-1, 2)
        return ends[:, 0].copy(), ends[:, 1] - ends[:, 0]

    def choices(self, size: int) -> NDArray[np.int64]:
        """Every choice (n, 3) of so many candidates that may be in one set; -1 stands for none."""
        apart = len(self.blocks) - self.alike
        every = _combinations(apart, size)
        if self.alike and size:
            fewer = _combinations(apart, size - 1)
            more = np.repeat(fewer, self.alike, axis=0)
            more[:, size - 1] = np.tile(np.arange(apart, len(self.blocks)), len(fewer))
            every = np.concatenate((every, more))
        return every

    @property
    def size_of_projection(self) -> float:
        """The work of one projection."""
        rows, columns = self.columns.shape
        return 200.0 + 2e-2 * rows * columns

    @cached_property
    def system(self) -> tuple[NDArray, NDArray, int, NDArray, NDArray]:
        """The problem as compiled code takes it: all columns (M, P + C), nominal ones first, where others are."""
        matrix = np.ascontiguousarray(np.hstack((self.nominal, self.columns)))
        return matrix, self.residual, self.nominal.shape[1], *self.layout


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


def sets_of_size(
    problem: Problem, size: int, slack: float, most_outliers: int = MOST_OUTLIERS, work: Work | None = None
) -> Iterator[EffectSet]:
    """All sets of a size that keep every residual of the linear model within its bound, to the slack.

    A set is refused when some weights prove that its radius is above one and the slack; the weights that refuse one set
    are tried on all others, and what no bound refuses is decided by a linear programme. About the most promising come
    first.

    The problem is linear at the nominal model's fit; its `size`, 0 to 3, counts effects and outliers together; `slack`
    is what the linearisation may be wrong by, in units of the bounds; of outliers, 0 to 2, enough explain anything.
    What it costs is added to the work.
    """
    limit, work = (1.0 + slack) ** 2, work or Work()
    weights = np.full(len(problem.residual), 1.0 / len(problem.residual))
    projections = []
    for rounds in ROUNDS_AT_FIRST:
        weights = sharp_weights(problem, weights, rounds)
        projections.append(project(problem, weights))
        work.add(problem.size_of_projection)
    for outliers in range(min(size, most_outliers) + 1):
        rows, choices = len(problem.residual), problem.choices(size - outliers)
        work.add(len(choices) * (1.0, 0.1 * rows, 0.1 * rows + 0.002 * rows**2)[outliers])
        sets = surviving_sets(choices, outliers, limit, parts(problem, projections[0]))
        open_sets = OpenSets(sets, np.zeros(len(sets)), np.zeros(len(sets), dtype=int))
        for number, projection in enumerate(projections):
            work.add(0.3 * len(open_sets))
            open_sets = open_sets.tried(problem, projection, number, limit)
        yield from settled(problem, projections, open_sets, slack, work)


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


def settled(
    problem: Problem, projections: Sequence[Projection], left: OpenSets, slack: float, work: Work
) -> Iterator[EffectSet]:
    """Decide the sets that no projection has refused."""
    limit = (1.0 + slack) ** 2
    weights = [projection.weights for projection in projections]
    wait, pause = 0, 0
    while len(left):
        pick = int(np.argmin(left.bound))
        chosen = left.sets[pick]
        work.add(50.0 + 2.0 * len(problem.residual) + 0.001 * len(left))
        verdict, sharp = settle(problem.system, chosen, weights[left.source[pick]], limit)
        left = left.without(pick)
        if verdict != REFUSED:
            candidate = EffectSet(
                tuple(int(i) for i in chosen[:3] if i >= 0), tuple(int(i) for i in chosen[3:] if i >= 0)
            )
            if verdict == UNDECIDED:
                work.programme(2 * len(problem.residual), problem.nominal.shape[1] + 3)
            if verdict == ACCEPTED or linear_radius(problem, candidate) <= 1.0 + slack:
                yield candidate
        elif wait > 0:
            wait -= 1
        elif len(left) > FEW:
            before = len(left)
            work.add(problem.size_of_projection + 0.3 * before)
            weights.append(sharp)
            left = left.tried(problem, project(problem, sharp), len(weights) - 1, limit)
            # Weights that refuse few others cost more than they save: leave more sets to themselves.
            pause = 0 if before - len(left) >= FEW else min(2 * pause + FEW, 1024)
            wait = pause


def parts(problem: Problem, projection: Projection) -> tuple[NDArray, ...]:
    """A projection of a problem as compiled code takes it."""
    p = projection
    return (p.weights, p.basis, p.residual, p.columns, p.gram, p.product, *problem.layout)


def linear_radius(problem: Problem, candidate: EffectSet) -> float:
    """Chebyshev radius that a set leaves, by a linear programme."""
    kept = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    own = [problem.columns[:, problem.blocks[effect]] for effect in candidate.effects]
    columns = np.hstack([problem.nominal, *own])[kept]
    return chebyshev_radius(columns, problem.residual[kept], np.ones(len(kept)))[0]


@compiled_and_kept
def _append(projection, candidate, factor, count):
    """Extend a Cholesky factor of so many columns by those of a candidate; dependent ones are passed over."""
    _, _, _, _, gram, product, starts, sizes = projection
    chosen, triangle, solved = factor
    first = starts[candidate]
    for column in range(first, first + sizes[candidate]):
        for m in range(count):
            value = gram[column, chosen[m]]
            for q in range(m):
                value -= triangle[count, q] * triangle[m, q]
            triangle[count, m] = value / triangle[m, m]
        pivot = gram[column, column]
        for q in range(count):
            pivot -= triangle[count, q] * triangle[count, q]
        if pivot > 1e-9 * gram[column, column] and pivot > 0.0:
            triangle[count, count] = np.sqrt(pivot)
            value = product[column]
            for q in range(count):
                value -= triangle[count, q] * solved[q]
            solved[count] = value / triangle[count, count]
            chosen[count] = column
            count += 1
    return count


@compiled_and_kept
def _of_effects(projection, total, candidates, factor):
    """How many columns candidates (3,) have in their factor, and their squared bound."""
    count = 0
    for candidate in candidates:
        if candidate >= 0:
            count = _append(projection, candidate, factor, count)
    square = total
    for q in range(count):
        square -= factor[2][q] * factor[2][q]
    return count, max(0.0, square)


@compiled_and_kept
def _reading(projection, row, factor, count, own):
    """Residual and leverage of a reading beside the chosen columns; `own` takes its row of these, made orthonormal."""
    _, basis, residual, columns, _, _, _, _ = projection
    chosen, triangle, solved = factor
    left, leverage = residual[row], np.sum(basis[row] * basis[row])
    for m in range(count):
        value = columns[row, chosen[m]]
        for q in range(m):
            value -= triangle[m, q] * own[q]
        own[m] = value / triangle[m, m]
        left -= own[m] * solved[m]
        leverage += own[m] * own[m]
    return left, leverage


@compiled_and_kept
def _product(basis, a, b, own, count):
    """Of the rows of two readings in the space of nominal and chosen columns."""
    product = 0.0
    for q in range(count):
        product += own[a, q] * own[b, q]
    for q in range(basis.shape[1]):
        product += basis[a, q] * basis[b, q]
    return product


@compiled_and_kept
def _without_one(square, residual, leverage, weight):
    left = 1.0 - leverage
    if left <= 1e-9 or weight >= 1.0 - 1e-9:
        return 0.0
    return max(0.0, square - residual * residual / left) / (1.0 - weight)


@compiled_and_kept
def _without_two(square, residuals, leverages, cross, weight):
    ra, rb = residuals
    left_a, left_b = 1.0 - leverages[0], 1.0 - leverages[1]
    determinant = left_a * left_b - cross * cross
    if determinant <= 1e-9 or weight >= 1.0 - 1e-9:
        return 0.0
    taken = (left_b * ra * ra + left_a * rb * rb + 2.0 * cross * ra * rb) / determinant
    return max(0.0, square - taken) / (1.0 - weight)


@compiled_and_kept
def bounds_of(sets, projection):
    """Squared bounds (n,) of sets (n, 5) under one projection.

    A projection is weights, basis, residual, columns, gram, product as `sets.Projection` has them, then the first
    column and the number of columns of each candidate.
    """
    weights, basis, residual = projection[0], projection[1], projection[2]
    factor, own, total = _room(residual)
    found = np.empty(len(sets))
    for n in range(len(sets)):
        count, square = _of_effects(projection, total, sets[n, :3], factor)
        a, b = sets[n, 3], sets[n, 4]
        if a >= 0:
            ra, ha = _reading(projection, a, factor, count, own[a])
            if b < 0:
                square = _without_one(square, ra, ha, weights[a])
            else:
                rb, hb = _reading(projection, b, factor, count, own[b])
                cross = _product(basis, a, b, own, count)
                square = _without_two(square, (ra, rb), (ha, hb), cross, weights[a] + weights[b])
        found[n] = square
    return found


@compiled_and_kept
def _room(residual):
    """A Cholesky factor of no columns, room for a row of each reading, and the residual's sum of squares."""
    factor = np.zeros(MOST_COLUMNS, np.int64), np.zeros((MOST_COLUMNS, MOST_COLUMNS)), np.zeros(MOST_COLUMNS)
    total = 0.0
    for value in residual:
        total += value * value
    return factor, np.zeros((len(residual), MOST_COLUMNS)), total


@compiled_and_kept
def _kept(survivors, count, numbers, a, b):
    if count == len(survivors):
        survivors = np.concatenate((survivors, np.empty_like(survivors)))
    survivors[count] = (numbers[0], numbers[1], numbers[2], a, b)
    return survivors


@compiled_and_kept
def _surviving(sets, outliers, limit, projection):
    """Of sets (n, 3) of candidates, each with every choice of so many outliers, those that are not refused."""
    weights, basis, residual = projection[0], projection[1], projection[2]
    factor, own, total = _room(residual)
    rows = len(residual)
    r, h = np.empty(rows), np.empty(rows)
    survivors, found = np.empty((1024, WIDTH), dtype=np.int64), 0
    for numbers in sets:
        count, square = _of_effects(projection, total, numbers, factor)
        if outliers == 0:
            if square <= limit:
                survivors = _kept(survivors, found, numbers, -1, -1)
                found += 1
            continue
        for m in range(rows):
            r[m], h[m] = _reading(projection, m, factor, count, own[m])
        for a in range(rows):
            if outliers == 1:
                if _without_one(square, r[a], h[a], weights[a]) <= limit:
                    survivors = _kept(survivors, found, numbers, a, -1)
                    found += 1
                continue
            for b in range(a + 1, rows):
                # The smallest eigenvalue of the formula's matrix is not below this.
                left = 1.0 - h[a] - h[b]
                weight = weights[a] + weights[b]
                if left > 1e-6 and square - (r[a] * r[a] + r[b] * r[b]) / left > limit * (1.0 - weight):
                    continue
                cross = _product(basis, a, b, own, count)
                if _without_two(square, (r[a], r[b]), (h[a], h[b]), cross, weight) <= limit:
                    survivors = _kept(survivors, found, numbers, a, b)
                    found += 1
    return survivors[:found]


def surviving_sets(choices, outliers, limit, projection):
    """All sets (n, 5) of choices (m, 3) and so many outliers whose squared bound under a projection is not above it."""
    return _surviving(choices, outliers, limit, projection)


def _combinations(count: int, size: int) -> NDArray[np.int64]:
    """Every choice (n, 3) of so many of a number of candidates; -1 stands for none."""
    every = np.array(list(combinations(range(count), size)), dtype=np.int64)
    sets = np.full((len(every), 3), -1)
    sets[:, :size] = every.reshape(len(every), -1)
    return sets


@compiled_and_kept
def settle(problem, chosen_set, weights, limit):
    """One set's (REFUSED, ACCEPTED or UNDECIDED, weights (M,) with which it ended).

    A problem is a matrix, the residual, the number of nominal columns, which come first, and the first column after
    these and the number of columns of each candidate; the chosen set is a row of five.
    """
    matrix, residual, always, starts, sizes = problem
    used = np.arange(always)
    w = weights.copy()
    for k in range(len(chosen_set)):
        if chosen_set[k] >= 0 and k < 3:
            first = always + starts[chosen_set[k]]
            used = np.append(used, np.arange(first, first + sizes[chosen_set[k]]))
        elif chosen_set[k] >= 0:
            w[chosen_set[k]] = 0.0
    w /= w.sum()
    columns, counted = matrix[:, used], w > 0.0
    x, correction = np.empty(len(used)), np.empty(len(used))
    for _ in range(ROUNDS):
        weighted = columns * w.reshape(-1, 1)
        normal = weighted.T @ columns
        _solve(normal, weighted.T @ residual, x)
        # Once more with what is left, so that the sum of squares is the least to rounding.
        _substitute(normal, weighted.T @ (residual - columns @ x), correction)
        x += correction
        misfit = np.abs(residual - columns @ x) * counted
        if np.sum(w * misfit * misfit) > limit:
            return REFUSED, w
        if misfit.max() <= 1.0:
            return ACCEPTED, w
        w = (0.99 * w * misfit / np.sum(w * misfit) + 0.01 / counted.sum()) * counted
    return UNDECIDED, w


@compiled_and_kept
def _solve(normal, right, x):
    """Cholesky's factor in place (lower triangle; a zero on the diagonal marks a dependent column) and the solution."""
    count = len(right)
    for p in range(count):
        pivot = normal[p, p]
        size = pivot
        for q in range(p):
            value = normal[p, q]
            for k in range(q):
                value -= normal[p, k] * normal[q, k]
            normal[p, q] = value / normal[q, q] if normal[q, q] > 0.0 else 0.0
            pivot -= normal[p, q] * normal[p, q]
        normal[p, p] = np.sqrt(pivot) if pivot > 1e-12 * size and pivot > 0.0 else 0.0
    _substitute(normal, right, x)


@compiled_and_kept
def _substitute(factor, right, x):
    count = len(right)
    for p in range(count):
        value = right[p]
        for q in range(p):
            value -= factor[p, q] * x[q]
        x[p] = value / factor[p, p] if factor[p, p] > 0.0 else 0.0
    for p in range(count - 1, -1, -1):
        value = x[p]
        for q in range(p + 1, count):
            value -= factor[q, p] * x[q]
        x[p] = value / factor[p, p] if factor[p, p] > 0.0 else 0.0
