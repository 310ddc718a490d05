"""Bench records whose truth is known: table, accelerometers, gyros by rotation matrices, by no formula of the product.

The attitude is a product of rotations of the base, the axes and the block; the gyros' turn is the logarithm of what the
attitude does from one fine step to the next, against inertial space. `tests` compare what is found with `Truth`.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from trihedron.tools.records import BenchRecord

GRAVITY = 9.80665
EARTH = 7.292115e-5
LATITUDE, AZIMUTH = math.radians(55.75), math.radians(20.0)
FINE = 8
"""Steps of the truth from one row to the next."""


def about(axis: int, angle: ArrayLike) -> np.ndarray:
    """Direction cosines (..., 3, 3) of a frame turned about one of its axes, 0 to 2."""
    angle = np.asarray(angle, dtype=float)
    i, j = ((1, 2), (2, 0), (0, 1))[axis]
    matrix = np.zeros((*angle.shape, 3, 3))
    matrix[..., axis, axis] = 1.0
    matrix[..., i, i] = matrix[..., j, j] = np.cos(angle)
    matrix[..., i, j], matrix[..., j, i] = np.sin(angle), -np.sin(angle)
    return matrix


def turned(vector: np.ndarray) -> np.ndarray:
    """Direction cosines (..., 3, 3) of a frame turned by rotation vectors (..., 3)."""
    vector = np.asarray(vector, dtype=float)
    size = np.linalg.norm(vector, axis=-1)[..., None, None]
    cross = np.zeros((*vector.shape, 3))
    cross[..., 0, 1], cross[..., 0, 2], cross[..., 1, 2] = vector[..., 2], -vector[..., 1], vector[..., 0]
    cross -= np.swapaxes(cross, -1, -2)
    safe = np.where(size > 0.0, size, 1.0)
    return np.eye(3) + np.sin(size) / safe * cross + (1.0 - np.cos(size)) / safe**2 * (cross @ cross)


def small_turns(relative: np.ndarray) -> np.ndarray:
    """Rotation vectors (N, 3) of small turns (N, 3, 3)."""
    twice = np.stack([relative[:, i, j] - relative[:, j, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
    size = 0.5 * np.linalg.norm(twice, axis=-1)
    return (
        0.5
        * twice
        * np.where(size > 1e-8, np.arcsin(np.minimum(size, 1.0)) / np.where(size > 0, size, 1.0), 1.0)[:, None]
    )


@dataclass(frozen=True)
class Truth:
    """What a bench and a block are: stand and mounting [rad], Γ and biases of the accelerometers [1], [g], the gyros'
    bias [rad/s], matrix [1], sensitivity [rad/s per g] and lag [s]; the accelerometers' lag [s] and places (3, 3)
    [m]."""

    kappa: float
    epsilon: float
    alpha_offset: float
    turn: np.ndarray
    plus: np.ndarray
    minus: np.ndarray
    gamma: np.ndarray
    bias: np.ndarray
    gyro_bias: np.ndarray
    gyro_matrix: np.ndarray
    sensitivity: np.ndarray
    lag: float
    force_lag: float
    arms: np.ndarray

    @staticmethod
    def drawn(rng: np.random.Generator) -> "Truth":
        """Any bench and block within usual sizes."""

        def within(size: float, *shape: int) -> np.ndarray:
            return rng.uniform(-size, size, shape)

        kappa, epsilon, offset, lag = rng.uniform(-1.0, 1.0, 4).tolist()
        return Truth(
            kappa=2.5e-3 * kappa,
            epsilon=2.5e-3 * epsilon,
            alpha_offset=2.5e-3 * offset,
            turn=within(4e-3, 3),
            plus=within(8e-3, 3),
            minus=within(8e-3, 3),
            gamma=np.tril(within(8e-3, 3, 3), -1),
            bias=within(8e-3, 3),
            gyro_bias=within(2e-3, 3),
            gyro_matrix=within(8e-3, 3, 3),
            sensitivity=within(2e-4, 3, 3),
            lag=4e-3 * lag,
            force_lag=float(within(4e-3)),
            arms=within(0.03, 3, 3),
        )

    @property
    def targets(self) -> list[float]:
        """In the order of the paper's 18."""
        scales = [value for pair in zip(self.plus, self.minus, strict=True) for value in pair]
        shears = [self.gamma[1, 0], self.gamma[2, 0], self.gamma[2, 1]]
        stand = [self.kappa, self.alpha_offset, self.epsilon]
        return [float(v) for v in (*stand, *scales, *shears, *self.turn[::-1], *self.bias)]

    @property
    def gyros(self) -> list[float]:
        """Bias, matrix and sensitivity row by row, lag."""
        rows = np.concatenate([self.gyro_bias, self.gyro_matrix.ravel(), self.sensitivity.ravel()])
        return [*rows.tolist(), self.lag]

    @property
    def lags(self) -> list[float]:
        """Of the accelerometers behind the encoders, and of the gyros behind the accelerometers."""
        return [self.force_lag, self.lag - self.force_lag]


@dataclass(frozen=True)
class Programme:
    """Positions [deg] that the table takes, with rests [s] between moves at one rate [rad/s]; ramps are smooth."""

    positions: tuple[tuple[float, float], ...]
    dwell: float = 6.0
    rate: float = 1.2
    ramp: float = 0.5
    step: float = 0.02

    def angles(self) -> np.ndarray:
        """Both true angles before any offset, on the fine grid (N, 2) [rad]."""
        fine = self.step / FINE
        rest = round(self.dwell / self.step) * FINE
        here, parts = np.deg2rad(self.positions[0]), []
        for place in self.positions:
            there = np.deg2rad(place)
            length = float(np.abs(there - here).max())
            if length > 0.0:
                # The rate rises and falls linearly over the ramps.
                seconds = length / self.rate + self.ramp
                t = fine * np.arange(1, FINE * math.ceil(seconds / self.step) + 1)
                speed = np.clip(np.minimum(t, seconds - t) / self.ramp, 0.0, 1.0)
                part = np.cumsum(speed)
                parts.append(here + (part / part[-1])[:, None] * (there - here))
            parts.append(np.tile(there, (rest, 1)))
            here = there
        return np.concatenate(parts)


