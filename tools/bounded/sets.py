"""Sets of effects and outliers that a linear fit allows, with proof that it refuses all others.

The proofs are lower bounds of the Chebyshev radius by weighted least squares.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². With the
columns that are always there projected out once, that minimum costs a few small numbers for each set of further
columns: this is what settles a hundred thousand sets in seconds. Lawson's algorithm (weights grow where residuals are
large) makes the bound sharp.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .exchange import MOST_COLUMNS
from .programmes import MANY_ROWS, SolverError, any_centre, column_space
from .set_bounds import ACCEPTED, REFUSED, UNDECIDED, bounds_of, settle, surviving_sets

MAX_SET = 3
MOST_OUTLIERS = 2
MANY_CANDIDATES, SOME_ROWS = 2000, 300
"""So many candidates are first judged by about so many rows: what these refuse all refuse."""
FEW = 32
"""For so few sets their own bounds cost less than another projection."""
ROUNDS_AT_FIRST = (2, 6, 12)
"""Rounds of Lawson's algorithm for the nominal model, one after the other: every set is tried with their weights."""


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

    @property
    def is_done(self) -> bool:
        """Whether no more may be done."""
        return self.done > self.limit

    def programme(self, rows: int, columns: int) -> None:
        """Count a linear programme, its model included."""
        exchanged = rows > MANY_ROWS and columns < MOST_COLUMNS
        self.add(1000.0 + (0.2 if exchanged else 1.2) * rows * columns)


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
        blocks, stop = [], 0
        for of_candidate in columns:
            start, stop = stop, stop + of_candidate.shape[1]
            blocks.append(slice(start, stop))
        return Problem(residual, nominal, np.hstack([np.zeros((len(residual), 0)), *columns]), tuple(blocks), alike)

    @cached_property
    def layout(self) -> tuple[NDArray, NDArray]:
        """First columns (n,) of the candidates, and their numbers of columns (n,)."""
        starts, sizes = np.zeros((2, len(self.blocks)), dtype=np.int64)
        for k, block in enumerate(self.blocks):
            starts[k], sizes[k] = block.start, block.stop - block.start
        return starts, sizes

    def choices(self, size: int) -> NDArray[np.int64]:
        """Every choice (n, 3) of so many candidates that may be in one set; -1 stands for none."""
        apart = len(self.blocks) - self.alike
        every = _combinations(apart, size)
        if self.alike and size:
            fewer = _combinations(apart, size - 1)
            with_alike = np.repeat(fewer, self.alike, axis=0)
            with_alike[:, size - 1] = np.tile(np.arange(apart, len(self.blocks)), len(fewer))
            every = np.concatenate((every, with_alike))
        return every

    def with_some(self, some: Sequence[int], step: int = 1) -> "Problem":
        """Some of the candidates (indices, in order), and every so many-th row."""
        columns = [self.columns[::step, self.blocks[k]] for k in some]
        apart = len(self.blocks) - self.alike
        alike = int(np.count_nonzero(np.asarray(some) >= apart))
        return Problem.of(self.residual[::step].copy(), self.nominal[::step], columns, alike)

    def of_some_rows(self) -> tuple["Problem", list[list[int]]]:
        """Rows spread evenly, and of candidates that are the same in these one for all; which ones (indices) each is.

        A set that these rows refuse is refused; what stands in all rows is in a set of no fewer here.
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
        """How many candidates, the first ones, are not alike where others are; 0 where none are."""
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
        """The same without any candidate, as sets of outliers alone have it."""
        return Problem.of(self.residual, self.nominal, ())

    @property
    def together(self) -> int:
        """How many columns, the first ones, are of candidates beside which others may stand in a set."""
        if not self.alike:
            return self.columns.shape[1]
        return int(self.blocks[-self.alike].start)

    @cached_property
    def system(self) -> tuple[NDArray, NDArray, int, NDArray, NDArray]:
        """The problem as compiled code takes it: all columns (M, P + C), nominal ones first, where others are."""
        matrix = np.ascontiguousarray(np.hstack((self.nominal, self.columns)))
        return matrix, self.residual, self.nominal.shape[1], *self.layout


@dataclass(frozen=True)
class Projection:
    """A problem under weights (M,), with the nominal columns projected out.

    `basis` (p, M) is orthonormal, of the weighted nominal columns; `residual` (M,) and `columns` (C, M), of all
    candidates, are weighted and projected. Of the columns' products `gram` (C, A) holds those with the A columns of
    candidates beside which others may stand in a set, `own` (C, K) those with the columns of the same candidate, and
    `product` (C,) those with the residual.
    """

    weights: NDArray
    basis: NDArray
    residual: NDArray
    columns: NDArray
    gram: NDArray
    own: NDArray
    product: NDArray


def project(problem: Problem, weights: NDArray, together: bool = True) -> Projection:
    """Weigh the rows, by weights (M,) that are not negative, and project out the nominal columns.

    `together`: for sets in which several candidates stand together, else for candidates one at a time.
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


