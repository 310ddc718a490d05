"""Lower bounds of the radius of sets of effects and outliers, as machine code.

For compiled code a set is a row of five whole numbers: up to three candidates, then up to two readings that are left
out; -1 is an empty place. Deleting reading a of weight w_a, residual r and leverage h takes r²/(1 - h) off the weighted
sum of squares. The others' weights then sum to 1 - w_a; two readings have a formula of order two.
"""

import numpy as np

from ..compiled import compiled_and_kept

WIDTH = 5
MOST_COLUMNS = 32
"""Largest number of columns: an effect has at most nine, a set at most three effects."""
REFUSED, ACCEPTED, UNDECIDED = 0, 1, 2
ROUNDS = 30
"""Rounds before a set is handed to a linear programme."""


def _append(projection, candidate, factor, count):
    """Extend a Cholesky factor of `count` columns by those of a candidate; skip dependent ones."""
    _, _, _, _, gram, squares, product, starts, sizes = projection
    chosen, triangle, solved = factor
    first = starts[candidate]
    for column in range(first, first + sizes[candidate]):
        for m in range(count):
            second = chosen[m]
            value = squares[column, second - first] if second >= first else gram[column, second]
            for q in range(m):
                value -= triangle[count, q] * triangle[m, q]
            triangle[count, m] = value / triangle[m, m]
        size = squares[column, column - first]
        pivot = size
        for q in range(count):
            pivot -= triangle[count, q] * triangle[count, q]
        if pivot > 1e-9 * size and pivot > 0.0:
            triangle[count, count] = np.sqrt(pivot)
            value = product[column]
            for q in range(count):
                value -= triangle[count, q] * solved[q]
            solved[count] = value / triangle[count, count]
            chosen[count] = column
            count += 1
    return count


def _of_effects(projection, candidates, factor, before, counts):
    """Return the number of candidates (3,) and the first that differs from `before` (3,), which they replace.

    `counts` (4,) are the numbers of columns in the factor for each number of candidates.
    """
    depth, changed = 0, 3
    for level in range(3):
        candidate = candidates[level]
        depth += candidate >= 0
        if changed == 3 and candidate != before[level]:
            changed = level
        if changed <= level:
            before[level] = candidate
            counts[level + 1] = counts[level]
            if candidate >= 0:
                counts[level + 1] = _append(projection, candidate, factor, counts[level])
    return depth, changed


def _squared(total, factor, count):
    """Return the squared bound of effects with `count` columns in their factor."""
    square = total
    for q in range(count):
        square -= factor[2][q] * factor[2][q]
    return max(0.0, square)


def _reading(projection, row, factor, count, leverages):
    """Return residual and leverage of a reading beside the chosen columns; `own` receives its row of these,
    orthonormal."""
    _, basis, residual, columns = projection[0], projection[1], projection[2], projection[3]
    chosen, triangle, solved = factor
    misfit, leverage = residual[row], 0.0
    for q in range(len(basis)):
        leverage += basis[q, row] * basis[q, row]
    for m in range(count):
        value = columns[chosen[m], row]
        for q in range(m):
            value -= triangle[m, q] * leverages[q]
        leverages[m] = value / triangle[m, m]
        misfit -= leverages[m] * solved[m]
        leverage += leverages[m] * leverages[m]
    return misfit, leverage


def _readings(columns, factor, place, leverages, r, h):
    """Compute `_reading` for all at once: take the chosen column of a place into `own` (K, M), residuals and
    leverages."""
    chosen, triangle, solved = factor
    column, row, rows = columns[chosen[place]], leverages[place], len(r)
    for k in range(rows):
        row[k] = column[k]
    for q in range(place):
        part, second = triangle[place, q], leverages[q]
        for k in range(rows):
            row[k] -= part * second[k]
    size, part = triangle[place, place], solved[place]
    for k in range(rows):
        row[k] /= size
        r[k] -= row[k] * part
        h[k] += row[k] * row[k]


def _product(basis, a, b, first, second, count):
    """Return the product of the rows of two readings in the space of nominal and chosen columns; `first` and `second`
    are their rows of the latter."""
    product = 0.0
    for q in range(count):
        product += first[q] * second[q]
    for q in range(len(basis)):
        product += basis[q, a] * basis[q, b]
    return product


