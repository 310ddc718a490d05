"""The bench with effects, each as one variant: readings, derivatives, exact fits and left-out readings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.effects import EffectPlace, Rows
from ...models.effects.variants import Variant
from ..bounded.programmes import Growth, any_centre, chebyshev_radius, least_squares
from ..bounded.work import Work, charge
from ..calibration.model import (
    Linearisation,
    Positions,
    direction_jacobian,
    predicted_input,
    predicted_reading,
    reading_jacobian,
    slip_jacobian,
)
from .bench_visits import (
    Circumstances,
    Visits,
    is_linear,
    left_open,
    readings_at,
    signature_columns,
    untold_readings,
)
from .cells import Cell, CellsAtRest
from .fit import Fit, Way, blocks_of, coefficient_limits, estimated

LARGEST_OF_BENCH = 0.5
"""No parameter of a bench [1], [rad], [g] is larger, as none of `--bounds`: accelerometers that are swapped or reversed
are no bench with an effect."""
HARD = 1e-3
"""By this part of half its range a sum of coefficients is held more loosely per unit of the radius."""
MAX_ITERATIONS, MAX_MOVES = 12, 8
DIFFERENCE = 1e-6
"""Difference of parameters [1], [rad], [g] for exact derivatives."""
EDGE = 1e-6
"""Error of a radius by approximate derivatives, for a set at the very edge."""
LEAST_PART = 0.01
"""Steps to a fit at the very edge are no shorter than this part of the whole one."""
ATTAINED = 1e-10
"""Relative difference between the radius of the programme and the largest misfit where it is attained."""
ASTRAY = 10.0
"""No bench has a parameter as large [1], [rad], [g]: a fit that comes there runs away."""
DIVERGED = 1e9
"""No model of a bench has a reading as large [g]: the sizes of its effects run away."""
NEAR = 1e-4
"""A step below this size [1], [rad], [g] leads near enough to the fit to refuse sets that are far from standing."""
SECOND_ORDER = 10.0
"""Factor of the square of a step's length that bounds the error of the linear model."""
CONVERGED = 1e-12
"""Parameters [1], [rad] that move by less than this do not move."""
DETERMINED = 1e-8
"""Part of the largest singular value below which readings that are kept do not determine a direction."""
MAX_LEVERAGE = 1.0
"""Largest uncertainty (rms) of a scored prediction over that of a reading."""


Exact = Callable[[Sequence[EffectPlace], NDArray, NDArray], tuple[NDArray, NDArray, NDArray]]
"""Errors (M,), derivatives (M, P + K), growth of the bounds (M, P + K), in bounds, at parameters and coefficients."""
Settled = Callable[[NDArray, NDArray, NDArray, NDArray], NDArray]
"""Derivatives, errors, which columns (n,) bounds are paid by, a step (n,): another step to the same radius."""


@dataclass(frozen=True)
class Paid:
    """Coefficients of one effect that have one sign, and with whose size bounds may grow.

    `columns` are their numbers, `low` and `high` the ends of the possible values of each.
    """

    columns: slice
    low: float
    high: float

    @property
    def signed_ends(self) -> list[tuple[float, float]]:
        """Possible signs, each with the end on its side of zero."""
        return [(sign, end) for sign, end in ((-1.0, self.low), (1.0, self.high)) if sign * end > 0.0]

    @staticmethod
    def of(places: Mapping[EffectPlace, int], rate: Floats) -> "list[Paid]":
        """Return the effects of one coefficient, with its column, whose size makes the bounds grow by `rate` (M, n)."""
        coefficients = []
        for place, column in places.items():
            if rate[:, column].any():
                (low,), (high,) = coefficient_limits(place)
                coefficients.append(Paid(slice(column, column + 1), float(low), float(high)))
        return coefficients


