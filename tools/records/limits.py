"""Limits: readings that stay at a channel's largest or least value because the instrument does not go on.

Equal extremes alone prove nothing: readings in steps, rests and a table at a constant rate have them too. They are a
limit where noise would not repeat a value as often, or where a curve runs into its extreme with a corner. Motion that
ends in a rest or in a constant rate has no corner.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import NamedTuple

import numpy as np

from ...models.arrays import Bools, Floats, Ints
from ..rounding import digits
from .kinds import RawRecord, StrapdownRecord

FEWEST = 3
"""Least number of successive rows at an extreme that may be a limit."""
DISTINCT = 20
"""A channel with fewer different values shows steps, not a limit."""
SHORT = 2
"""Most rows in succession at one value by chance; where values repeat longer, steps are wider than the noise."""
BEYOND_CHANCE = 2
"""Rows by which a run at a limit exceeds runs that chance makes elsewhere."""
LONGER = 2.0
"""A run longer than any elsewhere by this factor is no matter of steps."""
ROUGH, RESOLVED = 0.2, 2.5
"""Noise: at least the first part of the second differences that exceed the second number of resolutions change their
sign from row to row. Those of a smooth motion do not, those of its rounding are smaller."""
VISITS, NEIGHBOURS, OFTENER = 6, 20, 4
"""Rows at an extreme are a limit from the first number on, where they outnumber those at each of the neighbouring
values, of the second number, by the third factor."""
STEEP = 16.0
"""A corner needs a change of the readings by this number of resolutions."""
CORNER = 0.7
"""Part of the slope farther out that a corner keeps: a smooth extreme keeps 0.6 and less."""
BENT, STRAIGHT = 6.0, 1e-6
"""A curve is bent where its slopes differ by more than the first number of resolutions, and by more than the second
part of themselves."""
MOST_RUNS = 100
"""Most runs, the longest first, that are judged."""
STUCK, SELDOM, FAR = 5, 0.02, 3.0
"""Rows in succession at one value are stuck from the first number on, at least the third number of median deviations
out, where at most the second part of the rows repeats the row before."""
PIECES, STILL = 6, 4.0
"""A channel stands still where the means of this number of pieces differ by less than the second number, in resolutions
or in units of its noise."""
MOST_COURSES = 64
"""Channels whose course is kept: a command looks at the same readings several times."""


class Course(NamedTuple):
    """What tells limits of a channel: its least step, rows of one reading, its longest run of one, whether it is noisy.

    The counts of its largest values are in falling order, of its least values in rising order.
    """

    resolution: float
    repeats: int
    usual: int
    noisy: bool
    at_largest: Ints
    at_least: Ints


_courses: dict[tuple[int, bytes], Course | None] = {}


@dataclass(frozen=True, eq=False)
class Limits:
    """The limits of a record's channels.

    `channels`: channel ("w1", "f3", "dv2") -> its readings (N,) as they were measured, in [m/s²], of gyros in `unit`.
    `rows`: channel -> mask (N,) of the rows at a limit of it; channels without one are left out. `time_s` (N,) [s].
    """

    channels: Mapping[str, Floats]
    rows: Mapping[str, Bools]
    time_s: Floats
    unit: str

    def of(self, letter: str) -> Bools:
        """Rows (N,) at which any gyro, "w", or accelerometer, "f", is at a limit."""
        rows = np.zeros(len(self.time_s), dtype=bool)
        for name, mask in self.rows.items():
            if name.startswith(letter):
                rows |= mask
        return rows

    def among(self, chosen: Bools) -> "Limits":
        """The limits at some of the rows, a mask (N,)."""
        rows = {}
        for name, mask in self.rows.items():
            if (mask & chosen).any():
                rows[name] = mask & chosen
        return replace(self, rows=rows)

    @property
    def lines(self) -> list[str]:
        """Return warnings, a line for each channel."""
        lines = []
        for name, mask in self.rows.items():
            levels = np.unique(self.channels[name][mask])
            at = " and ".join(f"{digits(level, 6)}" for level in levels) if len(levels) <= 2 else "several values"
            first = self.time_s[np.argmax(mask)]
            unit = {"w": self.unit, "d": "m/s"}.get(name[0], "m/s²")
            lines.append(
                f"{name}: {int(mask.sum())} rows are saturated, at {at} {unit}, the first at {digits(first, 9)} s"
            )
        return lines


def channel_limits(record: StrapdownRecord | RawRecord) -> Limits:
    """The limits that a record's channels show; increments are not divided by logged times, which jitter."""
    channels, unit = {}, "rad/s"
    if isinstance(record, StrapdownRecord):
        if record.rate is not None:
            turning = record.rate
        else:
            turning = record.increment
        assert turning is not None
        channels = {}
        for axis, values in enumerate(turning.T, start=1):
            channels[f"w{axis}"] = values
        unit = unit if record.rate is not None else "rad"
        if record.velocity_increment is not None:
            for axis, values in enumerate(record.velocity_increment.T, start=1):
                channels[f"dv{axis}"] = values
    for axis, values in enumerate(record.specific_force.T, start=1):
        channels[f"f{axis}"] = values
    masks = {}
    for name, values in channels.items():
        mask = rows_at_limit(values, [channel for second, channel in channels.items() if second != name])
        if mask.any():
            masks[name] = mask
    return Limits(channels, masks, record.time_s, unit)


