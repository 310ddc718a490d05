"""Stretches of a record in which the block stands still: the readings whose noise is told."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..by_hand.still import Series, still_rests
from ..errors import InputError
from ..motion.rests import quiet_rests, rates_of, sampling_of
from ..records import RawRecord, StrapdownRecord, find_rests
from ..records.decisions import rows_of_rests
from ..records.kinds import BenchRecord, ForceRecord
from ..records.stamps import grid_of
from ..rounding import digits, exactly
from .processes import Sensor

TimeSeries = StrapdownRecord | RawRecord | ForceRecord
FEWEST_ROWS = 64
"""Rows of a stretch, at least."""
SAME_POSE = 0.03
"""Rests whose mean specific forces differ by less than this part of their size are of one pose."""
STILL = 0.05
"""A block of one pose whose angle of turn between rests stays below this stands still throughout [rad]."""
LONG_GAP = 20
"""Lost rows beyond which a gap ends a stretch: fewer are closed up."""
SAME_STEP = 0.01
"""Largest relative difference of the sampling periods of records of one instrument."""
KNOCKS = 10
"""Rows on both sides of a knock that are left out."""


@dataclass(frozen=True, eq=False)
class Channel:
    """One channel at rest: its name, its sensor, its stretches (n,) in rad/s or m/s²."""

    name: str
    sensor: Sensor
    pieces: tuple[NDArray[np.float64], ...]


@dataclass(frozen=True, eq=False)
class AtRest:
    """Readings at rest of one or several records.

    Attributes
    ----------
    channels : tuple of Channel
        gyros, if there are any, then accelerometers
    step : float
        time between readings [s]
    static : bool
        true if the whole record stands still, false if its rests are taken
    increments : bool
        true if the gyros gave increments
    """

    channels: tuple[Channel, ...]
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
        channels.append(Channel(channel.name, channel.sensor, tuple(pieces)))
    static = all(part.static for part in parts)
    return AtRest(tuple(channels), first.step, static, first.increments)


def _of_record(record: TimeSeries, skip: float) -> AtRest:
    """Return the readings at rest of one record."""
    grid = grid_of(record.time_s)
    rows, static = _still_rows(record)
    start = record.time_s[0] + skip
    kept = []
    for stretch in rows:
        kept += _without_gaps(record, stretch, grid.gaps[grid.lost > LONG_GAP], start)
    if not kept:
        length = FEWEST_ROWS * grid.period
        raise InputError(
            f"{record.path}: no rest of {FEWEST_ROWS} rows ({digits(length)} s) is in it; record the block at rest"
        )
    groups: list[tuple[Sensor, NDArray[np.float64]]] = []
    rates = _rates(record, grid.period)
    if rates is not None:
        groups.append(("gyro", rates))
    groups.append(("accelerometer", record.specific_force))
    channels = []
    for sensor, values in groups:
        for axis in range(3):
            pieces = tuple(np.ascontiguousarray(values[stretch, axis]) for stretch in kept)
            channels.append(Channel(f"{sensor} {axis + 1}", sensor, pieces))
    return AtRest(tuple(channels), grid.period, static, getattr(record, "increment", None) is not None)


def _rates(record: TimeSeries, period: float) -> NDArray[np.float64] | None:
    """Return rates (N, 3) [rad/s], of increments over one period; None without gyros."""
    if isinstance(record, StrapdownRecord | BenchRecord):
        if record.increment is not None:
            return record.increment / period
        return record.rate
    return None


def _still_rows(record: TimeSeries) -> tuple[list[slice], bool]:
    """Return the rows of each rest, and whether the block stands still throughout, in one stretch."""
    if record.decisions is not None and record.decisions.rests is not None:
        return rows_of_rests(record.time_s, record.decisions.rests, str(record.path)), False
    if isinstance(record, ForceRecord):
        still = still_rests(Series(record.time_s, record.specific_force / STANDARD_GRAVITY))
        if len(still) and _same_pose(still.force):
            return [slice(0, len(record))], True
        return list(still.rows), False
    if not isinstance(record, StrapdownRecord):
        rests = [rest.kept for rest in find_rests(record) if rest.refused is None]
        return rests, len(rests) == 1
    rests = quiet_rests(record, sampling_of(record))
    rows = list(rests.rows)
    if len(rests) == 0 or not _one_pose(record, rows):
        return rows, False
    return [slice(0, len(record))], True


def _one_pose(record: StrapdownRecord, rests: Sequence[slice]) -> bool:
    """Return true if all rests have one pose and the block does not turn between them."""
    if not _same_pose(np.stack([record.specific_force[rows].mean(axis=0) for rows in rests])):
        return False
    rate = rates_of(record)
    level = np.median(np.concatenate([rate[rows] for rows in rests]), axis=0)
    angle = np.cumsum((rate[1:] - level) * np.diff(record.time_s)[:, None], axis=0)
    # a wandering bias turns slowly: the turn within each tenth of the record counts
    parts = np.array_split(angle, 10)
    return all(float(np.ptp(part, axis=0).max(initial=0.0)) < STILL for part in parts)


def _same_pose(means: NDArray[np.float64]) -> bool:
    """Return true if the mean specific forces (K, 3) of rests are of one pose."""
    size = float(np.linalg.norm(means, axis=1).mean())
    return float(np.ptp(means, axis=0).max()) <= SAME_POSE * size


def _without_gaps(record: TimeSeries, stretch: slice, gaps: NDArray[np.int_], start: float) -> list[slice]:
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
