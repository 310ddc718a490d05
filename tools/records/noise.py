"""Noise from the scatter of readings: the bound σ of their error, and whether a rest has settled or drifts.

The bound comes from repeated positions, or from the Allan deviation within rests.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..rounding import digits, upwards
from .kinds import DwellNoise, PositionRecord, RawRecord
from .sigma import CHANNELS, Fitted, pooled_deviation

SAME_ANGLE = math.radians(1 / 60)
"""Positions whose angles agree so far are repeats of one [rad]."""

ROWS_AT_ONCE = 8192
"""Rows of sums whose differences are taken at once."""
SCATTER_FACTOR = 3.0
"""The bound on a mean's error over its standard error."""


WHITE, WANDERING = 1.0 / math.sqrt(2.0), math.sqrt(2.0)
"""What twice the averaging time makes of the deviation: of white noise, and of a random walk."""

BLOCKS = 40
"""Blocks into which a rest is cut for the test of its start."""
FEWEST = 8
"""Rows that are not tested for settling any more."""
TOO_MUCH_DROPPED = 1e-3
"""Chance that a settled block is called different: it costs a few rows."""
FALSE_ALARM = 1e-4
"""Chance that a trend is stated, or a rest called unsettled, where the scatter alone made it."""


@dataclass(frozen=True)
class NoiseBound:
    """σ as a fraction of g, and a sentence on its basis.

    `complete` says whether errors that hold over a rest show in it: only repeats of a position show them.
    """

    value: float
    basis: str
    complete: bool = True


def noise_bound_from(record: PositionRecord, fitted: Fitted | None = None) -> NoiseBound | None:
    """Take the bound on one averaged reading's error from the record: Gaussian errors exceed it in one of 100.

    Repeats of a position show everything that changes from one visit to the next, the encoders' errors included. The
    scatter within rests does not show an error that holds over a rest: where there are no repeats the basis says so.
    None when the record has neither repeats nor a scatter (as one made from rests has), or shows no error at all.

    `fitted` is the result of the fit to the readings, by default of the model of one mounting to this record.
    """
    fitted = fitted or Fitted(len(record))
    repeats = _from_repeats(record, fitted)
    scatter = _from_scatter(record, fitted)
    bound = scatter
    if repeats is not None:
        bound = repeats
    if repeats is not None and scatter is not None and scatter.value > repeats.value:
        bound = replace(scatter, complete=True)
    if bound is None:
        return None
    written = record.resolution / STANDARD_GRAVITY
    if written > bound.value:
        text = "half a last digit of the readings as written, more than their scatter"
        return NoiseBound(written, text, bound.complete)
    if bound.value > 0.0:
        return bound
    return None


def noise_bound_of(deviation: float, positions: int) -> NoiseBound:
    """The bound on one averaged reading's error by its standard deviation, both fractions of g."""
    factor = Fitted(positions).largest
    basis = f"{digits(factor)} sd, sd = {digits(deviation)} g as given, for {positions} positions; estimated"
    return NoiseBound(factor * deviation, basis)


def tells_noise(record: PositionRecord) -> bool:
    """Return true if the record bounds the noise, including errors that are constant over a rest."""
    bound = noise_bound_from(record)
    return bound is not None and bound.complete


def _from_repeats(record: PositionRecord, fitted: Fitted) -> NoiseBound | None:
    labels = _same_positions(record)
    residual, slack = _without_angle_differences(record)
    repeated = np.flatnonzero(np.bincount(labels) > 1)
    squares, visits, unlike = np.zeros(CHANNELS), 0, 0.0
    for label in repeated:
        rows = labels == label
        spread = np.ptp(np.stack([record.alpha[rows], record.beta[rows]], axis=1) % (2.0 * math.pi), axis=0)
        spread = np.minimum(spread, 2.0 * math.pi - spread)
        unlike = max(unlike, slack * float(spread.sum()))
        squares += np.sum((residual[rows] - mean_of(residual[rows])) ** 2, axis=0)
        visits += int(np.count_nonzero(rows))
    if not visits:
        return None
    deviation, freedom = pooled_deviation(squares, visits - len(repeated))
    factor = fitted.factor(freedom)
    plural = ""
    if len(repeated) > 1:
        plural = "s"
    basis = (
        f"{digits(factor)} times the standard deviation {upwards(deviation)} g of {visits} visits to {len(repeated)} "
        f"repeated position{plural}; estimated, for Gaussian errors"
    )
    return NoiseBound(factor * deviation + unlike, basis)


