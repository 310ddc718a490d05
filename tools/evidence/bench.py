"""The evidence of rests on a table: the exact model relinearised with each set of effects, outliers, ways of acting."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ...models.effects import POSITION_EFFECTS, EffectPlace
from ...models.effects import Rows as Contexts
from ...models.effects.last_stage import place_of
from ..bounded.programmes import MANY_ROWS, Interval, any_centre
from ..bounded.sets import MAX_SET
from ..bounded.work import Work
from ..calibrated import OpenTarget, noise_option
from ..calibration.calibration import (
    Asked,
    Calibration,
    calibrate,
    radius_limit,
    reading_uncertainty,
    repeats,
)
from ..calibration.model import Linearisation, least_singular, linearise
from ..calibration.parameter_sets import Sized
from ..calibration.targets import NAMES
from ..records import BenchRecord, PositionRecord
from ..rounding import exactly
from .bench_left_out import FOLDS, LinearReadings, trials
from .bench_model import (
    LARGEST_OF_BENCH,
    Cast,
    Paid,
    Readings,
    fitted,
    growths_of,
    least_radius,
    with_possible_sizes,
)
from .bench_predictions import (
    can_be_run,
    dense_spaces,
    helpful_mounting,
    measure_gain,
    second_mounting,
    separating_positions,
    simulate_rows,
)
from .bench_search import (
    SECOND_ORDER,
    BenchSearch,
    with_usual_signs,
)
from .bench_visits import Circumstances, circumstances_of, left_open, signature_columns, untold_readings
from .dependences import pairs_of_bench
from .evidence import (
    Effort,
    Evidence,
    Exclusions,
    Reader,
    Sizes,
    Source,
    Trial,
    own_with,
    parameters_with,
    stacked_sizes,
)
from .extension import Extension, extension_of_bench
from .fit import Classes, Fit, Gain, blocks_of
from .pairs import Pair
from .power import powers
from .rows import About, Channel, Rows

PAIR = 2
"""Effects of a set that is no larger than two that each act at a time of their own."""
FIT_TOLERANCE = 1e-8
"""Tolerance that the fit of an extended model adds to its radius."""


@dataclass(frozen=True, eq=False)
class TurnErrors:
    """Errors (S, 3) of turns over their bounds, `before` and `after`; from and to (S,) [s], angles (S, 2) [rad].

    They are those of a robust fit: that of the least radius spreads one error over many turns. `alone` holds the radius
    of the readings alone and of the turns alone, each without effects and with them; `readings` counts the moments at
    which accelerometers were read.
    """

    first: Floats
    last: Floats
    turned: Floats
    before: Floats
    after: Floats
    alone: tuple[tuple[float, float], tuple[float, float]]
    readings: int


@dataclass(frozen=True, eq=False)
class Bench:
    """The exact model of bench and block, which predicts averaged readings at positions of a table.

    Errors are fractions of g, at the nominal model's fit `here`; measurements are ordered position by position,
    accelerometers 1, 2, 3 within each: M = 3 N.

    `names` are name and unit of each parameter; `places` effects that can be tried; `calibration` is that of the
    nominal model. `numbers` (N,) are the row numbers of the record itself; `bounds` are u^max and v^0max of (1.7).
    """

    names: tuple[tuple[str, str], ...]
    places: tuple[EffectPlace, ...]
    calibration: Calibration
    here: Linearisation
    readings: Readings
    numbers: Ints
    bounds: tuple[float, float]

    @cached_property
    def rows(self) -> Rows:
        """The rows at the nominal fit; every fifth position is left out together."""
        here, sigma = self.here, self.calibration.noise_bound
        return Rows(
            self.names,
            here.point,
            self.places,
            here.residual,
            here.jacobian,
            here.bound,
            self.columns_of,
            fold_numbers=np.repeat(np.arange(len(self.readings)) % FOLDS, 3),
            are_readings=True,
            least_singular=least_singular(sigma) / sigma,
        )

    def columns_of(self, places: Sequence[EffectPlace]) -> Floats:
        """Signatures (M, K) of linear effects at the nominal fit."""
        return signature_columns(places, self.contexts)

    @cached_property
    def contexts(self) -> Contexts:
        """Quantities that the effects' signatures depend on, at the nominal fit."""
        return self.readings.rows(self.here.point)

    @property
    def effort(self) -> Effort:
        """Effort of the search, from the number of readings; a usual record has at most a thousand."""
        cost = max(1.0, len(self.here.residual) / MANY_ROWS)
        return Effort(cost, most_sets=None, most_rows=None, most_known_alone=MAX_SET)

    @property
    def limit(self) -> float:
        """Largest radius of a consistent model."""
        return bench_limit(self.calibration.noise_bound, self.readings.resolution)

    @property
    def room(self) -> float:
        """Addition to the bounds of the readings for the digits in which they are written."""
        return reading_uncertainty(self.readings.resolution)

    @property
    def curvature(self) -> float:
        """Error of the linear model per square of a misfit, both in units of the bounds."""
        return SECOND_ORDER * float(self.here.bound.min())

    @property
    def second_order(self) -> float:
        """Error of the linear model, in units of the bounds."""
        return self.curvature * self.radius**2

    @property
    def radius(self) -> float:
        """Radius of the nominal model."""
        return self.calibration.radius or 0.0

    @property
    def falsified(self) -> bool:
        """Return whether the readings contradict the nominal model."""
        return self.calibration.verdict == "falsified"

    @cached_property
    def baseline(self) -> Fit:
        """The nominal model, as a fit."""
        return self.refit(())

    @cached_property
    def classes(self) -> Classes:
        """Classes of the linear effects, by their columns at any positions with the record's mountings."""
        places = self.rows.linear_places
        return Classes.of(places, self.spaces_of(places))

    def spaces_of(self, places: Sequence[EffectPlace]) -> list[Floats]:
        """Return the column space of each effect beyond the model, at any positions with the record's mountings."""
        return dense_spaces(self.here.parametrisation, places)

    @cached_property
    def search(self) -> BenchSearch:
        """The search for sets of effects."""
        return BenchSearch(self.readings, self.here.point, self.places, self.classes)

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a size that no bound refuses: linear effects, outliers, and effects that are not linear."""
        return self.search.candidates(size, work)

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The exact model with linear effects, relinearised."""
        fit = fitted(self.readings, Cast(tuple(places)), self.here.point)
        if fit is None:
            raise ValueError("the fit runs away")
        return fit

    def untried(self, size: int) -> str | None:
        """Return why two effects at unknown times, which are never fitted together, could replace three effects."""
        return untried_in(self.search, size)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return the best fit of effects over all variants in which they can act, with the other consistent ones.

        There is one fit for each choice of signs of a variant's coefficients: sizes on both sides of zero are no
        interval.
        """
        found: dict[tuple[float, ...], list[Fit]] = {}
        for _, fit in self.standing(places, work):
            found.setdefault(fit.signs, []).append(fit)
        ranked = [sorted(fits, key=lambda fit: fit.radius) for fits in found.values()]
        return [replace(best, also=tuple(others)) for best, *others in ranked]

    def standing(self, places: Sequence[EffectPlace], work: Work) -> Iterator[tuple[Cast, Fit]]:
        """Yield each consistent variant in which the effects can act, with its fit."""
        bent, start = self.search.acting(places), self.search.centre.point
        for ways in product(*bent.values()):
            cast = Cast(tuple(places), dict(zip(bent, ways, strict=True)))
            fit = self._standing(cast, start, work)
            if fit is not None:
                yield cast, fit
                # The next variant is near this one.
                start = fit.point

    def _standing(self, cast: Cast, start: NDArray, work: Work) -> Fit | None:
        """Return a consistent fit with possible sizes, begun at parameters (P,) of the bench; None if there is none."""
        fit = fitted(self.readings, cast, start, self.limit, work)
        if fit is None or fit.radius > self.limit:
            return None
        work.programme(*fit.jacobian.shape)
        return with_possible_sizes(fit, self.limit, LARGEST_OF_BENCH)

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves, by the model linearised at the nominal fit."""
        columns, count = self.columns_of([place]), self.here.jacobian.shape[1]
        jacobian, rate = np.hstack((self.here.jacobian, columns)), np.zeros((len(columns), count + columns.shape[1]))
        if columns.shape[1] == 1:
            rate[:, count] = left_open(place, self.contexts)
        growths = growths_of(Paid.of({place: count}, rate), rate, np.zeros(jacobian.shape[1]))
        if not growths:
            return any_centre(jacobian, self.here.residual, self.here.bound)[0]
        return least_radius(jacobian, self.here.residual, self.here.bound, growths)[0]

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The exact model of bench and linear effects, linearised there."""
        model = Cast(tuple(places)).model(self.readings, point, coefficients)
        assert model is not None
        return About(self.readings.reading.ravel() - model.reading, model.jacobian, model.bound, model.rate)

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, Floats]]:
        """Yield linear effects that a fit lacks and the record determines fully, with their columns (M, k) there."""
        rows = self.readings.rows_with(fit)
        for place in self.classes.places if fit.places else self.rows.linear_places:
            if place not in fit.places and not untold_readings([place], rows).any():
                yield place, signature_columns([place], rows)

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """Return the same bench: it has signatures of any effect."""
        return self


@dataclass(frozen=True, eq=False)
class BenchReader(Reader):
    """The reader of rests on a table."""

    model: Bench

    told_by = "any measurement with these mountings"

    @property
    def too_large(self) -> str:
        """Hint for the message when no linear programme of the record can be solved."""
        return f"is --noise-bound {exactly(self.model.calibration.noise_bound)} a fraction of g?"

    @property
    def stated_bound(self) -> float:
        """The noise bound, a fraction of g."""
        return self.model.calibration.noise_bound

    def option_of_bounds(self, times: float, places: Sequence[EffectPlace]) -> str:
        """Return the option for a noise bound multiplied by `times`."""
        return noise_option(times * self.stated_bound)

    @cached_property
    def pairs(self) -> Sequence[Pair]:
        """Accelerometers, turns and tilts of the axes, each with every quantity of the record's rows."""
        return tuple(pairs_of_bench(self.model.contexts))

    def about(self, point: NDArray) -> "BenchReader | None":
        """Return the reader of the exact model linearised at other parameters (P,)."""
        here = self.model.here
        at = (here.parametrisation, here.positions, here.reading, point, here.bound, here.sign)
        return replace(self, model=replace(self.model, here=linearise(*at)))

    @property
    def numbers(self) -> Ints:
        """The record's own numbers (N,) of its positions."""
        return self.model.numbers

    @property
    def of_positions(self) -> Ints:
        """Which rows are readings at positions."""
        return np.arange(len(self.rows.residual))

    @property
    def circumstances(self) -> Circumstances:
        """The circumstances of the positions."""
        return self.model.readings.circumstances

    def turns_of(self, fit: Fit | None) -> TurnErrors | None:
        """Return the errors of the turns under a fit, or under the nominal model; None for a record of rests alone."""
        return None

    @property
    def rerun(self) -> "BenchRerun":
        """The record, simulated again."""
        return BenchRerun(self.model)

    def head(self) -> Mapping[str, Any]:
        """The model without effects."""
        nominal = self.model.calibration
        return {"baseline_model": nominal.baseline, "next_positions": (), "warnings": nominal.warnings}

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return the nominal calibration; for a fit with effects, its parameters with their possible intervals."""
        if fit is None or not fit.places:
            return self.model.calibration
        count = len(self.rows.names)
        values, ends = fit.estimate[:count], fit.ends(self.model.room, count=count)
        parameters = parameters_with(self.rows.names, values, ends)
        extended = {"verdict": "consistent", "radius": fit.radius, "parameters": parameters, "witness": []}
        return extended_calibration(self.model.calibration, extended)

    def missing(self) -> Mapping[str, Any]:
        """Return the open targets and positions to measure next; nothing where the readings suffice."""
        nominal, here = self.model.calibration, self.model.here
        if self.model.falsified or (nominal.stands and len(self.rows.residual) > here.span.shape[1]):
            return {}
        return {
            "missing": tuple(OpenTarget(symbol=gap.symbol, name=gap.name) for gap in nominal.missing),
            "next_positions": nominal.next_positions or tuple(repeats(here)),
        }

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Exclusions) -> Mapping[str, Any]:
        """Return the change of the targets by an extension, and a mounting that separates its causes further."""
        if not fit.places:
            return {}
        keys = self.targets_of(calibration)
        for place in fit.places:
            for other in self.model.classes.equivalents(place):
                titles = (place.title, other.title)
                mounting = second_mounting(self.model.here.parametrisation, [place], [other], titles)
                if mounting is not None:
                    return {**keys, "second_mounting": mounting}
        return keys

    def targets_of(self, calibration: Calibration) -> dict[str, Any]:
        """Return the targets before an extension and with it."""
        nominal = self.model.calibration.linearised
        targets = []
        for symbol, before, after in zip(nominal.symbols, nominal.point, calibration.parameters, strict=False):
            ends = {"low": after.low, "high": after.high}
            targets.append({"symbol": symbol, "before": float(before), "after": after.estimate, **ends})
        return {"targets": targets}

    def named(self, place: EffectPlace) -> EffectPlace:
        """An outlier with the record's own number of its position."""
        if place.effect != "outlier":
            return place
        return place_of(int(self.model.numbers[int(place.where.removeprefix("position-")) - 1]), place.axes[0])

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Return the intervals of an effect's parameters, widened for the uncertainty of Δβ and Δg/g.

        Phases of the inner axis are known up to multiples of Δβ, coefficients of inputs up to powers of 1 − Δg/g.
        """
        effect = place.definition
        turned = self.model.bounds[0] * (place.order or 1) if place.where == "inner-axis" else 0.0
        factors = [(1.0 + sign * self.model.bounds[1]) ** -effect.degree for sign in (-1.0, 1.0)]
        intervals = []
        for parameter, (low, high) in zip(effect.parameters, ends, strict=True):
            if parameter.name.endswith("phase"):
                intervals.append((low - turned, high + turned))
            else:
                intervals.append((min(low * f for f in factors), max(high * f for f in factors)))
        return tuple(intervals)

    def power(self) -> Sequence[Mapping[str, Any]]:
        """The power of the positions against the nominal model, of each place and quantity."""
        model, room = self.model, self.rows.bound * (1.0 + self.model.limit)
        return [one.entry for one in powers(model.contexts, model.here.parametrisation, self.rows.nominal, room)]

    def channels(self) -> Sequence[Channel]:
        """The residuals of each accelerometer over the angles, its input, time and temperature."""
        when, n, positions = self.model.readings.circumstances, self.model.contexts.n, self.model.here.positions
        residual, bound = self.rows.residual.reshape(-1, 3), self.rows.bound.reshape(-1, 3)
        angles = {"alpha": positions.alpha, "beta": positions.beta}
        slow = {"time": when.hours[:, None]}
        if when.temperature is not None:
            slow["temperature"] = when.temperature[:, None]
        channels = []
        for p in range(3):
            quantities = {"input": n[:, p : p + 1], **slow}
            label = {"accelerometer": p + 1}
            channels.append(Channel(label, residual[:, p], bound[:, p], quantities, {"inputs": n}, angles))
        return channels

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Return positions that separate sets; where no position does, a mounting."""
        model = self.model
        positions = separating_positions(model.readings, model.here.point, fits, model.bounds, model.room)
        for position in positions:
            if "repeats" in position:
                position["repeats"] = int(model.numbers[position["repeats"] - 1])
        sure = 2.0 * float(self.rows.bound.min())
        mounting = helpful_mounting(model.here.parametrisation, fits, positions, sure)
        return {"next_positions": positions} | ({} if mounting is None else {"second_mounting": mounting})

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Yield the trials of the whole set on left-out positions and blocks in time, then of each single effect."""
        rows = self.rows
        return trials(LinearReadings(rows.nominal, rows.residual, rows.bound), fit, self.named, self.model.numbers)


@dataclass(frozen=True, eq=False)
class BenchRerun:
    """Rests on a table, simulated again by FMUs of table and block."""

    model: Bench

    quoted = ("readings behind the first position", "g", 1.0)

    def gain(self, fit: Fit) -> Gain | None:
        """Return the gain at held-out positions, simulated again; None for outliers, which act at no other position."""
        if any(place.definition.kernel is None for place in fit.places):
            return None
        return measure_gain(self.model.readings, self.model.here.point, fit, self.model.calibration.gravity)

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Table and block as they are found, and a run through the record's positions for each of its mountings."""
        ends = fit.ends(self.model.room)
        return extension_of_bench(self.model.readings, fit, ends, effects, self.model.calibration.gravity)

    def errors(self, effects: Sizes) -> Floats | None:
        """Errors of the readings (N - 1, 3) behind the first position, at which a run begins, fractions of g."""
        model, readings = self.model, self.model.readings
        if not can_be_run(readings.circumstances):
            return None
        places, sizes, point = own_with(model, effects)
        at, x = model.about(places, point, sizes), np.append(point, sizes)
        linear = at.residual, at.bound, at.jacobian
        fit = Fit(tuple(places), blocks_of(places), x, np.zeros(len(x)), *linear, model.radius, x, sizes)
        rows = np.arange(1, len(readings))
        return readings.reading[rows] - simulate_rows(readings, fit, rows, model.calibration.gravity)

    def without(self, effects: Sizes) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Return the readings without the effects of the accelerometers, at the record's own fit beside all effects."""
        places, columns = self._columns(effects)
        added = (columns @ stacked_sizes(effects, places)).reshape(-1, 3)
        return places, {"specific_force": self.model.calibration.gravity * (self.model.readings.reading - added)}

    def reach(self, effects: Sizes, errors: Sizes) -> NDArray | None:
        """Return the largest remainder over the readings."""
        places, columns = self._columns(effects)
        added = (np.abs(columns) @ stacked_sizes(errors, places)).reshape(-1, 3)
        return self.model.calibration.gravity * added.max(axis=0)

    def _columns(self, effects: Sizes) -> tuple[list[EffectPlace], NDArray]:
        """Return the effects of the accelerometers among the given ones, and their coefficients' columns (M, K)."""
        model, linear = self.model, self.model.rows.linear_places
        *_, point = own_with(model, effects)
        places = [p for p in effects if p in linear and p.definition.stage == "reading_effects"]
        at = model.about(places, point, stacked_sizes(effects, places))
        return places, at.jacobian[:, len(point) :]


