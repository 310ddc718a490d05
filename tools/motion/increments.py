"""Input of the attitude computer from a record: uniform angle increments, bridged gaps, limits of trust.

Lost rows are put in on a line, with a bound of the attitude error that may cause. If the size of the motion's second
difference from row to row is at most c near the gap, the n rows on the line miss by at most c j (n + 1 - j) / 2 each, j
= 1 ... n. Attitudes turned by rates with these errors are apart by at most their sum, c n (n + 1)(n + 2) / 12, for any
motion: the integral of the error.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..records import StrapdownRecord
from ..records.limits import Limits, channel_limits
from ..records.stamps import grid_of
from ..result import Result
from ..rounding import exactly, upwards
from .rests import check_turns, mean_rates

JITTER = 0.01
"""Largest deviation of a row's time from the uniform grid that is none, in sampling periods."""
MOST_JITTER = 0.5
"""Largest deviation that is taken for jitter of the stamps: rates are then integrated over the intervals as logged."""
MOST_BRIDGED = 10
"""Most lost rows of a gap that is bridged."""
AROUND = 10
"""Rows that are compared on each side of a gap, beside as many as are lost."""
FEWEST_AROUND = 4
"""Least number of second differences that show the motion near a gap."""
ROOM = 2.0
"""Factor by which motion in a gap may bend more than around it. The rows around show nearly all of a motion without
frequencies above a tenth of the sampling one."""
SURE = 3.0
"""An increment holds the gap if it is this number of bounds from its prediction, and not from the sum over a whole
gap."""


class Bridge(Result):
    """A gap that was bridged: time of the row before it [s], rows that were put in, bound of the attitude error."""

    time_s: float
    rows: int
    bound: float = Field(alias="bound_rad")


def without_gaps(record: StrapdownRecord, most: int) -> tuple[StrapdownRecord, tuple[Bridge, ...]]:
    """A record with gaps of up to `most` lost rows bridged: readings on lines, the true attitude not known there.

    A row that was put in has the number of the row behind the gap. InputError for a gap of more rows, by its row, and
    where the rows around it do not show the motion.
    """
    if not 0 <= most <= MOST_BRIDGED:
        raise InputError(f"--bridge-gaps {most}: give a whole number of rows from 0 to {MOST_BRIDGED}")
    time = record.time_s
    between = np.diff(time)
    if not len(between):
        return record, ()
    grid = grid_of(time)
    usual, gaps, lost = grid.period, grid.gaps, grid.lost
    for k, count in zip(gaps, lost, strict=True):
        if count > most:
            way = "give a record without gaps"
            if count <= MOST_BRIDGED:
                way += f", or bridge it, with a bound of the error: --bridge-gaps {count}"
            raise InputError(
                f"{_row_behind(record, int(k))}: a gap of {exactly(float(between[k]), 6)} s before "
                f"{exactly(float(time[k + 1]), 9)} s, where rows come every {exactly(usual, 6)} s; {way}"
            )
    if not len(gaps):
        return record, ()
    bridges = []
    for k, count in zip(gaps, lost, strict=True):
        bridges.append(
            Bridge(time_s=float(time[k]), rows=int(count), bound_rad=_bound(record, int(k), int(count), usual))
        )
    bridges = tuple(bridges)
    # Fractional row numbers: a lost row lies a part of the way from one row to the next.
    numbers = np.arange(len(time), dtype=float)
    parts = []
    for k, count in zip(gaps, lost, strict=True):
        parts.append(k + np.arange(1, count + 1) / (count + 1))
    at = np.sort(np.concatenate([numbers, *parts]))
    measured = at == np.floor(at)

    def on_lines(values: NDArray | None) -> NDArray | None:
        if values is None:
            return None
        columns = []
        for column in values.reshape(len(numbers), -1).T:
            columns.append(np.interp(at, numbers, column))
        return np.stack(columns, axis=1).reshape(len(at), *values.shape[1:])

    attitude = None
    if record.attitude is not None:
        attitude = np.full((len(at), 4), np.nan)
        attitude[measured] = record.attitude
    names = ("time_s", "rate", "increment", "velocity_increment", "specific_force", "temperature")
    filled = {name: on_lines(getattr(record, name)) for name in names}
    row = record.row[np.ceil(at).astype(int)]
    return replace(record, **filled, attitude=attitude, row=row), bridges


