"""Rests of a block in a hand or on a desk, by its accelerometers: a hand that trembles turns the gyros at rest, too."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...models.arrays import Floats, Ints
from ..memory import each, once
from ..motion.rests import LEAST_ROWS, QUIET, still_stretches, still_windows, window_scatter, window_sums
from ..records.columns import LARGEST_FORCE
from ..records.stamps import grid_of, lost_share
from ..records.steps import reading_step

WIDER = 5.0
"""The limit of a second pass, where the first leaves fewer than `FEWEST` rests."""
FEWEST = 9
FIRST_ROWS = 1000
"""Rows that mostly show already that steps are narrower than the noise."""
SAME_RATE = np.radians(2.0)
"""Largest excess turn of a still window over the stillest ones [rad/s]."""
STILLEST = 0.1
"""Part of the still windows that shows the gyros' readings at rest: those in which they scatter least."""
END = 2.0
"""Length of the ends of a rest that show gravity's direction before and after a move [s]."""


@dataclass(frozen=True, eq=False)
class TimedReadings:
    """Readings in time.

    Attributes
    ----------
    time_s : (N,) array
        [s]
    force : (N, 3) array
        specific force [g]
    rate : (N, 3) array or None
        of gyros [rad/s]
    expansions : list of Expansion
        rotations over pieces of it that were carried
    """

    time_s: Floats
    force: Floats
    rate: Floats | None = None
    expansions: list[Any] = field(default_factory=list)

    @cached_property
    def period(self) -> float:
        """The time between samples [s]."""
        return grid_of(self.time_s).period

    @cached_property
    def lost(self) -> float:
        """The part of the rows that is lost under even stamps."""
        assert self.rate is not None
        return lost_share(self.time_s, self.force, self.rate)

    @cached_property
    def turned(self) -> Floats:
        """The angle (N,) that the gyros have turned since the first row, to and fro [rad]."""
        assert self.rate is not None
        speed = np.linalg.norm(self.rate[1:] + self.rate[:-1], axis=1)
        return np.append(0.0, np.cumsum(0.5 * speed * np.diff(self.time_s)))


@dataclass(frozen=True, eq=False)
class StillRests:
    """Rests of a series.

    Attributes
    ----------
    rows : tuple of slice
        the rows that are averaged, K; empty of readings that are averages already
    force : (K, 3) array
        mean readings [g]
    deviation : (K,) array
        standard deviation of a mean by the noise within the rests, the largest of the three [g]
    limit : float or None
        largest scatter in units of the noise with which they were found; None of rests that are given
    rate : (K, 3) array or None
        mean rates [rad/s]
    rate_deviation : (K, 3) array or None
        standard deviation of a mean rate by white noise within the rest [rad/s]
    rate_steps : (K, 3) array or None
        that by steps of the readings, which is much the same in all rests [rad/s]
    unrest : (K,) array or None
        scatter of the gyros, the largest of the three in units of the quietest tenth
    """

    rows: tuple[slice, ...]
    force: Floats
    deviation: Floats
    limit: float | None
    rate: Floats | None = None
    rate_deviation: Floats | None = None
    rate_steps: Floats | None = None
    unrest: Floats | None = None

    def __len__(self) -> int:
        return len(self.force)

    def those(self, chosen: Ints) -> "StillRests":
        """Return some of the rests."""
        of_gyros = self.rate, self.rate_deviation, self.rate_steps, self.unrest
        of_gyros = [None if one is None else one[chosen] for one in of_gyros]
        rows = tuple(self.rows[number] for number in chosen.tolist()) if self.rows else ()
        return StillRests(rows, self.force[chosen], self.deviation[chosen], self.limit, *of_gyros)


def still_rests(series: TimedReadings, limit: float | None = None) -> StillRests:
    """Find the rests of a series and average them.

    Parameters
    ----------
    series : TimedReadings
    limit : float, optional
        Largest scatter of an accelerometer at rest in units of its noise; by default 3, and 5 where that leaves fewer
        than nine rests and 5 leaves more.
    """
    if limit is not None:
        return averaged(series, next(_still_rows(series, [limit])), limit)
    each_rows = _still_rows(series, [QUIET, WIDER])
    rows = next(each_rows)
    if len(rows) < FEWEST:
        wider = next(each_rows)
        if len(wider) > len(rows):
            return averaged(series, wider, WIDER)
    return averaged(series, rows, QUIET)