def rows_at_limit(values: Floats, channels: Sequence[Floats] = ()) -> Bools:
    """Rows (N,) of a channel at its largest or least value, where that is a limit, and where it is stuck.

    Where the `others`, channels (N,), stand still for a while, a rest explains equal readings.
    """
    at_limit = np.zeros(len(values), dtype=bool)
    course = _course_of(values)
    if course is None:
        return at_limit
    resolution, repeats, usual, noisy = course.resolution, course.repeats, course.usual, course.noisy
    for sign, often in ((1.0, course.at_largest), (-1.0, course.at_least)):
        upright = sign * values
        at = upright == upright.max()
        begins, ends = runs_of(at)
        longest = np.argsort(begins - ends, kind="stable")[:MOST_RUNS]
        runs = []
        for k in longest:
            if ends[k] - begins[k] >= FEWEST * repeats:
                runs.append((int(begins[k]), int(ends[k])))
        if noisy:
            is_limit = often[0] >= max(VISITS, OFTENER * often[1 : 1 + NEIGHBOURS].max())
            is_limit |= bool(runs) and is_longer(runs[0][1] - runs[0][0], usual)
        else:
            is_limit = False
        corners = (run for run in runs if has_corner(upright, run, resolution, repeats))
        if is_limit or any(not is_rest(channels, run) for run in corners):
            at_limit |= at
    if noisy:
        return at_limit | stuck_rows(values, np.concatenate([[False], np.diff(values) == 0.0]))
    return at_limit


def _course_of(values: Floats) -> Course | None:
    """Return what tells limits of a channel, None of one with few values; the same readings are looked at once."""
    key = (len(values), sha256(values.tobytes()).digest())
    if key not in _courses:
        while len(_courses) >= MOST_COURSES:
            del _courses[next(iter(_courses))]
        _courses[key] = _new_course(values)
    return _courses[key]


def _new_course(values: Floats) -> Course | None:
    distinct, counts = np.unique(values, return_counts=True)
    if len(distinct) < DISTINCT:
        return None
    resolution = resolution_of(distinct)
    repeated = np.concatenate([[False], np.diff(values) == 0.0])
    repeats = int(np.median(np.diff(np.flatnonzero(np.append(~repeated, True)))))
    begins, ends = runs_of(repeated & (values > distinct[0]) & (values < distinct[-1]))
    usual = 1 + int((ends - begins).max(initial=0))
    near = 1 + NEIGHBOURS
    return Course(
        resolution,
        repeats,
        usual,
        is_noisy(values[::repeats], resolution),
        counts[: -1 - near : -1].copy(),
        counts[:near].copy(),
    )


