"""References of a carried attitude: gravity at the rests, or the true attitude.

A gyro whose reading is δω(t) too large turns the carried attitude. Over a piece from t₀ to t₁ the turn is C(t₀)ᵀ ∫ C (I
+ Γ)⁻¹ δω dt, in axes of the piece's beginning and to first order. Errors are computed less true: a reading that is too
large turns the carried attitude too far.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...models.arrays import Floats, Ints
from ...models.bench import EARTH_RATE
from ...models.effects import EffectPlace, Rows
from ..by_hand.small_turns import across
from ..motion.carry import GyroModel, Motion, matrices_of
from ..motion.inspect import Inspection
from ..motion.norm import COLUMNS, NAMES, ROWS, inputs_of, norm_block, norm_equations
from ..motion.rest_noise import RestNoise, factor_for, rest_lengths, rest_noise
from ..motion.rests import Rests
from ..motion.truth import MOST_PIECES, Usable, known_rows, usable_in, windows_between
from ..records import StrapdownRecord
from ..records.columns import INERTIAL
from ..records.noise import SCATTER_FACTOR
from ..records.turned import thinned
from .fit import coefficient_count
from .rows import Part, Pieces

CHUNK = 30_000
"""Rows at a time: the memory does not grow with the record."""
PART = 500
"""Rows whose products are summed at a time: they stay in the processor's own memory."""
LENGTHS = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Lengths of the windows [s]."""
FEWEST_WINDOWS = 8
"""A length with fewer windows is not used: they cannot be left out in blocks."""
TOGETHER = (1, 2, 3)
"""Moves between neighbouring rests, and over two and three rests."""
EARTH_AT_REST, EARTH_IN_MOTION = 1.0, 2.0
"""Multiples of Earth's rate that widen the bounds. With the gyros' bias free only its change between poses counts; with
the mean at rest removed it counts once there and once in the motion."""
Sized = Mapping[EffectPlace, tuple[float, ...]]
"""Effects with the values of their parameters."""


def force_deviation(inspection: Inspection) -> Floats:
    """Standard deviation (K, 3) of the accelerometers' means at rest [m/s²], flicker over the whole record included."""
    rests, record, period = inspection.rests, inspection.record, inspection.sampling.period
    assert rests.force_scatter is not None
    deviation = rests.force_scatter / SCATTER_FACTOR
    # A value that wanders from rest to rest may be an effect: only the rests themselves can decide.
    noise, lengths = rest_noise(record.specific_force, record.time_s, rests, period), rest_lengths(rests, period)
    return deviation if noise is None else np.maximum(deviation, np.sqrt(noise.rate_square(lengths)))


def truth_scatter(attitude: NDArray, rests: Rests, period: float, seconds: float, *, inertial: bool) -> float:
    """Return the largest turn of the true attitude (N, 4) between rows at a distance at rest [rad]; 0 where unknown.

    Of a shorter rest its ends: the errors of a reference do not grow with the time between. Against inertial space the
    steady turn of each rest is Earth's.
    """
    largest = 0.0
    for rows in rests.rows:
        apart = min(max(1, round(seconds / period)), rows.stop - rows.start - 1)
        first = np.arange(rows.start, rows.stop - apart)
        first = first[np.isfinite(attitude[[first, first + apart]]).all(axis=(0, 2))]
        turns = rotation_vectors(turned(Pieces("rests", "rest", first, first + apart), attitude))
        if inertial and len(turns):
            turns = turns - turns.mean(axis=0)
        largest = max(largest, float(np.abs(turns).max(initial=0.0)))
    return largest


@dataclass(frozen=True, eq=False)
class Run:
    """A run of the simulation through a record, with the derivatives by each coefficient.

    `attitude` (N, 4) as it was carried, scalar first. `rows` (B,): every row at which a piece begins or ends, in order.
    `integral` (B, 3, P + K): ∫ C (I + Γ)⁻¹ δω dt up to these rows, by each of the P = `own` parameters of the gyros and
    by each coefficient of their effects.
    """

    attitude: Floats
    rows: Ints
    integral: Floats
    own: int

    def columns(self, pieces: Pieces) -> Floats:
        """Signatures (S, 3, P + K) in axes of each piece's beginning."""
        before, after = (np.searchsorted(self.rows, at) for at in (pieces.first, pieces.last))
        start = matrices_of(self.attitude[pieces.first])
        return start.transpose(0, 2, 1) @ (self.integral[after] - self.integral[before])