def growths_of(paid: Sequence[Paid], rate: Floats, x: Floats) -> tuple[Growth, ...]:
    """The bounds' growth about a solution x (n,), in every branch of signs that the coefficients may have.

    By `rate` (M, n) the bounds grow per unit of a coefficient's size. None where nothing is paid for.
    """
    if not paid:
        return ()
    growths = []
    # The possible ends of each coefficient, sign by sign.
    ends = [coefficient.signed_ends for coefficient in paid]
    for branch in product(*ends):
        signs, low, high = np.zeros(len(x)), np.full(len(x), -np.inf), np.full(len(x), np.inf)
        for (sign, end), coefficient in zip(branch, paid, strict=True):
            columns = coefficient.columns
            signs[columns] = sign
            low[columns], high[columns] = min(0.0, end) - x[columns], max(0.0, end) - x[columns]
        growths.append(Growth(rate @ (signs * x), rate * signs, low, high))
    return tuple(growths)


def least_radius(
    jacobian: NDArray, residual: NDArray, bound: NDArray, growths: Sequence[Growth], *, any_step: bool = False
) -> tuple[float, NDArray, int]:
    """Return the least radius over all branches of the bounds' growth, the step (n,) to it, and its branch.

    Where several steps lead to it, `any_step` of them, or that of the programme.
    """
    if any_step and not growths:
        return *any_centre(jacobian, residual, bound), 0
    fits = [chebyshev_radius(jacobian, residual, bound, growth=growth)[:2] for growth in growths or (None,)]
    branch = int(np.argmin([radius for radius, _ in fits]))
    return (*fits[branch], branch)


def begun_with(growths: Sequence[Growth], branch: int) -> tuple[Growth, ...]:
    """The branches of the bounds' growth with one of them in front."""
    ordered = list(growths)
    if ordered:
        ordered.insert(0, ordered.pop(branch))
    return tuple(ordered)


@dataclass(frozen=True)
class Relaxation:
    """An upper limit for every variant of an effect: a set refused with it is refused with each variant.

    `ways` is the number of variants; 0 for a linear effect that the record leaves partly open. `touched` (M,) are the
    readings that some variant changes: they say nothing about the bench. `widening` (M,) is the growth of the other
    bounds, as fractions of g. `columns` (M, K) is the linear part of the effect; `rate` (M,) is the growth of the
    bounds per unit of its size.
    """

    place: EffectPlace
    ways: int
    touched: NDArray
    widening: NDArray
    columns: NDArray
    rate: NDArray


@dataclass(frozen=True)
class Model:
    """Prediction and derivatives of a bench with effects at one point.

    `reading`, `bound` (3 N,): predicted readings and bounds of their errors, fractions of g. `jacobian` (3 N, P + K):
    derivatives by parameters of the bench and coefficients of the effects. `rate` (3 N, P + K): growth of the bounds
    per unit of a coefficient's size. `variants`: action of each effect that is not linear; `rows`: rows with this
    prediction.
    """

    reading: NDArray
    jacobian: NDArray
    bound: NDArray
    rate: NDArray
    variants: tuple[Way | None, ...]
    rows: Rows


