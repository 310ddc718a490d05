"""The quietest dual: of all that satisfy what is asked, the one whose |F'y| is least in the mean square.

A vertex of the dual programme touches ±1 at as many positions as it can and exceeds it beside them; the quietest dual
touches where it must.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

RANK = 1e-9
DEAF = 1e-6
"""An inequality that the equations leave so little freedom is not asked for, unless it is broken by as much."""


def quietest(metric: NDArray, rows: NDArray, values: NDArray, slopes: NDArray, most: NDArray) -> NDArray | None:
    """y (P,) of least |L'y| with rows·y = values and slopes·y ≤ most; None when there is none.

    Least distance programming in the null space of the equations (Lawson and Hanson 1974, chapter 23).

    Parameters
    ----------
    metric : (P, P) array
        lower triangular L
    rows, values : (K, P), (K,) array
    slopes, most : (M, P), (M,) array
    """
    inverse = np.linalg.inv(metric)
    base, free = np.zeros(len(metric)), np.eye(len(metric))
    if len(rows):
        left, singular, right = np.linalg.svd(rows @ inverse.T, full_matrices=True)
        rank = int((singular > RANK * singular[0]).sum())
        base = right[:rank].T @ ((left.T @ values)[:rank] / singular[:rank])
        free = right[rank:].T
    scaled = slopes @ inverse.T
    excess = scaled @ base - most
    if (excess <= 0.0).all():
        return inverse.T @ base
    moves = scaled @ free
    size = np.linalg.norm(moves, axis=1)
    heard = size > DEAF
    if (excess[~heard] > DEAF).any() or not heard.any():
        return None
    stacked = np.vstack([-moves[heard].T, excess[heard]]) / size[heard]
    aim = np.zeros(len(stacked))
    aim[-1] = 1.0
    try:
        weights, _ = nnls(stacked, aim, maxiter=50 * len(stacked))
    except RuntimeError:
        return None
    rest = stacked @ weights - aim
    if -rest[-1] < RANK:
        return None
    return inverse.T @ (base - free @ (rest[:-1] / rest[-1]))