def _from_scatter(record: PositionRecord, fitted: Fitted) -> NoiseBound | None:
    if record.scatter is None:
        return None
    unseen = "an error that holds over a rest does not show: repeat positions, or give --noise-sd"
    # each rest tells about one difference of its halves
    factor = fitted.factor(len(record))
    if record.dwell_noise is not None:
        pooled = max(record.dwell_noise.deviation) / STANDARD_GRAVITY
        basis = (
            f"scatter within {len(record)} rests: {digits(factor)} times the Allan deviation at their dwell of "
            f"{digits(record.dwell_noise.dwell_s)} s, {upwards(pooled)} g; {unseen}"
        )
        return NoiseBound(factor * pooled, basis, complete=False)
    pooled = float(np.sqrt(np.max(np.mean(record.scatter**2, axis=0)))) / STANDARD_GRAVITY
    basis = f"scatter within {len(record)} rests: {digits(factor)} standard errors of a mean; {unseen}"
    return NoiseBound(factor * pooled, basis, complete=False)


def _same_positions(record: PositionRecord) -> NDArray:
    """A label for each row, the same for repeats of a position in the same mounting."""
    names = record.mounting or ("",) * len(record)
    keys = np.stack(
        [
            np.unique(np.array(names), return_inverse=True)[1],
            _angle_labels(record.alpha),
            _angle_labels(record.beta),
        ],
        axis=1,
    )
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)


def _angle_labels(angle: NDArray) -> NDArray:
    """A label for each angle, the same where angles agree within SAME_ANGLE, whole turns apart or not."""
    turned = angle % (2.0 * math.pi)
    order = np.argsort(turned, kind="stable")
    gap = np.diff(turned[order])
    # cut the circle at its widest gap, so that no cluster lies across the cut
    gaps = np.append(gap, 2.0 * math.pi - (turned[order[-1]] - turned[order[0]]))
    order = np.roll(order, -(int(np.argmax(gaps)) + 1))
    distance = (turned[order] - turned[order[0]]) % (2.0 * math.pi)
    labels = np.zeros(len(angle), dtype=np.int64)
    start, label = 0, 0
    for index in np.append(np.flatnonzero(np.diff(distance) > SAME_ANGLE) + 1, len(angle)).tolist():
        if distance[index - 1] - distance[start] <= SAME_ANGLE:
            labels[order[start:index]] = label
            label += 1
        else:
            # a dense sweep of angles has no repeats
            labels[order[start:index]] = np.arange(label, label + index - start)
            label += index - start
        start = index
    return labels


def _without_angle_differences(record: PositionRecord) -> tuple[NDArray, float]:
    """Return readings in g less a fitted block's readings at the same angles, and a slack [g/rad].

    Repeats are not set to the same angle exactly: an arcminute is 3e-4 g. The fit (three readings affine in
    the vertical of the ideal table) takes that away to a part in a thousand. Where the positions do not
    determine it, the readings stay, and the slack [g/rad] says how much a difference of angles may matter.
    """
    reading = record.specific_force / STANDARD_GRAVITY
    up = np.stack(
        [
            np.sin(record.alpha) * np.sin(record.beta),
            np.sin(record.alpha) * np.cos(record.beta),
            np.cos(record.alpha),
            np.ones(len(record)),
        ],
        axis=1,
    )
    residual = np.array(reading)
    names = np.array(record.mounting or ("",) * len(record))
    for name in np.unique(names):
        rows = names == name
        if np.linalg.matrix_rank(up[rows], tol=1e-2 * math.sqrt(np.count_nonzero(rows))) < 4:
            return reading, 0.5
        solution = np.linalg.lstsq(up[rows], reading[rows], rcond=None)[0]
        residual[rows] = reading[rows] - up[rows] @ solution
    return residual, 0.0