@dataclass(frozen=True, kw_only=True)
class Readings(Visits):
    """Readings at positions of the table, and how a bench with effects predicts them.

    `reading` (N, 3) over g, `bound` (3 N,) of their errors, fractions of g, `sign` (N, 3) of the inputs, by which scale
    factors are chosen.
    """

    reading: NDArray
    bound: NDArray
    sign: NDArray

    @staticmethod
    def of(here: Linearisation, circumstances: Circumstances, resolution: float = 0.0) -> "Readings":
        """The readings of a linearised record."""
        at = (here.parametrisation, here.positions, circumstances, resolution)
        return Readings(*at, reading=here.reading, bound=here.bound, sign=here.sign)

    def selected(self, rows: NDArray) -> Self:
        """Return the readings at some of the positions (n,) of int."""
        measured = {"reading": self.reading[rows], "bound": self.bound[readings_at(rows)], "sign": self.sign[rows]}
        return replace(super().selected(rows), **measured)

    def ways(self, place: EffectPlace, rows: Rows) -> Sequence[Way]:
        """Return the cells of an effect's unknown number, or its variants."""
        return CellsAtRest(place, rows) if place.definition.searched is not None else self.variants(place, rows)

    def variants(self, place: EffectPlace, rows: Rows) -> Sequence[Variant]:
        """Return the variants of an effect that is not linear; none of any other."""
        variants = place.definition.variants
        return [] if variants is None else variants(place, rows, self.reading, float(self.bound.min()))

    def relaxations(self, rows: Rows, places: Sequence[EffectPlace]) -> list[Relaxation]:
        """Return a relaxation for each effect that can act on the readings."""
        relaxations = []
        for place in places:
            if is_linear(place):
                added = np.zeros(rows.n.size), signature_columns([place], rows), left_open(place, rows)
                relaxations.append(Relaxation(place, 0, untold_readings([place], rows), *added))
                continue
            variants = self.variants(place, rows)
            if not variants:
                continue
            touched = np.any([variant.touched for variant in variants], axis=0)
            widening = np.max([variant.widening for variant in variants], axis=0)
            nothing = np.zeros((touched.size, 0)), np.zeros(touched.size)
            relaxations.append(Relaxation(place, len(variants), touched.ravel(), widening.ravel(), *nothing))
        return relaxations


@dataclass(frozen=True)
class Cast:
    """A set of effects, each with its variant.

    `ways`: of each effect that is not linear, which of its variants.
    """

    places: tuple[EffectPlace, ...]
    ways: Mapping[EffectPlace, int] = field(default_factory=dict)

    def variants(self, readings: Readings, rows: Rows) -> tuple[Way | None, ...] | None:
        """Return the variant of each effect; None where a way gives none here."""
        variants: list[Way | None] = []
        for place in self.places:
            ways = readings.ways(place, rows) if place in self.ways else [None]
            if (way := self.ways.get(place, 0)) >= len(ways):
                return None
            variants.append(ways[way])
        return tuple(variants)

    def model(
        self, readings: Readings, point: NDArray, coefficients: NDArray, blocks: Sequence[slice] | None = None
    ) -> Model | None:
        """Return the bench with these effects at a point and coefficients; None where a way gives no variant."""
        p, own = readings.parametrisation, dict(zip(self.places, blocks or blocks_of(self.places), strict=True))
        linear = [(place, coefficients[block]) for place, block in own.items() if place not in self.ways]
        at = readings.disturbed(point, linear)
        at, slipped = self._slipped(readings, point, at, {place: coefficients[block] for place, block in own.items()})
        rows = readings.rows(point, at)
        columns = {place: signature_columns([place], rows) for place, _ in linear}
        reading = predicted_reading(p, point, at, readings.sign).ravel()
        for place, part in linear:
            # The exact angles already include effects that turn the table or change its encoders.
            if not place.definition.turns_table:
                reading = reading + columns[place] @ part
        slopes = reading_jacobian(p, point, at, readings.sign)
        rows = replace(rows, prediction=reading.reshape(-1, 3))
        bound, rate = readings.bound, np.zeros((len(reading), len(point) + len(coefficients)))
        for place, part in linear:
            if len(part) == 1:
                rate[:, len(point) + own[place].start] = left_open(place, rows)
            else:
                # The undetermined part of an amplitude and a phase is of second order: take it at their size here.
                bound = bound + float(np.linalg.norm(part)) * left_open(place, rows)
        variants = self.variants(readings, rows)
        if variants is None:
            return None
        fixed = np.zeros(rows.n.shape, dtype=bool)
        for place, variant in zip(self.places, variants, strict=True):
            if isinstance(variant, Cell):
                if variant.missed is not None:
                    rate[:, len(point) :][:, own[place]] = variant.missed.reshape(len(reading), -1)
                columns[place] = slipped.get(place, variant.columns).reshape(len(reading), -1)
            elif variant is not None:
                slopes = _without_lost(readings, point, at, variant, slopes)
                reading = reading + variant.offset.ravel()
                bound = bound + variant.widening.ravel()
                columns[place] = variant.columns.reshape(len(reading), -1)
                fixed |= variant.fixed
        slopes[fixed] = 0.0
        rate[fixed.ravel()] = 0.0
        for place, block in own.items():
            if place not in self.ways:
                columns[place][fixed.ravel()] = 0.0
            elif place not in slipped:
                reading = reading + columns[place] @ coefficients[block]
        jacobian = np.hstack([slopes.reshape(len(reading), -1), *(columns[place] for place in self.places)])
        for variant in variants:
            if isinstance(variant, Variant) and variant.mixed is not None:
                # The exchange of channels comes last, with all effects on them.
                reading, jacobian = _mixed(variant.mixed, reading), _mixed(variant.mixed, jacobian)
                bound, rate = (_mixed(np.abs(variant.mixed), values) for values in (bound, rate))
        return Model(reading, jacobian, bound, rate, variants, rows)

    def _slipped(
        self, readings: Readings, point: NDArray, at: Positions, sizes: Mapping[EffectPlace, NDArray]
    ) -> tuple[Positions, dict[EffectPlace, NDArray]]:
        """Positions with the block turned on the table, and derivatives (N, 3, 3) by the vector of each such effect."""
        places = [place for place in self.ways if place.definition.stage == "geometry_effects"]
        if not places:
            return at, {}
        rows, after = readings.rows(point, at), {}
        for place in places:
            start = CellsAtRest(place, rows).ends[self.ways[place]]
            after[place] = (rows.hours > start)[:, None]
        slips = np.zeros((len(at.alpha), 3)) if at.slips is None else at.slips
        at = replace(at, slips=slips + sum(after[place] * sizes[place] for place in places))
        slopes = slip_jacobian(readings.parametrisation, point, at, readings.sign)
        return at, {place: slopes * after[place][:, :, None] for place in places}


