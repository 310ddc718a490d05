"""A record of a block that is carried, and its run: the linear rows of a run of the simulation, onset by onset."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import combinations, pairwise
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ...models.effects.definition import all_coefficients
from ...models.effects.last_stage import variant
from ..bounded.sets import Work
from ..bounded.sweep import Rows, Swept, apart, largest_sizes
from ..motion.carry import GyroModel, Motion
from ..motion.inspect import Inspection
from ..motion.norm import inputs_of
from .carried_pairs import GyroPairs, pairs_of_accelerometers
from .evidence import Evidence, rows_over
from .fit import Fit, coefficient_count, coefficient_limits
from .onsets import ROUNDS, STRETCHES, WEIGHED, Acting, Fading, Onsets, held, refused
from .pairs import Pair
from .references import Gravity, Truth, force_columns, has_truth

BIAS = EffectPlace("gyro-bias", "gyro-block")
LONG = 1_000_000
"""A record of more rows is long."""
MOST_TRIED = 12
"""After so many rows of a stretch that stands its least radius is no longer sought."""
MOST_WITH_ONSET = 1
"""Sets of more effects have none that sets in at a time: each such pair costs tens of programmes."""
FINE, DECIDED, FINER, LEAST_FINER, MOST_TIMES = 0.02, 1e-6, 16.0, 1.2, 5000
"""Time constants are taken so near each other that bounds grow by this part of themselves; where none stands, though
not all are refused, by the second. Then they are so many times nearer, at least so many, and so many at most."""
LEFT_AWAY = 1e-3
"""A few columns hold those of a stretch of time constants where the largest size does so much of a bound otherwise."""
Standing = tuple[tuple[float, float], list[tuple[Fit, float]], list[Swept]]


@dataclass(frozen=True, eq=False)
class CarriedRecord(Evidence):
    """A record of a block that is carried, as far as it is known before the simulation is run.

    `block` is "calibrated" or "nominal": whether the gyros' scale factors and misalignments are parameters; `rates`,
    "instantaneous" or "averaged", is what a rate in the record was taken for; `lacks` is what to add where nothing can
    be run.
    """

    found: Inspection
    block: str
    rates: str
    warnings: tuple[str, ...]
    lacks: tuple[str, ...]

    def missing(self) -> Mapping[str, Any]:
        """What to add where nothing can be run."""
        return {"missing": self.lacks} if self.lacks else {}

    def head(self) -> Mapping[str, Any]:
        """The record and what it is held against."""
        record = self.found.record
        return {
            "unit": "arcmin",
            "record": {"rows": len(record), "sha256": record.sha256},
            "reference": "true attitude" if has_truth(self.found) else "gravity",
            "noise_bound_arcmin": None,
            "noise_bound_from": "",
            "baseline_model": self.block,
            "baseline": {"radius": None, "falsified": None, "parameters": ()},
            "lengths": (),
            "order_stable": None,
            "warnings": self.warnings,
        }


@dataclass(frozen=True, eq=False)
class CarriedRun(CarriedRecord):
    """Rows of a run of the gyros through a record, beside which effects may set in at a time.

    `own` is the gyros' part of the model's parameters; about `model` the rows are linear, and `attitude` (N, 4) was
    carried with it. `at_rest` (3, K) is what each coefficient adds to the mean at rest that is taken out [rad/s], None
    where the bias is free. `starting` are effects that set in at a time, which can be tried too; of those among
    `places` `set_in` has the time, or the time constant [h].
    """

    own: tuple[EffectPlace, ...]
    motion: Motion
    model: GyroModel
    attitude: NDArray[np.float64]
    reference: Gravity | Truth
    at_rest: NDArray[np.float64] | None
    starting: tuple[EffectPlace, ...] = ()
    set_in: Mapping[EffectPlace, float] = field(default_factory=dict)

    @property
    def of_forces(self) -> int:
        """How many of the parameters are the accelerometers': nine where gravity is the reference."""
        return len(self.names) - sum(coefficient_count(place) for place in self.own)

    def without(self, places: Sequence[EffectPlace]) -> Self:
        """The evidence with fewer effects that can be tried."""
        fewer = super().without(places)
        return fewer if self.at_rest is None else replace(fewer, at_rest=self.at_rest[:, self.numbers_of(fewer.places)])

    @cached_property
    def onsets(self) -> Onsets:
        """Columns of effects that set in after a row."""
        own = None if self.at_rest is None else self.numbers_of([BIAS])
        resting = np.zeros(len(self.motion), dtype=bool)
        for rows in self.found.rests.rows:
            resting[rows] = True
        return Onsets(
            self.motion,
            self.model,
            self.attitude,
            tuple(part.pieces for part in self.parts),
            Onsets.turns_of(self.reference, self.attitude, self.point[: self.of_forces], self.parts),
            None if own is None else tuple(part.columns[..., own] for part in self.parts),
            resting,
        )

    def pairs(self) -> Sequence[Pair]:
        """Gyros, and accelerometers where gravity is the reference, each with every quantity of the record."""
        return self._pairs

    @cached_property
    def _pairs(self) -> Sequence[Pair]:
        if len(self.motion) > LONG:
            return ()
        found, reference = list(GyroPairs.carried(self, self.onsets).pairs()), self.reference
        if isinstance(reference, Gravity):
            found += pairs_of_accelerometers(self, reference, self.point[: self.of_forces], self.attitude)
        return tuple(found)

    @property
    def second_order(self) -> float:
        """What the linear model may be wrong by, in bounds: half the square of each turn that is missed."""
        turns = (part for part in self.parts if part.pieces.kind != "norms")
        return max(
            float(((part.error**2).sum(axis=1) / part.bound.min(axis=1)).max(initial=0.0)) / 2.0 for part in turns
        )

    @cached_property
    def acting(self) -> dict[EffectPlace, Acting | Fading]:
        """What each effect that sets in does from each row on."""
        return {place: self.onsets.acting(place) for place in self.starting}

    @cached_property
    def stretches(self) -> dict[tuple[EffectPlace, int, int], tuple[NDArray[np.float64], float]]:
        """Columns of the stretches that were tried, and what is missed."""
        return {}

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The evidence with an effect that sets in after a row, or with the time constant of that number, too."""
        made = self._beside(place, *self.onsets.columns(self.acting[place], row))
        return replace(made, set_in={**self.set_in, place: self.onsets.value(self.acting[place], row)})

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """The evidence with formulas and tables as more that can be tried; a ValueError for one that it cannot have."""
        made = self
        for place in places:
            if place not in (*made.places, *made.starting):
                made = made._beside(place, *self._columns_at(place))
        return made

    def _columns_at(self, place: EffectPlace) -> tuple[list[NDArray[np.float64]], NDArray[np.float64]]:
        """Columns (S, d, K) of each part of an effect that always acts, and its part (3, K) of the mean at rest."""
        if place.definition.component != "AccelerometerBlock":
            return self.onsets.columns(self.onsets.acting(place), 0)
        reference, x = self.reference, self.point[: self.of_forces]
        if not isinstance(reference, Gravity):
            raise ValueError("beside a true attitude nothing is told of accelerometers")
        forces = force_columns(place, inputs_of(x, reference.reading), reference.rests)
        by_reading = reference.of_readings(x, self.attitude)
        columns = [np.tensordot(by_reading[part.label], forces, axes=2) for part in self.parts]
        return columns, np.zeros((3, forces.shape[2]))

    def _beside(self, place: EffectPlace, columns: Sequence[NDArray], mean: NDArray) -> Self:
        """The evidence with one more effect, of such columns (S, d, K) and part (3, K) of the mean at rest."""
        parts = tuple(
            replace(part, columns=np.concatenate([part.columns, mine], axis=2))
            for part, mine in zip(self.parts, columns, strict=True)
        )
        at_rest = None if self.at_rest is None else np.hstack([self.at_rest, mean])
        return replace(self, parts=parts, places=(*self.places, place), at_rest=at_rest)

    def with_onsets(self, fit: Fit) -> Self:
        """The evidence with the effects of a fit that set in, at the times of the fit."""
        made = self
        for place, values in zip(fit.places, fit.values(), strict=True):
            if place in self.starting:
                made = made.with_onset(place, self.onsets.number(self.acting[place], values[-1]))
        return made

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,); those that set in have their times."""
        found = super().values_of(places, solution)
        return {p: (*v, self.set_in[p]) if p in self.set_in else v for p, v in found.items()}

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Sets of so many effects that no bound refuses; larger ones than `MOST_WITH_ONSET` have none that sets in."""
        yield from super().candidates(size, work, among)
        if among is None and size <= MOST_WITH_ONSET:
            for others in combinations(self.classes.places, size - 1):
                yield from ((*others, place) for place in self.starting)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Fits of a set of effects with possible sizes, at the times at which it can set in, if any of it does.

        These begin at zero where one that acts from the first row on would do as well.
        """
        setting_in = [place for place in places if place in self.starting]
        if not setting_in:
            return super().mended(places, work)
        (place,) = setting_in
        others, acting = [p for p in places if p != place], self.acting[place]
        ends, found, swept = (self._fading if isinstance(acting, Fading) else self._setting_in)(place, others, work)
        if not found:
            return []
        start, end = self.onsets.ends(acting, *ends)
        best = sorted(found, key=lambda one: one[0].radius)
        first, *also = (setting_in_at(fit, place, self.onsets.value(acting, row), (start, end)) for fit, row in best)
        return [replace(first, also=tuple(also), swept=tuple(swept))]

    def _setting_in(self, place: EffectPlace, others: Sequence[EffectPlace], work: Work) -> Standing:
        """Ends of the rows at which an effect beside others can set in, fits at some of them, and all of them."""
        found, every, ends = [], [], []
        for begin, end in self._stretches(place, others, work):
            swept = self._swept(place, others, (begin, end))
            fits = self._searched(swept, [*others, place], np.arange(begin, end + 1), work)
            if fits:
                found, every, ends = [*found, fits[0]], [*every, swept], [*ends, begin, end]
        if not found:
            return (0, 0), [], []
        # One that acts from the first row on would do as well.
        always = self.with_onset(place, 0).refit([*others, place]).radius <= self.limit
        return (0 if always else min(ends), max(ends)), found, every

    def _fading(self, place: EffectPlace, others: Sequence[EffectPlace], work: Work) -> Standing:
        """Numbers of time constants about all with which an effect beside others can fade, and fits, as above."""
        stretches = list(self._stretches(place, others, work))
        if not stretches:
            return (0, 0), [], []
        begin, end = float(min(begin for begin, _ in stretches)), float(max(end for _, end in stretches))
        parts, sizes, found = 1.0, None, []
        while True:
            numbers = np.linspace(begin, end, max(2, round((end - begin) * parts)) + 1)
            rows, error = self._rows_of_times(place, others, numbers)
            far = apart(rows, error)
            if sizes is None:
                sizes = largest_sizes(rows, self.limit, far, rows.bound[len(self.residual) :])
            more = float((far @ sizes / rows.bound).max())
            swept = Swept(replace(rows, bound=rows.bound + far @ sizes), self.limit, np.zeros(rows.fixed.shape[1]))
            gap = numbers[1] - numbers[0]
            within = [(numbers >= low - gap) & (numbers <= high + gap) for low, high in stretches]
            swept.proven[~np.any(within, axis=0)] = np.inf
            found = self._searched(swept, [*others, place], numbers, work) or found
            # The first and the last that are not refused stand with the bounds as they have grown.
            for side in (0, -1):
                while not swept.refused.all() and swept.tried(_standing(swept)[side]) > self.limit:
                    work.programme(*swept.rows.fixed.shape)
            if swept.refused.all():
                return (0, 0), [], []
            first, last = _standing(swept)
            begin, end = float(numbers[max(0, first - 1)]), float(numbers[min(len(numbers) - 1, last + 1)])
            # Nearer to each other bounds grow by less.
            finer = min(parts * (more / FINE if more > FINE else FINER), MOST_TIMES / (end - begin))
            if (found and more <= FINE) or more <= DECIDED or finer < LEAST_FINER * parts:
                break
            parts = finer
        if not found:
            return (0, 0), [], []
        every = swept
        swept = Swept(every.rows.chosen(slice(len(self.residual))), self.limit, every.origin, every.radii)
        swept.proven = every.proven
        return (begin, end), found, [swept]

    def _rows_of_times(
        self, place: EffectPlace, others: Sequence[EffectPlace], numbers: NDArray
    ) -> tuple[Rows, NDArray[np.float64]]:
        """An effect beside others with time constants of some numbers (R,), and what it misses (M, k) between these.

        The last k rows say that the sizes are possible.
        """
        acting = self.acting[place]
        assert isinstance(acting, Fading)
        moving, ways, error = self.onsets.swept_times(acting, numbers)
        before, own, largest = (
            self.matrix(others),
            self._over_bounds(error),
            np.abs(self.limits_of([place])).max(axis=0),
        )
        largest = np.abs(self.limits_of([place])).max(axis=0)
        (count, known), none = before.shape, np.zeros((len(largest), len(largest)))
        fixed = np.zeros((count + len(largest), known + len(largest)))
        fixed[:count, :known], fixed[count:, known:] = before, np.eye(len(largest))
        columns = np.vstack([self._over_bounds(moving), np.zeros((len(largest), ways.shape[1]))])
        residual, bound = np.append(self.residual, none[0]), np.append(self.bound, largest)
        rows = Rows(fixed, columns, ways, known + np.arange(len(largest)), residual, bound)
        return rows, np.vstack([own, none])

    def _over_bounds(self, columns: Sequence[NDArray]) -> NDArray[np.float64]:
        """Columns (S, d, K) of each part as rows (M, K) over their bounds."""
        return np.concatenate([rows_over(c, part.bound) for c, part in zip(columns, self.parts, strict=True)])

    def _swept(self, place: EffectPlace, others: Sequence[EffectPlace], ends: tuple[int, int]) -> Swept:
        """An effect beside others at every row between two."""
        acting = self.acting[place]
        assert isinstance(acting, Acting)
        fixed, moving, ways = self.onsets.swept(acting, *ends)
        rows = [self._over_bounds(columns) for columns in (fixed, moving)]
        matrix = np.hstack([self.matrix(others), rows[0]])
        own = np.arange(matrix.shape[1] - rows[0].shape[1], matrix.shape[1])
        every = Rows(matrix, rows[1], ways, own, self.residual, self.bound)
        return Swept(every, self.limit, np.zeros(matrix.shape[1]))

    def _searched(
        self, swept: Swept, places: Sequence[EffectPlace], numbers: NDArray, work: Work
    ) -> list[tuple[Fit, float]]:
        """The fit of a set of effects that mends the record at a value next to the best, with its number; or none."""
        for count, _ in enumerate(swept.search()):
            work.programme(*swept.rows.fixed.shape)
            if swept.refused.all() or (count >= MOST_TRIED and min(r for r, _ in swept.radii.values()) <= self.limit):
                break
        best, radius = min(((way, radius) for way, (radius, _) in swept.radii.items()), key=lambda one: one[1])
        if radius > self.limit:
            return []
        fit = self.with_onset(places[-1], numbers[best]).refit(places)
        return [(fit, numbers[best])] if fit.radius <= self.limit else []

    def _stretches(self, place: EffectPlace, others: Sequence[EffectPlace], work: Work) -> Iterator[tuple[int, int]]:
        """Rows between which an effect beside others may set in, as far as no bound refuses it."""
        if len(self.onsets.edges) < 2:
            return
        edges, matrix = self.onsets.edges_of(self.acting[place]), self.matrix(others)
        starts = np.unique(np.linspace(0, len(edges) - 1, STRETCHES + 1).round().astype(int))
        left = list(pairwise(starts.tolist()))[::-1]
        while left:
            low, high = left.pop()
            more, missed = self._of_stretch(place, int(edges[low]), int(edges[high]))
            kept = np.isfinite(more).all(axis=1)
            columns = np.hstack([matrix, more])[kept]
            work.add(ROUNDS * (300.0 + 0.1 * columns.size))
            if refused(columns, self.residual[kept], self.limit + missed):
                continue
            if high - low == 1:
                yield int(edges[low]), int(edges[high])
            else:
                middle = (low + high) // 2
                left += [(middle, high), (low, middle)]

    def _of_stretch(self, place: EffectPlace, begin: int, end: int) -> tuple[NDArray[np.float64], float]:
        """Columns (M, L) that hold an effect in a stretch of its times, over the bounds; kept for the next set.

        And by how many bounds what it does may miss them, where its size is possible.
        """
        known = self.stretches.get((place, begin, end))
        if known is None:
            acting = self.acting[place]
            if isinstance(acting, Fading):
                every, error = (self._over_bounds(columns) for columns in self.onsets.faded(acting, begin, end))
                largest = np.abs(self.limits_of([place])).max(axis=0)
                columns, left_away = held(every, LEFT_AWAY / (WEIGHED * float(np.linalg.norm(largest))))
                known = columns, float((error @ largest + left_away * WEIGHED * np.linalg.norm(largest)).max())
            else:
                known = self._over_bounds(self.onsets.within(acting, begin, end)), 0.0
            self.stretches[place, begin, end] = known
        return known


def _standing(swept: Swept) -> tuple[int, int]:
    """The first and the last value that is not refused."""
    left = np.flatnonzero(~swept.refused)
    return int(left[0]), int(left[-1])


def setting_in_at(fit: Fit, place: EffectPlace, start: float, ends: tuple[float, float]) -> Fit:
    """A fit whose last effect sets in at a time [h], of times within ends that are possible."""
    low, high = coefficient_limits(place)

    def values(coefficients: NDArray[np.float64]) -> tuple[float, ...]:
        return (*all_coefficients(coefficients), start)

    way = variant(
        (0, 3),
        (*zip(low.tolist(), high.tolist(), strict=True), ends),
        columns=np.zeros((0, 3, len(low))),
        low=low,
        high=high,
        values=values,
    )
    return replace(fit, variants=(*(None for _ in fit.places[:-1]), way))
