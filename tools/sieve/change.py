"""Which single change makes a wrong row fit: an angle, a sign, an exchange, a reading, the readings of another row."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ..bounded.programmes import chebyshev_radius, least_squares
from ..rounding import digits
from .exchange import NEAR, WrongRows
from .table import SECOND_ORDER, TableRows

SCAN = np.radians(np.arange(-180.0, 180.0, 0.25))
"""Changes of an angle that are tried [rad]."""
DIFFERENCE = 1e-6
NEWTON, TRIED = 12, 3
"""Steps from a scanned angle to the best one near it, and the number of best ones that are tried."""
DECIMALS = 4
"""Angles are stated to this many decimals of a degree."""
ANGLES = ("alpha", "beta")
GREEK = {"alpha": "α", "beta": "β"}
READING, DISCRETE, ANGLE, BOTH, ROW = 2, 2, 2, 3, 4
"""Numbers that count for a wrong reading, a discrete cause, an angle, both angles, and a row with an unknown error."""


@dataclass(frozen=True)
class RowChange:
    """A change with which a row fits: the numbers that it needs, in words, and as the result has it.

    `words` follow "Row 20 is wrong; all others fit." `reading`: the accelerometer, from 1, if its reading alone is
    wrong.
    """

    numbers: int
    words: str
    keys: Mapping[str, Any] = field(default_factory=dict)
    reading: int | None = None


NOTHING = RowChange(ROW, "No angle mends it. Possible cause: a disturbed rest.")


@dataclass(frozen=True, eq=False)
class Mending:
    """A row (from 0) that is wrong, and all rows that are; the table is linear about the fit of the others."""

    table: TableRows
    row: int
    wrong: Ints

    @cached_property
    def best(self) -> RowChange:
        """The simplest change with which the row fits."""
        for changes in (self.discrete(), self.readings(), self.angles()):
            every = list(changes)
            if every:
                return every[0] if len(every) == 1 else _either(every)
        return self.both_angles or NOTHING

    # Fit of the other rows

    @cached_property
    def alone(self) -> WrongRows:
        """The row, and the right rows that it must fit together with."""
        return WrongRows(self.table, np.array([self.row]), self.wrong)

    @property
    def bound(self) -> Floats:
        """Bounds of the row's readings (3,)."""
        return self.alone.bound[0]

    @property
    def reading(self) -> Floats:
        """Readings of the row (3,) [g]."""
        return self.alone.reading[0]

    @property
    def written(self) -> Floats:
        """Angles (2,) [rad]."""
        return self.alone.angles[0]

    def predicted(self, angles: NDArray) -> Floats:
        """Readings (K, 3) at other angles (K, 2), at the fit of the others."""
        return self.alone.predicted(angles)

    # Changes

    def discrete(self) -> Iterator[RowChange]:
        """Yield changes without a free number."""
        yield from self.copied()
        for exchange in self.alone.exchanges():
            shifts = _wrapped(exchange.angles[0] - self.written)
            if shifts.any():
                yield RowChange(DISCRETE, f"It fits with {exchange.words} ({_in_words(shifts)}).", _keys(shifts))
            else:
                yield RowChange(DISCRETE, f"It fits with {exchange.words}.", exchange.keys)

    def copied(self) -> Iterator[RowChange]:
        """Yield the change to another row whose readings or angles this row may hold."""
        linear = self.table.linear
        apart = np.abs(linear.reading - self.reading).max(axis=1)
        apart[self.row] = np.inf
        same = np.flatnonzero(apart <= 2.0 * self.bound.max())
        for row in same[np.argsort(apart[same], kind="stable")][:1]:
            number = int(self.table.numbers[row])
            yield RowChange(DISCRETE, f"Its readings are those of row {number}.", {"readings_of_row": number})
        if len(same):
            return
        at = linear.positions
        angles = np.column_stack((at.alpha, at.beta))
        near = np.abs(self.predicted(angles) - self.reading).max(axis=1)
        near[self.row] = np.inf
        for row in np.flatnonzero(near <= NEAR):
            if self.alone.fit(angles[row][None], self.alone.reading):
                number = int(self.table.numbers[row])
                yield RowChange(
                    DISCRETE, f"Its readings belong to the angles of row {number}.", {"angles_of_row": number}
                )
                return

    def readings(self) -> Iterator[RowChange]:
        """One of the three readings is wrong, the two others fit."""
        rows = self.alone.derivatives(self.written[None])
        error = (self.reading - self.predicted(self.written[None])[0]) / self.bound
        for k in range(3):
            kept = np.arange(3) != k
            if self.alone.radius_with(rows[kept], error[kept]) <= self.table.limit + SECOND_ORDER:
                size = float(error[k] * self.bound[k])
                words = f"f{k + 1} alone does not fit, by about {digits(size, 3)} g."
                yield RowChange(READING, words, {f"f{k + 1}_g": size}, reading=k + 1)

    def angles(self) -> Iterator[RowChange]:
        """One angle is wrong."""
        for axis in range(len(ANGLES)):
            shift = self._angle(axis)
            if shift is not None:
                shifts = np.zeros(2)
                shifts[axis] = shift
                yield RowChange(ANGLE, f"It fits with {_in_words(_wrapped(shifts))}.", _keys(_wrapped(shifts)))

    def _angle(self, axis: int) -> float | None:
        """Return the error of an angle [rad] whose correction makes the row fit; None where none does."""
        unit = np.eye(2)[axis]
        missed = np.linalg.norm(self.predicted(self.written + SCAN[:, None] * unit) - self.reading, axis=1)
        is_least = (missed <= np.roll(missed, 1)) & (missed <= np.roll(missed, -1))
        for start in sorted(np.flatnonzero(is_least), key=lambda k: missed[k])[:TRIED]:
            shift = float(SCAN[start])
            for _ in range(NEWTON):
                error, slope = self._about(self.written + shift * unit, axis)
                shift += float(slope @ error / (slope @ slope))
            if np.abs(error).max() > NEAR:
                continue
            radius, step = self._free(self.written + shift * unit, [axis])
            if radius <= self.table.limit + SECOND_ORDER:
                return shift + float(step[0])
        return None

    @cached_property
    def both_angles(self) -> RowChange | None:
        """Return other angles that fit the row: the readings belong to some attitude, though not to this one."""
        grid = np.radians(np.arange(0.0, 360.0, 5.0))
        every = np.stack(np.meshgrid(grid, grid, indexing="ij"), axis=-1).reshape(-1, 2)
        missed = np.linalg.norm(self.predicted(every) - self.reading, axis=1)
        angles = every[missed.argmin()]
        for _ in range(NEWTON):
            error, first = self._about(angles, 0)
            _, second = self._about(angles, 1)
            angles = angles + np.linalg.lstsq(np.column_stack((first, second)), error, rcond=None)[0]
        if np.abs(error).max() > NEAR or self._free(angles, [0, 1])[0] > self.table.limit + SECOND_ORDER:
            return None
        words = "Its readings are those of some attitude, though of none that one angle more or less gives."
        return RowChange(BOTH, words, _keys(_wrapped(angles - self.written)))

    def _about(self, angles: NDArray, axis: int) -> tuple[NDArray, NDArray]:
        """Errors (3,) at angles (2,), and derivatives (3,) of the prediction by one of them."""
        step = DIFFERENCE * np.eye(2)[axis]
        here, before, after = self.predicted(np.array([angles, angles - step, angles + step]))
        return self.reading - here, (after - before) / (2.0 * DIFFERENCE)

    def _free(self, angles: NDArray, axes: list[int]) -> tuple[float, Floats]:
        """The radius with some of the row's angles free, and their steps [rad] from the given ones by least squares."""
        matrix, target = self.alone.others
        error, _ = self._about(angles, 0)
        slopes = [self._about(angles, axis)[1] / self.bound for axis in axes]
        free = np.zeros((len(matrix), len(axes)))
        wide = np.vstack((np.hstack((matrix, free)), np.column_stack((self.alone.derivatives(angles[None]), *slopes))))
        errors = np.append(target, error / self.bound)
        radius, _, _ = chebyshev_radius(wide, errors, np.ones(len(errors)))
        return radius, least_squares(wide, errors)[matrix.shape[1] :]


def _either(changes: list[RowChange]) -> RowChange:
    """Several changes that each do, in one breath."""
    words = " Or: ".join(change.words for change in changes)
    first = changes[0]
    return RowChange(first.numbers, words, first.keys, first.reading)


def _wrapped(shifts: NDArray) -> Floats:
    """Angles within half a turn [rad]."""
    return (shifts + np.pi) % (2.0 * np.pi) - np.pi


def _keys(shifts: NDArray) -> dict[str, float]:
    """Changes of the angles that are not zero [deg]."""
    keys = {}
    for name, shift in zip(ANGLES, np.round(np.degrees(shifts), DECIMALS).tolist(), strict=True):
        if shift:
            keys[f"{name}_deg"] = shift
    return keys


def _in_words(shifts: NDArray) -> str:
    """The same in words: "α smaller by 0.4002°"."""
    texts = []
    for name, shift in zip(ANGLES, np.round(np.degrees(shifts), DECIMALS).tolist(), strict=True):
        if shift:
            texts.append(f"{GREEK[name]} {'larger' if shift > 0.0 else 'smaller'} by {abs(shift):g}°")
    return ", ".join(texts)
