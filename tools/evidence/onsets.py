"""Effects of the gyros that set in at a time: the evidence of one time, and of all times within a stretch.

What such an effect does to a piece of the record depends on its time only where the piece holds it. Of a stretch of
times pieces that begin or end within it are left out, those that hold all of it gain a turn of any size, the same one
for all of them, and the others are the same for each time: what is refused then is refused for each time. Stretches
that are not refused are halved, down to those in which no piece begins or ends.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import sharpened
from ..motion.carry import GyroModel, Motion
from .evidence import Part, Pieces
from .fit import estimated, least_radius
from .references import Gravity, Run, Truth, integrals, matrices_of

STRETCHES = 16
"""Stretches of times that are tried first."""
ROUNDS = 6
"""Rounds of Lawson's algorithm before a stretch is handed to a linear programme."""
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

    def acting(self, place: EffectPlace) -> Acting:
        """What an effect does from each row on."""
        rows = np.arange(len(self.motion))
        integral = integrals(self.motion, self.model, self.attitude, [place], rows)
        at_rest = np.zeros_like(integral)
        if self.bias is not None:
            seen = self.motion.rows(1, len(rows), self.model.inverse, self.model.bias)
            counted = place.definition.signature(place, seen) * self.rests[1:, None, None]
            at_rest[1:] = np.cumsum(counted, axis=0) / max(int(self.rests[1:].sum()), 1)
        return Acting(integral, at_rest)

    def columns(self, acting: Acting, row: int) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """Columns (S, d, K) of each part of an effect that sets in after a row; its part (3, K) of the mean at rest."""
        mean, found = acting.at_rest[-1] - acting.at_rest[row], []
        for k, (pieces, turns) in enumerate(zip(self.pieces, self.turns, strict=True)):
            after, before = (acting.integral[np.maximum(rows, row)] for rows in (pieces.last, pieces.first))
            mine = turns @ (after - before)
            found.append(mine if self.bias is None else mine - self.bias[k] @ mean)
        return found, mean

    def within(self, acting: Acting, begin: int, end: int) -> list[NDArray[np.float64]]:
        """Columns (S, d, L) of each part that hold what the effect does whenever it sets in from one row to another.

        NaN where a piece begins or ends between.
        """
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
