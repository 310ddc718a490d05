"""Effects of the gyros that set in at a time: the evidence of one time, and of all times within a stretch.

What such an effect does to a piece of the record depends on its time only where the piece holds it. Of a stretch of
times pieces that begin or end within it are left out, those that hold all of it gain a turn of any size, the same one
for all of them, and the others are the same for each time: what is refused then is refused for each time. Stretches
that are not refused are halved, down to those in which no piece begins or ends.

Effects that fade have a time constant in place of that time: columns of a few in and about a stretch hold those of each
within it.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.effects.last_stage import LAST_HOUR
from ..bounded.sets import sharpened
from ..motion.carry import GyroModel, Motion
from .fit import estimated, least_radius
from .references import Gravity, Run, Truth, integrals, matrices_of
from .rows import Part, Pieces

STRETCHES = 16
"""Stretches of times that are tried first."""
ROUNDS = 6
"""Rounds of Lawson's algorithm before a stretch is handed to a linear programme."""
RATIO, SHORTEST, LONGEST = 1.002, 0.05, 10.0
"""Of neighbouring time constants; the shortest is a part of the first pieces, the longest so many times the record."""
TIMES_AT_ONCE = 80
"""Time constants of the least stretches."""
SPACING, LEAST_SIZE = 40, 1e-6
"""Of the time constants of a stretch that hold all others; what is less, relatively, is left away."""
DEGREE, HELD = 7, 1e-9
"""Of the polynomials between these; of what they add less, relatively, is left away than of what a stretch holds."""
Columns = list[NDArray[np.float64]]
FEWEST = 2
"""So many moves, or windows of the least length, are wholly before an onset, and so many after."""


