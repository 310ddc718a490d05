"""A whole bench: its readings at rest and in motion as one, and effects with an unknown number beside its turns.

Gyros see a slip of the block itself. After it the block has another attitude, for accelerometers and gyros alike; the
turn over the gap includes the slip, which no encoder sees. The slip is linearised at half its size: the error of a
whole slip is of third order in its size.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Self, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Bools, Floats
from ...models.bench import (
    BIAS,
    GYRO_PARAMETERS,
    LAG,
    MATRIX,
    SENSITIVITY,
    integrated_readings,
    moments_of,
    small_turn,
)
from ...models.effects import EffectPlace, MotionRows
from ...models.effects.columns import TIME_CONSTANT, small_turns
from ...models.effects.steps import MOUNTING_SLIP
from ..bounded.work import Work
from ..calibration.in_motion import CERTAIN, FURTHER, InMotion, WithMotion, responses, slopes_by_angles
from ..calibration.model import Positions, linearise, predicted_input, slip_jacobian
from ..calibration.turns import WithTurns
from ..orchestrator import run_scenario
from ..records import BenchRecord, PositionRecord
from ..records.rests import without_turns
from .bench import Bench
from .bench_model import Readings
from .bench_visits import Circumstances
from .carried import LATENCY
from .cells_in_motion import Cells, OverBounds, Slips, cells_of
from .fit import Fit, coefficient_count, composed, estimated
from .observation import FINE, Group, Travel, interpolated, moves_of, senses_of_moves
from .rows import About, Pieces
from .setting_in import SettingIn

SENSITIVE = EffectPlace("gyro-g-sensitivity", "gyro-block")
MOST_ROWS = 120_000
"""A longer record is run at every second row, or third, and so on."""
(SLIP,) = MOUNTING_SLIP.places
FINEST, MOST_FINER = 0.02, 16
"""Spacing of the tried times of a slip, as the turn between two of them in bounds, and the most times in one row."""
ROUNDS = 2
"""Fits of a slip at finer times, each where the linear model holds over about half the range before."""
SLACK = 0.5
"""Largest error of the linear model of a search, in bounds."""
NOT_EXCLUDED = "beside what settles no sizes of other effects are excluded: each of its time constants asks for its own"


def fades(fit: Fit) -> bool:
    """Return whether a fit holds an effect that settles."""
    return any(place.definition.searched == TIME_CONSTANT for place in fit.places)


@dataclass(frozen=True, eq=False)
class Moving:
    """Readings at rest and in motion, in the order of time: as one evidence `read`, and as they are `seen` in motion.

    At rest those have no row, and rates of zero. `to_block` (3, 3): axes of the inner frame in those of the block;
    `lean` ε [rad].
    """

    read: Bench
    seen: InMotion
    to_block: Floats
    lean: float

    @staticmethod
    def of(
        rests: Bench, record: PositionRecord, motion: InMotion, to_block: NDArray, lean: float, encoder_bound: float
    ) -> "Moving":
        """Return the rests of a record and its readings in motion; motion exceeds an encoder's error [rad]."""
        linear_rests, readings_at_rest, raw = rests.here, rests.readings, record.raw
        assert isinstance(raw, BenchRecord)
        hours = (raw.time_s[motion.rows] - readings_at_rest.circumstances.began) / 3600.0
        order = np.argsort(np.append(readings_at_rest.circumstances.hours, hours), kind="stable")
        still = np.zeros((len(readings_at_rest), 2))
        angles = np.stack([readings_at_rest.at.alpha, readings_at_rest.at.beta], axis=1)
        moves = moves_of(raw, encoder_bound)
        spans = [(rest.kept_first - 1, rest.kept_last) for rest in record.rests if rest.refused is None]
        at_rest = InMotion(
            np.full(len(readings_at_rest), -1),
            np.array(spans),
            angles,
            readings_at_rest.reading,
            linear_rests.bound.reshape(-1, 3),
            still,
            still,
            _senses_at(rests, raw, moves),
        )
        fields: dict[str, Any] = {}
        for name, values in vars(at_rest).items():
            fields[name] = np.concatenate([values, getattr(motion, name)])[order]
        in_motion = InMotion(**fields)
        linear = linearise(
            linear_rests.parametrisation,
            in_motion.at(0.0),
            in_motion.reading,
            linear_rests.point,
            in_motion.bound.ravel(),
        )
        readings = Readings.of(linear, _circumstances(rests, raw, in_motion, order, moves), readings_at_rest.resolution)
        numbers = np.append(rests.numbers, np.zeros(len(motion.rows), dtype=int))[order]
        return Moving(replace(rests, here=linear, readings=readings, numbers=numbers), in_motion, to_block, lean)

    @property
    def at_rest(self) -> Bools:
        """Which readings (N,) are the rests'."""
        return self.seen.rows < 0

    def about(self, start: WithMotion) -> "Moving":
        """The readings linearised at the parameters of a fit, with its signs of the inputs in motion."""
        linear, point = self.read.here, start.point[: start.own]
        sign = self.seen.beyond_rest(start, start.point, start.gravity)[1]
        linear = replace(linear, point=point, sign=np.where(self.at_rest[:, None], linear.sign, sign))
        at = {"residual": linear.residual_at(point), "jacobian": linear.jacobian_at(point)}
        readings = replace(self.read.readings, sign=linear.sign)
        return replace(self, read=replace(self.read, here=replace(linear, **at), readings=readings))

    @cached_property
    def motion(self) -> MotionRows:
        """The rows as effects in motion see them."""
        motion, rows = self.seen.motion(self.to_block, self.lean, self.read.calibration.gravity), self.read.contexts
        sensed = responses(self.read.here.parametrisation, self.read.here.point, rows.n)
        return replace(
            motion, specific_force=rows.n, hours=rows.hours, temperature=rows.temperature, block_response=sensed
        )

    def columns(self, place: EffectPlace) -> Floats:
        """Return the columns (3 N, K) [g] of an accelerometer's effect that only motion shows; zeros for any other."""
        effect = place.definition
        if not (effect.in_motion and effect.component == "AccelerometerBlock"):
            return np.zeros((self.seen.reading.size, coefficient_count(place)))
        return effect.signature(place, self.motion).reshape(self.seen.reading.size, -1)

    def readings_at(self, system: WithTurns, point: NDArray) -> tuple[Readings, Floats]:
        """Return the readings less the effect of the accelerometers' places, at moments earlier by their lag.

        The second part is the derivatives (3 N, 10) of the readings by `FURTHER`, the last of the parameters (P,).
        """
        at, _, added, further = self.seen.beyond_rest(system, point, self.read.calibration.gravity)
        readings = self.read.readings
        return replace(readings, at=at, reading=readings.reading - added.reshape(-1, 3)), further