def _mixed(matrix: NDArray, values: NDArray) -> NDArray:
    """Values (3 N,) or (3 N, K) of the readings multiplied by the matrix (N, 3, 3) of each row."""
    return (matrix @ values.reshape(len(matrix), 3, -1)).reshape(values.shape)


def _without_lost(readings: Readings, point: NDArray, at: Positions, variant: Variant, slopes: NDArray) -> NDArray:
    """Return derivatives (N, 3, P) of the readings by the bench's parameters, less the part that a variant removes."""
    if not variant.lost.any():
        return slopes
    p, remaining = readings.parametrisation, slopes.copy()
    targets = (p.selection @ point)[at.mounting]
    inputs, n = direction_jacobian(p, point, at), predicted_input(p, point, at)
    for k, pair in enumerate(SYMMETRIC_PAIRS):
        rows = np.flatnonzero(variant.lost[:, k])
        chosen = np.where(readings.sign[rows, k] >= 0, TARGETS.index(pair[0]), TARGETS.index(pair[1]))
        scale = 1.0 + targets[rows, chosen]
        by_scale = p.selection[at.mounting[rows], chosen]
        remaining[rows, k] -= scale[:, None] * inputs[rows, k] + n[rows, k][:, None] * by_scale
    return remaining


def fitted(
    readings: Readings,
    cast: Cast,
    start: NDArray,
    limit: float = np.inf,
    work: Work | None = None,
) -> Fit | None:
    """Fit the bench together with effects: least squares, then the Chebyshev programme, both relinearised.

    The fit begins at parameters (P,) of the bench. It returns None if it leaves the variant of an effect, or if it
    diverges. It also does if its radius is surely above the limit, so that the last steps need no work. The work is
    counted.
    """
    reading, count, work = readings.reading.ravel(), len(start), work or Work()
    begun = cast.variants(readings, readings.rows(start))
    if begun is None:
        return None
    blocks = blocks_of(cast.places, begun)
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    for block, variant in zip(blocks, begun, strict=True):
        if variant is not None:
            x[count:][block] = 0.5 * (variant.low + variant.high)

    def model_at(x: NDArray) -> Model | None:
        work.add(model_work(readings))
        if not (np.abs(x[:count]).max() <= ASTRAY and np.isfinite(x[count:]).all()):
            return None
        model = cast.model(readings, x[:count], x[count:], blocks)
        return model if model is not None and np.abs(model.reading).max() <= DIVERGED else None

    single = {place: count + block.start for place, block in zip(cast.places, blocks, strict=True)}
    single = {place: column for place, column in single.items() if is_linear(place)}

    def fit_at(x: NDArray, model: Model, estimate: NDArray, *, there: bool = False, any_step: bool = False) -> Fit:
        """Return the fit linear at x: at the centre that a step leads to, or at x itself if `there`."""
        paid = Paid.of(single, model.rate) + [
            Paid(slice(count + block.start, count + block.stop), float(way.low[0]), float(way.high[0]))
            for block, way in zip(blocks, model.variants, strict=True)
            if way is not None and way.one_sign
        ]
        residual, growths = reading - model.reading, growths_of(paid, model.rate, x)
        if there:
            # The branch that x lies in has the widest bounds.
            growths = tuple(sorted(growths, key=lambda growth: -growth.now.sum()))
            grown = growths[0].now if growths else 0.0
            step, radius = np.zeros(len(x)), float(((np.abs(residual) - grown) / model.bound).max(initial=0.0))
        else:
            work.programme(*model.jacobian.shape)
            radius, step, branch = least_radius(model.jacobian, residual, model.bound, growths, any_step=any_step)
            growths = begun_with(growths, branch)
        at = (x, step, residual, model.bound, model.jacobian)
        return Fit(cast.places, blocks, *at, radius, estimate, x[count:], model.variants, growths)

    model, near = model_at(x), False
    # Readings with the widest bounds have no weight at first.
    size = np.append(np.zeros(count), np.ones(len(x) - count))
    for iteration in range(MAX_ITERATIONS + 1):
        if model is None:
            return None
        loose = model.bound + model.rate @ size
        step = least_squares(model.jacobian / loose[:, None], (reading - model.reading) / loose)
        if iteration == MAX_ITERATIONS or np.abs(step).max(initial=0.0) < CONVERGED:
            break
        x = x + step
        size = np.abs(x)
        model = model_at(x)
        if model is not None and not near and np.abs(step).max(initial=0.0) < NEAR:
            near, tried = True, fit_at(x, model, x, any_step=True)
            # The programmes that follow may end lower by the second order of the remaining steps.
            more = SECOND_ORDER * float(np.abs(tried.step).sum() ** 2 / model.bound.min())
            if tried.radius > limit + more:
                return None
    assert model is not None
    estimate, fit = x, fit_at(x, model, x)
    lowest = fit.radius
    for _ in range(MAX_MOVES):
        # Noise may be exactly at its bound: then the second order of the step to the centre must not count either.
        x = x + fit.step
        model = model_at(x)
        if model is None:
            return None
        least, fit = fit.radius, fit_at(x, model, estimate, there=True)
        if fit.radius <= least + ATTAINED * max(1.0, least):
            break
        fit = fit_at(x, model, estimate)
        lowest = min(lowest, fit.radius)
    fit = fit_at(x, model, estimate, there=True)
    part = 1.0
    # At the very edge derivatives must be exact, and whole steps may overshoot by their second order.
    while lowest <= limit + EDGE and fit.radius > limit and part > LEAST_PART:
        exact = replace(model, jacobian=exact_jacobian(model_at, x, model.jacobian))
        shorter = x + part * fit_at(x, exact, estimate).step
        moved = model_at(shorter)
        tried = None if moved is None else fit_at(shorter, moved, estimate, there=True)
        if moved is not None and tried is not None and tried.radius < fit.radius:
            x, model, fit = shorter, moved, tried
        else:
            part *= 0.5
    return fit if _stands(fit, model.rows) else None


