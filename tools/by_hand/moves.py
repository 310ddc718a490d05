"""Gyros along pieces of a series: moves between rests, windows with a true attitude, turns of a known angle.

reading = (I + M) ω + S n + B in the axes of the accelerometers, late by L. The attitude is carried row by row, in all
pieces at once; its change by each parameter is an integral along the way. Near these parameters the change is used.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.arrays import Bools, Floats, Ints
from ...models.bench import BIAS, GYRO_PARAMETERS, LAG, MATRIX, SENSITIVITY
from ..memory import each, once
from ..records.stamps import grid_of
from .forces import Forces, directions_of
from .small_turns import across, cross_matrices, rotations
from .still import END, StillRests, TimedReadings, mean_of_rows

LONGEST = 120.0
"""Longer moves are left out: their rates may have drifted [s]."""
GYROS = len(GYRO_PARAMETERS)
TURN_ERROR, TURN_BIAS = np.radians([2.0, 3.0])
"""Error of a hand's turn of a known angle, and of all turns alike: a person may take 357° for once round [rad]."""
BLOCK = 50_000
"""Intervals that are carried at once."""
NEAR = 1e-5
"""Smaller changes of a rotation are taken as linear in the parameters; their squares are below all errors [rad]."""
ROUGH = 1e-3
"""The same for errors of left-out moves, of which two digits are shown [rad]."""
MOST_EXPANSIONS = 12
"""Most parameters at which the rotations of a series are kept."""


@dataclass(eq=False)
class Way:
    """Intervals between neighbouring rows along pieces of a series, piece after piece.

    Attributes
    ----------
    series : TimedReadings
        with rates
    ends : (M, 2) array of int
        first and last row of each piece
    near : float
        largest change of a rotation that is taken as linear in the parameters [rad]
    """

    series: TimedReadings
    ends: Ints
    near: float = NEAR

    def those(self, chosen: NDArray) -> "Way":
        """Return the way of some of the pieces."""
        return Way(self.series, self.ends[chosen], self.near)

    @cached_property
    def sizes(self) -> Ints:
        """The number of intervals (M,) of each piece."""
        return self.ends[:, 1] - self.ends[:, 0]

    @cached_property
    def begins(self) -> Ints:
        """The number (M,) of the first interval of each piece."""
        return np.cumsum(self.sizes) - self.sizes

    @cached_property
    def rows(self) -> Ints:
        """The row (T,) at the end of each interval."""
        return np.arange(self.sizes.sum()) + np.repeat(self.ends[:, 0] + 1 - self.begins, self.sizes)

    @cached_property
    def step(self) -> Floats:
        """The length (T,) of each interval [s]."""
        return self.series.time_s[self.rows] - self.series.time_s[self.rows - 1]

    @cached_property
    def turn(self) -> Floats:
        """The integral (T, 3) of the readings over each interval [rad]."""
        return self._integral(self.series.rate)

    @cached_property
    def force(self) -> Floats:
        """The integral (T, 3) of the specific force over each interval [g s]."""
        return self._integral(self.series.force)

    def _integral(self, values: NDArray | None) -> Floats:
        assert values is not None
        return 0.5 * (values[self.rows] + values[self.rows - 1]) * self.step[:, None]

    def sums(self, values: NDArray) -> Floats:
        """Return the sums (M, ...) of values (T, ...) along each piece."""
        sums = np.zeros((len(self.ends), *values.shape[1:]))
        longer = self.sizes > 0
        if longer.any():
            sums[longer] = np.add.reduceat(values, self.begins[longer])
        return sums

    @cached_property
    def angle(self) -> Floats:
        """The total angle (M,) that the readings turn, to and fro [rad]."""
        return np.diff(self.series.turned[self.ends], axis=1)[:, 0]

    def true_turns(self, gyros: NDArray) -> Floats:
        """Return the turns (T, 3) of the block over the intervals [rad], for gyros of parameters (22,)."""
        inverse = _to_true(gyros)
        turn = self.turn - self.step[:, None] * gyros[BIAS]
        if gyros[SENSITIVITY].any():
            turn -= self.force @ gyros[SENSITIVITY].reshape(3, 3).T
        if gyros[LAG]:
            turn += gyros[LAG] * self.rise
        return turn @ inverse.T

    @cached_property
    def rise(self) -> Floats:
        """The increase (T, 3) of the rates over each interval [rad/s]."""
        assert self.series.rate is not None
        return self.series.rate[self.rows] - self.series.rate[self.rows - 1]

    def carried(self, gyros: NDArray) -> tuple[Floats, Floats]:
        """Return the rotations (M, 3, 3) from the end's axes to the beginning's, and their changes (M, 3, 22).

        A change is a small turn in the beginning's axes. The series keeps the rotations at earlier parameters: near
        these, only pieces that are new are carried along their rows.
        """
        known = self.series.expansions
        expansion = min(known, key=lambda one: one.distance(gyros), default=None)
        if expansion is not None and expansion.distance(gyros) <= self.near:
            known.remove(expansion)
            expansion.extend(self)
        if expansion is None or expansion.distance(gyros) > self.near:
            expansion = Expansion(gyros.copy())
            expansion.extend(self)
        known.append(expansion)
        del known[:-MOST_EXPANSIONS]
        return expansion.carried(self, gyros)

    def _expanded(self, gyros: NDArray) -> tuple[Floats, Floats]:
        """Return the rotations and their changes, carried along all intervals."""
        inverse = _to_true(gyros)
        true, count, first = self.true_turns(gyros), len(self.ends), self.begins
        attitude = rotations(true)
        by_size = np.argsort(-self.sizes, kind="stable")
        remaining = np.searchsorted(-self.sizes[by_size], -np.arange(self.sizes.max(initial=0)), side="left")
        rotation = np.tile(np.eye(3), (count, 1, 1))
        for number, active in enumerate(remaining.tolist()):
            rows = first[by_size[:active]] + number
            rotation[:active] = attitude[rows] = rotation[:active] @ attitude[rows]
        ordered = np.empty_like(rotation)
        ordered[by_size] = rotation
        # A turn within an interval acts at its middle.
        before = np.roll(attitude, 1, axis=0)
        before[first[self.sizes > 0]] = np.eye(3)
        middle = (0.5 * (before + attitude)).reshape(-1, 9)
        # Integrals along the way, in the axes of its beginning: each interval's step, turn, force, rise.
        columns = np.column_stack([self.step, true, self.force, self.rise @ inverse.T])
        integrals = np.zeros((count, 9, 10))
        for number, begin in enumerate(first.tolist()):
            rows = slice(begin, begin + self.sizes[number])
            integrals[number] = middle[rows].T @ columns[rows]
        integrals = integrals.reshape(count, 3, 3, 10)
        turned = np.einsum("mikc,kj->mijc", integrals, inverse)
        changes = np.zeros((count, 3, GYROS))
        changes[:, :, BIAS] = -turned[:, :, :, 0]
        changes[:, :, MATRIX] = -turned[:, :, :, 1:4].reshape(count, 3, 9)
        changes[:, :, SENSITIVITY] = -turned[:, :, :, 4:7].reshape(count, 3, 9)
        changes[:, :, LAG] = np.einsum("mikk->mi", integrals[:, :, :, 7:10])
        return ordered, changes