def _bound(record: StrapdownRecord, before: int, count: int, period: float) -> float:
    """Bound of the attitude error of a bridge over `count` rows behind row `before` [rad]."""
    if record.increment is not None:
        turns = record.increment
    else:
        turns = period * np.asarray(record.rate)
    time, reach = record.time_s, AROUND + count
    first, last = max(before + 1 - reach, 0), min(before + 1 + reach, len(turns))
    near, at = turns[first:last], np.round((time[first:last] - time[first]) / period)
    if record.increment is not None:
        _check_increment(record, before, count)
    # Divided differences, times two: second differences of rows that are one period apart.
    slope = np.diff(near, axis=0) / np.diff(at)[:, None]
    bend = 2.0 * np.diff(slope, axis=0) / (at[2:] - at[:-2])[:, None]
    if len(bend) < FEWEST_AROUND:
        raise InputError(
            f"{_row_behind(record, before)}: too few rows around a gap to bound what bridging it may cause"
        )
    largest = ROOM * float(np.linalg.norm(bend, axis=1).max())
    return largest * count * (count + 1) * (count + 2) / 12.0


def _check_increment(record: StrapdownRecord, before: int, count: int) -> None:
    """Refuse a gap whose turn is not lost: the increment behind it covers the whole gap."""
    turns = np.asarray(record.increment)
    behind = turns[before + 1]
    around = turns[max(before - AROUND, 0) : before + 2 + AROUND]
    neighbours = np.delete(around, min(before, AROUND) + 1, axis=0)
    expected = 0.5 * (turns[before] + turns[min(before + 2, len(turns) - 1)])
    change = float(np.linalg.norm(np.diff(neighbours, axis=0), axis=1).max(initial=0.0))
    alone, spread = np.linalg.norm(behind - expected), np.linalg.norm(behind - (count + 1) * expected)
    if alone > SURE * change and spread < alone:
        raise InputError(
            f"{_row_behind(record, before)}: the increment behind a gap seems to hold the turn over all of it: nothing "
            "is lost; divide it among the rows"
        )


def _row_behind(record: StrapdownRecord, before: int) -> str:
    """Return the place that a message names: the row behind a gap."""
    return f"{record.path}, row {int(record.row[before + 1])}, column 'time_s'"


@dataclass(frozen=True)
class Increments:
    """Angle increments from a first row on: integrals (N, 3) of the body's rate over the intervals between rows [rad].

    The times (N + 1,) are uniform, one period apart: the first row's and the ends of the intervals [s]. `velocity`
    (N, 3) are the integrals of the specific force [m/s], of a record that has them.
    """

    period: float
    time_s: NDArray
    angle: NDArray
    velocity: NDArray | None = None


def sampling_period(record: StrapdownRecord) -> float:
    """Time between the rows of a uniform record [s].

    An InputError for fewer than two rows, or a time that is off the uniform grid by more than half the period.
    """
    time = record.time_s
    if len(time) < 2:
        raise InputError(f"{record.path}: has {len(time)} row; an attitude needs at least two")
    period = float(time[-1] - time[0]) / (len(time) - 1)
    off = off_the_grid(time)
    worst = int(np.argmax(np.abs(off)))
    if not abs(off[worst]) <= MOST_JITTER:
        raise InputError(
            f"{record.path}, row {int(record.row[worst])}, column 'time_s': {exactly(time[worst], 9)} s is "
            f"{exactly(100.0 * abs(off[worst]), 3)} % of the period ({exactly(period, 6)} s) off the uniform grid; "
            f"at most {exactly(100.0 * MOST_JITTER)} % is taken: give a uniformly sampled record, or "
            "--stamps even where the sensor samples evenly"
        )
    return period


def off_the_grid(time: NDArray) -> NDArray:
    """Return the departure of times (N,) from the uniform grid between first and last, in periods."""
    return (time - time[0]) / (time[-1] - time[0]) * (len(time) - 1) - np.arange(len(time))


def jitter_line(record: StrapdownRecord) -> list[str]:
    """Return a warning about stamps that jitter, if any."""
    worst = float(np.abs(off_the_grid(record.time_s)).max())
    if record.rate is None or worst <= JITTER:
        return []
    return [
        f"time stamps are up to {upwards(100.0 * worst)} % of the period off the uniform grid: rates are integrated "
        "over the intervals as logged"
    ]


def left_out_line(rows: int, algorithm: str, end: float) -> tuple[str, ...]:
    """Return a warning about last rows that fill no step of an algorithm, if any; the attitude ends at `end` [s]."""
    if not rows:
        return ()
    words = f"the last {rows} rows do" if rows > 1 else "the last row does"
    return (
        f"{words} not complete a step of {algorithm}; the attitude ends at {exactly(end, 9)} s. "
        "one-sample-rodrigues takes every row",
    )


