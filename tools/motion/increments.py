"""Angle increments of a record that is sampled uniformly: what carries an attitude."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..records import StrapdownRecord
from ..rounding import exactly
from .rests import GAP, check_meaning, check_turns, mean_rates

JITTER = 0.01
"""Largest deviation of a row's time from the uniform grid that is taken, in sampling periods."""


@dataclass(frozen=True)
class Increments:
    """Angle increments from a first row on: integrals (N, 3) of the body's rate over the intervals between rows [rad].

    The times (N + 1,) are uniform, one period apart: the first row's and the ends of the intervals [s].
    """

    period: float
    time_s: np.ndarray
    angle: np.ndarray


def sampling_period(record: StrapdownRecord) -> float:
    """Time between the rows of a uniform record [s].

    An InputError for fewer than two rows, a gap, or a time that is off the uniform grid by more than 1 % of the period.
    """
    time = record.time_s
    if len(time) < 2:
        raise InputError(f"{record.path}: has {len(time)} row; an attitude needs at least two")
    between = np.diff(time)
    usual = float(np.median(between))
    gaps = np.flatnonzero(between > GAP * usual)
    if gaps.size:
        k = int(gaps[0])
        raise InputError(
            f"{record.path}, row {int(record.row[k + 1])}, column 'time_s': a gap of {exactly(between[k], 6)} s before "
            f"{exactly(time[k + 1], 9)} s, where rows come every {exactly(usual, 6)} s; give a record without gaps"
        )
    period = float(time[-1] - time[0]) / (len(time) - 1)
    off = (time - time[0]) / period - np.arange(len(time))
    worst = int(np.argmax(np.abs(off)))
    if not abs(off[worst]) <= JITTER:
        raise InputError(
            f"{record.path}, row {int(record.row[worst])}, column 'time_s': {exactly(time[worst], 9)} s is "
            f"{exactly(100.0 * abs(off[worst]), 3)} % of the period ({exactly(period, 6)} s) off the uniform grid; "
            f"at most {exactly(100.0 * JITTER)} % is taken: give a uniformly sampled record with enough digits of time"
        )
    return period


def increments_from(
    record: StrapdownRecord,
    first: int,
    rates: str = "instantaneous",
    gyro_bias: Sequence[float] | np.ndarray | None = None,
) -> Increments:
    """Angle increments of the rows after row `first`, at which the attitude is known.

    Increments are taken as they are, rates are integrated, less a bias [rad/s]; what the rates mean as of
    `attitude_of_record`. An InputError for a record that is not uniform, is too short, or turns by more than half a
    turn between two rows.
    """
    check_meaning(rates)
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
        angle = period * mean_rates(record, rates)[first:]
    if gyro_bias is not None:
        bias = np.asarray(gyro_bias, dtype=np.float64)
        if bias.shape != (3,) or not np.isfinite(bias).all():
            raise InputError("gyro_bias must be three finite numbers [rad/s], one for each gyro")
        angle = angle - period * bias
    check_turns(record, angle)
    time = record.time_s[0] + period * np.arange(first, len(record))
    return Increments(period, time, np.ascontiguousarray(angle))


def coarser(increments: Increments, divisor: int) -> Increments:
    """Increments of a gyro that is sampled less often: every `divisor` of them added up.

    Those at the end that fill no sample are left out. An InputError for a divisor that is not positive, or more than
    there are increments.
    """
    count = len(increments.angle)
    if not 1 <= divisor <= count:
        raise InputError(f"--rate-divisor {divisor}: give a whole number from 1 to {count}, the record's increments")
    kept = count // divisor
    angle = increments.angle[: kept * divisor].reshape(kept, divisor, 3).sum(axis=1)
    time = increments.time_s[: kept * divisor + 1 : divisor]
    return Increments(divisor * increments.period, time, np.ascontiguousarray(angle))
