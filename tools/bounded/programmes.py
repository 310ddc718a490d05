"""The linear programmes of the guaranteed approach, by exchanges of rows or HiGHS to 1e-10 of the noise bound.

All concern the set {x: |r − J x| ≤ bound}. Rows are scaled to a bound of one and parameters to the smallest bound, so
that the tolerances are relative to the noise. Few of many rows matter: programmes begin with a few and add the rows
that their solution violates, until it violates none.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import highspy
import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.arrays import Floats
from .exchange import Corner, exchanged, least_of
from .factors import pivoted
from .work import MANY_ROWS, charge

LEAST_LIMIT, MOST_ITERATIONS = 5000, 20
"""Steps of the simplex after which it counts as cycling: a constant, and more for each row and column."""
TOLERANCE = 1e-10
"""Primal and dual feasibility tolerance, as a fraction of the noise bound."""
RELATIVE_TOLERANCE = 1e-9
"""Largest error of a programme's value, as a fraction of the noise bound."""
ADDED_ROWS = 100
"""Number of most violated rows that one round adds."""
TOLD_APART, CONSIDERED = 0.99, 3000
"""Cosine from which two rows bound the same, and number of most violated rows that are searched for different ones."""
NEARLY = 1e-6
"""Relative room for rounding in the size of a row beside all others."""
BLOCK, MANY_BLOCKS = 2048, 8
"""Rows that a decomposition takes at once if there are many blocks: they stay in the processor's cache."""
DUAL_SIMPLEX, PRIMAL_SIMPLEX = 1, 4
Interval = tuple[float, float]
LEAST_VALUE = 1e-8
"""Relative singular value below which a direction is not determined."""
SAME_SPACE = 1e-7
"""Largest sine of an angle between two spaces that count as the same."""
IMITATED = 1e-7
"""Relative remainder below which columns are imitated."""
EXACT = 1e-11
"""Miss of a direction, relative to the duals' sizes, below which they are a proof."""
DEPENDENT = 1e-9
"""Size of a direction, for columns of size one, below which it is zero."""

OTHER_STRATEGIES = ((DUAL_SIMPLEX, "off"), (PRIMAL_SIMPLEX, "off"), (DUAL_SIMPLEX, "on"), (PRIMAL_SIMPLEX, "on"))
"""Strategies for a programme after its first one fails, as dual simplex sometimes does at these tolerances."""
SCALED, UNSCALED = 2, 0
"""HiGHS' own scaling, and none: scaled, nearly dependent columns may leave it without a basis."""


class Solver(highspy.Highs):
    """HiGHS without output: from 1.16 on its constructor prints its name before any option can be given."""

    def enableCallbacks(self) -> None:
        """Enable callbacks as HiGHS' constructor does, with the output off before."""
        self.setOptionValue("output_flag", False)
        super().enableCallbacks()


class SolverError(ArithmeticError):
    """A programme that must have a solution was not solved."""


@dataclass(frozen=True, eq=False)
class Growth:
    """Growth of bounds with the solution: `now` + `rows` x, for a step x between `low` and `high`.

    `now` (M,), `rows` (M, n); `low`, `high` (n,) are finite for columns with a part in it. The growth is nowhere
    negative between them. A growth with the size of a coefficient of either sign is one such branch for each sign.
    """

    now: Floats
    rows: Floats
    low: Floats
    high: Floats

    def at(self, step: NDArray) -> Floats:
        """Return the growth (M,) at a step (n,)."""
        return self.now + self.rows @ step

    def moved(self, step: NDArray) -> "Growth":
        """Return the same growth about another point, a step (n,) away."""
        return Growth(self.at(step), self.rows, self.low - step, self.high - step)

    def of(self, rows: NDArray) -> "Growth":
        """Return the growth of some of the rows (indices)."""
        return Growth(self.now[rows], self.rows[rows], self.low, self.high)

    def beside(self, columns: int) -> "Growth":
        """Return the growth with further columns, which have no part in it."""
        free = np.full(columns, np.inf)
        rows = np.hstack((self.rows, np.zeros((len(self.rows), columns))))
        return Growth(self.now, rows, np.append(self.low, -free), np.append(self.high, free))


