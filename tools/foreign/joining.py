"""Join accelerometers and gyros of two files to one record on their clocks."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.columns import FORCE, RATE, STRAPDOWN_RATES, TEMPERATURE, RecordKind
from ..rounding import digits, upwards
from .conversion import Conversion
from .names import TIMES
from .understanding import UnderstoodTable

GYROS = RecordKind("gyro record", (TIMES, *RATE), (TEMPERATURE,))
"""Gyros alone: one of two files."""
ALIKE = 1e-6
"""Largest difference of stamps that are the same [steps]."""
LONGEST_LAG = 0.5
"""Largest lag that is looked for [s]."""
LEAST_CORRELATION = 0.7
"""Correlation from which a lag is stated."""
LEAST_GAP = 5.0
"""Steps of the slower clock from which a gap is not bridged by interpolation."""

Side = tuple[UnderstoodTable, Conversion]


@dataclass(frozen=True)
class Clocks:
    """Times of two files on one clock [s], and the rows of the faster one that the slower one surrounds."""

    fast: NDArray[np.float64]
    slow: NDArray[np.float64]
    inside: NDArray[np.bool_]


def joined(forces: Side, rates: Side) -> Side:
    """Return one table of both files, on the faster clock; the slower readings are interpolated linearly.

    Raises InputError if the clocks have less than three rows in common.
    """
    (force_table, force), (rate_table, rate) = forces, rates
    shift = float(rate_table.start - force_table.start)
    times = (force.numbers[TIMES], rate.numbers[TIMES] + shift)
    faster = int(np.median(np.diff(times[1])) < np.median(np.diff(times[0])) * (1.0 - ALIKE))
    sides = ((force_table, force, FORCE), (rate_table, rate, RATE))
    fast, slow = sides[faster], sides[1 - faster]
    clocks = _clocks(times[faster], times[1 - faster], fast[0], slow[0])
    numbers = {TIMES: clocks.fast[clocks.inside] - (0.0 if force_table.start == 0 else clocks.fast[clocks.inside][0])}
    notes = [*force_table.notes, *rate_table.notes]
    for column in fast[2]:
        numbers[column] = fast[1].numbers[column][clocks.inside]
    bound = 0.0
    for column in slow[2]:
        values = slow[1].numbers[column]
        numbers[column] = np.interp(clocks.fast[clocks.inside], clocks.slow, values)
        bound = max(bound, float(np.abs(np.diff(values, 2)).max(initial=0.0)) / 8.0)
    unit, name = ("m/s²", "accelerometers") if slow[2] is FORCE else ("rad/s", "gyros")
    if _same(clocks):
        notes.append("both files have the same times")
    else:
        within = f"within {upwards(bound)} {unit}, an eighth of the largest second difference"
        notes.append(f"the {name} are interpolated linearly to the times of {fast[0].sheet.path.name}, {within}")
    notes.append(_lag_note(numbers))
    for free in rate_table.free_fields:
        if free.head.text:
            notes.append(f"left out of {rate_table.sheet.path.name}: column {free.head.text!r}")
    force_table.kind, force_table.notes = STRAPDOWN_RATES, []
    force_table.origins |= {column: origin for column, origin in rate_table.origins.items() if column in RATE}
    rows = fast[1].row[clocks.inside]
    left_out = {**force.left_out, **rate.left_out}
    outside = int(np.count_nonzero(~clocks.inside))
    if outside:
        notes.append(f"{outside} rows of {fast[0].sheet.path.name} are outside the times of {slow[0].sheet.path.name}")
    resolution = {} if slow[2] is FORCE and not _same(clocks) else force.resolution
    return force_table, Conversion(numbers, {}, rows, left_out, resolution, notes=list(dict.fromkeys(notes)))


def _same(clocks: Clocks) -> bool:
    inside = clocks.fast[clocks.inside]
    nearest = np.interp(inside, clocks.slow, np.arange(len(clocks.slow)))
    return bool(np.abs(nearest - np.round(nearest)).max() < ALIKE)


def _clocks(
    fast: NDArray[np.float64], slow: NDArray[np.float64], fast_table: UnderstoodTable, slow_table: UnderstoodTable
) -> Clocks:
    """Return both times, and the rows of the faster clock between two readings of the slower one.

    Raises InputError if a clock runs backwards, or if they have no time in common.
    """
    for table, times in ((fast_table, fast), (slow_table, slow)):
        back = np.flatnonzero(np.diff(times) <= 0.0)
        if len(back):
            raise InputError(f"{table.sheet.path}: row {back[0] + 1} of its data: the time does not rise")
    edge = ALIKE * float(np.median(np.diff(slow)))
    inside = (fast >= slow[0] - edge) & (fast <= slow[-1] + edge)
    after = np.clip(np.searchsorted(slow, fast), 1, len(slow) - 1)
    gaps = slow[after] - slow[after - 1]
    inside &= gaps <= LEAST_GAP * float(np.median(np.diff(slow)))
    if np.count_nonzero(inside) < 3:
        spans = [
            f"{table.sheet.path.name} from {times[0]:.6g} to {times[-1]:.6g} s"
            for table, times in ((fast_table, fast), (slow_table, slow))
        ]
        raise InputError(f"{fast_table.sheet.path}: no times in common: {', '.join(spans)}; give files of one clock")
    return Clocks(fast, slow, inside)


def _lag_note(numbers: dict[str, NDArray[np.float64]]) -> str:
    """Return the lag of the gyros behind the accelerometers, by turns of gravity, or that it cannot be estimated."""
    lag, correlation = lag_of(numbers)
    if correlation < LEAST_CORRELATION:
        return "no lag between the files can be estimated: too little of the motion turns gravity"
    behind = "behind" if lag >= 0.0 else "ahead of"
    return (
        f"the gyros are {digits(abs(lag), 2)} s {behind} the accelerometers (correlation {digits(correlation, 2)}); "
        "not corrected"
    )


def lag_of(numbers: dict[str, NDArray[np.float64]]) -> tuple[float, float]:
    """Return the lag [s] of the gyros behind the accelerometers, and the correlation of the turns of gravity there."""
    time = numbers[TIMES]
    step = float(np.median(np.diff(time)))
    count = int((time[-1] - time[0]) / step)
    shifts = int(LONGEST_LAG / step)
    if not 4 * shifts < count < 5_000_000 or shifts < 1:
        return 0.0, 0.0
    grid = time[0] + step * np.arange(count)
    width = max(int(0.05 / step), 1)
    smooth = np.ones(width) / width
    force = np.stack([np.convolve(np.interp(grid, time, numbers[name]), smooth, "same") for name in FORCE], axis=1)
    rate = np.stack([np.convolve(np.interp(grid, time, numbers[name]), smooth, "same") for name in RATE], axis=1)
    up = force / np.maximum(np.linalg.norm(force, axis=1, keepdims=True), 1e-9)
    # gravity turns against the block
    turning = np.linalg.norm(np.gradient(up, step, axis=0), axis=1)
    expected = np.linalg.norm(np.cross(rate - np.median(rate, axis=0), up), axis=1)
    scores = []
    for shift in range(-shifts, shifts + 1):
        behind = expected[shifts + shift : count - shifts + shift]
        scores.append(_correlation(turning[shifts : count - shifts], behind))
    best = int(np.argmax(scores))
    lag = float(best - shifts)
    if 0 < best < len(scores) - 1:
        left, top, right = scores[best - 1 : best + 2]
        curvature = left - 2.0 * top + right
        if curvature < 0.0:
            lag += 0.5 * (left - right) / curvature
    return lag * step, float(scores[best])


def _correlation(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    a, b = a - a.mean(), b - b.mean()
    size = float(np.sqrt(np.dot(a, a) * np.dot(b, b)))
    return float(np.dot(a, b)) / size if size > 0.0 else 0.0
