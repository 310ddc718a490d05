"""Linear programmes by exchange of rows: each step costs a product of the rows, and its end is proven.

The least largest residual (Stiefel's algorithm): n + 1 rows hold a solution for n columns. For rows that bound each
other, the largest residual is known. While another row misses by more, it replaces one of them. Weights of these rows
prove a lower bound of the least largest residual of all rows, which grows at each step.

The farthest point in a direction, for rows with two ends. Where n rows meet at a corner, the direction pulls each row
to one of its ends, so no point goes farther in this direction. While the corner is beyond another row, that row
replaces one of them, and rows that it passes on the way change their ends (dual simplex with long steps).

An exchange takes a small part of the time of a linear programme. If its end is not proven, as with dependent columns,
the solver takes over.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from .factors import pivoted, triangle
from .work import MOST_COLUMNS, charge

MOST_STEPS = 40
"""Number of steps between new solutions of the rows; the exchange gives up after one such solution for each column."""
FAR = 1e3
"""Distance of a missing end from the other end of its row: a row held there is no proof."""
HELD = 1e-9
"""Relative size below which a dual holds nothing."""
BENT = 1e-11
"""Perturbation of a direction, relative to its largest component, after which no two vertices go equally far."""
DEPENDENT = 1e-7
"""Columns of size one are not exchanged if one has less than this beside the others."""
PROVEN = 1e-9
"""Largest difference of radius and proof, relative to a radius of one or more."""
MANY = 3000
"""Number of rows, spread evenly, that give the beginning for more rows than this."""
BEGUN = 5
"""Number of candidates for the first rows, for each column, of those that least squares misses most."""


@dataclass(frozen=True, eq=False)
class Held:
    """The rows that hold a solution x (n,): their numbers and multipliers (n + 1,), whose sizes sum to one."""

    radius: float
    x: Floats
    rows: Ints
    multipliers: Floats


@dataclass(frozen=True, eq=False)
class Farthest:
    """The vertex x (n,) that goes farthest, the rows (n,) that meet there, and their duals (n,); or several (L, n)."""

    x: Floats
    rows: NDArray[np.int64]
    duals: Floats

    def of(self, count: int) -> Floats:
        """Return the duals (M,) of all rows."""
        every = np.zeros(count)
        every[self.rows] = self.duals
        return every


def exchanged(matrix: NDArray, target: NDArray) -> Held | None:
    """Return the least max |target (M,) - matrix (M, n) x| with the rows that hold it; None if it is not proven."""
    count, columns = matrix.shape
    if not 0 < columns < min(count, MOST_COLUMNS) or not np.isfinite(matrix).all():
        return None
    size = np.abs(matrix).max(axis=0)
    if not size.all():
        return None
    charge(300.0 + 0.2 * matrix.size)
    unit = matrix / size
    if (rows := _begun(unit, target)) is None:
        return None
    try:
        with np.errstate(all="ignore"):
            solution = _steps(unit, target, rows)
    except np.linalg.LinAlgError:
        return None
    return None if solution is None else Held(solution.radius, solution.x / size, solution.rows, solution.multipliers)


def _begun(matrix: NDArray, target: NDArray) -> Ints | None:
    """Return rows (n + 1,) that determine the columns, of those that least squares misses most; None if there are
    none."""
    columns = matrix.shape[1]
    every = slice(None, None, max(1, len(matrix) // MANY))
    some = np.column_stack((matrix[every], target[every]))
    factor = triangle(some)[: columns + 1]
    diagonal = np.abs(np.diag(factor)[:columns])
    if not diagonal.min() > DEPENDENT * diagonal.max():
        return None
    error = target - matrix @ np.linalg.solve(factor[:columns, :columns], factor[:columns, columns])
    worst = np.argsort(-np.abs(error), kind="stable")
    for most in sorted({min(len(worst), most) for most in (BEGUN * columns, MANY, len(worst))}):
        among = worst[:most]
        diagonal, order = pivoted(matrix[among].T)
        if len(diagonal) == columns and diagonal.min() > DEPENDENT * diagonal.max() and len(among) > columns:
            rest = among[order[columns:]]
            return np.append(among[order[:columns]], rest[np.abs(error[rest]).argmax()])
    return None


def _steps(matrix: NDArray, target: NDArray, rows: NDArray) -> Held | None:
    """Exchange rows until none misses by more."""
    from .exchange_steps import ENDED, ENDLESS, exchange_held

    columns = matrix.shape[1]
    multipliers = np.append(-np.linalg.solve(matrix[rows[:-1]].T, matrix[rows[-1]]), 1.0)
    multipliers *= 1.0 if multipliers @ target[rows] >= 0.0 else -1.0
    rows, sign = rows.astype(np.int64), np.where(multipliers >= 0.0, 1.0, -1.0)
    for _ in range(columns + 2):
        inverse = np.linalg.inv(np.column_stack((matrix[rows], sign)))
        how, steps = exchange_held(matrix, target, rows, sign, inverse, MOST_STEPS)
        if how == ENDED and steps == 0:
            solution = inverse @ target[rows]
            largest = float(np.abs(target - matrix @ solution[:-1]).max())
            return _proven(matrix, target, Held(float(solution[-1]), solution[:-1], rows, inverse[-1]), largest)
        if how == ENDLESS:
            return None
    return None


def _proven(matrix: NDArray, target: NDArray, solution: Held, largest: float) -> Held | None:
    """Return the solution if its multipliers prove that no x misses all rows by less."""
    weights = solution.multipliers
    missed = np.abs(weights @ matrix[solution.rows]).max()
    least = float(weights @ target[solution.rows]) / float(np.abs(weights).sum())
    sure = missed <= 1e-11 and largest - least <= PROVEN * max(1.0, largest)
    return solution if sure and np.isfinite(solution.x).all() else None


@cache
def _bends(columns: int) -> NDArray:
    """Return numbers (n,) of all signs and sizes up to one."""
    return np.cos(np.arange(1.0, columns + 1.0) ** 2)


class Corner:
    """Rows (n,) of a matrix (M, n) that meet, and their inverse; the next walk begins where the last one ended."""

    def __init__(self, rows: NDArray[np.int64], inverse: Floats) -> None:
        self.rows, self._inverse = rows, inverse

    @staticmethod
    def of(matrix: NDArray) -> "Corner | None":
        """Return the rows that determine the columns best; None if there are none."""
        columns = matrix.shape[1]
        if not 0 < columns <= min(len(matrix), MOST_COLUMNS) or not np.isfinite(matrix).all():
            return None
        diagonal, order = pivoted(matrix.T)
        rows = order[:columns]
        if not diagonal.min() > DEPENDENT * diagonal.max():
            return None
        return Corner(rows, np.linalg.inv(matrix[rows]))

    def farthest(self, matrix: NDArray, middle: NDArray, half: NDArray, weights: NDArray) -> Farthest | None:
        """Return the vertex of greatest weights'x of all x with |matrix x - middle (M,)| ≤ half (M,); None: not
        proven."""
        each = self.farthest_of_each(matrix, middle, half, weights[None])
        return Farthest(each.x[0], each.rows[0], each.duals[0]) if len(each.x) else None

    def farthest_of_each(self, matrix: NDArray, middle: NDArray, half: NDArray, weights: NDArray) -> Farthest:
        """Return `farthest` of each of some directions (K, n), up to the first that is not proven, as (L, n) each."""
        from .exchange_steps import EXACT, exchange_each

        charge(len(weights) * (20.0 + 0.02 * matrix.size))
        # Of many equally far vertices it is always the same, from any beginning.
        size = np.abs(weights).max(axis=1)
        toward = weights + size[:, None] * BENT * _bends(weights.shape[1])
        try:
            rows, sides, count = exchange_each(
                matrix, middle, half, toward, self.rows, self._inverse.copy(), MOST_STEPS
            )
            rows, sides, weights = rows[:count], sides[:count], weights[:count]
            inverses = np.linalg.inv(matrix[rows])
        except np.linalg.LinAlgError:
            nothing = weights[:0]
            return Farthest(nothing, nothing.astype(np.int64), nothing)
        duals, centre, reach = (weights[:, None] @ inverses)[:, 0], middle[rows], half[rows]
        x, sizes = (inverses @ (centre + sides * reach)[..., None])[..., 0], np.abs(duals)
        beyond = (duals * centre + sizes * reach - weights * x).sum(axis=1)
        missed = np.abs(weights - (duals[:, None] @ matrix[rows])[:, 0]).max(axis=1)
        proven = (beyond <= EXACT * sizes.sum(axis=1)) & (missed <= EXACT * size[:count])
        count = int(np.append(proven, False).argmin())
        if count:
            self.rows, self._inverse = rows[count - 1], inverses[count - 1]
        return Farthest(x[:count], rows[:count], duals[:count])


def least_of(matrix: NDArray, lower: NDArray, upper: NDArray, cost: NDArray) -> Farthest | None:
    """Return the vertex of least cost'x of all x with lower (M,) ≤ matrix x ≤ upper; ends may be infinite.

    The duals prove the least value. Returns None if it is not proven.
    """
    endless = np.isinf(lower), np.isinf(upper)
    bounded = np.flatnonzero(~(endless[0] & endless[1]))
    rows = np.ascontiguousarray(matrix[bounded])
    low = np.where(endless[0], upper - FAR, lower)[bounded]
    high = np.where(endless[1], lower + FAR, upper)[bounded]
    corner = Corner.of(rows)
    vertex = None if corner is None else corner.farthest(rows, 0.5 * (low + high), 0.5 * (high - low), -cost)
    if vertex is None:
        return None
    active, duals = bounded[vertex.rows], -vertex.duals
    far = np.where(duals > 0.0, endless[0][active], endless[1][active])
    if (far & (np.abs(duals) > HELD * np.abs(duals).sum())).any():
        return None
    return Farthest(vertex.x, active, duals)