class _Ends(NamedTuple):
    """Lower and upper ends (K,) of the rows in use, their middles and half their distances; whether all are finite."""

    lower: NDArray
    upper: NDArray
    middle: NDArray
    half: NDArray
    is_finite: bool


class Polytope:
    """{x: lower ≤ J x ≤ upper}, kept warm so that many objectives are cheap.

    J (M, n) has full column rank; tolerances are relative to `scale` (M,), the positive size of each row. `begin`: rows
    (indices) that always have ends and determine the columns, if others may have none.
    """

    def __init__(self, jacobian: NDArray, scale: NDArray, begin: NDArray | None = None):
        self._unit = float(scale.min())
        self._scale = scale
        self._matrix = jacobian * (self._unit / scale)[:, None]
        self._lower, self._upper = np.zeros((2, len(scale)))
        self._highs: highspy.Highs | None = None
        self._taken = first_rows(self._matrix) if begin is None else begin
        self._rows = self._matrix[self._taken]
        self._corner = Corner.of(self._rows)
        self._near: Nearness | None = None
        self._ends = self._ends_in_use()

    @property
    def _by_exchange(self) -> bool:
        """Return whether nothing needs the solver so far."""
        return self._highs is None and self._ends.is_finite

    def confine(self, lower: NDArray, upper: NDArray) -> None:
        """Set the ends (M,) of every row."""
        self._lower, self._upper = lower / self._scale, upper / self._scale
        self._ends = self._ends_in_use()
        if len(lower) >= MANY_BLOCKS * BLOCK:
            self._near = Nearness.of(self._matrix, np.minimum(self._upper, -self._lower))
        if self._highs is not None:
            rows = np.arange(len(self._taken), dtype=np.int32)
            self._highs.changeRowsBounds(len(rows), rows, self._ends.lower, self._ends.upper)  # pyright: ignore

    def _ends_in_use(self) -> "_Ends":
        lower, upper = self._lower[self._taken], self._upper[self._taken]
        is_finite = bool(np.isfinite(lower).all() and np.isfinite(upper).all())
        middle, half = np.zeros(len(lower)), np.full(len(lower), np.inf)
        if is_finite:
            middle, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        return _Ends(lower, upper, middle, half, is_finite)

    def maximise(self, weights: NDArray) -> tuple[float, NDArray, NDArray]:
        """Return the greatest weights'x over the set, the vertex x (n,) that attains it, and duals (M,).

        The duals Φ, with Φ'J = weights, are the derivatives of the value by each row's active end.
        """
        weights = np.asarray(weights, dtype=float)
        while True:
            x, multipliers = self._farthest(weights)
            if len(self._taken) == len(self._scale):
                break
            violated = self._violated_at(x)
            if not len(violated):
                break
            self._take(violated)
        duals = np.zeros(len(self._scale))
        duals[self._taken] = multipliers * self._unit / self._scale[self._taken]
        return float(weights @ x) * self._unit, x * self._unit, duals

    def maximise_each(self, weights: Sequence[NDArray]) -> Iterator[tuple[float, NDArray, NDArray]]:
        """Yield `maximise` of each of some weights (n,), in less time."""
        done = 0
        if self._corner is not None and self._by_exchange and len(self._taken) == len(self._scale) and len(weights):
            each = np.array(weights)
            vertices = self._corner.farthest_of_each(self._rows, self._ends.middle, self._ends.half, each)
            duals, numbers = np.zeros((len(vertices.x), len(self._scale))), self._taken[vertices.rows]
            duals[np.arange(len(numbers))[:, None], numbers] = vertices.duals * self._unit / self._scale[numbers]
            for row, x, of_rows in zip(each, vertices.x, duals, strict=False):
                yield float(row @ x) * self._unit, x * self._unit, of_rows
                done += 1
        for row in weights[done:]:
            yield self.maximise(row)

    def _violated_at(self, x: NDArray) -> NDArray:
        """Return rows to take in that a point is beyond; none only where it is beyond no row."""
        if self._near is None:
            return self._violated_of(slice(None), x)
        near = self._near.rows_at(x)
        violated = self._violated_of(near[:BLOCK], x)
        # A point that is far from zero is beyond some of the first rows: all are looked at where it is not.
        return violated if len(violated) or len(near) <= BLOCK else self._violated_of(slice(None), x)

    def _violated_of(self, rows: slice | NDArray, x: NDArray) -> NDArray:
        """Return the same of some of the rows."""
        activity, violation = self._matrix[rows] @ x, np.zeros(len(self._scale))
        violation[rows] = np.maximum(self._lower[rows] - activity, activity - self._upper[rows])
        apart = self._matrix if len(violation) >= MANY_BLOCKS * BLOCK else None
        return _most_violated(violation, self._taken, TOLERANCE, apart)

    def _farthest(self, weights: NDArray) -> tuple[NDArray, NDArray]:
        """Return the vertex x (n,) of the rows in use, and their duals (K,)."""
        ends = self._ends
        vertex = None
        if self._corner is not None and self._by_exchange:
            vertex = self._corner.farthest(self._rows, ends.middle, ends.half, weights)
        if vertex is not None:
            return vertex.x, vertex.of(len(ends.middle))
        if self._highs is None:
            free = np.full(len(weights), highspy.kHighsInf)
            self._highs = _model(np.zeros(len(weights)), -free, free, self._rows, ends.lower, ends.upper)
            self._highs.changeObjectiveSense(highspy.ObjSense.kMaximize)
        self._highs.changeColsCost(len(weights), np.arange(len(weights), dtype=np.int32), weights)
        solution = solved(self._highs)
        return np.array(solution.col_value), np.array(solution.row_dual)

    def _take(self, added: NDArray) -> None:
        rows = self._matrix[added]
        self._taken, self._rows = np.append(self._taken, added), np.vstack((self._rows, rows))
        self._ends = self._ends_in_use()
        if self._highs is not None:
            count, width = rows.shape
            start = np.arange(0, count * width, width, dtype=np.int32)
            index = np.tile(np.arange(width, dtype=np.int32), count)
            ends = self._lower[added], self._upper[added]
            self._highs.addRows(count, *ends, rows.size, start, index, rows.ravel())  # pyright: ignore


