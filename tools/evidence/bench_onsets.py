"""Effects of the gyros that set in at a time, or fade, and a slip of the block, as a bench record shows them.

Gyros see a slip itself. Behind it the block stands otherwise, for accelerometers and gyros alike; the turn over the gap
holds the slip, which no encoder sees. It is linear at half a slip: what a whole one does is missed by the third order
of its size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from ...models.bench import GYRO_PARAMETERS, LAG, MATRIX, integrated_readings, moments_of, small_turn
from ...models.effects import STRAPDOWN_EFFECTS, EffectPlace
from ...models.effects.columns import TIME_CONSTANT
from ...models.effects.steps import MOUNTING_SLIP
from ..bounded.sets import Work
from ..calibration.model import slip_jacobian
from ..calibration.turns import WithTurns
from ..records import BenchRecord
from ..records.rests import without_turns
from .bench_moving import Moving
from .bench_travel import Travel, interpolated
from .fit import Fit, estimated
from .observation import Group
from .onsets import Acting, Columns, Fading, Onsets
from .rows import About, Pieces
from .setting_in import SettingIn

(SLIP,) = MOUNTING_SLIP.places
FINEST, MOST_FINER = 0.02, 16
"""Times of a slip are so near that what it turns between two counts so much of a bound; so many a row at most."""


@dataclass(frozen=True, eq=False)
class SlipOnsets(Onsets):
    """Columns of a slip after each moment of a record: of readings, then of what gyros integrate.

    `hours` are of one or several moments a row, since the record's first rest; `whole` (S, 3, 3) of each part what the
    slip adds where it is within a piece, or before a reading: nothing is told of a reading that is of both sides of it.
    `missed`: what so few moments miss, in bounds.
    """

    whole: tuple[NDArray[np.float64], ...]
    missed: float

    at_once: ClassVar[int] = 1

    @staticmethod
    def of(raw: BenchRecord, fitted: WithTurns, moving: Moving, about: Fit | None) -> "SlipOnsets":
        """Linear at half the slip of a fit, and its parameters; by default at none, and the nominal model's."""
        turns, own_count, count = fitted.turns, fitted.own, len(fitted.point)
        point, half = np.append(fitted.point, 0.0), np.zeros(3)
        if about is not None:
            point = about.point
            half = 0.5 * about.coefficients[about.blocks[about.places.index(SLIP)]]
        turned = block_turns(raw, fitted, point[:count])
        step = np.linalg.norm(np.diff(turned, axis=0), axis=1).max() * 2.0 * np.linalg.norm(half)
        step /= float(fitted.bound[-3 * len(turns.first) :].min())
        finer = int(np.clip(np.ceil(step / FINEST), 1, MOST_FINER))
        time = np.interp(np.arange((len(turned) - 1) * finer + 1) / finer, np.arange(len(turned)), raw.time_s)
        late = time - point[own_count + LAG]
        fine = interpolated(late, raw.time_s, turned)
        # Complex steps: derivatives of the frame by the slip.
        slopes = np.imag([small_turn(half + 1e-30j * axis) for axis in np.eye(3)]) / 1e-30
        readings = moving.lagging(float(point[-1]))[0]
        at = replace(readings.at, slips=np.tile(half, (len(readings), 1)))
        slopes_read = slip_jacobian(readings.parametrisation, point[:own_count], at, readings.sign)
        gain = np.eye(3) + point[own_count:count][MATRIX].reshape(3, 3)
        begin, end = moving.seen.span.T
        pieces = (
            Pieces("rests", "readings", finer * begin, finer * end),
            Pieces("turns", "turns", finer * turns.first, finer * turns.last),
        )
        # A gyro that is read now and then does not tell how far it turned at once.
        across = np.full((len(turns.first), 3, 3), np.nan)
        if raw.increment is not None:
            across[:] = gain
        turning = np.broadcast_to(np.eye(3), (len(turns.first), 3, 3))
        grown = np.einsum("gi,kij,nj->ngk", gain, slopes, fine)
        return SlipOnsets(
            (time - moving.read.readings.circumstances.began) / 3600.0,
            (Group(pieces[0], np.zeros_like(slopes_read)), Group(pieces[1], turning)),
            np.zeros(len(time), dtype=bool),
            # Gyros of a block that stands otherwise have turned more; no mean at rest is taken out.
            lambda place: (grown, np.zeros_like(grown)),
            (slopes_read, across),
            step / finer,
        )

    def columns(self, acting: Acting | Fading, row: float) -> tuple[Columns, NDArray[np.float64]]:
        """As of other effects, with the slip itself; NaN of readings that are of both sides of it."""
        columns, mean = super().columns(acting, row)
        of_readings, of_turns = self.groups
        readings, turned = of_readings.pieces, of_turns.pieces
        before, across = readings.last <= row, (turned.first <= row) & (row < turned.last)
        columns[0] = self.whole[0] * ~before[:, None, None]
        columns[0][~before & (readings.first <= row)] = np.nan
        columns[1][across] += self.whole[1][across]
        return columns, mean

    def within(self, acting: Acting, begin: int, end: int) -> Columns:
        """As of other effects, where the slip is behind the moment `end` at the latest and a moment follows it."""
        columns = self.columns(acting, end)[0]
        for k, group in enumerate(self.groups):
            holding = (group.pieces.first <= begin) & (group.pieces.last > end) & (k > 0)
            turn = group.gain * holding[:, None, None]
            turn[~(holding | (group.pieces.last <= begin) | (group.pieces.first > end))] = np.nan
            columns[k] = np.concatenate([columns[k], turn], axis=2)
        return columns


