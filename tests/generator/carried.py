"""A block that is carried by hand from rest to rest, with known errors, and files of such records."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from generator import G
from generator.turns import attitudes, turned_by, up_in_body
from trihedron.tools.records import StrapdownRecord

PERIOD = 0.01
"""Time between the rows of strapdown records [s]."""
_FACES = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
_EDGES = [[1, 1, 0], [1, 0, 1], [0, 1, 1], [-1, 1, 0], [-1, 0, 1], [0, -1, 1], [1, 1, -1], [-1, -1, 1]]
_VERTICALS = np.array([*_FACES, *_EDGES], dtype=float)
POSES = _VERTICALS / np.linalg.norm(_VERTICALS, axis=1)[:, None]
"""Directions of the vertical in the block."""
Motion = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Times (N,) [s], true rates (N, 3) [rad/s] and inputs (N, 3) [g]."""


def true_motion(poses: np.ndarray = POSES, rest: float = 3.0, move: float = 1.5, period: float = PERIOD) -> Motion:
    """Return smooth turns between rests in poses."""
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
        # First, the block also turns about the vertical, by half a turn at most.
        spin = (0.5 + 0.4 * (k % 3)) * np.sin(2.0 * np.pi * s)
        vertical = Rotation.from_rotvec(-turn[:, None] * axis).apply(before)
        rates.append(speed[:, None] * axis + spin[:, None] * vertical)
        inputs.append(vertical)
    rate = np.vstack([*rates, np.zeros((still, 3))])
    n = np.vstack([*inputs, np.tile(poses[-1], (still, 1))])
    return period * np.arange(1, len(rate) + 1), rate, n


def strapdown_record(
    motion: Motion | None = None,
    *,
    seed: int = 0,
    gamma: Any = 0.0,
    bias_g: Any = 0.0,
    gyro_bias: Any = 0.0,
    drift: Any = 0.0,
    sensitivity: np.ndarray | None = None,
    force_noise: float = 0.03,
    rate_noise: float = 1e-3,
    **columns: Any,
) -> StrapdownRecord:
    """Return a record of a motion: Γ and b [g] of the accelerometers, bias [rad/s], drift [rad/s/h] and G [rad/s/g]."""
    time, rate, n = true_motion() if motion is None else motion
    rng = np.random.default_rng(seed)
    reading = n @ (np.eye(3) + gamma).T
    force = G * (reading + bias_g) + force_noise * rng.standard_normal(n.shape)
    measured = rate + gyro_bias + rate_noise * rng.standard_normal(n.shape) + time[:, None] / 3600.0 * drift
    if sensitivity is not None:
        measured = measured + n @ sensitivity.T
    return StrapdownRecord(time_s=time, rate=measured, increment=None, specific_force=force, **columns)


def drawn_motion(
    rng: np.random.Generator, moves: int = 16, rest: float = 4.0, period: float = PERIOD
) -> tuple[np.ndarray, np.ndarray, np.ndarray, Rotation]:
    """Draw a motion with its attitudes: moves about drawn axes, slow and fast."""
    rates, still = [np.zeros((round(2.0 * rest / period), 3))], round(rest / period)
    for _ in range(moves):
        length = rng.uniform(0.8, 3.0)
        axis = rng.standard_normal(3)
        s = (np.arange(round(length / period)) + 0.5) * period / length
        speed = rng.uniform(1.0, 4.0) / length * (1.0 - np.cos(2.0 * np.pi * s))
        rates.append(speed[:, None] * axis / np.linalg.norm(axis))
        rates.append(np.zeros((still, 3)))
    rate = np.vstack(rates)
    steps = np.vstack([np.zeros(3), 0.5 * (rate[1:] + rate[:-1]) * period])
    attitude = turned_by(steps)
    return period * np.arange(1, len(rate) + 1), rate, attitude.inv().apply([0.0, 0.0, 1.0]), attitude


