"""Compare gyros with the true attitude: units, order and signs of axes, and the meaning of the quaternions."""

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from ..records import StrapdownRecord
from ..records.channels import Channels
from ..records.stamps import grid_of
from ..records.turned import thinned
from ..result import Array, Result
from .rests import RecordSampling, Rests, rates_of
from .turning import FEWEST_WINDOWS, LEAST_MISS, LEAST_SHARE, LEAST_TURN, beside_truth, carried, rotation_of

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

LEAST_DOWN = 0.9
"""Least part of the specific force along −z of the true attitude's reference where that points down."""
LARGEST_TURN, FASTEST = 0.5, 0.99
"""Largest turn of the block in windows that compare gyros and true attitude [rad], and the part of the rows that keep
it."""
SHORT_WINDOW = 0.5
"""Shortest windows of other checks [s]."""
LENGTH_ROOM = 0.1
"""A window may be longer or shorter by this part, where the truth is not known at every row."""
MOST_PIECES = 400
"""Most windows of one length, and most moves over several rests, that are used, spread over the record."""
SAME_AXIS = 0.95
"""Least correlation with which turns about an axis are compared in size."""
LONGEST_TURN = 2.5
"""Longer turns have no certain axis [rad]."""
LARGEST_SCALE = 6.0
"""Factor beyond which gyros are in another unit."""
Usable: TypeAlias = Callable[[NDArray, NDArray], Bools]
"""Rows at which stretches (S,) begin and end -> whether every interval of theirs can be used."""


class TruthCheck(Result):
    """Comparison of the gyros with the true attitude, where possible.

    `faults`: lines on errors found; `scale`: ratio of the true turn to each gyro's turn.
    """

    faults: tuple[str, ...]
    scale: Array


def truth_check(record: StrapdownRecord, sampling: RecordSampling, rests: Rests) -> TruthCheck | None:
    """Return faults of the gyros against the true attitude: units, order, signs of axes; None if undecidable.

    Rotations are compared, over windows in which the block turns little and over longer ones, in which gyros that lag
    follow better.
    """
    rows = known_rows(record)
    if record.attitude is None or len(rows) < FEWEST_WINDOWS:
        return None
    turns = (rotation_of(record.attitude[rows[:-1]]).inv() * rotation_of(record.attitude[rows[1:]])).magnitude()
    speed = turns / np.diff(record.time_s[rows])
    seconds = LARGEST_TURN / max(float(np.quantile(speed, FASTEST)), LARGEST_TURN / SHORT_WINDOW)
    level = np.median(rests.rate, axis=0) if len(rests) else np.zeros(3)
    step = np.concatenate([[sampling.period], np.diff(record.time_s)])
    rate = rates_of(record) - level
    if record.rate is not None:
        rate[1:] = 0.5 * (rate[1:] + rate[:-1])
    increments = rate * step[:, None]
    comparisons = []
    for length in (seconds, SHORT_WINDOW):
        # Rotations are bounded, so a few that are wrong do no harm; in degrees most seem to be more than half a turn.
        ends = windows_between(rows, usable_in(record, sampling, whole=False), sampling.period, length)
        if len(ends) < FEWEST_WINDOWS:
            continue
        true = turns_between(record.attitude, ends)
        moving = true.magnitude() > LEAST_TURN
        if moving.sum() >= FEWEST_WINDOWS:
            faults, missed = beside_truth(increments, true[moving], ends[moving], record.channels, record.time_s)
            scale = scales_of(carried(increments, ends[moving]), true[moving])
            comparisons.append((missed, TruthCheck(faults=faults, scale=scale), ends[moving]))
    if not comparisons:
        return None
    missed, check, ends = min(comparisons, key=lambda comparison: comparison[0])
    if not check.faults and missed <= 1.0 - LEAST_SHARE:
        return check
    what = "the gyros do not turn as the true attitude does"
    meaning = _meaning(record.attitude, increments, ends, min(missed, LEAST_MISS))
    if meaning:
        line = f"{what}: they do where q0..q3 are {meaning}; give them body to reference, scalar first"
    elif check.faults or (check.scale != 1.0).any():
        return check
    else:
        line = f"{what}: is it body to reference, scalar first?"
    return TruthCheck(faults=(line,), scale=np.ones(3))