def integrals(
    motion: Motion, model: GyroModel, attitude: NDArray, places: Sequence[EffectPlace], rows: NDArray
) -> Floats:
    """∫ C (I + Γ)⁻¹ δω dt from the first row to some rows (B,), per coefficient of all effects: (B, 3, K).

    The attitude (N, 4), scalar first, was carried with the model; the rows rise.
    """
    inverse = model.inverse
    sums: list[NDArray] = []
    total: NDArray | None = None
    for begin in range(1, len(motion), CHUNK):
        end = min(begin + CHUNK, len(motion))
        steps = motion.rows(begin, end, inverse, model.bias)
        signatures = [p.definition.signature(p, steps) for p in places]
        turn = turning(motion, model, attitude, begin, end)
        grown = np.zeros((3, sum(columns.shape[2] for columns in signatures)))
        if total is None:
            total = grown
            sums += [total] * int(np.searchsorted(rows, 1))
        within = rows[np.searchsorted(rows, begin) : np.searchsorted(rows, end)] + 1 - begin
        for first, last in pairwise((0, *within.tolist(), len(turn))):
            for part in range(first, last, PART):
                rows_of_part = slice(part, min(part + PART, last))
                turns = turn[rows_of_part] @ np.concatenate([columns[rows_of_part] for columns in signatures], axis=2)
                # Added to the next row: sums are those of all rows one after the other, to the last bit.
                turns[0] += grown
                grown = turns.sum(axis=0)
            sums.append(total + grown)
        # The last one is no row of those.
        total = sums.pop()
    return np.array(sums)


def turning(motion: Motion, model: GyroModel, attitude: NDArray, begin: int, end: int) -> Floats:
    """Return C (I + Γ)⁻¹ dt (n, 3, 3) of rows begin to end: the turn by a unit of error of each gyro."""
    after, before = attitude[begin:end], attitude[begin - 1 : end - 1]
    middle = after + before * np.sign(np.sum(after * before, axis=1, keepdims=True))
    return matrices_of(middle) @ model.inverse * motion.step[begin:end, None, None]


def means_at_rest(motion: Motion, model: GyroModel, places: Sequence[EffectPlace], rests: Sequence[slice]) -> Floats:
    """Return the change (3, K) [rad/s] of the gyros' mean over all rests by each coefficient."""
    total, count = np.zeros((3, sum(coefficient_count(place) for place in places))), 0
    for rows in rests:
        for begin in range(max(rows.start, 1), rows.stop, CHUNK):
            end = min(begin + CHUNK, rows.stop)
            steps = motion.rows(begin, end, model.inverse, model.bias)
            total += np.concatenate([p.definition.signature(p, steps).sum(axis=0) for p in places], axis=1)
            count += end - begin
    return total / max(count, 1)


def turned(pieces: Pieces, attitude: NDArray) -> Floats:
    """Rotation (S, 3, 3) of each piece by an attitude (N, 4): body at its end to body at its beginning."""
    return matrices_of(attitude[pieces.first]).transpose(0, 2, 1) @ matrices_of(attitude[pieces.last])


def rotation_vectors(rotation: NDArray) -> Floats:
    """Rotation vectors (S, 3) of matrices (S, 3, 3) [rad]."""
    return Rotation.from_matrix(rotation).as_rotvec() if len(rotation) else np.zeros((0, 3))


def all_rows(parts: Sequence[Pieces]) -> Ints:
    """Every row at which a piece begins or ends, in order."""
    ends = [rows for part in parts for rows in (part.first, part.last)]
    return np.unique(np.concatenate(ends)) if ends else np.zeros(0, dtype=int)


def force_columns(place: EffectPlace, n: NDArray, rests: Rests) -> Floats:
    """Signature (K, 3, k) of a static effect of the accelerometers at inputs (K, 3) [g]."""
    nothing = np.zeros_like(n)
    hours, angle = (rests.time_s - rests.time_s[:1]) / 3600.0, np.zeros(len(n))
    rows = Rows(hours, angle, angle, n, by_alpha=nothing, by_beta=nothing, temperature=rests.temperature)
    return place.definition.signature(place, rows)


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference of a carried attitude: `scored` are the pieces of each kind that judge the model.

    `noise` is the gyros'; None where the record leaves it open: bounds are then zero.
    """

    time_s: Floats
    rests: Rests
    noise: RestNoise | None
    scored: tuple[Pieces, ...]

    @property
    def rows(self) -> Ints:
        """Every row at which a piece begins or ends."""
        return all_rows(self.scored)

    def directions(self, x: NDArray, effects: Sized | None = None) -> Floats:
        """Directions (K, 3) at the rests, with accelerometers of nine parameters and effects, where needed."""
        return np.zeros((0, 3))

    def spread(self, pieces: Pieces) -> Floats:
        """Return the mean square (S,) of the pieces' turns by noise [rad²]."""
        return np.zeros(len(pieces)) if self.noise is None else self.noise.angle_square(pieces.durations(self.time_s))


