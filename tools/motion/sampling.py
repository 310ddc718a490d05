"""How a strapdown record is sampled: period, jitter, gaps, saturated samples. Nothing is resampled."""

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.attitude import MAX_INCREMENT
from ..errors import InputError, nearest
from ..records import StrapdownRecord
from ..result import Result

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
RATE_MEANINGS = ("instantaneous", "averaged")
"""Samples of the rate (trapezoid rule), or means over the interval that ends at the row's time."""


class Gap(Result):
    """Where rows are missing: beginning and length [s]."""

    time_s: float
    length_s: float


class Sampling(Result):
    """How a record is sampled.

    Attributes
    ----------
    period : float
        mean time between rows, gaps left out [s]
    jitter_rms, jitter_max : float
        of the time between rows about the period, gaps left out [s]
    gaps : tuple of Gap
    missing : int
        rows that the gaps leave out
    saturated : dict
        channel ("w1", "f3") to the rows at its extreme, where these are saturated
    dead : tuple of str
        channels that never change
    """

    period: float = Field(alias="period_s")
    jitter_rms: float = Field(alias="jitter_rms_s")
    jitter_max: float = Field(alias="jitter_max_s")
    gaps: tuple[Gap, ...]
    missing: int = Field(alias="missing_rows")
    saturated: dict[str, int] = Field(alias="saturated_rows")
    dead: tuple[str, ...] = Field(alias="dead_channels")


def rates_of(record: StrapdownRecord) -> NDArray[np.float64]:
    """Rates (N, 3) [rad/s]: as measured, or the mean over the interval before each row where it has increments.

    The first increment has no interval of its own: the median one is taken for it.
    """
    if record.rate is not None:
        return record.rate
    assert record.increment is not None
    between = np.diff(record.time_s)
    return record.increment / np.concatenate([[np.median(between)], between])[:, None]


def mean_rates(record: StrapdownRecord, rates: str) -> NDArray[np.float64]:
    """Mean rates (N - 1, 3) over the intervals between the rows, from the samples of a record [rad/s].

    Parameters
    ----------
    record : StrapdownRecord
        with rates
    rates : str
        one of `RATE_MEANINGS`
    """
    assert record.rate is not None
    return record.rate[1:] if rates == "averaged" else 0.5 * (record.rate[1:] + record.rate[:-1])


def check_meaning(rates: str) -> None:
    """Refuse a meaning of the rates that is not one of `RATE_MEANINGS`."""
    if rates not in RATE_MEANINGS:
        raise InputError(f"rates '{rates}' are not known; {nearest(rates, RATE_MEANINGS)}")


def check_turns(record: StrapdownRecord, turns: NDArray[np.float64]) -> None:
    """Refuse turns between the record's last rows (n, 3) [rad] of which one is by more than half a turn, by its row."""
    size = np.linalg.norm(turns, axis=1)
    long = np.flatnonzero(~(size <= MAX_INCREMENT))
    if long.size:
        k = int(long[0])
        raise InputError(
            f"{record.path}, row {int(record.row[len(record) - len(turns) + k])}: a turn of {size[k]:.6g} rad since "
            f"the row before; at most half a turn ({MAX_INCREMENT:.6g} rad) can be told: are the rates in rad/s?"
        )


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
    saturated = {name: int(np.count_nonzero(saturated_mask(values))) for name, values in channels.items()}
    return Sampling(
        period_s=period,
        jitter_rms_s=float(np.sqrt(np.mean(off**2))),
        jitter_max_s=float(np.abs(off).max()),
        gaps=tuple(Gap(time_s=record.time_s[k], length_s=between[k]) for k in np.flatnonzero(is_gap)),
        missing_rows=int(np.sum(np.round(between[is_gap] / period) - 1.0)),
        saturated_rows={name: rows for name, rows in saturated.items() if rows},
        dead_channels=tuple(name for name, values in channels.items() if np.ptp(values) == 0.0),
    )


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
        begins, ends = runs_of(at)
        if abs(extreme - middle) > 3.0 * spread and (ends - begins).max(initial=0) >= CLIPPED_ROWS:
            found |= at
    repeated = np.concatenate([[False], np.diff(values) == 0.0])
    far = np.abs(values - middle) > 3.0 * spread
    begins, ends = runs_of(repeated & far)
    held = ends - begins >= STUCK_ROWS - 1
    stuck = np.zeros(len(values), dtype=bool)
    for begin, end in zip(begins[held], ends[held], strict=True):
        stuck[begin - 1 : end] = True
    return found | stuck if np.mean(repeated & ~stuck) < SELDOM else found


def runs_of(mask: NDArray[np.bool_]) -> tuple[NDArray[np.int_], NDArray[np.int_]]:
    """Beginnings and ends of the runs of a mask (N,)."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(int))
    return np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