def bench_limit(sigma: float, resolution: float) -> float:
    """Return the largest radius of a consistent bench, for a noise bound and half a last digit of the readings."""
    return radius_limit(sigma, resolution) + FIT_TOLERANCE


def untried_in(search: BenchSearch, size: int) -> str | None:
    """Return why sets of a size may not be the smallest; None where no smaller set was left out.

    Two effects that each act at an unknown time are not fitted together.
    """
    if size <= PAIR or not search.two_in_time(Work()):
        return None
    return "two effects that set in, settle or lag, each at its own time, might do with fewer, and were not tried"


def extended_calibration(nominal: Calibration, keys: Mapping[str, Any]) -> Calibration:
    """Return a calibration with other parameters, without the results that need those of the nominal model."""
    of_nominal = ("gyros", "reading_errors", "open", "next_positions", "stands_with_sigma", "no_estimate", "warnings")
    beside_result = ("linearised", "feasible", "made_of", "schema_")
    extended = {"estimator": "analytic centre", **keys}
    for name in type(nominal).model_fields:
        if name not in (*of_nominal, *beside_result):
            extended.setdefault(name, getattr(nominal, name))
    return Calibration(**extended)


GYROS_LEFT_OUT = (
    "the gyros of this bench record are left out, its rests alone are diagnosed; --latitude-deg and --azimuth-deg hold "
    "them against the table, too"
)


