"""Evidence: what a record says against a model, as linear rows in units of their bounds.

error = nominal · x + columns · c + noise within the bounds, about one fit or run of the model. A record has one or
several parts: pieces of one kind, with errors in one unit. What works on evidence knows no record.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.programmes import Interval, column_space, spaces_beyond
from ..bounded.sets import Problem, Work, sets_of_size
from ..calibrated import Calibration, Parameter, Sigma
from ..calibration.targets import NAMES
from ..result import finite_or_none
from .extension import Extension, Sized
from .fit import Classes, Fit, Gain, blocks_of, coefficient_limits, estimated, least_radius
from .pairs import Pair
from .rows import About, Channel, Part

FOLDS = 8
"""Blocks in time that are left out in turn."""
RANK = 1e-12
"""Directions of so small a part of the sum of squares are not determined."""
ROUNDS_OF_OWN = 3
"""So many rounds of least squares bring a record's own parameters to rest beside effects of given sizes."""
SEEN = 1e-3
"""An effect of its largest possible size that moves no error by so much of its bound cannot be seen."""


@dataclass(frozen=True)
class Worst:
    """The error of a reading that was left out, over its bound, and how large noise can make it.

    `position` is the record's own number, `accelerometer` counts from 1.
    """

    position: int
    accelerometer: int
    error: float
    allowed: float


@dataclass(frozen=True)
class ReadOff:
    """An effect that readings show by themselves: its place, what is stated of its parameters, and what is possible.

    `radius` is that of the model without it, where the readings that show it count as well; `objection` says why it is
    not named all the same.
    """

    place: EffectPlace
    values: tuple[float, ...]
    ends: tuple[Interval, ...]
    radius: float
    objection: str = ""


Errors = tuple[NDArray[np.float64], NDArray[np.float64]]


@dataclass(frozen=True, eq=False)
class Trial:
    """What readings that were left out say of some effects of a fit.

    `folds` and `blocks` are errors (R,) of what was left out, without and with the effects: parts of the evidence in
    turn, and blocks in time; None where that is not possible; `rows` (R,) those of the folds, where they are numbered.
    `shuffled` are the errors of the folds with the effects'
    signatures moved to where they do not belong. `jointly`: of the whole set, not of each of its effects; then `worst`
    is the error that is farthest beyond what noise makes of it, of both.
    """

    places: tuple[EffectPlace, ...]
    folds: Errors | None
    blocks: Errors | None
    shuffled: Iterable[NDArray[np.float64]] = ()
    jointly: bool = False
    worst: "Worst | None" = None
    rows: NDArray[np.int_] | None = None


