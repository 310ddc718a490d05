"""Whether a rest has settled, whether it still drifts, and what its own scatter says of its mean."""

import math
from dataclasses import dataclass
from functools import cache
from statistics import NormalDist

import numpy as np

BLOCKS = 40
"""Blocks into which a rest is cut for the test of its start."""

FEWEST = 8
"""Rows that are not tested for settling any more."""

TOO_MUCH_DROPPED = 1e-3
"""Chance that a settled block is called different: it costs a few rows."""

FALSE_ALARM = 1e-4
"""Chance that a trend is stated, or a rest called unsettled, where the scatter alone made it."""


@dataclass(frozen=True, eq=False)
class Trend:
    """Linear trends: change (m,) from the first to the last row, and whether (m,) the scatter cannot explain it."""

    change: np.ndarray
    significant: np.ndarray


def settled_from(values: np.ndarray, floor: np.ndarray, *, drifts: bool = False) -> int:
    """First row of a rest from which its readings and angles have settled.

    The rest is cut into blocks. A block of the first half that differs from the second half's mean by more than
    the second half's scatter has not settled, nor has anything before it; nor has a block from which on the first
    half as a whole differs. What is left is tested again, since an unsettled second half hides what is before it.

    Parameters
    ----------
    values, floor : ndarray, shape (n, m), (m,)
        one column for each accelerometer and axis; differences that are never taken for one: what rounding does
    drifts : bool
        whether the second half's linear trend, where it has one, is continued through the first: a drift through
        the whole rest is no settling
    """
    start = 0
    while len(values) - start >= FEWEST:
        dropped = _unsettled(values[start:], floor, drifts)
        if not dropped:
            break
        start += dropped
    return start


def still_settling(time: np.ndarray, values: np.ndarray, floor: np.ndarray) -> bool:
    """Whether a column's change over these rows slows down or speeds up: a transient, where a drift is linear."""
    place = (time - time[0]) / (time[-1] - time[0])
    basis = np.linalg.qr(np.stack([np.ones(len(time)), place, place**2], axis=1))[0]
    deviation = values - mean_of(values)
    weight = basis.T @ deviation
    residual = deviation - basis @ weight
    freedom = max(len(time) - 3, 1)
    error = np.sqrt(np.sum(residual**2, axis=0) / freedom)
    return bool(np.any(np.abs(weight[2]) > np.maximum(student_quantile(freedom, FALSE_ALARM) * error, floor)))


