"""Faults of single rests and moves of a series: a knock, a sign, an exchange, a range, an offset, a copy."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from generator.carried import drawn_motion, strapdown_record
from trihedron.tools.records import StrapdownRecord

Stretch = tuple[int, int]
"""First row, and the row behind the last."""


@dataclass(frozen=True)
class WrongPiece:
    """A record with a wrong rest or move: the kind of the fault, its number from 1, and the fault as a key of
    results."""

    record: Any
    kind: str
    number: int
    key: str


def knocked(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Disturb all accelerometers by 0.02 to 0.04 g [m/s²]."""
    values[at[0] : at[1]] += 9.81 * rng.choice([-1.0, 1.0], 3) * rng.uniform(0.02, 0.04, 3)


def one_off(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Disturb one accelerometer by 0.03 to 0.05 g [m/s²]."""
    values[at[0] : at[1], rng.integers(3)] += 9.81 * rng.choice([-1.0, 1.0]) * rng.uniform(0.03, 0.05)


def exchanged(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Exchange two channels."""
    pair = rng.choice(3, 2, replace=False)
    values[at[0] : at[1], pair] = values[at[0] : at[1], pair[::-1]].copy()


def sign_turned(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Reverse the sign of a channel."""
    values[at[0] : at[1], rng.integers(3)] *= -1.0


def half_range(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Halve all channels, as with another range."""
    values[at[0] : at[1]] *= 0.5


def offset(values: np.ndarray, at: Stretch, rng: np.random.Generator) -> None:
    """Shift one gyro by 0.04 to 0.08 rad/s."""
    values[at[0] : at[1], rng.integers(3)] += rng.choice([-1.0, 1.0]) * rng.uniform(0.04, 0.08)


OF_RESTS: dict[str, Callable[[np.ndarray, Stretch, np.random.Generator], None]] = {
    "knocked": knocked,
    "one off": one_off,
    "exchanged": exchanged,
}
OF_MOVES: dict[str, Callable[[np.ndarray, Stretch, np.random.Generator], None]] = {
    "sign": sign_turned,
    "exchanged": exchanged,
    "half range": half_range,
    "offset": offset,
}
KEYS = {"exchanged": "exchanged", "half range": "times"}
"""Keys that results have for a fault, where it is none of a channel."""


def hand_record(rng: np.random.Generator, moves: int) -> tuple[StrapdownRecord, list[Stretch]]:
    """Return a consistent record of a block moved by hand, and its rests."""
    motion = drawn_motion(rng, moves=moves, rest=2.5)
    gamma = np.tril(rng.uniform(-2e-3, 2e-3, (3, 3)))
    bias = rng.uniform(-2e-3, 2e-3, (2, 3))
    record = strapdown_record(
        motion[:3], seed=int(rng.integers(1_000_000)), gamma=gamma, bias_g=bias[0], gyro_bias=bias[1]
    )
    turning = np.append(0, np.any(motion[1] != 0.0, axis=1).astype(int))
    begins, ends = np.flatnonzero(np.diff(turning) == 1), np.flatnonzero(np.diff(turning) == -1)
    return record, list(zip(np.append(0, ends).tolist(), np.append(begins, len(record)).tolist(), strict=True))


def with_wrong_piece(seed: int, kind: str, what: str, moves: int = 18) -> WrongPiece:
    """Return a record of a block moved by hand with one wrong rest or move in its middle."""
    rng = np.random.default_rng([seed, moves])
    record, rests = hand_record(rng, moves)
    number = int(rng.integers(3, moves - 2))
    assert record.rate is not None
    if kind == "rest":
        force = record.specific_force.copy()
        OF_RESTS[what](force, rests[number - 1], rng)
        return WrongPiece(replace(record, specific_force=force), kind, number, KEYS.get(what, ""))
    rate = record.rate.copy()
    OF_MOVES[what](rate, (rests[number - 1][1], rests[number][0]), rng)
    return WrongPiece(replace(record, rate=rate), kind, number, KEYS.get(what, ""))