def resolution_of(distinct: Floats) -> float:
    """Return the least step between the different values (n,) of a channel, sorted; ignore rounding of doubles."""
    steps = np.diff(distinct)
    return float(steps[steps > 1e-12 * np.abs(distinct).max()].min(initial=np.ptp(distinct)))


def is_noisy(values: Floats, resolution: float) -> bool:
    """Return true if readings (n,) scatter from row to row by more than their resolution."""
    second = np.diff(values, 2)
    resolved = np.abs(second) > RESOLVED * resolution
    pairs = resolved[1:] & resolved[:-1]
    turning = pairs & (second[1:] * second[:-1] < 0.0)
    return bool(pairs.sum() >= DISTINCT and turning.sum() > ROUGH * pairs.sum() and pairs.mean() > SELDOM)


def is_longer(rows: int, usual: int) -> bool:
    """Return true if a run is longer than chance, or steps, make runs elsewhere, where the longest has `usual` rows."""
    if usual <= SHORT:
        return rows >= max(FEWEST, usual + BEYOND_CHANCE)
    return rows > LONGER * usual


def has_corner(values: Floats, run: tuple[int, int], resolution: float, repeats: int = 1) -> bool:
    """Return true if a curve, smooth outside, has a corner at its largest value and is bent as motion is.

    A smooth extreme has no corner; the straight ramps of a table are not bent towards their end. Every reading is
    repeated `held` times.
    """
    begin, end = run
    reach = 3 * (end - begin) + 1
    for outside in (values[max(begin - reach, 0) : begin][::-1], values[end : end + reach]):
        below = values[begin] - outside[repeats // 2 :]
        apart = repeats
        while 3 * apart < len(below):
            near, far, next_ = np.diff(below[[0, apart, 2 * apart, 3 * apart]])
            bend = far - near
            # The least distance at which it is seen whether the curve is bent tells how.
            if near > STEEP * resolution and abs(bend) > BENT * resolution + STRAIGHT * abs(far):
                if near > CORNER * far and bend > 0.0 and abs(next_ - far - bend) < bend:
                    return True
                break
            apart *= 2
    return False


def is_rest(channels: Sequence[Floats], run: tuple[int, int]) -> bool:
    """Return true if other channels are constant over a run of rows, but not around it."""
    begin, end = run
    length = end - begin
    around = (slice(max(begin - length, 0), begin), slice(end, end + length))
    moved = False
    for values in channels:
        if not stands_still(values[begin:end]):
            return False
        moved |= not all(stands_still(values[rows]) for rows in around)
    return moved


def stands_still(values: Floats) -> bool:
    """Return true if readings (n,) change by no more than their steps and noise."""
    if len(values) < 2 or np.ptp(values) == 0.0:
        return True
    means = np.array([piece.mean() for piece in np.array_split(values, min(PIECES, len(values)))])
    steps = np.abs(np.diff(values))
    return bool(np.ptp(means) <= STILL * max(float(np.median(steps)), float(steps[steps > 0.0].min())))


def stuck_rows(values: Floats, repeated: Bools) -> Bools:
    """Return rows (N,) where a channel that rarely repeats a value stays at one, far from its usual readings."""
    stuck = np.zeros(len(values), dtype=bool)
    begins, ends = runs_of(repeated)
    if (ends - begins).max(initial=0) < STUCK - 1:
        return stuck
    middle = float(np.median(values))
    far = np.abs(values - middle) > FAR * float(np.median(np.abs(values - middle)))
    begins, ends = runs_of(repeated & far)
    for begin, end in zip(begins, ends, strict=True):
        if end - begin >= STUCK - 1:
            stuck[begin - 1 : end] = True
    if np.mean(repeated & ~stuck) < SELDOM:
        return stuck
    return np.zeros(len(values), dtype=bool)


def runs_of(mask: Bools) -> tuple[Ints, Ints]:
    """Beginnings and ends of the runs of a mask (N,)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(int))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
