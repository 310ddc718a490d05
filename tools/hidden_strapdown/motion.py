"""A block moved by hand from rest to rest: harmonics that begin and end at rest, exact to rounding."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.harmonic_motion import HARMONICS
from ..attitude.compiled_runs import sample_motion

UP = np.array([0.0, 0.0, 1.0])
LARGEST_SWING = 1.2
"""Of each angle of a move about its middle [rad]."""
LARGEST_WIGGLE = 0.4
"""Of the part of a move that comes back to where it began [rad]."""
LARGEST_PUSH = 0.25
"""Linear acceleration of the hand [g]."""


@dataclass(frozen=True, eq=False)
class TrueMotion:
    """What the block does, at N + 1 rows a period apart.

    Attributes
    ----------
    period : float
        [s]
    increment : (N, 3) array
        integrals of the rate between the rows, in block axes [rad]
    rate : (N + 1, 3) array
        rates at the rows [rad/s]
    attitude : (N + 1, 4) array
        quaternions, scalar first, body to a reference whose third axis is up
    force : (N + 1, 3) array
        specific force at the rows, in block axes [g]
    """

    period: float
    increment: NDArray[np.float64]
    rate: NDArray[np.float64]
    attitude: NDArray[np.float64]
    force: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.rate)


@dataclass(frozen=True)
class Schedule:
    """How long rests and moves are; each is drawn from a range [s].

    Attributes
    ----------
    moves : (int, int)
        how many
    first_rest, rest, move : (float, float)
    """

    moves: tuple[int, int]
    first_rest: tuple[float, float]
    rest: tuple[float, float]
    move: tuple[float, float]


BETWEEN_RESTS = Schedule(moves=(20, 30), first_rest=(20.0, 30.0), rest=(3.0, 6.0), move=(1.2, 3.0))
"""A record that is made to be calibrated: gravity is the reference at each rest."""
BEFORE_A_CAMERA = Schedule(moves=(14, 22), first_rest=(20.0, 30.0), rest=(0.5, 2.0), move=(2.5, 6.0))
"""A record whose true attitude is seen: mostly in motion."""


def draw_motion(rng: np.random.Generator, schedule: Schedule, period: float) -> TrueMotion:
    """Rests and moves, one after the other; it ends with a rest."""
    increments, rates, attitudes, pushes = [], [], [], []
    attitude = Rotation.from_quat(rng.normal(size=4))
    count = int(rng.integers(schedule.moves[0], schedule.moves[1] + 1))
    for k in range(count + 1):
        still = round(rng.uniform(*(schedule.first_rest if k == 0 else schedule.rest)) / period)
        # The first row is the start; each rest and each move adds the rows after its own beginning.
        increments.append(np.zeros((still, 3)))
        rates.append(np.zeros((still + (k == 0), 3)))
        attitudes.append(np.tile(attitude.as_quat(), (still + (k == 0), 1)))
        pushes.append(np.zeros((still + (k == 0), 3)))
        if k == count:
            break
        rows = round(rng.uniform(*schedule.move) / period)
        harmonics = draw_move(rng, rows * period)
        angles, rate = angles_and_rates(harmonics, period * np.arange(rows + 1))
        turned = Rotation.from_euler("YZX", angles)
        path = attitude * turned[0].inv() * turned[1:]
        increments.append(sample_motion(harmonics.ravel(), period, rows).increments)
        rates.append(rate[1:])
        attitudes.append(path.as_quat())
        s = np.arange(1, rows + 1) / rows
        shape = np.sin(np.pi * s) ** 2 * np.sin(2.0 * np.pi * s + rng.uniform(0.0, 2.0 * math.pi))
        pushes.append(shape[:, None] * rng.uniform(-LARGEST_PUSH, LARGEST_PUSH, 3))
        attitude = path[-1]
    every = Rotation.from_quat(np.vstack(attitudes))
    return TrueMotion(
        period=period,
        increment=np.vstack(increments),
        rate=np.vstack(rates),
        attitude=np.roll(every.as_quat(), 1, axis=1),
        force=every.inv().apply(np.vstack(pushes) + UP),
    )


def draw_move(rng: np.random.Generator, seconds: float) -> NDArray[np.float64]:
    """Harmonics (3, 4, 3) of a move as `HarmonicMotion` takes them: amplitude, circular frequency, phase of each.

    Angles are cosines of half a turn, a turn, a turn and a half and two turns over the move, so their rates vanish at
    both ends; so do the accelerations, with a third harmonic of -1/9 of the first and a fourth of -1/4 of the second.
    """
    harmonics = np.zeros((3, HARMONICS, 3))
    harmonics[:, :, 1] = math.pi / seconds * np.arange(1, HARMONICS + 1)
    harmonics[:, :, 2] = 0.5 * math.pi
    swing, wiggle = rng.uniform(-LARGEST_SWING, LARGEST_SWING, 3), rng.uniform(-LARGEST_WIGGLE, LARGEST_WIGGLE, 3)
    harmonics[:, :, 0] = np.stack([swing, wiggle, -swing / 9.0, -wiggle / 4.0], axis=1)
    return harmonics


def angles_and_rates(harmonics: NDArray, time: NDArray) -> tuple[NDArray, NDArray]:
    """Angles ψ, ϑ, γ (N, 3) and body rates (N, 3) of a harmonic motion at times (N,)."""
    amplitude, frequency, phase = np.moveaxis(harmonics, 2, 0)
    argument = frequency * time[:, None, None] + phase
    angles = (amplitude * np.sin(argument)).sum(axis=2)
    turning = (amplitude * frequency * np.cos(argument)).sum(axis=2)
    sines, cosines = np.sin(angles), np.cos(angles)
    across = turning[:, 0] * cosines[:, 1]
    return angles, np.stack(
        [
            turning[:, 2] + turning[:, 0] * sines[:, 1],
            across * cosines[:, 2] + turning[:, 1] * sines[:, 2],
            turning[:, 1] * cosines[:, 2] - across * sines[:, 2],
        ],
        axis=1,
    )


def without_coning(motion: TrueMotion, coefficient: float) -> TrueMotion:
    """The motion with increments that lack c γ' × γ, γ' being the increment before: as one that sums rates has them."""
    before = np.vstack([motion.increment[:1], motion.increment[:-1]])
    return replace(motion, increment=motion.increment - coefficient * np.cross(before, motion.increment))
