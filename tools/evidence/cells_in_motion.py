"""An effect with one unknown number on pieces of a record in motion: each value of the number, and ranges of values.

A time counts from a row of the record on. The effect on a piece depends on the time only where the piece holds that
time. For a range of times, pieces that begin or end within it are left out. Those that hold all of it gain a turn of
any size, the same for all of them; the others are the same for each time. A range refused in this way is therefore
refused for each time. In the smallest ranges no piece begins or ends.

Columns of a few time constants in and about a range represent those of each time constant within it, by polynomials of
the logarithm. Derivatives bound the error of that.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.effects import STRAPDOWN_EFFECTS, EffectPlace
from ...models.effects.columns import TIME_CONSTANT
from ...models.effects.last_stage import LAST_HOUR
from ..bounded.programmes import SolverError
from ..bounded.sets import sharpened
from ..bounded.work import Work
from .cells import most_bent
from .fit import estimated, least_radius
from .observation import Group, boundaries_of, errors_between

ROUNDS = 6
"""Rounds of Lawson's algorithm before a range is handed to a linear programme."""
RATIO, SHORTEST, LONGEST = 1.002, 0.05, 10.0
"""Ratio of neighbouring time constants; the shortest, as a part of the first pieces; the longest, in lengths of the
record."""
TIMES_AT_ONCE = 80
"""Time constants of the least ranges."""
SPACING, DEGREE, AROUND = 40, 7, 3
"""Time constants between two nodes, degree of the polynomials through the nodes that give all others, and the number of
nodes beyond each end."""
NODES_AT_ONCE = 8
"""Most time constants whose columns are calculated together: each needs a number a row."""
MOST_EIGHTH = 222.8
"""The largest eighth derivative of e^(−x) by the logarithm of x."""
MISSED = MOST_EIGHTH * (0.5 * 1.5 * 2.5 * 3.5) ** 2 * (SPACING * math.log(RATIO)) ** 8 / math.factorial(8)
"""Largest error of this polynomial of an exponential, relative to its size at the first row."""
WEIGHED = 2.0
"""Largest sum of the weights of the values at its nodes."""
HELD = 1e-9
"""What polynomials add less, relatively, is left away, and counts as an error."""
LEFT_AWAY = 1e-3
"""Largest action, in bounds, that is neglected where a few columns hold those of a range of time constants."""
FEWEST = 2
"""Least number of moves, or windows of the least length, before an onset and after it."""
Columns = list[Floats]
OverBounds = Callable[[Sequence[Floats]], Floats]
"""Columns (S, d, K) of each group of pieces -> rows (M, K) over their bounds."""
Range = tuple[Floats, float]
"""Columns (M, L) over the bounds that hold an effect with any number of a range, and by how many bounds it may miss."""


def searched_places() -> tuple[EffectPlace, ...]:
    """Return the places of gyros' effects with an unknown number."""
    places: list[EffectPlace] = []
    for effect in STRAPDOWN_EFFECTS.values():
        if effect.searched is not None:
            places += effect.places
    return tuple(places)


SEARCHED = searched_places()


@dataclass(frozen=True, eq=False)
class SteppingAdditions:
    """Additions of an effect to groups of pieces from the first row on; the cells of its number follow from them.

    `hours` (N,) is the time of each row since the first; `resting` (N,) marks the rows of rests. `integral` (N, 3, K)
    is the effect's turn up to each row. `counted` (N, 3, K) is each row's part of the mean over all rests; zeros where
    no mean is removed. `over_bounds` maps columns (S, d, K) of each group to rows (M, K) over the bounds of their
    errors.
    """

    hours: Floats
    groups: tuple[Group, ...]
    resting: Bools
    integral: Floats
    counted: Floats
    over_bounds: OverBounds

    @cached_property
    def boundaries(self) -> Ints:
        """Rows at which pieces begin or end."""
        return boundaries_of(self.groups)

    @cached_property
    def rows_between(self) -> Ints:
        """Rows at which pieces begin or end, with enough of them before and after."""
        turning = [group.pieces for group in self.groups if group.pieces.kind not in ("rests", "norms")]
        most = max(turning, key=len)
        first, last = np.sort(most.first)[-FEWEST], np.sort(most.last)[FEWEST - 1]
        return self.boundaries[(self.boundaries >= last) & (self.boundaries <= first)]

    at_once: ClassVar[int] = 0
    """1 of what changes at once: the last row of a range is the one before its end."""


