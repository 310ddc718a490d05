"""Simulated strapdown records: a block moved by hand from rest to rest, with known errors."""

from itertools import pairwise

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.tools.records import StrapdownRecord

G = 9.80665
PERIOD = 0.01
POSES = np.array(
    [
        *(sign * row for row in np.eye(3) for sign in (1.0, -1.0)),
        *np.array([[1, 1, 0], [1, 0, 1], [0, 1, 1], [-1, 1, 0], [-1, 0, 1], [0, -1, 1], [1, 1, -1], [-1, -1, 1]])
        / np.sqrt([[2], [2], [2], [2], [2], [2], [3], [3]]),
    ]
)
"""Directions of the vertical in the block."""


def true_motion(poses: np.ndarray = POSES, rest: float = 3.0, move: float = 1.5, period: float = PERIOD):
    """Times (N,), rates (N, 3) [rad/s] and inputs (N, 3) [g]: smooth turns between rests."""
    rates, inputs = [], []
    still = round(rest / period)
    for k, (before, after) in enumerate(pairwise(poses)):
        rates.append(np.zeros((still, 3)))
        inputs.append(np.tile(before, (still, 1)))
        axis = np.cross(before, after)
        if np.linalg.norm(axis) < 1e-9:
            axis = np.cross(before, np.roll(before, 1) + np.array([0.3, 0.1, -0.2]))
        axis = -axis / np.linalg.norm(axis)
        angle = np.arccos(np.clip(before @ after, -1.0, 1.0))
        s = (np.arange(round(move / period)) + 0.5) * period / move
        turn = angle * (s - np.sin(2.0 * np.pi * s) / (2.0 * np.pi))
        speed = angle / move * (1.0 - np.cos(2.0 * np.pi * s))
        # The block also turns about the vertical, by half a turn at most, first.
        spin = (0.5 + 0.4 * (k % 3)) * np.sin(2.0 * np.pi * s)
        vertical = Rotation.from_rotvec(-turn[:, None] * axis).apply(before)
        rates.append(speed[:, None] * axis + spin[:, None] * vertical)
        inputs.append(vertical)
    rate = np.vstack([*rates, np.zeros((still, 3))])
    n = np.vstack([*inputs, np.tile(poses[-1], (still, 1))])
    return period * np.arange(1, len(rate) + 1), rate, n


def strapdown_record(
    motion=None,
    *,
    seed: int = 0,
    gamma: np.ndarray | None = None,
    bias_g: np.ndarray | None = None,
    gyro_bias: np.ndarray | None = None,
    drift: np.ndarray | None = None,
    sensitivity: np.ndarray | None = None,
    force_noise: float = 0.03,
    rate_noise: float = 1e-3,
    **more,
) -> StrapdownRecord:
    """A record of a motion: Γ and b [g] of the accelerometers, bias [rad/s], drift [rad/s/h] and G [rad/s/g]."""
    time, rate, n = true_motion() if motion is None else motion
    rng = np.random.default_rng(seed)
    reading = n @ (np.eye(3) + (np.zeros((3, 3)) if gamma is None else gamma)).T
    reading = G * (reading + (np.zeros(3) if bias_g is None else bias_g)) + force_noise * rng.standard_normal(n.shape)
    measured = rate + (np.zeros(3) if gyro_bias is None else gyro_bias) + rate_noise * rng.standard_normal(n.shape)
    if drift is not None:
        measured = measured + time[:, None] / 3600.0 * drift
    if sensitivity is not None:
        measured = measured + n @ sensitivity.T
    return StrapdownRecord(time_s=time, rate=measured, increment=None, specific_force=reading, **more)


def turned_by(steps: np.ndarray) -> Rotation:
    """Attitudes (N,) of a block that begins level and is turned by rotation vectors (N, 3) one after the other."""
    attitude, span = Rotation.from_rotvec(steps), 1
    # Products of 1, 2, 4, ... neighbours: the order of the factors stays.
    while span < len(steps):
        attitude = Rotation.concatenate([attitude[:span], attitude[:-span] * attitude[span:]])
        span *= 2
    return attitude


def drawn_motion(rng: np.random.Generator, moves: int = 16, rest: float = 4.0, period: float = PERIOD):
    """Times, rates and inputs as of `true_motion`, and attitudes: moves about drawn axes, slow and fast."""
    rates, still = [np.zeros((round(2.0 * rest / period), 3))], round(rest / period)
    for _ in range(moves):
        length = rng.uniform(0.8, 3.0)
        axis = rng.standard_normal(3)
        s = (np.arange(round(length / period)) + 0.5) * period / length
        speed = rng.uniform(1.0, 4.0) / length * (1.0 - np.cos(2.0 * np.pi * s))
        rates += [speed[:, None] * axis / np.linalg.norm(axis), np.zeros((still, 3))]
    rate = np.vstack(rates)
    steps = np.vstack([np.zeros(3), 0.5 * (rate[1:] + rate[:-1]) * period])
    attitude = turned_by(steps)
    return period * np.arange(1, len(rate) + 1), rate, attitude.inv().apply([0.0, 0.0, 1.0]), attitude


def slow_noise(rng: np.random.Generator, rows: int, size: float) -> np.ndarray:
    """Noise (rows, 3) that wanders over all times from 16 rows to the record alike, as flicker noise does."""
    total = np.zeros((rows, 3))
    for octave in range(4, int(np.log2(rows)) + 1):
        knots = np.arange(0, rows + 2**octave, 2**octave)
        values = rng.standard_normal((len(knots), 3))
        total += np.column_stack([np.interp(np.arange(rows), knots, column) for column in values.T])
    return size * total


def seen_attitude(rng: np.random.Generator, attitude: Rotation, error: float) -> np.ndarray:
    """Quaternions (N, 4), scalar first, of an attitude that cameras see with errors of so much rms [rad]."""
    seen = attitude * Rotation.from_rotvec(error * rng.standard_normal((len(attitude), 3)))
    return np.roll(seen.as_quat(), 1, axis=1)
