"""A record of a block that is carried, and its run: the linear rows of a run of the simulation, onset by onset."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import Work
from ..calibrated import Calibration
from ..motion.carry import GyroModel, Motion
from ..motion.inspect import Inspection
from ..motion.norm import inputs_of
from .cells_in_motion import Cells, cells_of
from .dependences import GyroPairs, pairs_of_accelerometers
from .evidence import Evidence, rows_over, undetermined
from .fit import Fit, coefficient_count
from .observation import Group, Observation
from .pairs import Pair
from .references import Gravity, Run, Truth, force_columns, has_truth, matrices_of, turning
from .rows import Pieces
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

    def calibration_of(self, fit: Fit | None = None) -> Calibration:
        """Nothing is known of a record of which nothing can be run."""
        return undetermined("")

    def head(self) -> Mapping[str, Any]:
        """The record and what it is held against."""
        record = self.found.record
        return {
            "unit": "arcmin",
            "record": {"rows": len(record), "sha256": record.sha256},
            "reference": "true attitude" if has_truth(self.found) else "gravity",
            "noise_bound_arcmin": None,
            "baseline_model": self.block,
            "lengths": (),
            "order_stable": None,
            "warnings": self.warnings,
        }


class UnitTurns(Run):
    """A run of the same attitude in which each piece gains a turn, a unit about each axis of the reference."""

    def columns(self, pieces: Pieces) -> NDArray[np.float64]:
        """Rotations (S, 3, 3) into axes of each piece's beginning."""
        return matrices_of(self.attitude[pieces.first]).transpose(0, 2, 1)


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
    def groups(self) -> tuple[Group, ...]:
        """The pieces of each part, by what a turn within one adds to its error, and what the mean at rest takes out."""
        bias = None if self.at_rest is None else self.numbers_of([BIAS])
        run = UnitTurns(self.attitude, self.reference.rows, np.zeros((0, 3, 3)), 0)
        gains = {part.label: part.columns for part in self.reference.parts(run, self.point[: self.of_forces], ())}
        groups = []
        for part in self.parts:
            mean = None if bias is None else part.columns[..., bias]
            groups.append(Group(part.pieces, gains[part.label], mean))
        return tuple(groups)

    @cached_property
    def resting(self) -> NDArray[np.bool_]:
        """Whether each row (N,) belongs to a rest."""
        resting = np.zeros(len(self.motion), dtype=bool)
        for rows in self.found.rests.rows:
            resting[rows] = True
        return resting

    @cached_property
    def observation(self) -> Observation:
        """What the parts say of additions to the gyros' rates over the steps of the run."""
        adds = turning(self.motion, self.model, self.attitude, 1, len(self.motion))
        return Observation(self.groups, adds, self.resting[1:])

    def make_cells(self, place: EffectPlace) -> Cells:
        """Return the cells of an effect's unknown number; of another effect what it does from each row on."""
        time, steps = self.motion.time_s, self.motion.rows(1, len(self.motion), self.model.inverse, self.model.bias)
        added = place.definition.signature(place, steps)
        counted = np.zeros((len(time), *added.shape[1:]))
        if self.at_rest is not None:
            counted[1:] = added * self.resting[1:, None, None] / max(int(self.resting[1:].sum()), 1)
        hours = (time - time[0]) / 3600.0
        return cells_of(place, hours, self.groups, self.observation.sums(added), counted, self.resting)

    def pairs(self) -> Sequence[Pair]:
        """Gyros, and accelerometers where gravity is the reference, each with every quantity of the record."""
        return self._pairs

    @cached_property
    def _pairs(self) -> Sequence[Pair]:
        if len(self.motion) > LONG:
            return ()
        steps = self.motion.rows(1, len(self.motion), self.model.inverse, self.model.bias)
        pairs = list(GyroPairs(steps, self.observation, [part.bound for part in self.parts]).pairs())
        if isinstance(self.reference, Gravity):
            pairs += pairs_of_accelerometers(self, self.reference, self.point[: self.of_forces], self.attitude)
        return tuple(pairs)

    @property
    def second_order(self) -> float:
        """What the linear model may be wrong by, in bounds: half the square of each turn that is missed."""
        turns = (part for part in self.parts if part.pieces.kind != "norms")
        return max(
            float(((part.error**2).sum(axis=1) / part.bound.min(axis=1)).max(initial=0.0)) / 2.0 for part in turns
        )

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The evidence with an effect that sets in after a row, or with the time constant of that number, too."""
        made = self._beside(place, *self.cells[place].columns(row))
        return replace(made, set_in={**self.set_in, place: self.cells[place].value(row)})

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
            return self.make_cells(place).columns(0)
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
