"""Evidence: what a record says against a model, as linear rows in units of their bounds.

error = nominal · x + columns · c + noise within the bounds, about one fit or run of the model. A record has one or
several parts: pieces of one kind, with errors in one unit. What works on evidence knows no record.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.programmes import chebyshev_radius
from ..bounded.sets import Problem

FOLDS = 8
"""Blocks in time that are left out in turn."""
RANK = 1e-12
"""Directions of so small a part of the sum of squares are not determined."""
FIRST_ROWS, MORE_ROWS = 300, 100
"""Rows that a linear programme begins with, and takes in at a time."""
TOLERANCE = 1e-9
"""How far, relatively, a row that was not taken in may be beyond the radius."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of a record of one kind.

    Attributes
    ----------
    kind : str
        "moves": between rests, the direction of gravity is known at both ends; "rests": the block does not turn;
        "norms": the size of gravity at rest; "windows": the true attitude is known at both ends
    label : str
        in words: "0.5 s", "2 moves"
    first, last : (S,) array of int
        rows of the record at which each piece begins and ends
    """

    kind: str
    label: str
    first: NDArray[np.int_]
    last: NDArray[np.int_]

    def __len__(self) -> int:
        return len(self.first)

    def selected(self, index: NDArray | slice) -> "Pieces":
        """Some of the pieces: mask or numbers."""
        return Pieces(self.kind, self.label, self.first[index], self.last[index])

    def durations(self, time_s: NDArray) -> NDArray[np.float64]:
        """Length of each piece (S,) [s]."""
        return time_s[self.last] - time_s[self.first]


@dataclass(frozen=True, eq=False)
class Part:
    """Errors of S pieces of one kind, with d components each.

    Attributes
    ----------
    pieces : Pieces
    error, bound : (S, d) array
        in the part's unit: [rad] of turns and directions, [g] of norms
    nominal : (S, d, P) array
        by the parameters of the model
    columns : (S, d, K) array
        by the coefficients of the effects
    scored : bool
        whether these are the errors that the model is judged by; what is known beside them stands in the other parts
    """

    pieces: Pieces
    error: NDArray[np.float64]
    bound: NDArray[np.float64]
    nominal: NDArray[np.float64]
    columns: NDArray[np.float64]
    scored: bool

    def __len__(self) -> int:
        return len(self.error)

    @property
    def label(self) -> str:
        """In words."""
        return self.pieces.label

    def selected(self, index: NDArray) -> "Part":
        """Some of the pieces: mask or numbers."""
        arrays = (values[index] for values in (self.error, self.bound, self.nominal, self.columns))
        return Part(self.pieces.selected(index), *arrays, self.scored)


@dataclass(frozen=True, eq=False)
class Fit:
    """A model with a set of effects, fitted to evidence.

    Attributes
    ----------
    places : tuple of EffectPlace
    radius : float
        least possible largest error over its bound, with coefficients of possible size
    solution : (P + k,) array
        steps of the model's parameters and coefficients of the effects, a Chebyshev centre
    """

    places: tuple[EffectPlace, ...]
    radius: float
    solution: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Folds:
    """Blocks in time: what is left out together.

    Attributes
    ----------
    count : int
    of_piece : tuple of (S,) array of int
        the fold of each piece, for each part
    of_row : (M,) array of int
    """

    count: int
    of_piece: tuple[NDArray[np.int_], ...]
    of_row: NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Evidence:
    """All parts of a record, with the names of their columns.

    Attributes
    ----------
    parts : tuple of Part
    names : tuple of (str, str)
        name and unit of each parameter of the model
    point : (P,) array
        values of these parameters about which the rows are linear
    places : tuple of EffectPlace
        effects that can be tried, in the order of their columns
    """

    parts: tuple[Part, ...]
    names: tuple[tuple[str, str], ...]
    point: NDArray[np.float64]
    places: tuple[EffectPlace, ...]

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Errors over their bounds (M,)."""
        return np.concatenate([(part.error / part.bound).ravel() for part in self.parts])

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Columns (M, P) of the model over the bounds."""
        return np.concatenate([_rows(part.nominal, part.bound) for part in self.parts])

    @cached_property
    def columns(self) -> NDArray[np.float64]:
        """Columns (M, K) of all effects over the bounds."""
        return np.concatenate([_rows(part.columns, part.bound) for part in self.parts])

    @cached_property
    def blocks(self) -> tuple[slice, ...]:
        """The columns of each effect."""
        ends = np.cumsum([0, *(coefficient_count(place) for place in self.places)]).tolist()
        return tuple(slice(start, stop) for start, stop in pairwise(ends))

    @property
    def problem(self) -> Problem:
        """The rows as the bounds of sets take them."""
        return Problem(self.residual, self.nominal, self.columns, self.blocks)

    @property
    def scored(self) -> tuple[int, ...]:
        """Numbers of the parts that the model is judged by."""
        return tuple(k for k, part in enumerate(self.parts) if part.scored)

    def numbers_of(self, places: Sequence[EffectPlace]) -> NDArray[np.int_]:
        """Numbers of the columns of some effects."""
        chosen = [self.blocks[self.places.index(place)] for place in places]
        return np.concatenate([np.arange(b.start, b.stop) for b in chosen]) if chosen else np.zeros(0, dtype=int)

    def columns_of(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Columns (M, k) of some effects over the bounds."""
        return self.columns[:, self.numbers_of(places)]

    def matrix(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Columns of the model and of some effects (M, P + k)."""
        return np.hstack([self.nominal, self.columns_of(places)])

    def limits_of(self, places: Sequence[EffectPlace]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Ends of the possible values of each coefficient of some effects."""
        parameters = [p for place in places for p in CATALOGUE[place.effect].at(place).parameters]
        low = [-p.largest if p.smallest is None else p.smallest for p in parameters]
        return np.array(low, dtype=float), np.array([p.largest for p in parameters], dtype=float)

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,)."""
        found, at = {}, len(self.names)
        for place in places:
            count = coefficient_count(place)
            found[place] = CATALOGUE[place.effect].at(place).from_coefficients(solution[at : at + count])
            at += count
        return found

    def of_parts(self, wanted: Sequence[int]) -> Self:
        """The evidence of some parts."""
        return replace(self, parts=tuple(self.parts[k] for k in wanted))

    def of_length(self, k: int) -> Self:
        """The evidence of one scored part, with what is known beside it."""
        return self.of_parts([i for i, other in enumerate(self.parts) if i == k or not other.scored])

    def with_places(self, kept: Sequence[EffectPlace]) -> Self:
        """The evidence with some of the effects."""
        numbers = self.numbers_of(kept)
        parts = tuple(replace(part, columns=part.columns[..., numbers]) for part in self.parts)
        return replace(self, parts=parts, places=tuple(kept))

    def with_errors(self, errors: Sequence[NDArray]) -> Self:
        """The evidence with other errors (S, d) of each part."""
        return self._replaced("error", errors)

    def with_bounds(self, bounds: Sequence[NDArray]) -> Self:
        """The evidence with other bounds (S, d) of each part."""
        return self._replaced("bound", bounds)

    def unweighted(self) -> Self:
        """The evidence with bounds of one."""
        return self.with_bounds([np.ones_like(part.bound) for part in self.parts])

    def _replaced(self, field: str, values: Sequence[NDArray]) -> Self:
        parts = tuple(replace(part, **{field: mine}) for part, mine in zip(self.parts, values, strict=True))
        return replace(self, parts=parts)

    def split(self, values: NDArray) -> list[NDArray[np.float64]]:
        """Rows (M,) in units of their bounds as errors (S, d) of each part, in its unit."""
        ends = np.cumsum([part.error.size for part in self.parts])[:-1]
        pieces = zip(self.parts, np.split(values, ends), strict=True)
        return [mine.reshape(part.error.shape) * part.bound for part, mine in pieces]

    def estimate(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Steps and coefficients (P + k,) of least squares."""
        return least_squares(self.matrix(places), self.residual)

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The Chebyshev fit of the model and some effects of possible sizes."""
        matrix = self.matrix(places)
        free = np.full(len(self.names), np.inf)
        ends = self.limits_of(places)
        low, high = np.concatenate([-free, ends[0]]), np.concatenate([free, ends[1]])
        if not matrix.shape[1]:
            return Fit((), float(np.abs(self.residual).max(initial=0.0)), np.zeros(0))
        # Of many rows few matter: those that least squares fit worst, and what a fit to them violates.
        left = np.abs(self.residual - matrix @ least_squares(matrix, self.residual))
        taken = np.argsort(-left, kind="stable")[:FIRST_ROWS]
        while True:
            bound = np.ones(len(taken))
            radius, x, _ = chebyshev_radius(matrix[taken], self.residual[taken], bound, low=low, high=high)
            excess = np.abs(self.residual - matrix @ x) - radius
            excess[taken] = 0.0
            more = np.argsort(-excess, kind="stable")[:MORE_ROWS]
            more = more[excess[more] > TOLERANCE * max(1.0, radius)]
            if not len(more):
                return Fit(tuple(places), radius, x)
            taken = np.concatenate([taken, more])

    def left_by(self, fit: Fit) -> NDArray[np.float64]:
        """Errors over their bounds (M,) that a fit leaves."""
        return self.residual - self.matrix(fit.places) @ fit.solution

    def folds(self, count: int = FOLDS) -> Folds:
        """Blocks in time, each with as many pieces of the shortest scored kind as the others."""
        main = max((self.parts[k] for k in self.scored), key=len)
        count = min(count, len(main))
        edges = np.quantile(_middles(main), np.linspace(0.0, 1.0, count + 1)[1:-1])
        of_piece = tuple(np.searchsorted(edges, _middles(part)) for part in self.parts)
        rows = [np.repeat(mine, part.error.shape[1]) for mine, part in zip(of_piece, self.parts, strict=True)]
        return Folds(count, of_piece, np.concatenate(rows))

    def left_out(self, places: Sequence[EffectPlace], folds: Folds) -> NDArray[np.float64]:
        """Errors (M,) in units of their bounds, those of each fold predicted by least squares over the others.

        A piece that reaches into a fold that is left out is left out with it where its middle lies in it.
        """
        matrix, left = self.matrix(places), np.array(self.residual)
        if not matrix.shape[1]:
            return left
        scale = np.linalg.norm(matrix, axis=0)
        matrix = matrix / np.where(scale > 0.0, scale, 1.0)
        outs = [np.flatnonzero(folds.of_row == number) for number in range(folds.count)]
        grams = np.array([matrix[out].T @ matrix[out] for out in outs])
        products = np.array([matrix[out].T @ self.residual[out] for out in outs])
        for out, gram, product in zip(outs, grams.sum(axis=0) - grams, products.sum(axis=0) - products, strict=True):
            left[out] = self.residual[out] - matrix[out] @ np.linalg.lstsq(gram, product, rcond=RANK)[0]
        return left


def coefficient_count(place: EffectPlace) -> int:
    """How many coefficients an effect has."""
    return len(CATALOGUE[place.effect].at(place).parameters)


def least_squares(matrix: NDArray, residual: NDArray) -> NDArray[np.float64]:
    """Least squares of rows in units of their bounds; directions that nothing determines stay where they are."""
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    return np.linalg.lstsq(matrix / scale, residual, rcond=1e-10)[0] / scale


def rms_size(error: NDArray) -> float:
    """Root mean square of the size of errors (S, d)."""
    return float(np.sqrt(np.mean((error**2).sum(axis=1)))) if len(error) else 0.0


def largest_size(error: NDArray) -> float:
    """Largest size of errors (S, d)."""
    return float(np.linalg.norm(error, axis=1).max(initial=0.0))


def _rows(columns: NDArray, bound: NDArray) -> NDArray:
    """Columns (S, d, K) over bounds (S, d), as rows (S d, K)."""
    return (columns / bound[..., None]).reshape(bound.size, columns.shape[-1])


def _middles(part: Part) -> NDArray:
    return 0.5 * (part.pieces.first + part.pieces.last)
