"""Rows of the gyros that no motion makes: spikes, overflows to the opposite end, and lost readings as zeros."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..records import StrapdownRecord
from ..records.limits import runs_of
from ..rounding import digits

LONGEST = 3
"""A spike holds at most so many rows."""
UNLIKE = 10.0
"""A spike differs from its neighbours by so many times their own spread."""
SHARPEST = 300.0
"""No hand and no table changes a rate so fast from one row to the next and back [rad/s²]; knocks are told apart."""
LEAST_TURN = 0.01
"""Rows that turn the attitude by less are not refused [rad]."""
RANGE_PART = 0.75
"""A reading that overflows jumps by so much of the range between the channel's extremes."""
STEADY = 0.25
"""Before and behind such a jump readings change by at most so much of it."""
LONGEST_LOSS = 0.5
"""Zeros for longer are no lost readings but a rest [s]."""
FEWEST_ZEROS = 2
"""Fewer zeros in a row are a spike, if anything."""


def odd_rows(record: StrapdownRecord) -> tuple[str, ...]:
    """Say in lines which rows of the gyros no motion makes.

    Rows with a knock of the accelerometers are motion: gyros feel it too.
    """
    period = float(np.median(np.diff(record.time_s)))
    rates = record.rate
    if rates is None:
        assert record.increment is not None
        rates = record.increment / period
    knocked = _beside(record.knocks)
    lines: list[str] = []
    for axis, values in enumerate(rates.T, start=1):
        if np.ptp(values) == 0.0:
            continue
        overflowed = overflowed_rows(values)
        zeros = lost_rows(values, period) & ~overflowed
        spikes = spike_rows(values, period) & ~overflowed & ~zeros & ~knocked
        kinds = {
            "an overflow to the opposite end of the range and back; choose a larger range": overflowed,
            "lost readings, exactly 0 between readings that are not": zeros,
            "unlike their neighbours, as no motion is (a spike)": spikes,
        }
        for words, rows in kinds.items():
            if rows.any():
                lines.append(f"gyro {axis}: {_counted(record, rows)}: {words}")
    return tuple(lines)


def spike_rows(values: NDArray[np.float64], period: float) -> NDArray[np.bool_]:
    """Rows (N,) of a rate [rad/s] that stand far from their neighbours on both sides, up to three in a row."""
    count = len(values)
    spikes = np.zeros(count, dtype=bool)
    scatter = float(np.median(np.abs(np.diff(values, 2)))) if count > 2 else 0.0
    for length in range(1, LONGEST + 1):
        starts = np.arange(2, count - length - 1)
        if not len(starts):
            break
        around = values[starts + np.array([[-2], [-1], [length], [length + 1]])]
        inside = values[starts + np.arange(length)[:, None]]
        off = np.abs(inside - np.median(around, axis=0)).min(axis=0)
        usual = np.maximum(np.ptp(around, axis=0), scatter)
        found = (off > UNLIKE * usual) & (off > SHARPEST * period) & (off * period * length > LEAST_TURN)
        for ahead in range(length):
            spikes[starts[found] + ahead] = True
    return spikes


def overflowed_rows(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows (N,) of a channel between two jumps from one end of its range to the other, towards which it was moving."""
    overflowed = np.zeros(len(values), dtype=bool)
    least, largest = float(values.min()), float(values.max())
    change = np.diff(values)
    if len(change) < 3 or not least < 0.0 < largest:
        return overflowed
    usual = float(np.median(np.abs(change)))
    before, jump, behind = change[:-2], change[1:-1], change[2:]
    beside = np.maximum(np.abs(before), np.abs(behind))
    is_jump = np.abs(jump) > RANGE_PART * (largest - least)
    is_jump &= (beside < STEADY * np.abs(jump)) & (np.minimum(np.abs(before), np.abs(behind)) > usual)
    # an overflow goes on as it came, from the other end
    is_jump &= (np.sign(before) == -np.sign(jump)) & (np.sign(behind) == -np.sign(jump))
    at = np.flatnonzero(is_jump) + 2
    for first, stop in pairwise(at):
        if np.sign(jump[first - 2]) != np.sign(jump[stop - 2]):
            overflowed[first:stop] |= np.sign(values[first:stop]) == np.sign(jump[first - 2])
    return overflowed


def lost_rows(values: NDArray[np.float64], period: float) -> NDArray[np.bool_]:
    """Rows (N,) of a rate [rad/s] that are exactly 0 for a short time, between readings far from 0."""
    lost = np.zeros(len(values), dtype=bool)
    scatter = float(np.median(np.abs(np.diff(values, 2)))) if len(values) > 2 else 0.0
    begins, ends = runs_of(values == 0.0)
    for begin, end in zip(begins, ends, strict=True):
        if end - begin < FEWEST_ZEROS or (end - begin) * period > LONGEST_LOSS or begin < 2 or end > len(values) - 2:
            continue
        before, after = values[begin - 1], values[end]
        usual = max(abs(before - values[begin - 2]), abs(values[end + 1] - after), scatter)
        nearest = min(abs(before), abs(after))
        far = nearest > UNLIKE * usual and nearest * period * (end - begin) > LEAST_TURN
        if far and before * after > 0.0:
            lost[begin:end] = True
    return lost


def _beside(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """These rows (N,) and their neighbours."""
    wider = rows.copy()
    wider[1:] |= rows[:-1]
    wider[:-1] |= rows[1:]
    return wider


def _counted(record: StrapdownRecord, rows: NDArray[np.bool_]) -> str:
    """How many rows, and the first of them with its time."""
    first = int(np.argmax(rows))
    where = f"row {int(record.row[first])} ({digits(float(record.time_s[first]), 9)} s)"
    count = int(rows.sum())
    if count == 1:
        return where
    return f"{count} rows, the first {where}"
