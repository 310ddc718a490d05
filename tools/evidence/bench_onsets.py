"""Effects of the gyros that set in at a time, or fade, and a slip of the block, as a bench record shows them."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...models.effects import STRAPDOWN_EFFECTS, EffectPlace
from ..bounded.sets import Work
from ..calibration.turns import WithTurns
from ..records import BenchRecord
from .bench_moving import Moving
from .bench_slip import SLIP, SlipOnsets
from .bench_travel import Travel
from .fit import Fit, estimated
from .onsets import Onsets
from .rows import About, Pieces
from .setting_in import SettingIn

SETTING_IN = tuple(
    place
    for effect in STRAPDOWN_EFFECTS.values()
    if effect.component == "GyroBlock" and (effect.sets_in or effect.fades)
    for place in effect.places
)
"""Effects of gyros that act from a time on, or settle."""
ROUNDS = 2
"""So many times a slip is fitted again where it is linear about half of what it was."""
SLACK = 0.5
"""What the linear model of a search may be wrong by, in bounds."""
NOT_EXCLUDED = "beside what settles no sizes of other effects are excluded: each of its time constants asks for its own"


def fades(fit: Fit) -> bool:
    """Whether an effect of a fit settles."""
    return any(place.definition.fades for place in fit.places)


def onsets_of_turns(raw: BenchRecord, whole: WithTurns, travel: Travel) -> Onsets:
    """Columns of effects of gyros on a table that set in after a row of its record."""
    hours = (raw.time_s - raw.time_s[0]) / 3600.0

    def grown(place: EffectPlace) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What an effect adds to the gyros' integrals up to each row (N, 3, K); no mean at rest is taken out."""
        sums = travel.gyros.sums(place.definition.signature(place, travel.motion))
        # Between the rows that are looked at the table turns by little: rates, and what a bias adds, are even.
        flat = [np.interp(hours, travel.hours, own) for own in sums.reshape(len(sums), -1).T]
        integral = np.stack(flat, axis=1).reshape(len(hours), *sums.shape[1:])
        return integral, np.zeros_like(integral)

    pieces = Pieces("turns", "turns", whole.turns.first, whole.turns.last)
    group = replace(travel.gyros.groups[0], pieces=pieces)
    return Onsets(hours, (group,), np.zeros(len(hours), dtype=bool), grown)


