"""The rests of a table run: stretches over which both encoders keep their level, tested, and averaged to positions."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError
from ..rounding import digits
from .cut_off import limited_rests
from .decisions import rows_of_rests
from .kinds import PositionRecord, RawRecord, Rest
from .noise import (
    BLOCKS,
    LinearTrend,
    dwell_noise,
    mean_of,
    scatter_about_line,
    scatter_of_mean,
    settled_from,
    still_settling,
    trend_of,
)

WINDOW = 8
"""Rows of the shortest stretch that can be told from a slow move."""

LEAST_TOLERANCE = math.radians(5 / 3600)
"""Spread of an encoder's readings that never counts as motion [rad]."""

GREATEST_TOLERANCE = math.radians(5 / 60)
"""No stretch with a greater spread is a rest [rad]: readings averaged over it would be wrong by 3e-7 g."""

COARSEST_ENCODER = math.radians(2 / 60)
"""A step of the reading above this is a move, not the last digit of an encoder [rad]."""

SHORTEST = 0.25
"""A rest lasts at least this part of the median rest."""

ROUNDING = 1e-12 * STANDARD_GRAVITY
"""Differences of readings that arithmetic alone may make [m/s²]."""

UNSETTLED = 1.0 / 3.0
"""A rest may still be settling where less than this multiple of the dropped part is left."""

UNUSUAL = 8.0
"""A drift that exceeds the median rest's by this factor belongs to its rest alone."""

FEWEST_COMPARED = 4
"""Fewer rests do not show a usual drift."""

UNSEEN_ANGLE = math.radians(0.1 / 3600)
"""Changes of an angle that make no difference to a reading [rad]."""

_MOVED = math.radians(5 / 60)
"""An axis has moved when its reading was so far from the rest's level [rad]."""

_AXES = ("outer", "inner")
_ARCSEC = math.radians(1 / 3600)


def find_rests(raw: RawRecord) -> list[Rest]:
    """Find the rests of the table and test each of them.

    Both encoder readings must keep their level within the record's own quiet scatter, for at least 8 rows and
    a quarter of the median rest. The unsettled start is dropped by a test of the readings themselves. Linear trends of
    angles and readings are tested. One of an angle beyond the quiet scatter refuses the rest; so does one of a reading
    that is beyond the rest's scatter and unlike the record's other rests. The others are stated. The rests come in the
    order of time, refused ones included. Rests that a person decided are tested only.
    """
    if len(raw) < WINDOW:
        return []
    angles = angles_of(raw)
    tolerance = np.array([quiet_tolerance(angles[:, k]) for k in range(2)])
    if raw.decisions is not None and raw.decisions.rests is not None:
        decided = rows_of_rests(raw.time_s, raw.decisions.rests, str(raw.path))
        return [tested(raw, angles, tolerance, rows.start, rows.stop - 1) for rows in decided]
    stops = find_stops(angles, tolerance)
    if not stops:
        return []
    edges = np.array(stops)
    duration = raw.time_s[edges[:, 1]] - raw.time_s[edges[:, 0]]
    median = _median_by_rows(duration, edges[:, 1] - edges[:, 0] + 1)
    rests = []
    for (first, last), lasts in zip(stops, duration.tolist(), strict=True):
        if lasts > SHORTEST * median:
            rests.append(tested(raw, angles, tolerance, first, last))
        else:
            why = f"lasts {digits(lasts)} s, no more than a quarter of the median rest of {digits(median)} s"
            rests.append(Rest(first, last, first, last, refused=why))
    return _without_limited(raw, _without_unusual_drifts(raw, rests))