def bench_evidence(record: PositionRecord, **options: Any) -> Evidence:
    """The evidence of a position record.

    Options are noise_bound, gravity, baseline, bounds and mounting; they and the errors are as for
    `trihedron.tools.calibration.calibrate`.
    """
    options_given, nominal = Asked(**options), calibrate(record, **options)
    if isinstance(record.raw, BenchRecord):
        nominal = nominal.model_copy(update={"warnings": [*nominal.warnings, GYROS_LEFT_OUT]})
    linear, circumstances = nominal.linearised, circumstances_of(record)
    if nominal.verdict == "falsified":
        bound = record.bounds_with(nominal.noise_bound, options_given.gravity)
        linear = with_usual_signs(linear, circumstances, bound, options_given.bounds)
    names = tuple((symbol, NAMES[symbol.partition("@")[0]][1]) for symbol in linear.symbols)
    readings = Readings.of(linear, circumstances, record.written_to(options_given.gravity))
    places: list[EffectPlace] = []
    for effect in POSITION_EFFECTS.values():
        # Every effect outside the baseline's model whose quantities the record holds.
        has_all = all(getattr(circumstances, need) is not None for need in effect.needs)
        if has_all and effect.within != options_given.baseline:
            places += effect.places
    model = Bench(names, tuple(places), nominal, linear, readings, record.position, options_given.bounds)
    return Evidence.of(BenchReader(model), Source(record, bench_evidence, options))
