"""Effects of the gyros that set in at a time: the evidence of one time, and of all times within a stretch.

What such an effect does to a piece of the record depends on its time only where the piece holds it. Of a stretch of
times pieces that begin or end within it are left out, those that hold all of it gain a turn of any size, the same one
for all of them, and the others are the same for each time: what is refused then is refused for each time. Stretches
that are not refused are halved, down to those in which no piece begins or ends.

Effects that fade have a time constant in place of that time. Columns of a few in and about a stretch hold, by
polynomials of its logarithm, those of each within it but for an error that derivatives bound.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.effects.columns import ONSET
from ...models.effects.last_stage import LAST_HOUR
from ..bounded.sets import Work, sharpened
from .cells import most_bent
from .fit import estimated, least_radius
from .observation import Group, rows_of

STRETCHES = 16
"""Stretches of times that are tried first."""
ROUNDS = 6
"""Rounds of Lawson's algorithm before a stretch is handed to a linear programme."""
RATIO, SHORTEST, LONGEST = 1.002, 0.05, 10.0
"""Of neighbouring time constants; the shortest is a part of the first pieces, the longest so many times the record."""
TIMES_AT_ONCE = 80
"""Time constants of the least stretches."""
SPACING, DEGREE, AROUND = 40, 7, 3
"""Of the time constants between which polynomials of this degree tell all others, so many of them beyond each end."""
MOST_EIGHTH = 222.8
"""The largest eighth derivative of e^(−x) by the logarithm of x."""
MISSED = MOST_EIGHTH * (0.5 * 1.5 * 2.5 * 3.5) ** 2 * (SPACING * math.log(RATIO)) ** 8 / math.factorial(8)
"""By so much, of its size at the first row, such a polynomial misses an exponential at most."""
WEIGHED = 2.0
"""The values at its nodes count so much together, at most."""
HELD = 1e-9
"""What polynomials add less, relatively, is left away, and counts as an error."""
Columns = list[NDArray[np.float64]]
FEWEST = 2
"""So many moves, or windows of the least length, are wholly before an onset, and so many after."""