@dataclass(frozen=True, eq=False)
class ByReadings:
    """Change of a part's pieces per unit error of the accelerometers' readings at the rests that they depend on.

    `rests` (S, E) are the numbers of these rests of each piece, `blocks` (S, d, E, 3) the changes.
    """

    rests: Ints
    blocks: Floats

    def of(self, added: NDArray) -> Floats:
        """Return the changes (S, d, k) by additions (K, 3, k) to the readings at all rests."""
        pieces, rows, rests, axes = self.blocks.shape
        at_rests = added[self.rests].reshape(pieces, rests * axes, added.shape[-1])
        return self.blocks.reshape(pieces, rows, rests * axes) @ at_rests

    def of_accelerometer(self, p: int, added: NDArray) -> Floats:
        """Return the changes (S, d, k) by additions (K, k) to the readings of one accelerometer."""
        return self.blocks[..., p] @ added[self.rests]


@dataclass(frozen=True, eq=False)
class Gravity(Reference):
    """Gravity is the reference: its direction at the rests, its size, and no turn of the block at rest.

    Pieces that are scored are moves over one, two and three rests. `ends` (S, 2) are the numbers of the rests at the
    ends of each; `still` are the rests without a gap. `reading` (K, 3) and `deviation` (K, 3) are the accelerometers'
    means and their standard deviation [g].
    """

    ends: tuple[Ints, ...]
    still: Pieces
    reading: Floats
    deviation: Floats

    @property
    def rows(self) -> Ints:
        """Every row at which a piece begins or ends."""
        return all_rows([self.still, *self.scored])

    def directions(self, x: NDArray, effects: Sized | None = None) -> Floats:
        """Return the directions (K, 3) at the rests, for nine parameters of the accelerometers and sizes of effects."""
        n = inputs_of(x, self.reading)
        for _ in range(2 if effects else 0):
            added = sum(force_columns(p, n, self.rests) @ np.array(v) for p, v in (effects or {}).items())
            n = inputs_of(x, self.reading - added)
        return n / np.linalg.norm(n, axis=1)[:, None]

    def across(self, number: int, up: NDArray, chosen: NDArray | slice = slice(None)) -> Floats:
        """Two unit vectors (S, 2, 3) across the directions (K, 3) before chosen moves of one kind."""
        return across(up[self.ends[number][chosen][:, 0]])

    def errors(
        self, number: int, rotation: NDArray, up: NDArray, frame: NDArray, chosen: NDArray | slice = slice(None)
    ) -> Floats:
        """Errors (S, 2) of directions after chosen moves of one kind, carried back by their rotations (S, 3, 3).

        `up` (K, 3) are the directions at the rests, `frame` (K, 3) those across which the errors are.
        """
        before, after = self.ends[number][chosen].T
        apart = np.einsum("sij,sj->si", rotation, up[after]) - up[before]
        return np.einsum("skp,sp->sk", self.across(number, frame, chosen), apart)

    def parts(self, run: Run, x: NDArray, places: Sequence[EffectPlace]) -> list[Part]:
        """Norms at the rests, turns at rest, moves, with the nine parameters `x` of the accelerometers.

        Parameters are the accelerometers' nine, then the gyros'; effects the gyros', then the accelerometers' static
        ones, at `places`.
        """
        n, up = inputs_of(x, self.reading), self.directions(x)
        by_parameters = np.zeros((len(n), 3, len(NAMES)))
        for k, (p, q) in enumerate(zip(ROWS, COLUMNS, strict=True)):
            by_parameters[:, p, k] = n[:, q]
        by_parameters[:, :, 6:] = np.eye(3)
        # An effect, or a parameter that is larger in truth, makes readings too large.
        forces = np.concatenate([by_parameters, *(force_columns(place, n, self.rests) for place in places)], axis=2)
        by_reading = self.of_readings(x, run.attitude)
        still, own, count = self.still, run.own, len(n)
        factor = factor_for(count + 3 * len(still) + 2 * sum(len(moves) for moves in self.scored))

        def part(pieces: Pieces, error: NDArray, bound: NDArray, by_rates: NDArray) -> Part:
            by_forces = by_reading[pieces.label].of(forces)
            nominal = np.concatenate([by_forces[..., : len(NAMES)], by_rates[..., :own]], axis=-1)
            columns = np.concatenate([by_rates[..., own:], by_forces[..., len(NAMES) :]], axis=-1)
            return Part(pieces, error, bound, nominal, columns, scored=pieces.kind == "moves")

        norm, _, of_norm = norm_equations(x, self.reading)
        deviation = np.sqrt((of_norm**2 * self.deviation**2).sum(axis=1))
        by_rates = np.zeros((count, 1, run.integral.shape[2]))
        norms = Pieces("norms", "norms", *_ends_of(self.rests))
        parts = [part(norms, norm[:, None], factor * deviation[:, None], by_rates)]
        if len(still):
            earth = EARTH_AT_REST * EARTH_RATE * still.durations(self.time_s)
            limit = factor * np.sqrt(self.spread(still)) + earth
            error = rotation_vectors(turned(still, run.attitude))
            parts.append(part(still, error, np.repeat(limit[:, None], 3, axis=1), run.columns(still)))
        for number, (moves, ends) in enumerate(zip(self.scored, self.ends, strict=True)):
            start, end = ends.T
            rotation = turned(moves, run.attitude)
            sideways = self.across(number, up)
            # An error e of the attitude moves the direction by e × u: along t by e · (u × t).
            by_rates = np.cross(up[start][:, None, :], sideways) @ run.columns(moves)
            at = by_reading[moves.label].blocks
            square = _square(at[:, :, 1], self.deviation[end])
            square = square + self.spread(moves)[:, None]
            square = square + _square(at[:, :, 0], self.deviation[start])
            limit = factor * np.sqrt(square) + EARTH_AT_REST * EARTH_RATE * moves.durations(self.time_s)[:, None]
            parts.append(part(moves, self.errors(number, rotation, up, up), limit, by_rates))
        return parts

    def of_readings(self, x: NDArray, attitude: NDArray) -> dict[str, ByReadings]:
        """Return the change of each part, by its label, per unit error of the readings at the rests.

        The attitude (N, 4) was carried; `x` are the nine parameters of the accelerometers.
        """
        n, up, inverse = inputs_of(x, self.reading), self.directions(x), np.linalg.inv(norm_block(x)[0])
        # Directions change with the inputs across them, over their size.
        size = np.linalg.norm(n, axis=1)[:, None, None]
        across_up = (np.eye(3) - up[:, :, None] * up[:, None, :]) / size @ inverse
        still = len(self.still)
        of_parts = {
            "norms": ByReadings(np.arange(len(n))[:, None], (up @ inverse)[:, None, None]),
            self.still.label: ByReadings(np.zeros((still, 0), dtype=np.int_), np.zeros((still, 3, 0, 3))),
        }
        for number, (moves, ends) in enumerate(zip(self.scored, self.ends, strict=True)):
            start, end = ends.T
            sideways = self.across(number, up)
            at_end = sideways @ turned(moves, attitude) @ across_up[end]
            blocks = np.stack([-sideways @ across_up[start], at_end], axis=2)
            of_parts[moves.label] = ByReadings(ends, blocks)
        return of_parts


