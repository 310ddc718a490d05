"""An observation: errors of pieces of a record as a linear functional of what is added at ports over its rows.

Rests on a table, turns of a table and a block that is carried make one each. Columns of effects, of effects that set in
or fade, and of unknown functions of a quantity are what it makes of different additions.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .pairs import TURN
from .rows import Pieces

Weights = Sequence[tuple[NDArray[np.int_], NDArray[np.float64]]]
"""Columns (R,) to which rows add, and how much (R,) of each."""


@dataclass(frozen=True, eq=False)
class Group:
    """Pieces of one kind, whose errors (S, d) are `gain` (S, d, 3) times what adds up between their first and last row.

    `mean` (S, d, 3) is what the mean over the rows at rest takes out of every row, None where none is taken out.
    """

    pieces: Pieces
    gain: NDArray[np.float64]
    mean: NDArray[np.float64] | None = None

    def columns(
        self, sums: NDArray[np.float64], mean: NDArray[np.float64], first: NDArray[np.int_], last: NDArray[np.int_]
    ) -> NDArray[np.float64]:
        """Return errors (S, d, K) by sums (B, 3, K), of which each piece has a first and a last, and a mean (3, K)."""
        errors = self.gain @ (sums[last] - sums[first])
        return errors if self.mean is None else errors - self.mean @ mean

    def since(self, sums: NDArray[np.float64], mean: NDArray[np.float64], row: int) -> NDArray[np.float64]:
        """Return errors (S, d, K) by sums up to each row of what acts after one of them."""
        return self.columns(sums, mean, np.maximum(self.pieces.first, row), np.maximum(self.pieces.last, row))

    @property
    def largest(self) -> "Group":
        """What the largest errors follow from, where all rows of a piece and the mean at rest err in the same sense."""
        return Group(self.pieces, np.abs(self.gain), None if self.mean is None else -np.abs(self.mean))


@dataclass(frozen=True, eq=False)
class Observation:
    """What pieces of a record say of additions at P ports over its R steps between rows.

    `adds` (R, 3, P): what a unit at each port adds to the sums of a step. `resting` (R,): steps of which the mean is
    taken. `ends` (R + 1, 3, P): what a unit adds at a row itself, to where the block stands; None where nothing does.
    Without groups each step is a piece by itself, whose errors are what is added there.
    """

    groups: tuple[Group, ...]
    adds: NDArray[np.float64]
    resting: NDArray[np.bool_] | None = None
    ends: NDArray[np.float64] | None = None

    def of(self, added: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the errors (M, K) of what is added (R, P, K), or (R + 1, P, K) at the rows where these count."""
        if not self.groups:
            return (self.adds @ added).reshape(-1, added.shape[2])
        sums, mean, parts = self.sums(added), self.mean(added), []
        for group in self.groups:
            errors = group.columns(sums, mean, group.pieces.first, group.pieces.last)
            parts.append(errors.reshape(-1, errors.shape[2]))
        return np.concatenate(parts)

    def sums(self, added: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return what has been added (R + 1, 3, K) up to each row."""
        sums = np.zeros((len(self.adds) + 1, 3, added.shape[2]))
        if self.ends is None:
            np.cumsum(self.adds @ added, axis=0, out=sums[1:])
            return sums
        at_rows = np.einsum("rap,rpk->rak", self.ends, added)
        np.cumsum(self.adds @ (0.5 * (at_rows[1:] + at_rows[:-1])), axis=0, out=sums[1:])
        return at_rows + sums

    def mean(self, added: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean (P, K) of what is added over the rows at rest."""
        if self.resting is None or not self.resting.any():
            return np.zeros(added.shape[1:])
        return added[self.resting].mean(axis=0)

    @cached_property
    def boundaries(self) -> NDArray[np.int_]:
        """Rows at which pieces begin or end, in order."""
        return rows_of([group.pieces for group in self.groups])

    def of_functions(self, weights: Weights, count: int, port: int) -> list[NDArray[np.float64]]:
        """Return errors (S, d, count) of each group, of weights that add to some columns at one port."""
        sums = integrated(weights, count, self.adds[..., port], self.boundaries)
        mean = np.zeros((self.adds.shape[2], count))
        if self.resting is not None:
            for column, weight in weights:
                mean[port] += np.bincount(column[self.resting], weight[self.resting], count)
            mean[port] /= max(int(self.resting.sum()), 1)
        return [self._between(group, sums, mean) for group in self.groups]

    def _between(self, group: Group, sums: NDArray[np.float64], mean: NDArray[np.float64]) -> NDArray[np.float64]:
        first, last = (np.searchsorted(self.boundaries, rows) for rows in (group.pieces.first, group.pieces.last))
        return group.columns(sums, mean, first, last)

    @cached_property
    def largest(self) -> "Observation":
        """What the largest errors follow from of additions without sign."""
        return Observation(tuple(group.largest for group in self.groups), np.abs(self.adds), self.resting)


def rows_of(pieces: Sequence[Pieces]) -> NDArray[np.int_]:
    """Return the rows at which some pieces begin or end, in order."""
    return np.unique(np.concatenate([rows for piece in pieces for rows in (piece.first, piece.last)]))


@dataclass(frozen=True, eq=False)
class OnKnots:
    """Functions that are straight between knots (k,); round a circle the last knot is the first."""

    knots: NDArray[np.float64]
    circle: bool = False

    @property
    def count(self) -> int:
        """How many functions are one at a knot each."""
        return len(self.knots) - self.circle

    def weights(self, values: NDArray) -> Weights:
        """Return the knots before and after values (n,), and what the function there counts."""
        values = values % TURN if self.circle else values
        after = np.clip(np.searchsorted(self.knots, values), 1, len(self.knots) - 1)
        share = (values - self.knots[after - 1]) / (self.knots[after] - self.knots[after - 1])
        return (after - 1, 1.0 - share), (after % self.count, share)

    def at(self, values: NDArray) -> NDArray[np.float64]:
        """Return the functions (n, K) at values (n,)."""
        functions, rows = np.zeros((len(values), self.count)), np.arange(len(values))
        for knot, weight in self.weights(values):
            functions[rows, knot] += weight
        return functions


def integrated(weights: Weights, count: int, adds: NDArray, boundaries: NDArray) -> NDArray[np.float64]:
    """Return the sums (B, 3, count), up to each boundary, of additions (R, 3) times what weights add to columns."""
    until = np.searchsorted(boundaries, np.arange(1, len(adds) + 1))
    ends = len(boundaries) + 1
    total = np.zeros((3, ends * count))
    for column, weight in weights:
        cells = until * count + column
        for axis in range(3):
            total[axis] += np.bincount(cells, adds[:, axis] * weight, total.shape[1])
    return np.cumsum(total.reshape(3, ends, count)[:, :-1], axis=1).transpose(1, 0, 2)
