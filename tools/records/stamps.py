"""Time stamps: the sampling period, the gaps, and the even times of a record whose logger stamps late or coarsely.

A sensor samples evenly; its logger stamps late, in steps of its clock, or in bursts. The period is the slope of stamps
over row number. Behind a gap the stamps leave that line for good; a late stamp returns to it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints

GAP = 1.5
"""Stamps that leave their line for good by half a period less than this many periods hide a gap."""
UNEVEN = 0.01
"""Largest departure of a stamp from even times that counts as none, in periods."""
HARDLY = 0.25
"""Where no time between stamps differs by a larger part from their mean, their mean is the period."""
NEAR = 32
"""Rows on each side of a possible gap that tell whether stamps return to their line."""
USUAL = 0.99
"""Part of the times between stamps that are no gaps."""
ROUNDS = 3
"""Rounds in which the period is fitted to the earliest stamps."""
RETURN = 3
"""A late stamp returns to the line within this many times its delay."""
MOST_ROWS = 2000
"""Largest number of rows on each side of a possible gap."""
LATE = 1.25
"""A time between stamps of more periods may hide a gap."""
FEW = 8
"""Fewer rows on one side than this tell a late stamp from a gap only where the stamps are even."""
LAGS = (256, 64, 16, 4, 1)
"""Distances between stamps in rows over which the period is tried, after a sixteenth of the record."""
CERTAIN = 8.0
"""A gap moves stamps by more than this many usual changes of the earliest departure."""
ON_STEP, NEARLY_ALL = 0.1, 0.98
"""Departure from a whole number of periods that counts as none; part of the rows for which it must hold."""
IRREGULAR = 4.0
"""Of stamps that follow no line, times that exceed nine in ten of all others by this factor are gaps."""

CLEAR = 36.0
"""Least square of a step from row to row, in units of its noise, that shows whether a row is lost in it."""
ALIKE = 0.35
"""Largest change between the steps beside it, of their size, where a motion is smooth."""
FEWEST_LOST, LEAST_LOST = 4, 0.004
"""Fewest steps, and least part of them, that prove lost rows."""
STRETCHES, STRETCH_ROWS = 8, 25_000
"""Stretches of a long record that are searched for lost rows, and the rows of each."""


@dataclass(frozen=True, eq=False)
class Grid:
    """Even times of a record beside its stamps.

    Attributes
    ----------
    period : float
        time between samples [s]
    gaps : (G,) array of int
        rows before a gap
    even : (N,) array
        times of even samples, as near to the stamps as they come [s]
    logged : (N,) array
        the stamps [s]
    regular : bool
        true if even times describe the stamps; False where the rows follow no line between gaps
    """

    period: float
    gaps: Ints
    even: Floats
    logged: Floats
    regular: bool

    @property
    def is_gap(self) -> Bools:
        """Intervals (N - 1,) between rows that are gaps."""
        mask = np.zeros(len(self.logged) - 1, dtype=bool)
        mask[self.gaps] = True
        return mask

    @property
    def lost(self) -> Ints:
        """Rows (G,) that each gap lacks, at least one."""
        between = np.diff(self.even)[self.gaps]
        return np.maximum(np.round(between / self.period).astype(int) - 1, 1)

    @property
    def departure(self) -> float:
        """Largest departure of a stamp from its even time [s]."""
        return float(np.abs(self.logged - self.even).max(initial=0.0))

    @property
    def uneven(self) -> bool:
        """Return true if the stamps depart from even times by more than a hundredth of the period."""
        return self.regular and self.departure > UNEVEN * self.period


def grid_of(time: Floats) -> Grid:
    """Return period, gaps and even times of stamps (N,), at least two [s]."""
    return _grid(time.tobytes())


@lru_cache(maxsize=8)
def _grid(stamps: bytes) -> Grid:
    time = np.frombuffer(stamps)
    rows = np.arange(len(time))
    lags = [lag for lag in (len(time) // 16, *LAGS) if 0 < lag <= max(1, len(time) // 4)]
    for lag in lags:
        period = float(np.median(time[lag:] - time[:-lag])) / lag
        if period <= 0.0:
            continue
        if lag == 1 and _lies_on_steps(time, period):
            return _with_steps(time, period)
        stretch = _stretch(time, period)
        period = _steadied(time, period, stretch, lag)
        gaps, shift = _lasting_jumps(time - period * rows, period, stretch)
        if _wander(time - period * rows - shift, stretch) <= (GAP - 1.0) * period:
            period = _common_slope(time, gaps, period, stretch)
            gaps, _ = _lasting_jumps(time - period * rows, period, stretch)
            return _fitted(time, gaps, period, stretch)
    between = np.diff(time)
    usual = max(float(np.median(between)), np.finfo(float).tiny)
    longest = max(GAP * usual, IRREGULAR * float(np.quantile(between, 0.9)))
    is_gap = between > longest
    return Grid(float(np.mean(between[~is_gap])), np.flatnonzero(is_gap), time, time, regular=False)


def _stretch(time: NDArray, period: float) -> int:
    """Return the number of rows that contain at least one stamp that is hardly late."""
    longest = float(np.quantile(np.diff(time), USUAL)) / period
    return int(min(max(NEAR, RETURN * longest), max(NEAR, len(time) // 16)))


def _steadied(time: NDArray, period: float, stretch: int, lag: int) -> float:
    """The period by the earliest stamps of stretches of rows: delays do not move it."""
    for _ in range(ROUNDS):
        earliest = _earliest(time - period * np.arange(len(time)), stretch)
        apart = lag // stretch
        if not 1 <= apart < len(earliest):
            return period
        period += float(np.median(earliest[apart:] - earliest[:-apart])) / (apart * stretch)
    return period


def _lasting_jumps(departure: NDArray, period: float, stretch: int) -> tuple[Ints, NDArray]:
    """Return the rows before a gap, and the shift (N,) of each row's stamp by the gaps before it [s]."""
    count = len(departure)
    step = np.diff(departure)
    candidates = np.flatnonzero(step > (LATE - 1.0) * period)
    # The longest first: a gap limits the comparison beside it.
    order = candidates[np.argsort(-step[candidates], kind="stable")]
    bounds = np.zeros(count + 1, dtype=bool)
    bounds[[0, count]] = True
    jumps = np.zeros(count)
    wander = CERTAIN * _wander(departure, stretch)
    for before in order:
        reach = int(min(max(stretch, RETURN * (1.0 + step[before] / period)), MOST_ROWS))
        low, high = max(before + 1 - reach, 0), min(before + 1 + reach, count)
        inside = np.flatnonzero(bounds[low : before + 1])
        if inside.size:
            low += int(inside[-1])
        inside = np.flatnonzero(bounds[before + 2 : high])
        if inside.size:
            high = before + 2 + int(inside[0])
        jump, unsure = _jump(departure[low : before + 1], departure[before + 1 : high])
        if jump > (GAP - 1.0) * period + unsure + wander:
            bounds[before + 1] = True
            jumps[before + 1] = jump
    return np.flatnonzero(jumps) - 1, np.cumsum(jumps)


