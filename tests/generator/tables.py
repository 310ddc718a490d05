"""Bench records with known truth: a block with gyros on a table, at rest and turning.

The gyros' turn is the logarithm of the attitude's change from one fine step to the next, against inertial space.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from generator import G
from generator.turns import FINE, about, rotation_vectors, turned
from trihedron.tools.records import BenchRecord

EARTH = 7.292115e-5
LATITUDE, AZIMUTH = math.radians(55.75), math.radians(20.0)


@dataclass(frozen=True)
class Truth:
    """True parameters of a bench and a block: bench and mounting [rad]; Γ and biases of the accelerometers [1], [g],
    their lag [s] and places (3, 3) [m]; the gyros' bias [rad/s], matrix [1], sensitivity [rad/s per g] and lag [s]."""

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
        """Draw any bench and block within usual sizes."""

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
        """Return the targets in the order of the paper's 18."""
        scales = np.stack([self.plus, self.minus], axis=1).ravel()
        shears = [self.gamma[1, 0], self.gamma[2, 0], self.gamma[2, 1]]
        stand = [self.kappa, self.alpha_offset, self.epsilon]
        return np.concatenate([stand, scales, shears, self.turn[::-1], self.bias]).tolist()

    @property
    def gyros(self) -> list[float]:
        """Return bias, matrix and sensitivity row by row, lag."""
        return [*self.gyro_bias, *self.gyro_matrix.ravel(), *self.sensitivity.ravel(), self.lag]

    @property
    def lags(self) -> list[float]:
        """Return the lags of the accelerometers behind the encoders, and of the gyros behind the accelerometers [s]."""
        return [self.force_lag, self.lag - self.force_lag]


@dataclass(frozen=True)
class Programme:
    """Positions [deg] of the table, with rests [s] between moves at one rate [rad/s]; ramps are smooth."""

    positions: tuple[tuple[float, float], ...]
    dwell: float = 6.0
    rate: float = 1.2
    ramp: float = 0.5
    step: float = 0.02

    def angles(self) -> np.ndarray:
        """Return both true angles before any offset, on the fine grid (N, 2) [rad]."""
        fine = self.step / FINE
        rest = round(self.dwell / self.step) * FINE
        start, parts = np.deg2rad(self.positions[0]), []
        for position in self.positions:
            end = np.deg2rad(position)
            length = float(np.abs(end - start).max())
            if length > 0.0:
                # The rate rises and falls linearly over the ramps.
                seconds = length / self.rate + self.ramp
                t = fine * np.arange(1, FINE * math.ceil(seconds / self.step) + 1)
                speed = np.clip(np.minimum(t, seconds - t) / self.ramp, 0.0, 1.0)
                part = np.cumsum(speed)
                parts.append(start + (part / part[-1])[:, None] * (end - start))
            parts.append(np.tile(end, (rest, 1)))
            start = end
        return np.concatenate(parts)


STILL_POSITIONS = tuple((20.0 + 45.0 * k, beta) for beta in (25.0, 145.0, 265.0) for k in range(8))
OUTER_TURNS = ((0.0, 0.0), (720.0, 0.0), (0.0, 0.0), (0.0, 90.0), (720.0, 90.0), (0.0, 90.0), (0.0, 180.0))
INNER_TURNS = ((720.0, 180.0), (720.0, 270.0), (0.0, 270.0), (90.0, 270.0), (90.0, 990.0), (90.0, 270.0))
PROGRAMME = Programme(STILL_POSITIONS + OUTER_TURNS + INNER_TURNS + ((30.0, -450.0), (30.0, 270.0)))
"""Positions for the accelerometers; whole turns about the outer axis at four inner angles, and about the inner one."""


@dataclass(frozen=True)
class Errors:
    """Error bounds of readings: accelerometers at rest [g], a gyro's sample [rad/s], encoders [rad]."""

    force: float = 1e-5
    rate: float = 2e-4
    encoder: float = 0.0
    seed: int = 1