def _unsettled(values: np.ndarray, floor: np.ndarray, drifts: bool) -> int:
    """How many rows at the start have not settled by one test; at most half of them."""
    size = max(1, len(values) // BLOCKS)
    # counted from the end, so that rows that fill no block are at the start
    count = len(values) // size
    offset = len(values) - count * size
    means = _block_means(values[offset:], count)
    half = count // 2
    first, second = means[:half], means[half:]
    # the second half's level, or its line where it has a trend
    place = np.arange(half, count)
    level, centre = mean_of(second), float(place.mean())
    centred = place - centre
    square = float(centred @ centred)
    slope = centred @ (second - level) / square
    about = np.sqrt(np.sum((second - level - np.outer(centred, slope)) ** 2, axis=0) / max(len(second) - 2, 1))
    limit = student_quantile(len(second) - 2, FALSE_ALARM) * about / math.sqrt(square)
    change = np.abs(slope) * (len(second) - 1)
    trend = (drifts and len(second) > 3) & (np.abs(slope) > limit) & (change > floor)
    scatter = np.where(trend, about, np.std(second - second[0], axis=0, ddof=1))
    leverage = np.where(trend, 1.0 / square, 0.0)
    distance = np.arange(half) - centre
    difference = first - (level + distance[:, None] * np.where(trend, slope, 0.0))
    # from each block on to the middle, the mean of the first half
    left = np.arange(half, 0, -1)
    onwards = np.cumsum(difference[::-1], axis=0)[::-1] / left[:, None]
    mean_distance = np.cumsum(distance[::-1])[::-1] / left
    # a block beside a line that is wrongly called different costs more than a few rows
    chance = FALSE_ALARM if drifts else TOO_MUCH_DROPPED
    widest = np.array([student_quantile(len(second) - 2 if sloped else len(second) - 1, chance) for sloped in trend])
    of_one = 1.0 + 1.0 / len(second) + distance[:, None] ** 2 * leverage
    of_many = 1.0 / left[:, None] + 1.0 / len(second) + mean_distance[:, None] ** 2 * leverage
    one = np.maximum(widest * np.sqrt(of_one) * scatter, floor)
    many = np.maximum(widest * np.sqrt(of_many) * scatter, floor)
    different = np.any((np.abs(difference) > one) | (np.abs(onwards) > many), axis=1)
    last = np.flatnonzero(different)
    return offset + (int(last[-1]) + 1) * size if last.size else 0


def mean_of(values: np.ndarray) -> np.ndarray:
    """Mean over the rows; of equal rows exactly that row."""
    return values[0] + np.mean(values - values[0], axis=0)


def scatter_of_mean(values: np.ndarray) -> np.ndarray:
    """Standard error of the mean over the rows, from their own scatter, shape (m,).

    The largest of three: independent rows, independent eighths, and half the difference of the two halves,
    which keeps what flicker leaves in a mean where the rows' deviation over √n loses it.
    """
    count = len(values)
    white = np.std(values - values[0], axis=0, ddof=1) / math.sqrt(count)
    halves = _block_means(values, 2)
    slow = 0.5 * np.abs(halves[1] - halves[0])
    if count < 16:
        return np.maximum(white, slow)
    eighths = _block_means(values, 8)
    return np.maximum(np.maximum(white, slow), np.std(eighths - eighths[0], axis=0, ddof=1) / math.sqrt(8))


def trend_of(time: np.ndarray, values: np.ndarray, floor: np.ndarray) -> Trend:
    """Linear trend of each column of a rest (n, m) over its times (n,) [s], by least squares.

    Changes up to the floor (m,) are never significant: what rounding does.
    """
    centred = time - mean_of(time)
    deviation = values - mean_of(values)
    square = float(centred @ centred)
    slope = centred @ deviation / square
    residual = deviation - np.outer(centred, slope)
    freedom = len(time) - 2
    error = np.sqrt(np.sum(residual**2, axis=0) / max(freedom, 1) / square)
    duration = float(time[-1] - time[0])
    change = slope * duration
    return Trend(change, np.abs(change) > np.maximum(student_quantile(freedom, FALSE_ALARM) * error * duration, floor))


def scatter_about_line(time: np.ndarray, values: np.ndarray) -> float:
    """Largest less smallest distance of values (n,) from their least-squares line."""
    centred = time - mean_of(time)
    slope = float(centred @ (values - mean_of(values))) / float(centred @ centred)
    return float(np.ptp(values - slope * centred))


@cache
def student_quantile(freedom: int, chance: float) -> float:
    """How many standard errors a quantity with so many degrees of freedom may lie from its mean, on either side.

    The quantile of Student's t: the incomplete beta function by its continued fraction (Lentz), solved by Newton's
    method in the logarithms. scipy has it too, but loading `scipy.special` takes longer than a simulation of a table.
    """
    freedom = max(freedom, 1)
    half = 0.5 * freedom
    log_beta = math.lgamma(half) + math.lgamma(0.5) - math.lgamma(half + 0.5)
    log_t = math.log(NormalDist().inv_cdf(1.0 - 0.5 * chance))
    for _ in range(50):
        square = math.exp(2.0 * log_t)
        x = freedom / (freedom + square)
        front = math.exp(0.5 * math.log(square / (freedom + square)) - half * math.log1p(square / freedom) - log_beta)
        c, d = 1.0, 1.0 / (1.0 - (half + 0.5) * x / (half + 1.0))
        fraction = d
        for m in range(1, 10_000):
            even = half + 2 * m
            for step in (
                m * (0.5 - m) * x / ((even - 1.0) * even),
                -(half + m) * (half + 0.5 + m) * x / (even * (even + 1.0)),
            ):
                c, d = 1.0 + step / c, 1.0 / (1.0 + step * d)
                fraction *= c * d
            if abs(c * d - 1.0) < 1e-16:
                break
        tail = front * fraction / half
        change = math.log(tail / chance) * tail / (2.0 * front)
        log_t += change
        if abs(change) < 1e-14:
            break
    return math.exp(log_t)


def _block_means(values: np.ndarray, count: int) -> np.ndarray:
    """Means of `count` blocks of equal size, shape (count, m); rows at the end may be left over."""
    size = len(values) // count
    blocks = values[: count * size].reshape(count, size, -1)
    return blocks[:, 0] + np.mean(blocks - blocks[:, :1], axis=1)