def exact_jacobian(model_at: Callable[[NDArray], Model | None], x: NDArray, approximate: NDArray) -> Floats:
    """Derivatives (M, P + K) of the readings at x by central differences; approximate ones where the model ends."""
    jacobian = np.array(approximate)
    for column, unit in enumerate(np.eye(len(x))):
        before, after = model_at(x - DIFFERENCE * unit), model_at(x + DIFFERENCE * unit)
        if before is not None and after is not None:
            jacobian[:, column] = (after.reading - before.reading) / (2.0 * DIFFERENCE)
    return jacobian


def relinearised(at: Exact, places: Sequence[EffectPlace], start: NDArray, settled: Settled | None = None) -> Fit:
    """The fit of exact rows with linear effects: least squares, then the Chebyshev programme, both relinearised.

    It begins at parameters (P,). `settled` may move a step to the least radius where this leaves parameters open.
    """
    count, blocks = len(start), blocks_of(places)
    x = np.append(start, np.zeros(blocks[-1].stop if blocks else 0))
    single = {p: count + b.start for p, b in zip(places, blocks, strict=True) if b.stop - b.start == 1}

    def fit_at(x: NDArray, estimate: NDArray, *, there: bool) -> Fit:
        residual, jacobian, rate = at(places, x[:count], x[count:])
        growths, bound = growths_of(Paid.of(single, rate), rate, x), np.ones(len(residual))
        if there:
            growths = tuple(sorted(growths, key=lambda growth: -growth.now.sum()))
            grown = growths[0].now if growths else 0.0
            step, radius = np.zeros(len(x)), float((np.abs(residual) - grown).max(initial=0.0))
        else:
            radius, step, branch = least_radius(jacobian, residual, bound, growths)
            if settled is not None:
                step = settled(jacobian, residual, np.any(rate, axis=0, keepdims=True)[0], step)
            growths = begun_with(growths, branch)
        own = (x, step, residual, bound, jacobian)
        return Fit(tuple(places), blocks, *own, radius, estimate, x[count:], (), growths)

    for _ in range(MAX_ITERATIONS):
        residual, jacobian, _ = at(places, x[:count], x[count:])
        step = estimated(jacobian, residual)
        x = x + step
        if np.abs(step).max(initial=0.0) < CONVERGED:
            break
    estimate, best = x, fit_at(x, x, there=True)
    for _ in range(MAX_MOVES):
        fit = fit_at(x, estimate, there=False)
        x = x + fit.step
        moved = fit_at(x, estimate, there=True)
        best = min(best, moved, key=lambda one: one.radius)
        if moved.radius <= fit.radius + ATTAINED * max(1.0, fit.radius):
            break
    return best