@dataclass(frozen=True, eq=False)
class Nearness:
    """Rows in the order in which a point must be away from zero to reach their ends.

    |row x| ≤ |row R⁻¹| |R x| with the triangle R of all rows: at a point near zero few of many rows need a look.
    `triangle` (n, n); `order` (M,); `least` (M,): the least |R x| at which each, in this order, is at an end.
    """

    triangle: Floats
    order: NDArray[np.int64]
    least: Floats

    @staticmethod
    def of(matrix: NDArray, room: NDArray) -> "Nearness | None":
        """Return the order of rows (M, n) with room (M,) about zero; None where they do not determine the columns."""
        triangle = np.asarray(np.linalg.qr(shortened(matrix), mode="r"))
        diagonal = np.abs(np.diag(triangle))
        if not diagonal.min() > DEPENDENT * diagonal.max():
            return None
        size = np.linalg.norm(np.linalg.solve(triangle.T, matrix.T), axis=0)
        least = room / np.where(size > 0.0, size, 1.0)
        order = np.argsort(least, kind="stable")
        return Nearness(triangle, order, least[order])

    def rows_at(self, x: NDArray) -> NDArray[np.int64]:
        """Return the rows that may be beyond an end at a point (n,)."""
        away = float(np.linalg.norm(self.triangle @ x)) * (1.0 + NEARLY)
        return self.order[: np.searchsorted(self.least, away, side="right")]


def first_rows(matrix: NDArray) -> NDArray:
    """Return rows (indices) to begin with: all if they are few, else the n that determine the columns best."""
    if len(matrix) <= MANY_ROWS:
        return np.arange(len(matrix))
    rows, count = np.arange(len(matrix)), matrix.shape[1]
    if len(matrix) >= MANY_BLOCKS * BLOCK:
        # Those of each block that determine the columns best, and of these again.
        starts = range(0, len(matrix), BLOCK)
        rows = np.concatenate([k + pivoted(matrix[k : k + BLOCK].T)[1][:count] for k in starts])
    return np.sort(rows[pivoted(matrix[rows].T)[1][:count]])