def allan_deviation(pieces: Sequence[NDArray], size: int) -> NDArray | None:
    """Overlapping Allan deviation of averages over `size` rows, all pieces together, shape (m,).

    It is the square root of half the mean square difference of averages side by side; None when no piece holds two. The
    pieces (n, m) are readings within each rest, equally spaced in time.
    """
    return allan_deviation_of_sums([sums_of(piece) for piece in pieces], size)


def sums_of(piece: NDArray) -> NDArray:
    """Return the sums (n + 1, m) of a piece (n, m) up to each row, its mean taken out: they stay small."""
    return np.concatenate([np.zeros((1, piece.shape[1])), np.cumsum(piece - mean_of(piece), axis=0)])


def allan_deviation_of_sums(sums: Sequence[NDArray], size: int) -> NDArray | None:
    """Return the overlapping Allan deviation of averages over `size` rows, shape (m,), from `sums_of` each piece."""
    total, count = 0.0, 0
    for of_piece in sums:
        if len(of_piece) <= 2 * size:
            continue
        difference = np.empty((len(of_piece) - 2 * size, of_piece.shape[1]))
        # In parts that stay in the processor's own memory.
        for begin in range(0, len(difference), ROWS_AT_ONCE):
            part = difference[begin : begin + ROWS_AT_ONCE]
            end = begin + len(part)
            middle = of_piece[begin + size : end + size]
            np.subtract(of_piece[begin + 2 * size : end + 2 * size], middle, out=part)
            part -= middle
            part += of_piece[begin:end]
        total = total + np.einsum("ij,ij->j", difference, difference)
        count += len(difference)
    if count:
        return np.sqrt(0.5 * total / count) / size
    return None


