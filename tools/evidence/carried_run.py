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
from ..motion.carry import GyroModel, Motion
from ..motion.inspect import Inspection
from .carried_pairs import GyroPairs, pairs_of_accelerometers
from .evidence import Evidence, rows_over
from .fit import Fit, coefficient_count, coefficient_limits
from .onsets import ROUNDS, STRETCHES, Acting, Onsets, refused
from .pairs import Pair
from .references import Gravity, Truth, has_truth

BIAS = EffectPlace("gyro-bias", "gyro-block")
LONG = 1_000_000
"""A record of more rows is long."""
MOST_WITH_ONSET = 1
"""Sets of more effects have none that sets in at a time: each such pair costs tens of programmes."""


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
    `places` `set_in` has the row.
    """

    own: tuple[EffectPlace, ...]
    motion: Motion
    model: GyroModel
    attitude: NDArray[np.float64]
    reference: Gravity | Truth
    at_rest: NDArray[np.float64] | None
    starting: tuple[EffectPlace, ...] = ()
    set_in: Mapping[EffectPlace, int] = field(default_factory=dict)

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
        found, reference = list(GyroPairs(self, self.onsets).pairs()), self.reference
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
    def acting(self) -> dict[EffectPlace, Acting]:
        """What each effect that sets in does from each row on."""
        return {place: self.onsets.acting(place) for place in self.starting}

    def with_onset(self, place: EffectPlace, row: int) -> Self:
        """The evidence with an effect that sets in after a row, as one more that can be tried."""
        columns, mean = self.onsets.columns(self.acting[place], row)
        parts = tuple(
            replace(part, columns=np.concatenate([part.columns, mine], axis=2))
            for part, mine in zip(self.parts, columns, strict=True)
        )
        at_rest = None if self.at_rest is None else np.hstack([self.at_rest, mean])
        set_in = {**self.set_in, place: row}
        return replace(self, parts=parts, places=(*self.places, place), at_rest=at_rest, set_in=set_in)

    def with_onsets(self, fit: Fit) -> Self:
        """The evidence with the effects of a fit that set in, at the times of the fit."""
        made = self
        for place, values in zip(fit.places, fit.values(), strict=True):
            if place in self.starting:
                made = made.with_onset(place, int(np.searchsorted(self.onsets.hours, values[-1])) - 1)
        return made

    def values_of(self, places: Sequence[EffectPlace], solution: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
        """Values of the parameters of some effects by a solution (P + k,); those that set in have their times."""
        found = super().values_of(places, solution)
        return {p: (*v, self._start(self.set_in[p])) if p in self.set_in else v for p, v in found.items()}

    def _start(self, row: int) -> float:
        """A time after a row and before the next [h]."""
        return 0.5 * float(self.onsets.hours[row] + self.onsets.hours[row + 1])

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
        others, found = [p for p in places if p != place], []
        for begin, end in self._stretches(place, others, work):
            fit, row = self._within(place, others, (begin, end), work)
            if fit.radius <= self.limit:
                found.append((fit, row, begin, end))
        if not found:
            return []
        hours = self.onsets.hours
        always = self.with_onset(place, 0).refit(places).radius <= self.limit
        earliest = 0 if always else min(begin for *_, begin, _ in found)
        ends = float(hours[earliest]), float(hours[max(end for *_, end in found)])
        best = sorted(found, key=lambda one: one[0].radius)
        first, *also = (setting_in_at(fit, place, self._start(row), ends) for fit, row, *_ in best)
        return [replace(first, also=tuple(also))]

    def _stretches(self, place: EffectPlace, others: Sequence[EffectPlace], work: Work) -> Iterator[tuple[int, int]]:
        """Rows between which an effect beside others may set in, as far as no bound refuses it."""
        edges, matrix = self.onsets.edges, self.matrix(others)
        if len(edges) < 2:
            return
        starts = np.unique(np.linspace(0, len(edges) - 1, STRETCHES + 1).round().astype(int))
        left = list(pairwise(starts.tolist()))[::-1]
        while left:
            low, high = left.pop()
            within = self.onsets.within(self.acting[place], int(edges[low]), int(edges[high]))
            more = np.concatenate([rows_over(c, part.bound) for c, part in zip(within, self.parts, strict=True)])
            kept = np.isfinite(more).all(axis=1)
            columns = np.hstack([matrix, more])[kept]
            work.add(ROUNDS * (300.0 + 0.1 * columns.size))
            if refused(columns, self.residual[kept], self.limit):
                continue
            if high - low == 1:
                yield int(edges[low]), int(edges[high])
            else:
                middle = (low + high) // 2
                left += [(middle, high), (low, middle)]

    def _within(
        self, place: EffectPlace, others: Sequence[EffectPlace], rows: tuple[int, int], work: Work
    ) -> tuple[Fit, int]:
        """A fit at a row of a stretch at which an effect beside others sets in, with which the model stands.

        The one of the least radius that was found, where it stands with none; and the row.
        """
        tried: dict[int, Fit] = {}

        def at(row: int) -> Fit:
            if row not in tried:
                work.programme(len(self.residual), self.nominal.shape[1] + 3 * (1 + len(others)))
                tried[row] = self.with_onset(place, row).refit([*others, place])
            return tried[row]

        begin, end = rows[0], rows[1] - 1
        while at((begin + end) // 2).radius > self.limit and end - begin > 2:
            third = max(1, (end - begin) // 3)
            lower, upper = at(begin + third), at(end - third)
            begin, end = (begin, end - third) if lower.radius < upper.radius else (begin + third, end)
        row = min(tried, key=lambda row: tried[row].radius)
        return tried[row], row


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