def gravity_pieces(inspection: Inspection) -> tuple[Pieces, tuple[Pieces, ...], tuple[Ints, ...]]:
    """Rests without a gap; moves over one, two and three rests; numbers (S, 2) of the rests at the ends of each."""
    rests, usable = inspection.rests, usable_in(inspection.record, inspection.sampling)
    first, last = _ends_of(rests)
    whole_rests = np.flatnonzero(usable(first, last) & (last > first))
    still = Pieces("rests", "rests", first[whole_rests], last[whole_rests])
    moves, ends = [], []
    for together in TOGETHER:
        numbers = np.arange(max(0, len(rests) - together))
        begin, end = last[numbers], first[numbers + together]
        chosen = np.flatnonzero(usable(begin, end))
        if together > 1:
            chosen = thinned(chosen, MOST_PIECES)
        if len(chosen):
            label = "1 move" if together == 1 else f"{together} moves"
            moves.append(Pieces("moves", label, begin[chosen], end[chosen]))
            ends.append(np.column_stack([chosen, chosen + together]))
    return still, tuple(moves), tuple(ends)


@dataclass(frozen=True, eq=False)
class Truth(Reference):
    """The true attitude (N, 4) is the reference, NaN where it is not known, over windows of several lengths.

    `scatter` (L,) is, for each length, the largest turn of the true attitude between rows at that distance at rest
    [rad]. `stated` is the stated largest error at any row [rad]; None where it is taken from the rests. `inertial`:
    true if the attitude is against inertial space, so that Earth's rotation is in it.
    """

    attitude: Floats
    scatter: Floats
    stated: float | None = None
    inertial: bool = False

    @property
    def at_rest(self) -> float:
        """Error of the true attitude at a row at rest, from the differences between rows [rad]."""
        return 0.5 * float(self.scatter.max(initial=0.0))

    @property
    def of_windows(self) -> Floats:
        """Addition of the true attitude's errors to the bound of a window of each length (L,) [rad].

        A stated error counts at both ends, and never reduces the error that the record shows.
        """
        if self.stated is None:
            return self.scatter
        return np.full(len(self.scatter), 2.0 * max(self.stated, self.at_rest))

    def errors(
        self, number: int, rotation: NDArray, up: NDArray, frame: NDArray, chosen: NDArray | slice = slice(None)
    ) -> Floats:
        """Rotation vectors (S, 3) of the carried rotations (S, 3, 3) against the true ones of chosen windows [rad]."""
        true = turned(self.scored[number].selected(chosen), self.attitude)
        return rotation_vectors(rotation @ true.transpose(0, 2, 1))

    def parts(self, run: Run, x: NDArray, places: Sequence[EffectPlace]) -> list[Part]:
        """Return a part for each length; it has no rows of accelerometers."""
        factor = factor_for(3 * sum(len(windows) for windows in self.scored))
        parts = []
        for number, (windows, of_truth) in enumerate(zip(self.scored, self.of_windows, strict=True)):
            limit = np.zeros(len(windows))
            if self.noise is not None:
                seconds = windows.durations(self.time_s)
                earth = 0.0 if self.inertial else EARTH_IN_MOTION * EARTH_RATE
                limit = factor * np.sqrt(self.spread(windows)) + earth * seconds + of_truth
            error = self.errors(number, turned(windows, run.attitude), x, x)
            bound, columns = np.repeat(limit[:, None], 3, axis=1), run.columns(windows)
            parts.append(Part(windows, error, bound, columns[..., : run.own], columns[..., run.own :], scored=True))
        return parts


