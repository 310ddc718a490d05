"""Lawson's algorithm, compiled, for one set of effects and outliers that no bound has refused.

The file takes nothing from others but the compiler: what is kept on disk is compiled anew when this file changes.
"""

import numpy as np

from ..compiled import compiled_and_kept

REFUSED, ACCEPTED, UNDECIDED = 0, 1, 2
ROUNDS = 30
"""Rounds before a set is handed to a linear programme."""


@compiled_and_kept
def settle(matrix, residual, always, starts, sizes, chosen_set, weights, limit):
    """One set's (REFUSED, ACCEPTED or UNDECIDED, weights (M,) with which it ended).

    `matrix` has the `always` nominal columns first, `starts` counts from there; the chosen set is a row of five, as in
    `set_bounds`.
    """
    rows = len(residual)
    used = np.empty(matrix.shape[1], dtype=np.int64)
    count = always
    for k in range(always):
        used[k] = k
    for k in range(3):
        if chosen_set[k] >= 0:
            for column in range(starts[chosen_set[k]], starts[chosen_set[k]] + sizes[chosen_set[k]]):
                used[count] = always + column
                count += 1
    w = weights.copy()
    for k in range(3, len(chosen_set)):
        if chosen_set[k] >= 0:
            w[chosen_set[k]] = 0.0
    w /= w.sum()
    alive = 0
    for m in range(rows):
        if w[m] > 0.0:
            alive += 1
    normal = np.empty((count, count))
    right = np.empty(count)
    x = np.empty(count)
    misfit = np.empty(rows)
    for _ in range(ROUNDS):
        normal[:] = 0.0
        right[:] = 0.0
        for m in range(rows):
            if w[m] > 0.0:
                for p in range(count):
                    value = w[m] * matrix[m, used[p]]
                    right[p] += value * residual[m]
                    for q in range(p + 1):
                        normal[p, q] += value * matrix[m, used[q]]
        _solve(normal, right, x)
        # Once more with what is left, so that the sum of squares is the least to rounding.
        for again in range(2):
            square, largest = 0.0, 0.0
            right[:] = 0.0
            for m in range(rows):
                if w[m] > 0.0:
                    value = residual[m]
                    for p in range(count):
                        value -= matrix[m, used[p]] * x[p]
                    misfit[m] = value
                    square += w[m] * value * value
                    largest = max(largest, abs(value))
                    if again == 0:
                        for p in range(count):
                            right[p] += w[m] * matrix[m, used[p]] * value
                else:
                    misfit[m] = 0.0
            if again == 0:
                correction = np.empty(count)
                _substitute(normal, right, correction)
                x += correction
        if square > limit:
            return REFUSED, w
        if largest <= 1.0:
            return ACCEPTED, w
        total = 0.0
        for m in range(rows):
            total += w[m] * abs(misfit[m])
        for m in range(rows):
            if w[m] > 0.0:
                w[m] = 0.99 * w[m] * abs(misfit[m]) / total + 0.01 / alive
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