def shortened(matrix: NDArray) -> Floats:
    """Return few rows (K, n) with the singular values, and the least-squares content, of many (M, n).

    R of the QR decompositions of blocks of rows; the matrix itself if it has few rows.
    """
    count = len(matrix) // BLOCK
    if count < MANY_BLOCKS:
        return matrix
    blocks = matrix[: count * BLOCK].reshape(count, BLOCK, -1)
    # A few at a time: each is copied before it is decomposed.
    triangles = [np.linalg.qr(blocks[k : k + MANY_BLOCKS], mode="r") for k in range(0, count, MANY_BLOCKS)]
    return np.vstack((*np.concatenate(triangles), matrix[count * BLOCK :]))


def _most_violated(
    violation: NDArray, taken: NDArray, tolerance: float, matrix: NDArray | None = None, count: int = ADDED_ROWS
) -> NDArray:
    """Return rows to add: the most violated of those not in use, in the order of the rows.

    With a matrix (M, n) no two of them bound nearly the same.
    """
    violation[taken] = 0.0
    worst = np.flatnonzero(violation > tolerance)
    count = count if matrix is None else CONSIDERED
    if len(worst) > count:
        worst = worst[np.argpartition(violation[worst], -count)[-count:]]
    if matrix is None:
        return np.sort(worst)
    worst = worst[np.argsort(-violation[worst], kind="stable")]
    rows = matrix[worst] / np.linalg.norm(matrix[worst], axis=1, keepdims=True)
    apart, chosen = np.ones(len(worst), dtype=bool), []
    while apart.any() and len(chosen) < ADDED_ROWS:
        chosen.append(int(apart.argmax()))
        apart &= np.abs(rows @ rows[chosen[-1]]) < TOLD_APART
    return np.sort(worst[chosen])


def chebyshev_radius(
    jacobian: NDArray,
    residual: NDArray,
    bound: NDArray,
    *,
    low: NDArray | None = None,
    high: NDArray | None = None,
    growth: Growth | None = None,
) -> tuple[float, NDArray, NDArray]:
    """Return the least possible max |residual − jacobian x| / bound, with the proof that nothing less is possible.

    The jacobian (M, n) may have any rank; the units of its columns do not matter. Bounds (M,) are positive; `low` and
    `high` (n,) are ends of x: the duals prove the radius only without them. A `growth` has ends of its own. With it the
    result is the least ρ with |residual − jacobian x| ≤ ρ bound + growth(x): the size of x pays for the growth.

    Returns the radius: above 1 no x keeps every residual within its bound; x: a centre; duals (M,): jacobian'duals = 0,
    sum of bound·|duals| = 1, residual'duals = radius. The measurements with a nonzero dual, at most rank + 1, prove the
    radius by themselves.
    """
    free = np.full(jacobian.shape[1], highspy.kHighsInf)
    low, high = -free if low is None else low, free if high is None else high
    if growth is not None:
        low, high = np.maximum(low, growth.low), np.minimum(high, growth.high)
    anywhere = growth is None and not np.isfinite((low, high)).any()
    exchange = exchanged(jacobian / bound[:, None], residual / bound) if anywhere or len(bound) > MANY_ROWS else None
    if exchange is not None and anywhere:
        every = np.zeros(len(bound))
        every[exchange.rows] = exchange.multipliers / bound[exchange.rows]
        return max(0.0, exchange.radius), exchange.x, every
    chosen = first_rows(jacobian / bound[:, None])
    if exchange is not None:
        # The rows that hold the solution without ends and growth nearly hold it with them.
        worst = np.argpartition(-np.abs((residual - jacobian @ exchange.x) / bound), ADDED_ROWS)[:ADDED_ROWS]
        chosen = np.unique(np.concatenate((chosen, exchange.rows, worst)))
    added = ADDED_ROWS
    while True:
        every, growth_of_chosen = np.zeros(len(bound)), None if growth is None else growth.of(chosen)
        radius, x, every[chosen] = _chebyshev(
            jacobian[chosen], residual[chosen], bound[chosen], (low, high), growth_of_chosen
        )
        if len(chosen) == len(bound):
            return radius, x, every
        grown = 0.0 if growth is None else growth.at(x)
        excess = (np.abs(residual - jacobian @ x) - grown) / bound - radius
        violated = _most_violated(excess, chosen, TOLERANCE * max(1.0, radius), count=added)
        if not len(violated):
            return radius, x, every
        # Each round begins anew: rounds must be few.
        chosen, added = np.append(chosen, violated), 2 * added