def slow_noise(rng: np.random.Generator, rows: int, size: float) -> np.ndarray:
    """Draw noise (rows, 3) that wanders equally over all times from 16 rows to the record, like flicker noise."""
    total = np.zeros((rows, 3))
    for octave in range(4, int(np.log2(rows)) + 1):
        knots = np.arange(0, rows + 2**octave, 2**octave)
        values = rng.standard_normal((len(knots), 3))
        for axis in range(3):
            total[:, axis] += np.interp(np.arange(rows), knots, values[:, axis])
    return size * total


def camera_attitude(rng: np.random.Generator, attitude: Rotation, error: float) -> np.ndarray:
    """Return quaternions (N, 4), scalar first, of an attitude seen by cameras with this rms error [rad]."""
    filmed = attitude * Rotation.from_rotvec(error * rng.standard_normal((len(attitude), 3)))
    return np.roll(filmed.as_quat(), 1, axis=1)


# Files of a block that is turned by hand


@dataclass(frozen=True)
class HandMotion:
    """Rests and drawn turns in turn."""

    turns: np.ndarray
    swings: np.ndarray
    rest: float
    move: float = 1.5

    @staticmethod
    def drawn(
        rng: np.random.Generator, poses: int, rest: float, angles: tuple[float, float], *, fast: float = 1.0
    ) -> "HandMotion":
        """Draw a motion with this number of poses, with turns of angles [rad] from the least to the greatest."""
        turns = rng.normal(size=(poses, 3))
        turns *= (fast * rng.uniform(*angles, poses) / np.linalg.norm(turns, axis=1))[:, None]
        return HandMotion(turns, fast * rng.uniform(-0.8, 0.8, (poses, 3)), rest)

    @property
    def count(self) -> int:
        """Number of rows of the record."""
        return round((len(self.turns) * (self.rest + self.move) + self.rest) / PERIOD) + 1

    @property
    def times(self) -> np.ndarray:
        """Times of the rows [s], from 0."""
        return PERIOD * np.arange(self.count)

    def rate(self, times: np.ndarray) -> np.ndarray:
        """Return true rates (N, 3) [rad/s] at times (N,)."""
        span, poses = self.rest + self.move, len(self.turns)
        number = np.minimum((times // span).astype(int), poses - 1)
        since = times - number * span
        s = np.clip((since - self.rest) / self.move, 0.0, 1.0)
        bell = (1.0 - np.cos(2.0 * np.pi * s)) / self.move
        wave = np.sin(2.0 * np.pi * s) * np.sin(np.pi * s) ** 2
        moving = (since > self.rest) & (times < poses * span)
        turning = self.turns[number] * bell[:, None] + self.swings[number] * 4.0 * wave[:, None]
        return np.where(moving[:, None], turning, 0.0)

    def attitudes(self) -> np.ndarray:
        """Quaternions (N, 4) at the rows, body to reference."""
        return attitudes(self.rate, self.count, PERIOD)


def wandering(rng: np.random.Generator, rows: int) -> np.ndarray:
    """Draw a walk (rows, 3) [rad/s] that settles, like the flicker of a good MEMS gyro."""
    walk = np.zeros((rows, 3))
    for k, kick in enumerate(rng.normal(0.0, 2e-6, (rows - 1, 3))):
        walk[k + 1] = 0.999 * walk[k] + kick
    return walk


def mems_force(rng: np.random.Generator, n: np.ndarray) -> np.ndarray:
    """Return readings (N, 3) [g] of the accelerometers of a good MEMS unit at inputs (N, 3)."""
    gamma = np.tril(rng.uniform(-3e-3, 3e-3, (3, 3)))
    return n + n @ gamma.T + rng.uniform(-3e-3, 3e-3, 3) + rng.normal(0.0, 1e-3, n.shape)


def write_strapdown(
    path: Path, times: np.ndarray, rate: np.ndarray, force: np.ndarray, attitude: np.ndarray | None = None
) -> None:
    """Write a record of rates (N, 3) [rad/s], readings (N, 3) [g] and, if known, the true attitude (N, 4)."""
    names = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
    columns, formats = [times + PERIOD, rate, G * force], ["%.4f"] + 3 * ["%.8f"] + 3 * ["%.7f"]
    if attitude is not None:
        names += ",q0,q1,q2,q3"
        columns.append(attitude)
        formats += 4 * ["%.9f"]
    np.savetxt(path, np.column_stack(columns), formats, ",", header=names, comments="")


# A gyro's fault outside the catalogue

WHITE = 8e-4
"""Noise of a gyro at a row [rad/s]."""
SEEN = 1e-4
"""Errors of the reference attitude [rad]."""
UNIT = 4e-3
"""Largest rate [rad/s] of a fault of size one."""
Shape = Callable[[np.ndarray], np.ndarray]
SHAPES: dict[str, Shape] = {
    "bump": lambda part: np.exp(-(((part - 0.45) / 0.15) ** 2)),
    "sawtooth": lambda part: 2.0 * ((1.5 * part + 0.25) % 1.0) - 1.0,
    "fifth power": lambda part: part**5,
    "wave": lambda part: np.sin(6.0 * part + 0.5),
    "knee": lambda part: np.maximum(0.0, part - 0.2),
    "bends off": lambda part: part / (1.0 + 8.0 * part**2),
    "jump": lambda part: (part > 0.3).astype(float),
    "hump": lambda part: np.exp(-(((part - 0.1) / 0.3) ** 2)),
    "swing": lambda part: np.sin(2.0 * np.pi * 2.6 * part + 0.4),
}
"""Functions of a quantity over its largest size, from -1 to 1."""
GYRO_FAULTS: Sequence[tuple[str, str]] = (
    ("bump", "own"),
    ("sawtooth", "own"),
    ("fifth power", "own"),
    ("wave", "force"),
    ("knee", "own"),
    ("bump", "other"),
    ("bends off", "own"),
    ("jump", "own"),
    ("swing", "hours"),
    ("hump", "hours"),
    ("wave", "other"),
    ("knee", "force"),
)
"""A shape of a fault, and the gyro's quantity on which it depends."""


@dataclass(frozen=True)
class OutsideGyro:
    """A record in a file, and its secret.

    `place` and `quantity` by the product's names; `fault` (N,) is the error of that gyro [rad/s] at values (N,) of the
    quantity.
    """

    path: Path
    shape: str
    place: str
    quantity: str
    with_truth: bool
    size: float
    fault: np.ndarray
    values: np.ndarray


def outside_gyro(path: Path, seed: int, index: int) -> OutsideGyro:
    """Return one record with a fault; every other one has a reference of attitude."""
    rng = np.random.default_rng([seed, index])
    shape, source = GYRO_FAULTS[index % len(GYRO_FAULTS)]
    with_truth = (index + index // len(GYRO_FAULTS)) % 2 == 0
    motion = HandMotion.drawn(rng, 20, 2.5, (0.8, 2.6))
    times, true, attitude = motion.times, motion.rate(motion.times), motion.attitudes()
    n = up_in_body(attitude)
    p, size = int(rng.integers(3)), float(rng.uniform(1.5, 6.0))
    other = (p + int(rng.integers(1, 3))) % 3
    quantity, values = {
        "own": (f"w{p + 1}", true[:, p]),
        "other": (f"w{other + 1}", true[:, other]),
        "force": (f"n{other + 1}", n[:, other]),
        "hours": ("hours", times / 3600.0),
    }[source]
    fault = size * UNIT * float(rng.choice([-1.0, 1.0])) * SHAPES[shape](values / np.abs(values).max())
    gyro = true + rng.uniform(-3e-3, 3e-3, 3) + rng.normal(0.0, WHITE, true.shape)
    gyro += wandering(rng, motion.count)
    gyro[:, p] += fault
    force = mems_force(rng, n)
    if with_truth:
        filmed = attitude + 0.5 * SEEN * rng.normal(size=attitude.shape)
        write_strapdown(path, times, gyro, force, filmed / np.linalg.norm(filmed, axis=1)[:, None])
    else:
        # Between rests the block counts as calibrated: each gyro has its own scale factor and misalignments.
        write_strapdown(path, times, gyro + true @ rng.uniform(-2e-3, 2e-3, (3, 3)).T, force)
    return OutsideGyro(path, shape, f"gyro-{p + 1}", quantity, with_truth, size, fault, values)