def average_rests(raw: RawRecord, rests: Sequence[Rest]) -> PositionRecord:
    """Average the rows kept of each rest that is not refused; an InputError when no rest can be used.

    `time_s` is the middle of the averaging interval, `row` the line of its first row. The approach columns are there
    when every rest was preceded by a move of that axis. `scatter` is each mean's standard error.
    """
    averaged = []
    for rest in rests:
        if rest.refused is None:
            averaged.append(rest)
    if not averaged:
        why = f"the angles keep their level nowhere for {WINDOW} rows"
        if rests:
            further = ""
            if len(rests) > 1:
                further = ", and others"
            why = f"row {raw.row[rests[0].first]}: {rests[0].refused}" + further
        raise InputError(f"{raw.path}: no rest of the table can be averaged: {why}")
    angles = angles_of(raw)
    slices = [rest.kept for rest in averaged]
    begins, ends = np.array([(rest.kept_first, rest.kept_last) for rest in averaged]).T

    def means(values: NDArray) -> NDArray:
        return np.array([mean_of(values[rows]) for rows in slices])

    # the encoder's own turn again, so that angles stand as they were read
    turns = np.stack([raw.alpha, raw.beta], axis=1) - angles
    mean_angle = means(angles) + turns[begins]
    temperature = None
    if raw.temperature is not None:
        temperature = means(raw.temperature)
    return PositionRecord(
        position=np.arange(1, len(averaged) + 1),
        time_s=0.5 * (raw.time_s[begins] + raw.time_s[ends]),
        alpha=mean_angle[:, 0],
        beta=mean_angle[:, 1],
        specific_force=means(raw.specific_force),
        temperature=temperature,
        approach_alpha=_approach(angles[:, 0], averaged),
        approach_beta=_approach(angles[:, 1], averaged),
        resolution=raw.resolution,
        row=raw.row[begins],
        path=raw.path,
        sha256=raw.sha256,
        about=raw.about,
        channels=raw.channels,
        warnings=raw.warnings + _said(raw, rests),
        scatter=np.array([scatter_of_mean(raw.specific_force[rows]) for rows in slices]),
        dwell_noise=dwell_noise(raw, slices),
        raw=raw,
        rests=tuple(rests),
        decisions=raw.decisions,
    )


def position_record_of(raw: RawRecord) -> PositionRecord:
    """The rests of a raw record found and averaged; errors as `average_rests`."""
    return average_rests(raw, find_rests(raw))


