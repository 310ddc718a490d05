"""Stretches of a record in which the block stands still: the readings whose noise is identified."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fmus.units import STANDARD_GRAVITY
from ...models.arrays import Floats, Ints
from ..by_hand.still import TimedReadings, still_rests
from ..errors import InputError
from ..motion.rests import quiet_rests, rates_of, sampling_of
from ..records import RawRecord, StrapdownRecord, find_rests
from ..records.cut_off import cut_off, steps_hide_noise
from ..records.decisions import rows_of_rests
from ..records.kinds import BenchRecord, ForceRecord
from ..records.limits import rows_at_limit
from ..records.noise import sums_of
from ..records.stamps import grid_of
from ..rounding import digits, exactly
from .processes import Sensor

TimeSeries = StrapdownRecord | RawRecord | ForceRecord
ROUNDING = 1e-14
"""Relative difference below which readings are one value."""
FEWEST_ROWS = 64
"""Rows of a stretch, at least."""
SAME_POSE = 0.03
"""A block whose specific force changes by less than this part of its size keeps its pose."""
POSE_WINDOW = 1.0
"""Length of the windows whose median forces show the pose [s]."""
TURN_TIMES = (0.5, 1.0, 2.0, 5.0, 10.0)
"""Times within which the rate of a move changes [s]: that of a bias changes more slowly, or no more than usual."""
SLOW_TURN = 0.01
"""Change of the angle of turn from one such time to the next from which one that stands out is a move [rad]."""
OUTSTANDING = 8.0
"""A change this many times the usual one stands out: a wandering bias has none."""
WANDER = 0.05
"""Usual change of the angle beyond that of any bias, and angle of turn within a record that is too short to show the
usual one [rad]."""
FEWEST_WINDOWS = 16
"""Number of times in a record from which a usual value is computed."""
STILL_STRETCH = 60.0
"""Shortest stretch of a moved record that is a rest though its readings walk: no hand turns as slowly [s]."""
NORMAL = 1.4826
"""Standard deviation of normal values over the median of their sizes."""
LONG_GAP = 20
"""Lost rows beyond which a gap ends a stretch: fewer are closed up."""
SAME_STEP = 0.01
"""Largest relative difference of the sampling periods of records of one instrument."""
CUT_OFF = 0.02
"""Part of the readings at an end of the range from which noise would be told too small."""
KNOCKS = 10
"""Rows on both sides of a knock that are left out."""


@dataclass(frozen=True, eq=False)
class ChannelAtRest:
    """One channel at rest: its name, its sensor, its stretches (n,) in rad/s or m/s²."""

    name: str
    sensor: Sensor
    pieces: tuple[Floats, ...]

    @property
    def caution(self) -> str:
        """Return the properties of the noise that the readings leave open; empty where there are none."""
        if self.is_constant:
            return f"{self.name}: never changes at rest; its noise is unknown, and no result below counts it"
        if steps_hide_noise(self.pieces):
            return (
                f"{self.name}: its steps are wider than its noise; N is that of the readings, and a limit of the range "
                "would not show"
            )
        if cut_off(self.pieces) is not None:
            return (
                f"{self.name}: its readings end as at a limit of the range, or as those of bounded noise or a "
                "vibration do; at a limit its noise is larger"
            )
        return ""

    @property
    def is_constant(self) -> bool:
        """Return true if the readings repeat one value in each stretch, but for its rounding."""
        return all(np.ptp(piece) <= ROUNDING * np.abs(piece).max() for piece in self.pieces)


@dataclass(frozen=True, eq=False)
class AtRest:
    """Readings at rest of one or several records.

    Attributes
    ----------
    channels : tuple of ChannelAtRest
        gyros, if there are any, then accelerometers
    step : float
        time between readings [s]
    static : bool
        true if the whole record stands still, false if its rests are taken
    increments : bool
        true if the gyros gave increments
    """

    channels: tuple[ChannelAtRest, ...]
    step: float
    static: bool
    increments: bool

    @property
    def rows(self) -> int:
        """Return the rows of all stretches."""
        return sum(map(len, self.channels[0].pieces))

    @property
    def duration(self) -> float:
        """Return the length of all stretches [s]."""
        return self.rows * self.step

    @property
    def longest(self) -> float:
        """Return the length of the longest stretch [s]."""
        return max(map(len, self.channels[0].pieces)) * self.step


def at_rest(records: Sequence[TimeSeries], skip: float = 0.0) -> AtRest:
    """Return the readings at rest of records of one instrument.

    Parameters
    ----------
    records : sequence of StrapdownRecord, RawRecord or BenchRecord
        records with one sampling period
    skip : float
        time at the start of each record that is left out: warm-up [s]

    Raises
    ------
    InputError
        for a record without a rest, records of different periods, or rests that are too short
    """
    parts = []
    for record in records:
        parts.append(_of_record(record, skip))
    first = parts[0]
    for record, part in zip(records, parts, strict=True):
        if abs(part.step - first.step) > SAME_STEP * first.step:
            raise InputError(
                f"{record.path}: has a row every {exactly(part.step, 4)} s, {records[0].path} every "
                f"{exactly(first.step, 4)} s; give records of one rate"
            )
        if len(part.channels) != len(first.channels):
            raise InputError(f"{record.path}: has other channels than {records[0].path}; give records of one kind")
    channels = []
    for place, channel in enumerate(first.channels):
        pieces = [piece for part in parts for piece in part.channels[place].pieces]
        channels.append(ChannelAtRest(channel.name, channel.sensor, tuple(pieces)))
    static = all(part.static for part in parts)
    return AtRest(tuple(channels), first.step, static, first.increments)


def _of_record(record: TimeSeries, skip: float) -> AtRest:
    """Return the readings at rest of one record."""
    if len(record.time_s) < FEWEST_ROWS:
        raise InputError(
            f"{record.path}: has {len(record.time_s)} rows; a rest of {FEWEST_ROWS} rows at least is needed"
        )
    grid = grid_of(record.time_s)
    rows, static = _still_rows(record, grid.period)
    start = record.time_s[0] + skip
    kept = []
    for stretch in rows:
        kept += _without_gaps(record, stretch, grid.gaps[grid.lost > LONG_GAP], start)
    if not kept:
        length = FEWEST_ROWS * grid.period
        raise InputError(
            f"{record.path}: no rest of {FEWEST_ROWS} rows ({digits(length)} s) is in it; record the block at rest"
        )
    groups: list[tuple[Sensor, Floats]] = []
    rates = _rates(record, grid.period)
    if rates is not None:
        groups.append(("gyro", rates))
    groups.append(("accelerometer", record.specific_force))
    channels = []
    for sensor, values in groups:
        for axis in range(3):
            pieces = tuple(np.ascontiguousarray(values[stretch, axis]) for stretch in kept)
            _check_range(pieces, f"{record.path}: {sensor} {axis + 1}")
            channels.append(ChannelAtRest(f"{sensor} {axis + 1}", sensor, pieces))
    return AtRest(tuple(channels), grid.period, static, getattr(record, "increment", None) is not None)


def _check_range(pieces: Sequence[Floats], where: str) -> None:
    """Raise an InputError where readings are cut off at an end of the range: their noise looks smaller than it is."""
    cut = sum(int(rows_at_limit(piece).sum()) for piece in pieces)
    rows = sum(map(len, pieces))
    end = cut_off(pieces)
    if end is not None and end.certain:
        cut = max(cut, end.rows)
    if cut > CUT_OFF * rows:
        raise InputError(
            f"{where}: {cut} of {rows} readings at rest are at an end of its range; record it within the range"
        )


def _rates(record: TimeSeries, period: float) -> Floats | None:
    """Return rates (N, 3) [rad/s], of increments over one period; None without gyros."""
    if isinstance(record, StrapdownRecord | BenchRecord):
        if record.increment is not None:
            return record.increment / period
        return record.rate
    return None


def _still_rows(record: TimeSeries, period: float) -> tuple[list[slice], bool]:
    """Return the rows of each rest, and whether the block stands still throughout, in one stretch."""
    if record.decisions is not None and record.decisions.rests is not None:
        return rows_of_rests(record.time_s, record.decisions.rests, str(record.path)), False
    whole = slice(0, len(record))
    if isinstance(record, StrapdownRecord | ForceRecord):
        if _stands_still(record, whole, period):
            return [whole], True
        return _rests_of(record, period), False
    rests = find_rests(record)
    if len(rests) == 1 and rests[0].last - rests[0].first == len(record) - 1:
        return [whole], True
    return [rest.kept for rest in rests if rest.refused is None], False


def _rests_of(record: StrapdownRecord | ForceRecord, period: float) -> list[slice]:
    """Return the rows of the rests of a block that moves, among them long ones whose readings drift."""
    if isinstance(record, ForceRecord):
        return list(still_rests(TimedReadings(record.time_s, record.specific_force / STANDARD_GRAVITY)).rows)
    rests = quiet_rests(record, sampling_of(record))
    shortest = round(STILL_STRETCH / period)
    parts = [rows for rows in rests.rows if rows.stop - rows.start < shortest]
    for rows in (*rests.rows, *rests.walking_rows):
        if rows.stop - rows.start >= shortest:
            parts += _still_parts(record, rows, period)
    return sorted(parts, key=lambda rows: rows.start)


def _still_parts(record: StrapdownRecord, rows: slice, period: float) -> list[slice]:
    """Return a stretch if the block stands still in it, else what halving leaves of it."""
    if _stands_still(record, rows, period):
        return [rows]
    middle = (rows.start + rows.stop) // 2
    if (rows.stop - middle) * period < STILL_STRETCH:
        return []
    first, second = slice(rows.start, middle), slice(middle, rows.stop)
    return _still_parts(record, first, period) + _still_parts(record, second, period)


def _stands_still(record: StrapdownRecord | ForceRecord, rows: slice, period: float) -> bool:
    """Return true if the block keeps its pose in some rows, however much its biases drift or wander."""
    force = record.specific_force[rows]
    size = max(1, round(POSE_WINDOW / period))
    count = max(1, len(force) // size)
    medians = np.median(force[: count * size].reshape(count, -1, 3), axis=1)
    if not _same_pose(medians):
        return False
    return isinstance(record, ForceRecord) or not _turns(rates_of(record)[rows], period)


def _turns(rate: Floats, period: float) -> bool:
    """Return true if rates (n, 3) show a move.

    The rate of a move changes within seconds, and stands out. A bias wanders always alike, or drifts over minutes.
    """
    angle = period * sums_of(rate)
    if len(rate) * period < FEWEST_WINDOWS * TURN_TIMES[-1] and np.ptp(angle, axis=0).max() > WANDER:
        return True
    for time in TURN_TIMES:
        half = max(1, round(0.5 * time / period))
        turned = angle[2 * half :: half] - angle[: -2 * half : half]
        change = turned[4:] - 2.0 * turned[2:-2] + turned[:-4]
        if len(change) < FEWEST_WINDOWS:
            break
        usual = NORMAL * np.median(np.abs(change - np.median(change, axis=0)), axis=0)
        if usual.max() > WANDER or (np.abs(change) > np.maximum(SLOW_TURN, OUTSTANDING * usual)).any():
            return True
    return False


def _same_pose(means: Floats) -> bool:
    """Return true if specific forces (K, 3) are of one pose."""
    size = float(np.linalg.norm(means, axis=1).mean())
    return float(np.ptp(means, axis=0).max()) <= SAME_POSE * size


def _without_gaps(record: TimeSeries, stretch: slice, gaps: Ints, start: float) -> list[slice]:
    """Return the parts of a stretch between long gaps and knocks, from a time on [s]."""
    first = max(stretch.start, int(np.searchsorted(record.time_s, start)))
    cuts = [(int(gap) + 1, int(gap) + 1) for gap in gaps]
    cuts += [(int(row) - KNOCKS, int(row) + KNOCKS + 1) for row in np.flatnonzero(record.knocks)]
    parts = []
    for end, behind in sorted(cuts):
        if first < end < stretch.stop:
            parts.append(slice(first, end))
        if end < stretch.stop:
            first = max(first, behind)
    parts.append(slice(first, stretch.stop))
    return [part for part in parts if part.stop - part.start >= FEWEST_ROWS]
