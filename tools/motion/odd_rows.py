"""Rows of gyros and accelerometers that no motion makes: spikes, overflows to the opposite end, lost readings."""

from itertools import pairwise

import numpy as np
import scipy
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ..records import ForceRecord, RawRecord, StrapdownRecord
from ..records.limits import runs_of
from ..rounding import digits

Series = RawRecord | StrapdownRecord | ForceRecord
"""Records of readings in time."""
LONGEST = 3
"""Most rows of a spike."""
UNLIKE = 10.0
"""Distance of a spike from its neighbours over their spread."""
SHARPEST = 300.0
"""Change of a rate from one row to the next and back [rad/s²] that no hand and no table makes; knocks are excluded by
other rules."""
LEAST_TURN = 0.01
"""Rows that turn the attitude by less are not refused [rad]."""
ALONE = 30.0
"""Ratio of an accelerometer's jump to that of each other that excludes a knock."""
RANGE_PART = 0.75
"""Least jump of a reading that overflows, as a part of the range between the channel's extremes."""
STEADY = 0.25
"""Largest change of the readings before and behind this jump, as a part of it."""
TOWARDS = 5.0
"""Least jump over the usual change, towards the end of the range."""
LONGEST_LOSS = 0.5
"""Zeros for longer in a record without noise are no lost readings but a rest [s]."""
STUCK, SELDOM = 6, 0.02
"""Number of equal rows in succession that are stuck, where no larger part of the other rows repeats the one before."""
OVERFLOW = "an overflow to the opposite end of the range and back; choose a larger range"
LOST = "lost readings, exactly 0 between readings that are not"
HELD = "stuck at one value, though the readings change from row to row elsewhere"
SPIKE = "unlike their neighbours, as no motion is (a spike)"


def odd_rows_of_gyros(record: StrapdownRecord) -> tuple[str, ...]:
    """Describe the rows of the gyros that no motion can cause."""
    return _described(record, _odd_gyros(record))


def odd_rows_of_forces(record: Series) -> tuple[str, ...]:
    """Describe the rows of the accelerometers that no motion can cause."""
    return _described(record, _odd_forces(record))


def odd_rows(record: Series) -> dict[str, NDArray[np.bool_]]:
    """Return the rows (N,) of each channel that no motion can cause, by words; channels without any are left out."""
    gyros = _odd_gyros(record) if isinstance(record, StrapdownRecord) else {}
    return gyros | _odd_forces(record)


def _odd_gyros(record: StrapdownRecord) -> dict[str, NDArray[np.bool_]]:
    """Rows with a knock of the accelerometers are motion: gyros feel it too."""
    period = float(np.median(np.diff(record.time_s)))
    rates = record.rate
    if rates is None:
        assert record.increment is not None
        rates = record.increment / period
    least = max(SHARPEST * period, LEAST_TURN / period)
    spikes = unlike_rows(rates, least) & ~_beside(record.knocks)[:, None]
    return _odd(record, "gyro", rates, spikes, least)


def _odd_forces(record: Series) -> dict[str, NDArray[np.bool_]]:
    """A knock is motion: more than one accelerometer feels it."""
    period = float(np.median(np.diff(record.time_s)))
    forces = record.specific_force
    if isinstance(record, StrapdownRecord) and record.velocity_increment is not None:
        forces = record.velocity_increment / period
    spikes = unlike_rows(forces, STANDARD_GRAVITY)
    if spikes.any():
        off = np.abs(forces - scipy.ndimage.median_filter(forces, (2 * LONGEST + 3, 1)))
        spikes &= off > ALONE * np.sort(off, axis=1)[:, 1:2]
    odd = _odd(record, "accelerometer", forces, spikes, STANDARD_GRAVITY)
    lost = lost_rows(np.linalg.norm(forces, axis=1), period, 0.0)
    return {f"all accelerometers: {LOST}": lost} if lost.any() and not odd else odd


def _odd(
    record: Series,
    name: str,
    channels: NDArray,
    spikes: NDArray[np.bool_],
    least: float,
) -> dict[str, NDArray[np.bool_]]:
    """Return each kind of odd rows of each channel (N, 3), by words."""
    period = float(np.median(np.diff(record.time_s)))
    odd, moving = {}, ~_repeated_together(record)
    for axis, values in enumerate(channels.T, start=1):
        overflowed = overflowed_rows(values)
        lost = lost_rows(values, period, least) & ~overflowed
        stuck = stuck_rows(values, moving, least) & ~overflowed & ~lost
        alone = spikes[:, axis - 1] & ~overflowed & ~lost & ~stuck
        for words, rows in ((OVERFLOW, overflowed), (LOST, lost), (HELD, stuck), (SPIKE, alone)):
            if rows.any():
                odd[f"{name} {axis}: {words}"] = rows
    return odd


def _described(record: Series, odd: dict[str, NDArray[np.bool_]]) -> tuple[str, ...]:
    """Return a line for each kind of odd rows."""
    lines = []
    for words, rows in odd.items():
        channel, _, what = words.partition(": ")
        lines.append(f"{channel}: {_counted(record, rows)}: {what}")
    return tuple(lines)