def model_work(readings: Visits) -> float:
    """The work of one model of these readings."""
    return 2000.0 + 20.0 * len(readings)


def _stands(fit: Fit, rows: Rows) -> bool:
    """Return whether each effect that is not linear acts at the fit as its variant assumes."""
    for block, variant in zip(fit.blocks, fit.variants, strict=True):
        if variant is None:
            continue
        middle = fit.coefficients[block]
        within = bool(np.all(middle >= variant.low - 1e-12) and np.all(middle <= variant.high + 1e-12))
        if not within or (isinstance(variant, Variant) and not variant.stands(rows, middle)):
            return False
    return True


def with_possible_sizes(fit: Fit, limit: float, largest_of_bench: float) -> Fit | None:
    """Return a fit with possible sizes, its own or the nearest; None where none keep the radius within the limit."""
    if np.abs(fit.point).max(initial=0.0) > largest_of_bench:
        return None
    if fit.is_possible:
        return fit
    coefficients, free = fit.coefficients, np.full(len(fit.point), np.inf)
    low, high = (np.append(sign * free, end - coefficients) for sign, end in zip((-1.0, 1.0), fit.limits, strict=True))
    growth = fit.growths[0] if fit.growths else None
    rows = (fit.jacobian, fit.residual, fit.bound)
    sums, middle, half = _limited_sums(fit)
    if len(sums):
        # A row with a bound that hardly grows with the radius holds a sum within its ends.
        hard = half * HARD
        anything = np.full(len(low), np.inf)
        growth = growth or Growth(np.zeros(len(fit.bound)), np.zeros_like(fit.jacobian), -anything, anything)
        now = np.append(growth.now, half - limit * hard)
        growth = Growth(now, np.vstack((growth.rows, np.zeros_like(sums))), growth.low, growth.high)
        rows = (np.vstack((fit.jacobian, sums)), np.append(fit.residual, middle), np.append(fit.bound, hard))
    radius, step, _ = chebyshev_radius(*rows, low=low, high=high, growth=growth)
    moved = replace(fit, radius=radius, step=step, stated=coefficients + step[len(fit.point) :])
    return moved if radius <= limit and moved.is_possible else None