def any_centre(jacobian: NDArray, residual: NDArray, bound: NDArray) -> tuple[float, Floats]:
    """Return the radius of `chebyshev_radius`, and some x (n,) that attains it (there may be many), in less time."""
    exchange = exchanged(jacobian / bound[:, None], residual / bound)
    return (
        chebyshev_radius(jacobian, residual, bound)[:2] if exchange is None else (max(0.0, exchange.radius), exchange.x)
    )


def moved_duals(duals: NDArray, rows: NDArray, direction: NDArray) -> Floats:
    """Return duals (K,), changed least, with which rows (K, n) add up to a direction (n,), or nearly."""
    missed = direction - duals @ rows
    if len(rows) == len(missed):
        try:
            return duals + np.linalg.solve(rows.T, missed)
        except np.linalg.LinAlgError:
            pass
    solution = scipy.linalg.lstsq(rows.T, missed, lapack_driver="gelsy", check_finite=False)
    assert solution is not None
    return duals + solution[0]


def proven_radius(jacobian: NDArray, residual: NDArray, bound: NDArray, growth: Growth, duals: Floats) -> float:
    """Return a lower bound of `chebyshev_radius` from the duals (M,) of a similar programme; -inf if they prove none.

    The duals are moved by least squares, over the rows that have one, to duals of this programme. For any Φ with
    Φ'J + |Φ|'G = 0 no x has Φ'(residual − J x) ≤ |Φ|'(ρ bound + now + G x) at a smaller ρ.
    """
    proof = np.flatnonzero(duals)
    rows, grown, multipliers = jacobian[proof], growth.rows[proof], duals[proof]
    matrix = rows + np.sign(multipliers)[:, None] * grown
    size = np.abs(matrix).max(axis=0, initial=0.0)
    matrix = matrix / np.where(size > 0.0, size, 1.0)
    paid, proven = np.isfinite(growth.low) & np.isfinite(growth.high), -math.inf
    # A coefficient that pays for growth is at one of its ends, or between them.
    for part_of_columns in (~paid, np.ones_like(paid)) if paid.any() else (~paid,):
        part = matrix[:, part_of_columns]
        moved = moved_duals(multipliers, part, np.zeros(part.shape[1]))
        weights = np.abs(moved)
        slope = moved @ rows + weights @ grown
        if not weights.any() or (np.abs(slope[~paid]) > EXACT * weights.sum() * size[~paid]).any():
            continue
        most = np.maximum(slope[paid] * growth.low[paid], slope[paid] * growth.high[paid]).sum()
        least = (moved @ residual[proof] - weights @ growth.now[proof] - most) / (weights @ bound[proof])
        proven = max(proven, float(least))
    return proven


def _chebyshev(
    jacobian: NDArray, residual: NDArray, bound: NDArray, ends: tuple[NDArray, NDArray], growth: Growth | None
) -> tuple[float, NDArray, NDArray]:
    """Compute `chebyshev_radius` with all rows at once."""
    rows, columns = jacobian.shape
    target = residual / bound
    by, now = (np.zeros_like(jacobian), 0.0) if growth is None else (growth.rows, growth.now / bound)
    largest = np.maximum(np.abs(jacobian), np.abs(by)) / bound[:, None]
    size = largest.max(axis=0, initial=0.0) if rows else np.zeros(columns)
    size[size == 0.0] = 1.0
    matrix, grown = jacobian / bound[:, None] / size, by / bound[:, None] / size
    stretch = max(1.0, float(np.abs(target).max(initial=0.0)))
    sides = np.block([[matrix + grown, np.ones((rows, 1))], [matrix - grown, -np.ones((rows, 1))]])
    infinite, cost = np.full(rows, np.inf), np.append(np.zeros(columns), 1.0)
    low, high = (np.append(end * size / stretch, last) for end, last in zip(ends, (0.0, np.inf), strict=True))
    lower, upper = np.append((target - now) / stretch, -infinite), np.append(infinite, (target + now) / stretch)
    everything = np.vstack((sides, np.eye(columns + 1)))
    vertex = least_of(everything, np.append(lower, low), np.append(upper, high), cost)
    if vertex is None:
        solution = solved(_model(cost, low, high, sides, lower, upper))
        x, duals = np.array(solution.col_value), np.array(solution.row_dual)
    else:
        x, duals = vertex.x, vertex.of(len(everything))
    return max(0.0, float(x[-1]) * stretch), x[:-1] * stretch / size, (duals[:rows] + duals[rows : 2 * rows]) / bound


