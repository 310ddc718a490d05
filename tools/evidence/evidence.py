"""Evidence: a record held against a model, composed of rows, model and reader.

The rows are linear about one fit or run. The model fits sets of effects to them. The reader gives their meaning in the
record: names, units, words, left-out data, and runs to repeat. Code that works on evidence knows no kind of record.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Protocol, Self, final

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.effects import EffectPlace
from ..bounded.programmes import Interval, column_space, spaces_beyond
from ..bounded.sets import Problem, sets_of_size
from ..bounded.work import Work, charge
from ..calibrated import Calibration, Parameter, Sigma
from ..calibration.parameter_sets import Sized
from ..calibration.targets import words_of
from ..result import finite_or_none
from .extension import Extension
from .fit import Classes, Fit, Gain, blocks_of, coefficient_limits, estimated, least_radius, width_of
from .pairs import Pair
from .rows import About, Channel, Rows

WORK_OF_RERUN = 3e5, 30.0
"""Work of a new simulation: of its components, and of each row of the evidence."""
ROUNDS_OF_OWN = 3
"""Rounds of least squares that bring a record's own parameters to rest beside effects of given sizes."""
SEEN = 1e-3
"""Part of its bound that an effect of its largest possible size must move an error by to be seen."""
SHUFFLES = 40
LIMIT = 1.0 + 1e-7
"""Radius up to which a model stands: one, and the rounding of the programmes."""
Sizes = Mapping[EffectPlace, NDArray]
"""Effects with their linear coefficients."""
Errors = tuple[Floats, Floats]
Exclusions = Sequence[Mapping[str, Any]] | None
"""Excluded sizes of effects; None where the work reached its limit before they were known."""


@dataclass(frozen=True)
class Worst:
    """The error of a left-out reading over its bound, and the largest that noise can cause.

    `position` is the record's own number, `accelerometer` counts from 1.
    """

    position: int
    accelerometer: int
    error: float
    allowed: float


@dataclass(frozen=True)
class ReadOff:
    """An effect that readings show by themselves: its place, its stated parameters and their possible intervals.

    `radius` is that of the model without it, with the readings that show it included; `objection` is the reason not to
    name it.
    """

    place: EffectPlace
    values: tuple[float, ...]
    ends: tuple[Interval, ...]
    radius: float
    objection: str = ""


@dataclass(frozen=True, eq=False)
class Trial:
    """Trial of some effects of a fit on left-out readings.

    `folds` and `blocks` are errors (R,) of left-out data, without and with the effects: parts of the evidence in turn,
    and blocks in time. They are None where that is not possible. `rows` (R,) are those of the folds, where they are
    numbered. `shuffled` are the errors of the folds with the effects' signatures moved to places where they do not
    belong. `jointly` marks the trial of the whole set; `worst` is then the error of folds or blocks that is farthest
    beyond the noise.
    """

    places: tuple[EffectPlace, ...]
    folds: Errors | None
    blocks: Errors | None
    shuffled: Iterable[Floats] = ()
    jointly: bool = False
    worst: Worst | None = None
    rows: Ints | None = None


@dataclass(frozen=True)
class Effort:
    """Effort that a search in a record may take.

    Attributes
    ----------
    cost : float
        cost of each set, relative to a usual record
    most_sets, most_rows : int or None
        number of reported sets, of rows that bound the possible values; None: all
    most_known_alone : int
        largest size of a set that needs no proven quantity to be reported as the only one
    ranks_each : bool
        true if the radius with each single effect is computed
    """

    cost: float = 1.0
    most_sets: int | None = 12
    most_rows: int | None = 2500
    most_known_alone: int = 0
    ranks_each: bool = True


