"""Rotation matrices, cross products and directions across others, for many vectors at once."""

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats


def rotations(turn: NDArray) -> Floats:
    """Return rotation matrices (..., 3, 3) of rotation vectors (..., 3)."""
    square = np.square(turn).sum(axis=-1)
    angle = np.sqrt(square) / np.pi
    second = 0.5 * np.sinc(0.5 * angle) ** 2
    matrix = cross_matrices(np.sinc(angle)[..., None] * turn)
    scaled = second[..., None] * turn
    for row in range(3):
        for column in range(3):
            matrix[..., row, column] += scaled[..., row] * turn[..., column]
        matrix[..., row, row] += 1.0 - second * square
    return matrix


def cross_matrices(vector: NDArray) -> Floats:
    """Return the matrices (..., 3, 3) of the cross product by vectors (..., 3)."""
    matrix = np.zeros((*vector.shape[:-1], 3, 3))
    for first, second, third in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[..., second, first] = vector[..., third]
        matrix[..., first, second] = -vector[..., third]
    return matrix


def across(direction: NDArray) -> Floats:
    """Return two unit vectors (M, 2, 3) across each direction (M, 3)."""
    least = np.eye(3)[np.argmin(np.abs(direction), axis=1)]
    first = np.cross(direction, least)
    first = first / np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(direction, first)], axis=1)


def nearest_rotation(matrix: NDArray) -> Floats:
    """Return the rotation (3, 3) nearest to a matrix: R with the largest trace of Rᵀ times it."""
    first, _, second = np.linalg.svd(matrix, full_matrices=False)
    return first @ np.diag([1.0, 1.0, np.linalg.det(first @ second)]) @ second
