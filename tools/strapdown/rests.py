"""Rests of a block that is moved by hand: where gyros and accelerometers show nothing but their noise."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from trihedron.records import StrapdownRecord
from trihedron.records.allan import deviation_at_dwell
from trihedron.records.noise import SCATTER_FACTOR
from trihedron.strapdown.sampling import GAP, Sampling, rates_of

WINDOW = 0.5
"""Length of the windows in which rest is looked for [s]."""
LAG = 0.05
"""Noise is taken from differences over this time [s]: long enough for filters to forget, short for a hand."""
QUIET = 3.0
"""A window is quiet when no channel scatters so many times as much as its noise."""
QUIETEST = 0.1
"""Part of the windows that shows the noise."""
SHORTEST = 1.0
"""A rest lasts at least so long [s]."""
SETTLING = 0.2
"""Dropped at both ends of a rest [s]."""
SLOW = 3.0
"""A rest whose thirds differ by so many times the noise of a sample is a slow turn."""
FAR = 10.0
"""A rest whose mean rate is so many times the noise of a sample from the median rest's is a steady turn."""


@dataclass(frozen=True, eq=False)
class Rests:
    """The rests of a strapdown record.

    Attributes
    ----------
    rows : tuple of slice
        the rows that are averaged, of each rest
    time_s : (K,) array
        middle of each rest [s]
    force, rate : (K, 3) array
        mean readings [m/s²], [rad/s]
    force_bound, rate_bound : (K, 3) array or None
        bound of each mean's error, three times the Allan deviation at the length of the rests; None where these are
        too few or too short to tell
    temperature : (K,) array or None
        [°C]
    noise : (6,) array
        scatter of one sample at rest: gyros [rad/s], accelerometers [m/s²]
    turning : int
        quiet stretches that were slow turns, left out
    """

    rows: tuple[slice, ...]
    time_s: NDArray[np.float64]
    force: NDArray[np.float64]
    rate: NDArray[np.float64]
    force_bound: NDArray[np.float64] | None
    rate_bound: NDArray[np.float64] | None
    temperature: NDArray[np.float64] | None
    noise: NDArray[np.float64]
    turning: int

    def __len__(self) -> int:
        return len(self.rows)


def find_rests(record: StrapdownRecord, sampling: Sampling) -> Rests:
    """Find the rests of a record and average them.

    A window is quiet when each channel scatters in it less than three times as much as its noise, which is taken from
    differences over 0.05 s in the windows where they are least: a slow move has small differences and a large
    scatter. Rests are quiet stretches of a second and more without a gap, whose readings do not walk.

    Parameters
    ----------
    record : StrapdownRecord
    sampling : Sampling
        of that record

    Returns
    -------
    Rests
        none at all where nothing is quiet
    """
    rate = rates_of(record)
    channels = np.hstack([rate, record.specific_force])
    size = max(8, round(WINDOW / sampling.period))
    lag = max(1, min(round(LAG / sampling.period), size // 4))
    if len(record) < 2 * size:
        return _averaged(record, rate, (), np.zeros(6), 0)
    scatter = _scatter(channels, size)
    apart = channels[lag:] - channels[:-lag]
    sums = np.vstack([np.zeros((1, 6)), np.cumsum(apart**2, axis=0)])
    differences = np.sqrt(0.5 * np.maximum(sums[size - lag :] - sums[: lag - size], 0.0) / (size - lag))
    most = max(1, round(QUIETEST * len(scatter)))
    noise = np.sort(differences, axis=0)[:most].max(axis=0)
    # A channel that is dead, or shows steps wider than its noise, decides nothing.
    noise = np.where(noise > 0.0, noise, np.inf)
    quiet = np.all(scatter <= QUIET * noise, axis=1)
    begun = np.concatenate([[0], np.cumsum(quiet)])
    at = np.arange(len(record))
    resting = begun[np.minimum(at + 1, len(scatter))] > begun[np.clip(at + 1 - size, 0, len(scatter))]
    kept, turning = [], 0
    dropped = round(SETTLING / sampling.period)
    for first, stop in _stretches(resting, record.time_s, sampling.period):
        if record.time_s[stop - 1] - record.time_s[first] < SHORTEST:
            continue
        rows = slice(first + dropped, stop - dropped)
        if _walks(channels[rows], noise):
            turning += 1
        else:
            kept.append(rows)
    if kept:
        means = np.array([rate[rows].mean(axis=0) for rows in kept])
        far = np.any(np.abs(means - np.median(means, axis=0)) > FAR * noise[:3], axis=1)
        turning += int(far.sum())
        kept = [rows for k, rows in enumerate(kept) if not far[k]]
    return _averaged(record, rate, tuple(kept), np.where(np.isfinite(noise), noise, 0.0), turning)


def _scatter(channels: NDArray, size: int) -> NDArray:
    """Standard deviation of each channel in each window of `size` rows, shape (N - size + 1, 6)."""
    centred = channels - channels.mean(axis=0)
    sums = np.vstack([np.zeros((1, 6)), np.cumsum(centred, axis=0)])
    squares = np.vstack([np.zeros((1, 6)), np.cumsum(centred**2, axis=0)])
    mean = (sums[size:] - sums[:-size]) / size
    return np.sqrt(np.maximum((squares[size:] - squares[:-size]) / size - mean**2, 0.0))


def _stretches(resting: NDArray, time: NDArray, period: float) -> list[tuple[int, int]]:
    """Beginnings and ends of the stretches of quiet rows between moves and gaps."""
    found: list[tuple[int, int]] = []
    breaks = np.flatnonzero(np.diff(time) > GAP * period) + 1
    edges = np.concatenate([[0], breaks, [len(time)]])
    for low, high in pairwise(edges):
        steps = np.diff(np.concatenate([[False], resting[low:high], [False]]).astype(int))
        begins, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
        found += [(int(low + a), int(low + b)) for a, b in zip(begins, ends, strict=True)]
    return found


def _walks(values: NDArray, noise: NDArray) -> bool:
    """Whether the first and the last third of a stretch (n, 6) differ as no noise makes them."""
    third = max(1, len(values) // 3)
    return bool((np.abs(values[-third:].mean(axis=0) - values[:third].mean(axis=0)) > SLOW * noise).any())


def _averaged(record: StrapdownRecord, rate: NDArray, rows: tuple[slice, ...], noise: NDArray, turning: int) -> Rests:
    def means(values: NDArray) -> NDArray:
        return np.array([values[r].mean(axis=0) for r in rows]).reshape(len(rows), *values.shape[1:])

    return Rests(
        rows=rows,
        time_s=means(record.time_s),
        force=means(record.specific_force),
        rate=means(rate),
        force_bound=_bounds(record.specific_force, rows),
        rate_bound=_bounds(rate, rows),
        temperature=None if record.temperature is None else means(record.temperature),
        noise=noise,
        turning=turning,
    )


def _bounds(values: NDArray, rows: tuple[slice, ...]) -> NDArray | None:
    """Bounds (K, 3) of the means' errors: shorter rests than the median one have larger ones, as white noise has."""
    deviation = deviation_at_dwell([values[r] for r in rows])
    if deviation is None:
        return None
    length = np.array([r.stop - r.start for r in rows], dtype=float)
    longer = np.sqrt(np.maximum(1.0, np.median(length) / length))
    return SCATTER_FACTOR * longer[:, None] * deviation