def _senses_at(rests: Bench, raw: BenchRecord, moves: NDArray) -> Floats:
    """Return senses (N, 3) of the inputs' last changes before rests; 0 where moves (2, T) of both axes leave it open.

    Where both axes stopped together both must agree; otherwise the axis that stopped later decides.
    """
    circumstances, at = rests.readings.circumstances, rests.readings.at
    arrived = np.searchsorted(raw.time_s, circumstances.began + 3600.0 * circumstances.hours)
    row, turned = np.arange(moves.shape[1]), np.cumsum(np.abs(moves), axis=1)
    last = np.maximum.accumulate(np.where(moves != 0.0, row, 0), axis=1)[:, arrived]
    later_outer = turned[0, arrived] - turned[0, last[1]] > FINE
    later_inner = turned[1, arrived] - turned[1, last[0]] > FINE
    senses = _senses_of_axes(moves)[:, arrived]
    grown = senses[:, :, None] * np.moveaxis(slopes_by_angles(rests.here.parametrisation, rests.here.point, at), 2, 0)
    ways = np.where(np.abs(grown) > CERTAIN, np.sign(grown), 0.0)
    together = np.where(ways[0] == ways[1], ways[0], 0.0)
    alone = np.where(later_outer[:, None], ways[0], ways[1])
    return np.where((later_outer == later_inner)[:, None], together, alone)


def _senses_of_axes(moves: NDArray) -> Floats:
    """Senses (2, T) of the last move of both axes, by their moves (2, T)."""
    outer, inner = moves
    return np.stack([senses_of_moves(outer[1:]), senses_of_moves(inner[1:])])