def _still_rows(series: TimedReadings, limits: Sequence[float]) -> Iterator[list[slice]]:
    """Yield the rows of each rest, without its ends, by each limit.

    Only windows count whose mean rate is near that of the still windows in which the gyros scatter least: a turn about
    the vertical is still for accelerometers, and no hand turns as steadily as a block rests.
    """
    if len(series.time_s) < 2 * LEAST_ROWS:
        yield from ([] for _ in limits)
        return
    most = LARGEST_FORCE / 9.0
    windows, _ = still_windows([*np.clip(series.force, -most, most).T], series.period, limits)
    means, scatter = np.empty(0), np.empty(0)
    for still in windows:
        if series.rate is not None and still.any():
            if not len(means):
                size = len(series.time_s) - len(still) + 1
                means = np.column_stack([window_sums(values, size) / size for values in series.rate.T])
                scatter = np.linalg.norm([window_scatter(values, size) for values in series.rate.T], axis=0)
            least = np.quantile(scatter[still], STILLEST)
            usual = np.median(means[still & (scatter <= least)], axis=0)
            still &= np.linalg.norm(means - usual, axis=1) <= SAME_RATE
        yield still_stretches(series.time_s, still, series.period)


def averaged(series: TimedReadings, rows: Sequence[slice], limit: float | None) -> StillRests:
    """Return the means over rests."""
    count = len(rows)
    force = np.reshape(each(mean_of_rows, series.force, rows), (count, 3))
    deviation = np.array(each(_deviation_of_mean, series.force, rows))
    if count:
        # One rest tells its own noise badly: the median, as white noise falls with the length.
        lengths = np.array([at.stop - at.start for at in rows])
        deviation = np.median(deviation) * np.sqrt(np.median(lengths) / lengths)
        deviation = np.hypot(deviation, _of_steps(series.force, each(_spread, series.force, rows)).max(axis=1))
    if series.rate is None:
        return StillRests(tuple(rows), force, deviation, limit)
    rate, spread = (np.reshape(each(of_rest, series.rate, rows), (count, 3)) for of_rest in (mean_of_rows, _spread))
    unrest, rate_deviation = np.ones(count), spread
    if count:
        rate_deviation = spread / np.sqrt(lengths)[:, None]
        quiet = np.quantile(spread, 0.1, axis=0)
        unrest = (spread / np.where(quiet > 0.0, quiet, 1.0)).max(axis=1)
    steps = _of_steps(series.rate, spread)
    return StillRests(tuple(rows), force, deviation, limit, rate, rate_deviation, steps, unrest)


def mean_of_rows(values: NDArray) -> Floats:
    """Return the mean (C,) of rows (n, C)."""
    return values.mean(axis=0)


def _of_steps(values: NDArray, spread: ArrayLike) -> Floats:
    """Return the error (K, C) of means over rests by steps of the readings (N, C) that noise does not even out."""
    spread = np.asarray(spread)
    changes = np.abs(np.diff(values[:FIRST_ROWS], axis=0))
    # No step is wider than the least change, and a sort of all readings takes a while.
    least = np.where(changes > 0.0, changes, np.inf).min(axis=0, initial=np.inf).max()
    if spread.size and spread.min() >= 0.5 * least:
        return np.zeros(spread.shape)
    step = once(reading_step, values)
    return np.where(spread < 0.5 * step, step / np.sqrt(12.0), 0.0)


def _spread(values: NDArray) -> Floats:
    return values.std(axis=0)


def _deviation_of_mean(values: NDArray) -> float:
    """Return the standard deviation of the mean of rows (n, 3), by the means of its eighths: noise has a memory."""
    parts = min(8, len(values))
    if parts < 2:
        return 0.0
    size, longer = divmod(len(values), parts)
    ends = [number * size + min(number, longer) for number in range(parts + 1)]
    means = np.array([np.add.reduce(values[first:last], axis=0) / (last - first) for first, last in pairwise(ends)])
    return float(means.std(axis=0, ddof=1).max() / np.sqrt(len(means)))
