"""Spaces that columns span: least squares, likeness, what cannot be told apart."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

DETERMINED = 1e-8
"""Directions whose singular value is below this part of the largest are not determined."""
SAME_SPACE = 1e-7
"""Largest sine of an angle between two spaces that are called the same."""
IMITATED = 1e-7
"""Columns of which so little is left, relatively, are imitated."""
DEPENDENT = 1e-9
"""A direction of columns, each of size one, that is so small is none."""


def least_squares(matrix: NDArray, target: NDArray) -> NDArray[np.float64]:
    """The x (n,) of least sum of squares of target - matrix x; directions that are not determined stay at zero.

    Parameters
    ----------
    matrix : (M, n) array
        the units of its columns do not matter
    target : (M,) array
    """
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0.0] = 1.0
    u, values, directions = np.linalg.svd(matrix / size, full_matrices=False)
    kept = values > DETERMINED * values.max(initial=0.0)
    return (directions[kept].T @ ((u[:, kept].T @ target) / values[kept])) / size


def column_space(columns: NDArray) -> NDArray[np.float64]:
    """Orthonormal basis of the space that columns span; their units do not matter."""
    size = np.linalg.norm(columns, axis=0)
    u, values, _ = np.linalg.svd(columns / np.where(size > 0.0, size, 1.0), full_matrices=False)
    return u[:, values > DEPENDENT * values.max(initial=0.0)] if values.max(initial=0.0) > 0.0 else u[:, :0]


def spaces_beyond(imitated: NDArray, blocks: Sequence[NDArray]) -> list[NDArray[np.float64]]:
    """What blocks of columns (M, k) add to the space of other columns (M, P), as orthonormal columns."""
    base = column_space(imitated)
    spaces = []
    for block in blocks:
        left = block - base @ (base.T @ block)
        left[:, np.linalg.norm(left, axis=0) < IMITATED * np.linalg.norm(block, axis=0)] = 0.0
        spaces.append(column_space(left))
    return spaces


def same_space(a: NDArray, b: NDArray) -> bool:
    """Whether two orthonormal bases span the same space."""
    return a.shape == b.shape and float(np.linalg.norm(a - b @ (b.T @ a), 2)) < SAME_SPACE


def cosine(a: NDArray, b: NDArray) -> float:
    """Cosine of the least angle between the spaces of two orthonormal bases; 0 where one is empty."""
    return min(1.0, float(np.linalg.norm(a.T @ b, 2))) if a.shape[1] and b.shape[1] else 0.0


def spread_directions(count: int, steps: int) -> list[NDArray[np.float64]]:
    """Unit vectors (count,) spread over all directions; of opposite ones one is enough."""
    if count == 1:
        return [np.ones(1)]
    if count == 2:
        angles = math.pi * np.arange(steps) / steps
        return [np.array([math.cos(angle), math.sin(angle)]) for angle in angles]
    vectors = np.random.default_rng(0).normal(size=(4 * steps, count))
    return list(vectors / np.linalg.norm(vectors, axis=1, keepdims=True))