def _jump(before: NDArray, behind: NDArray) -> tuple[float, float]:
    """Return the lasting jump of the departures at a row, and its uncertainty from the few rows."""
    jump = min(
        float(behind.min() - before.min()),
        float(behind.max() - before.max()),
        float(np.median(behind) - np.median(before)),
    )
    unsure = 0.0
    if min(len(before), len(behind)) < FEW:
        longer = max(before, behind, key=len)
        unsure = float(np.ptp(longer))
    return jump, unsure


def _earliest(departure: NDArray, stretch: int) -> NDArray:
    """The earliest departure (S,) of each stretch of rows [s]."""
    count = len(departure) // stretch
    return departure[: count * stretch].reshape(count, stretch).min(axis=1)


def _wander(departure: NDArray, stretch: int) -> float:
    """Median change of the earliest departure from one stretch of rows to the next [s]; 0 of few stretches."""
    earliest = _earliest(departure, stretch)
    if len(earliest) < 3:
        return 0.0
    return float(np.median(np.abs(np.diff(earliest))))


def _lies_on_steps(time: NDArray, period: float) -> bool:
    """Return true if nearly all times between stamps are whole periods."""
    steps = np.diff(time) / period
    off = np.abs(steps - np.round(steps))
    return bool(np.mean(off <= ON_STEP) >= NEARLY_ALL and steps.min() >= 1.0 - ON_STEP)