class Model(Protocol):
    """A model of a record, linear about its rows, to which sets of effects can be fitted.

    `curvature` times the square of a radius is the error of the linear model, in bounds. `room` is the addition to the
    bounds for the digits of the record.
    """

    curvature: float
    room: float

    @property
    def rows(self) -> Rows:
        """The rows about one point."""
        ...

    @property
    def effort(self) -> Effort:
        """Effort that a search may take."""
        ...

    @property
    def limit(self) -> float:
        """Largest radius of a consistent model."""
        ...

    @property
    def second_order(self) -> float:
        """Error of the linear model, in units of the bounds."""
        ...

    @property
    def falsified(self) -> bool:
        """Return whether the record contradicts the model without effects."""
        ...

    @property
    def radius(self) -> float:
        """Radius of the model without effects."""
        ...

    @property
    def baseline(self) -> Fit:
        """The model without effects."""
        ...

    @property
    def classes(self) -> Classes:
        """The effects that can be seen and separated."""
        ...

    def spaces_of(self, places: Sequence[EffectPlace]) -> list[Floats]:
        """Return the column space of each effect beyond the model, as in `classes`."""
        ...

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The Chebyshev fit of the model and some effects of possible sizes."""
        ...

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves."""
        ...

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a given size that no bound refuses, by default one effect a class; the most promising first.

        The cost is added to the work, as it is in `mended`.
        """
        ...

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return consistent fits of a set of effects with possible sizes, each in another variant."""
        ...

    def untried(self, size: int) -> str | None:
        """Return why consistent sets of a size may not be the smallest: which smaller ones were not tried."""
        ...

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, Floats]]:
        """Yield the effects that a fit lacks, with their columns (M, k) there."""
        ...

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The rows about parameters (P,) and coefficients (K,) of some effects."""
        ...

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """Return the model with formulas and tables as further effects; raise a ValueError for an impossible one."""
        ...


class Linear:
    """A model that is linear in its parameters and effects; models of records with a run derive from it."""

    rows: Rows
    effort: Effort = Effort()
    limit: float = LIMIT
    curvature: float = 0.0
    room: float = 0.0

    def __init__(self, rows: Rows) -> None:
        self.rows = rows

    @cached_property
    def baseline(self) -> Fit:
        """The model without effects."""
        return self.refit(())

    @property
    def radius(self) -> float:
        """Radius of the model without effects."""
        return self.baseline.radius

    @property
    def falsified(self) -> bool:
        """Return whether the record contradicts the model without effects."""
        return self.baseline.radius > self.limit

    @property
    def second_order(self) -> float:
        """Error of the linear model, in units of the bounds."""
        return self.curvature * self.radius**2

    @cached_property
    def classes(self) -> Classes:
        """The effects that can be seen and separated."""
        return Classes.of(self.seen, self.spaces_of(self.seen))

    @cached_property
    def seen(self) -> tuple[EffectPlace, ...]:
        """Effects that a possible size makes visible beside the model."""
        base, seen = column_space(self.rows.nominal), []
        for place in self.rows.places:
            columns = self.rows.columns_of([place])
            visible = (columns - base @ (base.T @ columns)) * np.abs(coefficient_limits(place)).max(axis=0)
            if np.abs(visible).max(initial=0.0) > SEEN:
                seen.append(place)
        return tuple(seen)

    def spaces_of(self, places: Sequence[EffectPlace]) -> list[Floats]:
        """Return the column space of each effect beyond the model."""
        return spaces_beyond(self.rows.nominal, [self.rows.columns_of([place]) for place in places])

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The Chebyshev fit of the model and some effects of possible sizes."""
        return linear_fit(self.rows, places)

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves."""
        return self.refit([place]).radius

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a given size that no bound refuses; the most promising first."""
        places = self.classes.places if among is None else among
        rows = self.rows
        problem = Problem.of(rows.residual, rows.nominal, [rows.columns_of([place]) for place in places])
        for chosen in sets_of_size(problem, size, self.limit - 1.0, 0, work):
            yield tuple(places[i] for i in chosen.effects)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return the fit of a set of effects, if it is consistent."""
        work.programme(len(self.rows.residual), self.rows.nominal.shape[1] + width_of(places))
        fit = self.refit(places)
        return [fit] if fit.radius <= self.limit else []

    def untried(self, size: int) -> str | None:
        """Return None: all sets are tried."""
        return None

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, Floats]]:
        """Yield the effects that a fit lacks, with their columns (M, k)."""
        for place in self.seen:
            if place not in fit.places:
                yield place, self.rows.columns_of([place])

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The rows about parameters (P,) and coefficients (K,) of some effects."""
        rows = self.rows
        matrix = rows.matrix(places)
        step = np.concatenate([point - rows.point, coefficients])
        return About(rows.residual - matrix @ step, matrix, rows.bound, np.zeros_like(matrix))

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """Return the same evidence: a record with columns of any effect has those of all."""
        return self


def linear_fit(rows: Rows, places: Sequence[EffectPlace]) -> Fit:
    """The Chebyshev fit of linear rows over their bounds with some effects of possible sizes."""
    matrix, count = rows.matrix(places), len(rows.names)
    free, ends = np.full(count, np.inf), limits_of(places)
    low, high = np.append(-free, ends[0]), np.append(free, ends[1])
    at = np.concatenate([rows.point, np.zeros(matrix.shape[1] - count)])
    squares = estimated(matrix, rows.residual)
    radius, step = least_radius(matrix, rows.residual, (low, high), squares)
    estimate = at + squares
    blocks = blocks_of(places)
    return Fit(tuple(places), blocks, at, step, rows.residual, rows.bound, matrix, radius, estimate, estimate[count:])