def increments_from(
    record: StrapdownRecord,
    first: int,
    rates: str = "instantaneous",
    gyro_bias: Sequence[float] | NDArray | None = None,
) -> Increments:
    """Angle increments of the rows after row `first`, at which the attitude is known.

    Increments are taken as they are. Rates are integrated, less a bias [rad/s], with the meanings of `run_attitude`. An
    InputError for a record that is not uniform, is too short, or turns by more than half a turn between two rows.
    """
    period = sampling_period(record)
    count = len(record) - 1 - first
    if count < 1:
        raise InputError(
            f"{record.path}, row {int(record.row[first])}: the first known attitude is that of the last row; "
            "at least one row must follow it"
        )
    if record.increment is not None:
        angle = record.increment[first + 1 :]
    else:
        step = np.full(len(record) - 1, period)
        if np.abs(off_the_grid(record.time_s)).max() > JITTER:
            step = np.diff(record.time_s)
        angle = step[first:, None] * mean_rates(record, rates)[first:]
    if gyro_bias is not None:
        bias = np.asarray(gyro_bias, dtype=np.float64)
        if bias.shape != (3,) or not np.isfinite(bias).all():
            raise InputError("gyro_bias must be three finite numbers [rad/s], one for each gyro")
        angle = angle - period * bias
    check_turns(record, angle)
    time = record.time_s[0] + period * np.arange(first, len(record))
    velocity = record.velocity_increment
    return Increments(period, time, np.ascontiguousarray(angle), None if velocity is None else velocity[first + 1 :])


def coarser(increments: Increments, divisor: int) -> Increments:
    """Increments of a gyro that is sampled less often: every `divisor` of them added up.

    Those at the end that fill no sample are left out. An InputError for a divisor that is not positive, or more than
    there are increments.
    """
    count = len(increments.angle)
    if not 1 <= divisor <= count:
        raise InputError(f"--rate-divisor {divisor}: give a whole number from 1 to {count}, the record's increments")
    samples = count // divisor

    def added(values: NDArray) -> NDArray:
        return np.ascontiguousarray(values[: samples * divisor].reshape(samples, divisor, 3).sum(axis=1))

    time = increments.time_s[: samples * divisor + 1 : divisor]
    velocity = None
    if increments.velocity is not None:
        velocity = added(increments.velocity)
    return Increments(divisor * increments.period, time, added(increments.angle), velocity)


@dataclass(frozen=True)
class GyroInput:
    """Input to carry the attitude of a record, from the first row with a known true attitude.

    Attributes
    ----------
    record : StrapdownRecord
        with its gaps bridged
    first, start : int, list of 4 float
        index of that row, and the attitude there; of a record without true attitudes: 0, and the identity
    increments : Increments
        from there on
    bridges : tuple of Bridge
        gaps that were bridged behind it
    limits : Limits
        the readings that were taken and are at a limit
    worthless_from : float
        time from which on no attitude is to be trusted: a gyro was at its limit [s]; infinite where none was
    """

    record: StrapdownRecord
    first: int
    start: list[float]
    increments: Increments
    bridges: tuple[Bridge, ...]
    limits: Limits
    worthless_from: float

    @property
    def bridged_bound(self) -> float:
        """Bound of the attitude error from all bridges [rad]."""
        return float(sum(bridge.bound for bridge in self.bridges))

    @property
    def warnings(self) -> tuple[str, ...]:
        """Return the warnings on the record, its stamps and the gyros' limits."""
        limits = (line for line in self.limits.lines if line.startswith(("w", "dv")))
        return (*self.record.warnings, *jitter_line(self.record), *limits)

    def trusted_until(self, time: NDArray) -> float | None:
        """Return the last of some times (N,), the start first, with an attitude to trust [s]; None: all."""
        if self.worthless_from == np.inf:
            return None
        return float(time[time < self.worthless_from][-1])


def gyro_input(
    record: StrapdownRecord,
    rates: str,
    *,
    bridge_gaps: int = 0,
    gyro_bias: Sequence[float] | NDArray | None = None,
) -> GyroInput:
    """Return the input to carry a record's attitude; options and errors as of `run_attitude`."""
    limits, measured = channel_limits(record), record.time_s
    record, bridges = without_gaps(record, bridge_gaps)
    first, start = starting_attitude(record)
    increments = increments_from(record, first, rates, gyro_bias)
    begin, period = record.time_s[first], increments.period
    # An instantaneous rate at the first row counts, too.
    at_once = record.rate is not None and rates == "instantaneous"
    limited = limits.among(measured >= begin if at_once else measured > begin)
    late, worthless = limited.of("w"), np.inf
    if late.any():
        # Half a row earlier: logged times are off the grid by a little. The attitude at the start is known.
        worthless = max(float(measured[np.argmax(late)]), increments.time_s[0] + period) - 0.5 * period
    behind = []
    for bridge in bridges:
        if bridge.time_s >= begin:
            behind.append(bridge)
    behind = tuple(behind)
    return GyroInput(record, first, start, increments, behind, limited, worthless)


def starting_attitude(record: StrapdownRecord) -> tuple[int, list[float]]:
    """Index of the row to begin at, and the attitude there."""
    if record.attitude is not None:
        rows = np.flatnonzero(np.isfinite(record.attitude).all(axis=1))
        if rows.size:
            first = int(rows[0])
            return first, (record.attitude[first] / np.linalg.norm(record.attitude[first])).tolist()
    return 0, [1.0, 0.0, 0.0, 0.0]
