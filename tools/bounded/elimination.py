"""Unknowns of single positions or rests, eliminated from a programme: what remains has few columns."""

from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solveh_banded

from ...models.arrays import Floats, Ints
from .programmes import IMITATED
from .set_bounds import ACCEPTED, REFUSED, ROUNDS, UNDECIDED
from .sets import sharpened

WIDEST = 8
"""Most unknowns next to each other on which a row may depend."""
NEGLIGIBLE = 1e-12
"""Part of the largest coefficient below which a row does not depend on an unknown."""


def eliminated(system: Floats, free: Floats) -> Floats | None:
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


def settled_beside(system: Floats, free: Floats, weights: NDArray, limit: float) -> int:
    """Return the verdict (REFUSED, ACCEPTED, UNDECIDED) on a model with free unknowns, in order as of rests in time.

    Each row depends on a few unknowns next to each other, so their normal equations are a narrow band. Their cost grows
    like the number of rows. `system` and `free` are as for `eliminated`, `weights` (M,) are those of the first bound,
    and the radius may be up to the limit.
    """
    acts = np.abs(free) > NEGLIGIBLE * np.abs(free).max(initial=0.0)
    count = free.shape[1]
    first = np.where(acts.any(axis=1), acts.argmax(axis=1), 0)
    width = int(np.where(acts.any(axis=1), count - acts[:, ::-1].argmax(axis=1) - first, 1).max(initial=1))
    if width > WIDEST or not acts.any(axis=0).all():
        return UNDECIDED
    first = np.minimum(first, count - width)
    numbers = first[:, None] + np.arange(width)
    coefficients = np.take_along_axis(free, numbers, axis=1)
    for _ in range(ROUNDS):
        root = np.sqrt(weights)[:, None]
        try:
            within = _without_band(root * system, root * coefficients, numbers, count)
        except np.linalg.LinAlgError:
            return UNDECIDED
        misfit = np.abs(within) / root[:, 0]
        if within @ within > limit**2:
            return REFUSED
        if misfit.max() <= limit:
            return ACCEPTED
        weights = sharpened(weights, misfit)
    return UNDECIDED


def _without_band(system: Floats, coefficients: Floats, numbers: Ints, count: int) -> Floats:
    """Return the least-squares residual (M,) of the last column of a system (M, P) beside the others and unknowns.

    Row m depends on the unknowns `numbers` (M, w), of `count`, by its `coefficients` (M, w).
    """
    width = numbers.shape[1]
    band = np.zeros((width, count))
    for k in range(width):
        products = coefficients[:, : width - k] * coefficients[:, k:]
        band[k] = np.bincount(numbers[:, : width - k].ravel(), products.ravel(), count)
    remaining = system
    # Once more with the remainder, so that the sum of squares is the least to rounding.
    for _ in range(2):
        right = np.empty((count, system.shape[1]))
        for column in range(system.shape[1]):
            products = coefficients * remaining[:, column, None]
            right[:, column] = np.bincount(numbers.ravel(), products.ravel(), count)
        at_unknowns = solveh_banded(band, right, lower=True)
        remaining = remaining - np.einsum("mw,mwp->mp", coefficients, at_unknowns[numbers])
    model, size = remaining[:, :-1], np.linalg.norm(system[:, :-1], axis=0)
    model = model / np.where(size > 0.0, size, 1.0)
    basis, values, _ = np.linalg.svd(model, full_matrices=False)
    basis = basis[:, values > IMITATED]
    return remaining[:, -1] - basis @ (basis.T @ remaining[:, -1])