def tested(raw: RawRecord, angles: NDArray, tolerance: NDArray, first: int, last: int) -> Rest:
    """Drop the unsettled rows, then test the others for length and for trends."""
    # a row beside a move may hold a reading taken while the table still moved
    start, end = first, last
    if first > 0:
        start = first + 1
    if last < len(raw) - 1:
        end = last - 1
    floor, angle_floor = reading_floor(raw), np.full(2, UNSEEN_ANGLE)
    knocked = np.flatnonzero(raw.knocks[start : end + 1])
    if knocked.size:
        return Rest(first, last, start, end, refused=f"a knock in row {raw.row[start + int(knocked[0])]}")
    half = slice((start + end) // 2, end + 1)
    half_lasts = f"in its last {_lasts(raw, half)}"
    turning = trend_of(raw.time_s[half], angles[half], angle_floor)
    for axis in np.flatnonzero(turning.significant & (np.abs(turning.change) > tolerance))[:1]:
        return Rest(first, last, start, end, refused=f"the {_turning(axis, turning)} {half_lasts}")

    values = np.concatenate([raw.specific_force[start : end + 1], angles[start : end + 1]], axis=1)
    dropped = _dropped(raw.time_s[start : end + 1], values, np.concatenate([floor, angle_floor]))
    start += dropped
    count = end - start + 1
    if count < WINDOW - 2:
        return Rest(first, last, start, end, refused=f"has not settled before its last {count} rows")
    if count < UNSETTLED * dropped and still_settling(raw.time_s[half], raw.specific_force[half], floor):
        why = f"has not settled: how fast the readings change still changes {half_lasts}"
        return Rest(first, last, start, end, refused=why)

    rows = slice(start, end + 1)
    turning = trend_of(raw.time_s[rows], angles[rows], angle_floor)
    drifting = trend_of(raw.time_s[rows], raw.specific_force[rows], floor)
    trends = [_turning(axis, turning) for axis in np.flatnonzero(turning.significant)]
    trends += [
        f"f{axis + 1} drifts by {digits(drifting.change[axis] / STANDARD_GRAVITY, 2)} g"
        for axis in np.flatnonzero(drifting.significant)
    ]
    trends_in_words = []
    for text in trends:
        trends_in_words.append(f"{text} in {_lasts(raw, rows)}")
    return Rest(first, last, start, end, trends=tuple(trends_in_words))


def _without_unusual_drifts(raw: RawRecord, rests: list[Rest]) -> list[Rest]:
    """Refuse rests in which a reading drifts as it does in none of the others, and by more than it scatters."""
    places = []
    for k, rest in enumerate(rests):
        if rest.refused is None:
            places.append(k)
    if len(places) < FEWEST_COMPARED:
        return rests
    trends, rates = [], []
    for k in places:
        time = raw.time_s[rests[k].kept]
        trends.append(trend_of(time, raw.specific_force[rests[k].kept], reading_floor(raw)))
        rates.append(np.abs(trends[-1].change) / (time[-1] - time[0]))
    usual = np.median(rates, axis=0)
    for k, trend, rate in zip(places, trends, rates, strict=True):
        rows = rests[k].kept
        for axis in np.flatnonzero(trend.significant & (rate > UNUSUAL * usual)):
            change = trend.change[axis]
            if abs(change) > scatter_about_line(raw.time_s[rows], raw.specific_force[rows, axis]):
                why = f"f{axis + 1} drifts linearly by {digits(change / STANDARD_GRAVITY, 2)} g in {_lasts(raw, rows)}"
                often = ""
                if usual[axis] > 0.0:
                    often = f", {digits(rate[axis] / usual[axis], 2)} times the median"
                rests[k] = replace(rests[k], refused=f"{why}{often}: a trend, which other rests do not have")
                break
    return rests


def _without_limited(raw: RawRecord, rests: list[Rest]) -> list[Rest]:
    """Refuse rests in which an accelerometer is at an end of its range: the mean of its readings is wrong."""
    usable = [k for k, rest in enumerate(rests) if rest.refused is None]
    limited = limited_rests(raw.specific_force, [rests[k].kept for k in usable], [raw.alpha, raw.beta])
    for k, axes in zip(usable, limited, strict=True):
        if axes.any():
            rests[k] = replace(rests[k], refused=f"f{np.argmax(axes) + 1} is at an end of its range")
    return rests


def _dropped(time: NDArray, values: NDArray, floor: NDArray) -> int:
    """Return the number of unsettled rows, measured from a linear drift where there is one, else from a level.

    A drift counts if it does not bend and outlasts the rows dropped before it; otherwise it is the tail of a transient.
    """
    start = settled_from(values, floor, drifts=True)
    while len(values) - start >= WINDOW and UNSETTLED * (len(values) - start) >= start:
        if not still_settling(time[start:], values[start:], floor):
            return start
        start += max(1, len(values) // BLOCKS)
    return settled_from(values, floor)


def angles_of(raw: RawRecord) -> NDArray:
    """Both encoder readings without jumps by whole turns, shape (N, 2) [rad]."""
    return np.stack([without_turns(raw.alpha), without_turns(raw.beta)], axis=1)


def reading_floor(raw: RawRecord) -> NDArray:
    """Changes of the readings (3,) that rounding may make [m/s²]."""
    return np.full(3, max(2.0 * raw.resolution, ROUNDING))


def _turning(axis: int | np.integer, trend: LinearTrend) -> str:
    return f"{_AXES[axis]} axis turns by {digits(float(trend.change[axis] / _ARCSEC), 2)} arcsec"


def _lasts(raw: RawRecord, rows: slice) -> str:
    return f"{digits(float(raw.time_s[rows.stop - 1] - raw.time_s[rows.start]))} s"


def _median_by_rows(duration: NDArray, rows: NDArray) -> float:
    """Return the duration for which half the rows of all stops belong to stops at least that long.

    Many short pieces of a slow motion do not pull it down as they would a plain median.
    """
    order = np.argsort(duration, kind="stable")
    below = np.cumsum(rows[order])
    return float(duration[order[np.searchsorted(below, 0.5 * below[-1])]])


def _approach(angle: NDArray, rests: Sequence[Rest]) -> NDArray | None:
    """Sense of the last move of one axis before each rest, +1 or -1; None when a rest has none before it."""
    senses: list[float] = []
    searched = 0
    for rest in rests:
        level = float(mean_of(angle[rest.kept_first : rest.kept_last + 1]))
        # far outside the scatter of a rest and the overshoot of the servo
        away = np.flatnonzero(np.abs(angle[searched : rest.first] - level) > _MOVED)
        if away.size:
            senses.append(math.copysign(1.0, level - float(angle[searched + int(away[-1])])))
        elif senses:
            senses.append(senses[-1])
        else:
            return None
        searched = rest.first
    return np.array(senses)


def _said(raw: RawRecord, rests: Sequence[Rest]) -> tuple[str, ...]:
    """One line for each refused rest and one for the trends, at most ten of the former."""
    refused = [rest for rest in rests if rest.refused is not None]
    lines = [
        f"{raw.path}: rest in rows {raw.row[rest.first]} to {raw.row[rest.last]} left out: {rest.refused}"
        for rest in refused[:10]
    ]
    if len(refused) > len(lines):
        lines.append(f"{raw.path}: {len(refused) - len(lines)} more rests left out")
    drifting = [rest for rest in rests if rest.refused is None and rest.trends]
    if drifting:
        rest = drifting[0]
        lines.append(
            f"{raw.path}: a linear trend in {len(drifting)} of {len(rests)} rests, first in rows "
            f"{raw.row[rest.kept_first]} to {raw.row[rest.kept_last]}: {', '.join(rest.trends)}"
        )
    return tuple(lines)


def without_turns(angle: NDArray) -> NDArray:
    """The angle without the jumps by whole turns that an encoder makes at its zero, shape (N,) [rad]."""
    turns = np.rint(np.diff(angle) / (2.0 * math.pi))
    result = angle.copy()
    result[1:] -= np.cumsum(turns) * (2.0 * math.pi)
    return result


def smallest_step(angle: NDArray) -> float:
    """The smallest change of an encoder's reading from row to row that is not a move [rad]; infinite where none is."""
    steps = np.abs(np.diff(angle))
    return float(steps[(steps > 0.0) & (steps <= COARSEST_ENCODER)].min(initial=math.inf))


def quiet_tolerance(angle: NDArray, step: float | None = None) -> float:
    """Spread of one encoder's readings over a rest, from the record's own quiet stretches [rad].

    Some hundredths of the record at least are taken to be at rest on this axis. The lowest hundredth of the spread over
    short windows is then a rest's, at most a tenth of the spread over a long rest. An encoder whose last digit seldom
    changes shows it in its smallest step, which is given where more is known than these rows.
    """
    spread = np.quantile(_window_spread(angle), 0.01)
    if step is None:
        step = smallest_step(angle)
    digit = 0.0
    if math.isfinite(step):
        digit = step
    return min(max(10.0 * float(spread), 1.5 * digit, LEAST_TOLERANCE), GREATEST_TOLERANCE)


def find_stops(angles: NDArray, tolerance: NDArray) -> list[tuple[int, int]]:
    """First and last row of every stretch of at least WINDOW rows over which both angles keep their level.

    Parameters
    ----------
    angles : ndarray, shape (N, 2)
        encoder readings without jumps by whole turns [rad]
    tolerance : ndarray, shape (2,)
        spread of a rest on each axis [rad]

    Returns
    -------
    list of (int, int)
        in the order of time
    """
    count = len(angles)
    if count < WINDOW:
        return []
    quiet = np.all([_window_spread(angles[:, k]) <= tolerance[k] for k in range(2)], axis=0)
    covered = np.convolve(quiet, np.ones(WINDOW, dtype=np.int64)) > 0
    # a move between two rows leaves both in quiet windows, but not of the same rest
    joined = np.all(np.abs(np.diff(angles, axis=0)) <= tolerance, axis=1) & covered[1:] & covered[:-1]
    starts = np.flatnonzero(covered & ~np.concatenate([[False], joined]))
    ends = np.flatnonzero(covered & ~np.concatenate([joined, [False]]))
    stops = []
    for first, last in zip(starts.tolist(), ends.tolist(), strict=True):
        stops += list(_levels(angles, first, last, tolerance))
    long = []
    for first, last in stops:
        if last - first + 1 >= WINDOW:
            long.append((first, last))
    return long


def _window_spread(values: NDArray) -> NDArray:
    """Largest less smallest value in each window of WINDOW rows, shape (N - WINDOW + 1,)."""
    high = low = values
    width = 1
    while width < WINDOW:
        high = np.maximum(high[:-width], high[width:])
        low = np.minimum(low[:-width], low[width:])
        width *= 2
    return high - low


def _levels(angles: NDArray, first: int, last: int, tolerance: NDArray) -> Iterator[tuple[int, int]]:
    """Cut a stretch that holds a slow motion into pieces of one level each; one that only creeps is a rest."""
    if np.all(np.ptp(angles[first : last + 1], axis=0) <= GREATEST_TOLERANCE):
        yield first, last
        return
    start = first
    while start <= last:
        end = _level_end(angles, start, last, tolerance)
        middle = (start + end + 1) // 2
        if middle > start:
            halves = [mean_of(angles[start:middle]), mean_of(angles[middle : end + 1])]
            # a piece of a motion moves on by the whole tolerance, a rest stays where it is
            if np.all(np.abs(halves[1] - halves[0]) <= 0.25 * tolerance):
                yield start, end
        start = end + 1


def _level_end(angles: NDArray, start: int, last: int, tolerance: NDArray) -> int:
    """Last row up to which the spread from `start` stays within the tolerance."""

    def level(end: int) -> bool:
        return bool(np.all(np.ptp(angles[start : end + 1], axis=0) <= tolerance))

    good, step = start, 1
    while good + step <= last and level(good + step):
        good += step
        step *= 2
    while step:
        if good + step <= last and level(good + step):
            good += step
        step //= 2
    return good