def _with_steps(time: NDArray, period: float) -> Grid:
    """The even times of stamps that are whole periods apart."""
    is_gap = np.diff(time) > GAP * period
    return _fitted(time, np.flatnonzero(is_gap), period, NEAR)


def _segments(gaps: Ints, count: int) -> Iterator[tuple[int, int]]:
    """First rows of the parts between gaps, and those behind them."""
    return pairwise([0, *(gaps + 1).tolist(), count])


def _common_slope(time: NDArray, gaps: Ints, period: float, stretch: int) -> float:
    """The slope of the earliest stamps of stretches of rows, one for all parts between gaps."""
    departure = time - period * np.arange(len(time))
    moment = square = 0.0
    for first, stop in _segments(gaps, len(time)):
        earliest = _earliest(departure[first:stop], stretch)
        if len(earliest) >= 3:
            at = stretch * (np.arange(len(earliest)) - 0.5 * (len(earliest) - 1))
            moment += float(at @ earliest)
            square += float(at @ at)
    if square > 0.0:
        return period + moment / square
    return period


def _fitted(time: NDArray, gaps: Ints, period: float, stretch: int) -> Grid:
    """Return the even times of stamps with known gaps."""
    between = np.delete(np.diff(time), gaps)
    rows = np.arange(len(time))
    mean = float(np.mean(between)) if len(between) else period
    # The slope of even stamps is their mean; a late stamp at an end would move it.
    if np.abs(between - mean).max(initial=0.0) <= HARDLY * mean:
        period = mean
    else:
        period = _common_slope(time, gaps, period, stretch)
    departure = time - period * rows
    even: Floats = np.asarray(period * rows, dtype=np.float64)
    for first, stop in _segments(gaps, len(time)):
        even[first:stop] += np.median(departure[first:stop])
    return Grid(period, gaps, even, time, regular=True)


def lost_share(time: Floats, *readings: Floats) -> float:
    """Return the part of the rows that a smooth motion proves to be lost though its stamps (N,) are even.

    Where a row is lost, all readings (N, 3) change twice as much as by the rows beside it. As many changes by nothing
    prove that the readings are repeated or coarse instead.
    """
    starts = np.linspace(0, max(len(time) - STRETCH_ROWS, 0), STRETCHES).astype(int)
    rows = np.unique(starts[:, None] + np.arange(min(STRETCH_ROWS, len(time))))
    change = np.diff(np.column_stack([values[rows] for values in readings]), axis=0)
    if len(change) < FEW:
        return 0.0
    excess, is_clear = _excess_of_steps(change)
    seconds = np.diff(time[rows])[2:-2]
    excess = excess[is_clear & (seconds < GAP * np.median(seconds))]
    doubled, unmoved = _count_near(excess, 1.0, 0.3), _count_near(excess, -1.0, 0.3)
    # Rough motions and uneven sampling give smaller changes, too.
    is_peak = _count_near(excess, 0.55, 0.15) < 1.2 * doubled
    share = doubled / max(len(excess), 1)
    is_proven = is_peak and doubled >= max(FEWEST_LOST, 2.5 * unmoved) and share > LEAST_LOST
    return share if is_proven else 0.0


def _excess_of_steps(change: Floats) -> tuple[Floats, Bools]:
    """Return by how much steps of readings (M, C) exceed those of the rows beside them, over these (M - 4,).

    With it, whether the motion is fast and smooth enough to tell: two steps on each side predict the one between.
    """
    noise = 1.5 * np.median(np.abs(change[2:-2] - 0.5 * (change[1:-3] + change[3:-1])), axis=0)
    change = change[:, noise > 0.0] / noise[noise > 0.0]
    first, before, step, after, last = (change[k : len(change) - 4 + k] for k in range(5))
    usual = (4.0 * (before + after) - (first + last)) / 6.0
    channels = change.shape[1]
    size = np.square(usual).sum(axis=1)
    excess = (usual * step).sum(axis=1) / np.maximum(size - 0.5 * channels, 1.0) - 1.0
    across = np.square(step - (1.0 + excess[:, None]) * usual).sum(axis=1)
    is_smooth = np.square(after - before).sum(axis=1) < 4.0 * ALIKE**2 * size + 2.0 * channels
    return excess, (size > CLEAR) & is_smooth & (across < 0.15 * size + 3.0 * channels)


def _count_near(values: Floats, center: float, reach: float) -> int:
    return int((np.abs(values - center) < reach).sum())