@dataclass(frozen=True, eq=False)
class Evidence:
    """All parts of a record, with the names of their columns.

    `names` are name and unit of each parameter of the model; `point` (P,) their values about which the rows are linear;
    `places` the effects that can be tried, in the order of their columns.
    """

    parts: tuple[Part, ...]
    names: tuple[tuple[str, str], ...]
    point: NDArray[np.float64]
    places: tuple[EffectPlace, ...]

    read_off: ClassVar[Sequence[ReadOff]] = ()
    """Effects that readings show by themselves; what they change is left out of the rows."""

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Errors over their bounds (M,)."""
        return np.concatenate([(part.error / part.bound).ravel() for part in self.parts])

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Columns (M, P) of the model over the bounds."""
        return np.concatenate([rows_over(part.nominal, part.bound) for part in self.parts])

    @cached_property
    def columns(self) -> NDArray[np.float64]:
        """Columns (M, K) of all effects over the bounds."""
        return np.concatenate([rows_over(part.columns, part.bound) for part in self.parts])

    @cached_property
    def blocks(self) -> tuple[slice, ...]:
        """The columns of each effect."""
        return blocks_of(self.places)

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
        ends = [np.array(coefficient_limits(place)) for place in places]
        low, high = np.hstack([np.zeros((2, 0)), *ends])
        return low, high

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,)."""
        own = zip(places, blocks_of(places), strict=True)
        coefficients = solution[len(self.names) :]
        return {place: place.definition.from_coefficients(coefficients[block]) for place, block in own}

    def of_length(self, k: int) -> Self:
        """The evidence of one scored part, with what is known beside it."""
        return replace(self, parts=tuple(part for i, part in enumerate(self.parts) if i == k or not part.scored))

    def with_errors(self, errors: Sequence[NDArray]) -> Self:
        """The evidence with other errors (S, d) of each part."""
        return self._replaced("error", errors)

    def with_bounds(self, bounds: Sequence[NDArray]) -> Self:
        """The evidence with other bounds (S, d) of each part."""
        return self._replaced("bound", bounds)

    def without(self, places: Sequence[EffectPlace]) -> Self:
        """The evidence with fewer effects that can be tried."""
        kept = tuple(place for place in self.places if place not in places)
        own = self.numbers_of(kept)
        return replace(
            self, places=kept, parts=tuple(replace(part, columns=part.columns[..., own]) for part in self.parts)
        )

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """The evidence with formulas and tables that were not tried from the first on; an exact model has them all.

        A ValueError for one that it cannot have.
        """
        return self

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
        return estimated(self.matrix(places), self.residual)

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The Chebyshev fit of the model and some effects of possible sizes."""
        matrix, count = self.matrix(places), len(self.names)
        free, ends = np.full(count, np.inf), self.limits_of(places)
        low, high = np.append(-free, ends[0]), np.append(free, ends[1])
        at = np.concatenate([self.point, np.zeros(matrix.shape[1] - count)])
        squares = estimated(matrix, self.residual)
        radius, step = least_radius(matrix, self.residual, (low, high), squares)
        blocks = blocks_of(places)
        estimate = at + squares
        return Fit(
            tuple(places), blocks, at, step, self.residual, self.bound, matrix, radius, estimate, estimate[count:]
        )

    # What the engine asks of every kind of record. A linear record answers as it stands here.

    limit: ClassVar[float] = 1.0 + 1e-7
    """Radius up to which a model stands: one, and what the programmes may be wrong by."""
    most_sets: ClassVar[int | None] = 12
    """So many of the sets that remain are shown; None: all."""
    most_rows: ClassVar[int | None] = 2500
    """So many rows bound what is possible; None: all."""

    @property
    def length(self) -> float:
        """How many times as much each set costs as in a usual record: so much more a search may take."""
        return 1.0

    @property
    def too_large(self) -> str:
        """What to say where no linear programme of the record can be solved."""
        return "the errors are too large for one linear system"

    @cached_property
    def bound(self) -> NDArray[np.float64]:
        """Bounds (M,) of the errors in the units of `residual`."""
        return np.ones(len(self.residual))

    @cached_property
    def baseline(self) -> Fit:
        """The model without effects."""
        return self.refit(())

    @property
    def falsified(self) -> bool:
        """Whether the model without effects cannot be true of the record."""
        return self.baseline.radius > self.limit

    @property
    def stated_bound(self) -> float | None:
        """The noise bound as it is published; None where there is no single one."""
        return None

    @property
    def baseline_radius(self) -> float:
        """Radius of the model without effects."""
        return self.baseline.radius

    @cached_property
    def classes(self) -> Classes:
        """The effects that can be seen and told apart."""
        spaces = spaces_beyond(self.nominal, [self.columns_of([place]) for place in self.seen])
        return Classes.of(self.seen, spaces)

    @cached_property
    def seen(self) -> tuple[EffectPlace, ...]:
        """Effects that some size which is called possible makes visible beside the model."""
        base = column_space(self.nominal)
        found = []
        for place in self.places:
            columns = self.columns_of([place])
            left = (columns - base @ (base.T @ columns)) * np.abs(self.limits_of([place])).max(axis=0)
            if np.abs(left).max(initial=0.0) > SEEN:
                found.append(place)
        return tuple(found)

    def space_of(self, place: EffectPlace) -> NDArray[np.float64]:
        """What an effect adds to the model, as `classes` have it."""
        (space,) = spaces_beyond(self.nominal, [self.columns_of([place])])
        return space

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Sets of so many effects, by default one of each class, that no bound refuses; the most promising first.

        What that costs is added to the work, as it is in `mended`.
        """
        places = self.classes.places if among is None else among
        problem = Problem.of(self.residual, self.nominal, [self.columns_of([place]) for place in places])
        for chosen in sets_of_size(problem, size, self.limit - 1.0, 0, work):
            yield tuple(places[i] for i in chosen.effects)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Fits of a set of effects with possible sizes, each in ways of its own, with which the model stands."""
        work.programme(len(self.residual), self.nominal.shape[1] + len(self.numbers_of(places)))
        fit = self.refit(places)
        return [fit] if fit.radius <= self.limit else []

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves."""
        return self.refit([place]).radius

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, NDArray[np.float64]]]:
        """Effects that a fit has not, with their columns (M, k) there."""
        for place in self.seen:
            if place not in fit.places:
                yield place, self.columns_of([place])

    # What a joint evidence of several records asks of each

    @property
    def linear_places(self) -> list[EffectPlace]:
        """Effects that are linear in their coefficients."""
        return list(self.places)

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The rows about parameters (P,) and coefficients (K,) of some effects."""
        matrix = self.matrix(places)
        step = np.concatenate([point - self.point, coefficients])
        return About(self.residual - matrix @ step, matrix, self.bound, np.zeros_like(matrix))

    def outlier_at(self, row: int) -> EffectPlace | None:
        """What a reading that is off is called; None where a row is no reading."""
        return None

    def second_order_at(self, radius: float) -> float:
        """What the linear model may be wrong by, in units of the bounds, where it misses by so many of them."""
        return 0.0

    def own_with(self, effects: Mapping[EffectPlace, NDArray]) -> tuple[list[EffectPlace], NDArray, NDArray]:
        """Those of some effects that the record can show, their given coefficients (K,), and its own parameters (P,).

        The parameters are those of least squares beside the effects.
        """
        places = [place for place in effects if place in self.linear_places]
        sizes = np.concatenate([np.zeros(0), *(effects[place] for place in places)])
        point = self.point
        for _ in range(ROUNDS_OF_OWN):
            at = self.about(places, point, sizes)
            rows = at.jacobian[:, : len(point)] / at.bound[:, None]
            point = point + estimated(rows, at.residual / at.bound) if len(point) else point
        return places, sizes, point

    def rms_with(self, effects: Mapping[EffectPlace, NDArray]) -> float:
        """Root mean square of the errors over their bounds with effects of given coefficients, to first order."""
        places, sizes, point = self.own_with(effects)
        at = self.about(places, point, sizes)
        return float(np.sqrt(np.mean((at.residual / at.bound) ** 2)))

    def applied(self, effects: Mapping[EffectPlace, NDArray]) -> NDArray[np.float64] | None:
        """The quoted errors (S, d) by FMUs that are extended by effects of given coefficients; None: cannot be run."""
        raise NotImplementedError

    def without_added(self, effects: Mapping[EffectPlace, NDArray]) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Those of some effects, of given coefficients, that can be taken out, and the record's fields without."""
        raise NotImplementedError

    @property
    def quoted_errors(self) -> tuple[str, str, float]:
        """Of what the quoted errors are, in words, the unit in which they are quoted, and what it is in theirs."""
        raise NotImplementedError

    @property
    def least_singular(self) -> float:
        """Directions of the parameters with a smaller singular value, in units of the bounds, are not determined."""
        return 0.0

    def fold_of_rows(self) -> NDArray[np.int_]:
        """The part (M,) of the record that each row is left out with."""
        return self.of_rows(self.folds())

    def room(self, fit: Fit) -> float:
        """What a record that is written in digits adds to the bounds of a fit."""
        return 0.0

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Intervals of an effect's parameters, widened by what the rows cannot tell."""
        return tuple(ends)

    def named(self, place: EffectPlace) -> EffectPlace:
        """An effect as the record names it."""
        return place

    def missing(self) -> Mapping[str, Any]:
        """Keys of the result where nothing can be fitted: what is missing; empty where all is there."""
        return {}

    def power(self) -> Sequence[Mapping[str, Any]]:
        """From which size on an unlisted fault of each place and quantity would have shown; empty: not judged."""
        return ()

    def objections(self) -> tuple[str, ...]:
        """Why the record cannot be what it says."""
        return ()

    def untried(self, size: int) -> str | None:
        """Why sets of so many effects are not the smallest, though they stand: what might do was not tried."""
        return None

    def would_need(self, places: Sequence[EffectPlace]) -> str:
        """What else would have to be true for these effects to be enough, in words; empty where nothing can be said."""
        return ""

    def as_measured(self) -> "Evidence | None":
        """The evidence with nothing taken out beforehand; None where nothing is."""
        return None

    def head(self) -> Mapping[str, Any]:
        """The first keys of the result: what was assumed, and the baseline."""
        raise NotImplementedError

    def of_misfit(self) -> Mapping[str, Any]:
        """Keys of the result for a record that falsifies the baseline."""
        return {}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """What the record says of the model's parameters: beside the effects of a fit that stands, or without effects.

        Without a fit nothing is bounded that a falsified model cannot bound.
        """
        raise NotImplementedError

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
        """Keys of the result for a model that stands; `missing` where it is too little to falsify anything.

        `calibration` is that beside the effects of the fit, `excluded` are sizes of others that are excluded.
        """
        return {}

    ranks_each: ClassVar[bool] = True
    """Whether it is told what each effect by itself would leave; else nobody asks, and it is not worked out."""

    most_known_alone: ClassVar[int] = 0
    """Sets of so many effects are known to stand alone where no other is found; larger ones need a proven quantity."""

    second_order: ClassVar[float] = 0.0
    """What the linear model may be wrong by, in units of the bounds."""

    told_by: ClassVar[str] = "this record"
    """What tells effects of different classes apart, in words."""

    def pairs(self) -> Sequence[Pair]:
        """Places, each with a quantity on which its error may depend, whatever the law; none by default."""
        return ()

    def channels(self) -> Sequence[Channel]:
        """The errors of the baseline, component by component, with what they may depend on; none by default."""
        return ()

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """The second witness: what was left out says of the effects of a fit."""
        raise NotImplementedError

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Components that start with a fit's parameters and with effects as they are stated; scenarios of the record.

        A ValueError where a value is beyond what a component takes.
        """
        raise NotImplementedError

    def gain(self, fit: Fit) -> Gain | None:
        """What the extended components predict of what was not used; None where that is not possible."""
        raise NotImplementedError

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Keys of the result that say what to measure so that sets can be told apart; none by default."""
        return {}

    def folds(self, count: int = FOLDS) -> list[NDArray[np.int_]]:
        """Blocks in time, each with as many pieces of the shortest scored kind as the others; each piece's (S,)."""
        main = max((self.parts[k] for k in self.scored), key=len)
        edges = np.quantile(_middles(main), np.linspace(0.0, 1.0, min(count, len(main)) + 1)[1:-1])
        return [np.searchsorted(edges, _middles(part)) for part in self.parts]

    def of_rows(self, folds: Sequence[NDArray]) -> NDArray[np.int_]:
        """The block of each row (M,)."""
        return np.concatenate([np.repeat(m, p.error.shape[1]) for m, p in zip(folds, self.parts, strict=True)])

    def left_out(self, places: Sequence[EffectPlace], folds: Sequence[NDArray]) -> NDArray[np.float64]:
        """Errors (M,) in units of their bounds, those of each fold predicted by least squares over the others.

        A piece that reaches into a fold that is left out is left out with it where its middle lies in it.
        """
        matrix, left = self.matrix(places), np.array(self.residual)
        if not matrix.shape[1]:
            return left
        scale = np.linalg.norm(matrix, axis=0)
        matrix = matrix / np.where(scale > 0.0, scale, 1.0)
        of_rows = self.of_rows(folds)
        outs = [np.flatnonzero(of_rows == number) for number in range(of_rows.max() + 1)]
        grams = np.array([matrix[out].T @ matrix[out] for out in outs])
        products = np.array([matrix[out].T @ self.residual[out] for out in outs])
        for out, gram, product in zip(outs, grams.sum(axis=0) - grams, products.sum(axis=0) - products, strict=True):
            left[out] = self.residual[out] - matrix[out] @ np.linalg.lstsq(gram, product, rcond=RANK)[0]
        return left


