"""Faults of laboratories in a record of positions: wrong angles, signs, exchanged or copied rows, disturbed rests."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from generator import SIGMA
from generator.effects import Sized
from generator.positions import Session, errors
from trihedron.tools.records import PositionRecord


@dataclass(frozen=True)
class WrongRows:
    """A record with wrong rows, their numbers from 1, and the fault in words."""

    record: PositionRecord
    rows: tuple[int, ...]
    what: str


Spoiled = Callable[[np.ndarray, np.ndarray, int, np.random.Generator], None]
"""Spoils angles (N, 2) [rad] or readings (N, 3) [g] of one row (from 0) in place."""


def angle_off(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Make a digit of an angle wrong."""
    angles[row, rng.integers(2)] += np.radians(rng.choice([-1.0, 1.0]) * rng.choice([0.1, 0.4, 1.0, 3.0, 10.0, 60.0]))


def angles_exchanged(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Write α and β in each other's column."""
    angles[row] = angles[row, ::-1].copy()


def sign_turned(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Reverse the sign of an angle."""
    axis = rng.integers(2)
    angles[row, axis] = -angles[row, axis]


def channel_turned(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Reverse the sign of a reading."""
    axis = rng.integers(3)
    reading[row, axis] = -reading[row, axis]


def channels_exchanged(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Write two readings in each other's column."""
    i, j = rng.choice(3, 2, replace=False)
    reading[row, [i, j]] = reading[row, [j, i]]


def copied(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Copy the readings of another row."""
    reading[row] = reading[(row + rng.integers(1, len(reading))) % len(reading)]


def disturbed(angles: np.ndarray, reading: np.ndarray, row: int, rng: np.random.Generator) -> None:
    """Add the disturbance of a shaken table."""
    reading[row] += SIGMA * rng.choice([-1.0, 1.0], 3) * rng.uniform(8.0, 60.0, 3)


SPOILED: dict[str, Spoiled] = {
    "angle": angle_off,
    "angles exchanged": angles_exchanged,
    "sign": sign_turned,
    "channel": channel_turned,
    "channels exchanged": channels_exchanged,
    "copied": copied,
    "disturbed": disturbed,
}


def with_wrong_rows(seed: int, what: str, count: int = 36, rows: int = 1, hidden: Sequence[Sized] = ()) -> WrongRows:
    """Return a record of a drawn session with this number of rows wrong in this way."""
    rng = np.random.default_rng([seed, count, rows])
    session = Session.drawn(rng, count)
    angles, reading = session.read(hidden, errors(rng, count)[0])
    wrong = np.sort(rng.choice(count, rows, replace=False))
    for row in wrong:
        SPOILED[what](angles, reading, int(row), rng)
    record = session.recorded(angles, reading)
    return WrongRows(record, tuple((wrong + 1).tolist()), what)


def with_wrong_stretch(seed: int, what: str, count: int = 48, length: int = 8) -> WrongRows:
    """Return a record of a drawn session with this number of consecutive rows wrong in the same way."""
    rng = np.random.default_rng([seed, count, length])
    session = Session.drawn(rng, count)
    angles, reading = session.read(error=errors(rng, count)[0])
    first = int(rng.integers(0, count - length + 1))
    channels = rng.choice(3, 2, replace=False)
    for row in range(first, first + length):
        if what == "channels exchanged":
            reading[row, channels] = reading[row, channels[::-1]]
        else:
            SPOILED[what](angles, reading, row, rng)
    record = session.recorded(angles, reading)
    return WrongRows(record, tuple(range(first + 1, first + length + 1)), what)
