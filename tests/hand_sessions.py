"""Simulated sessions of a block in a hand: poses without gyros, six faces with turns, moves from rest to rest."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import polars as pl
from scipy.spatial.transform import Rotation

from by_hand import GRAVITY, NAMES, Instrument

PERIOD = 0.01
NOISE = (2e-3, 1e-3)
"""Of a sample of accelerometers [g] and of gyros [rad/s]."""
Errors = Callable[[np.random.Generator, tuple[int, int]], np.ndarray]
FACES = ("+1", "-1", "+2", "-2", "+3", "-3")


def truth(instrument: Instrument) -> dict[str, float]:
    """Return the true parameters of an instrument by their symbols."""
    entries = [*(instrument.matrix - np.eye(3))[np.tril_indices(3)], *instrument.bias]
    values: dict[str, float] = dict(zip(NAMES, entries, strict=True))
    matrix = instrument.gyro_matrix - np.eye(3)
    for row in range(3):
        values[f"B{row + 1}"] = instrument.gyro_bias[row]
        for column in range(3):
            values[f"M{row + 1}{column + 1}"] = matrix[row, column]
            values[f"S{row + 1}{column + 1}"] = instrument.sensitivity[row, column]
    return values


def directions(rng: np.random.Generator, count: int) -> np.ndarray:
    """Return random unit vectors (count, 3)."""
    vectors = rng.normal(size=(count, 3))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def attitudes(rng: np.random.Generator, count: int) -> list[Rotation]:
    """Return attitudes that are uniform over all rotations."""
    return list(Rotation.from_quat(rng.normal(size=(count, 4))))


def poses(instrument: Instrument, up: np.ndarray, errors: np.ndarray) -> pl.DataFrame:
    """Return a pose record of verticals (N, 3) in block axes, with errors (N, 3) of the readings [g]."""
    reading = instrument.readings(GRAVITY * up) + GRAVITY * errors
    columns = {f"f{axis + 1}_mps2": reading[:, axis] for axis in range(3)}
    return pl.DataFrame({"position": np.arange(1, len(up) + 1), **columns})


def runs(
    seed: int, counts: tuple[int, ...], errors: Errors, *, strange: bool = False
) -> tuple[list[Instrument], list[pl.DataFrame]]:
    """Return runs of an instrument, each with its own biases; the last of another instrument where it is strange."""
    rng = np.random.default_rng(seed)
    instruments, tables = [], []
    for number, count in enumerate(counts):
        instrument = Instrument(seed + (1000 if strange and number == len(counts) - 1 else 0))
        instrument.bias = instrument.bias + rng.normal(0.0, 2e-3, 3)
        instruments.append(instrument)
        tables.append(poses(instrument, directions(rng, count), errors(rng, (count, 3))))
    return instruments, tables


def turning(rests: list[Rotation], moving_s: float, resting_s: float) -> tuple[np.ndarray, Rotation]:
    """Return the times and attitudes (body to world) of a block that turns steadily from one rest to the next."""
    step = int(resting_s / PERIOD), int(moving_s / PERIOD)
    parts = [np.tile(rests[0].as_quat(), (step[0], 1))]
    for before, after in pairwise(rests):
        way = (before.inv() * after).as_rotvec()
        share = 0.5 - 0.5 * np.cos(np.pi * np.arange(1, step[1] + 1) / step[1])
        parts.append((before * Rotation.from_rotvec(share[:, None] * way)).as_quat())
        parts.append(np.tile(after.as_quat(), (step[0], 1)))
    quaternions = np.vstack(parts)
    return PERIOD * np.arange(len(quaternions)), Rotation.from_quat(quaternions)


def strapdown(
    instrument: Instrument, time: np.ndarray, attitude: Rotation, rng: np.random.Generator, noise: tuple[float, float]
) -> pl.DataFrame:
    """Return a strapdown record of attitudes (body to world), with noise of a sample [g], [rad/s]."""
    between = (attitude[:-1].inv() * attitude[1:]).as_rotvec() / PERIOD
    rate = np.vstack([between[:1], 0.5 * (between[1:] + between[:-1]), between[-1:]])
    force = GRAVITY * attitude.inv().apply([0.0, 0.0, 1.0])
    reading = instrument.readings(force) + GRAVITY * rng.normal(0.0, noise[0], force.shape)
    rates = instrument.rates(rate, force) + rng.normal(0.0, noise[1], rate.shape)
    columns = {f"w{axis + 1}_radps": rates[:, axis] for axis in range(3)}
    columns |= {f"f{axis + 1}_mps2": reading[:, axis] for axis in range(3)}
    return pl.DataFrame({"time_s": time, **columns})


def ferraris(
    seed: int,
    tilt: float = 0.03,
    *,
    of_prior: bool = False,
    error: float = 0.0,
    turn_error: float = 0.0,
    turn_bias: float = 0.0,
) -> tuple[Instrument, pl.DataFrame]:
    """Return an instrument, and its session of six faces, tilted by some radians, and three turns.

    Each face reads wrong by a constant with the standard deviation `error` [g]. Each turn is wrong by an angle of
    `turn_error`, and all alike by one of `turn_bias` [rad].
    """
    rng = np.random.default_rng(seed)
    instrument = Instrument.of_prior(seed) if of_prior else Instrument(seed)
    instrument.sensitivity = np.zeros((3, 3))
    errors = GRAVITY * np.random.default_rng([seed, 2]).normal(0.0, error, (6, 3))
    wrong = np.random.default_rng([seed, 3]).normal(0.0, turn_error, 3)
    wrong += np.random.default_rng([seed, 4]).normal(0.0, turn_bias)
    faces = []
    for word in FACES:
        axis = np.zeros(3)
        axis[int(word[1]) - 1] = 1.0 if word[0] == "+" else -1.0
        up = axis + rng.normal(0.0, tilt, 3)
        faces.append(Rotation.align_vectors([[0.0, 0.0, 1.0]], [up / np.linalg.norm(up)])[0])
    tables, parts, start = [], [], 0.0
    for word, face in zip(FACES, faces, strict=True):
        time, attitude = turning([face, face], 0.5, 2.0)
        table = strapdown(instrument, start + time, attitude, rng, NOISE)
        off = errors[len(tables)]
        tables.append(table.with_columns(*(pl.col(f"f{axis + 1}_mps2") + off[axis] for axis in range(3))))
        parts += [word] * len(time)
        start += float(time[-1]) + PERIOD
    for axis in range(3):
        up = faces[2 * axis]
        stops = [
            Rotation.from_rotvec([0.0, 0.0, angle]) * up
            for angle in np.radians([0, 120, 240, 360]) * (1.0 + wrong[axis] / (2.0 * np.pi))
        ]
        sections = [turning([first, second], 1.5, 0.02) for first, second in pairwise(stops)]
        attitude = Rotation.concatenate([section[1] for section in sections])
        time = PERIOD * np.arange(len(attitude))
        tables.append(strapdown(instrument, start + time, attitude, rng, NOISE))
        parts += [f"{axis + 1}:360"] * len(time)
        start += float(time[-1]) + PERIOD
    return instrument, pl.concat(tables).with_columns(part=pl.Series(parts))


def hand_moved(
    seed: int, count: int = 14, *, sensitivity: bool = False, error: float = 0.0
) -> tuple[Instrument, pl.DataFrame]:
    """Return an instrument and the record of its moves between random rests.

    Accelerometers read wrong by a constant at each rest, with the standard deviation `error` [g].
    """
    rng = np.random.default_rng(seed)
    instrument = Instrument(seed)
    if not sensitivity:
        instrument.sensitivity = np.zeros((3, 3))
    rests = attitudes(rng, count)
    time, attitude = turning(rests, 2.0, 3.0)
    table = strapdown(instrument, time, attitude, rng, (3e-3, 2e-3))
    errors = GRAVITY * np.random.default_rng([seed, 2]).normal(0.0, error, (count, 3))
    # A rest and half of the moves beside it err alike.
    of_row = np.clip(np.round((time - 1.5) / 5.0), 0, count - 1).astype(int)
    off = [pl.col(f"f{axis + 1}_mps2") + errors[of_row, axis] for axis in range(3)]
    return instrument, table.with_columns(*off)


def written(table: pl.DataFrame, path: Path) -> Path:
    """Write a table as CSV."""
    table.write_csv(path)
    return path