@dataclass(frozen=True, eq=False)
class Onsets(SteppingAdditions):
    """An effect that sets in after a row: its number is the row."""

    @cached_property
    def at_rest(self) -> Floats:
        """Its part (N, 3, K) of the mean over all rests, up to each row."""
        return np.cumsum(self.counted, axis=0)

    @property
    def edges(self) -> Ints:
        """Rows at which pieces begin or end."""
        return self.rows_between

    def value(self, number: float) -> float:
        """Return a time after a row and before the next [h]."""
        return 0.5 * float(self.hours[int(number)] + self.hours[int(number) + 1])

    def number(self, value: float) -> float:
        """Return the row before a time [h]."""
        return int(np.searchsorted(self.hours, value)) - 1

    def ends(self, begin: float, end: float) -> tuple[float, float]:
        """Return the times [h] of two rows."""
        return float(self.hours[int(begin)]), float(self.hours[int(end) + self.at_once])

    def columns(self, number: float) -> tuple[Columns, Floats]:
        """Return the columns of an effect that acts after a row."""
        row = int(number)
        mean = self.at_rest[-1] - self.at_rest[row]
        return [group.since(self.integral, mean, row) for group in self.groups], mean

    def moving(self, begin: int, end: int, *, rested: bool) -> Columns:
        """Return the possible changes (S, d, 3 or 6) by an effect with an onset between two rows, against the last.

        They are a turn within pieces that hold both rows and, where it `rested` between them, the mean at rest.
        """
        moving = []
        for k, group in enumerate(self.groups):
            turn = self.turn_within(k, begin, end)
            if rested and group.mean is not None:
                turn = np.concatenate([turn, group.mean], axis=2)
            moving.append(turn)
        return moving

    def turn_within(self, k: int, begin: int, end: int) -> Floats:
        """Return the change of pieces (S, d, 3) by a turn between two rows; NaN for a piece that holds one of them."""
        group = self.groups[k]
        holding = (group.pieces.first <= begin) & (group.pieces.last >= end)
        apart = (group.pieces.last <= begin) | (group.pieces.first >= end)
        turn = group.gain * holding[:, None, None]
        turn[~(holding | apart)] = np.nan
        return turn

    def range(self, begin: int, end: int, largest: NDArray) -> Range:
        """Return the columns at the last row and those that move, which miss nothing."""
        end -= self.at_once
        rested = bool(self.resting[begin : end + 1].any())
        columns = self.over_bounds(self.columns(end)[0])
        return np.hstack([columns, self.over_bounds(self.moving(begin, end, rested=rested))]), 0.0

    def swept(self, begin: int, end: int) -> tuple[NDArray, NDArray, Floats]:
        """Return the additions of the effect at every row from one to another.

        Returns rows (M, K) at the last row, NaN where the record leaves them open; rows (M, t) that move; and the ways
        (R, t, K) in which each value adds them.
        """
        rows = slice(begin, end + 1)
        ways = [self.integral[end] - self.integral[rows]]
        if self.groups[0].mean is not None:
            ways.append(self.at_rest[rows] - self.at_rest[end])
        moving = np.nan_to_num(self.over_bounds(self.moving(begin, end, rested=True)))
        return self.over_bounds(self.columns(end)[0]), moving, np.concatenate(ways, axis=1)


@dataclass(frozen=True, eq=False)
class Slips(Onsets):
    """A slip of the block after a moment: columns of readings, then of the gyros' integrals.

    `hours` are those of one or several moments a row, since the record's first rest. `whole` (S, 3, 3) of each group is
    the slip's addition to a piece that holds it, or to a later reading; a reading on both sides of it is undetermined.
    `missed` is the error by the small number of moments, in bounds.
    """

    whole: tuple[Floats, ...]
    missed: float

    at_once: ClassVar[int] = 1

    def columns(self, number: float) -> tuple[Columns, Floats]:
        """Return columns with the slip itself; NaN of readings that are of both sides of it."""
        columns, mean = super().columns(number)
        readings, turned = (group.pieces for group in self.groups)
        before, across = readings.last <= number, (turned.first <= number) & (number < turned.last)
        columns[0] = self.whole[0] * ~before[:, None, None]
        columns[0][~before & (readings.first <= number)] = np.nan
        columns[1][across] += self.whole[1][across]
        return columns, mean

    def turn_within(self, k: int, begin: int, end: int) -> Floats:
        """Return the same where the slip is behind the moment `end` at the latest and a moment follows it."""
        pieces, gain = self.groups[k].pieces, self.groups[k].gain
        holding = (pieces.first <= begin) & (pieces.last > end) & (k > 0)
        turn = gain * holding[:, None, None]
        turn[~(holding | (pieces.last <= begin) | (pieces.first > end))] = np.nan
        return turn


