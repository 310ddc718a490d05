"""A record of a block that is carried, and its run: the linear rows of a run of the simulation, onset by onset."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import Work
from ..motion.carry import GyroModel, Motion
from ..motion.inspect import Inspection
from ..motion.norm import inputs_of
from .carried_pairs import GyroPairs, pairs_of_accelerometers
from .evidence import Evidence, rows_over
from .fit import Fit, coefficient_count
from .onsets import CarriedOnsets
from .pairs import Pair
from .references import Gravity, Truth, force_columns, has_truth
from .setting_in import SettingIn

BIAS = EffectPlace("gyro-bias", "gyro-block")
LONG = 1_000_000
"""A record of more rows is long."""


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
class CarriedRun(CarriedRecord, SettingIn):
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
    def onsets(self) -> CarriedOnsets:
        """Columns of effects that set in after a row."""
        own = None if self.at_rest is None else self.numbers_of([BIAS])
        resting = np.zeros(len(self.motion), dtype=bool)
        for rows in self.found.rests.rows:
            resting[rows] = True
        time = self.motion.time_s
        return CarriedOnsets(
            (time - time[0]) / 3600.0,
            tuple(part.pieces for part in self.parts),
            CarriedOnsets.turns_of(self.reference, self.attitude, self.point[: self.of_forces], self.parts),
            None if own is None else tuple(part.columns[..., own] for part in self.parts),
            resting,
            self.motion,
            self.model,
            self.attitude,
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

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Sets of so many effects that no bound refuses, then those with one that sets in."""
        yield from super().candidates(size, work, among)
        if among is None:
            yield from self.sets_in_time(size, work)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Fits of a set of effects with possible sizes, at the times at which it can set in, if any of it does."""
        in_time = any(place in self.starting for place in places)
        return self.mended_in_time(places, work) if in_time else super().mended(places, work)

    def over_bounds(self, columns: Sequence[NDArray]) -> NDArray[np.float64]:
        """Columns (S, d, K) of each part as rows (M, K) over their bounds."""
        return np.concatenate([rows_over(c, part.bound) for c, part in zip(columns, self.parts, strict=True)])