class Turned(Run):
    """A run of the same attitude in which each piece gains a turn, a unit about each axis of the reference."""

    def columns(self, pieces: Pieces) -> NDArray[np.float64]:
        """Rotations (S, 3, 3) into axes of each piece's beginning."""
        return matrices_of(self.attitude[pieces.first]).transpose(0, 2, 1)


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

    def at(self, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The integral (N, 3, K) up to each row with a time constant, and its part of the mean at rest (3, K)."""
        part = np.exp(-self.hours[1:] / self.times[number])[:, None, None]
        grown = np.cumsum(self.turning * part, axis=0)
        return np.concatenate([np.zeros_like(grown[:1]), grown]), (self.resting * part).sum(axis=0)


@dataclass(frozen=True, eq=False)
class Onsets:
    """Columns of effects that set in after a row of a run of the gyros, for the parts of its evidence.

    `turns` (S, d, 3) of each part: what a turn within a piece adds to its error; `bias` (S, d, 3) what a bias adds,
    which the mean at rest takes out, None where none is; `rests` (N,) whether a row belongs to a rest.
    """

    motion: Motion
    model: GyroModel
    attitude: NDArray[np.float64]
    pieces: tuple[Pieces, ...]
    turns: tuple[NDArray[np.float64], ...]
    bias: tuple[NDArray[np.float64], ...] | None
    rests: NDArray[np.bool_]

    @staticmethod
    def turns_of(
        reference: Gravity | Truth, attitude: NDArray, x: NDArray, parts: Sequence[Part]
    ) -> tuple[NDArray, ...]:
        """What a turn within each piece of some parts of a reference's evidence adds to its error (S, d, 3)."""
        every = reference.parts(Turned(attitude, reference.rows, np.zeros((0, 3, 3)), 0), x, ())
        known = {part.label: part.columns for part in every}
        return tuple(known[part.label] for part in parts)

    @cached_property
    def hours(self) -> NDArray[np.float64]:
        """Time of each row (N,) since the first [h]."""
        return (self.motion.time_s - self.motion.time_s[0]) / 3600.0

    @cached_property
    def edges(self) -> NDArray[np.int_]:
        """Rows at which pieces begin or end, where enough of them are before and after."""
        main = max((p for p in self.pieces if p.kind not in ("rests", "norms")), key=len)
        first, last = np.sort(main.first)[-FEWEST], np.sort(main.last)[FEWEST - 1]
        every = np.unique(np.concatenate([rows for p in self.pieces for rows in (p.first, p.last)]))
        return every[(every >= last) & (every <= first)]

    def edges_of(self, acting: Acting | Fading) -> NDArray[np.int_]:
        """Ends of the least stretches: rows of an onset, or numbers of time constants."""
        return self.edges if isinstance(acting, Acting) else np.arange(0, len(acting.times), TIMES_AT_ONCE)

    def value(self, acting: Acting | Fading, number: int) -> float:
        """A time after a row and before the next, or a time constant [h]."""
        if isinstance(acting, Fading):
            return float(acting.times[number])
        return 0.5 * float(self.hours[number] + self.hours[number + 1])

    def number(self, acting: Acting | Fading, value: float) -> int:
        """The row, or the number of the time constant, that has such a value [h]."""
        if isinstance(acting, Fading):
            return int(np.abs(acting.times - value).argmin())
        return int(np.searchsorted(self.hours, value)) - 1

    def ends(self, acting: Acting | Fading, begin: int, end: int) -> tuple[float, float]:
        """The values at both ends of a stretch [h].

        What stands with the shortest or longest time constant that is sought is not told from what is beyond.
        """
        if not isinstance(acting, Fading):
            return float(self.hours[begin]), float(self.hours[end])
        low = float(acting.times[begin]) if begin > 0 else 0.0
        return low, float(acting.times[end]) if end < len(acting.times) - 1 else LAST_HOUR

    def acting(self, place: EffectPlace) -> Acting | Fading:
        """What an effect does from each row on, or with each time constant."""
        rows = np.arange(len(self.motion))
        integral = integrals(self.motion, self.model, self.attitude, [place], rows)
        counted = np.zeros_like(integral)
        if self.bias is not None:
            seen = self.motion.rows(1, len(rows), self.model.inverse, self.model.bias)
            counted[1:] = place.definition.signature(place, seen) * self.rests[1:, None, None]
            counted /= max(int(self.rests[1:].sum()), 1)
        if not place.definition.fades:
            return Acting(integral, np.cumsum(counted, axis=0))
        low, high = SHORTEST * self.hours[self.edges[0]], LONGEST * self.hours[-1]
        count = TIMES_AT_ONCE * max(1, math.ceil(math.log(high / low) / math.log(RATIO) / TIMES_AT_ONCE)) + 1
        return Fading(np.geomspace(low, high, count), self.hours, np.diff(integral, axis=0), counted[1:])

    def columns(self, acting: Acting | Fading, row: int) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """Columns (S, d, K) of each part of an effect that sets in after a row; its part (3, K) of the mean at rest.

        Of one that fades with the time constant of that number.
        """
        found = []
        if isinstance(acting, Fading):
            (integral, mean), row = acting.at(row), 0
        else:
            integral, mean = acting.integral, acting.at_rest[-1] - acting.at_rest[row]
        for k, (pieces, turns) in enumerate(zip(self.pieces, self.turns, strict=True)):
            after, before = (integral[np.maximum(rows, row)] for rows in (pieces.last, pieces.first))
            mine = turns @ (after - before)
            found.append(mine if self.bias is None else mine - self.bias[k] @ mean)
        return found, mean

    def within(self, acting: Acting | Fading, begin: int, end: int) -> list[NDArray[np.float64]]:
        """Columns (S, d, L) of each part that hold what the effect does whenever it sets in from one row to another.

        NaN where a piece begins or ends between. Of one that fades what it does with any time constant between.
        """
        if isinstance(acting, Fading):
            return self._faded(acting, begin, end)
        found, none = self.columns(acting, end)[0], np.zeros((3, 0))
        rested = self.bias is not None and self.rests[begin : end + 1].any()
        for k, (pieces, turns) in enumerate(zip(self.pieces, self.turns, strict=True)):
            holding = (pieces.first <= begin) & (pieces.last >= end)
            apart = (pieces.last <= begin) | (pieces.first >= end)
            turn = turns * holding[:, None, None]
            turn[~(holding | apart)] = np.nan
            mean = self.bias[k] if rested and self.bias is not None else turns @ none
            found[k] = np.concatenate([found[k], turn, mean], axis=2)
        return found

    def swept(self, acting: Acting | Fading, begin: int, end: int) -> tuple[Columns, Columns, NDArray[np.float64]]:
        """What the effect does at every row from one to another, or with every time constant between two numbers.

        Columns (S, d, K) of each part, columns (S, d, t) that move, and of each value the ways (R, t, K) in which they
        are added. Of time constants the latter hold what is done to a part of 1e-6.
        """
        if isinstance(acting, Fading):
            return self._swept_times(acting, begin, end)
        rows = slice(begin, end + 1)
        ways = [acting.integral[end] - acting.integral[rows]]
        moving = [
            turns * ((pieces.first <= begin) & (pieces.last >= end))[:, None, None]
            for pieces, turns in zip(self.pieces, self.turns, strict=True)
        ]
        if self.bias is not None:
            ways.append(acting.at_rest[rows] - acting.at_rest[end])
            moving = [np.concatenate(both, axis=2) for both in zip(moving, self.bias, strict=True)]
        return self.columns(acting, end)[0], moving, np.concatenate(ways, axis=1)

    def _swept_times(self, acting: Fading, begin: int, end: int) -> tuple[Columns, Columns, NDArray[np.float64]]:
        """As `swept`, of what fades: the ways are polynomials of the logarithm of the time constant."""
        first, last = max(0, begin - TIMES_AT_ONCE), min(len(acting.times) - 1, end + TIMES_AT_ONCE)
        numbers = np.arange(first, last + 1, SPACING)
        every = [self._sample(acting, int(number)) for number in numbers]
        stacked = np.array([np.concatenate([c.reshape(-1, c.shape[2]) for c in one]) for one in every])
        count, rows, own = stacked.shape
        basis, sizes, parts = np.linalg.svd(stacked.transpose(1, 0, 2).reshape(rows, -1), full_matrices=False)
        held = sizes > HELD * sizes[0]
        at = parts[held].reshape(-1, count, own).transpose(1, 0, 2)
        wanted = np.arange(begin, end + 1)
        nearest = np.clip((wanted - first) // SPACING - DEGREE // 2, 0, max(0, count - DEGREE - 1))
        nodes = nearest[:, None] + np.arange(min(DEGREE + 1, count))
        ways = np.einsum("rj,rjtk->rtk", lagrange((wanted - first) / SPACING, nodes), at[nodes])
        ends = np.cumsum([c[..., 0].size for c in every[0]])[:-1]
        moving = np.split((basis * sizes)[:, held], ends)
        moving = [mine.reshape(*c.shape[:2], -1) for mine, c in zip(moving, every[0], strict=True)]
        return [np.zeros_like(c) for c in every[0]], moving, ways

    def _sample(self, acting: Fading, number: int) -> list[NDArray[np.float64]]:
        """Columns with a time constant, kept for the stretches that share it."""
        known = acting.samples.get(number)
        if known is None:
            known = acting.samples[number] = self.columns(acting, number)[0]
        return known

    def _faded(self, acting: Fading, begin: int, end: int) -> list[NDArray[np.float64]]:
        """A few columns that hold, to a part of 1e-6, those of every time constant between two numbers.

        Exponentials of time are analytic in the logarithm of their time constant: a few of them hold those between.
        """
        first, last = max(0, begin - TIMES_AT_ONCE), min(len(acting.times) - 1, end + TIMES_AT_ONCE)
        every = [self._sample(acting, number) for number in range(first, last + 1, SPACING)]
        stacked = np.concatenate([np.concatenate([c.reshape(-1, c.shape[2]) for c in one]) for one in every], axis=1)
        basis, sizes, _ = np.linalg.svd(stacked, full_matrices=False)
        held = (basis * sizes)[:, sizes > LEAST_SIZE * sizes[0]]
        ends = np.cumsum([c[..., 0].size for c in every[0]])[:-1]
        parts = zip(np.split(held, ends), every[0], strict=True)
        return [mine.reshape(*c.shape[:2], held.shape[1]) for mine, c in parts]


def lagrange(at: NDArray, nodes: NDArray) -> NDArray[np.float64]:
    """What the values at nodes (R, j) count in the polynomials through them at some numbers (R,)."""
    found = np.ones(nodes.shape)
    for one in range(nodes.shape[1]):
        for other in range(nodes.shape[1]):
            if other != one:
                found[:, one] *= (at - nodes[:, other]) / (nodes[:, one] - nodes[:, other])
    return found


def refused(matrix: NDArray, residual: NDArray, limit: float) -> bool:
    """Whether rows (M, P) in units of their bounds leave a radius above the limit, whatever the coefficients.

    Weighted least squares prove it, or a linear programme does.
    """
    if not len(residual):
        return False
    scale = np.linalg.norm(matrix, axis=0)
    matrix = matrix[:, scale > 0.0] / scale[scale > 0.0]
    weights = np.full(len(residual), 1.0 / len(residual))
    for _ in range(ROUNDS):
        root = np.sqrt(weights)
        misfit = residual - matrix @ estimated(root[:, None] * matrix, root * residual)
        if weights @ misfit**2 > limit**2 * (1.0 + 1e-6):
            return True
        if np.abs(misfit).max() <= limit:
            return False
        weights = sharpened(weights, misfit)
    free = np.full(matrix.shape[1], np.inf)
    return least_radius(matrix, residual, (-free, free), estimated(matrix, residual))[0] > limit