def least_largest(
    matrix: NDArray, lower: NDArray, upper: NDArray, offset: NDArray, slopes: NDArray
) -> tuple[float, NDArray]:
    """Return the least possible max |offset + slopes x| over {x: lower ≤ matrix x ≤ upper}, and the x (n,) that attains
    it.

    The matrix (M, n) has full column rank; offset (R,), slopes (R, n).
    """
    unit = float((upper - lower).min()) / 2.0
    rows, columns = matrix.shape
    ones = np.ones((len(offset), 1))
    stacked = np.block([[matrix, np.zeros((rows, 1))], [slopes, ones], [slopes, -ones]])
    infinite = np.full(len(offset), highspy.kHighsInf)
    free = np.full(columns, highspy.kHighsInf)
    highs = _model(
        np.append(np.zeros(columns), 1.0),
        np.append(-free, 0.0),
        np.append(free, highspy.kHighsInf),
        stacked,
        np.concatenate([lower / unit, -offset / unit, -infinite]),
        np.concatenate([upper / unit, infinite, -offset / unit]),
    )
    values = np.array(solved(highs).col_value) * unit
    return float(values[-1]), values[:-1]


def solver() -> highspy.Highs:
    """Return HiGHS with the options of every programme: simplex on one thread, no output, to `TOLERANCE`."""
    highs = Solver()
    options: Sequence[tuple[str, object]] = (
        ("output_flag", False),
        ("threads", 1),
        ("parallel", "off"),
        ("solver", "simplex"),
        ("presolve", "off"),
        ("primal_feasibility_tolerance", TOLERANCE),
        ("dual_feasibility_tolerance", TOLERANCE),
        ("small_matrix_value", 1e-12),
    )
    for name, value in options:
        highs.setOptionValue(name, value)
    return highs


def linear_programme(
    cost: NDArray,
    ends: tuple[NDArray, NDArray],
    matrix: tuple[NDArray, NDArray, NDArray],
    row_ends: tuple[NDArray, NDArray],
) -> highspy.HighsLp:
    """Return the programme of least cost'x (n,) with x between its ends and the rows (M,) between theirs, for HiGHS.

    The matrix is stored by columns: the first index of each (n + 1,), and the rows and values (K,) of its elements.
    """
    lp = highspy.HighsLp()
    lp.num_col_, lp.num_row_ = len(cost), len(row_ends[0])
    lp.col_cost_, (lp.col_lower_, lp.col_upper_) = cost, ends
    lp.row_lower_, lp.row_upper_ = row_ends
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_, lp.a_matrix_.index_ = matrix[0].astype(np.int32), matrix[1].astype(np.int32)
    lp.a_matrix_.value_ = matrix[2]
    return lp


def _model(
    cost: NDArray, lower: NDArray, upper: NDArray, matrix: NDArray, row_lower: NDArray, row_upper: NDArray
) -> highspy.Highs:
    columns, rows = np.nonzero(matrix.T)
    starts = np.searchsorted(columns, np.arange(len(cost) + 1))
    highs = solver()
    highs.setOptionValue("simplex_strategy", PRIMAL_SIMPLEX)
    size = len(cost), len(row_lower), len(rows)
    how = int(highspy.MatrixFormat.kColwise), int(highspy.ObjSense.kMinimize), 0.0
    ends = cost, lower, upper, row_lower, row_upper
    kinds = np.zeros(len(cost), dtype=np.int32)
    # As arrays: a `HighsLp` takes them number by number, which is slower than the programme itself.
    elements = starts.astype(np.int32), rows.astype(np.int32), matrix.T[columns, rows]
    if highs.passModel(*size, *how, *ends, *elements, kinds) == highspy.HighsStatus.kError:  # pyright: ignore
        raise SolverError("the linear programme was not accepted by the solver")
    return highs