def limits_of(places: Sequence[EffectPlace]) -> tuple[Floats, Floats]:
    """Ends of the possible values of each coefficient of some effects."""
    ends = [np.array(coefficient_limits(place)) for place in places]
    low, high = np.hstack([np.zeros((2, 0)), *ends])
    return low, high


class Rerun(Protocol):
    """Result of the extended components, FMUs, for a record.

    `quoted` is the name of the errors in words, the unit in which they are quoted, and its size in theirs.
    """

    @property
    def quoted(self) -> tuple[str, str, float]:
        """Return the name of the quoted errors in words, their unit, and its size."""
        ...

    def gain(self, fit: Fit) -> Gain | None:
        """Return the gain of the extended components on data that no fit used; None where none can be computed."""
        ...

    def errors(self, effects: Sizes) -> Floats | None:
        """The quoted errors (S, d) with effects of given coefficients; None: cannot be run."""
        ...

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Return components with a fit's parameters and its stated effects, and scenarios of the record.

        Raises a ValueError if a component does not accept a value.
        """
        ...

    def without(self, effects: Sizes) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Return the effects, of given coefficients, that can be subtracted, and the record's fields without them."""
        ...

    def reach(self, effects: Sizes, errors: Sizes) -> NDArray | None:
        """Return the largest remainder (3,) [m/s²] of `without` in each accelerometer, by errors of the coefficients.

        None where it changes no accelerometer.
        """
        ...


@dataclass(frozen=True)
class Lengths:
    """Parts of the rows that are pieces of several lengths.

    Attributes
    ----------
    quoted : int
        number of the part whose errors are quoted
    model_of : callable
        the model of other rows, given as ``rows=``
    as_measured : Rows or None
        rows before any correction, where there is one
    would_need : callable
        further condition under which some effects are enough, in words; empty where there is none
    """

    quoted: int
    model_of: Callable[..., Any]
    as_measured: Rows | None
    would_need: Callable[[Sequence[EffectPlace]], str]