def _without_one(square, residual, leverage, weight):
    free = 1.0 - leverage
    if free <= 1e-9 or weight >= 1.0 - 1e-9:
        return 0.0
    return max(0.0, square - residual * residual / free) / (1.0 - weight)


def _without_two(square, residuals, leverages, cross, weight):
    ra, rb = residuals
    left_a, left_b = 1.0 - leverages[0], 1.0 - leverages[1]
    determinant = left_a * left_b - cross * cross
    if determinant <= 1e-9 or weight >= 1.0 - 1e-9:
        return 0.0
    explained = (left_b * ra * ra + left_a * rb * rb + 2.0 * cross * ra * rb) / determinant
    return max(0.0, square - explained) / (1.0 - weight)


@compiled_and_kept
def bounds_of(sets, projection):
    """Return the squared bounds (n,) of sets (n, 5) under one projection.

    A projection is weights, basis, residual, columns, gram, own, product of `sets.Projection`, then the first column
    and the number of columns of each candidate.
    """
    weights, basis, residual = projection[0], projection[1], projection[2]
    factor, before, counts, total = _room(residual)
    two, bounds = np.zeros((2, MOST_COLUMNS)), np.empty(len(sets))
    for n in range(len(sets)):
        _of_effects(projection, sets[n, :3], factor, before, counts)
        count = counts[3]
        square = _squared(total, factor, count)
        a, b = sets[n, 3], sets[n, 4]
        if a >= 0:
            ra, ha = _reading(projection, a, factor, count, two[0])
            if b < 0:
                square = _without_one(square, ra, ha, weights[a])
            else:
                rb, hb = _reading(projection, b, factor, count, two[1])
                cross = _product(basis, a, b, two[0], two[1], count)
                square = _without_two(square, (ra, rb), (ha, hb), cross, weights[a] + weights[b])
        bounds[n] = square
    return bounds


def _room(residual):
    """Return an empty Cholesky factor, the candidates and counts of columns in it, and the residual's sum of
    squares."""
    factor = np.zeros(MOST_COLUMNS, np.int64), np.zeros((MOST_COLUMNS, MOST_COLUMNS)), np.zeros(MOST_COLUMNS)
    total = 0.0
    for value in residual:
        total += value * value
    return factor, np.full(3, -2), np.zeros(4, np.int64), total


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


def _one_may_do(square, residuals, leverages, spared):
    """Return nonzero if a left-out reading might take a set's square (squared bound) to the limit: a quick test."""
    may = 0
    for a in range(len(residuals)):
        free = 1.0 - leverages[a]
        enough = (square - spared[a]) * free <= residuals[a] * residuals[a] * (1.0 + 1e-6)
        may |= enough | (free <= 1e-8)
    return may