def _circumstances(rests: Bench, raw: BenchRecord, seen: InMotion, order: NDArray, moves: NDArray) -> Circumstances:
    """Circumstances of rests and of rows in motion, in this order; both are `seen`, moves (2, T) are of both axes."""
    at_rest, rows = rests.readings.circumstances, seen.rows[seen.rows >= 0]
    # An axis that stopped before the other one has the sense of its own last move.
    going = _senses_of_axes(moves)[:, rows].T
    senses = np.concatenate([np.stack([at_rest.sense_alpha, at_rest.sense_beta], axis=1), going])[order]
    warm = None
    if at_rest.temperature is not None and raw.temperature is not None:
        warm = np.append(at_rest.temperature, raw.temperature[rows])[order]
    return replace(
        at_rest,
        hours=np.append(at_rest.hours, (raw.time_s[rows] - at_rest.began) / 3600.0)[order],
        temperature=warm,
        sense_alpha=senses[:, 0],
        sense_beta=senses[:, 1],
        before=None,
        axis_rates=seen.rate,
        input_senses=seen.senses,
    )


# A slip, and the gyros' effects


def slips_of(raw: BenchRecord, fitted: WithTurns, moving: Moving, about: Fit | None, over_bounds: OverBounds) -> Slips:
    """Return a slip, linear at half that of a fit and its parameters; by default at none, and the nominal model's."""
    turns, own_count, count = fitted.turns, fitted.own, len(fitted.point)
    point, half = np.append(fitted.point, np.zeros(len(FURTHER))), np.zeros(3)
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
    # Complex steps give the derivatives of the frame by the slip.
    slopes = np.imag([small_turn(half + 1e-30j * axis) for axis in np.eye(3)]) / 1e-30
    readings, _ = moving.readings_at(fitted, point)
    at = replace(readings.at, slips=np.tile(half, (len(readings), 1)))
    slopes_read = slip_jacobian(readings.parametrisation, point[:own_count], at, readings.sign)
    gain = np.eye(3) + point[own_count:count][MATRIX].reshape(3, 3)
    begin, end = moving.seen.span.T
    pieces = (
        Pieces("rests", "readings", finer * begin, finer * end),
        Pieces("turns", "turns", finer * turns.first, finer * turns.last),
    )
    # A gyro with sampled rates does not record a sudden turn.
    across = np.full((len(turns.first), 3, 3), np.nan)
    if raw.increment is not None:
        across[:] = gain
    turning = np.broadcast_to(np.eye(3), (len(turns.first), 3, 3))
    integral = np.einsum("gi,kij,nj->ngk", gain, slopes, fine)
    # Gyros of a slipped block have turned more; no mean at rest is removed.
    return Slips(
        (time - moving.read.readings.circumstances.began) / 3600.0,
        (Group(pieces[0], np.zeros_like(slopes_read)), Group(pieces[1], turning)),
        np.zeros(len(time), dtype=bool),
        integral,
        np.zeros_like(integral),
        over_bounds,
        (slopes_read, across),
        step / finer,
    )


def block_turns(raw: BenchRecord, fitted: WithTurns, point: NDArray) -> Floats:
    """Return the turn (N, 3) [rad] of the block up to each row, in its axes, by parameters of bench and gyros."""
    moments = moments_of(raw.time_s, without_turns(raw.alpha), without_turns(raw.beta))
    targets, ideal = fitted.parametrisation.selection[0] @ point[: fitted.own], np.zeros(len(GYRO_PARAMETERS))
    still = np.stack([np.zeros_like(moments), np.zeros_like(moments)])
    return integrated_readings(targets, ideal, moments, still, fitted.turns.mounting, fitted.turns.earth)


def cells_of_turns(
    place: EffectPlace, raw: BenchRecord, fitted: WithTurns, travel: Travel, over_bounds: OverBounds
) -> Cells:
    """Return the cells of an effect of gyros on a table."""
    hours = (raw.time_s - raw.time_s[0]) / 3600.0
    sums = travel.gyros.sums(place.definition.signature(place, travel.motion))
    # Between these rows the table turns little: rates, and the effect of a bias, are even.
    _, axes, count = sums.shape
    integral = interpolated(hours, travel.hours, sums.reshape(len(sums), -1)).reshape(len(hours), axes, count)
    pieces = Pieces("turns", "turns", fitted.turns.first, fitted.turns.last)
    return cells_of(place, hours, (replace(travel.gyros.groups[0], pieces=pieces),), over_bounds, integral)