def deviation_at_dwell(pieces: Sequence[NDArray]) -> NDArray | None:
    """Allan deviation of an average over a whole rest (the median one), shape (m,).

    A rest shows it up to half its length. One octave more follows from the slope of the last octave, white noise's at
    best and a random walk's at worst. None when the rests are too short to tell.
    """
    rows = 0
    if len(pieces):
        rows = int(np.median([len(piece) for piece in pieces]))
    if rows < 4:
        return None
    sums = [sums_of(piece) for piece in pieces]
    half, quarter = allan_deviation_of_sums(sums, rows // 2), allan_deviation_of_sums(sums, rows // 4)
    if half is None or quarter is None:
        return None
    slope = np.divide(half, quarter, out=np.full_like(half, WHITE), where=quarter > 0.0)
    return half * np.clip(slope, WHITE, WANDERING)


def dwell_noise(raw: RawRecord, rests: Sequence[slice]) -> DwellNoise | None:
    """Return the noise of a record's averages, from the rows kept of each rest; None when these are too short."""
    deviation = deviation_at_dwell([raw.specific_force[rows] for rows in rests])
    if deviation is None:
        return None
    first, second, third = deviation.tolist()
    dwell = float(np.median([raw.time_s[rows.stop - 1] - raw.time_s[rows.start] for rows in rests]))
    return DwellNoise(dwell, (first, second, third))


@dataclass(frozen=True, eq=False)
class LinearTrend:
    """Linear trends: change (m,) from first to last row, and whether (m,) it exceeds the scatter."""

    change: NDArray
    significant: NDArray


def settled_from(values: NDArray, floor: NDArray, *, drifts: bool = False) -> int:
    """First row of a rest from which its readings and angles have settled.

    The rest is cut into blocks. A block of the first half that differs from the second half's mean by more than the
    second half's scatter has not settled, nor has anything before it. Nor has a block from which on the first half as a
    whole differs. The other blocks are tested again, since an unsettled second half hides errors before it.

    Parameters
    ----------
    values, floor : ndarray, shape (n, m), (m,)
        one column for each accelerometer and axis; differences that are never taken for one: what rounding does
    drifts : bool
        whether the second half's linear trend, where it has one, is continued through the first: a drift through
        the whole rest is more than settling
    """
    start = 0
    while len(values) - start >= FEWEST:
        dropped = _unsettled(values[start:], floor, drifts)
        if not dropped:
            break
        start += dropped
    return start


def still_settling(time: NDArray, values: NDArray, floor: NDArray) -> bool:
    """Return true if a column's change over these rows slows down or speeds up: a transient, not a linear drift."""
    place = (time - time[0]) / (time[-1] - time[0])
    basis = np.linalg.qr(np.stack([np.ones(len(time)), place, place**2], axis=1))[0]
    deviation = values - mean_of(values)
    weight = basis.T @ deviation
    residual = deviation - basis @ weight
    freedom = max(len(time) - 3, 1)
    error = np.sqrt(np.sum(residual**2, axis=0) / freedom)
    return bool(np.any(np.abs(weight[2]) > np.maximum(student_quantile(freedom, FALSE_ALARM) * error, floor)))


def _unsettled(values: NDArray, floor: NDArray, drifts: bool) -> int:
    """Return the number of rows at the start that have not settled by one test; at most half of them."""
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
    remaining = np.arange(half, 0, -1)
    onwards = np.cumsum(difference[::-1], axis=0)[::-1] / remaining[:, None]
    mean_distance = np.cumsum(distance[::-1])[::-1] / remaining
    # a block beside a line that is wrongly called different costs more than a few rows
    if drifts:
        chance = FALSE_ALARM
    else:
        chance = TOO_MUCH_DROPPED
    widest = np.array([student_quantile(len(second) - 2 if sloped else len(second) - 1, chance) for sloped in trend])
    of_one = 1.0 + 1.0 / len(second) + distance[:, None] ** 2 * leverage
    of_many = 1.0 / remaining[:, None] + 1.0 / len(second) + mean_distance[:, None] ** 2 * leverage
    widest_single = np.maximum(widest * np.sqrt(of_one) * scatter, floor)
    many = np.maximum(widest * np.sqrt(of_many) * scatter, floor)
    different = np.any((np.abs(difference) > widest_single) | (np.abs(onwards) > many), axis=1)
    last = np.flatnonzero(different)
    if last.size:
        return offset + (int(last[-1]) + 1) * size
    return 0


def mean_of(values: NDArray) -> NDArray:
    """Mean over the rows; of equal rows exactly that row."""
    return values[0] + np.mean(values - values[0], axis=0)


def scatter_of_mean(values: NDArray) -> NDArray:
    """Standard error of the mean over the rows, from their own scatter, shape (m,).

    The largest of three: independent rows, independent eighths, and half the difference of the two halves. The last
    keeps the flicker in a mean, where the rows' deviation over √n loses it.
    """
    count = len(values)
    white = np.std(values - values[0], axis=0, ddof=1) / math.sqrt(count)
    halves = _block_means(values, 2)
    slow = 0.5 * np.abs(halves[1] - halves[0])
    if count < 16:
        return np.maximum(white, slow)
    eighths = _block_means(values, 8)
    return np.maximum(np.maximum(white, slow), np.std(eighths - eighths[0], axis=0, ddof=1) / math.sqrt(8))


def trend_of(time: NDArray, values: NDArray, floor: NDArray) -> LinearTrend:
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
    return LinearTrend(
        change, np.abs(change) > np.maximum(student_quantile(freedom, FALSE_ALARM) * error * duration, floor)
    )


def scatter_about_line(time: NDArray, values: NDArray) -> float:
    """Largest less smallest distance of values (n,) from their least-squares line."""
    centred = time - mean_of(time)
    slope = float(centred @ (values - mean_of(values))) / float(centred @ centred)
    return float(np.ptp(values - slope * centred))


@cache
def student_quantile(freedom: int, chance: float) -> float:
    """Return the quantile of Student's t: the largest deviation from the mean, either side, in standard errors.

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


def _block_means(values: NDArray, count: int) -> NDArray:
    """Return the means of `count` blocks of equal size, shape (count, m); rows at the end may remain unused."""
    size = len(values) // count
    blocks = values[: count * size].reshape(count, size, -1)
    return blocks[:, 0] + np.mean(blocks - blocks[:, :1], axis=1)