@compiled_and_kept
def _surviving(sets, outliers, limit, projection):
    """Return the sets (n, 3) of candidates, each with every choice of `outliers` outliers, that are not refused."""
    weights, basis, residual, columns = projection[0], projection[1], projection[2], projection[3]
    factor, before, counts, total = _room(residual)
    rows = len(residual)
    # Residuals and leverages beside none, one, two and three candidates.
    leverages, r, h = np.empty((MOST_COLUMNS, rows)), np.empty((4, rows)), np.zeros((4, rows))
    r[0] = residual
    spared, picked = np.empty(rows), np.empty(rows, np.int64)
    for a in range(rows):
        for q in range(len(basis)):
            h[0, a] += basis[q, a] * basis[q, a]
        # A left-out reading takes its weight off the limit; with all of the weight it may take anything.
        spared[a] = limit * (1.0 - weights[a]) if weights[a] < 1.0 - 1e-8 else np.inf
    survivors, survivor_count = np.empty((1024, WIDTH), dtype=np.int64), 0
    for numbers in sets:
        depth, changed = _of_effects(projection, numbers, factor, before, counts)
        count = counts[3]
        square = _squared(total, factor, count)
        if outliers == 0:
            if square <= limit:
                survivors = _kept(survivors, survivor_count, numbers, -1, -1)
                survivor_count += 1
            continue
        for level in range(changed, depth):
            for a in range(rows):
                r[level + 1, a], h[level + 1, a] = r[level, a], h[level, a]
            for place in range(counts[level], counts[level + 1]):
                _readings(columns, factor, place, leverages, r[level + 1], h[level + 1])
        left_r, left_h = r[depth], h[depth]
        if outliers == 1:
            if not _one_may_do(square, left_r, left_h, spared):
                continue
            for a in range(rows):
                if _without_one(square, left_r[a], left_h[a], weights[a]) <= limit:
                    survivors = _kept(survivors, survivor_count, numbers, a, -1)
                    survivor_count += 1
            continue
        largest = highest = 0.0
        for a in range(rows):
            largest, highest = max(largest, left_r[a] * left_r[a]), max(highest, left_h[a])
        some = 0
        for a in range(rows):
            # It is not enough beside any other reading.
            free = 1.0 - left_h[a] - highest
            if free > 1e-6 and square - (left_r[a] * left_r[a] + largest) / free > limit:
                continue
            picked[some] = a
            some += 1
        for first in range(some):
            a = picked[first]
            ra, ha = left_r[a], left_h[a]
            for second in range(first + 1, some):
                b = picked[second]
                rb, hb = left_r[b], left_h[b]
                # The smallest eigenvalue of the formula's matrix is not below this.
                free = 1.0 - ha - hb
                weight = weights[a] + weights[b]
                if free > 1e-6 and square - (ra * ra + rb * rb) / free > limit * (1.0 - weight):
                    continue
                cross = _product(basis, a, b, leverages[:, a], leverages[:, b], count)
                if _without_two(square, (ra, rb), (ha, hb), cross, weight) <= limit:
                    survivors = _kept(survivors, survivor_count, numbers, a, b)
                    survivor_count += 1
    return survivors[:survivor_count]


def surviving_sets(choices, outliers, limit, projection):
    """Return all sets (n, 5) of choices (m, 3) and `outliers` outliers whose squared bound is at most the limit."""
    return _surviving(choices, outliers, limit, projection)


@compiled_and_kept
def settle(problem, chosen_set, weights, limit):
    """Return the verdict on one set (REFUSED, ACCEPTED or UNDECIDED) and the final weights (M,).

    A problem is a matrix, the residual, the number of nominal columns, which come first, and of each candidate its
    first column and its number of columns. The chosen set is a row of five.
    """
    matrix, residual, always, starts, sizes = problem
    rows, count, positive = len(residual), always, 0
    chosen, w = np.empty(always + MOST_COLUMNS, np.int64), weights.copy()
    for q in range(always):
        chosen[q] = q
    for k in range(len(chosen_set)):
        if chosen_set[k] >= 0 and k < 3:
            first = always + starts[chosen_set[k]]
            for column in range(first, first + sizes[chosen_set[k]]):
                chosen[count] = column
                count += 1
        elif chosen_set[k] >= 0:
            w[chosen_set[k]] = 0.0
    total = 0.0
    for m in range(rows):
        total += w[m]
        positive += w[m] > 0.0
    columns, weighted, misfit = np.empty((rows, count)), np.empty((rows, count)), np.empty(rows)
    x, correction = np.empty(count), np.empty(count)
    for m in range(rows):
        w[m] /= total
        for q in range(count):
            columns[m, q] = matrix[m, chosen[q]]
    # Loops over numbers: whole arrays take numba four times as long to compile.
    for _ in range(ROUNDS):
        for m in range(rows):
            for q in range(count):
                weighted[m, q] = columns[m, q] * w[m]
        normal = weighted.T @ columns
        _solve(normal, weighted.T @ residual, x)
        # Once more with the remainder, so that the sum of squares is the least to rounding.
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
                w[m] = 0.99 * w[m] * misfit[m] / total + 0.01 / positive
    return UNDECIDED, w


def _solve(normal, right, x):
    """Solve by Cholesky's factor in place (lower triangle; a zero on the diagonal marks a dependent column)."""
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
