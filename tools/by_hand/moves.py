"""Gyros along pieces of a series: moves between rests, windows with a true attitude, turns of a known angle.

reading = (I + M) ω + S n + B in the axes of the accelerometers, late by L. The attitude is carried row by row, in all
pieces at once; its change by each parameter is an integral along the way.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ..records.stamps import grid_of
from .forces import Forces, directions_of
from .small_turns import across, cross_matrices, rotations
from .still import END, StillRests, TimedReadings

LONGEST = 120.0
"""Longer moves are left out: their rates may have drifted [s]."""
GYROS = 22
"""Parameters: three biases, nine of M, nine of S, the lag."""
BIAS, MATRIX, SENSITIVITY, LAG = slice(0, 3), slice(3, 12), slice(12, 21), 21
TURN_ERROR = np.radians(2.0)
"""Error of a hand's turn of a known angle [rad]."""


@dataclass(frozen=True, eq=False)
class Way:
    """Rows of gyros along pieces, side by side and filled up with zeros.

    Attributes
    ----------
    turn : (T, M, 3) array
        integral of the readings over each interval [rad]
    rise : (T, M, 3) array
        increase of the rates over each interval [rad/s]
    step : (T, M) array
        length of each interval [s]; 0 behind the end of a piece
    force : (T, M, 3) array
        mean specific force over each interval [g]
    ends : (M, 2) array of int
        first and last row of each piece
    """

    turn: NDArray[np.float64]
    rise: NDArray[np.float64]
    step: NDArray[np.float64]
    force: NDArray[np.float64]
    ends: NDArray[np.int_]

    @staticmethod
    def of(series: TimedReadings, ends: NDArray[np.int_]) -> "Way":
        """Return the way of pieces between rows (M, 2)."""
        assert series.rate is not None
        ends = ends.reshape(-1, 2)
        longest, count = int((ends[:, 1] - ends[:, 0]).max(initial=0)), len(ends)
        turn, rise, force = np.zeros((3, longest, count, 3))
        step = np.zeros((longest, count))
        for number, (first, last) in enumerate(ends.tolist()):
            size = last - first
            seconds = np.diff(series.time_s[first : last + 1])
            rate, values = series.rate[first : last + 1], series.force[first : last + 1]
            turn[:size, number] = 0.5 * (rate[1:] + rate[:-1]) * seconds[:, None]
            rise[:size, number] = np.diff(rate, axis=0)
            step[:size, number] = seconds
            force[:size, number] = 0.5 * (values[1:] + values[:-1])
        return Way(turn, rise, step, force, ends)

    def those(self, chosen: NDArray) -> "Way":
        """Return the way of some of the pieces."""
        longest = int(np.diff(self.ends[chosen], axis=1).max(initial=0))
        parts = (self.turn, self.rise, self.step, self.force)
        turn, rise, step, force = (part[:longest, chosen] for part in parts)
        return Way(turn, rise, step, force, self.ends[chosen])

    @cached_property
    def angle(self) -> NDArray[np.float64]:
        """The total angle (M,) that the readings turn, to and fro [rad]."""
        return np.linalg.norm(self.turn, axis=2).sum(axis=0)

    def true_turns(self, gyros: NDArray) -> NDArray[np.float64]:
        """Return the turns (T, M, 3) of the block over the intervals [rad], for gyros of parameters (22,)."""
        inverse = np.linalg.inv(np.eye(3) + gyros[MATRIX].reshape(3, 3))
        added = gyros[BIAS] + self.force @ gyros[SENSITIVITY].reshape(3, 3).T
        return (self.turn + gyros[LAG] * self.rise - added * self.step[:, :, None]) @ inverse.T

    def carried(self, gyros: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the rotations (M, 3, 3) from the end's axes to the beginning's, and their changes (M, 3, 22).

        A change is a small turn in the beginning's axes.
        """
        inverse = np.linalg.inv(np.eye(3) + gyros[MATRIX].reshape(3, 3))
        true = self.true_turns(gyros)
        count = true.shape[1]
        small = rotations(true)
        # Integrals along the way, in the axes of its beginning: each interval's step, turn, force, rise.
        columns = np.zeros((*self.step.shape, 10))
        columns[:, :, 0] = self.step
        columns[:, :, 1:4] = true
        columns[:, :, 4:7] = self.force * self.step[:, :, None]
        columns[:, :, 7:10] = self.rise @ inverse.T
        rotation = np.tile(np.eye(3), (count, 1, 1))
        integrals = np.zeros((count, 9, 10))
        for number in range(len(true)):
            after = rotation @ small[number]
            # A turn within the interval acts at its middle.
            middle = (0.5 * (rotation + after)).reshape(count, 9, 1)
            integrals += middle * columns[number][:, None, :]
            rotation = after
        integrals = integrals.reshape(count, 3, 3, 10)
        turned = np.einsum("mikc,kj->mijc", integrals, inverse)
        changes = np.zeros((count, 3, GYROS))
        changes[:, :, BIAS] = -turned[:, :, :, 0]
        changes[:, :, MATRIX] = -turned[:, :, :, 1:4].reshape(count, 3, 9)
        changes[:, :, SENSITIVITY] = -turned[:, :, :, 4:7].reshape(count, 3, 9)
        changes[:, :, LAG] = np.einsum("mikk->mi", integrals[:, :, :, 7:10])
        return rotation, changes


@dataclass(frozen=True, eq=False)
class PieceRows:
    """Errors (M, d) of pieces [rad], and their slopes by the nine parameters of the accelerometers (M, d, 9) and by
    those of the gyros (M, d, 22). Their mean square (M, d) is by readings of the accelerometers with unit errors."""

    error: NDArray[np.float64]
    by_forces: NDArray[np.float64]
    by_gyros: NDArray[np.float64]
    by_readings: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moves:
    """Moves between neighbouring rests.

    Attributes
    ----------
    way : Way
        of M moves
    rests : (M, 2) array of int
        the rests before and after each
    before, after : (M, 3) array
        mean readings of the accelerometers at the ends of these rests [g]
    """

    way: Way
    rests: NDArray[np.int_]
    before: NDArray[np.float64]
    after: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.rests)

    def those(self, chosen: NDArray) -> "Moves":
        """Return some of the moves."""
        return Moves(self.way.those(chosen), self.rests[chosen], self.before[chosen], self.after[chosen])

    def among(self, rests: NDArray[np.int_], count: int) -> "Moves":
        """Return the moves between two of some of `count` rests, renumbered."""
        number = np.full(count, -1)
        number[rests] = np.arange(len(rests))
        moves = self.those(np.flatnonzero((number[self.rests] >= 0).all(axis=1)))
        return replace(moves, rests=number[moves.rests])

    def rows(self, forces: Forces, gyros: NDArray) -> PieceRows:
        """Return the errors (M, 2) of gravity's directions, across those before the moves."""
        start, start_reading, start_x = directions_of(forces.x, self.before)
        end, end_reading, end_x = directions_of(forces.x, self.after)
        rotation, changes = self.way.carried(gyros)
        carried = np.einsum("mij,mj->mi", rotation, end)
        sideways = across(start)
        by_readings = np.square(sideways @ rotation @ end_reading).sum(axis=2)
        by_readings += np.square(sideways @ start_reading).sum(axis=2)
        return PieceRows(
            np.einsum("mki,mi->mk", sideways, carried - start),
            sideways @ (rotation @ end_x - start_x),
            -sideways @ cross_matrices(carried) @ changes,
            by_readings,
        )


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows with a true attitude at both ends, from the axes of the block to those of a fixed frame.

    Attributes
    ----------
    way : Way
        of M windows
    true : (M, 3, 3) array
        rotations from the end's axes to the beginning's
    """

    way: Way
    true: NDArray[np.float64]

    def __len__(self) -> int:
        return len(self.true)

    def those(self, chosen: NDArray) -> "Windows":
        """Return some of the windows."""
        return Windows(self.way.those(chosen), self.true[chosen])

    def rows(self, _: Forces, gyros: NDArray) -> PieceRows:
        """Return the errors (M, 3) of the carried rotations."""
        rotation, changes = self.way.carried(gyros)
        error = (
            Rotation.from_matrix(rotation @ self.true.transpose(0, 2, 1)).as_rotvec() if len(self) else self.true[:, 0]
        )
        return PieceRows(error, np.zeros((len(self), 3, 9)), changes, np.zeros((len(self), 3)))


@dataclass(frozen=True, eq=False)
class Turns:
    """Turns of known angles (T,) [rad] about a steady axis, and the error of an angle [rad]."""

    way: Way
    angle: NDArray[np.float64]
    error: float = TURN_ERROR

    def __len__(self) -> int:
        return len(self.angle)

    def rows(self, gyros: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the errors (T,) of the turns over that of an angle, and their slopes (T, 22)."""
        inverse = np.linalg.inv(np.eye(3) + gyros[MATRIX].reshape(3, 3))
        true = self.way.true_turns(gyros).sum(axis=0)
        angle = np.linalg.norm(true, axis=1)
        axis = true / np.where(angle > 0.0, angle, 1.0)[:, None] @ inverse
        seconds = self.way.step.sum(axis=0)
        force = (self.way.force * self.way.step[:, :, None]).sum(axis=0)
        slopes = np.zeros((len(self), GYROS))
        slopes[:, BIAS] = -axis * seconds[:, None]
        slopes[:, MATRIX] = -(axis[:, :, None] * true[:, None, :]).reshape(-1, 9)
        slopes[:, SENSITIVITY] = -(axis[:, :, None] * force[:, None, :]).reshape(-1, 9)
        return (angle - self.angle) / self.error, slopes / self.error


def moves_of(series: TimedReadings, rests: StillRests, broken: NDArray[np.bool_]) -> Moves:
    """Return the moves between rests without a gap and without a broken row (N,), each of at most two minutes."""
    gaps = np.concatenate([[0], np.cumsum(grid_of(series.time_s).is_gap | broken[1:])])
    end = max(1, round(END / series.period))
    pairs, ends, before, after = [], [], [], []
    for number in range(len(rests) - 1):
        at, then = rests.rows[number], rests.rows[number + 1]
        standing = slice(max(at.start, at.stop - end), at.stop)
        coming = slice(then.start, min(then.stop, then.start + end))
        first, last = (standing.start + standing.stop - 1) // 2, (coming.start + coming.stop - 1) // 2
        if gaps[last] != gaps[first] or series.time_s[last] - series.time_s[first] > LONGEST:
            continue
        pairs.append((number, number + 1))
        ends.append((first, last))
        before.append(series.force[standing].mean(axis=0))
        after.append(series.force[coming].mean(axis=0))
    rows = np.array(ends, dtype=int).reshape(-1, 2)
    return Moves(
        Way.of(series, rows),
        np.array(pairs, dtype=int).reshape(-1, 2),
        np.array(before).reshape(-1, 3),
        np.array(after).reshape(-1, 3),
    )