def solved(
    highs: highspy.Highs, usual: int = PRIMAL_SIMPLEX, others: Sequence[tuple[int, str]] = OTHER_STRATEGIES
) -> highspy.HighsSolution:
    """Solve, warm if possible; after a failure, from nothing by one strategy after the other, and the usual one again.

    Cycling counts as a failure. Raises SolverError if no strategy solves it.
    """
    rows, columns = highs.getNumRow(), highs.getNumCol()
    size = rows + columns
    charge(500.0 + 0.6 * rows * columns)
    highs.setOptionValue("simplex_iteration_limit", LEAST_LIMIT + MOST_ITERATIONS * size)
    highs.run()
    if highs.getModelStatus() == highspy.HighsModelStatus.kOptimal:
        return highs.getSolution()
    for strategy, presolve, scaling in [*((*way, SCALED) for way in others), (usual, "off", UNSCALED)]:
        highs.clearSolver()
        highs.setOptionValue("simplex_strategy", strategy)
        highs.setOptionValue("presolve", presolve)
        highs.setOptionValue("simplex_scale_strategy", scaling)
        highs.run()
        if highs.getModelStatus() == highspy.HighsModelStatus.kOptimal:
            solution = highs.getSolution()
            highs.setOptionValue("simplex_strategy", usual)
            highs.setOptionValue("presolve", "off")
            highs.setOptionValue("simplex_scale_strategy", SCALED)
            return solution
    raise SolverError(f"a linear programme was not solved: {highs.modelStatusToString(highs.getModelStatus())}")


def least_squares(matrix: NDArray, target: NDArray) -> Floats:
    """Return the x (n,) of least sum of squares of target (M,) - matrix (M, n) x; undetermined directions stay at zero.

    The units of the matrix's columns do not matter.
    """
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    u, values, directions = np.linalg.svd(matrix / size, full_matrices=False)
    determined = values > LEAST_VALUE * values.max(initial=0.0)
    return (directions[determined].T @ ((u[:, determined].T @ target) / values[determined])) / size


def column_space(columns: NDArray) -> Floats:
    """Return an orthonormal basis of the space that columns span; their units do not matter."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns / np.where(size > 0.0, size, 1.0)
    try:
        u, values, _ = np.linalg.svd(scaled, full_matrices=False)
    except np.linalg.LinAlgError:
        # The faster algorithm fails on some finite matrices.
        u, values, _ = scipy.linalg.svd(scaled, full_matrices=False, lapack_driver="gesvd")
    return u[:, values > DEPENDENT * values.max(initial=0.0)] if values.max(initial=0.0) > 0.0 else u[:, :0]


def spaces_beyond(imitated: NDArray, blocks: Sequence[NDArray]) -> list[Floats]:
    """Return the spaces that blocks of columns (M, k) add to the space of other columns (M, P), as orthonormal
    columns."""
    base = column_space(imitated)
    spaces = []
    for block in blocks:
        beyond = block - base @ (base.T @ block)
        beyond[:, np.linalg.norm(beyond, axis=0) < IMITATED * np.linalg.norm(block, axis=0)] = 0.0
        spaces.append(column_space(beyond))
    return spaces


def same_space(a: NDArray, b: NDArray, tolerance: float = SAME_SPACE) -> bool:
    """Return True if two orthonormal bases span the same space, to within a tolerance of unit vectors."""
    return a.shape == b.shape and is_within(a, b, tolerance)


def is_within(a: NDArray, b: NDArray, tolerance: float = SAME_SPACE) -> bool:
    """Return True if the space of one orthonormal basis lies in that of another."""
    return float(np.linalg.norm(a - b @ (b.T @ a), 2)) < tolerance


def cosine(a: NDArray, b: NDArray) -> float:
    """Return the cosine of the least angle between the spaces of two orthonormal bases; 0 if one is empty."""
    return min(1.0, float(np.linalg.norm(a.T @ b, 2))) if a.shape[1] and b.shape[1] else 0.0


def spread_directions(count: int, steps: int) -> list[Floats]:
    """Return unit vectors (count,) spread over all directions; of opposite ones one is enough."""
    if count == 1:
        return [np.ones(1)]
    if count == 2:
        angles = math.pi * np.arange(steps) / steps
        return [np.array([math.cos(angle), math.sin(angle)]) for angle in angles]
    vectors = np.random.default_rng(0).normal(size=(4 * steps, count))
    return list(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