@dataclass(frozen=True, eq=False)
class Acting:
    """What an effect does from a row on: `integral` (N, 3, K) of ∫ C (I + Γ)⁻¹ δω dt up to each row.

    `at_rest` (N, 3, K) is its part of the mean over all rests up to each row; zeros where no mean is taken out.
    """

    integral: NDArray[np.float64]
    at_rest: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Fading:
    """What an effect does that fades with one of many time constants `times` (J,) [h], near each other.

    `turning` (N - 1, 3, K): C (I + Γ)⁻¹ δω dt of each row at the beginning of the effect, and `resting` (N - 1, 3, K)
    its part of the mean over all rests.
    """

    times: NDArray[np.float64]
    hours: NDArray[np.float64]
    turning: NDArray[np.float64]
    resting: NDArray[np.float64]

    @cached_property
    def samples(self) -> dict[int, list[NDArray[np.float64]]]:
        """Columns of each part with some of the time constants."""
        return {}

    @property
    def step(self) -> float:
        """Difference of the logarithms of neighbouring time constants."""
        return math.log(self.times[1] / self.times[0])

    def time(self, number: float) -> float:
        """The time constant [h] of a number, between two of `times` or beyond them."""
        return float(self.times[0] * math.exp(self.step * number))

    def at(self, number: float, rows: NDArray) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The integral (R, 3, K) up to some rows with a time constant, and its part of the mean at rest (3, K)."""
        part = np.exp(-self.hours[1:] / self.time(number))[:, None, None]
        return _up_to(self.turning * part, rows), np.einsum("nik,n->ik", self.resting, part[:, 0, 0])


def _up_to(additions: NDArray, rows: NDArray) -> NDArray[np.float64]:
    """The sums (R, 3, K) of what (N - 1, 3, K) comes before some rows (R,), in order."""
    starts = np.append(0, rows[:-1])
    some, sums = rows > starts, np.zeros((len(rows), *additions.shape[1:]))
    sums[some] = np.add.reduceat(additions[: rows[-1]], starts[some], axis=0)
    return np.cumsum(sums, axis=0)


@dataclass(frozen=True, eq=False)
class Onsets:
    """Columns of effects that set in after a row of a record, for the groups of its pieces.

    `hours` (N,) of each row since the first; `resting` (N,) whether a row belongs to a rest; `grown`: place -> what an
    effect turns up to each row (N, 3, K), and each row's part (N, 3, K) of the mean at rest.
    """

    hours: NDArray[np.float64]
    groups: tuple[Group, ...]
    resting: NDArray[np.bool_]
    grown: Callable[[EffectPlace], tuple[NDArray[np.float64], NDArray[np.float64]]]

    at_once: ClassVar[int] = 0
    """1 of what changes at once: the last row of a stretch is the one before its end."""

    @cached_property
    def ends_of_pieces(self) -> NDArray[np.int_]:
        """Rows at which pieces begin or end."""
        return rows_of([group.pieces for group in self.groups])

    @cached_property
    def edges(self) -> NDArray[np.int_]:
        """Rows at which pieces begin or end, where enough of them are before and after."""
        turning = [group.pieces for group in self.groups if group.pieces.kind not in ("rests", "norms")]
        most = max(turning, key=len)
        first, last = np.sort(most.first)[-FEWEST], np.sort(most.last)[FEWEST - 1]
        rows = self.ends_of_pieces
        return rows[(rows >= last) & (rows <= first)]

    def edges_of(self, acting: Acting | Fading) -> NDArray[np.int_]:
        """Ends of the least stretches: rows of an onset, or numbers of time constants."""
        if isinstance(acting, Acting):
            return self.edges
        return np.arange(0, len(acting.times), TIMES_AT_ONCE)

    def value(self, acting: Acting | Fading, number: float) -> float:
        """A time after a row and before the next, or a time constant [h]."""
        if isinstance(acting, Fading):
            return acting.time(number)
        return 0.5 * float(self.hours[int(number)] + self.hours[int(number) + 1])

    def number(self, acting: Acting | Fading, value: float) -> float:
        """The row, or the number of the time constant, that has such a value [h]."""
        if isinstance(acting, Fading):
            return math.log(value / acting.times[0]) / acting.step
        return int(np.searchsorted(self.hours, value)) - 1

    def ends(self, acting: Acting | Fading, begin: float, end: float) -> tuple[float, float]:
        """The values at both ends of a stretch [h].

        What stands with the shortest or longest time constant that is sought is not told from what is beyond.
        """
        if not isinstance(acting, Fading):
            return float(self.hours[int(begin)]), float(self.hours[int(end) + self.at_once])
        low, high = 0.0, LAST_HOUR
        if begin > 0:
            low = acting.time(begin)
        if end < len(acting.times) - 1:
            high = acting.time(end)
        return low, high

    def acting(self, place: EffectPlace) -> Acting | Fading:
        """What an effect does from each row on, or with each time constant."""
        integral, counted = self.grown(place)
        if place.definition.searched == ONSET:
            return Acting(integral, np.cumsum(counted, axis=0))
        low, high = SHORTEST * self.hours[self.edges[0]], LONGEST * self.hours[-1]
        count = TIMES_AT_ONCE * max(1, math.ceil(math.log(high / low) / math.log(RATIO) / TIMES_AT_ONCE)) + 1
        return Fading(np.geomspace(low, high, count), self.hours, np.diff(integral, axis=0), counted[1:])

    def columns(self, acting: Acting | Fading, row: float) -> tuple[Columns, NDArray[np.float64]]:
        """Columns (S, d, K) of each part of an effect that sets in after a row; its part (3, K) of the mean at rest.

        Of one that fades with the time constant of that number.
        """
        if isinstance(acting, Fading):
            sums, mean = acting.at(row, self.ends_of_pieces)
            return [self._between(group, sums, mean) for group in self.groups], mean
        mean = acting.at_rest[-1] - acting.at_rest[int(row)]
        return [group.since(acting.integral, mean, int(row)) for group in self.groups], mean

    def _between(self, group: Group, sums: NDArray, mean: NDArray) -> NDArray[np.float64]:
        """Columns (S, d, K) of one group by sums up to the rows at which pieces begin or end."""
        ends = self.ends_of_pieces
        first, last = np.searchsorted(ends, group.pieces.first), np.searchsorted(ends, group.pieces.last)
        return group.columns(sums, mean, first, last)

    def within(self, acting: Acting, begin: int, end: int) -> Columns:
        """Columns (S, d, L) of each part that hold what the effect does whenever it sets in from one row to another.

        NaN where a piece begins or ends between.
        """
        columns, none = self.columns(acting, end)[0], np.zeros((3, 0))
        rested = self.resting[begin : end + 1].any()
        for k, group in enumerate(self.groups):
            holding = (group.pieces.first <= begin) & (group.pieces.last >= end)
            apart = (group.pieces.last <= begin) | (group.pieces.first >= end)
            turn = group.gain * holding[:, None, None]
            turn[~(holding | apart)] = np.nan
            mean = group.mean if rested and group.mean is not None else group.gain @ none
            columns[k] = np.concatenate([columns[k], turn, mean], axis=2)
        return columns

    def swept(self, acting: Acting, begin: int, end: int) -> tuple[Columns, Columns, NDArray[np.float64]]:
        """What the effect does at every row from one to another.

        Columns (S, d, K) of each part, columns (S, d, t) that move, and of each row the ways (R, t, K) in which they
        are added.
        """
        rows = slice(begin, end + 1)
        ways = [acting.integral[end] - acting.integral[rows]]
        moving = []
        for group in self.groups:
            holding = (group.pieces.first <= begin) & (group.pieces.last >= end)
            turn = group.gain * holding[:, None, None]
            if group.mean is not None:
                turn = np.concatenate([turn, group.mean], axis=2)
            moving.append(turn)
        if self.groups[0].mean is not None:
            ways.append(acting.at_rest[rows] - acting.at_rest[end])
        return self.columns(acting, end)[0], moving, np.concatenate(ways, axis=1)

    def faded(self, acting: Fading, begin: float, end: float) -> tuple[Columns, Columns]:
        """Columns (S, d, L) of each part that hold what the effect does with any time constant between two numbers.

        And by how much (S, d, K) they may miss a unit of it, where they count as in `swept_times`.
        """
        samples = [self._sample(acting, number) for number in self._nodes(begin, end)]
        missed = self._at_most(acting, np.full(len(acting.turning), MISSED))
        columns = []
        for k in range(len(self.groups)):
            columns.append(np.concatenate([sample[k] for sample in samples], axis=2))
        return columns, missed

    def swept_times(self, acting: Fading, numbers: NDArray) -> tuple[Columns, NDArray[np.float64], Columns]:
        """What the effect does with time constants of some numbers (R,), evenly spaced.

        Columns (S, d, t) of each part that move, ways (R, t, K) in which they are added, polynomials of the logarithm;
        and by how much (S, d, K) what it does with any time constant between two neighbours may miss the straight line
        between theirs.
        """
        nodes = self._nodes(numbers[0], numbers[-1])
        samples = [self._sample(acting, number) for number in nodes]
        stacked = np.array([_stacked(sample) for sample in samples])
        count, rows, per_row = stacked.shape
        basis, sizes, parts = np.linalg.svd(stacked.transpose(1, 0, 2).reshape(rows, -1), full_matrices=False)
        retained, basis = sizes > HELD * sizes[0], basis * sizes
        at = parts[retained].reshape(-1, count, per_row).transpose(1, 0, 2)
        places = (numbers - nodes[0]) / SPACING
        own_nodes = np.clip(places.astype(int) - AROUND, 0, count - DEGREE - 1)[:, None] + np.arange(DEGREE + 1)
        ways = np.einsum("rj,rjtk->rtk", lagrange(places, own_nodes), at[own_nodes])
        ends = np.cumsum([columns[..., 0].size for columns in samples[0]])[:-1]
        width = acting.step * (numbers[1] - numbers[0])
        slow = np.array([[acting.time(numbers[0]), acting.time(numbers[-1])]])
        bent = most_bent(acting.hours[1:, None] / slow)[:, 0] * width**2 / 8.0
        bases = np.split(basis[:, retained], ends)
        left_away = np.split(WEIGHED * np.linalg.norm(basis[:, ~retained], axis=1), ends)
        moving, missed = [], []
        for k, straight in enumerate(self._at_most(acting, bent + MISSED)):
            pieces, axes, _ = straight.shape
            moving.append(bases[k].reshape(pieces, axes, -1))
            missed.append(straight + left_away[k].reshape(pieces, axes, 1))
        return moving, ways, missed

    @staticmethod
    def _nodes(begin: float, end: float) -> NDArray[np.int_]:
        """Numbers of the time constants by which those between two numbers are told."""
        first, last = math.floor(begin / SPACING) - AROUND, math.ceil(end / SPACING) + AROUND
        return SPACING * np.arange(first, max(last, first + DEGREE) + 1)

    def _sample(self, acting: Fading, number: int) -> Columns:
        """Columns with a time constant, kept for the stretches that share it."""
        sample = acting.samples.get(number)
        if sample is None:
            sample = acting.samples[number] = self.columns(acting, number)[0]
        return sample

    def _at_most(self, acting: Fading, part: NDArray) -> Columns:
        """What a part (N - 1,), of either sign, of what the effect does at each row does to the errors at most."""
        ends = self.ends_of_pieces
        grown = _up_to(np.abs(acting.turning) * part[:, None, None], ends)
        mean = np.einsum("nik,n->ik", np.abs(acting.resting), part)
        return [self._between(group.largest, grown, mean) for group in self.groups]


def _stacked(columns: Columns) -> NDArray[np.float64]:
    """Columns (S, d, K) of each part as rows (M, K)."""
    return np.concatenate([part.reshape(-1, part.shape[2]) for part in columns])


def lagrange(at: NDArray, nodes: NDArray) -> NDArray[np.float64]:
    """What the values at nodes (R, j) count in the polynomials through them at some numbers (R,)."""
    weights = np.ones(nodes.shape)
    for node in range(nodes.shape[1]):
        for further in range(nodes.shape[1]):
            if further != node:
                weights[:, node] *= (at - nodes[:, further]) / (nodes[:, node] - nodes[:, further])
    return weights


def held(matrix: NDArray, most: float) -> tuple[NDArray[np.float64], float]:
    """As few columns (M, L) as hold columns (M, n) but for rows of such a length at most; and the longest left away."""
    basis, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    basis = basis * sizes
    left_away = np.sqrt(np.cumsum((basis**2)[:, ::-1], axis=1)).max(axis=0, initial=0.0)
    count = int(np.searchsorted(left_away, most))
    if not count:
        return basis, 0.0
    return basis[:, :-count], float(left_away[count - 1])


def refused(matrix: NDArray, residual: NDArray, limit: float, work: Work) -> bool:
    """Whether rows (M, P) in units of their bounds leave a radius above the limit, whatever the coefficients.

    Weighted least squares prove it, or a linear programme does; what they cost is added to the work.
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
    return least_radius(matrix, residual, (-free, free), estimated(matrix, residual))[0] > limit
