"""Turns of gyros over stretches of rows: many stretches at once, rows that turn little added up."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from ...models.arrays import Bools, Floats, Ints
from ..memory import once
from .kinds import StrapdownRecord

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

STEP = 0.1
"""Turns of neighbouring rows are added up to one of about this size [rad]."""


@dataclass(frozen=True, eq=False)
class Stretches:
    """Stretches of rows as sequences of turns (S, C, 3) [rad], and their durations (S, C) [s].

    `way` (S,): total angle of the block's turns, to and fro [rad].
    """

    turns: Floats
    seconds: Floats
    way: Floats

    @staticmethod
    def of(record: StrapdownRecord, time: Floats, ends: Ints) -> "Stretches":
        """The stretches between rows (S, 2) of a record with these time stamps (N,); each has one row at least."""
        turns, so_far = once(_turns_of, record, time)
        summed = []
        for first, last in ends.tolist():
            begins = np.flatnonzero(np.diff(so_far[first:last] // STEP, prepend=-1.0))
            summed.append(np.add.reduceat(turns[first:last], begins))
        count = 1 << (max(map(len, summed), default=1) - 1).bit_length()
        padded = np.zeros((len(ends), count, 4))
        for place, parts in enumerate(summed):
            padded[place, : len(parts)] = parts
        return Stretches(padded[:, :, :3], padded[:, :, 3], so_far[ends[:, 1]] - so_far[ends[:, 0]])

    def __len__(self) -> int:
        return len(self.way)

    def those(self, mask: Bools) -> "Stretches":
        """Some of the stretches."""
        return Stretches(self.turns[mask], self.seconds[mask], self.way[mask])

    def less(self, level: Floats) -> "Stretches":
        """The stretches without a rate (S, 3) that the gyros read at rest [rad/s]."""
        turns = self.turns - self.seconds[:, :, None] * level[:, None, :]
        return Stretches(turns, self.seconds, np.linalg.norm(turns, axis=2).sum(axis=1))

    def total(self, matrix: Floats) -> "Rotation":
        """The turns (S), at least one, over whole stretches of gyros that are read through a matrix (3, 3)."""
        total = scipy.spatial.transform.Rotation.from_rotvec((self.turns @ matrix.T).reshape(-1, 3))
        while len(total) > len(self):
            total = total[0::2] * total[1::2]
        return total


def _turns_of(record: StrapdownRecord, time: Floats) -> tuple[Floats, Floats]:
    """Return turns and durations (N - 1, 4) from row to row [rad, s], and the angle (N,) to and fro so far [rad]."""
    step = np.diff(time)[:, None]
    if record.rate is None:
        assert record.increment is not None
        turns = record.increment[1:]
    else:
        turns = 0.5 * (record.rate[1:] + record.rate[:-1]) * step
    return np.hstack([turns, step]), np.append(0.0, np.cumsum(np.linalg.norm(turns, axis=1)))


def thinned(chosen: Ints, most: int) -> Ints:
    """Return at most `most` rows of an array, spread over it: they carry much the same information."""
    if len(chosen) <= most:
        return chosen
    return chosen[np.linspace(0, len(chosen) - 1, most).round().astype(int)]
