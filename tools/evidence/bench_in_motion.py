"""The evidence of a whole bench: accelerometers at rest on a table, and gyros as it turns, as one system of rows.

Readings come first, at positions and in motion in the order of time; the gyros' integrals over turns and rests follow.
Bench, accelerometers and gyros have one set of parameters, with a lag of accelerometers and of gyros behind the
encoders. Both see an effect on the table, each as a witness.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.parameters import elements_of
from ...models.arrays import Floats, Ints
from ...models.bench import BIAS, GYRO_PARAMETERS, MATRIX
from ...models.effects import EffectPlace
from ..bounded.programmes import MANY_ROWS, Growth, Interval, SolverError, any_centre, chebyshev_radius
from ..bounded.sets import MOST_OUTLIERS, Problem, sets_of_size
from ..bounded.work import Work
from ..calibrated import Calibration
from ..calibration.calibration import Asked
from ..calibration.gyros import BenchOnEarth as Place
from ..calibration.gyros import fit_whole, with_gyros
from ..calibration.in_motion import FURTHER, InMotion, with_motion
from ..calibration.model import Linearisation
from ..calibration.parameter_sets import Sized, Start
from ..calibration.targets import MOTION_NAMES
from ..calibration.turns import WithTurns, beside_turns
from ..errors import InputError
from ..records import BenchRecord, PositionRecord
from .bench import (
    GYROS_LEFT_OUT,
    Bench,
    BenchReader,
    BenchRerun,
    TurnErrors,
    bench_evidence,
    bench_limit,
    untried_in,
)
from .bench_in_time import NOT_EXCLUDED, SLACK, SLIP, Moving, TurnsInTime, effects_of_model, fades, simulated_turns
from .bench_left_out import FOLDS, trials_of_each
from .bench_model import LARGEST_OF_BENCH, begun_with, least_radius, relinearised, with_possible_sizes
from .bench_search import BenchSearch
from .bench_visits import Circumstances, is_linear
from .carried import SHOWN_BY
from .cells_in_motion import SEARCHED
from .dependences import pairs_of_whole
from .evidence import Effort, Evidence, Exclusions, Sizes, Source, Trial, linear_fit
from .extension import Extension, extension_of_bench
from .fit import ARCMIN, Classes, Fit, Gain, blocks_of, estimated, gain_of, not_in_all, robust_estimate, width_of
from .observation import IN_MOTION, OF_GYROS, Travel, acts_at_rest, approached, effects_of_gyros
from .pairs import Pair
from .rows import About, Channel, Rows, reading_at

LARGEST_FLUCTUATION = 1e-4
"""An axis that turns by less [rad] has not been moved."""


@dataclass(frozen=True, eq=False)
class BenchInMotion(TurnsInTime):
    """The exact model of bench, accelerometers and gyros, for rests on a table and the turns between them.

    Rows are in units of their bounds: three readings of each position and of each moment in motion, then three
    integrals of each turn. `rests` is the model of the positions alone, `moving` has all readings, `whole` is the model
    fitted to readings and turns, `travel` the path of the table. The last parameters are the accelerometers' lag and
    their places from where the axes cross.
    """

    names: tuple[tuple[str, str], ...]
    point: Floats
    places: tuple[EffectPlace, ...]
    calibration: Calibration
    rests: Bench
    moving: Moving
    whole: WithTurns
    travel: Travel
    raw: BenchRecord
    starting: tuple[EffectPlace, ...] = (*SEARCHED, SLIP)
    set_in: Mapping[EffectPlace, float] = field(default_factory=dict)
    around: About | None = None
    narrowed: Mapping[EffectPlace, Sequence[tuple[int, int]]] = field(default_factory=dict)
    loose: float = 0.0
    slipping: Fit | None = None

    @cached_property
    def rows(self) -> Rows:
        """Readings and integrals less prediction; every fifth position, and every fifth turn, is left out together."""
        if self.around is not None:
            residual, nominal = self.around.residual * self.says, self.around.jacobian * self.says[:, None]
        else:
            residual, nominal, _ = self.at((), self.point, np.zeros(0))
        turns = (len(residual) - self.of_readings) // 3
        return Rows(
            self.names,
            self.point,
            self.places,
            residual,
            nominal,
            np.ones(len(residual)),
            self.columns_of,
            fold_numbers=np.append(self.moving.read.rows.fold_of_rows, np.repeat(np.arange(turns) % FOLDS, 3)),
        )

    @property
    def here(self) -> Linearisation:
        """The rests, linearised."""
        return self.rests.here

    @property
    def numbers(self) -> Ints:
        """The record's own numbers (N,) of its rests."""
        return self.rests.numbers

    @property
    def bounds(self) -> tuple[float, float]:
        """u^max and v^0max of (1.7)."""
        return self.rests.bounds

    @property
    def of_readings(self) -> int:
        """Number of rows that are readings."""
        return len(self.moving.read.here.residual)

    @property
    def of_positions(self) -> Ints:
        """Which rows are readings at positions."""
        return np.flatnonzero(np.repeat(self.moving.at_rest, 3))

    @property
    def effort(self) -> Effort:
        """Effort of the search; effects of gyros and turns, with their times, double that of the readings.

        The rows are many, and each effect alone would need a fit to all of them. Two effects that set in at a time are
        not tried together.
        """
        cost = 2.0 * max(1.0, len(self.rows.residual) / MANY_ROWS)
        return Effort(cost, most_sets=None, most_rows=None, most_known_alone=1, ranks_each=False)

    @property
    def limit(self) -> float:
        """Largest radius of a consistent model."""
        return bench_limit(self.calibration.noise_bound, self.rests.readings.resolution) + self.loose

    @property
    def room(self) -> float:
        """Addition to the bounds for the digits of the readings, in units of the bounds."""
        return self.rests.room / self.calibration.noise_bound

    @property
    def curvature(self) -> float:
        """The curvature of the model of the rests."""
        return self.rests.curvature

    @property
    def falsified(self) -> bool:
        """Return whether rests, turns or readings in motion contradict the nominal model."""
        return self.calibration.verdict == "falsified" or self.baseline.radius > self.limit

    @property
    def radius(self) -> float:
        """Radius of the nominal model."""
        return max(self.calibration.radius or 0.0, self.baseline.radius)

    @cached_property
    def classes(self) -> Classes:
        """Classes of the linear effects, by their columns on these rows."""
        places = self.rows.linear_places
        return Classes.of(places, self.spaces_of(places))

    @cached_property
    def pairs(self) -> Sequence[Pair]:
        """Accelerometers, gyros and the table, each with every quantity of the record."""
        return tuple(pairs_of_whole(self.moving.read.contexts, self.travel, self.whole.bound, self.rows.nominal))

    def refit(self, places: Sequence[EffectPlace]) -> Fit:
        """The exact model with linear effects, relinearised; about a fit the linear one."""
        if self.around is not None:
            return linear_fit(self.rows, places)
        return relinearised(self.at, places, self.point)

    def alone(self, place: EffectPlace) -> float:
        """Radius that one effect leaves, by the linear model."""
        return any_centre(self.rows.matrix([place]), self.rows.residual, self.rows.bound)[0]

    @cached_property
    def search(self) -> BenchSearch:
        """The search for sets of effects in the rests."""
        return BenchSearch(self.rests.readings, self.here.point, self.places, self.classes)

    def untried(self, size: int) -> str | None:
        """Return the reason of the model of the rests."""
        return untried_in(self.search, size)

    def at(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> tuple[Floats, Floats, Floats]:
        """Return errors (M,), derivatives (M, P + K), growth of the bounds (M, P + K); exact, in units of the bounds.

        The effects act linearly on the turns.
        """
        blocks, bench_count = blocks_of(places), self.whole.own
        at_rest, numbers = [], [np.zeros(0, int)]
        for place, block in zip(places, blocks, strict=True):
            if acts_at_rest(place) and place not in self.set_in:
                at_rest.append(place)
                numbers.append(np.arange(block.start, block.stop))
        columns = np.concatenate(numbers)
        readings, _ = self.moving.readings_at(self.whole, point)
        rows = replace(self.moving.read, readings=readings).about(at_rest, point[:bench_count], coefficients[columns])
        residual, jacobian, bound, chosen = self._beside_turns(rows, columns, self.added(places), point, coefficients)
        rate = np.zeros_like(jacobian)
        rate[: self.of_readings, chosen] = rows.rate
        bound = np.where(self.says, bound, np.inf)
        return residual / bound, jacobian / bound[:, None], rate / bound[:, None]

    def _beside_turns(
        self, rows: About | Fit, columns: NDArray, added: NDArray, point: NDArray, coefficients: NDArray
    ) -> tuple[Floats, Floats, Floats, Ints]:
        """Return the readings by a model of the bench, with the turns beside them, about parameters and coefficients.

        `columns` are the numbers of the model's coefficients among (K,); `added` (M, K) holds the changes by the
        others. The result is errors (M,), derivatives (M, P + K), bounds (M,), and the mask of the model's columns.
        """
        fitted, count = self.whole, self.of_readings
        further = np.zeros((len(added), len(FURTHER)))
        further[:count] = self.moving.readings_at(fitted, point)[1]
        chosen = np.append(np.arange(fitted.own), len(point) + columns)
        residual = fitted.residual_at(point[: -len(FURTHER)]) - added @ coefficients
        residual[:count] = rows.residual - added[:count] @ coefficients
        jacobian = np.hstack([fitted.jacobian_at(point[: -len(FURTHER)]), further, added])
        jacobian[:count, chosen] = rows.jacobian
        return residual, jacobian, np.append(rows.bound, fitted.bound[count:]), chosen

    def about(self, places: Sequence[EffectPlace], point: NDArray, coefficients: NDArray) -> About:
        """The exact model of the whole bench with linear effects, linearised there."""
        residual, jacobian, rate = self.at(places, point, coefficients)
        return About(residual, jacobian, np.ones(len(residual)), rate)

    def added(self, places: Sequence[EffectPlace], blocks: Sequence[slice] | None = None) -> Floats:
        """Return the columns (M, K) of effects in motion for readings [g], and of linear ones for integrals [rad]."""
        blocks, columns_known = blocks_of(places) if blocks is None else blocks, self._known
        added = np.zeros((len(self.whole.bound), blocks[-1].stop if blocks else 0))
        for place, block in zip(places, blocks, strict=True):
            # Nonlinear effects act only on accelerometers at rest, except for a slip at its time.
            if is_linear(place) or place in self.set_in:
                if place not in columns_known and place in self.set_in:
                    columns_known[place] = np.nan_to_num(self.columns_set_in(place))
                elif place not in columns_known:
                    columns_known[place] = np.vstack([self.moving.columns(place), self.travel.columns(place)])
                added[:, block] = columns_known[place]
        return added

    @cached_property
    def _known(self) -> dict[EffectPlace, Floats]:
        """Columns of the effects requested so far."""
        return {}

    def columns_of(self, places: Sequence[EffectPlace]) -> Floats:
        """Columns (M, K) of linear effects over the bounds, at the nominal fit."""
        columns = self.added(places)
        for place, block in zip(places, blocks_of(places), strict=True):
            if acts_at_rest(place) and place not in self.set_in:
                columns[: self.of_readings, block] = self.moving.read.columns_of([place])
        return columns * (self.says / self.whole.bound)[:, None]

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of linear effects and outliers that no bound refuses, then those with effects that are not linear.

        Nonlinear effects, and undetermined effects at rests, change no turn. A set is yielded if the rests alone allow
        these effects and the turns alone allow the others.
        """
        places = self.classes.places if among is None else among
        problem = Problem.of(self.rows.residual, self.rows.nominal, [self.columns_of([place]) for place in places])
        slack = self.limit - 1.0 + SLACK
        yielded = set()
        for chosen in sets_of_size(problem, size, slack, MOST_OUTLIERS, work):
            if set(chosen.outliers) <= set(self.of_positions.tolist()):
                outliers = [reading_at(row) for row in chosen.outliers]
                candidate = tuple([places[i] for i in chosen.effects] + outliers)
                yielded.add(frozenset(candidate))
                yield candidate
        gyros = [place for place in self.classes.places if place.definition.component in OF_GYROS]
        resting = {reading_at(int(row)) for row in self.of_positions}
        search, allowed = self.moving.read.search, dict[tuple[EffectPlace, ...], bool]()
        for count in range(1, size + 1):
            for bent in search.candidates(count, work):
                if all(is_linear(place) and place not in search.relaxed for place in bent):
                    continue
                # A row in motion has no number, so it cannot be a single outlier.
                if any(place.effect == "outlier" and place not in resting for place in bent):
                    continue
                turned = tuple(place for place in bent if place.definition.turns_table)
                for of_gyros in combinations(gyros, size - count):
                    key = turned + of_gyros
                    if key not in allowed:
                        allowed[key] = self._turns_allow(key, slack, work)
                    if allowed[key] and frozenset(bent + of_gyros) not in yielded:
                        yield bent + of_gyros
        if among is None:
            # At the nominal point the rows are not quite linear.
            yield from self.sets_in_time(size, work, SLACK)

    def _turns_allow(self, places: Sequence[EffectPlace], slack: float, work: Work) -> bool:
        """Return whether the turns alone are consistent with the chosen effects of the gyros and the table."""
        rows = self.rows.matrix(places)[self.of_readings :]
        work.programme(*rows.shape)
        acting = rows[:, np.abs(rows).max(axis=0) > 0.0]
        try:
            radius = chebyshev_radius(acting, self.rows.residual[self.of_readings :], np.ones(len(acting)))[0]
        except SolverError:
            return True
        return radius <= 1.0 + slack

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return consistent fits of a set with possible sizes, with each variant of an effect that is not linear."""
        if any(place in self.starting for place in places):
            return self.mended_in_time(places, work)
        work.programme(*self.rows.matrix([place for place in places if is_linear(place)]).shape)
        if all(is_linear(place) for place in places):
            fit = self.refit(places)
            possible = with_possible_sizes(fit, self.limit, LARGEST_OF_BENCH) if fit.radius <= self.limit else None
            return [] if possible is None else [possible]
        gyros = [place for place in places if not acts_at_rest(place)]
        fits = []
        for fit in self.moving.read.mended([place for place in places if acts_at_rest(place)], work):
            standing = []
            for way in (fit, *fit.also):
                with_turns = self._standing(way, gyros)
                if with_turns is not None:
                    standing.append(with_turns)
            if standing:
                standing.sort(key=lambda way: way.radius)
                fits.append(replace(standing[0], also=tuple(standing[1:])))
        return fits

    def _standing(self, fit: Fit, gyros: Sequence[EffectPlace]) -> Fit | None:
        """Return a fit of the readings with the turns and effects of the gyros; None where it is not consistent."""
        count, count_of_fit = self.of_readings, len(fit.coefficients)
        places = fit.places + tuple(gyros)
        blocks = fit.blocks
        for block in blocks_of(gyros):
            blocks += (slice(block.start + count_of_fit, block.stop + count_of_fit),)
        point = np.append(fit.point, self.point[self.whole.own :])
        sizes = np.append(fit.coefficients, np.zeros(width_of(gyros)))
        added = self.added(places, blocks)
        rows = self._beside_turns(fit, np.arange(count_of_fit), added, point, sizes)
        residual, jacobian, bound, chosen = rows
        residual, bound = residual / self.whole.bound, bound / self.whole.bound
        jacobian = jacobian / self.whole.bound[:, None]
        at, bound_read = np.append(point, sizes), self.whole.bound[:count]

        def grown(growth: Growth) -> Growth:
            rows, low = np.zeros_like(jacobian), np.full(len(at), -np.inf)
            rows[:count, chosen], high = growth.rows / bound_read[:, None], -low
            low[chosen], high[chosen] = growth.low, growth.high
            return Growth(np.append(growth.now / bound_read, np.zeros(len(bound) - count)), rows, low, high)

        growths = tuple(map(grown, fit.growths))
        radius, step, branch = least_radius(jacobian, residual, bound, growths)
        growths = begun_with(growths, branch)
        variants = tuple(way for _, _, way in fit.ways) + (None,) * len(gyros)
        values = (residual, bound, jacobian, radius, at + step, (at + step)[len(point) :])
        stacked = Fit(places, blocks, at, step, *values, variants, growths)
        return with_possible_sizes(stacked, self.limit, LARGEST_OF_BENCH) if radius <= self.limit else None

    def beside(self, fit: Fit) -> Iterator[tuple[EffectPlace, Floats]]:
        """Yield the linear effects that a fit lacks, with their columns (M, k) at the nominal fit."""
        # A search beside each of many time constants would cost too much.
        for place in () if fades(fit) else self.classes.places:
            if place not in fit.places:
                yield place, self.columns_of([place])


@dataclass(frozen=True, eq=False)
class WholeReader(BenchReader):
    """The reader of rests on a table and turns between them."""

    model: BenchInMotion

    @property
    def pairs(self) -> Sequence[Pair]:
        """Accelerometers, gyros and the table, each with every quantity of the record."""
        return self.model.pairs

    @property
    def of_positions(self) -> Ints:
        """Which rows are readings at positions."""
        return self.model.of_positions

    def about(self, point: NDArray) -> None:
        """Return None: rests and turns together are not linearised anew."""

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Return the calibration of the rests; the nominal one is falsified too by turns or readings in motion."""
        calibration = super().calibration_of(fit)
        if (fit is not None and fit.places) or not self.model.falsified:
            return calibration
        if not calibration.stands:
            return calibration.model_copy(update={"radius": self.model.radius})
        parameters = []
        for parameter in calibration.parameters:
            unbounded = {"low": None, "high": None, "estimate": parameter.least_squares}
            parameters.append(parameter.model_copy(update=unbounded))
        changed = {"verdict": "falsified", "radius": self.model.radius, "parameters": parameters}
        return calibration.model_copy(update={**changed, "estimator": "least squares"})

    @property
    def circumstances(self) -> Circumstances:
        """The circumstances of the rests."""
        return self.model.rests.readings.circumstances

    @property
    def rests(self) -> BenchReader:
        """The reader of the rests by themselves."""
        return BenchReader(self.model.rests)

    @property
    def rerun(self) -> "WholeRerun":
        """The record, simulated again."""
        return WholeRerun(self.model)

    def trials(self, fit: Fit) -> Iterator[Trial]:
        """Each effect of a fit but outliers: positions and turns left out without it, with it, and with it shuffled.

        Its signature is shuffled over positions, and over turns.
        """
        if not self.model.acts_linearly(fit):
            return
        folds = self.rows.fold_of_rows
        yield from trials_of_each(fit, [np.flatnonzero(folds == fold) for fold in range(FOLDS)], self._shuffled)

    def _shuffled(self, columns: NDArray, rng: np.random.Generator) -> Floats:
        """Columns (M, k) of an effect moved to other positions, and to other turns."""
        moved = []
        for part in (columns[: self.model.of_readings], columns[self.model.of_readings :]):
            triples = part.reshape(len(part) // 3, -1)
            moved.append(triples[rng.permutation(len(triples))].reshape(part.shape))
        return np.concatenate(moved)

    def told(self, place: EffectPlace, ends: Sequence[Interval]) -> tuple[Interval, ...]:
        """Intervals of an effect's parameters; of the accelerometers' and the table's as of the rests."""
        return super().told(place, ends) if acts_at_rest(place) else tuple(ends)

    def power(self) -> Sequence[Mapping[str, Any]]:
        """Return the power of the positions alone."""
        return self.rests.power()

    def channels(self) -> Sequence[Channel]:
        """Return the channels of the accelerometers, with their residuals under the whole model."""
        residual = self.rows.residual[self.model.of_positions].reshape(-1, 3)
        return [
            replace(channel, error=residual[:, p], bound=np.ones(len(residual)))
            for p, channel in enumerate(self.rests.channels())
        ]

    def turns_of(self, fit: Fit | None) -> TurnErrors | None:
        """Return the errors of the turns over their bounds, by a fit or the nominal model; None if that diverges."""
        try:
            nominal = self.model.baseline
        except ValueError:
            return None
        fit = fit or nominal
        rows, turns, travel = self.model.of_readings, self.model.whole.turns, self.model.travel
        first, last = 3600.0 * travel.hours[travel.first], 3600.0 * travel.hours[travel.last]
        before, after = (_robust_errors(one)[rows:].reshape(-1, 3) for one in (nominal, fit))

        def alone(rows_alone: slice) -> tuple[float, float]:
            """Return the radius of some of the rows alone, without effects and with them."""
            ones = np.ones(len(self.rows.residual[rows_alone]))
            errors, columns = fit.left / fit.allowed, fit.jacobian / fit.allowed[:, None]
            without = chebyshev_radius(self.rows.nominal[rows_alone], self.rows.residual[rows_alone], ones)[0]
            return without, chebyshev_radius(columns[rows_alone], errors[rows_alone], ones)[0]

        radii = alone(slice(rows)), alone(slice(rows, None))
        return TurnErrors(first, last, turns.moments[:, 2:4], before, after, radii, rows // 3)

    def of_model(self, fit: Fit, calibration: Calibration, excluded: Exclusions) -> Mapping[str, Any]:
        """Return the change of the targets by an extension, and a warning where other effects cannot be excluded."""
        targets = self.targets_of(calibration) if fit.places else {}
        return targets | ({"warnings": (NOT_EXCLUDED,)} if fades(fit) else {})

    def probe(self, fits: Sequence[Fit]) -> Mapping[str, Any]:
        """Return positions that separate sets by accelerometers or table; for gyros, turns and rests in words."""
        apart = not_in_all(fits)
        if all(acts_at_rest(place) for place in apart) and all(fit.linear for fit in fits):
            alone = []
            for fit in fits:
                alone.append(self.model.rests.refit([place for place in fit.places if acts_at_rest(place)]))
            return self.rests.probe(alone)
        sentences = dict.fromkeys(SHOWN_BY[place.effect] for place in apart if place.effect in SHOWN_BY)
        return {"next": list(sentences)}


def _robust_errors(fit: Fit) -> Floats:
    """Return errors (M,) over their bounds near a fit; those of a fit that stands are its own."""
    left, columns = fit.left / fit.allowed, fit.jacobian / fit.allowed[:, None]
    return left if fit.radius <= 1.0 else left - columns @ robust_estimate(columns, left)


@dataclass(frozen=True, eq=False)
class WholeRerun:
    """Rests and turns of a table, simulated again by FMUs."""

    model: BenchInMotion

    @property
    def rests(self) -> BenchRerun:
        """The rests alone, simulated again."""
        return BenchRerun(self.model.rests)

    @property
    def quoted(self) -> tuple[str, str, float]:
        """The name and unit of the errors, as for the rests."""
        return self.rests.quoted

    def errors(self, effects: Sizes) -> Floats | None:
        """Return the errors of the simulated rests."""
        return self.rests.errors(effects)

    def without(self, effects: Sizes) -> tuple[Sequence[EffectPlace], dict[str, Any]]:
        """Return the rests without the effects."""
        return self.rests.without(effects)

    def reach(self, effects: Sizes, errors: Sizes) -> NDArray | None:
        """Return the largest remainder for the rests."""
        return self.rests.reach(effects, errors)

    def _at_rest(self, fit: Fit) -> Fit | None:
        """Return bench and accelerometers of a fit as a fit of the rests; None where the rests contradict it."""
        places = [place for place in fit.places if acts_at_rest(place)]
        of_rests = next(iter(self.model.rests.mended(places, Work())), None) if places else self.model.rests.baseline
        if of_rests is None:
            return None
        columns = [np.arange(b.start, b.stop) for p, b, _ in fit.ways if acts_at_rest(p)]
        columns_at_rest = len(fit.point) + np.concatenate([np.zeros(0, int), *columns])
        estimate = np.append(fit.estimate[: self.model.whole.own], fit.estimate[columns_at_rest])
        return replace(of_rests, estimate=estimate, stated=estimate[self.model.whole.own :])

    def gain(self, fit: Fit) -> Gain | None:
        """Held-out positions simulated again, where the effects act there, and every fifth turn where they act there.

        For the turns the parameters are estimated on all other rows, without the effects and with them.
        """
        at_rest, turned = self._at_rest(fit), self._gain_of_turns(fit)
        first = None if at_rest is None or not at_rest.places else self.rests.gain(at_rest)
        if first is None or turned is None:
            return first or turned
        return first.model_copy(update={"others": [turned]})

    def _gain_of_turns(self, fit: Fit) -> Gain | None:
        model, fitted = self.model, self.model.whole
        with_times = model.with_onsets(fit)
        if not model.acts_linearly(fit) or not with_times.added(fit.places)[model.of_readings :].any():
            return None
        turns_held, errors = np.arange(0, len(fitted.turns.first), FOLDS), []
        kept_rows = model.rows.fold_of_rows != 0
        for places in ((), fit.places):
            solution = estimated(with_times.rows.matrix(places)[kept_rows], model.rows.residual[kept_rows])
            step, sizes = np.split(solution, [len(model.point)])
            effects = {p: sizes[block] for p, block in zip(places, blocks_of(places), strict=True)}
            # The time of a slip is on the clock of the rests, other times are on that of the rows.
            began = (model.rests.readings.circumstances.began - float(model.raw.time_s[0])) / 3600.0
            set_in = {place: time + began * (place == SLIP) for place, time in with_times.set_in.items()}
            point = (model.point + step)[: -len(FURTHER)]
            try:
                integrals = simulated_turns(model.raw, fitted, model.travel, point, effects, set_in)
            except InputError:
                # No component accepts these values.
                return None
            errors.append((fitted.turns.integral - integrals)[turns_held])
        before, after = errors
        gain = gain_of(before, after, ARCMIN, over="turns", pieces=len(turns_held), rows=turns_held)
        return gain.model_copy(update={"unit": "arcmin"})

    def extension(self, fit: Fit, effects: Sized) -> Extension:
        """Table and blocks as they are found, and a run through the record's positions."""
        at_rest = self._at_rest(fit)
        if at_rest is None:
            raise ValueError("the rests by themselves do not stand with these effects")
        count, ends = self.model.whole.own, fit.ends(self.model.room)
        gravity = self.model.calibration.gravity
        at_rest_extension = extension_of_bench(self.model.rests.readings, at_rest, ends[:count], effects, gravity)

        def said(values: NDArray) -> dict[str, Any]:
            gyros = values[count : -len(FURTHER)].tolist()
            return {"gravity": gravity, "bias": gyros[BIAS], "scale_misalignment": gyros[MATRIX]}

        low, high = ends.T
        least, most = elements_of(said(low)), elements_of(said(high))
        intervals = {name: (least[name], most[name]) for name in least if name != "gravity"}
        point = fit.estimate[: len(fit.point)]
        # Sensitivities and lag of the gyros are effects on the gyros.
        further = dict(effects)
        of_gyros = slice(count, -len(FURTHER))
        lowest, highest = effects_of_model(low[of_gyros]), effects_of_model(high[of_gyros])
        for place, values in effects_of_model(point[of_gyros]).items():
            further[place] = values, list(zip(lowest[place], highest[place], strict=True))
        starts = list(at_rest_extension.starts)
        for name in ("GyroBlock", "GyroCompensation"):
            starts.append(Start.of(name, said(point), intervals, further))
        if any(place.definition.component == "AttitudeComputer" for place in effects):
            starts.append(Start.of("AttitudeComputer", {}, {}, further))
        return Extension(starts, at_rest_extension.scenarios)


def whole_evidence(record: PositionRecord, place: Place, **options: Any) -> Evidence:
    """Return the evidence of a bench record with a known place; options as in `bench_evidence`, errors as for gyros."""
    raw = record.raw
    if not isinstance(raw, BenchRecord):
        raise InputError(f"--latitude-deg: {record.path} has no gyros; a bench record (w1_radps, ...) is needed")
    # The encoder's error decides between rest and motion; beyond the largest fluctuation it would not be a reading's
    # noise.
    least = place.encoder_within(LARGEST_FLUCTUATION)
    record = approached(record, least)
    rests = bench_evidence(record, **options).model
    alone, linear = rests.calibration, rests.here
    fitted = fit_whole(linear, record, place, alone.noise_bound)
    calibration = with_gyros(alone, record, place, fitted, Asked(**options))
    warnings = [warning for warning in calibration.warnings if warning != GYROS_LEFT_OUT]
    calibration = calibration.model_copy(update={"warnings": warnings})
    encoder_bound = place.encoder_within(alone.noise_bound)
    travel = Travel.of(raw, fitted, encoder_bound, alone.gravity)
    in_motion = InMotion.of(record, linear, alone.gravity, encoder_bound)
    # The search for a slip includes its turns.
    without = replace(rests, places=tuple(place for place in rests.places if place != SLIP))
    moving = Moving.of(without, record, in_motion, travel.to_block, travel.lean, least)
    start = with_motion(fitted, in_motion, alone.gravity)
    moving = moving.about(start)
    whole, _ = beside_turns(moving.read.here, fitted.turns, start.point[: -len(FURTHER)])
    of_gyros = effects_of_gyros(with_temperature=raw.temperature is not None)
    places = without.places + IN_MOTION + of_gyros
    names = (*rests.names, *((symbol, MOTION_NAMES[symbol][1]) for symbol in (*GYRO_PARAMETERS, *FURTHER)))
    model = BenchInMotion(names, start.point, places, calibration, rests, moving, whole, travel, raw)
    return Evidence.of(WholeReader(model), Source(record, whole_evidence, {"place": place, **options}))
