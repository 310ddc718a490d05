"""Lower bounds of the Chebyshev radius of many sets of effects at once.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². With the columns
that are always there projected out once, that minimum costs a few small numbers for each set: this is what settles a
hundred thousand sets in seconds. Lawson's algorithm (weights grow where residuals are large) makes the bound sharp.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Problem:
    """A linear fit in units of the bounds, with the columns of candidate effects.

    Attributes
    ----------
    residual : (M,) array
        over the bounds
    nominal : (M, P) array
        columns that are always there
    columns : (M, C) array
        columns of all candidates
    blocks : tuple of slice
        the columns of each candidate
    """

    residual: NDArray
    nominal: NDArray
    columns: NDArray
    blocks: tuple[slice, ...]

    def columns_of(self, chosen: Sequence[int]) -> NDArray:
        """Numbers of the columns of some candidates."""
        parts = [np.arange(self.blocks[i].start, self.blocks[i].stop) for i in chosen]
        return np.concatenate(parts) if parts else np.zeros(0, dtype=int)


@dataclass(frozen=True)
class Projection:
    """A problem under weights, with the nominal columns and those of a set projected out.

    Attributes
    ----------
    weights : (M,) array
    basis : (M, p) array
        orthonormal, of the weighted columns that were projected out
    residual : (M,) array
        weighted, projected
    columns : (M, C) array
        of all candidates, weighted, projected
    """

    weights: NDArray
    basis: NDArray
    residual: NDArray
    columns: NDArray

    @property
    def square(self) -> float:
        """Squared bound of the set itself."""
        return float(self.residual @ self.residual)

    @property
    def misfit(self) -> NDArray:
        """Residuals (M,) of the weighted fit, in units of the bounds."""
        return self.residual / np.sqrt(np.maximum(self.weights, 1e-300))


def project(problem: Problem, weights: NDArray, chosen: Sequence[int] = (), *, candidates: bool = True) -> Projection:
    """Weigh the rows and project out the nominal columns and those of the chosen candidates.

    Parameters
    ----------
    problem : Problem
    weights : (M,) array
        not negative, with sum 1
    chosen : sequence of int
        the set
    candidates : bool
        whether the candidates' columns are wanted too
    """
    root = np.sqrt(weights)
    taken = root[:, None] * np.hstack((problem.nominal, problem.columns[:, problem.columns_of(chosen)]))
    size = np.linalg.norm(taken, axis=0)
    taken = taken / np.where(size > 0.0, size, 1.0)
    basis, values, _ = np.linalg.svd(taken, full_matrices=False)
    basis = basis[:, values > 1e-9 * values.max(initial=0.0)]
    residual = root * problem.residual
    residual = residual - basis @ (basis.T @ residual)
    columns = np.zeros((len(root), 0))
    if candidates:
        columns = root[:, None] * problem.columns
        before = np.linalg.norm(columns, axis=0)
        columns = columns - basis @ (basis.T @ columns)
        columns[:, np.linalg.norm(columns, axis=0) < 1e-7 * before] = 0.0
    return Projection(weights, basis, residual, columns)


def squares_with_one_more(projection: Projection, problem: Problem, others: Sequence[int]) -> NDArray:
    """Squared bounds (n,) of the sets that add one of `others`; candidates with equally many columns together."""
    found = np.zeros(len(others))
    sizes = np.array([problem.blocks[index].stop - problem.blocks[index].start for index in others], dtype=int)
    for size in np.unique(sizes).tolist():
        at = np.flatnonzero(sizes == size)
        index = np.array([problem.blocks[others[int(i)]].start for i in at])[:, None] + np.arange(size)
        columns = projection.columns[:, index]
        gram = np.einsum("mij,mik->ijk", columns, columns)
        product = np.einsum("mij,m->ij", columns, projection.residual)
        found[at] = projection.square - gained(gram, product)
    return np.maximum(found, 0.0)


def gained(gram: NDArray, product: NDArray) -> NDArray:
    """What least squares takes off (n,): product' gram⁻¹ product, for stacks (n, k, k) and (n, k), singular or not."""
    size = np.sqrt(np.diagonal(gram, axis1=-2, axis2=-1))
    size = np.where(size > 0.0, size, np.inf)
    scaled = gram / size[:, :, None] / size[:, None, :]
    right = product / size
    if gram.shape[-1] == 1:
        return right[:, 0] ** 2
    inverse = np.linalg.pinv(scaled, rcond=1e-9, hermitian=True)
    return np.einsum("ni,nij,nj->n", right, inverse, right)


def squares_without_one(projection: Projection) -> NDArray:
    """Squared bounds (M,) when one reading is left out, its weight spread over the others."""
    left = 1.0 - np.sum(projection.basis**2, axis=1)
    taken = np.where(left > 1e-9, projection.residual**2 / np.maximum(left, 1e-9), projection.square)
    return np.maximum(projection.square - taken, 0.0) / np.maximum(1.0 - projection.weights, 1e-9)


def squares_without_two(projection: Projection) -> NDArray:
    """Squared bounds (M, M) when two readings are left out; the diagonal is infinite."""
    cross = -(projection.basis @ projection.basis.T)
    left = 1.0 + np.diagonal(cross)
    r = projection.residual
    determinant = left[:, None] * left[None, :] - cross**2
    quadratic = left[None, :] * (r**2)[:, None] + left[:, None] * (r**2)[None, :] - 2.0 * cross * np.outer(r, r)
    taken = np.where(determinant > 1e-9, quadratic / np.maximum(determinant, 1e-9), projection.square)
    rest = 1.0 - projection.weights[:, None] - projection.weights[None, :]
    found = np.maximum(projection.square - taken, 0.0) / np.maximum(rest, 1e-9)
    np.fill_diagonal(found, np.inf)
    return found


def sharpened(weights: NDArray, misfit: NDArray) -> NDArray:
    """Lawson's update: weights grow where the misfit is large; none vanishes for good."""
    grown = weights * np.abs(misfit)
    total = grown.sum()
    if not total > 0.0:
        return weights
    return 0.99 * grown / total + 0.01 / len(weights)


def sharp_weights(problem: Problem, weights: NDArray, chosen: Sequence[int], rounds: int) -> NDArray:
    """Weights after some rounds for one set."""
    for _ in range(rounds):
        weights = sharpened(weights, project(problem, weights, chosen, candidates=False).misfit)
    return weights


def is_refused(problem: Problem, weights: NDArray, chosen: Sequence[int], deleted: Sequence[int], limit: float) -> bool:
    """Whether some rounds of Lawson's algorithm prove that the squared radius of a set is above `limit`.

    Parameters
    ----------
    problem : Problem
    weights : (M,) array
        to begin with
    chosen : sequence of int
        the effects of the set
    deleted : sequence of int
        readings that it leaves out
    limit : float
        squared
    """
    kept = np.setdiff1d(np.arange(len(weights)), deleted)
    part = Problem(problem.residual[kept], problem.nominal[kept], problem.columns[kept], problem.blocks)
    weights = weights[kept] / weights[kept].sum()
    for _ in range(ROUNDS):
        projection = project(part, weights, chosen, candidates=False)
        if projection.square > limit:
            return True
        if np.abs(projection.misfit).max() <= 1.0:
            return False
        weights = sharpened(weights, projection.misfit)
    return False


ROUNDS = 25
"""Rounds of Lawson's algorithm before a set is handed to the exact judge."""