PROGRAMME = Programme(
    (
        *((20.0 + 45.0 * k, beta) for beta in (25.0, 145.0, 265.0) for k in range(8)),
        *((0.0, 0.0), (720.0, 0.0), (0.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 90.0), (0.0, 180.0), (720.0, 180.0)),
        *((720.0, 270.0), (0.0, 270.0), (90.0, 270.0), (90.0, 990.0), (90.0, 270.0), (30.0, -450.0), (30.0, 270.0)),
    )
)
"""Positions for the accelerometers; whole turns about the outer axis at four inner angles, and about the inner one."""


@dataclass(frozen=True)
class Errors:
    """Bounds of what readings err by: accelerometers at rest [g], a gyro's sample [rad/s], encoders [rad]."""

    force: float = 1e-5
    rate: float = 2e-4
    encoder: float = 0.0
    seed: int = 1


def _turned_block(truth: Truth, time: np.ndarray, angle: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Block axes (N, 3, 3) from those of the base, and from inertial ones, in which the base turns with the Earth."""
    inner = about(2, angle[:, 1]) @ about(1, truth.epsilon) @ about(0, angle[:, 0] - truth.alpha_offset)
    in_base = turned(truth.turn) @ q @ inner @ about(1, truth.kappa)
    level = EARTH * math.cos(LATITUDE)
    earth = np.array([level * math.cos(AZIMUTH), level * math.sin(AZIMUTH), EARTH * math.sin(LATITUDE)])
    return in_base, in_base @ turned(time[:, None] * earth)


def attitudes_of(truth: Truth, record: BenchRecord) -> np.ndarray:
    """Block axes (N, 3, 3) from inertial ones at a record's rows, by the angles that it has."""
    return _turned_block(truth, record.time_s, np.stack([record.alpha, record.beta], axis=1), np.eye(3))[1]


def _felt(truth: Truth, time: np.ndarray, force: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Specific force (N, 3, 3) [g] where each accelerometer is, as late as it reads it."""
    middle = 0.5 * (time[1:] + time[:-1])
    turning = np.stack([np.interp(time, middle, rate[:, k]) for k in range(3)], axis=1)
    faster = np.diff(turning, axis=0, prepend=turning[:1], append=turning[-1:])
    faster = 0.5 * (faster[1:] + faster[:-1]) * (len(time) - 1) / (time[-1] - time[0])
    felt = [force + (np.cross(turning, np.cross(turning, r)) + np.cross(faster, r)) / GRAVITY for r in truth.arms]
    late = np.stack(felt, axis=1).reshape(len(time), 9)
    moments = time - truth.force_lag
    return np.stack([np.interp(moments, time, late[:, k]) for k in range(9)], axis=1).reshape(-1, 3, 3)


def bench_record(
    truth: Truth, programme: Programme = PROGRAMME, errors: Errors = Errors(), mounting=None
) -> BenchRecord:
    """What encoders, accelerometers and gyros (increments) say of it."""
    rng = np.random.default_rng(errors.seed)
    q = np.eye(3) if mounting is None else np.asarray(mounting)
    angle = programme.angles()
    time = programme.step / FINE * np.arange(len(angle))
    in_base, attitude = _turned_block(truth, time, angle, q)
    rate = small_turns(attitude[1:] @ np.swapaxes(attitude[:-1], 1, 2)) / (programme.step / FINE)
    middle = 0.5 * (time[1:] + time[:-1])
    lagging = np.stack([np.interp(middle - truth.lag, middle, rate[:, k]) for k in range(3)], axis=1)
    force = in_base[:, :, 2]
    n = force[::FINE]
    midforce = 0.5 * (force[1:] + force[:-1])
    reading = lagging @ (np.eye(3) + truth.gyro_matrix).T + truth.gyro_bias + midforce @ truth.sensitivity.T
    fine = programme.step / FINE
    rows = len(n)
    increments = np.zeros((rows, 3))
    whole = (rows - 1) * FINE
    increments[1:] = reading[:whole].reshape(rows - 1, FINE, 3).sum(axis=1) * fine
    increments[0] = increments[1]
    increments += programme.step * rng.uniform(-errors.rate, errors.rate, increments.shape)
    still = np.all(np.abs(np.diff(angle[::FINE], axis=0, prepend=angle[:1])) < 1e-12, axis=1)
    rest = np.cumsum(np.diff(still.astype(int), prepend=0) == 1)
    held = rng.uniform(-errors.force, errors.force, (rest.max() + 1, 3))
    felt = _felt(truth, time, force, rate)[::FINE]
    scale = np.where(np.einsum("npp->np", felt) >= 0.0, truth.plus, truth.minus)
    own = np.einsum("npp->np", felt) * (1.0 + scale) + np.einsum("pq,npq->np", truth.gamma, felt)
    f = own + truth.bias + held[rest]
    off = rng.uniform(-errors.encoder, errors.encoder, (rest.max() + 1, 2))[rest]
    told = angle[::FINE] + off
    return BenchRecord(time[::FINE], told[:, 0], told[:, 1], GRAVITY * f, increment=increments)
