"""Gaps of a strapdown record, bridged: lost rows put in on a line, with a bound of the attitude error that may cause.

Of motion whose second difference from row to row, the vector's size, is at most c near the gap, the n rows on the line
miss by at most c j (n + 1 - j) / 2 each, j = 1 ... n. Attitudes turned by rates that miss by so much are apart by their
sum at most, c n (n + 1)(n + 2) / 12, whatever the motion is else: the integral of the miss.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ..errors import InputError
from ..records import StrapdownRecord
from ..result import Result
from ..rounding import exactly
from .rests import GAP

MOST_BRIDGED = 10
"""More lost rows than so many in one gap are not bridged."""
AROUND = 10
"""So many rows, and as many as are lost, are looked at on each side of a gap."""
FEWEST_AROUND = 4
"""So many second differences tell what motion does near a gap."""
ROOM = 2.0
"""Motion in a gap may bend so many times as much as it does around it. Of motion without frequencies above a tenth of
the sampling one the rows around show all but the least of what it does."""
SURE = 3.0
"""An increment that is so many bounds from what was to be expected, and not from what a whole gap adds up to, holds the
gap."""


class Bridge(Result):
    """A gap that was bridged: time of the row before it [s], rows that were put in, bound of the attitude error."""

    time_s: float
    rows: int
    bound: float = Field(alias="bound_rad")


def without_gaps(record: StrapdownRecord, most: int) -> tuple[StrapdownRecord, tuple[Bridge, ...]]:
    """A record with gaps of up to `most` lost rows bridged: readings on lines, the true attitude not known there.

    A row that was put in has the number of the row behind the gap. InputError for a gap of more rows, by its row, and
    where the rows around it do not tell what the motion does.
    """
    if not 0 <= most <= MOST_BRIDGED:
        raise InputError(f"--bridge-gaps {most}: give a whole number of rows from 0 to {MOST_BRIDGED}")
    time = record.time_s
    between = np.diff(time)
    if not len(between):
        return record, ()
    usual = float(np.median(between))
    gaps = np.flatnonzero(between > GAP * usual)
    lost = np.round(between[gaps] / usual).astype(int) - 1
    for k, count in zip(gaps, lost, strict=True):
        if count > most:
            way = "give a record without gaps"
            if count <= MOST_BRIDGED:
                way += f", or bridge it, with a bound of the error: --bridge-gaps {count}"
            raise InputError(
                f"{_row_behind(record, int(k))}: a gap of {exactly(between[k], 6)} s before "
                f"{exactly(time[k + 1], 9)} s, where rows come every {exactly(usual, 6)} s; {way}"
            )
    if not len(gaps):
        return record, ()
    bridges = []
    for k, count in zip(gaps, lost, strict=True):
        bridges.append(
            Bridge(time_s=float(time[k]), rows=int(count), bound_rad=_bound(record, int(k), int(count), usual))
        )
    bridges = tuple(bridges)
    # Numbers between those of the rows: a lost row stands a part of the way from one to the next.
    numbers = np.arange(len(time), dtype=float)
    parts = []
    for k, count in zip(gaps, lost, strict=True):
        parts.append(k + np.arange(1, count + 1) / (count + 1))
    at = np.sort(np.concatenate([numbers, *parts]))
    measured = at == np.floor(at)

    def on_lines(values: NDArray | None) -> NDArray | None:
        if values is None:
            return None
        columns = []
        for column in values.reshape(len(numbers), -1).T:
            columns.append(np.interp(at, numbers, column))
        return np.stack(columns, axis=1).reshape(len(at), *values.shape[1:])

    attitude = None
    if record.attitude is not None:
        attitude = np.full((len(at), 4), np.nan)
        attitude[measured] = record.attitude
    names = ("time_s", "rate", "increment", "velocity_increment", "specific_force", "temperature")
    filled = {name: on_lines(getattr(record, name)) for name in names}
    row = record.row[np.ceil(at).astype(int)]
    return replace(record, **filled, attitude=attitude, row=row), bridges


def _bound(record: StrapdownRecord, before: int, count: int, period: float) -> float:
    """Bound of the attitude error of a bridge over `count` rows behind row `before` [rad]."""
    if record.increment is not None:
        turns = record.increment
    else:
        turns = period * np.asarray(record.rate)
    time, reach = record.time_s, AROUND + count
    first, last = max(before + 1 - reach, 0), min(before + 1 + reach, len(turns))
    near, at = turns[first:last], np.round((time[first:last] - time[first]) / period)
    if record.increment is not None:
        _check_increment(record, before, count)
    # Divided differences, times two: second differences of rows that are one period apart.
    slope = np.diff(near, axis=0) / np.diff(at)[:, None]
    bend = 2.0 * np.diff(slope, axis=0) / (at[2:] - at[:-2])[:, None]
    if len(bend) < FEWEST_AROUND:
        raise InputError(
            f"{_row_behind(record, before)}: too few rows around a gap to bound what bridging it may cause"
        )
    largest = ROOM * float(np.linalg.norm(bend, axis=1).max())
    return largest * count * (count + 1) * (count + 2) / 12.0


def _check_increment(record: StrapdownRecord, before: int, count: int) -> None:
    """Refuse a gap whose rows are not lost: the increment behind it holds the turn over the whole of it."""
    turns = np.asarray(record.increment)
    behind = turns[before + 1]
    around = turns[max(before - AROUND, 0) : before + 2 + AROUND]
    neighbours = np.delete(around, min(before, AROUND) + 1, axis=0)
    expected = 0.5 * (turns[before] + turns[min(before + 2, len(turns) - 1)])
    change = float(np.linalg.norm(np.diff(neighbours, axis=0), axis=1).max(initial=0.0))
    alone, spread = np.linalg.norm(behind - expected), np.linalg.norm(behind - (count + 1) * expected)
    if alone > SURE * change and spread < alone:
        raise InputError(
            f"{_row_behind(record, before)}: the increment behind a gap seems to hold the turn over all of it: nothing "
            "is lost; divide it among the rows"
        )


def _row_behind(record: StrapdownRecord, before: int) -> str:
    """Where a message points to: the row behind a gap."""
    return f"{record.path}, row {int(record.row[before + 1])}, column 'time_s'"
