"""The evidence of rests on a table: the exact model relinearised with each set of effects, outliers, ways of acting."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations, product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import POSITION_EFFECTS, EffectPlace, Rows
from ...models.effects.last_stage import place_of
from ...models.effects.rows import Variant
from ..bounded.programmes import Interval, column_space
from ..bounded.sets import Problem, Work, project, sets_of_size
from ..calibration.calibration import (
    Asked,
    Calibration,
    calibrate,
    radius_limit,
    reading_uncertainty,
    repeats,
)
from ..calibration.model import Linearisation
from ..records import PositionRecord
from ..result import finite_or_none
from ..rounding import exactly
from .bench_centre import (
    ROUNDS,
    STANDS_OUT,
    Setting,
    centre_of,
    usual_centre,
    usual_misfit,
    with_usual_signs,
    without_last,
)
from .bench_left_out import Linear, trials
from .bench_model import (
    LARGEST_OF_BENCH,
    Cast,
    Paid,
    Readings,
    Relaxation,
    fitted,
    growths_of,
    least_radius,
    model_work,
    with_possible_sizes,
)
from .bench_pairs import pairs_of_bench
from .bench_power import powers
from .bench_predictions import dense_spaces, helpful_mounting, measure_gain, second_mounting, separating_positions
from .bench_scenario import extension_of_bench
from .bench_visits import circumstances_of, is_linear, left_open, signature_columns, untold_readings
from .bench_wander import wanders
from .evidence import Channel, Evidence, Trial
from .extension import Extension, Sized
from .fit import Classes, Fit, Gain
from .pairs import Pair

FIT_TOLERANCE = 1e-8
"""What the fit of an extended model adds to the tolerance of its radius."""
LEAST_SLACK = 0.05
SECOND_ORDER = 5.0
"""The linear model may be wrong by so many times the square of the usual misfit, as fractions of g."""
TOO_MUCH = 0.3
"""With more slack than this, effects that stand out are fitted before others are sought."""
MOST_ANCHORS = 3
PROVEN_WANDER = 2
"""A function of time, which contains so much, counts as so many effects, or one more where time is not proven."""


@dataclass(frozen=True, eq=False)
class Bench(Evidence):
    """What averaged readings at positions of a table say against the exact model of bench and block.

    `residual`, `nominal` and `bound` are fractions of g, at the nominal model's fit `here`; measurements are ordered
    position by position, accelerometers 1, 2, 3 within each: M = 3 N.

    `calibration` is that of the nominal model; `numbers` (N,) are the record's own numbers of its rows; `bounds` are
    u^max and v^0max of (1.7).
    """

    calibration: Calibration
    here: Linearisation
    readings: Readings
    numbers: NDArray[np.int_]
    bounds: tuple[float, float]

    most_sets = None
    most_rows = None
    fits_any_law = True

    @cached_property
    def residual(self) -> NDArray[np.float64]:
        """Readings less prediction (M,)."""
        return self.here.residual

    @cached_property
    def nominal(self) -> NDArray[np.float64]:
        """Derivatives (M, P) by the bench's parameters."""
        return self.here.jacobian

    @cached_property
    def bound(self) -> NDArray[np.float64]:
        """Bounds (M,) of the readings' errors."""
        return self.here.bound

    @property
    def limit(self) -> float:
        """Radius up to which a model stands."""
        return radius_limit(self.calibration.noise_bound, self.readings.resolution) + FIT_TOLERANCE

    @property
    def too_large(self) -> str:
        """What to say where no linear programme of the record can be solved."""
        return f"is --noise-bound {exactly(self.calibration.noise_bound)} a fraction of g?"

    @property
    def rounding(self) -> float:
        """What writing down the readings adds to their bounds."""
        return reading_uncertainty(self.readings.resolution)

    @cached_property
    def rows(self) -> Rows:
        """What signatures see at the nominal fit."""
        return self.readings.rows(self.here.point)

    @property
    def linear_places(self) -> list[EffectPlace]:
        """Effects that are linear in their coefficients."""
        return [place for place in self.places if is_linear(place)]

    @cached_property
    def classes(self) -> Classes:
        """Linear effects by what they add at any positions with the record's mountings."""
        return Classes.of(self.linear_places, dense_spaces(self.here.parametrisation, self.linear_places))

    def space_of(self, place: EffectPlace) -> NDArray[np.float64]:
        """What an effect adds to the model at any positions with the record's mountings."""
        (space,) = dense_spaces(self.here.parametrisation, [place])
        return space

    def columns_of(self, places: Sequence[EffectPlace]) -> NDArray[np.float64]:
        """Signatures (M, K) of linear effects at the nominal fit."""
        return signature_columns(places, self.rows)

    @property
    def falsified(self) -> bool:
        """Whether the nominal model cannot be true of the record."""
        return self.calibration.verdict == "falsified"

    # The search: a fit that few readings cannot draw is the centre; where the misfit is so large that the linear model
    # may be wrong by much, effects that stand out are fitted first and the others are sought beside them.

    @cached_property
    def centre(self) -> Fit:
        """The nominal model where few readings, and channels that are exchanged, cannot draw it."""
        return usual_centre(self.readings, self.here.point)

    @cached_property
    def additive(self) -> dict[EffectPlace, Sequence[Variant]]:
        """Effects that only add columns, others in each of their ways: they are sought by these."""
        rows = self.readings.rows(self.centre.point)
        found = {place: self.readings.variants(place, rows) for place in self.places if not is_linear(place)}
        return {place: ways for place, ways in found.items() if ways and all(way.adds for way in ways)}

    @property
    def ways(self) -> list[tuple[EffectPlace, int]]:
        """Each effect that only adds columns, in each of its ways."""
        return [(place, way) for place, ways in self.additive.items() for way in range(len(ways))]

    @cached_property
    def _open_ways(self) -> dict[frozenset[EffectPlace], list[int]]:
        """Of sets with an effect that only adds columns the ways of it that no bound refuses."""
        return {}

    @cached_property
    def relaxed(self) -> dict[EffectPlace, Relaxation]:
        """What effects may do at most that are not linear, or whose circumstances the record does not tell."""
        rows = self.readings.rows(self.centre.point)
        untold = [place for place in self.classes.places if untold_readings([place], rows).any()]
        bent = [place for place in self.places if not is_linear(place) and place not in self.additive]
        return {mine.place: mine for mine in self.readings.relaxations(rows, [*untold, *bent])}

    @cached_property
    def _anchors(self) -> dict[tuple[EffectPlace, ...], tuple[list[Fit], list[Setting]]]:
        return {}

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Sets of a size that no bound refuses: linear effects, outliers, and effects that are not linear."""
        if np.abs(self.centre.point).max() > LARGEST_OF_BENCH:
            return
        if size > 1:
            limit, rows = 1.0 + self.slack(self.centre), self.readings.rows_with(self.centre)
            for wander in wanders(self.centre, rows, limit, work, proven=size == PROVEN_WANDER):
                yield (wander,)
        free = [place for place in self.classes.places if place not in self.relaxed]
        for count in range(min(size, len(self.relaxed)) + 1):
            for chosen in combinations(self.relaxed.values(), count):
                beside = tuple(mine.place for mine in chosen)
                seen: dict[tuple[EffectPlace, ...], set[int]] = {}
                for linear, ways in self._linear_sets(self.centre, free, chosen, size - count, work):
                    places = (*sorted(linear, key=lambda place: place.title), *beside)
                    if places not in seen and not ways:
                        yield places
                    seen.setdefault(places, set()).update(ways)
                # An effect's other ways count for what is possible with it: it waits for all of them.
                for places, ways in seen.items():
                    if ways:
                        self._open_ways[frozenset(places)] = sorted(ways)
                        yield places

    @cached_property
    def _problems(self) -> dict[tuple[object, ...], Problem]:
        """Searches beside a centre by their candidates: they are the same beside every choice of relaxed effects."""
        return {}

    def _linear_sets(
        self, centre: Fit, places: Sequence[EffectPlace], chosen: Sequence[Relaxation], size: int, work: Work
    ) -> Iterator[tuple[frozenset[EffectPlace], tuple[int, ...]]]:
        """Sets of so many linear effects and outliers, beside those of a centre, that no bound refuses.

        With each the way of the effect in it that only adds columns, if there is one.
        """
        free = [place for place in places if place not in centre.places]
        steps = tuple(self.ways) if size > 0 else ()
        if size > 0 and self.slack(centre) > TOO_MUCH:
            if centre.places not in self._anchors:
                work.add(2 * MOST_ANCHORS * ROUNDS * model_work(self.readings))
                self._anchors[centre.places] = self.anchors(centre, free), self.settings(centre)
            more, settings = self._anchors[centre.places]
            for one in more:
                yield from self._linear_sets(one, places, chosen, size - 1, work)
            for setting in settings:
                yield from self._sets_of(setting, free, chosen, size, work)
            free = [place for place in free if place not in {one.places[-1] for one in more}]
            standing = {place for setting in settings for place, _ in setting.steps}
            steps = [step for step in steps if step[0] not in standing]
            # Others have no time told, but for the gaps that are nearest to what they look like.
            steps = tuple(steps[k] for k in most_helpful(self.problem(centre, [], steps))[:MOST_ANCHORS])
        yield from self._sets_of(Setting(centre, self.slack(centre), steps), free, chosen, size, work)

    def _sets_of(
        self, setting: Setting, free: Sequence[EffectPlace], chosen: Sequence[Relaxation], size: int, work: Work
    ) -> Iterator[tuple[frozenset[EffectPlace], tuple[int, ...]]]:
        """As `_linear_sets`, in one setting, of so many of the effects that are free and of its steps."""
        steps, places = setting.steps, setting.centre.places
        problem = self.problem(setting.centre, free, steps)
        part, kept = self._without(problem, chosen)
        for candidate in sets_of_size(part, size, setting.slack, work=work):
            outliers = [int(kept[row]) for row in candidate.outliers]
            if self._paid_radius(problem, chosen, candidate.effects, outliers, work) > 1.0 + setting.slack:
                continue
            own = [steps[i - len(free)] for i in candidate.effects if i >= len(free)]
            found = (
                *places,
                *(free[i] for i in candidate.effects if i < len(free)),
                *(place for place, _ in own),
                *(place_of(row // 3 + 1, row % 3 + 1) for row in outliers),
            )
            yield frozenset(found), tuple(way for _, way in own)

    def slack(self, centre: Fit) -> float:
        """What the linear model may be wrong by, in units of the bounds: of second order in the usual misfit."""
        return LEAST_SLACK + SECOND_ORDER * usual_misfit(centre) ** 2 * float(self.bound.min())

    def settings(self, centre: Fit) -> list[Setting]:
        """Where the bench is with each effect that only adds columns and stands out, beside those of a centre.

        With about its time told the bench is known, so that all of its ways can be judged there.
        """
        found: dict[EffectPlace, Setting] = {}
        for k in most_helpful(self.problem(centre, [], self.ways)):
            place, way = self.ways[k]
            if place in found:
                continue
            cast = Cast((*centre.places, place), {place: way})
            one = centre_of(self.readings, cast, self.here.point, centre)
            steps = tuple(step for step in self.ways if step[0] == place)
            found[place] = Setting(without_last(self.readings, one), self.slack(one), steps)
            if usual_misfit(one) > STANDS_OUT * usual_misfit(centre):
                found[place] = replace(found[place], steps=())
            if len(found) == MOST_ANCHORS:
                break
        return [setting for setting in found.values() if setting.steps]

    @property
    def second_order(self) -> float:
        """What the linear model may be wrong by, in units of the bounds."""
        return SECOND_ORDER * self.baseline_radius**2 * float(self.bound.min())

    @property
    def stated_bound(self) -> float:
        """The noise bound, a fraction of g."""
        return self.calibration.noise_bound

    @property
    def baseline_radius(self) -> float:
        """Radius of the nominal model."""
        return self.calibration.radius

    def pairs(self) -> Sequence[Pair]:
        """Accelerometers, turns and tilts of the axes, each with every quantity of the record's rows."""
        return tuple(pairs_of_bench(self.rows))

    def problem(
        self, centre: Fit, places: Sequence[EffectPlace], ways: Sequence[tuple[EffectPlace, int]] = ()
    ) -> Problem:
        """The search for effects beside those of a centre, and for others in some ways, in units of the bounds."""
        key = (centre, tuple(places), tuple(ways))
        if key in self._problems:
            return self._problems[key]
        rows, bound = self.readings.rows_with(centre), self.bound[:, None]
        blocks = [signature_columns([place], rows) / bound for place in places]
        blocks += [self.additive[place][way].columns.reshape(len(bound), -1) / bound for place, way in ways]
        found = Problem.of(centre.residual / bound[:, 0], centre.jacobian / bound, blocks, len(ways))
        return self._problems.setdefault(key, found)

    def anchors(self, centre: Fit, places: Sequence[EffectPlace]) -> list[Fit]:
        """Centres with one effect more that stands out, the most helpful first."""
        helpful = [places[k] for k in most_helpful(self.problem(centre, places))]
        more = [
            centre_of(self.readings, Cast((*centre.places, place)), self.here.point, centre)
            for place in helpful[:MOST_ANCHORS]
        ]
        return [one for one in more if usual_misfit(one) <= STANDS_OUT * usual_misfit(centre)]

    def _without(self, problem: Problem, chosen: Sequence[Relaxation]) -> tuple[Problem, NDArray]:
        """The problem that bounds every set with these effects from below, and the readings (m,) that it keeps."""
        if not chosen:
            return problem, np.arange(len(problem.residual))
        nominal = np.hstack([problem.nominal, *(mine.columns / self.bound[:, None] for mine in chosen)])
        widened = self.bound + sum(mine.widening for mine in chosen)
        kept = np.flatnonzero(~np.any([mine.touched for mine in chosen], axis=0))
        shrunk = (self.bound / widened)[kept]
        columns = problem.columns[kept] * shrunk[:, None]
        nominal, residual = nominal[kept] * shrunk[:, None], problem.residual[kept] * shrunk
        return replace(problem, residual=residual, nominal=nominal, columns=columns), kept

    def _paid_radius(
        self,
        problem: Problem,
        chosen: Sequence[Relaxation],
        effects: Sequence[int],
        outliers: Sequence[int],
        work: Work,
    ) -> float:
        """A lower bound of the radius of a set, in which what is not told of effects is paid for by their sizes.

        The set has effects of the problem, outliers at some readings, and those that are `chosen`; 0 where each of
        these is told, or bounded as well by `_without`.
        """
        untold = [mine for mine in chosen if not mine.ways]
        if not untold:
            return 0.0
        bent = [mine for mine in chosen if mine.ways]
        kept = ~np.any([np.zeros(len(self.bound), dtype=bool), *(mine.touched for mine in bent)], axis=0)
        kept[outliers] = False
        own = [problem.columns[:, problem.blocks[effect]] for effect in effects]
        jacobian = np.hstack([problem.nominal, *own, *(mine.columns / self.bound[:, None] for mine in untold)])
        columns = {mine.place: jacobian.shape[1] - len(untold) + k for k, mine in enumerate(untold)}
        rate = np.zeros(jacobian.shape)
        for mine in untold:
            rate[:, columns[mine.place]] = mine.rate / self.bound
        bound = 1.0 + sum(mine.widening for mine in bent) / self.bound
        growths = growths_of(Paid.of(columns, rate[kept]), rate[kept], np.zeros(jacobian.shape[1]))
        work.programme(*jacobian.shape)
        return least_radius(jacobian[kept], problem.residual[kept], bound[kept], growths)[0]

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The exact model with linear effects, relinearised."""
        fit = fitted(self.readings, Cast(tuple(places)), self.here.point)
        if fit is None:
            raise ValueError("the fit runs away")
        return fit

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Effects fitted in each of the ways in which they can act: the best, and with it all others that stand, too.

        One fit for each choice of signs of what an effect adds in its way: sizes on both sides of zero are no interval.
        """
        known = frozenset(self.classes.whole_class(place)[0] for place in places)
        bent: dict[EffectPlace, Sequence[int]] = {}
        for place in places:
            if place in self.additive:
                bent[place] = self._open_ways.get(known, range(len(self.additive[place])))
            elif place in self.relaxed and (count := self.relaxed[place].ways):
                bent[place] = range(count)
        found: dict[tuple[float, ...], list[Fit]] = {}
        start = self.centre.point
        for ways in product(*bent.values()):
            fit = self._standing(Cast(tuple(places), dict(zip(bent, ways, strict=True))), start, work)
            if fit is not None:
                found.setdefault(fit.signs, []).append(fit)
                # The next way is about as this one.
                start = fit.point
        ranked = [sorted(fits, key=lambda fit: fit.radius) for fits in found.values()]
        return [replace(best, also=tuple(others)) for best, *others in ranked]

    def _standing(self, cast: Cast, start: NDArray, work: Work) -> Fit | None:
        """A fit with possible sizes, where it mends the record; begun at parameters (P,) of the bench."""
        fit = fitted(self.readings, cast, start, self.limit, work)
        if fit is None or fit.radius > self.limit:
            return None
        work.programme(*fit.jacobian.shape)
        return with_possible_sizes(fit, self.limit, LARGEST_OF_BENCH)

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves, by the model linearised at the nominal fit."""
        columns, count = self.columns_of([place]), self.nominal.shape[1]
        jacobian, rate = np.hstack((self.nominal, columns)), np.zeros((len(columns), count + columns.shape[1]))
        if columns.shape[1] == 1:
            rate[:, count] = left_open(place, self.rows)
        growths = growths_of(Paid.of({place: count}, rate), rate, np.zeros(jacobian.shape[1]))
        return least_radius(jacobian, self.residual, self.bound, growths)[0]

    # What the readings do not tell

    def room(self, fit: Fit) -> float:
        """What the readings' rounding adds to the bounds."""
        return self.rounding

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Intervals of an effect's parameters, widened by what the readings do not tell of Δβ and Δg/g.

        Phases of the inner axis are known up to multiples of Δβ, coefficients of inputs up to powers of 1 − Δg/g.
        """
        effect = place.definition
        turned = self.bounds[0] * (place.order or 1) if place.where == "inner-axis" else 0.0
        factors = [(1.0 + sign * self.bounds[1]) ** -effect.degree for sign in (-1.0, 1.0)]
        return tuple(
            (low - turned, high + turned)
            if parameter.name.endswith("phase")
            else (min(low * f for f in factors), max(high * f for f in factors))
            for parameter, (low, high) in zip(effect.parameters, ends, strict=True)
        )

    def named(self, place: EffectPlace) -> EffectPlace:
        """An outlier with the record's own number of its position."""
        if place.effect != "outlier":
            return place
        return place_of(int(self.numbers[int(place.where.removeprefix("position-")) - 1]), place.axes[0])

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, NDArray[np.float64]]]:
        """Linear effects that a fit has not and whose circumstances are told, with their columns (M, k) there."""
        rows = self.readings.rows_with(fit)
        for place in self.classes.places if fit.places else self.linear_places:
            if place not in fit.places and not untold_readings([place], rows).any():
                yield place, signature_columns([place], rows)

    # Keys of the result

    def power(self) -> Sequence[Mapping[str, Any]]:
        """The power of the positions against the nominal model, of each place and quantity."""
        room = self.bound * (1.0 + self.limit)
        return [one.entry for one in powers(self.rows, self.here.parametrisation, self.nominal, room)]

    def head(self) -> Mapping[str, Any]:
        """The noise bound, the baseline and what falsifies it."""
        nominal = self.calibration
        return {
            "noise_bound": nominal.noise_bound,
            "noise_bound_basis": nominal.noise_bound_basis,
            "baseline_model": nominal.baseline,
            "baseline": {"radius": nominal.radius, "falsified": self.falsified, "witness": tuple(nominal.witness)},
            "next_positions": (),
            "warnings": nominal.warnings,
        }

    def missing(self) -> Mapping[str, Any]:
        """Targets that stay open and positions that mend it; no more readings than parameters prove nothing."""
        nominal = self.calibration
        if self.falsified or (nominal.verdict == "consistent" and len(self.residual) > self.here.span.shape[1]):
            return {}
        return {
            "missing": tuple(nominal.missing),
            "next_positions": nominal.next_positions or tuple(repeats(self.here)),
        }

    def of_model(self, fit: Fit, excluded: Sequence[Mapping[str, Any]]) -> Mapping[str, Any]:
        """What an extension does to the calibration's targets, and a mounting that would tell more of its causes."""
        if not fit.places:
            return {}
        nominal = self.calibration.linearised
        known = zip(nominal.symbols, nominal.point, fit.estimate, fit.ends(self.room(fit)), strict=False)
        targets = [
            {"symbol": symbol, "before": float(before), "after": float(after)}
            | dict(zip(("low", "high"), map(finite_or_none, ends), strict=True))
            for symbol, before, after, ends in known
        ]
        pairs = ((place, other) for place in fit.places for other in self.classes.equivalents(place))
        p = self.here.parametrisation
        found = (second_mounting(p, [a], [b], (a.title, b.title)) for a, b in pairs)
        mounting = next((said for said in found if said is not None), None)
        return {"targets": targets} | ({} if mounting is None else {"second_mounting": mounting})

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Positions, and where these do not do a mounting, that tell sets apart."""
        positions = separating_positions(self.readings, self.here.point, fits, self.bounds, self.rounding)
        for position in positions:
            if "repeats" in position:
                position["repeats"] = int(self.numbers[position["repeats"] - 1])
        mounting = helpful_mounting(self.here.parametrisation, fits, positions, 2.0 * float(self.bound.min()))
        return {"next_positions": positions} | ({} if mounting is None else {"second_mounting": mounting})

    def gain(self, fit: Fit) -> Gain | None:
        """Held-out positions simulated again; None where that says nothing of other positions: outliers."""
        if any(place.definition.kernel is None for place in fit.places):
            return None
        return measure_gain(self.readings, self.here.point, fit, self.calibration.gravity)

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Table and block as they are found, and a run through the record's positions for each of its mountings."""
        ends = fit.ends(self.room(fit))
        return extension_of_bench(self.readings, fit, ends, effects, self.calibration.gravity)

    def channels(self) -> Sequence[Channel]:
        """The residuals of each accelerometer over the angles, its input, time and temperature."""
        when = self.readings.circumstances
        slow = {"time": when.hours, "temperature": when.temperature}
        residual, bound, n = self.residual.reshape(-1, 3), self.bound.reshape(-1, 3), self.rows.n
        return [
            Channel(
                {"accelerometer": p + 1},
                residual[:, p],
                bound[:, p],
                {"input": n[:, p : p + 1]} | {name: v[:, None] for name, v in slow.items() if v is not None},
                {"inputs": n},
                {"alpha": self.here.positions.alpha, "beta": self.here.positions.beta},
            )
            for p in range(3)
        ]

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Positions left out in turn, and blocks in time, with the whole set, then without each of several effects."""
        return trials(Linear(self.nominal, self.residual, self.bound), fit, self.named, self.numbers)


def most_helpful(problem: Problem) -> list[int]:
    """Candidates by what each takes off the robust sum of squares, the most helpful first."""
    projection = project(problem, 1.0 / np.maximum(1.0, np.abs(problem.residual)))
    spaces = [column_space(projection.columns[:, block]) for block in problem.blocks]
    gains = [float(np.sum((space.T @ projection.residual) ** 2)) for space in spaces]
    return [k for k in np.argsort(-np.array(gains), kind="stable").tolist() if spaces[k].shape[1]]


def bench_evidence(record: PositionRecord, **options: Any) -> Bench:
    """The evidence of a position record.

    Options are noise_bound, gravity, baseline, bounds and mounting; they and the errors are as for
    `trihedron.tools.calibration.calibrate`.
    """
    asked, nominal = Asked(**options), calibrate(record, **options)
    here, circumstances = nominal.linearised, circumstances_of(record)
    if nominal.verdict == "falsified":
        here = with_usual_signs(here, circumstances, nominal.noise_bound, asked.bounds)
    names = tuple((symbol, "") for symbol in here.symbols)
    readings = Readings.of(here, circumstances, record.written_to(asked.gravity))
    # Every effect that is not in the baseline's model, and of which nothing is missing in the record.
    known = [
        effect
        for effect in POSITION_EFFECTS.values()
        if effect.within != asked.baseline and all(getattr(circumstances, need) is not None for need in effect.needs)
    ]
    places = tuple(place for effect in known for place in effect.places)
    return Bench((), names, here.point, places, nominal, here, readings, record.position, asked.bounds)
