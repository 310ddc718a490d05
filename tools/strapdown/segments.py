"""Pieces of a strapdown record over which the carried attitude is compared with what is known at their ends."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..records import StrapdownRecord
from .rests import Rests
from .sampling import GAP, Sampling, rates_of, saturated_mask

MOST_SEGMENTS = 400
"""Of more windows of one length so many are taken, spread over the record."""
LENGTH_ROOM = 0.1
"""A window may be longer or shorter by this part, where the truth is not known at every row."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Pieces of one kind.

    Attributes
    ----------
    kind : str
        "moves": between rests, the direction of gravity is known at both ends; "rests": the block does not turn;
        "windows": the true attitude is known at both ends
    label : str
        in words: "0.5 s", "2 moves"
    first, last : (S,) array of int
        rows between which the attitude is carried
    """

    kind: str
    label: str
    first: NDArray[np.int_]
    last: NDArray[np.int_]

    def __len__(self) -> int:
        return len(self.first)

    def selected(self, index: NDArray) -> "Segments":
        """The same with some of the pieces."""
        return Segments(self.kind, self.label, self.first[index], self.last[index])

    def durations(self, time_s: NDArray) -> NDArray:
        """Length of each piece (S,) [s]."""
        return time_s[self.last] - time_s[self.first]


def broken_intervals(record: StrapdownRecord, sampling: Sampling) -> NDArray[np.int_]:
    """How many of the intervals that end at rows 0 to k are of no use, shape (N,): gaps and saturated gyros."""
    bad = np.zeros(len(record), dtype=bool)
    bad[1:] = np.diff(record.time_s) > GAP * sampling.period
    rate = rates_of(record)
    for axis in range(3):
        if f"w{axis + 1}" in sampling.saturated:
            clipped = saturated_mask(rate[:, axis])
            bad |= clipped
            bad[1:] |= clipped[:-1]
    return np.cumsum(bad)


def is_whole(broken: NDArray, first: NDArray, last: NDArray) -> NDArray[np.bool_]:
    """Pieces (S,) without a gap or a saturated gyro."""
    return broken[last] == broken[first]


def rest_segments(rests: Rests, broken: NDArray) -> tuple[Segments, NDArray[np.int_]]:
    """The rests themselves, and the number of the rest of each."""
    first = np.array([rows.start for rows in rests.rows], dtype=int)
    last = np.array([rows.stop - 1 for rows in rests.rows], dtype=int)
    kept = np.flatnonzero(is_whole(broken, first, last) & (last > first))
    return Segments("rests", "rests", first[kept], last[kept]), kept


def move_segments(rests: Rests, broken: NDArray, together: int) -> tuple[Segments, NDArray[np.int_]]:
    """Moves from each rest to the one so many after it, and the number (S, 2) of the rests at their ends."""
    count = max(0, len(rests) - together)
    ends = np.column_stack([np.arange(count), np.arange(count) + together]).astype(int)
    first = np.array([rests.rows[i].stop - 1 for i in ends[:, 0]], dtype=int)
    last = np.array([rests.rows[j].start for j in ends[:, 1]], dtype=int)
    kept = is_whole(broken, first, last)
    label = "1 move" if together == 1 else f"{together} moves"
    return Segments("moves", label, first[kept], last[kept]), ends[kept]


def known_rows(record: StrapdownRecord) -> NDArray[np.int_]:
    """Rows whose true attitude is known."""
    if record.attitude is None:
        return np.zeros(0, dtype=int)
    return np.flatnonzero(np.isfinite(record.attitude).all(axis=1))


def window_segments(known: NDArray, broken: NDArray, period: float, seconds: float) -> Segments:
    """Windows of one length, side by side, between rows (K,) whose true attitude is known."""
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
    begins, ends = np.array(first, dtype=int), np.array(last, dtype=int)
    kept = np.flatnonzero(is_whole(broken, begins, ends))
    if len(kept) > MOST_SEGMENTS:
        kept = kept[np.linspace(0, len(kept) - 1, MOST_SEGMENTS).round().astype(int)]
    return Segments("windows", f"{seconds:g} s", begins[kept], ends[kept])


def all_rows(parts: Sequence[Segments]) -> NDArray[np.int_]:
    """Every row at which a piece begins or ends, in order."""
    ends = [rows for part in parts for rows in (part.first, part.last)]
    return np.unique(np.concatenate(ends)) if ends else np.zeros(0, dtype=int)
