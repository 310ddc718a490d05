"""The model of a block that is carried: a run of the simulation through its record, and linear rows about it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats
from ...models.effects import EffectPlace
from ..bounded.work import Work
from ..motion.carry import GyroModel, Motion, carried_attitude, reads
from ..motion.inspect import Inspection
from ..motion.norm import NAMES, inputs_of
from .cells_in_motion import Cells, cells_of
from .dependences import GyroPairs, pairs_of_accelerometers
from .fit import Fit, coefficient_count
from .observation import Group, Observation
from .pairs import Pair
from .references import (
    Gravity,
    Run,
    Truth,
    all_rows,
    force_columns,
    matrices_of,
    rotation_vectors,
    turned,
    turning,
)
from .rows import Pieces, Rows, rows_over
from .setting_in import SettingIn

BIAS = EffectPlace("gyro-bias", "gyro-block")
LONG = 1_000_000
"""A record of more rows is long."""


class UnitTurns(Run):
    """A run of the same attitude in which each piece gains a turn, a unit about each axis of the reference."""

    def columns(self, pieces: Pieces) -> Floats:
        """Rotations (S, 3, 3) into axes of each piece's beginning."""
        return matrices_of(self.attitude[pieces.first]).transpose(0, 2, 1)


@dataclass(frozen=True, eq=False)
class Carried(SettingIn):
    """A run of the gyros through a record: the model that carries the attitude, beside which effects may set in.

    `own` is the gyros' part of the model's parameters; the rows are linear about `gyros`, which also carried `attitude`
    (N, 4). `at_rest` (3, K) is the part of each coefficient in the mean at rest that is removed [rad/s]; None where the
    bias is free. `starting` are effects that set in at a time, which can be tried too; `set_in` has the time, or the
    time constant [h], of those among the rows.
    """

    rows: Rows
    found: Inspection
    own: tuple[EffectPlace, ...]
    motion: Motion
    gyros: GyroModel
    attitude: Floats
    reference: Gravity | Truth
    at_rest: Floats | None
    starting: tuple[EffectPlace, ...] = ()
    set_in: Mapping[EffectPlace, float] = field(default_factory=dict)

    @property
    def of_forces(self) -> int:
        """Number of parameters of the accelerometers: nine where gravity is the reference."""
        return len(self.rows.names) - sum(coefficient_count(place) for place in self.own)

    def with_stated(self, stated: float) -> Self:
        """Return the run whose bounds are for errors of the true attitude of up to `stated` at any row [rad]."""
        before = self.reference
        assert isinstance(before, Truth)
        after = replace(before, stated=stated)
        widening = after.of_windows - before.of_windows
        bounds = [part.bound + added for part, added in zip(self.rows.parts, widening, strict=True)]
        return replace(self, rows=self.rows.with_bounds(bounds), reference=after)

    def without(self, places: Sequence[EffectPlace]) -> Self:
        """The model with fewer effects that can be tried."""
        rows, at_rest = self.rows.without(places), self.at_rest
        if at_rest is not None:
            at_rest = at_rest[:, self.rows.numbers_of(rows.places)]
        return replace(self, rows=rows, at_rest=at_rest)

    @cached_property
    def groups(self) -> tuple[Group, ...]:
        """Groups of the pieces of each part, with the gains of a turn within a piece and of the mean at rest."""
        bias = None if self.at_rest is None else self.rows.numbers_of([BIAS])
        run = UnitTurns(self.attitude, self.reference.rows, np.zeros((0, 3, 3)), 0)
        gains = {part.label: part.columns for part in self.reference.parts(run, self.rows.point[: self.of_forces], ())}
        groups = []
        for part in self.rows.parts:
            mean = None if bias is None else part.columns[..., bias]
            groups.append(Group(part.pieces, gains[part.label], mean))
        return tuple(groups)

    @cached_property
    def resting(self) -> Bools:
        """Mask (N,) of the rows that belong to a rest."""
        resting = np.zeros(len(self.motion), dtype=bool)
        for rows in self.found.rests.rows:
            resting[rows] = True
        return resting

    @cached_property
    def observation(self) -> Observation:
        """Observation by all parts of additions to the gyros' rates over the steps of the run."""
        adds = turning(self.motion, self.gyros, self.attitude, 1, len(self.motion))
        return Observation(self.groups, adds, self.resting[1:])

    def make_cells(self, place: EffectPlace) -> Cells:
        """Return the cells of an effect's unknown number; for any other effect, those of its onset at each row."""
        time, steps = self.motion.time_s, self.motion.rows(1, len(self.motion), self.gyros.inverse, self.gyros.bias)
        added = place.definition.signature(place, steps)
        counted = np.zeros((len(time), *added.shape[1:]))
        if self.at_rest is not None:
            counted[1:] = added * self.resting[1:, None, None] / max(int(self.resting[1:].sum()), 1)
        hours = (time - time[0]) / 3600.0
        integral = self.observation.sums(added)
        return cells_of(place, hours, self.groups, self.over_bounds, integral, counted, self.resting)

    @cached_property
    def pairs(self) -> Sequence[Pair]:
        """Gyros, and accelerometers where gravity is the reference, each with every quantity of the record."""
        if len(self.motion) > LONG:
            return ()
        steps = self.motion.rows(1, len(self.motion), self.gyros.inverse, self.gyros.bias)
        pairs = list(GyroPairs(steps, self.observation, [part.bound for part in self.rows.parts]).pairs())
        if isinstance(self.reference, Gravity):
            x = self.rows.point[: self.of_forces]
            pairs += pairs_of_accelerometers(self.rows.parts, self.reference, x, self.attitude)
        return tuple(pairs)

    @property
    def second_order(self) -> float:
        """Error of the linear model, in units of the bounds: half the square of each turn's residual."""
        turns = (part for part in self.rows.parts if part.pieces.kind != "norms")
        return max(
            float(((part.error**2).sum(axis=1) / part.bound.min(axis=1)).max(initial=0.0)) / 2.0 for part in turns
        )

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The model with an effect that sets in after a row, or with the time constant of that number, too."""
        model = self._beside(place, *self.cells[place].columns(row))
        return replace(model, set_in={**self.set_in, place: self.cells[place].value(row)})

    def including(self, places: Sequence[EffectPlace]) -> Self:
        """Return the model with formulas and tables as further effects; raise a ValueError for an impossible one."""
        model = self
        for place in places:
            if place not in (*model.rows.places, *model.starting):
                model = model._beside(place, *self._columns_at(place))
        return model

    def _columns_at(self, place: EffectPlace) -> tuple[list[Floats], Floats]:
        """Columns (S, d, K) of each part of an effect that always acts, and its part (3, K) of the mean at rest."""
        if place.definition.component != "AccelerometerBlock":
            return self.make_cells(place).columns(0)
        reference, x = self.reference, self.rows.point[: self.of_forces]
        if not isinstance(reference, Gravity):
            raise ValueError("beside a true attitude nothing is told of accelerometers")
        forces = force_columns(place, inputs_of(x, reference.reading), reference.rests)
        by_reading = reference.of_readings(x, self.attitude)
        columns = [by_reading[part.label].of(forces) for part in self.rows.parts]
        return columns, np.zeros((3, forces.shape[2]))

    def _beside(self, place: EffectPlace, columns: Sequence[NDArray], mean: NDArray) -> Self:
        """Return the model with one more effect, by its columns (S, d, K) and its part (3, K) of the mean at rest."""
        at_rest = None if self.at_rest is None else np.hstack([self.at_rest, mean])
        return replace(self, rows=self.rows.with_effect(place, columns), at_rest=at_rest)

    def candidates(
        self, size: int, work: Work, among: Sequence[EffectPlace] | None = None
    ) -> Iterator[tuple[EffectPlace, ...]]:
        """Yield sets of a given size that no bound refuses, then those with one effect that sets in."""
        yield from super().candidates(size, work, among)
        if among is None:
            yield from self.sets_in_time(size, work)

    def mended(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return fits of a set of effects with possible sizes, at the possible times of any effect that sets in."""
        in_time = any(place in self.starting for place in places)
        return self.mended_in_time(places, work) if in_time else super().mended(places, work)

    def over_bounds(self, columns: Sequence[NDArray]) -> Floats:
        """Columns (S, d, K) of each part as rows (M, K) over their bounds."""
        return np.concatenate([rows_over(c, part.bound) for c, part in zip(columns, self.rows.parts, strict=True)])

    def gyros_with(self, places: Sequence[EffectPlace], solution: NDArray) -> GyroModel:
        """The gyros with steps of the model's parameters and coefficients of effects (P + k,)."""
        gyros = with_parameters(self.gyros, self.own, solution[self.of_forces : len(self.rows.names)])
        bias = gyros.bias
        if self.at_rest is not None:
            bias = bias - self.at_rest[:, self.rows.numbers_of(places)] @ solution[len(self.rows.names) :]
        effects = {place: values for place, values in self.values_of(places, solution).items() if is_of_gyros(place)}
        return GyroModel(bias, gyros.scale_misalignment, effects)

    def simulated(
        self, fmus: Mapping[str, Path], places: Sequence[EffectPlace], solution: NDArray, numbers: Sequence[NDArray]
    ) -> list[Floats]:
        """Return errors (n, d) of some pieces (n,) of each scored kind, by FMUs that are extended with effects.

        The solution (P + k,) are steps of the model's parameters and coefficients of the effects.
        """
        pieces = [kind.selected(at) for kind, at in zip(self.reference.scored, numbers, strict=True)]
        rows = all_rows(pieces)
        # Components that count hours must count them from the record's beginning; of a long record only a part is run.
        runs_whole = len(self.motion) <= LONG or reads(places, "HOURS")
        begin, end = (0, len(self.motion)) if runs_whole else (int(rows[0]), int(rows[-1]) + 1)
        gyros = self.gyros_with(places, solution)
        attitude = carried_attitude(self.motion.part(begin, end), gyros, self.found.gravity, fmus)
        forces = {p: values for p, values in self.values_of(places, solution).items() if not is_of_gyros(p)}
        up = self.reference.directions((self.rows.point + solution[: len(self.rows.names)])[: len(NAMES)], forces)
        errors = []
        for k, (pieces_run, at) in enumerate(zip(pieces, numbers, strict=True)):
            moved = replace(pieces_run, first=pieces_run.first - begin, last=pieces_run.last - begin)
            errors.append(self.reference.errors(k, turned(moved, attitude), up, up, at))
        return errors

    def errors_along(self, attitude: NDArray, step: NDArray) -> list[Floats]:
        """Errors of each part with another attitude and a step of the model's parameters; norms stay."""
        reference, x, errors = self.reference, self.rows.point[: len(NAMES)], []
        first, up = reference.directions(x), reference.directions(x + step[: len(NAMES)])
        for part in self.rows.parts:
            rotation = turned(part.pieces, attitude)
            if part.pieces.kind == "norms":
                errors.append(part.error)
            elif part.pieces.kind == "rests":
                errors.append(rotation_vectors(rotation))
            else:
                errors.append(reference.errors(reference.scored.index(part.pieces), rotation, up, first))
        return errors

    @property
    def quoted(self) -> int:
        """Number of the part whose errors are quoted: single moves, or the windows of the middle length."""
        return self.rows.scored[0 if isinstance(self.reference, Gravity) else len(self.rows.scored) // 2]

    @property
    def falsified(self) -> bool:
        """Return whether the record contradicts the model; a bias that is not constant contradicts it."""
        return super().falsified or self.unsteady is not None

    @property
    def unsteady(self) -> str | None:
        """Sentence on gyros that are not constant at rest; None where only noise varies."""
        return None if self.reference.noise is None else self.reference.noise.said

    @property
    def jumps(self) -> bool:
        """Return whether a change of the biases between two rests makes the gyros constant at rest."""
        return self.reference.noise is not None and self.reference.noise.jumps


def is_of_gyros(place: EffectPlace) -> bool:
    """Return whether an effect is carried with the attitude; any other changes the accelerometers' readings at rest."""
    return place.definition.component != "AccelerometerBlock"


def with_parameters(model: GyroModel, places: Sequence[EffectPlace], step: NDArray) -> GyroModel:
    """The gyros with steps (3,) or (9,) of bias, scale and misalignment added, in the order of the places."""
    bias, scale, at = model.bias, model.scale_misalignment, 0
    for place in places:
        if place == BIAS:
            bias, at = bias + step[at : at + 3], at + 3
        else:
            scale, at = scale + step[at : at + 9], at + 9
    return GyroModel(bias, scale, model.effects)