def _limited_sums(fit: Fit) -> tuple[NDArray, NDArray, NDArray]:
    """Return sums (S, P + K) of coefficients that are sizes, with middle and half (S,) of their ranges from the fit."""
    count = len(fit.point)
    sums, middle, half = [np.zeros((0, len(fit.at)))], [np.zeros(0)], [np.zeros(0)]
    for _, block, way in fit.ways:
        if way is None or len(way.directions) == len(way.low):
            continue
        directions = np.zeros((len(way.directions), len(fit.at)))
        directions[:, count + block.start : count + block.stop] = way.directions
        low, high = np.array(way.limits[: len(directions)]).T
        sums.append(directions)
        middle.append(0.5 * (low + high) - directions @ fit.at)
        half.append(0.5 * (high - low))
    return np.vstack(sums), np.concatenate(middle), np.concatenate(half)


# Left-out readings


def leverages(jacobian: NDArray, fitted_rows: NDArray, rows_out: NDArray) -> NDArray | None:
    """Return the leverage (H,) of held-out readings over the others; None where the others lose the rank."""
    inverse = _inverse(jacobian, determined(jacobian), fitted_rows)
    return None if inverse is None else np.linalg.norm(jacobian[rows_out] @ inverse[1], axis=1)


def predicted_errors(
    unit: NDArray, rank: int, residual: NDArray, bound: NDArray, fitted_rows: NDArray, rows_out: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Return the errors (H,) of left-out readings and their leverages (H,); None where rank is lost.

    Least squares over the kept readings predict the others. Readings are in units of their bounds, as are the
    derivatives (M, n), `unit`, of a rank. A leverage is the uncertainty of a prediction in bounds, where each error is
    one bound (rms).
    """
    charge(100.0 + 5e-3 * len(fitted_rows) * unit.shape[1] ** 2)
    solved = _inverse(unit, rank, fitted_rows)
    if solved is None:
        return None
    inverse, uncertain = solved
    predicted = unit[rows_out] @ (inverse @ (residual[fitted_rows] / bound[fitted_rows]))
    return residual[rows_out] - bound[rows_out] * predicted, np.linalg.norm(unit[rows_out] @ uncertain, axis=1)


def determined(matrix: NDArray) -> int:
    """Return the number of directions that rows (M, n) determine, independent of the units of the columns."""
    values = np.linalg.svd(matrix / _sizes(matrix), compute_uv=False)
    return int((values > DETERMINED * values.max(initial=0.0)).sum())


def _sizes(matrix: NDArray) -> Floats:
    scale = np.abs(matrix).max(axis=0, initial=0.0)
    return np.where(scale > 0.0, scale, 1.0)


def _inverse(matrix: NDArray, rank: int, fitted_rows: NDArray) -> tuple[NDArray, NDArray] | None:
    """Return the pseudoinverse (n, K) of the kept rows; None where they lose the rank of all, or are too few.

    Also returns a matrix (n, r) whose rows have the length of the pseudoinverse's rows in every direction.
    """
    scale = _sizes(matrix)
    u, sizes, directions = np.linalg.svd(matrix[fitted_rows] / scale, full_matrices=False)
    large = sizes > DETERMINED * sizes.max(initial=0.0)
    if len(fitted_rows) <= rank or large.sum() < rank:
        return None
    uncertain = (directions[large].T / sizes[large]) / scale[:, None]
    return uncertain @ u[:, large].T, uncertain
