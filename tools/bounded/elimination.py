"""Unknowns of single positions, eliminated from a programme: what remains has the same radius and few columns."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

NEGLIGIBLE = 1e-12
"""Part of the largest coefficient below which a row does not depend on an unknown."""


def eliminated(system: NDArray[np.float64], free: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return rows without the unknowns that are free, where each of these acts on a few rows only.

    Each free unknown must lie in an interval for each of its rows. Intervals have a common point if every two of them
    have one (Helly), so two rows make one row without the unknown.

    Parameters
    ----------
    system : (M, P) array
        columns of the model, and the residual, in units of the bounds of the rows
    free : (M, K) array
        coefficients of the free unknowns

    Returns
    -------
    (R, P) array or None
        rows with the same least largest error; None if a row depends on two free unknowns, or if R would be above M
    """
    acts = np.abs(free) > NEGLIGIBLE * np.abs(free).max(initial=0.0)
    if (acts.sum(axis=1) > 1).any():
        return None
    sizes = acts.sum(axis=0)
    if (sizes * (sizes - 1) // 2).sum() > acts.any(axis=1).sum():
        return None
    pairs: list[tuple[int, int]] = []
    for unknown in acts.T:
        pairs.extend(combinations(np.flatnonzero(unknown).tolist(), 2))
    first, second = np.array(pairs, dtype=np.int64).reshape(-1, 2).T
    coefficient = free.sum(axis=1, where=acts)[:, None]
    across = system[first] * coefficient[second] - system[second] * coefficient[first]
    across /= np.abs(coefficient[first]) + np.abs(coefficient[second])
    return np.vstack((system[~acts.any(axis=1)], across))
