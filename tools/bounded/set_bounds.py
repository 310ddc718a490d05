"""Lower bounds of what sets of effects and outliers leave, as machine code.

A set is for compiled code a row of five whole numbers: up to three candidates, then up to two readings that are left
out; -1 stands for none. Deleting reading a of weight w_a, residual r and leverage h takes r²/(1 - h) off the weighted
sum of squares, and the others' weights then sum to 1 - w_a; two readings have a formula of order two.
"""

import numpy as np

from ..compiled import compile_callee, compiled_and_kept

WIDTH = 5
MOST_COLUMNS = 32
"""An effect has at most nine columns, a set at most three effects."""
REFUSED, ACCEPTED, UNDECIDED = 0, 1, 2
ROUNDS = 30
"""Rounds before a set is handed to a linear programme."""


@compile_callee
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


@compile_callee
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


@compile_callee
def _reading(projection, row, factor, count, own):
    """Residual and leverage of a reading beside the chosen columns; `own` takes its row of these, made orthonormal."""
    _, basis, residual, columns, _, _, _, _ = projection
    chosen, triangle, solved = factor
    left, leverage = residual[row], 0.0
    for q in range(basis.shape[1]):
        leverage += basis[row, q] * basis[row, q]
    for m in range(count):
        value = columns[row, chosen[m]]
        for q in range(m):
            value -= triangle[m, q] * own[q]
        own[m] = value / triangle[m, m]
        left -= own[m] * solved[m]
        leverage += own[m] * own[m]
    return left, leverage


@compile_callee
def _product(basis, a, b, own, count):
    """Of the rows of two readings in the space of nominal and chosen columns."""
    product = 0.0
    for q in range(count):
        product += own[a, q] * own[b, q]
    for q in range(basis.shape[1]):
        product += basis[a, q] * basis[b, q]
    return product


@compile_callee
def _without_one(square, residual, leverage, weight):
    left = 1.0 - leverage
    if left <= 1e-9 or weight >= 1.0 - 1e-9:
        return 0.0
    return max(0.0, square - residual * residual / left) / (1.0 - weight)


@compile_callee
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


@compile_callee
def _room(residual):
    """A Cholesky factor of no columns, room for a row of each reading, and the residual's sum of squares."""
    factor = np.zeros(MOST_COLUMNS, np.int64), np.zeros((MOST_COLUMNS, MOST_COLUMNS)), np.zeros(MOST_COLUMNS)
    total = 0.0
    for value in residual:
        total += value * value
    return factor, np.zeros((len(residual), MOST_COLUMNS)), total


@compile_callee
def _kept(survivors, count, numbers, a, b):
    if count == len(survivors):
        fewer = survivors
        survivors = np.empty((2 * count, WIDTH), np.int64)
        for m in range(count):
            for q in range(WIDTH):
                survivors[m, q] = fewer[m, q]
    for q in range(3):
        survivors[count, q] = numbers[q]
    survivors[count, 3], survivors[count, 4] = a, b
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


@compiled_and_kept
def settle(problem, chosen_set, weights, limit):
    """One set's (REFUSED, ACCEPTED or UNDECIDED, weights (M,) with which it ended).

    A problem is a matrix, the residual, the number of nominal columns, which come first, and the first column after
    these and the number of columns of each candidate; the chosen set is a row of five.
    """
    matrix, residual, always, starts, sizes = problem
    rows, count, kept = len(residual), always, 0
    used, w = np.empty(always + MOST_COLUMNS, np.int64), weights.copy()
    for q in range(always):
        used[q] = q
    for k in range(len(chosen_set)):
        if chosen_set[k] >= 0 and k < 3:
            first = always + starts[chosen_set[k]]
            for column in range(first, first + sizes[chosen_set[k]]):
                used[count] = column
                count += 1
        elif chosen_set[k] >= 0:
            w[chosen_set[k]] = 0.0
    total = 0.0
    for m in range(rows):
        total += w[m]
        kept += w[m] > 0.0
    columns, weighted, misfit = np.empty((rows, count)), np.empty((rows, count)), np.empty(rows)
    x, correction = np.empty(count), np.empty(count)
    for m in range(rows):
        w[m] /= total
        for q in range(count):
            columns[m, q] = matrix[m, used[q]]
    # Loops over numbers: whole arrays take numba four times as long to compile.
    for _ in range(ROUNDS):
        for m in range(rows):
            for q in range(count):
                weighted[m, q] = columns[m, q] * w[m]
        normal = weighted.T @ columns
        _solve(normal, weighted.T @ residual, x)
        # Once more with what is left, so that the sum of squares is the least to rounding.
        _substitute(normal, weighted.T @ (residual - columns @ x), correction)
        for q in range(count):
            x[q] += correction[q]
        predicted = columns @ x
        total = square = largest = 0.0
        for m in range(rows):
            misfit[m] = abs(residual[m] - predicted[m]) if w[m] > 0.0 else 0.0
            total += w[m] * misfit[m]
            square += w[m] * misfit[m] * misfit[m]
            largest = max(largest, misfit[m])
        if square > limit:
            return REFUSED, w
        if largest <= 1.0:
            return ACCEPTED, w
        for m in range(rows):
            if w[m] > 0.0:
                w[m] = 0.99 * w[m] * misfit[m] / total + 0.01 / kept
    return UNDECIDED, w


@compile_callee
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


@compile_callee
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