def _turned_block(truth: Truth, time: np.ndarray, angle: np.ndarray, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return block axes (N, 3, 3) from those of the base, and from inertial ones, in which the base turns with the
    Earth."""
    inner = about(2, angle[:, 1]) @ about(1, truth.epsilon) @ about(0, angle[:, 0] - truth.alpha_offset)
    in_base = turned(truth.turn) @ q @ inner @ about(1, truth.kappa)
    level = EARTH * math.cos(LATITUDE)
    earth = np.array([level * math.cos(AZIMUTH), level * math.sin(AZIMUTH), EARTH * math.sin(LATITUDE)])
    return in_base, in_base @ turned(time[:, None] * earth)


def attitudes_of(truth: Truth, record: BenchRecord) -> np.ndarray:
    """Return block axes (N, 3, 3) from inertial ones at a record's rows, by its angles."""
    return _turned_block(truth, record.time_s, np.stack([record.alpha, record.beta], axis=1), np.eye(3))[1]


def _at(moments: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return values (N, K) at moments (M,), linear between the times."""
    columns = np.empty((len(moments), values.shape[1]))
    for k in range(values.shape[1]):
        columns[:, k] = np.interp(moments, time, values[:, k])
    return columns


def _felt(truth: Truth, time: np.ndarray, force: np.ndarray, rate: np.ndarray) -> np.ndarray:
    """Return the specific force (N, 3, 3) [g] at each accelerometer, with its lag."""
    turning = _at(time, 0.5 * (time[1:] + time[:-1]), rate)
    faster = np.diff(turning, axis=0, prepend=turning[:1], append=turning[-1:])
    faster = 0.5 * (faster[1:] + faster[:-1]) * (len(time) - 1) / (time[-1] - time[0])
    felt = np.empty((len(time), 3, 3))
    for p, arm in enumerate(truth.arms):
        felt[:, p] = force + (np.cross(turning, np.cross(turning, arm)) + np.cross(faster, arm)) / G
    return _at(time - truth.force_lag, time, felt.reshape(len(time), 9)).reshape(-1, 3, 3)


def _increments(truth: Truth, middle: np.ndarray, rate: np.ndarray, force: np.ndarray, fine: float) -> np.ndarray:
    """Return increments (N, 3) [rad] of the gyros from row to row; the first equals the second."""
    lagging = _at(middle - truth.lag, middle, rate)
    felt = 0.5 * (force[1:] + force[:-1])
    reading = lagging @ (np.eye(3) + truth.gyro_matrix).T + truth.gyro_bias + felt @ truth.sensitivity.T
    steps = len(reading) // FINE
    summed = fine * reading[: steps * FINE].reshape(steps, FINE, 3).sum(axis=1)
    return np.vstack([summed[:1], summed])


def bench_record(
    truth: Truth, programme: Programme = PROGRAMME, errors: Errors = Errors(), mounting: ArrayLike | None = None
) -> BenchRecord:
    """Return the record by encoders, accelerometers and gyros (increments)."""
    rng = np.random.default_rng(errors.seed)
    q = np.eye(3) if mounting is None else np.asarray(mounting)
    angle, fine = programme.angles(), programme.step / FINE
    time = fine * np.arange(len(angle))
    in_base, attitude = _turned_block(truth, time, angle, q)
    rate = rotation_vectors(attitude[1:] @ np.swapaxes(attitude[:-1], 1, 2)) / fine
    force = in_base[:, :, 2]
    increments = _increments(truth, 0.5 * (time[1:] + time[:-1]), rate, force, fine)
    increments += programme.step * rng.uniform(-errors.rate, errors.rate, increments.shape)
    still = np.all(np.abs(np.diff(angle[::FINE], axis=0, prepend=angle[:1])) < 1e-12, axis=1)
    rest = np.cumsum(np.diff(still.astype(int), prepend=0) == 1)
    offset = rng.uniform(-errors.force, errors.force, (rest.max() + 1, 3))[rest]
    felt = _felt(truth, time, force, rate)[::FINE]
    along = np.einsum("npp->np", felt)
    scale = np.where(along >= 0.0, truth.plus, truth.minus)
    f = along * (1.0 + scale) + np.einsum("pq,npq->np", truth.gamma, felt) + truth.bias + offset
    off = rng.uniform(-errors.encoder, errors.encoder, (rest.max() + 1, 2))[rest]
    alpha, beta = (angle[::FINE] + off).T
    return BenchRecord(time[::FINE], alpha, beta, G * f, increment=increments)
