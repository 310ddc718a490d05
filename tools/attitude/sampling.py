"""A strapdown record's samples as angle increments on a uniform grid."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.attitude import MAX_INCREMENT
from ..errors import InputError, nearest
from ..records import StrapdownRecord

JITTER = 0.01
"""Largest deviation of a row's time from the uniform grid that is taken, in sampling periods."""

RATE_MEANINGS = ("instantaneous", "averaged")

REST_BLOCK = 1.0
"""Length of the blocks in which rest is looked for [s]."""

QUIET = 2.0
"""A block is at rest when its gyros scatter at most so many times as much as in the record's quietest block."""


@dataclass(frozen=True)
class Increments:
    """Angle increments from a first row on.

    Attributes
    ----------
    period : float
        time between rows [s]
    time_s : ndarray, shape (N + 1,)
        uniform: the first row's time and the ends of the N intervals [s]
    angle : ndarray, shape (N, 3)
        integral of the body's rate over each interval [rad]
    """

    period: float
    time_s: np.ndarray
    angle: np.ndarray


def sampling_period(record: StrapdownRecord) -> float:
    """Time between the rows of a uniform record [s].

    Raises
    ------
    InputError
        fewer than two rows, a gap, or a time that is off the uniform grid by more than 1 % of the period
    """
    time = record.time_s
    if len(time) < 2:
        raise InputError(f"{record.path}: has {len(time)} row; an attitude needs at least two")
    between = np.diff(time)
    usual = float(np.median(between))
    gaps = np.flatnonzero(between > 1.5 * usual)
    if gaps.size:
        k = int(gaps[0])
        raise InputError(
            f"{record.path}, row {int(record.row[k + 1])}, column 'time_s': a gap of {between[k]:.6g} s before "
            f"{time[k + 1]:.9g} s, where rows come every {usual:.6g} s; give a record without gaps"
        )
    period = float(time[-1] - time[0]) / (len(time) - 1)
    off = (time - time[0]) / period - np.arange(len(time))
    worst = int(np.argmax(np.abs(off)))
    if not abs(off[worst]) <= JITTER:
        raise InputError(
            f"{record.path}, row {int(record.row[worst])}, column 'time_s': {time[worst]:.9g} s is "
            f"{100.0 * abs(off[worst]):.3g} % of the period ({period:.6g} s) off the uniform grid; "
            f"at most {100.0 * JITTER:g} % is taken: give a uniformly sampled record with enough digits of time"
        )
    return period


def increments_from(
    record: StrapdownRecord,
    first: int,
    rates: str = "instantaneous",
    gyro_bias: Sequence[float] | np.ndarray | None = None,
) -> Increments:
    """Angle increments of the rows after row `first`.

    Parameters
    ----------
    record : StrapdownRecord
        increments are taken as they are, rates are integrated
    first : int
        index of the row at which the attitude is known
    rates : "instantaneous" or "averaged"
        samples of the rate (trapezoid rule), or means over the interval that ends at the row's time
    gyro_bias : sequence of 3 float or None
        rate that is taken out of every sample [rad/s]

    Raises
    ------
    InputError
        the record is not uniform, is too short, or turns by more than half a turn between two rows
    """
    if rates not in RATE_MEANINGS:
        raise InputError(f"rates '{rates}' are not known; {nearest(rates, RATE_MEANINGS)}")
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
        assert record.rate is not None
        rate = record.rate[first:]
        angle = period * (rate[1:] if rates == "averaged" else 0.5 * (rate[:-1] + rate[1:]))
    if gyro_bias is not None:
        bias = np.asarray(gyro_bias, dtype=np.float64)
        if bias.shape != (3,) or not np.isfinite(bias).all():
            raise InputError("gyro_bias must be three finite numbers [rad/s], one for each gyro")
        angle = angle - period * bias
    size = np.linalg.norm(angle, axis=1)
    long = np.flatnonzero(~(size <= MAX_INCREMENT))
    if long.size:
        k = int(long[0])
        raise InputError(
            f"{record.path}, row {int(record.row[first + 1 + k])}: a turn of {size[k]:.6g} rad since the row before; "
            f"at most half a turn ({MAX_INCREMENT:.6g} rad) can be told: are the rates in rad/s?"
        )
    time = record.time_s[0] + period * np.arange(first, len(record))
    return Increments(period, time, np.ascontiguousarray(angle))


def coarser(increments: Increments, divisor: int) -> Increments:
    """Increments of a gyro that is sampled less often: every `divisor` of them added up.

    Parameters
    ----------
    divisor : int
        1 changes nothing; increments at the end that fill no sample are left out

    Raises
    ------
    InputError
        a divisor that is not positive, or more than there are increments
    """
    count = len(increments.angle)
    if not 1 <= divisor <= count:
        raise InputError(f"--rate-divisor {divisor}: give a whole number from 1 to {count}, the record's increments")
    kept = count // divisor
    angle = increments.angle[: kept * divisor].reshape(kept, divisor, 3).sum(axis=1)
    time = increments.time_s[: kept * divisor + 1 : divisor]
    return Increments(divisor * increments.period, time, np.ascontiguousarray(angle))


def rate_at_rest(record: StrapdownRecord) -> np.ndarray | None:
    """Mean rate over the rest with which a record begins: what a user takes for the gyros' bias.

    It holds Earth's rotation too, in the components of that rest.

    Parameters
    ----------
    record : StrapdownRecord
        uniformly sampled

    Returns
    -------
    ndarray, shape (3,), or None
        [rad/s]; None where the record does not begin with a rest of at least one block (1 s)

    Raises
    ------
    InputError
        the record is not uniform
    """
    period = sampling_period(record)
    rate = record.rate if record.rate is not None else np.asarray(record.increment) / period
    size = max(2, round(REST_BLOCK / period))
    count = len(record) // size
    if count < 2:
        return None
    scatter = rate[: count * size].reshape(count, size, 3).std(axis=1).max(axis=1)
    moving = np.flatnonzero(scatter > QUIET * scatter.min())
    quiet = int(moving[0]) if moving.size else count
    return rate[: quiet * size].mean(axis=0) if quiet else None
