"""An observation: errors of pieces of a record as a linear functional of additions at ports over its rows.

Rests on a table, turns of a table and a carried block make one each. Different additions give the columns of effects,
of effects that set in or fade, and of unknown functions of a quantity.

An effect on the table turns the frame of its inner axis by small ψ(t) at given encoder readings. Between two moments
the block then turns by ψ₂ − ψ₁ + ∫ ω × ψ dt more, in axes of that frame. The reason: a frame that is turned by ψ itself
turns with ω + dψ/dt + ω × ψ. Effects of the gyros add their signatures, integrated.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ...models.bench import axes_of_turns, turning_of
from ...models.effects import CATALOGUE, STRAPDOWN_EFFECTS, EffectPlace, MotionRows, Rows
from ...models.effects.columns import small_turns
from ..calibration.model import Positions, predicted_input
from ..calibration.turns import WithTurns, motion_of, slopes_of
from ..compiled import COMPILES, FEW, compiled_and_kept
from ..records import BenchRecord, PositionRecord, RawRecord
from ..records.rests import without_turns
from .pairs import TURN
from .rows import Pieces

FINE = 0.01
"""So far [rad] the table turns from one row that is looked at to the next."""
IN_THE_MODEL = ("gyro-bias", "gyro-scale-misalignment", "gyro-g-sensitivity", "latency")
"""Effects that the calibration of the gyros has in it."""
CONTAINING = ("lag",)
"""Effects that these hold, to first order."""
OF_GYROS = ("GyroBlock", "AttitudeComputer")
"""Components that feel turns of the block without a move of the table: the gyros, and the computer that integrates
them."""
Weights = Sequence[tuple[Ints, Floats]]
"""Columns (R,) to which rows add, and how much (R,) of each."""


@dataclass(frozen=True, eq=False)
class Group:
    """Pieces of one kind; their errors (S, d) are `gain` (S, d, 3) times the sum between their first and last row.

    `mean` (S, d, 3) is the gain of the mean at rest that is removed from every row, None where none is removed.
    """

    pieces: Pieces
    gain: Floats
    mean: Floats | None = None

    def columns(self, sums: Floats, mean: Floats, first: Ints, last: Ints) -> Floats:
        """Return errors (S, d, K) by sums (B, 3, K), with the first and last sum of each piece, and a mean (3, K)."""
        errors = self.gain @ (sums[last] - sums[first])
        return errors if self.mean is None else errors - self.mean @ mean

    def since(self, sums: Floats, mean: Floats, row: int) -> Floats:
        """Return errors (S, d, K) by an addition that acts after a row, from its sums up to each row."""
        return self.columns(sums, mean, np.maximum(self.pieces.first, row), np.maximum(self.pieces.last, row))

    @property
    def largest(self) -> "Group":
        """Group that yields the largest errors: all rows of a piece and the mean at rest err in the same sense."""
        return Group(self.pieces, np.abs(self.gain), None if self.mean is None else -np.abs(self.mean))


@dataclass(frozen=True, eq=False)
class Observation:
    """Linear map from additions at P ports over R steps between rows to errors of pieces of a record.

    `adds` (R, 3, P) is the addition of a unit at each port to the sums of a step. `resting` (R,) marks the steps whose
    mean is taken. `ends` (R + 1, 3, P) is the addition of a unit at a row itself to the attitude of the block; None
    where there is none. Without groups each step is a piece by itself, with the additions there as its errors.
    """

    groups: tuple[Group, ...]
    adds: Floats
    resting: Bools | None = None
    ends: Floats | None = None

    def of(self, added: Floats) -> Floats:
        """Return the errors (M, K) by additions (R, P, K) to steps, or (R + 1, P, K) at the rows where these count."""
        if not self.groups:
            return (self.adds @ added).reshape(-1, added.shape[2])
        sums, mean, parts = self.sums(added), self.mean(added), []
        for group in self.groups:
            errors = group.columns(sums, mean, group.pieces.first, group.pieces.last)
            parts.append(errors.reshape(-1, errors.shape[2]))
        return np.concatenate(parts)

    def sums(self, added: Floats) -> Floats:
        """Return the sums (R + 1, 3, K) of the additions up to each row."""
        sums = np.zeros((len(self.adds) + 1, 3, added.shape[2]))
        if self.ends is None:
            np.cumsum(self.adds @ added, axis=0, out=sums[1:])
            return sums
        at_rows = np.einsum("rap,rpk->rak", self.ends, added)
        np.cumsum(self.adds @ (0.5 * (at_rows[1:] + at_rows[:-1])), axis=0, out=sums[1:])
        return at_rows + sums

    def mean(self, added: Floats) -> Floats:
        """Return the mean (P, K) of the additions over the rows at rest."""
        if self.resting is None or not self.resting.any():
            return np.zeros(added.shape[1:])
        return added[self.resting].mean(axis=0)

    @cached_property
    def boundaries(self) -> Ints:
        """Rows at which pieces begin or end, in order."""
        return boundaries_of(self.groups)

    def of_functions(self, weights: Weights, count: int, port: int) -> list[Floats]:
        """Return errors (S, d, count) of each group, of weights that add to some columns at one port."""
        sums = integrated(weights, count, self.adds[..., port], self.boundaries)
        mean = np.zeros((self.adds.shape[2], count))
        if self.resting is not None:
            for column, weight in weights:
                mean[port] += np.bincount(column[self.resting], weight[self.resting], count)
            mean[port] /= max(int(self.resting.sum()), 1)
        return errors_between(self.groups, self.boundaries, sums, mean)

    def on_knots(self, knots: NDArray, values: NDArray, times: NDArray | float, port: int) -> list[Floats]:
        """Return errors (S, d, k) of each group, of functions of values (R,) that are one at a single knot (k,), times
        a factor, at one port."""
        count, rows = len(knots), len(values)
        if not COMPILES or rows <= FEW:
            weights = [(knot, times * weight) for knot, weight in OnKnots(knots).weights(values)]
            return self.of_functions(weights, count, port)
        resting = np.zeros(0, dtype=bool) if self.resting is None else self.resting
        total, mean = np.zeros((2, 3, len(self.boundaries) + 1, count)), np.zeros((2, count))
        factor = np.ascontiguousarray(np.broadcast_to(times, rows), dtype=float)
        adds = self.adds[..., port]
        _add_on_knots(np.ascontiguousarray(values), factor, knots, adds, self.boundaries, resting, total, mean)
        sums = np.cumsum((total[0] + total[1])[:, :-1], axis=1).transpose(1, 0, 2)
        means = np.zeros((self.adds.shape[2], count))
        means[port] = (mean[0] + mean[1]) / max(int(resting.sum()), 1)
        return errors_between(self.groups, self.boundaries, sums, means)

    @cached_property
    def largest(self) -> "Observation":
        """Observation that yields the largest errors by additions of either sign."""
        return Observation(tuple(group.largest for group in self.groups), np.abs(self.adds), self.resting)


def boundaries_of(groups: Sequence[Group]) -> Ints:
    """Return the rows at which pieces of some groups begin or end, in order."""
    rows = np.zeros(0, dtype=int)
    for group in groups:
        rows = np.concatenate((rows, group.pieces.first, group.pieces.last))
    return np.unique(rows)


def errors_between(groups: Sequence[Group], boundaries: Ints, sums: Floats, mean: Floats) -> list[Floats]:
    """Return errors (S, d, K) of each group by sums (B, 3, K) up to the boundaries of its pieces and a mean (3, K)."""
    errors = []
    for group in groups:
        first, last = np.searchsorted(boundaries, group.pieces.first), np.searchsorted(boundaries, group.pieces.last)
        errors.append(group.columns(sums, mean, first, last))
    return errors


@dataclass(frozen=True, eq=False)
class OnKnots:
    """Functions that are straight between knots (k,); round a circle the last knot is the first."""

    knots: Floats
    circle: bool = False

    @property
    def count(self) -> int:
        """Number of functions that are one at a single knot."""
        return len(self.knots) - self.circle

    def weights(self, values: NDArray) -> Weights:
        """Return the knots before and after values (n,), and the weights of the function there."""
        values = values % TURN if self.circle else values
        after = np.clip(np.searchsorted(self.knots, values), 1, len(self.knots) - 1)
        share = (values - self.knots[after - 1]) / (self.knots[after] - self.knots[after - 1])
        return (after - 1, 1.0 - share), (after % self.count, share)

    def at(self, values: NDArray) -> Floats:
        """Return the functions (n, K) at values (n,)."""
        functions, rows = np.zeros((len(values), self.count)), np.arange(len(values))
        for knot, weight in self.weights(values):
            functions[rows, knot] += weight
        return functions


def integrated(weights: Weights, count: int, adds: NDArray, boundaries: NDArray) -> Floats:
    """Return the sums (B, 3, count), up to each boundary, of additions (R, 3) times weights, by column."""
    ends = len(boundaries) + 1
    # The number of boundaries before each row.
    until = np.repeat(np.arange(ends), np.diff(boundaries, prepend=0, append=len(adds)))
    total = np.zeros((3, ends * count))
    for column, weight in weights:
        cells = until * count + column
        for axis in range(3):
            total[axis] += np.bincount(cells, adds[:, axis] * weight, total.shape[1])
    return np.cumsum(total.reshape(3, ends, count)[:, :-1], axis=1).transpose(1, 0, 2)


@compiled_and_kept
def _add_on_knots(values, times, knots, adds, boundaries, resting, total, mean):
    """Add up what `OnKnots.weights` and `integrated` do, in one pass: at the knots before and after each value."""
    after, at = 1, 0
    for row in range(len(values)):
        while after < len(knots) - 1 and not knots[after] >= values[row]:
            after += 1
        while after > 1 and knots[after - 1] >= values[row]:
            after -= 1
        while at < len(boundaries) and boundaries[at] <= row:
            at += 1
        share = (values[row] - knots[after - 1]) / (knots[after] - knots[after - 1])
        for side in range(2):
            weight = times[row] * (share if side else 1.0 - share)
            knot = after - 1 + side
            for axis in range(3):
                total[side, axis, at, knot] += adds[row, axis] * weight
            if len(resting) and resting[row]:
                mean[side, knot] += weight


def observation_of_rests(rows: Rows, stage: str | None) -> Observation:
    """Return the observation, by readings at single rests, of additions at the ports of a stage."""
    return Observation((), rows.by_ports(stage))


# Turns of a table


def effects_in_motion() -> tuple[EffectPlace, ...]:
    """Effects of accelerometers and table that only motion shows; places of accelerometers belong to the model."""
    places: list[EffectPlace] = []
    for name, effect in CATALOGUE.items():
        if name != "lever-arm" and effect.in_motion and effect.component in ("AccelerometerBlock", "TurntableMotion"):
            places += effect.places
    return tuple(places)


IN_MOTION = effects_in_motion()


def acts_at_rest(place: EffectPlace) -> bool:
    """Return whether an effect acts at rest: on the table, or on accelerometers but not only in motion."""
    effect = place.definition
    return effect.component not in OF_GYROS and not (effect.in_motion and effect.component == "AccelerometerBlock")


def effects_of_gyros(*, with_temperature: bool) -> tuple[EffectPlace, ...]:
    """Return the linear effects that gyros on a table can show beyond their calibration.

    Effects of temperature are among them only where the record has it.
    """
    places: list[EffectPlace] = []
    for name, effect in STRAPDOWN_EFFECTS.items():
        if name in (*IN_THE_MODEL, *CONTAINING) or effect.component not in OF_GYROS:
            continue
        is_told = with_temperature or "temperature" not in effect.needs
        if effect.linear and not effect.of_law and is_told:
            places += effect.places
    return tuple(places)


def interpolated(at: NDArray, time: NDArray, values: NDArray) -> Floats:
    """Return values (N, k) at times (N,) interpolated at others (n,)."""
    return np.stack([np.interp(at, time, column) for column in values.T], axis=1)


def approached(record: PositionRecord, encoder_bound: float) -> PositionRecord:
    """Return a bench record's rests with the senses in which both axes came to them, by its moves."""
    raw, arrived = record.raw, [rest.kept_first for rest in record.rests if rest.refused is None]
    if raw is None or record.approach_alpha is not None or len(arrived) != len(record):
        return record
    outer, inner = moves_of(raw, encoder_bound)
    return replace(
        record,
        approach_alpha=senses_of_moves(outer[1:])[arrived],
        approach_beta=senses_of_moves(inner[1:])[arrived],
    )


