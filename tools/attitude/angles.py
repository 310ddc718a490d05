"""Errors between computed and true attitudes: in the Euler-Krylov angles ψ, ϑ, γ, and as one angle."""

import math

import numpy as np
from scipy.spatial.transform import Rotation


def angle_errors(attitudes: np.ndarray, angles: np.ndarray, normalised: bool) -> np.ndarray:
    """Largest errors of ψ, ϑ, γ [rad].

    Parameters
    ----------
    attitudes : ndarray, shape (N, 4)
        computed quaternions, scalar first
    angles : ndarray, shape (N, 3)
        true angles
    normalised : bool
        whether the quaternions are brought to the unit sphere before the angles are taken. The formulas are those of
        the paper, C11 = 2(λ0² + λ1²) - 1 and so on, which hold on it.

    Returns
    -------
    ndarray, shape (3,)
    """
    l0, l1, l2, l3 = attitudes.T / np.linalg.norm(attitudes, axis=1) if normalised else attitudes.T
    c11, c22 = 2.0 * (l0 * l0 + l1 * l1) - 1.0, 2.0 * (l0 * l0 + l2 * l2) - 1.0
    c31, c23, c21 = 2.0 * (l1 * l3 - l0 * l2), 2.0 * (l2 * l3 - l0 * l1), 2.0 * (l1 * l2 + l0 * l3)
    found = np.column_stack((np.arctan2(-c31, c11), np.arctan2(c21, np.hypot(c11, c31)), np.arctan2(-c23, c22)))
    apart = np.abs(found - angles)
    return np.minimum(apart, np.abs(apart - 2.0 * math.pi)).max(axis=0)


def attitudes_of_angles(angles: np.ndarray) -> np.ndarray:
    """Quaternions (N, 4), scalar first, of the angles ψ, ϑ, γ (N, 3): about the second, then third, then first axis."""
    return np.roll(Rotation.from_euler("YZX", angles).as_quat(), 1, axis=-1)


def angle_between(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Angles (N,) between the attitudes of quaternions (N, 4), whatever their norms [rad]; right for small angles."""
    scalar = (p * q).sum(axis=1)
    vector = p[:, :1] * q[:, 1:] - q[:, :1] * p[:, 1:] - np.cross(p[:, 1:], q[:, 1:])
    return 2.0 * np.arctan2(np.linalg.norm(vector, axis=1), np.abs(scalar))
