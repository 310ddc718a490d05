"""The steps of an exchange of rows: Python for the few of a small calibration, then machine code."""

import numpy as np

from ..compiled import compiled_and_kept

EXACT = 1e-10
"""Largest miss of a row, relative to a radius of one or more."""
NO_PIVOT = 1e-11
"""Size below which a row has no part in others."""
PLAIN_USES = 200
"""Number of uses, or directions, as Python: a calibration of 12 positions takes 132."""
ENDED, ENDLESS, NOT_ENDED = 0, 1, 2
"""Ends of the steps: nothing misses by more, nothing can be exchanged, or the number of steps is reached."""


def _replaced(inverse, part, out):
    """Change the inverse (n, n) of rows to that with another one at a place; `part` (n,): the new row in these."""
    column = inverse[:, out] / part[out]
    inverse -= np.outer(column, part)
    inverse[:, out] = column


def _exchange_held(matrix, target, rows, sign, inverse, most):
    """Exchange some of the rows (n + 1,) that hold a solution, with their signs; return the kind of end and the
    steps."""
    last = len(rows) - 1
    row_of = np.empty(len(rows))
    for step in range(most):
        solution = inverse @ target[rows]
        radius, error = solution[last], target - matrix @ solution[:last]
        row = np.abs(error).argmax()
        if not abs(error[row]) > radius + EXACT * max(1.0, radius):
            return ENDED, step
        error_sign = 1.0 if error[row] > 0.0 else -1.0
        row_of[:last], row_of[last] = matrix[row], error_sign
        part = row_of @ inverse
        ratio, less = inverse[last] * sign, error_sign * part * sign
        for k in range(last + 1):
            ratio[k] = max(ratio[k], 0.0) / less[k] if less[k] > NO_PIVOT else np.inf
        out = ratio.argmin()
        if ratio[out] == np.inf:
            return ENDLESS, step
        _replaced(inverse, part, out)
        rows[out], sign[out] = row, error_sign
    return NOT_ENDED, most


def _exchange_met(matrix, middle, half, weights, rows, side, inverse, most):
    """Exchange some of the rows (n,) that meet, each at one of its sides; return the kind of end and the steps."""
    duals = weights @ inverse
    for step in range(most):
        missed = matrix @ (inverse @ (middle[rows] + side * half[rows])) - middle
        beyond = np.abs(missed) - half
        row = beyond.argmax()
        if beyond[row] <= EXACT:
            return ENDED, step
        sign, slope = 1.0 if missed[row] > 0.0 else -1.0, -beyond[row]
        part = matrix[row] @ inverse
        ratio, less = duals * side, sign * part * side
        for k in range(len(rows)):
            ratio[k] = max(ratio[k], 0.0) / less[k] if less[k] > NO_PIVOT else np.inf
        while True:
            out = ratio.argmin()
            least = ratio[out]
            if least == np.inf:
                return ENDLESS, step
            # A row released at one end may move to its other one as long as the corner goes no farther.
            slope += 2.0 * less[out] * half[rows[out]]
            if slope >= 0.0:
                break
            side[out], ratio[out] = -side[out], np.inf
        duals -= least * sign * part
        _replaced(inverse, part, out)
        duals[out], rows[out], side[out] = least * sign, row, sign
    return NOT_ENDED, most


def _exchange_each(matrix, middle, half, directions, begin, inverse, most):
    """Exchange rows for one direction (K, n) after the other, each from the rows where the last one ended.

    `begin` (n,) are the first rows and `inverse` (n, n) is theirs; it changes. Returns the rows (K, n) and sides that
    each direction ends with, and the number of directions before the first that does not end.
    """
    count, columns = directions.shape
    rows, sides, identity = np.empty((count, columns), np.int64), np.empty((count, columns)), np.eye(columns)
    rows[0] = begin
    for k in range(count):
        if k > 0:
            rows[k] = rows[k - 1]
        duals = directions[k] @ inverse
        for j in range(columns):
            sides[k, j] = 1.0 if duals[j] >= 0.0 else -1.0
        for _ in range(columns + 2):
            how, steps = _exchange_met(matrix, middle, half, directions[k], rows[k], sides[k], inverse, most)
            if how == ENDLESS or not np.isfinite(inverse).all():
                return rows, sides, k
            if steps == 0:
                break
            inverse[:] = np.linalg.solve(matrix[rows[k]], identity)
        if steps > 0:
            return rows, sides, k
    return rows, sides, count


exchange_held = compiled_and_kept(_exchange_held, PLAIN_USES)
exchange_each = compiled_and_kept(_exchange_each, PLAIN_USES, 3)
