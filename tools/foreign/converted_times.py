"""Convert texts and counts to times from the first row: dates, clocks that change, counters that wrap."""

import re
from collections.abc import Sequence
from decimal import Decimal, InvalidOperation

import numpy as np

from ...models.arrays import Floats
from ..errors import InputError
from ..records.columns import (
    quoted,
)
from .mapping import OPEN, plural
from .names import DATE, TIMES
from .numbers import (
    clock,
    moment,
)
from .understanding import CLOCK, UnderstoodTable

DAY, HOUR = 86400.0, 3600.0
ZONE = re.compile(r"(Z|[+-]\d\d:?\d\d)$")
"""Endings of times that are not local times."""
COUNTERS = (2.0**16, 2.0**24, 2.0**31, 2.0**32)
"""Values at which counters of whole numbers wrap to zero."""
WRITTEN = (2.0**32 * 1e-9, 2.0**32 * 1e-6, 604800.0, 2.0**32 * 1e-3, 604800e3)
"""Values at which other times wrap: 32 bits in a smaller unit, and the seconds and milliseconds of a GPS week."""
WRAPPED = 20.0
"""Largest step of a counter that wraps [usual steps]."""
EPOCH = 1e8
"""Time above which times count from an epoch [s]: the first row is subtracted, since doubles would lose digits."""


def numbered_times(table: UnderstoodTable, texts: Sequence[str], values: Floats) -> Floats:
    """Return times [s] of numbers (N,): from the first row on if they count from an epoch.

    The difference is exact: doubles hold 16 digits, epochs in ns have 19.
    """
    unit = table.origins[TIMES].unit
    assert unit is not None
    if np.abs(values * unit.factor).max() > EPOCH:
        try:
            exact = [Decimal(text.strip()) for text in texts]
        except InvalidOperation:
            exact = [Decimal(repr(value)) for value in values.tolist()]
        table.start = exact[0] * Decimal(repr(unit.factor))
        values = np.array([float(time - exact[0]) for time in exact])
        table.notes.append("times count from the first row")
    return counted_times(table, values)


def written_times(table: UnderstoodTable, texts: dict[str, list[str]], lines: Sequence[int]) -> Floats:
    """Return times [s] from the first row on of times of day and dates.

    Raises InputError with the row that has none.
    """
    origin = table.origins[TIMES]
    mapping = table.whole_mapping
    order = mapping.dates or "day-first"
    dates = texts.get(DATE, [""] * len(lines))
    days, seconds = [], []
    for text, date, line in zip(texts[TIMES], dates, lines, strict=True):
        on, of_day = 0, clock(text, mapping.clock) if origin.form == CLOCK else None
        if origin.form != CLOCK:
            on, of_day = moment(text, order, mapping.clock) or (0, None)
        midnight = moment(date, order) if DATE in texts else (0, 0.0)
        if of_day is None or midnight is None:
            what = f"column {origin.name!r}: {quoted(text.strip())} has another format than the times before"
            raise InputError(f"{table.sheet.path}: row {line}, {what}")
        days.append(on + midnight[0])
        seconds.append(of_day + midnight[1])
    table.notes.append("times count from the first row")
    table.start = days[0] * Decimal(DAY) + Decimal(repr(seconds[0]))
    # days and seconds apart: doubles hold few digits of both together
    days, seconds = DAY * np.array(days), np.array(seconds)
    values = (days - days[0]) + (seconds - seconds[0]) + _clock_changes(table, days + seconds, texts[TIMES], lines)
    if origin.form == CLOCK and DATE not in texts:
        nights = np.cumsum(np.diff(values, prepend=values[0]) < -0.5 * DAY)
        if nights.any():
            table.notes.append(f"midnight passes {plural(int(nights[-1]), 'time')}")
        values = values + DAY * nights
    return values


def counted_times(table: UnderstoodTable, values: Floats) -> Floats:
    """Return times [s] of a column of numbers (N,), without the wraps of its counter."""
    unit = table.origins[TIMES].unit
    assert unit is not None
    values, wraps = unwrapped(values)
    if wraps:
        table.notes.append(f"the counter of times wraps {plural(wraps, 'time')}")
    return values * unit.factor


def _clock_changes(table: UnderstoodTable, seconds: Floats, texts: Sequence[str], lines: Sequence[int]) -> Floats:
    """Return the seconds (N,) that remove clock changes from local times; ask if one jumps at a full hour."""
    steps = np.diff(seconds)
    answer = table.mapping.clock_changes
    if not steps.size or answer == "none" or ZONE.search(texts[0].strip()):
        return 0.0 * seconds
    period = float(np.median(np.abs(steps)))
    near = max(3.0 * period, 2.0)
    # the clock is near a full hour before and after the change
    is_full = np.abs((seconds + 0.5 * HOUR) % HOUR - 0.5 * HOUR) <= near
    is_change = (np.abs(np.abs(steps - period) - HOUR) <= near) & is_full[:-1] & is_full[1:]
    changes = np.flatnonzero(is_change)
    if period > 0.1 * HOUR or not changes.size:
        return 0.0 * seconds
    if answer in ("", OPEN):
        row = int(changes[0])
        why = f"row {lines[row]} is of {texts[row].strip()!r}, the next of {texts[row + 1].strip()!r}"
        table.ask("clock_changes", ("corrected", "none"), f"{why}: whether the clock was changed")
        return 0.0 * seconds
    jumps = np.zeros(len(seconds))
    jumps[changes + 1] = -HOUR * np.sign(steps[changes] - period)
    return np.cumsum(jumps)


def unwrapped(counts: Floats) -> tuple[Floats, int]:
    """Return times (N,) of a counter without its wraps to zero, and the number of wraps; unchanged if there are
    none."""
    step = np.diff(counts)
    wraps = step < 0.0
    if not wraps.any() or wraps.all() or counts.min() < 0.0:
        return counts, 0
    usual = float(np.median(step[~wraps]))
    are_whole = np.array_equal(counts, np.round(counts))
    for size in sorted((*WRITTEN, *COUNTERS) if are_whole else WRITTEN):
        over = step[wraps] + size
        if counts.max() < size and over.min() > 0.0 and over.max() <= WRAPPED * usual:
            turns = np.append(0, np.cumsum(wraps))
            return counts + size * turns, int(turns[-1])
    return counts, 0