def moves_of(raw: RawRecord, encoder_bound: float) -> Floats:
    """Return the move of both axes (2, T) at the rows of a series [rad a row]; 0 within an encoder's error [rad]."""
    moves = []
    for angle in (without_turns(raw.alpha), without_turns(raw.beta)):
        moves.append(np.where(motion_of(angle, encoder_bound) > 0.0, np.gradient(angle), 0.0))
    return np.stack(moves)


@dataclass(frozen=True, eq=False)
class Travel:
    """A table on its way through a bench record, at rows (R,) between which it turns by little or not at all.

    `hours` (R,); `alpha`, `beta` (R,) [rad]; `turning` (R - 1, 3) [rad] turns of the inner frame between them, in its
    axes; `step` (R - 1,) [s]. `up` (R, 3) is the vertical in block axes; `senses` (R, 2) those of each axis' last move;
    `axis_rates` (R, 2) [rad/s]; `temperature` (R,) [degC]. `first`, `last` (S,) are pieces by these rows; `coning` (S,
    3) as of `Turns`. `to_gyros` (3, 3) maps turns of the inner frame to the gyros' readings, `to_block` (3, 3) to block
    axes.
    """

    hours: Floats
    alpha: Floats
    beta: Floats
    turning: Floats
    step: Floats
    up: Floats
    senses: Floats
    axis_rates: Floats
    temperature: Floats | None
    first: Ints
    last: Ints
    coning: Floats
    to_gyros: Floats
    to_block: Floats
    shift: float
    lean: float
    gravity: float

    @staticmethod
    def of(raw: BenchRecord, fitted: WithTurns, encoder_bound: float, gravity: float) -> "Travel":
        """Return the path through a record with fitted gyros, bench and accelerometers; an encoder's error [rad]."""
        turns, x = fitted.turns, fitted.point[: fitted.own]
        angles = np.stack([without_turns(raw.alpha), without_turns(raw.beta)])
        moved = np.stack([motion_of(values, encoder_bound) for values in angles])
        # Rows at which pieces begin or end, and for each move a number of rows that grows with its turn.
        turned = np.floor(np.cumsum(moved.sum(axis=0)) / FINE)
        rows_kept = np.unique(
            np.concatenate([[0, turned.size - 1], turns.first, turns.last, np.flatnonzero(np.diff(turned))])
        )
        path = np.cumsum(moved, axis=1)[:, rows_kept]
        alpha, beta = angles[:, rows_kept]
        swing = np.where(np.diff(path, axis=1) > 0.0, np.diff(angles[:, rows_kept], axis=1), 0.0)
        targets = fitted.parametrisation.selection[0] @ x
        lean, middle = float(targets[2]), 0.5 * (beta[1:] + beta[:-1])
        turning = turning_of(middle, swing[0], swing[1], lean)
        at = Positions(alpha, beta, np.zeros(len(rows_kept), dtype=int))
        to_gyros = turns.jacobian_of_axes(targets, fitted.point[fitted.own :])
        return Travel(
            (raw.time_s[rows_kept] - raw.time_s[0]) / 3600.0,
            alpha,
            beta,
            turning,
            np.diff(raw.time_s[rows_kept]),
            predicted_input(fitted.parametrisation, x, at),
            np.stack([senses_of_moves(values) for values in swing], axis=1),
            np.stack([slopes_of(values, raw.time_s)[rows_kept] for values in angles], axis=1),
            None if raw.temperature is None else raw.temperature[rows_kept],
            np.searchsorted(rows_kept, turns.first),
            np.searchsorted(rows_kept, turns.last),
            turns.coning,
            to_gyros,
            turns.block_axes(targets),
            float(targets[1]),
            lean,
            gravity,
        )

    def columns(self, place: EffectPlace) -> Floats:
        """Return the columns (3 S, K) [rad] of an effect for the integrals of the gyros over all pieces."""
        if place.definition.component == "GyroBlock":
            return self.gyros.of(place.definition.signature(place, self.motion))
        if place.definition.component == "AttitudeComputer":
            # The attitude computer sums the record's own rows, independent of the table's motion between them.
            return -self.coning.reshape(-1, 1)
        if not place.definition.turns_table:
            return np.zeros((3 * len(self.first), len(place.definition.linear_parameters)))
        return self.table.of(small_turns(place.definition, place, self.rows))

    @cached_property
    def gyros(self) -> Observation:
        """Observation by the pieces of additions to the gyros' rates over the steps."""
        unit = np.broadcast_to(np.eye(3), (len(self.first), 3, 3))
        pieces = Pieces("turns", "turns", self.first, self.last)
        return Observation((Group(pieces, unit),), self.step[:, None, None] * np.eye(3))

    @cached_property
    def table(self) -> Observation:
        """Observation by the pieces of small turns at the rows, and of the turns that follow as the frame turns."""
        (group,) = self.gyros.groups
        gain = np.broadcast_to(self.to_gyros, group.gain.shape)
        across = np.cross(self.turning[:, None, :], np.eye(3)).transpose(0, 2, 1)
        return Observation((replace(group, gain=gain),), across, ends=np.moveaxis(self.axes, 0, 2))

    @cached_property
    def rows(self) -> Rows:
        """The way as effects on the table see it."""
        nothing = np.zeros((len(self.hours), 3))
        return Rows(
            hours=self.hours,
            alpha=self.alpha - self.shift,
            beta=self.beta,
            n=self.up,
            by_alpha=nothing,
            by_beta=nothing,
            temperature=self.temperature,
            sense_alpha=self.senses[:, 0],
            sense_beta=self.senses[:, 1],
            from_vertical=self.shift,
            axis_rates=self.axis_rates,
        )

    @cached_property
    def axes(self) -> Floats:
        """The axes (7, R, 3) of small turns, of the table and of the block, in those of the inner frame."""
        of_table = axes_of_turns(self.alpha - self.shift, self.beta, self.lean)
        of_block = np.broadcast_to(self.to_block[:, None, :], (3, *of_table.shape[1:]))
        return np.concatenate([of_table, of_block])

    def turned(self, functions: OnKnots, values: NDArray, slope: NDArray) -> Floats:
        """Return the change (3 S, K) [rad] of the integrals by small turns: slope (R, 3) times functions of (R,)."""
        middle = 0.5 * (slope[1:] + slope[:-1])
        weights, count = functions.weights(0.5 * (values[1:] + values[:-1])), functions.count
        across, ends = np.cross(self.turning, middle), np.unique(np.append(self.first, self.last))
        sums = integrated(weights, count, across, ends)
        sums += slope[ends, :, None] * functions.at(values[ends])[:, None, :]
        begin, end = np.searchsorted(ends, self.first), np.searchsorted(ends, self.last)
        (group,) = self.table.groups
        return group.columns(sums, np.zeros((3, count)), begin, end).reshape(-1, count)

    @cached_property
    def motion(self) -> MotionRows:
        """The steps of the way as the gyros see them, at the rates that the table gives."""
        rate = self.turning @ self.to_block.T / self.step[:, None]
        # Between distant rows a table comes to rest: the rates at the rows give the change.
        at_rows = turning_of(self.beta, self.axis_rates[:, 0], self.axis_rates[:, 1], self.lean) @ self.to_block.T
        return MotionRows(
            rate=rate,
            rate_before=rate - np.diff(at_rows, axis=0),
            specific_force=0.5 * (self.up[1:] + self.up[:-1]),
            hours=0.5 * (self.hours[1:] + self.hours[:-1]),
            step=self.step,
            temperature=None if self.temperature is None else self.temperature[1:],
            gravity=self.gravity,
            response=self.to_gyros @ np.linalg.inv(self.to_block),
        )


def senses_of_moves(swing: NDArray) -> Floats:
    """Return the sense (R,) of an axis' last move, by its turns (R - 1,) between rows; 0 before the first move."""
    last = np.maximum.accumulate(np.where(swing != 0.0, np.arange(len(swing)), -1))
    return np.append(0.0, np.where(last >= 0, np.sign(swing[last]), 0.0))
