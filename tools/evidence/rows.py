"""Rows of evidence: errors with their bounds, and their derivatives by parameters and effects."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.effects import EffectPlace
from ...models.effects.last_stage import place_of
from ...models.effects.lookup import Table
from ..bounded.work import charge
from .fit import blocks_of, estimated

FOLDS = 8
"""Blocks in time that are left out in turn."""
RANK = 1e-12
"""Part of the sum of squares below which a direction is not determined."""
DEVIATIONS = 3.0
"""Standard deviations of an error in its bound."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Pieces of a record of one kind, each from one of its rows `first` (S,) to another, `last` (S,).

    `kind`: "moves": between rests, the direction of gravity is known at both ends; "rests": the block does not turn;
    "norms": the size of gravity at rest. With "windows" the true attitude is known at both ends. `label` is in words:
    "0.5 s", "2 moves".
    """

    kind: str
    label: str
    first: Ints
    last: Ints

    def __len__(self) -> int:
        return len(self.first)

    def selected(self, index: NDArray | slice) -> "Pieces":
        """Return some of the pieces, by mask or numbers."""
        return Pieces(self.kind, self.label, self.first[index], self.last[index])

    def durations(self, time_s: NDArray) -> Floats:
        """Length of each piece (S,) [s]."""
        return time_s[self.last] - time_s[self.first]


@dataclass(frozen=True, eq=False)
class Part:
    """Errors of S pieces of one kind, with d components each.

    `error`, `bound` (S, d) are in the part's unit: [rad] of turns and directions, [g] of norms. `nominal` (S, d, P) are
    derivatives by the parameters of the model, `columns` (S, d, K) by the coefficients of the effects. The `scored`
    errors judge the model; the other parts hold further known errors.
    """

    pieces: Pieces
    error: Floats
    bound: Floats
    nominal: Floats
    columns: Floats
    scored: bool

    def __len__(self) -> int:
        return len(self.error)

    @property
    def label(self) -> str:
        """The kind of pieces in words."""
        return self.pieces.label

    @property
    def middles(self) -> Floats:
        """The middle row of each piece (S,)."""
        return np.asarray(0.5 * (self.pieces.first + self.pieces.last), dtype=float)

    def selected(self, index: NDArray) -> "Part":
        """Return the part with some of the pieces, by mask or numbers."""
        names = ("error", "bound", "nominal", "columns")
        return replace(self, pieces=self.pieces.selected(index), **{name: getattr(self, name)[index] for name in names})


@dataclass(frozen=True, eq=False)
class Channel:
    """Errors (S,) of one component, `label`: ``{"axis": 1}``, and the quantities that they may depend on, by name.

    `quantities` are coordinates (S, k) of one variable each, `joint` of several together; `angles` (S,) [rad] are tried
    each, and all together.
    """

    label: Mapping[str, int]
    error: Floats
    bound: Floats
    quantities: Mapping[str, Floats]
    joint: Mapping[str, Floats] = field(default_factory=dict)
    angles: Mapping[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class About:
    """Rows about parameters and coefficients: errors (M,), derivatives (M, P + K), bounds (M,) of the errors.

    `rate` (M, P + K) is the growth of the bounds per unit of a coefficient's size, where the record leaves its action
    open.
    """

    residual: Floats
    jacobian: Floats
    bound: Floats
    rate: Floats


@dataclass(frozen=True, eq=False)
class Rows:
    """Linear rows: residual = nominal · step + columns · coefficients + noise within the bound.

    Attributes
    ----------
    names : tuple of (str, str)
        name and unit of each parameter of the model
    point : array (P,)
        their values at which the rows are linearised
    places : tuple of EffectPlace
        effects that can be tried
    residual, bound : array (M,)
        errors at the point, and the largest by noise
    nominal : array (M, P)
        derivatives by the parameters
    columns_of : callable
        derivatives (M, K) by the coefficients of some effects
    parts : tuple of Part
        pieces of each kind, if the record has any; then residual and columns are over the bounds
    fold_numbers : array (M,), optional
        the part of the record with which each row is left out; by default blocks in time of the parts
    are_readings : bool
        true if they begin with readings of three accelerometers each, all of which can be outliers
    least_singular : float
        directions of the parameters with a smaller singular value, over the bounds, are not determined
    """

    names: tuple[tuple[str, str], ...]
    point: Floats
    places: tuple[EffectPlace, ...]
    residual: Floats
    nominal: Floats
    bound: Floats
    columns_of: Callable[[Sequence[EffectPlace]], Floats]
    parts: tuple[Part, ...] = ()
    fold_numbers: Ints | None = None
    are_readings: bool = False
    least_singular: float = 0.0

    @staticmethod
    def of(
        parts: Sequence[Part],
        names: Sequence[tuple[str, str]] = (),
        point: Sequence[float] | Floats = (),
        places: Sequence[EffectPlace] = (),
    ) -> "Rows":
        """The rows of parts, whose columns are in the order of the places, over their bounds."""
        error, nominal, columns = [np.zeros(0)], [np.zeros((0, len(names)))], []
        for part in parts:
            error.append((part.error / part.bound).ravel())
            nominal.append(rows_over(part.nominal, part.bound))
            columns.append(rows_over(part.columns, part.bound))
        residual = np.concatenate(error)
        signatures = np.concatenate(columns) if columns else np.zeros((0, 0))
        blocks = dict(zip(places, blocks_of(places), strict=True))

        def columns_of(chosen: Sequence[EffectPlace]) -> Floats:
            return signatures[:, numbers_in(blocks, chosen)]

        return Rows(
            tuple(names),
            np.asarray(point, dtype=float),
            tuple(places),
            residual,
            np.concatenate(nominal),
            np.ones(len(residual)),
            columns_of,
            tuple(parts),
        )

    @cached_property
    def blocks(self) -> dict[EffectPlace, slice]:
        """The columns of each effect in the parts."""
        return dict(zip(self.places, blocks_of(self.places), strict=True))

    def numbers_of(self, places: Sequence[EffectPlace]) -> Ints:
        """Numbers of the columns of some effects in the parts."""
        return numbers_in(self.blocks, places)

    @property
    def piece_count(self) -> int:
        """Number of pieces of the most frequent scored kind, or of readings of an accelerometer."""
        if self.scored:
            return max(len(self.parts[k]) for k in self.scored)
        return len(self.residual) // (3 if self.are_readings else 1)

    @property
    def linear_places(self) -> list[EffectPlace]:
        """Effects that are linear in their coefficients."""
        return [place for place in self.places if place.definition.linear]

    def matrix(self, places: Sequence[EffectPlace]) -> Floats:
        """Columns of the model and of some effects (M, P + k)."""
        return np.hstack([self.nominal, self.columns_of(places)])

    def estimate(self, places: Sequence[EffectPlace]) -> Floats:
        """Steps and coefficients (P + k,) of least squares."""
        return estimated(self.matrix(places), self.residual)

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,)."""
        coefficients = solution[len(self.names) :]
        values = {}
        for place, block in zip(places, blocks_of(places), strict=True):
            values[place] = place.definition.from_coefficients(coefficients[block])
        return values

    # Rows of parts

    @property
    def scored(self) -> tuple[int, ...]:
        """Numbers of the parts that the model is judged by."""
        return tuple(k for k, part in enumerate(self.parts) if part.scored)

    def with_parts(self, parts: Sequence[Part]) -> "Rows":
        """The rows of other parts with the same columns."""
        return Rows.of(parts, self.names, self.point, self.places)

    def select(self, k: int) -> "Rows":
        """Return the rows of one scored part, with those of the parts that are not scored."""
        return self.with_parts([part for i, part in enumerate(self.parts) if i == k or not part.scored])

    def with_errors(self, errors: Sequence[NDArray]) -> "Rows":
        """The rows with other errors (S, d) of each part."""
        return self.with_parts([replace(part, error=own) for part, own in zip(self.parts, errors, strict=True)])

    def with_bounds(self, bounds: Sequence[NDArray]) -> "Rows":
        """The rows with other bounds (S, d) of each part."""
        return self.with_parts([replace(part, bound=own) for part, own in zip(self.parts, bounds, strict=True)])

    def without(self, places: Sequence[EffectPlace]) -> "Rows":
        """The rows with fewer effects that can be tried."""
        remaining = tuple(place for place in self.places if place not in places)
        numbers = self.numbers_of(remaining)
        parts = [replace(part, columns=part.columns[..., numbers]) for part in self.parts]
        return Rows.of(parts, self.names, self.point, remaining)

    def with_effect(self, place: EffectPlace, columns: Sequence[NDArray]) -> "Rows":
        """Return the rows with one more effect, by its columns (S, d, K) in each part."""
        parts = []
        for part, added in zip(self.parts, columns, strict=True):
            parts.append(replace(part, columns=np.concatenate([part.columns, added], axis=2)))
        return Rows.of(parts, self.names, self.point, (*self.places, place))

    def shuffled(self, place: EffectPlace, rng: np.random.Generator) -> "Rows":
        """The rows with the columns of one effect moved to other pieces of the same part."""
        numbers, parts = self.numbers_of([place]), []
        for part in self.parts:
            columns = part.columns.copy()
            columns[..., numbers] = part.columns[rng.permutation(len(part))][..., numbers]
            parts.append(replace(part, columns=columns))
        return self.with_parts(parts)

    def split(self, values: NDArray) -> list[Floats]:
        """Rows (M,) in units of their bounds as errors (S, d) of each part, in its unit."""
        ends = np.cumsum([part.error.size for part in self.parts])[:-1]
        errors = []
        for part, own in zip(self.parts, np.split(values, ends), strict=True):
            errors.append(own.reshape(part.error.shape) * part.bound)
        return errors

    def folds(self, count: int = FOLDS) -> list[Ints]:
        """Return the fold of each piece (S,): blocks in time with equal numbers of the shortest scored kind."""
        main = max((self.parts[k] for k in self.scored), key=len)
        edges = np.quantile(main.middles, np.linspace(0.0, 1.0, min(count, len(main)) + 1)[1:-1])
        return [np.searchsorted(edges, part.middles) for part in self.parts]

    @property
    def fold_of_rows(self) -> Ints:
        """The part (M,) of the record that each row is left out with."""
        return self.of_rows(self.folds()) if self.fold_numbers is None else self.fold_numbers

    def of_rows(self, folds: Sequence[NDArray]) -> Ints:
        """The block of each row (M,)."""
        return np.concatenate([np.repeat(own, p.error.shape[1]) for own, p in zip(folds, self.parts, strict=True)])

    def smoothing(self, places: Sequence[EffectPlace]) -> Floats:
        """Return further rows (B, P + k) of zeros by which tables bend about as much as over the whole record.

        Without them a knot takes any value where the pieces near it are left out.
        """
        first, width = len(self.names), len(self.names) + len(self.numbers_of(places))
        further = [np.zeros((0, width))]
        for place, block in zip(places, blocks_of(places), strict=True):
            if place.effect != "lookup":
                continue
            bends = Table.of(place.law).bends
            values = self.estimate(places)[first:][block]
            size = float(np.linalg.norm(bends @ values)) / math.sqrt(max(len(bends), 1))
            if size > 0.0:
                smoothing = np.zeros((len(bends), width))
                smoothing[:, first + block.start : first + block.stop] = bends / (DEVIATIONS * size)
                further.append(smoothing)
        return np.vstack(further)

    def left_out(self, places: Sequence[EffectPlace], folds: Sequence[NDArray]) -> Floats:
        """Errors (M,) in units of their bounds, those of each fold predicted by least squares over the others.

        A piece that reaches into a fold that is left out is left out with it where its middle lies in it.
        """
        matrix, errors = self.matrix(places), np.array(self.residual)
        if not matrix.shape[1]:
            return errors
        charge(20.0 + 3e-3 * matrix.size * matrix.shape[1])
        scale = np.linalg.norm(matrix, axis=0)
        matrix = matrix / np.where(scale > 0.0, scale, 1.0)
        smoothing = self.smoothing(places) / np.where(scale > 0.0, scale, 1.0)
        of_rows = self.of_rows(folds)
        outs = [np.flatnonzero(of_rows == number) for number in range(of_rows.max() + 1)]
        grams = np.array([matrix[out].T @ matrix[out] for out in outs])
        products = np.array([matrix[out].T @ self.residual[out] for out in outs])
        whole = grams.sum(axis=0) + smoothing.T @ smoothing
        for out, gram, product in zip(outs, whole - grams, products.sum(axis=0) - products, strict=True):
            errors[out] = self.residual[out] - matrix[out] @ np.linalg.lstsq(gram, product, rcond=RANK)[0]
        return errors


def numbers_in(blocks: Mapping[EffectPlace, slice], places: Sequence[EffectPlace]) -> Ints:
    """Numbers of the columns of some effects."""
    numbers = [np.zeros(0, dtype=int)]
    for place in places:
        numbers.append(np.arange(blocks[place].start, blocks[place].stop))
    return np.concatenate(numbers)


def reading_at(row: int) -> EffectPlace:
    """Return the outlier at a reading, by its row."""
    return place_of(row // 3 + 1, row % 3 + 1)


def rows_over(columns: NDArray, bound: NDArray) -> Floats:
    """Columns (S, d, K) over bounds (S, d), as rows (S d, K)."""
    return (columns / bound[..., None]).reshape(bound.size, columns.shape[-1])
