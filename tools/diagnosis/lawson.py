"""Lower bounds of the Chebyshev radius of a linear fit, by weighted least squares.

For weights w ≥ 0 with sum 1 and rows in units of their bounds, radius² ≥ min over x of Σ w (r - J x)². With the
columns that are always there projected out once, that minimum costs a few small numbers for each set of further
columns: this is what settles a hundred thousand sets in seconds. Lawson's algorithm (weights grow where residuals are
large) makes the bound sharp.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

DEPENDENT = 1e-9
"""A column whose norm shrinks by this factor in a projection is called dependent."""


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

    @property
    def starts(self) -> NDArray:
        """First columns (n,) of the candidates."""
        return np.array([block.start for block in self.blocks], dtype=np.int64)

    @property
    def sizes(self) -> NDArray:
        """Numbers of columns (n,) of the candidates."""
        return np.array([block.stop - block.start for block in self.blocks], dtype=np.int64)

    @cached_property
    def matrix(self) -> NDArray:
        """All columns (M, P + C): the nominal ones first."""
        return np.ascontiguousarray(np.hstack((self.nominal, self.columns)))


@dataclass(frozen=True)
class Projection:
    """A problem under weights, with the nominal columns projected out.

    Attributes
    ----------
    weights : (M,) array
    basis : (M, p) array
        orthonormal, of the weighted nominal columns
    residual : (M,) array
        weighted, projected
    columns : (M, C) array
        of all candidates, weighted, projected
    gram : (C, C) array
        their products with each other
    product : (C,) array
        their products with the residual
    """

    weights: NDArray
    basis: NDArray
    residual: NDArray
    columns: NDArray
    gram: NDArray
    product: NDArray

    @property
    def square(self) -> float:
        """Squared bound of the nominal model alone."""
        return float(self.residual @ self.residual)


def project(problem: Problem, weights: NDArray) -> Projection:
    """Weigh the rows and project out the nominal columns.

    Parameters
    ----------
    problem : Problem
    weights : (M,) array
        not negative, with sum 1
    """
    root = np.sqrt(weights)
    basis, residual = without_nominal(problem, root)
    columns = root[:, None] * problem.columns
    before = np.linalg.norm(columns, axis=0)
    columns = columns - basis @ (basis.T @ columns)
    columns[:, np.linalg.norm(columns, axis=0) < 1e-7 * before] = 0.0
    return Projection(weights, basis, residual, columns, columns.T @ columns, columns.T @ residual)


def without_nominal(problem: Problem, root: NDArray) -> tuple[NDArray, NDArray]:
    """Basis (M, p) of the nominal columns and the residual (M,) without them, rows multiplied by `root` (M,)."""
    basis = weighted_basis(problem.nominal, root)
    residual = root * problem.residual
    return basis, residual - basis @ (basis.T @ residual)


def weighted_basis(columns: NDArray, root: NDArray) -> NDArray:
    """Orthonormal basis (M, p) of columns whose rows are multiplied by `root` (M,)."""
    taken = root[:, None] * columns
    size = np.linalg.norm(taken, axis=0)
    basis, values, _ = np.linalg.svd(taken / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return np.ascontiguousarray(basis[:, values > DEPENDENT * values.max(initial=0.0)])


def sharpened(weights: NDArray, misfit: NDArray) -> NDArray:
    """Lawson's update: weights grow where the misfit is large; none vanishes for good."""
    grown = weights * np.abs(misfit)
    total = grown.sum()
    if not total > 0.0:
        return weights
    return 0.99 * grown / total + 0.01 / len(weights)


def sharp_weights(problem: Problem, weights: NDArray, rounds: int) -> NDArray:
    """Weights after some rounds for the nominal model alone."""
    for _ in range(rounds):
        root = np.sqrt(np.maximum(weights, 1e-300))
        weights = sharpened(weights, without_nominal(problem, root)[1] / root)
    return weights