class TurnsInTime(SettingIn):
    """Evidence of a whole bench beside which effects of its gyros set in.

    `around` are rows without effects, linear about a fit instead of the nominal model; `narrowed` is the `left_open` of
    that fit; `loose` is the error of its model, in bounds. `slipping` is a fit with a slip; slips are linear about half
    of it.
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
        """Possible ranges of an effect's times beside the fit."""
        return self.narrowed

    def make_cells(self, place: EffectPlace) -> Cells:
        """Return those of the slip, or of an effect of the gyros."""
        if place == SLIP:
            return slips_of(self.raw, self.whole, self.moving, self.slipping, self.over_bounds)
        return cells_of_turns(place, self.raw, self.whole, self.travel, self.over_bounds)

    def with_onset(self, place: EffectPlace, row: float) -> Self:
        """The evidence with an effect that sets in after a row, or with the time constant of that number, too."""
        return self._replaced_by(set_in={**self.set_in, place: self.cells[place].value(row)})

    def columns_set_in(self, place: EffectPlace) -> Floats:
        """Return the columns (M, K) [g, rad] of an effect at its onset; NaN where the record leaves them open."""
        cells = self.cells[place]
        columns, _ = cells.columns(cells.number(self.set_in[place]))
        return self.over_bounds(columns) * self.whole.bound[:, None]

    @cached_property
    def says(self) -> Bools:
        """Mask (M,) of the rows that the effects that set in leave determined."""
        if SLIP not in self.set_in:
            return np.ones(len(self.whole.bound), dtype=bool)
        return np.asarray(np.isfinite(self.columns_set_in(SLIP)).all(axis=1))

    def over_bounds(self, columns: Sequence[NDArray]) -> Floats:
        """Columns (S, 3, K) of the turns, or of readings and turns, as rows (M, K) over their bounds."""
        stacked = np.vstack([part.reshape(-1, part.shape[2]) for part in columns])
        above = np.zeros((len(self.whole.bound) - len(stacked), stacked.shape[1]))
        return np.vstack([above, stacked]) / self.whole.bound[:, None]

    def mended_in_time(self, places: Sequence[EffectPlace], work: Work) -> Sequence[Fit]:
        """Return fits of a set with one effect that sets in; rows are linear about the best fit from the nominal point.

        A slip is searched twice more, because its effect is not linear.
        """
        if self.around is None:
            (place, rest), loose = self._apart(places), SLACK
            if place == SLIP:
                loose += self.second_order
            rough = self._replaced_by(loose=loose)
            if not (ranges := list(rough.open_ranges_of(place, rest, work))):
                return []
            begin, end = min(ranges, key=lambda ends: self._left_by(place, rest, 0.5 * (ends[0] + ends[1])))
            evidence, row, narrowed = self, 0.5 * (begin + end), {place: ranges}
            fit = evidence.with_onset(place, row).refit([*rest, place])
            if place == SLIP:
                time, narrowed = self.cells[place].value(row), {}
                for _ in range(ROUNDS):
                    evidence = evidence._replaced_by(slipping=fit)
                    slips = evidence.cells[place]
                    fit = evidence.with_onset(place, slips.number(time)).refit([*rest, place])
                    assert isinstance(slips, Slips)
                    evidence = evidence._replaced_by(loose=slips.missed)
            # Rows about a fit without the effect that sets in: at another time other rows are determined.
            coefficients, count = fit.coefficients[: fit.blocks[-1].start], len(fit.point)
            rows = evidence.about(rest, fit.point, coefficients)
            residual = rows.residual + rows.jacobian[:, count:] @ coefficients
            around = replace(rows, residual=residual, jacobian=rows.jacobian[:, :count])
            about = evidence._replaced_by(around=around, point=fit.point, narrowed=narrowed)
            return about.mended_in_time(places, work)
        return super().mended_in_time(places, work)

    def _left_by(self, place: EffectPlace, linear: Sequence[EffectPlace], row: float) -> float:
        """Return the norm of the least-squares residual with an effect that sets in after a row."""
        columns, _ = self.cells[place].columns(int(row))
        matrix = np.hstack([self.rows.matrix(linear), np.nan_to_num(self.over_bounds(columns))])
        return float(np.linalg.norm(self.rows.residual - matrix @ estimated(matrix, self.rows.residual)))

    def acts_linearly(self, fit: Fit) -> bool:
        """Return whether every effect of a fit is linear in its coefficients, given the time at which it sets in."""
        return all(variant is None or place in self.starting for place, _, variant in fit.ways)

    def _replaced_by(self, **fields: Any) -> Self:
        evidence = replace(cast(Any, self), **fields)
        evidence.__dict__["cells"] = self.cells
        if "slipping" in fields:
            evidence.__dict__["cells"] = {**self.cells, SLIP: evidence.make_cells(SLIP)}
        return evidence


# The turns of a record, simulated again


