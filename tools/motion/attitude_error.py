"""Errors between computed and true attitudes: as one angle, as angles of one kind or another, and over time.

Quaternions are scalar first, body to reference.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar
from scipy.spatial.transform import Rotation

from ..errors import InputError

FEWEST_PERIODS = 4
"""A period that is looked for is at most this part of the run."""

STRONG = 0.1
"""A line of the spectrum counts as a harmonic of the motion from this part of the strongest on."""


def rotation_of(quaternion: np.ndarray) -> Rotation:
    """Rotations of quaternions (N, 4), scalar first."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1))


def attitude_error(computed: np.ndarray, true: np.ndarray) -> np.ndarray:
    """Rotation vectors that turn the true attitudes into the computed ones, components in the reference frame.

    Parameters
    ----------
    computed, true : ndarray, shape (N, 4)
        unit quaternions, scalar first, body to reference

    Returns
    -------
    ndarray, shape (N, 3)
        [rad], length within [0, π]
    """
    if len(computed) == 0:
        return np.zeros((0, 3))
    return (rotation_of(computed) * rotation_of(true).inv()).as_rotvec()


def heading_and_tilt(error: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Split error rotations into the turn about the reference's third axis and the tilt of that axis.

    Parameters
    ----------
    error : ndarray, shape (N, 3)
        rotation vectors, components in the reference frame [rad]

    Returns
    -------
    heading : ndarray, shape (N,)
        turn about the third axis, within [-π, π] [rad]
    tilt : ndarray, shape (N,)
        angle between the third axis and where the error takes it [rad]; rotation = tilt after heading, exactly
    """
    if len(error) == 0:
        return np.zeros(0), np.zeros(0)
    x, y, z, w = Rotation.from_rotvec(error).as_quat().T
    heading = 2.0 * np.arctan2(z, w)
    tilt = 2.0 * np.arctan2(np.hypot(x, y), np.hypot(w, z))
    return np.arctan2(np.sin(heading), np.cos(heading)), tilt


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


@dataclass(frozen=True, eq=False)
class ErrorSplit:
    """The parts of an error, slow + periodic = error.

    Attributes
    ----------
    period : float
        over which the slow part is averaged [s]
    slow, periodic : ndarray, shape (N, K)
        in the unit of the error
    rate : ndarray, shape (K,)
        drift: slope of the best line through the slow part, per second
    amplitude : ndarray, shape (K,)
        largest size of the periodic part
    """

    period: float
    slow: np.ndarray
    periodic: np.ndarray
    rate: np.ndarray
    amplitude: np.ndarray


def split_error(time_s: np.ndarray, error: np.ndarray, period: float | None = None) -> ErrorSplit:
    """Split an error as Chelnokov et al. 2016, section 3.1.1, describe theirs.

    The slow part is the mean over one whole period around each moment, so that what repeats with the motion drops out
    of it; half a period from the ends it goes on with the drift.

    Parameters
    ----------
    time_s : ndarray, shape (N,)
        growing [s]
    error : ndarray, shape (N,) or (N, K)
        of one or several components
    period : float or None
        of the motion [s]; None: the longest strong one in the error's spectrum

    Raises
    ------
    InputError
        fewer than eight errors, a number that is not finite, or a run of less than two periods
    """
    time = np.asarray(time_s, dtype=np.float64)
    values = np.asarray(error, dtype=np.float64).reshape(len(time), -1)
    if len(time) < 8 or not (np.isfinite(time).all() and np.isfinite(values).all() and (np.diff(time) > 0.0).all()):
        raise InputError("an error is split from at least eight finite values at growing times")
    span = float(time[-1] - time[0])
    if period is None:
        period = found_period(time, values)
    if not (np.isfinite(period) and 0.0 < 2.0 * period <= span):
        raise InputError(f"a run of {span:g} s is shorter than two periods of {period:g} s: its drift cannot be told")
    total = CubicSpline(time, values).antiderivative()
    half = 0.5 * period
    inside = np.clip(time, time[0] + half, time[-1] - half)
    slow = (total(inside + half) - total(inside - half)) / period
    interior = (time >= time[0] + half) & (time <= time[-1] - half)
    rate = _slope(time[interior], slow[interior])
    slow = slow + np.outer(time - inside, rate)
    periodic = values - slow
    return ErrorSplit(period, slow, periodic, rate, np.abs(periodic).max(axis=0))


def found_period(time_s: np.ndarray, error: np.ndarray) -> float:
    """Longest strong period in an error whose best line is taken out [s].

    Parameters
    ----------
    time_s : ndarray, shape (N,)
    error : ndarray, shape (N, K)

    Returns
    -------
    float
        at most a quarter of the run; the quarter itself where nothing is periodic
    """
    span = float(time_s[-1] - time_s[0])
    grid = np.linspace(time_s[0], time_s[-1], len(time_s))
    even = CubicSpline(time_s, error)(grid)
    rest = even - even.mean(axis=0) - np.outer(grid - grid.mean(), _slope(grid, even))
    window = np.hanning(len(grid))[:, None]
    power = np.sqrt((np.abs(np.fft.rfft(window * rest, axis=0)) ** 2).sum(axis=1))
    power[:FEWEST_PERIODS] = 0.0
    if not power.max() > 0.0:
        return span / FEWEST_PERIODS
    strong = np.flatnonzero(power >= STRONG * power.max())
    # A line of the windowed spectrum is three bins wide: the strongest of the first group is the period's.
    first = strong[0]
    peak = first + int(np.argmax(power[first : first + 3]))
    return _refined_period(grid, rest, span / peak, span)


def _refined_period(time: np.ndarray, rest: np.ndarray, period: float, span: float) -> float:
    """The period near a line of the spectrum whose sine and cosine take most out of the error."""
    window = np.hanning(len(time))[:, None] * rest

    def left(frequency: float) -> float:
        wave = np.exp(-2j * np.pi * frequency * (time - time[0]))
        return -float((np.abs(wave @ window) ** 2).sum())

    near = (1.0 / period - 0.6 / span, 1.0 / period + 0.6 / span)
    best = minimize_scalar(left, bounds=near, method="bounded", options={"xatol": 1e-6 / span})
    return 1.0 / float(best.x)  # type: ignore[attr-defined]


def _slope(time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Slopes (K,) of the best lines through values (N, K)."""
    moved = time - time.mean()
    return moved @ values / (moved @ moved)