@dataclass(eq=False)
class Expansion:
    """Rotations (P, 3, 3) over pieces of a series and their changes (P, 3, 22) at some parameters (22,) of gyros.

    `places` has the number of each piece by its first and its last row.
    """

    gyros: Floats
    places: dict[tuple[int, ...], int] = field(default_factory=dict)
    rotation: Floats = field(default_factory=lambda: np.zeros((0, 3, 3)))
    changes: Floats = field(default_factory=lambda: np.zeros((0, 3, GYROS)))

    def distance(self, gyros: NDArray) -> float:
        """Return the largest turn of a piece to other parameters [rad]."""
        return float(np.abs(self.changes.reshape(-1, GYROS) @ (gyros - self.gyros)).max(initial=0.0))

    def extend(self, way: Way) -> None:
        """Carry the pieces of a way that are new."""
        fresh = [ends for ends in map(tuple, way.ends.tolist()) if ends not in self.places]
        if not fresh:
            return
        fresh_way = Way(way.series, np.array(fresh))
        # Blocks of pieces stay in the processor's cache.
        blocks = np.array_split(fresh_way.ends, max(1, int(fresh_way.sizes.sum()) // BLOCK))
        parts = [Way(way.series, ends)._expanded(self.gyros) for ends in blocks]
        self.places |= {ends: number for number, ends in enumerate(fresh, start=len(self.places))}
        rotation, changes = zip(*parts, strict=True)
        self.rotation = np.concatenate([self.rotation, *rotation])
        self.changes = np.concatenate([self.changes, *changes])

    def carried(self, way: Way, gyros: NDArray) -> tuple[Floats, Floats]:
        """Return the rotations of a way at parameters nearby, and their changes."""
        at = np.array([self.places[ends] for ends in map(tuple, way.ends.tolist())], dtype=int)
        rotation, changes = self.rotation[at], self.changes[at]
        step = gyros - self.gyros
        return (rotations(changes @ step) @ rotation if step.any() else rotation), changes


@dataclass(frozen=True, eq=False)
class PieceRows:
    """Errors (M, d) of pieces [rad], and their slopes by the nine parameters of the accelerometers (M, d, 9) and by
    those of the gyros (M, d, 22). Their mean square (M, d) is by readings of the accelerometers with unit errors."""

    error: Floats
    by_forces: Floats
    by_gyros: Floats
    by_readings: Floats


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
    rests: Ints
    before: Floats
    after: Floats

    def __len__(self) -> int:
        return len(self.rests)

    def those(self, chosen: NDArray) -> "Moves":
        """Return some of the moves."""
        return Moves(self.way.those(chosen), self.rests[chosen], self.before[chosen], self.after[chosen])

    def among(self, rests: Ints, count: int) -> "Moves":
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
    case_error : float or None
        error of the accelerometers' axes [rad], where the rotations are in these; None of those in the axes of the true
        attitude
    """

    way: Way
    true: Floats
    case_error: float | None = None

    def __len__(self) -> int:
        return len(self.true)

    def those(self, chosen: NDArray) -> "Windows":
        """Return some of the windows."""
        return replace(self, way=self.way.those(chosen), true=self.true[chosen])

    def in_axes_of(self, forces: Forces) -> "Windows":
        """Return the windows in the axes of the accelerometers, which `forces.case` turns into the present ones."""
        assert forces.case is not None
        return replace(self, true=forces.case.T @ self.true @ forces.case, case_error=forces.case_error)

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
    angle: Floats
    error: float = TURN_ERROR

    def __len__(self) -> int:
        return len(self.angle)

    def rows(self, gyros: NDArray) -> tuple[Floats, Floats]:
        """Return the errors (T,) of the turns over that of an angle, and their slopes (T, 22)."""
        inverse = _to_true(gyros)
        way = self.way
        true, seconds, force = way.sums(way.true_turns(gyros)), way.sums(way.step), way.sums(way.force)
        angle = np.linalg.norm(true, axis=1)
        axis = true / np.where(angle > 0.0, angle, 1.0)[:, None] @ inverse
        slopes = np.zeros((len(self), GYROS))
        slopes[:, BIAS] = -axis * seconds[:, None]
        slopes[:, MATRIX] = -(axis[:, :, None] * true[:, None, :]).reshape(-1, 9)
        slopes[:, SENSITIVITY] = -(axis[:, :, None] * force[:, None, :]).reshape(-1, 9)
        return (angle - self.angle) / self.error, slopes / self.error


def moves_of(series: TimedReadings, rests: StillRests, broken: Bools) -> Moves:
    """Return the moves between rests without a gap and without a broken row (N,), each of at most two minutes."""
    gaps = once(_gaps_before, series, broken.tobytes())
    end = max(1, round(END / series.period))
    rows = [(at.start, at.stop) for at in rests.rows]
    before = [slice(max(start, stop - end), stop) for start, stop in rows[:-1]]
    after = [slice(start, min(stop, start + end)) for start, stop in rows[1:]]
    middles = [(at.start + at.stop - 1) // 2 for pair in zip(before, after, strict=True) for at in pair]
    ends = np.array(middles, dtype=int).reshape(-1, 2)
    is_short = np.diff(series.time_s[ends], axis=1)[:, 0] <= LONGEST
    kept = np.flatnonzero(is_short & (np.diff(gaps[ends], axis=1)[:, 0] == 0))
    pieces = [[of_rests[number] for number in kept.tolist()] for of_rests in (before, after)]
    of_gravity = (np.reshape(each(mean_of_rows, series.force, at), (-1, 3)) for at in pieces)
    return Moves(Way(series, ends[kept]), kept[:, None] + np.arange(2), *of_gravity)


def _to_true(gyros: NDArray) -> NDArray:
    """Return (I + M)⁻¹ (3, 3) of gyros of parameters (22,)."""
    return np.linalg.inv(np.eye(3) + gyros[MATRIX].reshape(3, 3))


def _gaps_before(series: TimedReadings, broken: bytes) -> Ints:
    """Return the number of gaps and broken rows (N,) up to each row."""
    return np.append(0, np.cumsum(grid_of(series.time_s).is_gap | np.frombuffer(broken, dtype=bool)[1:]))
