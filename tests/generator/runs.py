"""Raw records of a table's moves and rests, with the known result of each rest."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from generator import G
from trihedron.tools.records import PositionRecord, RawRecord

ARCSEC = np.deg2rad(1 / 3600)
PROGRAMME = [(np.deg2rad(20 + 45 * k), np.deg2rad(beta)) for beta in (25, 145, 265) for k in range(8)]


def up(alpha: ArrayLike, beta: ArrayLike) -> np.ndarray:
    """Return the readings of an ideal block (..., 3) [g]."""
    return np.stack([np.sin(alpha) * np.sin(beta), np.sin(alpha) * np.cos(beta), np.cos(alpha)], axis=-1)


@dataclass(frozen=True)
class Bench:
    """A table run: smooth moves, readings of an ideal block with the given errors (in g, rad, s)."""

    dwell: float = 20.0
    step: float = 0.1
    mean_rate: float = np.deg2rad(15)
    white: float = 0.0
    held: float = 0.0
    encoder_held: float = 0.0
    encoder_noise: float = 0.0
    encoder_digit: float = 0.0
    transient: float = 0.0
    time_constant: float = 2.0
    drift_per_hour: float = 0.0
    creep: float = 0.0
    seed: int = 1

    def run(self, positions: Sequence[tuple[float, float]]) -> tuple[RawRecord, np.ndarray]:
        """Return the raw record and the expected specific force of each rest [g], without drift."""
        rng = np.random.default_rng(self.seed)
        angles, forces, truth = [], [], []
        start = np.zeros(2)
        for position in positions:
            end = np.array(position)
            moving = int(np.ceil(np.abs(end - start).max() / self.mean_rate / self.step))
            resting = round(self.dwell / self.step)
            part = np.concatenate([np.arange(moving) / max(moving, 1), np.ones(resting)])
            smooth = 0.5 - 0.5 * np.cos(np.pi * part)
            since = np.concatenate([np.zeros(moving), self.step * np.arange(resting)])
            path = start + smooth[:, None] * (end - start) + self.creep * since[:, None]
            offset = rng.uniform(-self.held, self.held, 3)
            force = up(path[:, 0], path[:, 1]) + offset + rng.uniform(-self.white, self.white, (len(part), 3))
            force[moving:] += self.transient * np.exp(-since[moving:, None] / self.time_constant)
            reading = path + rng.uniform(-self.encoder_held, self.encoder_held, 2)
            reading += rng.normal(0, 1, path.shape) * self.encoder_noise
            angles.append(reading)
            forces.append(force)
            truth.append(up(*end) + offset)
            start = end
        angle, force = np.concatenate(angles), np.concatenate(forces)
        time = self.step * np.arange(len(angle))
        force = force + self.drift_per_hour * time[:, None] / 3600
        if self.encoder_digit:
            angle = np.round(angle / self.encoder_digit) * self.encoder_digit
        return RawRecord(time, angle[:, 0], angle[:, 1], G * force), np.array(truth)


def mean_errors(record: PositionRecord, truth: np.ndarray, drift_per_hour: float = 0.0) -> np.ndarray:
    """Return errors (N, 3) [g] of averaged readings."""
    return record.specific_force / G - truth - drift_per_hour * record.time_s[:, None] / 3600