def effects_of_model(gyros: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
    """Return the sensitivity and the lag of the gyro model (22,) as effects of the block."""
    return {SENSITIVE: tuple(gyros[SENSITIVITY].tolist()), LATENCY: (float(gyros[LAG]),)}


def simulated_turns(
    raw: BenchRecord,
    fitted: WithTurns,
    travel: Travel,
    point: NDArray,
    effects: Mapping[EffectPlace, NDArray],
    set_in: Mapping[EffectPlace, float] | None = None,
) -> Floats:
    """Return the integrals (S, 3) [rad] of the gyro block's FMU over each piece, extended by the given effects.

    `point` (P,) are parameters of bench, accelerometers and gyros; `set_in` times [h] of effects that have one.
    """
    own, time = fitted.own, raw.time_s
    gyros, turned = point[own:], block_turns(raw, fitted, point)
    alpha, beta = without_turns(raw.alpha), without_turns(raw.beta)
    on_gyros: list[tuple[EffectPlace, Sequence[float]]] = list(effects_of_model(gyros).items())
    for place, coefficients in effects.items():
        if place.definition.component == "GyroBlock":
            values = list(place.definition.from_coefficients(coefficients))
            if set_in is not None and place in set_in:
                values.append(set_in[place])
            on_gyros.append((place, values))
        elif place.definition.turns_table:
            turns = small_turns(place.definition, place, travel.rows)
            added = (travel.table.sums(turns) @ coefficients) @ travel.to_block.T
            hours = (time - time[0]) / 3600.0
            turned = turned + interpolated(hours, travel.hours, added)
        elif place == SLIP:
            assert set_in is not None
            later = int(np.searchsorted((time - time[0]) / 3600.0, set_in[place]))
            behind = (turned[later:] - turned[later - 1]) @ small_turn(coefficients).T
            turned = np.vstack([turned[:later], turned[later - 1] + coefficients + behind])
    rows = np.unique(np.append(np.arange(0, len(time), -(-len(time) // MOST_ROWS)), len(time) - 1))
    period = float(time[-1] - time[0]) / (len(rows) - 1)
    even = time[0] + period * np.arange(len(rows))
    at = interpolated(even, time, turned)
    angles = Positions(np.interp(even, time, alpha), np.interp(even, time, beta), np.zeros(len(rows), dtype=int))
    force = STANDARD_GRAVITY * predicted_input(fitted.parametrisation, point[:own], angles)
    columns, driven, recorded = {"time_s": even[1:] - time[0]}, {}, {}
    for k in range(3):
        columns[f"w{k + 1}_rad"] = np.diff(at[:, k])
        driven[f"gyros.increment[{k + 1}]"] = f"w{k + 1}_rad"
        recorded[f"w{k + 1}_rad"] = f"gyros.increment_reading[{k + 1}]"
    for k in range(3):
        columns[f"f{k + 1}_mps2"] = 0.5 * (force[1:, k] + force[:-1, k])
        driven[f"gyros.specific_force[{k + 1}]"] = f"f{k + 1}_mps2"
    warm = raw.temperature
    if warm is None:
        warm = np.full(len(time), 20.0)
    columns["temperature_degC"] = np.interp(even, time, warm)[1:]
    driven["gyros.temperature"] = "temperature_degC"
    block: dict[str, Any] = {"bias": gyros[BIAS].tolist(), "scale_misalignment": gyros[MATRIX].tolist()}
    names = [parameters_of(place, values) for place, values in on_gyros]
    scenario = composed(
        "the turns of a bench record, simulated again",
        {"gyros": ("GyroBlock", {"gravity": STANDARD_GRAVITY, **block})},
        names,
        recorded,
        run={"step_s": period, "stop_s": (len(rows) - 1) * period},
        stimuli=[{"table": pl.DataFrame(columns), "stamp": "end", "columns": driven}],
    )
    increments = run_scenario(scenario).table.select(list(recorded)).to_numpy()
    sums = interpolated(time, even, np.cumsum(increments, axis=0))
    integrals = sums[fitted.turns.last] - sums[fitted.turns.first]
    for place, coefficients in effects.items():
        if place.definition.component == "AttitudeComputer":
            integrals = integrals + (travel.columns(place) @ coefficients).reshape(-1, 3)
    return integrals


def parameters_of(place: EffectPlace, values: Sequence[float]) -> dict[str, object]:
    """An effect as a scenario file writes it."""
    entry = dict(place.entry)
    for parameter, value in zip(place.definition.parameters, values, strict=True):
        entry[parameter.name] = float(value)
    return entry
