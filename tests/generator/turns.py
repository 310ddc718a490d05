"""Turns of frames: matrices, rotation vectors, quaternions."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

FINE = 8
"""Steps of an attitude from one row to the next."""


def about(axis: int, angle: ArrayLike) -> np.ndarray:
    """Return direction cosines (..., 3, 3) of a frame turned about one of its axes, 0 to 2."""
    angle = np.asarray(angle, dtype=float)
    first, second = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., first, first] = matrix[..., second, second] = np.cos(angle)
    matrix[..., first, second] = np.sin(angle)
    matrix[..., second, first] = -np.sin(angle)
    return matrix


def turned(vector: ArrayLike) -> np.ndarray:
    """Return direction cosines (..., 3, 3) of a frame turned by rotation vectors (..., 3)."""
    vector = np.asarray(vector, dtype=float)
    size = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = np.zeros((*vector.shape, 3))
    cross[..., 0, 1] = vector[..., 2]
    cross[..., 0, 2] = -vector[..., 1]
    cross[..., 1, 2] = vector[..., 0]
    cross -= np.swapaxes(cross, -1, -2)
    divisor = np.where(size > 0.0, size, 1.0)
    return np.eye(3) + np.sin(size) / divisor * cross + (1.0 - np.cos(size)) / divisor**2 * (cross @ cross)


def rotation_vectors(matrix: np.ndarray) -> np.ndarray:
    """Return rotation vectors (..., 3) of direction cosines (..., 3, 3), less than half a turn each."""
    odd = np.stack(
        [
            matrix[..., 1, 2] - matrix[..., 2, 1],
            matrix[..., 2, 0] - matrix[..., 0, 2],
            matrix[..., 0, 1] - matrix[..., 1, 0],
        ],
        axis=-1,
    )
    sine = 0.5 * np.linalg.norm(odd, axis=-1)
    cosine = 0.5 * (np.trace(matrix, axis1=-2, axis2=-1) - 1.0)
    ratio = np.where(sine > 1e-12, np.arctan2(sine, cosine) / np.where(sine > 0.0, sine, 1.0), 1.0)
    return 0.5 * odd * ratio[..., None]


def attitudes(rate: Callable[[np.ndarray], np.ndarray], count: int, period: float) -> np.ndarray:
    """Return quaternions (N, 4), body to reference, of true rates [rad/s]; midpoints of eight steps in each
    interval."""
    times = period * (np.arange((count - 1) * FINE) + 0.5) / FINE
    steps = rate(times) * period / FINE
    turning = turned_by(np.vstack([np.zeros(3), steps]))
    return np.roll(turning[::FINE].as_quat(), 1, axis=1)


def up_in_body(quaternion: np.ndarray) -> np.ndarray:
    """Return the reference's third axis (N, 3) in the body."""
    w, x, y, z = quaternion.T
    return np.stack((2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)), axis=1)


def turned_by(steps: np.ndarray) -> Rotation:
    """Return attitudes (N,) of a block that begins level and is turned by rotation vectors (N, 3) one after the
    other."""
    attitude, span = Rotation.from_rotvec(steps), 1
    # Products of 1, 2, 4, ... neighbours keep the order of the factors.
    while span < len(steps):
        attitude = Rotation.concatenate([attitude[:span], attitude[:-span] * attitude[span:]])
        span *= 2
    return attitude