def unlike_rows(channels: NDArray[np.float64], least: float) -> NDArray[np.bool_]:
    """Rows (N, K) of channels (N, K) far from their neighbours on both sides, by `least` and more; up to three."""
    count = len(channels)
    spikes = np.zeros(channels.shape, dtype=bool)
    if count < LONGEST + 5:
        return spikes
    # A spike is farther from the row before it than from the median of its neighbours, less their spread.
    steps = (np.abs(np.diff(channels, axis=0)) > (1.0 - 1.0 / UNLIKE) * least).any(axis=1)
    jumps = 1 + np.flatnonzero(steps)
    if not len(jumps):
        return spikes
    scatter = np.median(np.abs(np.diff(channels, 2, axis=0)), axis=0)
    for length in range(1, LONGEST + 1):
        starts = jumps[(jumps >= 2) & (jumps < count - length - 1)]
        around = channels[starts + np.array([[-2], [-1], [length], [length + 1]])]
        inside = channels[starts + np.arange(length)[:, None]]
        off = np.abs(inside - np.median(around, axis=0)).min(axis=0)
        far = (off > UNLIKE * np.maximum(np.ptp(around, axis=0), scatter)) & (off > least)
        for ahead in range(length):
            spikes[starts + ahead] |= far
    return spikes


def overflowed_rows(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows (N,) of a channel between two jumps from one end of its range to the other, towards which it was moving."""
    overflowed = np.zeros(len(values), dtype=bool)
    change = np.diff(values)
    if len(change) < 3 or not values.min() < 0.0 < values.max():
        return overflowed
    before, jump, behind = change[:-2], change[1:-1], change[2:]
    is_jump = np.abs(jump) > RANGE_PART * np.ptp(values)
    if not is_jump.any():
        return overflowed
    steps = np.abs([before, behind])
    is_jump &= (steps.max(axis=0) < STEADY * np.abs(jump)) & (steps.min(axis=0) > TOWARDS * np.median(np.abs(change)))
    # an overflow goes on as it came, from the other end
    is_jump &= (np.sign(before) == -np.sign(jump)) & (np.sign(behind) == -np.sign(jump))
    at = np.flatnonzero(is_jump)
    for first, stop in pairwise(at):
        if jump[first] * jump[stop] < 0.0:
            rows = slice(first + 2, stop + 2)
            overflowed[rows] |= np.sign(values[rows]) == np.sign(jump[first])
    return overflowed


def lost_rows(values: NDArray[np.float64], period: float, least: float) -> NDArray[np.bool_]:
    """Rows (N,) that are exactly 0 between readings far from 0, which times the rows are `least` and more."""
    lost = np.zeros(len(values), dtype=bool)
    if values.all():
        return lost
    scatter = float(np.median(np.abs(np.diff(values, 2)))) if len(values) > 2 else 0.0
    begins, ends = runs_of(values == 0.0)
    inner = (begins >= 2) & (ends <= len(values) - 2)
    if scatter == 0.0:
        inner &= (ends - begins) * period <= LONGEST_LOSS
    for begin, end in zip(begins[inner], ends[inner], strict=True):
        before, after = values[begin - 1], values[end]
        usual = max(abs(before - values[begin - 2]), abs(values[end + 1] - after), scatter)
        nearest = min(abs(before), abs(after))
        lost[begin:end] = before * after > 0.0 and nearest > UNLIKE * usual and nearest * (end - begin) > least
    return lost


def stuck_rows(values: NDArray[np.float64], moving: NDArray[np.bool_], least: float) -> NDArray[np.bool_]:
    """Rows (N,) at one value while others change, from which the channel jumps by what times the rows is `least`.

    `moving` (N,): rows in which some channel does not repeat the row before. A channel that often repeats a value is
    coarse, and one at its largest or least value is at its limit.
    """
    stuck = np.zeros(len(values), dtype=bool)
    repeated = np.append(False, np.diff(values) == 0.0) & moving
    begins, ends = runs_of(repeated)
    is_long = ends - begins >= STUCK - 1
    usual = repeated.copy()
    for begin, end in zip(begins[is_long], ends[is_long], strict=True):
        usual[begin:end] = False
    if not is_long.any() or usual.mean() > SELDOM:
        return stuck
    scatter = float(np.median(np.abs(np.diff(values, 2))))
    extremes = (values.min(), values.max())
    for begin, end in zip(begins[is_long], ends[is_long], strict=True):
        value = values[begin]
        around = values[[max(begin - 2, 0), min(end, len(values) - 1)]]
        jump = float(np.abs(around - value).max())
        if value not in extremes and jump > UNLIKE * scatter and jump * (end - begin) > least:
            stuck[begin - 1 : end] = True
    return stuck


def _repeated_together(record: Series) -> NDArray[np.bool_]:
    """Rows (N,) in which all channels repeat the row before: a rest without noise, or a row that is held."""
    channels = [record.specific_force]
    if isinstance(record, StrapdownRecord):
        turning = record.increment if record.rate is None else record.rate
        assert turning is not None
        channels.append(turning)
    changes = np.diff(np.hstack(channels), axis=0)
    return np.append(False, np.all(changes == 0.0, axis=1))


def _beside(rows: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """These rows (N,) and their neighbours."""
    return np.convolve(rows, np.ones(3), "same") > 0.0


def _counted(record: Series, rows: NDArray[np.bool_]) -> str:
    """Return the number of rows, and the first of them with its time."""
    first = int(np.argmax(rows))
    where = f"row {int(record.row[first])} ({digits(float(record.time_s[first]), 9)} s)"
    count = int(rows.sum())
    if count == 1:
        return where
    return f"{count} rows, the first {where}"