def has_truth(inspection: Inspection) -> bool:
    """Return whether a record holds the true attitude in any row."""
    return len(known_rows(inspection.record)) > 0


def is_inertial(record: StrapdownRecord) -> bool:
    """Return whether a record declares its true attitude as against inertial space."""
    key, value = INERTIAL
    return record.attitude is not None and record.about.get(key) == value


def without_earth(inspection: Inspection) -> Inspection:
    """Return the inspection of an inertial record with the true rate at rest removed from the gyros' means."""
    record, rests = inspection.record, inspection.rests
    if not is_inertial(record) or not len(rests):
        return inspection
    assert record.attitude is not None
    ends = Pieces("rests", "rests", *_ends_of(rests))
    true = rotation_vectors(turned(ends, record.attitude)) / ends.durations(record.time_s)[:, None]
    is_known = np.isfinite(true)
    rate = np.where(is_known, rests.rate - np.where(is_known, true, 0.0), rests.rate)
    return inspection.model_copy(update={"rests": rests.model_copy(update={"rate": rate})})


def truth_windows(inspection: Inspection) -> tuple[Pieces, ...]:
    """Return the windows of each length that the record holds often enough."""
    record, sampling = inspection.record, inspection.sampling
    rows, usable, period = known_rows(record), usable_in(record, sampling), sampling.period
    windows = [windows_of(rows, usable, period, seconds) for seconds in LENGTHS if seconds >= 4.0 * period]
    return tuple(pieces for pieces in windows if len(pieces) >= FEWEST_WINDOWS)


def windows_of(known: NDArray, usable: Usable, period: float, seconds: float) -> Pieces:
    """Return windows of one length, side by side, between rows (K,) with a known true attitude."""
    first, last = windows_between(known, usable, period, seconds).T
    return Pieces("windows", f"{seconds:g} s", first, last)


def _ends_of(rests: Rests) -> tuple[Ints, Ints]:
    """First and last rows (K,) of the rests."""
    first = np.array([rows.start for rows in rests.rows], dtype=int)
    return first, np.array([rows.stop - 1 for rows in rests.rows], dtype=int)


def _square(rows: NDArray, deviation: NDArray) -> NDArray:
    """Return the mean square (S, d) of rows (S, d, 3) of errors with deviations (S, 3)."""
    return np.einsum("sdp,sp->sd", rows**2, deviation**2)
