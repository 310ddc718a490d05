"""Where the table stands still: stretches over which both encoder readings keep their level."""

import math
from collections.abc import Iterator

import numpy as np

from .settling import mean_of

WINDOW = 8
"""Rows of the shortest stretch that can be told from a slow move."""

LEAST_TOLERANCE = math.radians(5 / 3600)
"""Spread of an encoder's readings that never counts as motion [rad]."""

GREATEST_TOLERANCE = math.radians(5 / 60)
"""No stretch with a greater spread is a rest [rad]: readings averaged over it would be wrong by 3e-7 g."""

COARSEST_ENCODER = math.radians(2 / 60)
"""A step of the reading above this is a move, not the last digit of an encoder [rad]."""

_FULL_TURN = 2.0 * math.pi


def without_turns(angle: np.ndarray) -> np.ndarray:
    """The angle without the jumps by whole turns that an encoder makes at its zero, shape (N,) [rad]."""
    turns = np.rint(np.diff(angle) / _FULL_TURN)
    result = angle.copy()
    result[1:] -= np.cumsum(turns) * _FULL_TURN
    return result


def quiet_tolerance(angle: np.ndarray) -> float:
    """Spread of one encoder's readings over a rest, from the record's own quiet stretches [rad].

    Some hundredths of the record at least are taken to be at rest on this axis: the lowest hundredth of the
    spread over short windows is then a rest's, a tenth of the spread over a long rest at most. An encoder whose
    last digit seldom changes shows it in its smallest step.
    """
    spread = np.quantile(_window_spread(angle), 0.01)
    steps = np.abs(np.diff(angle))
    steps = steps[(steps > 0.0) & (steps <= COARSEST_ENCODER)]
    digit = float(steps.min()) if steps.size else 0.0
    return min(max(10.0 * float(spread), 1.5 * digit, LEAST_TOLERANCE), GREATEST_TOLERANCE)


def find_stops(angles: np.ndarray, tolerance: np.ndarray) -> list[tuple[int, int]]:
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
    return [(first, last) for first, last in stops if last - first + 1 >= WINDOW]


def _window_spread(values: np.ndarray) -> np.ndarray:
    """Largest less smallest value in each window of WINDOW rows, shape (N - WINDOW + 1,)."""
    high = low = values
    width = 1
    while width < WINDOW:
        high = np.maximum(high[:-width], high[width:])
        low = np.minimum(low[:-width], low[width:])
        width *= 2
    return high - low


def _levels(angles: np.ndarray, first: int, last: int, tolerance: np.ndarray) -> Iterator[tuple[int, int]]:
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


def _level_end(angles: np.ndarray, start: int, last: int, tolerance: np.ndarray) -> int:
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