@dataclass(frozen=True, eq=False)
class TimeConstants(SteppingAdditions):
    """An effect that fades with a time constant, numbered from the shortest of the search."""

    samples: dict[int, Floats] = field(default_factory=dict)

    @cached_property
    def times(self) -> Floats:
        """Time constants (J,) [h] of the search, near each other."""
        low, high = SHORTEST * self.hours[self.rows_between[0]], LONGEST * self.hours[-1]
        count = TIMES_AT_ONCE * max(1, math.ceil(math.log(high / low) / math.log(RATIO) / TIMES_AT_ONCE)) + 1
        return np.geomspace(low, high, count)

    @cached_property
    def step(self) -> float:
        """Difference of the logarithms of neighbouring time constants."""
        return math.log(self.times[1] / self.times[0])

    @cached_property
    def turning(self) -> Floats:
        """Turn (N - 1, 3, K) of each step by the effect from its beginning."""
        return np.diff(self.integral, axis=0)

    @property
    def edges(self) -> Ints:
        """Numbers, evenly spaced."""
        return np.arange(0, len(self.times), TIMES_AT_ONCE)

    def value(self, number: float) -> float:
        """Return the time constant [h] of a number, between two of `times` or beyond them."""
        return float(self.times[0] * math.exp(self.step * number))

    def number(self, value: float) -> float:
        """Return the number of a time constant [h]."""
        return math.log(value / self.times[0]) / self.step

    def ends(self, begin: float, end: float) -> tuple[float, float]:
        """Return the time constants [h] at both ends; a cell at the edge also holds everything beyond it."""
        low, high = 0.0, LAST_HOUR
        if begin > 0:
            low = self.value(begin)
        if end < len(self.times) - 1:
            high = self.value(end)
        return low, high

    def columns(self, number: float) -> tuple[Columns, Floats]:
        """Return the columns of a fading effect."""
        return self._columns_of([number])[0]

    def _columns_of(self, numbers: Sequence[float]) -> list[tuple[Columns, Floats]]:
        """Return the columns of an effect that fades with each of some time constants."""
        times = np.array([[self.value(number)] for number in numbers])
        parts = np.exp(-self.hours[1:] / times)
        sums, means = _up_to(self.turning, parts, self.boundaries), _sum_of(self.counted[1:], parts)
        return [
            (errors_between(self.groups, self.boundaries, of_one, mean), mean)
            for of_one, mean in zip(sums, means, strict=True)
        ]

    def range(self, begin: int, end: int, largest: NDArray) -> Range:
        """Return few columns that represent those of a few time constants, with the error of their polynomials."""
        missed = self._missed
        size = WEIGHED * np.linalg.norm(largest)
        few, left_away = held(np.hstack(self._samples(self._nodes(begin, end))), LEFT_AWAY / float(size))
        return few, float((missed @ largest + left_away * size).max())

    def swept(self, numbers: NDArray) -> tuple[NDArray, NDArray, Floats]:
        """Return the additions of the effect for time constants with the given numbers (R,), evenly spaced.

        Returns rows (M, t) that move and the ways (R, t, K) to add them, polynomials of the logarithm. The error (M, K)
        is that of the straight line between two neighbours, for any time constant between them.
        """
        nodes = self._nodes(numbers[0], numbers[-1])
        samples = np.stack(self._samples(nodes), axis=1)
        rows, count, per_row = samples.shape
        # The dropped part is judged in the units of the errors.
        units = self.over_bounds([np.ones((*group.gain.shape[:2], 1)) for group in self.groups])
        errors = samples.reshape(rows, -1) / np.where(units > 0.0, units, 1.0)
        basis, sizes, parts = np.linalg.svd(errors, full_matrices=False)
        retained, basis = sizes > HELD * sizes[0], basis * sizes * units
        at = parts[retained].reshape(-1, count, per_row).transpose(1, 0, 2)
        places = (numbers - nodes[0]) / SPACING
        own_nodes = np.clip(places.astype(int) - AROUND, 0, count - DEGREE - 1)[:, None] + np.arange(DEGREE + 1)
        ways = np.einsum("rj,rjtk->rtk", lagrange(places, own_nodes), at[own_nodes])
        width = self.step * (numbers[1] - numbers[0])
        slow = np.array([[self.value(numbers[0]), self.value(numbers[-1])]])
        bent = most_bent(self.hours[1:, None] / slow)[:, 0] * width**2 / 8.0
        left_away = WEIGHED * np.linalg.norm(basis[:, ~retained], axis=1)
        return basis[:, retained], ways, self._at_most(bent + MISSED) + left_away[:, None]

    @staticmethod
    def _nodes(begin: float, end: float) -> Ints:
        """Return the numbers of the time constants that serve as nodes between two numbers."""
        first, last = math.floor(begin / SPACING) - AROUND, math.ceil(end / SPACING) + AROUND
        return SPACING * np.arange(first, max(last, first + DEGREE) + 1)

    def _samples(self, numbers: Ints) -> list[Floats]:
        """Rows (M, K) with some time constants, kept for the ranges that share them."""
        unknown = [number for number in numbers.tolist() if number not in self.samples]
        for begin in range(0, len(unknown), NODES_AT_ONCE):
            some = unknown[begin : begin + NODES_AT_ONCE]
            for number, (columns, _) in zip(some, self._columns_of(some), strict=True):
                self.samples[number] = self.over_bounds(columns)
        return [self.samples[number] for number in numbers.tolist()]

    @cached_property
    def _missed(self) -> Floats:
        """The largest errors (M, K) by polynomials in place of exponentials."""
        return self._at_most(np.full(len(self.turning), MISSED))

    @cached_property
    def _sizes(self) -> tuple[Floats, Floats]:
        """Sizes (N - 1, 3, K) of the turns and of the parts of the mean at rest, without signs."""
        return np.abs(self.turning), np.abs(self.counted[1:])

    def _at_most(self, part: NDArray) -> Floats:
        """Return the largest errors (M, K) from a part (N - 1,), of either sign, of the effect at each row."""
        turning, counted = self._sizes
        (sums,), (mean,) = _up_to(turning, part[None], self.boundaries), _sum_of(counted, part[None])
        largest = [group.largest for group in self.groups]
        return self.over_bounds(errors_between(largest, self.boundaries, sums, mean))


