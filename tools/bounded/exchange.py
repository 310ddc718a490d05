"""The least largest residual by exchanging rows: n + 1 rows hold a solution for n columns (Stiefel's algorithm).

For such rows that bound each other the largest residual is known. While another row misses by more it takes the place
of one of them; the least largest residual of all rows is proven from below by weights of these, and what is proven
grows at each step. It takes a small part of the time of a linear programme, and its end is proven; where it is not, as
with columns that depend on each other, the programme is for the solver.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

MOST_COLUMNS = 64
"""Of more columns a step costs more than one of the solver."""
MOST_STEPS, KEPT_STEPS = 40, 40
"""Steps for each column after which it is given up; after so many the rows are solved anew."""
DEPENDENT = 1e-7
"""Columns, each of size one, of which one has so little beside the others, are not exchanged."""
EXACT, PROVEN = 1e-10, 1e-9
"""What a row may miss by and what is between radius and proof, relatively to a radius of one or more."""
MANY = 3000
"""Of more rows so many, spread evenly, say where to begin."""
BEGUN = 5
"""The first rows are of those that least squares misses most, so many for each column."""


@dataclass(frozen=True, eq=False)
class Held:
    """The rows that hold a solution x (n,): their numbers and multipliers (n + 1,), of which the sizes sum to one."""

    radius: float
    x: NDArray[np.float64]
    rows: NDArray[np.int_]
    multipliers: NDArray[np.float64]


def exchanged(matrix: NDArray, target: NDArray) -> Held | None:
    """The least max |target (M,) - matrix (M, n) x| with what holds it; None where that is not proven."""
    count, columns = matrix.shape
    if not 0 < columns < min(count, MOST_COLUMNS) or not np.isfinite(matrix).all():
        return None
    size = np.abs(matrix).max(axis=0)
    if not size.all():
        return None
    unit = matrix / size
    if (rows := _begun(unit, target)) is None:
        return None
    try:
        with np.errstate(all="ignore"):
            found = _steps(unit, target, rows)
    except np.linalg.LinAlgError:
        return None
    return None if found is None else Held(found.radius, found.x / size, found.rows, found.multipliers)


def _begun(matrix: NDArray, target: NDArray) -> NDArray[np.int_] | None:
    """Rows (n + 1,) that determine the columns, of those that least squares misses most; None where none do."""
    columns = matrix.shape[1]
    some = np.column_stack((matrix, target))[:: max(1, len(matrix) // MANY)]
    triangle = np.asarray(qr(some, mode="r")[0])[: columns + 1]
    diagonal = np.abs(np.diag(triangle)[:columns])
    if not diagonal.min() > DEPENDENT * diagonal.max():
        return None
    error = target - matrix @ np.linalg.solve(triangle[:columns, :columns], triangle[:columns, columns])
    worst = np.argsort(-np.abs(error), kind="stable")
    for among in (worst[: BEGUN * columns], worst):
        found = qr(matrix[among].T, mode="r", pivoting=True)
        diagonal, order = np.abs(np.diag(np.asarray(found[0]))), np.asarray(found[-1])
        if len(diagonal) == columns and diagonal.min() > DEPENDENT * diagonal.max() and len(among) > columns:
            rest = among[order[columns:]]
            return np.append(among[order[:columns]], rest[np.abs(error[rest]).argmax()])
    return None


def _steps(matrix: NDArray, target: NDArray, rows: NDArray) -> Held | None:
    """Exchange rows until none misses by more."""
    columns = matrix.shape[1]
    held = np.append(-np.linalg.solve(matrix[rows[:-1]].T, matrix[rows[-1]]), 1.0)
    held *= 1.0 if held @ target[rows] >= 0.0 else -1.0
    sign = np.where(held >= 0.0, 1.0, -1.0)
    inverse, fresh = np.linalg.inv(np.column_stack((matrix[rows], sign))), True
    for step in range(MOST_STEPS * columns):
        solution = inverse @ target[rows]
        x, radius = solution[:-1], float(solution[-1])
        error = target - matrix @ x
        row = int(np.abs(error).argmax())
        largest = abs(float(error[row]))
        if not largest > radius + EXACT * max(1.0, radius):
            if fresh:
                weights = inverse[-1]
                return _proven(matrix, target, Held(radius, x, rows, weights), largest)
            inverse, fresh = np.linalg.inv(np.column_stack((matrix[rows], sign))), True
            continue
        own = 1.0 if error[row] > 0.0 else -1.0
        part = np.append(matrix[row], own) @ inverse
        weights, less = np.maximum(inverse[-1] * sign, 0.0), own * part * sign
        ratio = np.where(less > 1e-11, weights / less, np.inf)
        out = int(ratio.argmin())
        if ratio[out] == np.inf:
            return None
        rows, sign = rows.copy(), sign.copy()
        rows[out], sign[out] = row, own
        if fresh := step % KEPT_STEPS == KEPT_STEPS - 1:
            inverse = np.linalg.inv(np.column_stack((matrix[rows], sign)))
        else:
            replaced = part.copy()
            replaced[out] -= 1.0
            inverse = inverse - np.outer(inverse[:, out] / part[out], replaced)
    return None


def _proven(matrix: NDArray, target: NDArray, held: Held, largest: float) -> Held | None:
    """What was found, where its multipliers are a proof that no x misses all rows by less."""
    weights = held.multipliers
    missed = np.abs(weights @ matrix[held.rows]).max()
    least = float(weights @ target[held.rows]) / float(np.abs(weights).sum())
    sure = missed <= 1e-11 and largest - least <= PROVEN * max(1.0, largest)
    return held if sure and np.isfinite(held.x).all() else None
