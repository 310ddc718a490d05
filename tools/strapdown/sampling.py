"""How a strapdown record is sampled: period, jitter, gaps, saturated samples. Nothing is resampled."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records import StrapdownRecord

GAP = 1.5
"""A time between rows is a gap from so many periods on."""
CLIPPED_ROWS = 3
"""So many rows in a row at the extreme of a channel are saturated."""
STUCK_ROWS, SELDOM = 5, 0.02
"""So many rows in a row at one value, of a channel of which so few rows repeat the one before, are stuck."""
DISTINCT = 20
"""A channel with fewer different values shows steps, not a limit."""
FEWEST_ROWS = 16
"""Fewer rows tell nothing."""


@dataclass(frozen=True)
class Sampling:
    """How a record is sampled.

    Attributes
    ----------
    period : float
        mean time between rows, gaps left out [s]
    jitter_rms, jitter_max : float
        of the time between rows about the period, gaps left out [s]
    gaps : tuple of (float, float)
        beginning and length of each gap [s]
    missing : int
        rows that the gaps leave out
    saturated : dict
        channel ("w1", "f3") to the rows at its extreme, where these are saturated
    dead : tuple of str
        channels that never change
    """

    period: float
    jitter_rms: float
    jitter_max: float
    gaps: tuple[tuple[float, float], ...]
    missing: int
    saturated: dict[str, int]
    dead: tuple[str, ...]


def rates_of(record: StrapdownRecord) -> NDArray[np.float64]:
    """Rates (N, 3) [rad/s]: as measured, or the mean over the interval before each row where it has increments.

    The first increment has no interval of its own: the median one is taken for it.
    """
    if record.rate is not None:
        return record.rate
    assert record.increment is not None
    between = np.diff(record.time_s)
    return record.increment / np.concatenate([[np.median(between)], between])[:, None]


def sampling_of(record: StrapdownRecord) -> Sampling:
    """How a record is sampled; InputError where it has fewer than 16 rows."""
    if len(record) < FEWEST_ROWS:
        raise InputError(f"{record.path}: has {len(record)} rows; at least {FEWEST_ROWS} are needed")
    between = np.diff(record.time_s)
    is_gap = between > GAP * np.median(between)
    # The median tells gaps; of stamps that jitter it is off by more than the mean, by which rates would be too.
    period = float(np.mean(between[~is_gap]))
    off = between[~is_gap] - period
    channels = {f"w{i + 1}": v for i, v in enumerate(rates_of(record).T)}
    channels |= {f"f{i + 1}": v for i, v in enumerate(record.specific_force.T)}
    saturated = {name: rows for name, values in channels.items() if (rows := saturated_rows(values))}
    return Sampling(
        period=period,
        jitter_rms=float(np.sqrt(np.mean(off**2))),
        jitter_max=float(np.abs(off).max()),
        gaps=tuple((float(record.time_s[k]), float(between[k])) for k in np.flatnonzero(is_gap)),
        missing=int(np.sum(np.round(between[is_gap] / period) - 1.0)),
        saturated=saturated,
        dead=tuple(name for name, values in channels.items() if np.ptp(values) == 0.0),
    )


def saturated_rows(values: NDArray[np.float64]) -> int:
    """How many rows of a channel (N,) `saturated_mask` marks."""
    return int(np.count_nonzero(saturated_mask(values)))


def saturated_mask(values: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Rows of a channel (N,) at its largest or its least value, if that is a limit, and where it stays at another one.

    A limit is held for three rows and more and is far from what the channel reads most of the time: the steps of a
    quiet channel repeat too. A channel that hardly ever repeats a value and then stays at one, far out, is clipped too.
    """
    found = np.zeros(len(values), dtype=bool)
    if len(np.unique(values)) < DISTINCT:
        return found
    middle = float(np.median(values))
    spread = float(np.median(np.abs(values - middle)))
    for extreme in (float(values.max()), float(values.min())):
        at = values == extreme
        if abs(extreme - middle) > 3.0 * spread and longest_run(at) >= CLIPPED_ROWS:
            found |= at
    repeated = np.concatenate([[False], np.diff(values) == 0.0])
    far = np.abs(values - middle) > 3.0 * spread
    begins, ends = runs_of(repeated & far)
    held = ends - begins >= STUCK_ROWS - 1
    alone = np.array(repeated)
    for begin, end in zip(begins[held], ends[held], strict=True):
        alone[begin - 1 : end] = False
    if np.mean(alone) < SELDOM:
        for begin, end in zip(begins[held], ends[held], strict=True):
            found[begin - 1 : end] = True
    return found


def runs_of(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Beginnings and ends of the runs of a mask (N,)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(int))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)


def longest_run(mask: NDArray[np.bool_]) -> int:
    """Length of the longest run of a mask (N,)."""
    begins, ends = runs_of(mask)
    return int((ends - begins).max(initial=0))