class TurnsInTime(SettingIn):
    """Evidence of a whole bench beside which effects of its gyros set in.

    `around` are rows without effects, linear about a fit in place of the nominal model, `narrowed` what `left_open`
    says beside it; `loose` what its model may be wrong by, in bounds. `slipping` is a fit with a slip, about half of
    which slips are linear.
    """

    raw: BenchRecord
    moving: Moving
    whole: WithTurns
    travel: Travel
    around: About | None
    narrowed: Mapping[EffectPlace, Sequence[tuple[int, int]]]
    loose: float
    slipping: Fit | None

    most_with_onset = 2

    @property
    def left_open(self) -> Mapping[EffectPlace, Sequence[tuple[int, int]]]:
        """Stretches of an effect's times beside the fit about which the rows are linear."""
        return self.narrowed

    @cached_property
    def onsets(self) -> Onsets:
        """Columns of effects that set in after a row."""
        return onsets_of_turns(self.raw, self.whole, self.travel)

    @cached_property
    def slips(self) -> SlipOnsets:
        """Columns of a slip after a moment."""
        return SlipOnsets.of(self.raw, self.whole, self.moving, self.slipping)

    def onsets_of(self, place: EffectPlace) -> Onsets:
        """Those of the gyros, or of the slip."""
        return self.slips if place == SLIP else self.onsets

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The evidence with an effect that sets in after a row, or with the time constant of that number, too."""
        value = self.onsets_of(place).value(self.acting[place], row)
        return self._replaced_by(set_in={**self.set_in, place: value})

    def columns_set_in(self, place: EffectPlace) -> NDArray[np.float64]:
        """What an effect that sets in at its time adds to readings [g] and integrals [rad] (M, K); NaN: not told."""
        onsets, acting = self.onsets_of(place), self.acting[place]
        columns, _ = onsets.columns(acting, onsets.number(acting, self.set_in[place]))
        return self.over_bounds(columns) * self.whole.bound[:, None]

    @cached_property
    def says(self) -> NDArray[np.bool_]:
        """Which rows (M,) say something beside what sets in at its time."""
        every = [np.isfinite(self.columns_set_in(place)).all(axis=1) for place in self.set_in if place == SLIP]
        return np.all([np.ones(len(self.whole.bound), dtype=bool), *every], axis=0)

    def over_bounds(self, columns: Sequence[NDArray]) -> NDArray[np.float64]:
        """Columns (S, 3, K) of the turns, or of readings and turns, as rows (M, K) over their bounds."""
        own = np.vstack([part.reshape(-1, part.shape[2]) for part in columns])
        above = np.zeros((len(self.whole.bound) - len(own), own.shape[1]))
        return np.vstack([above, own]) / self.whole.bound[:, None]

    def mended_in_time(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Fits of a set with one effect that sets in; rows are linear about the best that the nominal point shows.

        Of a slip that is found again twice: what it does is bent.
        """
        if self.around is None:
            (place,) = (place for place in places if place in self.starting)
            others = [other for other in places if other != place]
            bent = self.second_order_at(self.baseline_radius) if place == SLIP else 0.0
            rough = self._replaced_by(loose=SLACK + bent)
            if not (left := list(rough.open_stretches(place, others, work))):
                return []
            begin, end = min(left, key=lambda ends: self._left_by(place, others, 0.5 * (ends[0] + ends[1])))
            made, row, narrowed = self, 0.5 * (begin + end), {place: left}
            fit = made.with_onset(place, row).refit([*others, place])
            if place == SLIP:
                time, narrowed = self.slips.value(self.acting[place], row), {}
                for _ in range(ROUNDS):
                    made = made._replaced_by(slipping=fit)
                    row = made.slips.number(made.acting[place], time)
                    fit = made.with_onset(place, row).refit([*others, place])
                made = made._replaced_by(loose=made.slips.missed)
            # Without what sets in: at another time other rows say something.
            coefficients, count = fit.coefficients[: fit.blocks[-1].start], len(fit.point)
            rows = made.about(others, fit.point, coefficients)
            residual = rows.residual + rows.jacobian[:, count:] @ coefficients
            around = replace(rows, residual=residual, jacobian=rows.jacobian[:, :count])
            about = made._replaced_by(around=around, point=fit.point, narrowed=narrowed)
            return about.mended_in_time(places, work)
        return super().mended_in_time(places, work)

    def _left_by(self, place: EffectPlace, others: Sequence[EffectPlace], row: float) -> float:
        """What least squares leave of the rows with an effect that sets in after a row."""
        columns, _ = self.onsets_of(place).columns(self.acting[place], int(row))
        matrix = np.hstack([self.matrix(others), np.nan_to_num(self.over_bounds(columns))])
        return float(np.linalg.norm(self.residual - matrix @ estimated(matrix, self.residual)))

    def acts_linearly(self, fit: Fit) -> bool:
        """Whether every effect of a fit is linear in its coefficients, at its time where it sets in."""
        return all(variant is None or place in self.starting for place, _, variant in fit.ways)

    def _replaced_by(self, **fields: Any) -> Self:
        made = replace(self, **fields)
        known = {name: self.__dict__[name] for name in ("onsets", "slips", "acting") if name in self.__dict__}
        made.__dict__.update(known)
        if "slipping" in fields:
            del made.__dict__["slips"]
            made.__dict__["acting"] = {**self.acting, SLIP: made.slips.acting(SLIP)}
        return made