def _own_products(columns: NDArray, squares: NDArray, problem: Problem) -> NDArray[np.float64]:
    """The products (C, K) of columns (C, M), of which squares (C,) are known, with those of the same candidate."""
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
        """The first ones are made when they are needed: one alone may refuse all sets."""
        nonlocal weights
        for rounds in ROUNDS_AT_FIRST[len(projections) : number + 1]:
            weights = sharp_weights(problem, weights, rounds)
            projections.append(project(problem, weights, size > 1))
            work.add(problem.size_of_projection)
        return projections[number]

    for outliers in range(min(size, most_outliers) + 1):
        rows, choices = len(problem.residual), problem.choices(size - outliers)
        # Of two readings that are left out few pairs are looked at.
        work.add(len(choices) * (0.3, 0.005 * rows, 0.04 * rows + 5e-5 * rows**2)[outliers])
        sets = surviving_sets(choices, outliers, limit, parts(problem, projection(0)))
        open_sets = OpenSets(sets, np.zeros(len(sets)), np.zeros(len(sets), dtype=int))
        for number in range(len(ROUNDS_AT_FIRST)):
            if len(open_sets):
                work.add(0.3 * len(open_sets))
                open_sets = open_sets.tried(problem, projection(number), number, limit)
        yield from decided(problem, projections, open_sets, slack, work, together=size > 1)


def standing_in_some_rows(problem: Problem, size: int, slack: float, most_outliers: int, work: Work) -> list[int]:
    """Candidates (indices) that stand in any set by some of the rows, and all of those that are not alike."""
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
        """All but one."""
        return OpenSets(np.delete(self.sets, pick, 0), np.delete(self.bound, pick), np.delete(self.source, pick))

    def tried(self, problem: Problem, projection: Projection, number: int, limit: float) -> "OpenSets":
        """Those that one more projection does not refuse, either."""
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
    """A projection of a problem as compiled code takes it."""
    p = projection
    return (p.weights, p.basis, p.residual, p.columns, p.gram, p.own, p.product, *problem.layout)


def linear_radius(problem: Problem, candidate: EffectSet) -> float:
    """Chebyshev radius that a set leaves, by a linear programme; 0 where it is not solved, which refuses nothing."""
    rows = np.setdiff1d(np.arange(len(problem.residual)), candidate.outliers)
    blocks = [problem.columns[:, problem.blocks[effect]] for effect in candidate.effects]
    columns = np.hstack([problem.nominal, *blocks])[rows]
    try:
        return any_centre(columns, problem.residual[rows], np.ones(len(rows)))[0]
    except SolverError:
        return 0.0


def _combinations(count: int, size: int) -> NDArray[np.int64]:
    """Every choice (n, 3) of so many of a number of candidates; -1 stands for none."""
    every = np.array(list(combinations(range(count), size)), dtype=np.int64)
    sets = np.full((len(every), 3), -1)
    sets[:, :size] = every.reshape(len(every), size)
    return sets