def parameters_with(
    names: Iterable[tuple[str, str]], values: NDArray, ends: NDArray, *, inside: bool = False
) -> list[Parameter]:
    """Parameters by name and unit with values (P,) and ends (P, 2), infinite where nothing bounds them.

    `inside`: a value that is beyond an end is taken to it.
    """
    parameters = []
    for (name, unit), value, (low, high) in zip(names, values, ends, strict=True):
        bounded = bool(np.isfinite(low) and np.isfinite(high))
        parameters.append(
            Parameter(
                symbol=name,
                name=words_of(name),
                unit=unit,
                determined=bounded,
                estimate=float(np.clip(value, low, high) if inside else value),
                low=finite_or_none(low),
                high=finite_or_none(high),
            )
        )
    return parameters


def undetermined(basis: str) -> Calibration:
    """The calibration that says nothing, and why."""
    sigma = Sigma.model_validate({"value": None, "kind": "unknown", "from": basis})
    return Calibration(verdict="insufficient", sigma=sigma, radius=None, estimator=None, parameters=[])


def words_of(name: str) -> str:
    """A parameter in words, where it has such."""
    target, at, mounting = name.partition("@")
    return NAMES[target][0] + at + mounting if target in NAMES else name


def rms_size(error: NDArray) -> float:
    """Root mean square of the size of errors (S, d)."""
    return float(np.sqrt(np.mean((error**2).sum(axis=1)))) if len(error) else 0.0


def largest_size(error: NDArray) -> float:
    """Largest size of errors (S, d)."""
    return float(np.linalg.norm(error, axis=1).max(initial=0.0))


def rows_over(columns: NDArray, bound: NDArray) -> NDArray:
    """Columns (S, d, K) over bounds (S, d), as rows (S d, K)."""
    return (columns / bound[..., None]).reshape(bound.size, columns.shape[-1])


def _middles(part: Part) -> NDArray:
    return 0.5 * (part.pieces.first + part.pieces.last)
