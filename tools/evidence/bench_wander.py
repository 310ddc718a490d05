"""A bias that wanders with time: proven only where the errors vary least as a function of time.

A function of time with enough knots explains any fault of one accelerometer. The variation shows that the errors depend
on time. It is the least sum of changes, from row to row in the order of a quantity, that makes the model consistent.
Time is proven where its order gives far less variation than the order of any other quantity, and than random orders.
The search decides whether other sets of effects do as well.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import bmat, csc_matrix, identity

from ...models.arrays import Floats, Ints
from ...models.effects import EffectPlace, Rows
from ...models.effects.definition import ACCELEROMETERS
from ..bounded.programmes import SolverError, any_centre, linear_programme, solved, solver
from ..bounded.work import Work
from .bench_visits import signature_columns
from .fit import Fit

ROWS_PER_KNOT = 2
"""A function of more knots than rows over this says nothing."""
FAR_LESS = 0.7
"""Ratio of the variation in the order of time to that of any other quantity."""
SHUFFLES, AS_GOOD = 19, 1
"""Number of orders that are drawn at random, and the most of them that may vary as little as the order of time."""
DIGITS = 6
"""Decimals of a knot [h]."""
TURN = 2.0 * np.pi


def wanders(centre: Fit, rows: Rows, limit: float, work: Work, *, proven: bool) -> Iterator[EffectPlace]:
    """Yield the wanders that mend the model linear at a centre, each with the fewest knots.

    A wander mends it with a radius up to the limit. With `proven`, the errors must also be proven to depend on time.
    The cost is added to the work.
    """

    every = np.arange(len(centre.residual))

    def stands(columns: Floats, rows: Ints = every) -> bool:
        matrix = (np.hstack((centre.jacobian, columns)) / centre.bound[:, None])[rows]
        work.programme(*matrix.shape)
        try:
            return any_centre(matrix, (centre.residual / centre.bound)[rows], np.ones(len(rows)))[0] <= limit
        except SolverError:
            # A set that was not tried is not refused.
            return True

    for p, where in enumerate(ACCELEROMETERS):
        # A function that is free at every reading of an accelerometer equals the model without its readings.
        if not stands(centre.jacobian[:, :0], every[every % 3 != p]):
            continue
        if proven and not _is_time(centre, rows, p, work):
            continue
        for knots in range(3, len(rows.hours) // ROWS_PER_KNOT + 1):
            wander = EffectPlace("bias-wander", where, law=straight(rows.hours, knots))
            if stands(signature_columns([wander], rows)):
                yield wander
                break


def _free(p: int, count: int) -> Floats:
    """Columns (3 N, N), one for each reading of an accelerometer."""
    free = np.zeros((count, 3, count))
    free[np.arange(count), p, np.arange(count)] = 1.0
    return free.reshape(3 * count, count)


def _is_time(centre: Fit, rows: Rows, p: int, work: Work) -> bool:
    """Return whether the errors of an accelerometer vary far less with time than with any other quantity."""
    count = len(rows.hours)
    of_time = least_variation(centre, p, np.argsort(rows.hours, kind="stable"), work)
    for k in range(3):
        if of_time > FAR_LESS * least_variation(centre, p, np.argsort(rows.n[:, k], kind="stable"), work):
            return False
    for angle in (rows.alpha, rows.beta):
        order = np.argsort(angle % TURN, kind="stable")
        if of_time > FAR_LESS * least_variation(centre, p, np.append(order, order[0]), work):
            return False
    rng, as_good = np.random.default_rng(count), 0
    for _ in range(SHUFFLES):
        as_good += least_variation(centre, p, rng.permutation(count), work) <= of_time
        if as_good > AS_GOOD:
            return False
    return True


def least_variation(centre: Fit, p: int, order: Ints, work: Work) -> float:
    """Return the least total variation of an addition (n,) to an accelerometer that makes the model consistent.

    The value is in units of the bounds, by the model linear at a centre; infinite where no addition does.
    """
    jacobian, residual = centre.jacobian / centre.bound[:, None], centre.residual / centre.bound
    scale = np.abs(jacobian).max(axis=0, initial=0.0)
    scale[scale == 0.0] = 1.0
    bench, count, steps = jacobian.shape[1], len(residual) // 3, len(order) - 1
    ones = np.ones(steps)
    changes = csc_matrix(
        (np.concatenate((ones, -ones)), (np.tile(np.arange(steps), 2), np.concatenate((order[1:], order[:-1])))),
        shape=(steps, count),
    )
    step_sizes = identity(steps)
    matrix = bmat(
        [[csc_matrix(jacobian / scale), csc_matrix(_free(p, count)), None],
         [None, changes, -step_sizes], [None, -changes, -step_sizes]]
    ).tocsc()  # fmt: skip
    matrix.sort_indices()
    free, many = np.full(bench + count, np.inf), np.full(2 * steps, np.inf)
    work.programme(len(residual) + 2 * steps, bench + count + steps)
    highs = solver()
    highs.passModel(
        linear_programme(
            np.concatenate((np.zeros(bench + count), ones)),
            (np.concatenate((-free, np.zeros(steps))), np.concatenate((free, np.full(steps, np.inf)))),
            (matrix.indptr, matrix.indices, matrix.data),
            (np.concatenate((residual - 1.0, -many)), np.concatenate((residual + 1.0, np.zeros(2 * steps)))),
        )
    )
    try:
        return float(np.sum(solved(highs).col_value[bench + count :]))
    except SolverError:
        return np.inf


def straight(hours: Floats, knots: int) -> str:
    """The law of a function of time (N,) with knots at equal distances over a record."""
    places = np.round(np.linspace(hours.min(), hours.max(), knots), DIGITS)
    return f"hours at {' '.join(repr(float(value)) for value in places)}"