Cells = Onsets | TimeConstants
"""Cells of an unknown number: ranges of it, and the responses of the effect in each."""


def cells_of(
    place: EffectPlace,
    hours: Floats,
    groups: tuple[Group, ...],
    over_bounds: OverBounds,
    integral: Floats,
    counted: Floats | None = None,
    resting: Bools | None = None,
) -> Cells:
    """Return the cells of an effect's number; one that is not searched acts from the first row on.

    Arguments are as for `InMotion`; without a mean at rest that is taken out there is none to count.
    """
    if counted is None or resting is None:
        counted, resting = np.zeros_like(integral), np.zeros(len(hours), dtype=bool)
    if place.definition.searched == TIME_CONSTANT:
        return TimeConstants(hours, groups, resting, integral, counted, over_bounds)
    return Onsets(hours, groups, resting, integral, counted, over_bounds)


def _sum_of(additions: NDArray, parts: NDArray) -> Floats:
    """Return the sums (J, 3, K) of J parts (J, n) of some additions (n, 3, K)."""
    count, axes, columns = additions.shape
    return (parts @ additions.reshape(count, axes * columns)).reshape(len(parts), axes, columns)


def _up_to(additions: NDArray, parts: NDArray, rows: NDArray) -> Floats:
    """Return the sums (J, R, 3, K) of J parts (J, N - 1) of additions (N - 1, 3, K) before some rows (R,), in order."""
    ends = (0, *rows.tolist())
    sums = [_sum_of(additions[start:end], parts[:, start:end]) for start, end in pairwise(ends)]
    return np.cumsum(np.stack(sums, axis=1), axis=1)


def lagrange(at: NDArray, nodes: NDArray) -> Floats:
    """Return the weights of the values at nodes (R, j) in the polynomials through them, at the given numbers (R,)."""
    weights = np.ones(nodes.shape)
    for node in range(nodes.shape[1]):
        for further in range(nodes.shape[1]):
            if further != node:
                weights[:, node] *= (at - nodes[:, further]) / (nodes[:, node] - nodes[:, further])
    return weights


def held(matrix: NDArray, most: float) -> tuple[Floats, float]:
    """Return the fewest columns (M, L) that span columns (M, n), except for short rows; and the longest of these.

    `most` is the largest length of a row that is dropped.
    """
    basis, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    basis = basis * sizes
    left_away = np.sqrt(np.cumsum((basis**2)[:, ::-1], axis=1)).max(axis=0, initial=0.0)
    count = int(np.searchsorted(left_away, most))
    if not count:
        return basis, 0.0
    return basis[:, :-count], float(left_away[count - 1])


def refused(matrix: NDArray, residual: NDArray, limit: float, work: Work) -> bool:
    """Return whether rows (M, P) in units of their bounds leave a radius above the limit for any coefficients.

    Weighted least squares or a linear programme prove it; an unsolved programme proves nothing. Their cost is added to
    the work.
    """
    if not len(residual):
        return False
    scale = np.linalg.norm(matrix, axis=0)
    matrix = matrix[:, scale > 0.0] / scale[scale > 0.0]
    weights = np.full(len(residual), 1.0 / len(residual))
    for _ in range(ROUNDS):
        work.add(300.0 + 0.1 * matrix.size)
        root = np.sqrt(weights)
        misfit = residual - matrix @ estimated(root[:, None] * matrix, root * residual)
        if weights @ misfit**2 > limit**2 * (1.0 + 1e-6):
            return True
        if np.abs(misfit).max() <= limit:
            return False
        weights = sharpened(weights, misfit)
    free = np.full(matrix.shape[1], np.inf)
    try:
        return least_radius(matrix, residual, (-free, free), estimated(matrix, residual))[0] > limit
    except SolverError:
        return False