@dataclass(frozen=True, eq=False)
class Reader:
    """Reader of a record's rows: their names, units and words, and the further data of the record.

    Each kind of record derives a class from this one. Methods without a meaning for a kind return None or nothing.
    """

    model: Any

    told_by: ClassVar[str] = "this record"
    """What tells effects of different classes apart, in words."""
    too_large: ClassVar[str] = "the errors are too large for one linear system"
    """What to say where no linear programme of the record can be solved."""
    stated_bound: ClassVar[float | None] = None
    """The noise bound as it is published; None where there is no single one."""
    read_off: ClassVar[Sequence[ReadOff]] = ()
    """Effects that readings show by themselves; the readings that these change are left out of the rows."""
    pairs: ClassVar[Sequence[Pair]] = ()
    """Places, each with a quantity on which its error may depend by any law."""
    rerun: ClassVar[Rerun | None] = None
    lengths: ClassVar[Lengths | None] = None

    @property
    def rows(self) -> Rows:
        """The rows of the model."""
        return self.model.rows

    def about(self, point: NDArray) -> "Reader | None":
        """Return the reader of rows about other parameters (P,); None of a model that is not linearised anew."""
        return None

    def head(self) -> Mapping[str, Any]:
        """Return the first keys of the result: assumptions and baseline; `missing` where nothing can be fitted."""
        raise NotImplementedError

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return the calibration by the record: beside the effects of a consistent fit, or without effects.

        Without a fit, parameters that a falsified model cannot bound have no bounds.
        """
        raise NotImplementedError

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Yield the trials of a fit's effects on left-out data: the second witness."""
        raise NotImplementedError

    def option_of_bounds(self, times: float, places: Sequence[EffectPlace]) -> str:
        """Return the option that multiplies all bounds by `times`, or by more; empty where there is none."""
        return ""

    def missing(self) -> Mapping[str, Any]:
        """Return the keys on missing data where nothing can be fitted; empty where the record is complete."""
        return {}

    def objections(self) -> tuple[str, ...]:
        """Return reasons why the record contradicts its own description."""
        return ()

    def named(self, place: EffectPlace) -> EffectPlace:
        """An effect as the record names it."""
        return place

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Return the intervals of an effect's parameters, widened for everything that the rows leave open."""
        return tuple(ends)

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Exclusions) -> Mapping[str, Any]:
        """Return the keys of the result for a consistent model; `missing` where it has too little to falsify anything.

        `calibration` is that beside the effects of the fit, `excluded` are the excluded sizes of other effects.
        """
        return {}

    def power(self) -> Sequence[Mapping[str, Any]]:
        """Return the size from which an unlisted fault of each place and quantity would show; empty: not judged."""
        return ()

    def channels(self) -> Sequence[Channel]:
        """Return the errors of the baseline by component, with the quantities that they may depend on."""
        return ()

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Return the keys of the result with the measurements that would separate the sets."""
        return {}


@dataclass(frozen=True, eq=False)
class Source:
    """Source of evidence: a record, the function that makes evidence of it, and its options."""

    record: Any
    make: Callable[..., "Evidence"]
    options: Mapping[str, Any]

    def again(self, record: Any = None, **changed: Any) -> "Evidence":
        """Return the evidence of another record, or with changed options; errors as of its `make`."""
        return self.make(self.record if record is None else record, **{**self.options, **changed})


@final
@dataclass(frozen=True, eq=False)
class Evidence:
    """A record held against a model: its rows, the model fitted to them, and the reader of both.

    The engine uses only the members of `Model`; any others serve the kind of record. `source` is the origin of the
    evidence; None for several records together.
    """

    model: Any
    reader: Reader
    source: Source | None = None

    @staticmethod
    def of(reader: Reader, source: Source | None = None) -> "Evidence":
        """The evidence of a reader with its model."""
        return Evidence(reader.model, reader, source)

    @property
    def rows(self) -> Rows:
        """The rows about one point of the model."""
        return self.model.rows

    def including(self, places: Sequence[EffectPlace]) -> "Evidence":
        """The evidence with formulas and tables that were not tried from the first on.

        A ValueError for one that it cannot have.
        """
        model = self.model.including(places)
        return self if model is self.model else Evidence(model, replace(self.reader, model=model), self.source)

    def gain(self, fit: Fit) -> Gain | None:
        """Return the gain of the extended components on data that no fit used; None where none can be computed."""
        if self.reader.rerun is None:
            return None
        charge(WORK_OF_RERUN[0] + WORK_OF_RERUN[1] * len(self.rows.residual))
        return self.reader.rerun.gain(fit)


def trials_in_time(rows: Rows, fit: Fit) -> Iterator[Trial]:
    """Each effect of a fit: blocks in time left out without it, with it, with its columns at other pieces."""
    folds, rng = rows.folds(), np.random.default_rng(len(rows.residual))
    reached = rows.left_out(fit.places, folds)
    for place in fit.places:
        others = [other for other in fit.places if other != place]
        shuffled = (rows.shuffled(place, rng).left_out(fit.places, folds) for _ in range(SHUFFLES))
        yield Trial((place,), (rows.left_out(others, folds), reached), None, shuffled, rows=np.arange(len(reached)))


def own_with(model: Any, effects: Sizes) -> tuple[list[EffectPlace], Floats, Floats]:
    """Return the effects that a record can show, their given coefficients (K,), and its own parameters (P,).

    The parameters are those of least squares beside the effects.
    """
    linear = model.rows.linear_places
    places = [place for place in effects if place in linear]
    sizes = stacked_sizes(effects, places)
    point = model.rows.point
    for _ in range(ROUNDS_OF_OWN):
        at = model.about(places, point, sizes)
        rows = at.jacobian[:, : len(point)] / at.bound[:, None]
        point = point + estimated(rows, at.residual / at.bound) if len(point) else point
    return places, sizes, point


def stacked_sizes(effects: Sizes, places: Sequence[EffectPlace]) -> Floats:
    """The coefficients (K,) of some effects, one after the other."""
    sizes = [np.zeros(0)]
    for place in places:
        sizes.append(effects[place])
    return np.concatenate(sizes)


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
    """Return a calibration without any result, with the reason."""
    sigma = Sigma.model_validate({"value": None, "kind": "unknown", "from": basis})
    return Calibration(verdict="insufficient", sigma=sigma, radius=None, estimator=None, parameters=[])


def rms_size(error: NDArray) -> float:
    """Root mean square of the size of errors (S, d)."""
    return float(np.sqrt(np.mean((error**2).sum(axis=1)))) if len(error) else 0.0


def largest_size(error: NDArray) -> float:
    """Largest size of errors (S, d)."""
    return float(np.linalg.norm(error, axis=1).max(initial=0.0))
