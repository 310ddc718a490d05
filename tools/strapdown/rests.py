"""Rests of a block that is moved by hand: where gyros and accelerometers show nothing but their noise."""

from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..records import StrapdownRecord
from ..records.noise import SCATTER_FACTOR, deviation_at_dwell
from .clipping import clipped_rests
from .reading_steps import reading_steps
from .sampling import GAP, Sampling, rates_of

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
"""A rest whose mean rate is so many times the noise of a sample from what the others make expect is a steady turn."""
FEWEST_POSES = 10
"""Of fewer rests no dependence on gravity and time is taken away before."""
REWEIGHTED = 30
"""Rounds of reweighted least squares."""


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
        bound of each mean's error, three times the Allan deviation at the length of the rests, and what steps of the
        readings leave; None where the rests are too few or too short to tell
    temperature : (K,) array or None
        [°C]
    noise : (6,) array
        scatter of one sample at rest: gyros [rad/s], accelerometers [m/s²]
    turning : int
        quiet stretches that were slow turns, left out
    clipped : int
        rests with an accelerometer at its limit, left out
    step : (3,) array
        in which each accelerometer reads [m/s²], where its noise does not average that out; else 0
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
    clipped: int = 0
    step: NDArray[np.float64] = field(default_factory=lambda: np.zeros(3))

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
    channels = [*rate.T, *record.specific_force.T]
    size = max(8, round(WINDOW / sampling.period))
    lag = max(1, min(round(LAG / sampling.period), size // 4))
    if len(record) < 2 * size:
        return _averaged(record, rate, (), np.zeros(6), 0)
    noise = np.empty(6)
    quiet = np.ones(len(record) - size + 1, dtype=bool)
    # One channel after the other: sums over an hour at 1 kHz are large.
    for k, values in enumerate(channels):
        noise[k] = _noise(values, size, lag)
        quiet &= _scatter(values, size) <= QUIET * noise[k]
    begun = np.concatenate([[0], np.cumsum(quiet)])
    at = np.arange(len(record))
    resting = begun[np.minimum(at + 1, len(quiet))] > begun[np.clip(at + 1 - size, 0, len(quiet))]
    kept, turning = [], 0
    dropped = round(SETTLING / sampling.period)
    for first, stop in _stretches(resting, record.time_s, sampling.period):
        if record.time_s[stop - 1] - record.time_s[first] < SHORTEST:
            continue
        rows = slice(first + dropped, stop - dropped)
        if _walks(np.column_stack([values[rows] for values in channels]), noise):
            turning += 1
        else:
            kept.append(rows)
    turns = _steady_turns(rate, record.specific_force, kept, noise[:3])
    turning += int(turns.sum())
    kept = [rows for rows, out in zip(kept, turns, strict=True) if not out]
    clipped = clipped_rests(record.specific_force, kept)
    kept = [rows for rows, out in zip(kept, clipped, strict=True) if not out]
    found = _averaged(record, rate, tuple(kept), np.where(np.isfinite(noise), noise, 0.0), turning)
    return replace(found, clipped=int(clipped.sum()))


def _noise(values: NDArray, size: int, lag: int) -> float:
    """Noise of a channel (N,), from differences over `lag` rows in the windows of `size` rows where they are least.

    A channel that is dead, or shows steps wider than its noise, decides nothing: its noise is infinite.
    """
    square = _window_sums((values[lag:] - values[:-lag]) ** 2, size - lag)
    most = max(1, round(QUIETEST * len(square)))
    noise = float(np.sqrt(0.5 * np.maximum(np.partition(square, most - 1)[most - 1], 0.0) / (size - lag)))
    return noise if noise > 0.0 else np.inf


def _scatter(values: NDArray, size: int) -> NDArray:
    """Standard deviation of a channel (N,) in each window of `size` rows, shape (N - size + 1,)."""
    centred = values - values.mean()
    mean = _window_sums(centred, size) / size
    return np.sqrt(np.maximum(_window_sums(centred**2, size) / size - mean**2, 0.0))


def _window_sums(values: NDArray, size: int) -> NDArray:
    """Sums of values (N,) over windows of `size` rows, shape (N - size + 1,)."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return sums[size:] - sums[:-size]


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


def _steady_turns(rate: NDArray, force: NDArray, rests: list[slice], noise: NDArray) -> NDArray[np.bool_]:
    """Rests (K,) whose mean rate is far from what the others', and their dependence on gravity and time, make expect.

    Gyros that depend on gravity read something else in every pose. The least sum of sizes (least squares, reweighted)
    is not drawn to a few turns.
    """
    if not rests:
        return np.zeros(0, dtype=bool)
    means, up = (np.array([values[rows].mean(axis=0) for rows in rests]) for values in (rate, force))
    design = np.ones((len(rests), 1))
    if len(rests) >= FEWEST_POSES:
        middle = np.array([0.5 * (rows.start + rows.stop) for rows in rests])
        design = np.column_stack([design, middle / middle.max(), up / np.abs(up).max()])
    least = np.where(np.isfinite(noise), noise, 1.0)
    found = np.zeros(len(rests), dtype=bool)
    for axis in range(3):
        left = means[:, axis] - np.median(means[:, axis])
        for _ in range(REWEIGHTED):
            root = 1.0 / np.sqrt(np.maximum(np.abs(left), 0.1 * least[axis] + 1e-300))
            solution = np.linalg.lstsq(design * root[:, None], means[:, axis] * root, rcond=1e-9)[0]
            left = means[:, axis] - design @ solution
        found |= np.abs(left) > FAR * noise[axis]
    return found


def _averaged(record: StrapdownRecord, rate: NDArray, rows: tuple[slice, ...], noise: NDArray, turning: int) -> Rests:
    def means(values: NDArray) -> NDArray:
        return np.array([values[r].mean(axis=0) for r in rows]).reshape(len(rows), *values.shape[1:])

    force_bound = _bounds(record.specific_force, rows)
    step, off = reading_steps(record.specific_force, rows) if rows else (np.zeros(3), np.zeros(3))
    return Rests(
        rows=rows,
        time_s=means(record.time_s),
        force=means(record.specific_force),
        rate=means(rate),
        force_bound=None if force_bound is None else force_bound + off,
        rate_bound=_bounds(rate, rows),
        temperature=None if record.temperature is None else means(record.temperature),
        noise=noise,
        turning=turning,
        step=step,
    )


def _bounds(values: NDArray, rows: tuple[slice, ...]) -> NDArray | None:
    """Bounds (K, 3) of the means' errors: shorter rests than the median one have larger ones, as white noise has."""
    deviation = deviation_at_dwell([values[r] for r in rows])
    if deviation is None:
        return None
    length = np.array([r.stop - r.start for r in rows], dtype=float)
    longer = np.sqrt(np.maximum(1.0, np.median(length) / length))
    return SCATTER_FACTOR * longer[:, None] * deviation