def block_turns(raw: BenchRecord, fitted: WithTurns, point: NDArray) -> NDArray[np.float64]:
    """How far (N, 3) [rad] the block has turned up to each row, in its axes, by parameters of bench and gyros."""
    moments = moments_of(raw.time_s, without_turns(raw.alpha), without_turns(raw.beta))
    targets, ideal = fitted.parametrisation.selection[0] @ point[: fitted.own], np.zeros(len(GYRO_PARAMETERS))
    still = np.stack([np.zeros_like(moments), np.zeros_like(moments)])
    return integrated_readings(targets, ideal, moments, still, fitted.turns.mounting, fitted.turns.earth)


def effects_setting_in() -> tuple[EffectPlace, ...]:
    """Effects of gyros that act from a time on, or settle."""
    places: list[EffectPlace] = []
    for effect in STRAPDOWN_EFFECTS.values():
        if effect.component == "GyroBlock" and effect.searched is not None:
            places += effect.places
    return tuple(places)


SETTING_IN = effects_setting_in()
ROUNDS = 2
"""So many times a slip is fitted again where it is linear about half of what it was."""
SLACK = 0.5
"""What the linear model of a search may be wrong by, in bounds."""
NOT_EXCLUDED = "beside what settles no sizes of other effects are excluded: each of its time constants asks for its own"


def fades(fit: Fit) -> bool:
    """Whether an effect of a fit settles."""
    return any(place.definition.searched == TIME_CONSTANT for place in fit.places)


def onsets_of_turns(raw: BenchRecord, fitted: WithTurns, travel: Travel) -> Onsets:
    """Columns of effects of gyros on a table that set in after a row of its record."""
    hours = (raw.time_s - raw.time_s[0]) / 3600.0

    def grown(place: EffectPlace) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """What an effect adds to the gyros' integrals up to each row (N, 3, K); no mean at rest is taken out."""
        sums = travel.gyros.sums(place.definition.signature(place, travel.motion))
        # Between the rows that are looked at the table turns by little: rates, and what a bias adds, are even.
        _, axes, count = sums.shape
        integral = interpolated(hours, travel.hours, sums.reshape(len(sums), -1)).reshape(len(hours), axes, count)
        return integral, np.zeros_like(integral)

    pieces = Pieces("turns", "turns", fitted.turns.first, fitted.turns.last)
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
        if SLIP not in self.set_in:
            return np.ones(len(self.whole.bound), dtype=bool)
        return np.asarray(np.isfinite(self.columns_set_in(SLIP)).all(axis=1))

    def over_bounds(self, columns: Sequence[NDArray]) -> NDArray[np.float64]:
        """Columns (S, 3, K) of the turns, or of readings and turns, as rows (M, K) over their bounds."""
        stacked = np.vstack([part.reshape(-1, part.shape[2]) for part in columns])
        above = np.zeros((len(self.whole.bound) - len(stacked), stacked.shape[1]))
        return np.vstack([above, stacked]) / self.whole.bound[:, None]

    def mended_in_time(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Fits of a set with one effect that sets in; rows are linear about the best that the nominal point shows.

        Of a slip that is found again twice: what it does is bent.
        """
        if self.around is None:
            (place,) = (place for place in places if place in self.starting)
            rest, loose = [p for p in places if p != place], SLACK
            if place == SLIP:
                loose += self.second_order_at(self.baseline_radius)
            rough = self._replaced_by(loose=loose)
            if not (stretches := list(rough.open_stretches(place, rest, work))):
                return []
            begin, end = min(stretches, key=lambda ends: self._left_by(place, rest, 0.5 * (ends[0] + ends[1])))
            evidence, row, narrowed = self, 0.5 * (begin + end), {place: stretches}
            fit = evidence.with_onset(place, row).refit([*rest, place])
            if place == SLIP:
                time, narrowed = self.slips.value(self.acting[place], row), {}
                for _ in range(ROUNDS):
                    evidence = evidence._replaced_by(slipping=fit)
                    row = evidence.slips.number(evidence.acting[place], time)
                    fit = evidence.with_onset(place, row).refit([*rest, place])
                evidence = evidence._replaced_by(loose=evidence.slips.missed)
            # Without what sets in: at another time other rows say something.
            coefficients, count = fit.coefficients[: fit.blocks[-1].start], len(fit.point)
            rows = evidence.about(rest, fit.point, coefficients)
            residual = rows.residual + rows.jacobian[:, count:] @ coefficients
            around = replace(rows, residual=residual, jacobian=rows.jacobian[:, :count])
            about = evidence._replaced_by(around=around, point=fit.point, narrowed=narrowed)
            return about.mended_in_time(places, work)
        return super().mended_in_time(places, work)

    def _left_by(self, place: EffectPlace, linear: Sequence[EffectPlace], row: float) -> float:
        """What least squares leave of the rows with an effect that sets in after a row."""
        columns, _ = self.onsets_of(place).columns(self.acting[place], int(row))
        matrix = np.hstack([self.matrix(linear), np.nan_to_num(self.over_bounds(columns))])
        return float(np.linalg.norm(self.residual - matrix @ estimated(matrix, self.residual)))

    def acts_linearly(self, fit: Fit) -> bool:
        """Whether every effect of a fit is linear in its coefficients, at its time where it sets in."""
        return all(variant is None or place in self.starting for place, _, variant in fit.ways)

    def _replaced_by(self, **fields: Any) -> Self:
        evidence = replace(self, **fields)
        cached = {name: self.__dict__[name] for name in ("onsets", "slips", "acting") if name in self.__dict__}
        evidence.__dict__.update(cached)
        if "slipping" in fields:
            del evidence.__dict__["slips"]
            evidence.__dict__["acting"] = {**self.acting, SLIP: evidence.slips.acting(SLIP)}
        return evidence