def scales_of(carried_turns: "Rotation", true: "Rotation") -> Floats:
    """Return the ratio of true turns to carried turns (S) about each axis (3,).

    An axis about which they do not turn alike is as the others are; 1 where none does.
    """
    vectors, true_vectors = carried_turns.as_rotvec(), true.as_rotvec()
    short = np.maximum(carried_turns.magnitude(), true.magnitude()) < LONGEST_TURN
    size, true_size = np.square(vectors[short]).sum(axis=0), np.square(true_vectors[short]).sum(axis=0)
    told = (vectors[short] * true_vectors[short]).sum(axis=0) > SAME_AXIS * np.sqrt(size * true_size)
    scales = np.sqrt(true_size / np.where(told, size, 1.0))
    told &= (scales > 1.0 / LARGEST_SCALE) & (scales < LARGEST_SCALE)
    if not told.any():
        return np.ones(3)
    return np.where(told, scales, np.median(scales[told]))


def _meaning(attitude: NDArray, increments: NDArray, ends: NDArray, missed: float) -> str:
    """Return the meaning of a true attitude (N, 4) under which the gyros miss less; empty if no known one helps.

    Windows are rows (S, 2); missed is a part of the turns, squared.
    """
    ways = {
        "reference to body": attitude * [1.0, -1.0, -1.0, -1.0],
        "body to reference, scalar last": np.roll(attitude, 1, axis=1),
    }
    for name, meant in ways.items():
        true = turns_between(meant, ends)
        if beside_truth(increments, true, ends, Channels(), np.zeros(len(attitude)))[1] < missed:
            return name
    return ""


def turns_between(attitude: NDArray, ends: NDArray) -> "Rotation":
    """Turns (S) of a true attitude (N, 4), scalar first, between rows (S, 2), in body axes."""
    before, after = (rotation_of(attitude[rows]) for rows in ends.T)
    return before.inv() * after


def downward_warning(record: StrapdownRecord) -> tuple[str, ...]:
    """Warn where the specific force points along −z of the reference: z is down, or all accelerometers are reversed.

    Nothing else in a record can show that all are reversed, and nothing in this record which of the two it is. There is
    no line where a person has stated how the channels are read.
    """
    rows = known_rows(record)
    if record.attitude is None or not len(rows) or record.channels is not None:
        return ()
    force = record.specific_force[rows]
    mean = rotation_of(record.attitude[rows]).apply(force).mean(axis=0)
    if not mean[2] < -LEAST_DOWN * float(np.median(np.linalg.norm(force, axis=1))):
        return ()
    mends = Channels((-1, -2, -3)).options[0]
    what = "the specific force points along -z of the true attitude's reference: its z points down, or all"
    return (f"{what} accelerometers are reversed (--channels {mends}); the record cannot tell which",)


def usable_in(record: StrapdownRecord, sampling: RecordSampling, *, whole: bool = True) -> Usable:
    """Return stretches of a record without gap or saturated gyro; `whole`: without knock or ambiguous turn, too."""
    bad = np.zeros(len(record), dtype=bool)
    bad[1:] = grid_of(record.time_s).is_gap
    # In rates, both turns next to a row contain it.
    spoilt = sampling.limits.of("w") | sampling.broken if whole else sampling.limits.of("w")
    bad |= spoilt
    bad[1:] |= spoilt[:-1]
    broken = np.cumsum(bad)
    return lambda first, last: broken[last] == broken[first]


def known_rows(record: StrapdownRecord) -> Ints:
    """Return the rows whose true attitude is known."""
    if record.attitude is None:
        return np.zeros(0, dtype=int)
    return np.flatnonzero(np.isfinite(record.attitude).all(axis=1))


def windows_between(known: NDArray, usable: Usable, period: float, seconds: float) -> Ints:
    """Return windows of one length, side by side, as rows (S, 2) of the rows (K,) with known true attitude."""
    rows = max(1, round(seconds / period))
    room = max(1, int(LENGTH_ROOM * rows))
    first, last = [], []
    k = 0
    while k < len(known) - 1:
        start = known[k]
        end = int(np.searchsorted(known, start + rows))
        candidates = [e for e in (end - 1, end) if k < e < len(known)]
        best = min(candidates, key=lambda e: abs(known[e] - start - rows), default=None)
        if best is None:
            break
        if abs(known[best] - start - rows) > room:
            k += 1
            continue
        first.append(start)
        last.append(known[best])
        k = best
    windows = np.column_stack([np.array(first, dtype=int), np.array(last, dtype=int)])
    return windows[thinned(np.flatnonzero(usable(windows[:, 0], windows[:, 1])), MOST_PIECES)]
