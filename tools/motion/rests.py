"""Sampling and rests of the record of a block moved by hand.

Nothing is resampled: period, jitter, gaps and saturated samples are stated. At rest gyros and accelerometers show
nothing but their noise.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from ...models.arrays import Bools, Floats, Ints
from ...models.rotation import MAX_INCREMENT
from ..errors import InputError, nearest
from ..memory import each, once
from ..records import StrapdownRecord
from ..records.columns import LARGEST_FORCE
from ..records.cut_off import limited_rests
from ..records.decisions import rows_of_rests
from ..records.limits import Limits, channel_limits, runs_of
from ..records.noise import SCATTER_FACTOR, deviation_at_dwell
from ..records.sigma import deviation_widening
from ..records.stamps import grid_of
from ..result import ABSENT, Array, Result
from ..rounding import digits, downwards, exactly

FEWEST_ROWS = 16
"""Fewer rows tell nothing."""
RATE_MEANINGS = ("instantaneous", "averaged")
"""Samples of the rate (trapezoid rule), or means over the interval that ends at the row's time."""
WINDOW = 0.5
"""Length of the windows in which rest is looked for [s]."""
LAG = 0.05
"""Noise is taken from differences over this time [s]: long enough for filters to forget, short for a hand."""
QUIET = 3.0
"""Largest scatter of a channel at rest over its noise."""
QUIETEST = 0.1
"""Part of the windows that shows the noise."""
IRREGULAR = 0.1
"""Where a larger part of the rows has a gap behind it, sampling is irregular, and short gaps end no rest."""
SHORTEST = 1.0
"""A rest lasts at least so long [s]."""
SETTLING = 0.2
"""Dropped at both ends of a rest [s]."""
SLOW = 3.0
"""Difference of a rest's thirds that counts as a slow turn, over the noise of a sample."""
FAR = 10.0
"""Distance of a rest's mean rate from its expectation that counts as a steady turn, over the noise of a sample."""
FEWEST_POSES = 10
"""Fewest rests from which dependences on gravity and time are subtracted."""
REWEIGHTED = 30
"""Rounds of reweighted least squares."""
FEW_VALUES = 3
"""Where the readings of a rest take at most this number of values, noise is no wider than a step, and the mean is off
by up to half of one."""
WIDE_NOISE = 0.1
"""With noise as wide as k steps the mean is off by at most this part of one step, over k. It is the first harmonic of
the rounding error: 1/π² of a step for a flat distribution, and less for a Gaussian one."""
SAME_STEP = 1e-3
"""Rounding of the multiples of a step, as a part of it: they are written with their own digits."""
TOO_FINE = 1e-6
"""Part of the range of the readings below which a step is a last digit: a record without noise has no other."""
LAST_DIGITS = 1e-12
"""Part of its largest value by which a channel without noise changes by rounding alone."""
LEAST_ROWS = 8
"""Fewest rows of a window."""
MOST_DIVISIONS = 60


class Gap(Result):
    """A gap of missing rows: beginning and length [s]."""

    time_s: float
    length_s: float


class RecordSampling(Result):
    """Sampling of a record.

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
        channel ("w1", "f3") to the rows at a limit of it
    saturated_from : dict
        such a channel to the time of the first of them [s]
    dead : tuple of str
        channels that never change
    wrapped, wrapped_from : int, float or None
        rows at which a turn of more than half a turn since the row before ends, and the time of the first [s]
    broken : (N,) array of bool
        these rows, and those with a knock: no rest or move with them is used
    """

    period: float = Field(alias="period_s")
    jitter_rms: float = Field(alias="jitter_rms_s")
    jitter_max: float = Field(alias="jitter_max_s")
    gaps: tuple[Gap, ...]
    missing: int = Field(alias="missing_rows")
    saturated: dict[str, int] = Field(alias="saturated_rows")
    saturated_from: dict[str, float] = Field(default_factory=dict, alias="saturated_from_s")
    dead: tuple[str, ...] = Field(alias="dead_channels")
    wrapped: int = Field(default=0, alias="wrapped_rows")
    wrapped_from: float | None = Field(default=None, alias="wrapped_from_s")
    limits: Limits = Field(default=ABSENT, exclude=True)
    broken: Bools = Field(default=ABSENT, exclude=True)

    @property
    def lines(self) -> list[str]:
        """Return warnings on ambiguous turns, and on channels at their limit."""
        if self.wrapped_from is None:
            return self.limits.lines
        where = "in the row at"
        if self.wrapped != 1:
            where = f"in {self.wrapped} rows, the first at"
        return [
            *self.limits.lines,
            f"w: more than half a turn since the row before {where} {digits(self.wrapped_from, 9)} s, which cannot be "
            "told (are the rates in rad/s?)",
        ]


def rates_of(record: StrapdownRecord) -> Floats:
    """Rates (N, 3) [rad/s]: as measured, or the mean over the interval before each row where it has increments.

    The first increment has no interval of its own: the median one is taken for it.
    """
    if record.rate is not None:
        return record.rate
    assert record.increment is not None
    between = np.diff(record.time_s)
    return record.increment / np.concatenate([[np.median(between)], between])[:, None]


def mean_rates(record: StrapdownRecord, rates: str) -> Floats:
    """Mean rates (N - 1, 3) over the intervals between the rows, from the samples of a record with rates [rad/s]."""
    assert record.rate is not None
    if rates == "averaged":
        return record.rate[1:]
    return 0.5 * (record.rate[1:] + record.rate[:-1])


def check_meaning(rates: str) -> None:
    """Refuse a meaning of the rates that is not one of `RATE_MEANINGS`."""
    if rates not in RATE_MEANINGS:
        raise InputError(f"rates '{rates}' are not known; {nearest(rates, RATE_MEANINGS)}")


def check_turns(record: StrapdownRecord, turns: Floats) -> None:
    """Refuse, by its row, a turn of more than half a revolution between the record's last rows (n, 3) [rad]."""
    size = np.linalg.norm(turns, axis=1)
    long = np.flatnonzero(~(size <= MAX_INCREMENT))
    if long.size:
        k = int(long[0])
        raise InputError(
            f"{record.path}, row {int(record.row[len(record) - len(turns) + k])}: a turn of "
            f"{digits(size[k], 6)} rad since the row before; at most half a turn "
            f"({downwards(MAX_INCREMENT, 6)} rad) can be told: are the rates in rad/s?"
        )


def sampling_of(record: StrapdownRecord) -> RecordSampling:
    """Return the sampling of a record; InputError where it has fewer than 16 rows."""
    if len(record) < FEWEST_ROWS:
        raise InputError(f"{record.path}: has {len(record)} rows; at least {FEWEST_ROWS} are needed")
    between = np.diff(record.time_s)
    grid = grid_of(record.time_s)
    is_gap, period = grid.is_gap, grid.period
    off = between[~is_gap] - period
    channels = {f"w{i + 1}": v for i, v in enumerate(rates_of(record).T)}
    for i, v in enumerate(record.specific_force.T):
        channels[f"f{i + 1}"] = v
    limits, wrapped = (
        once(channel_limits, record),
        wrapped_rows(record, np.concatenate([[period], np.where(is_gap, period, between)])),
    )
    first_limits = {}
    for name, mask in limits.rows.items():
        first_limits[name] = float(record.time_s[np.argmax(mask)])
    dead = []
    for name, values in channels.items():
        if np.ptp(values) == 0.0:
            dead.append(name)
    wrapped_from = None
    if wrapped.any():
        wrapped_from = float(record.time_s[np.argmax(wrapped)])
    return RecordSampling(
        period_s=period,
        jitter_rms_s=float(np.sqrt(np.mean(off**2))),
        jitter_max_s=float(np.abs(off).max()),
        gaps=tuple(Gap(time_s=record.time_s[k], length_s=between[k]) for k in np.flatnonzero(is_gap)),
        missing_rows=int(grid.lost.sum()),
        saturated_rows={name: int(mask.sum()) for name, mask in limits.rows.items()},
        saturated_from_s=first_limits,
        limits=limits,
        dead_channels=tuple(dead),
        wrapped_rows=int(wrapped.sum()),
        wrapped_from_s=wrapped_from,
        broken=wrapped | record.knocks,
    )


def wrapped_rows(record: StrapdownRecord, step: Floats) -> Bools:
    """Return rows (N,) that end an ambiguous turn, over half a revolution, in intervals (N,) [s].

    So they are whether a rate is that of its row or the mean over the interval before.
    """
    if record.increment is not None:
        turn = record.increment
    else:
        turn = rates_of(record) * step[:, None]
    return ~(np.linalg.norm(turn, axis=1) <= MAX_INCREMENT)


BY_CHANCE = 0.05
"""Chance that the bound of a mean at rest is not widened enough."""
FEWEST_FOR_NOISE = 5
"""Fewer rests tell an Allan deviation at their length by chance."""


def widened_for_rests(scatter: NDArray | None) -> Floats | None:
    """Return bounds (K, 3) of means at K rests by their scatter (K, 3); None of too few rests."""
    if scatter is None or len(scatter) < FEWEST_FOR_NOISE:
        return None
    return deviation_widening(len(scatter), BY_CHANCE) * scatter


class Rests(Result):
    """The rests of a strapdown record.

    Attributes
    ----------
    count : int
        K
    turning : int
        quiet stretches that were slow turns, left out
    clipped : int
        rests with an accelerometer at its limit, left out
    step : (3,) array
        in which each accelerometer reads [m/s²], where its noise does not average that out; else 0
    time_s : (K,) array
        middle of each rest [s]
    length_s : (K,) array
        length of the averaged part of each rest [s]
    force_bound, rate_bound : (K, 3) array or None
        bound of each mean's error [m/s²], [rad/s]: the scatter below, widened because the deviation of few rests may be
        too small. None where the rests are fewer than `FEWEST_FOR_NOISE` or too short
    force_scatter, rate_scatter : (K, 3) array or None
        three times the Allan deviation at the length of the rests, and what steps of the readings leave
    rows, clipped_rows, walking_rows : tuple of slice
        the averaged rows of each rest; the rows of each rest with an accelerometer at its limit; the rows of each quiet
        stretch whose readings walk as in a slow turn, or by a large drift
    force, rate : (K, 3) array
        mean readings [m/s²], [rad/s]
    temperature : (K,) array or None
        [°C]
    noise : (6,) array
        scatter of one sample at rest: gyros [rad/s], accelerometers [m/s²]
    """

    count: int
    turning: int = Field(alias="slow_turns_left_out")
    clipped: int = Field(alias="clipped_left_out")
    step: Array = Field(alias="reading_step_mps2")
    time_s: Array
    length_s: Array
    force_bound: Array | None = Field(alias="force_bound_mps2")
    rate_bound: Array | None = Field(alias="rate_bound_radps")
    force_scatter: Array | None = Field(default=None, exclude=True)
    rate_scatter: Array | None = Field(default=None, exclude=True)
    rows: tuple[slice, ...] = Field(default=(), exclude=True)
    clipped_rows: tuple[slice, ...] = Field(default=(), exclude=True)
    walking_rows: tuple[slice, ...] = Field(default=(), exclude=True)
    force: Array = Field(default=ABSENT, exclude=True)
    rate: Array = Field(default=ABSENT, exclude=True)
    temperature: Array | None = Field(default=None, exclude=True)
    noise: Array = Field(default=ABSENT, exclude=True)

    def __len__(self) -> int:
        return self.count


def quiet_rests(record: StrapdownRecord, sampling: RecordSampling, *, bounds: bool = True) -> Rests:
    """Find the rests of a record in which gyros and accelerometers are still, and average them.

    The bounds of the means are the noise within the rests, so that the gyros must be still, too: a trembling hand would
    be in them. Rests whose readings walk are left out. Rests that a person decided replace these. Without `bounds` the
    result has none, and no steps of the readings.
    """
    channels, quiet, noise = once(_quiet_windows, record, sampling.period)
    rate = once(rates_of, record)
    if record.decisions is not None and record.decisions.rests is not None:
        still, turning, walking = rows_of_rests(record.time_s, record.decisions.rests, str(record.path)), 0, []
    else:
        still, walking = [], []
        for rows in still_stretches(record.time_s, quiet, sampling.period, sampling.broken):
            walks = _walks(np.column_stack([values[rows] for values in channels]), noise)
            (walking if walks else still).append(rows)
        turns = _steady_turns(rate, record.specific_force, still, noise[:3])
        turning = len(walking) + int(turns.sum())
        still = [rows for rows, turns_on in zip(still, turns, strict=True) if not turns_on]
    limited = limited_rests(record.specific_force, still)
    usable, clipped = [], []
    for rows, axes in zip(still, limited, strict=True):
        if axes.any():
            clipped.append(rows)
        else:
            usable.append(rows)
    finite_noise = np.where(np.isfinite(noise), noise, 0.0)
    rests = _averaged(record, sampling, tuple(usable), finite_noise, bounds=bounds)
    left_out = {"turning": turning, "clipped": len(clipped)}
    return rests.model_copy(update={**left_out, "clipped_rows": tuple(clipped), "walking_rows": tuple(walking)})


def _quiet_windows(record: StrapdownRecord, period: float) -> tuple[list[NDArray], Bools, NDArray]:
    """Return the channels of a record without knocks, and its still windows with the noise, as of `still_windows`."""
    # A knock would be all that sums of squares hold.
    channels = [*rates_of(record).T, *np.clip(record.specific_force, -LARGEST_FORCE, LARGEST_FORCE).T]
    (still,), noise = still_windows(channels, period, [QUIET])
    return channels, still, noise


def still_windows(channels: Sequence[NDArray], period: float, limits: Sequence[float]) -> tuple[list[Bools], NDArray]:
    """Return the windows of half a second in which each channel is still, by their first rows, and the noises.

    For each limit, a channel is still where it scatters at most that many times its noise. The noise comes from
    differences over 0.05 s in the windows where they are least: a slow move has small differences and a large scatter.
    In a record without noise nothing but last digits changes at rest. No window is still in a record of less than two
    windows.
    """
    size = max(LEAST_ROWS, round(WINDOW / period))
    if len(channels[0]) < 2 * size:
        return [np.zeros(0, dtype=bool) for _ in limits], np.zeros(len(channels))
    lag = max(1, min(round(LAG / period), size // 4))
    noise = np.array([channel_noise(values, size, lag) for values in channels])
    if not np.isfinite(noise).any():
        least = [LAST_DIGITS * np.abs(values).max() for values in channels]
        changes = np.any([np.abs(np.diff(v)) > e for v, e in zip(channels, least, strict=True)], axis=0)
        return [window_sums(changes, size - 1) == 0 for _ in limits], noise
    still = [np.ones(len(channels[0]) - size + 1, dtype=bool) for _ in limits]
    # One channel after the other: sums over an hour at 1 kHz are large.
    for values, usual in zip(channels, noise, strict=True):
        scatter = window_scatter(values, size)
        for limit, windows in zip(limits, still, strict=True):
            windows &= scatter <= limit * usual
    return still, noise


def still_stretches(time: NDArray, still: Bools, period: float, broken: Bools | None = None) -> list[slice]:
    """Return the rows of each rest by its still windows, without its ends and without broken rows (N,).

    Neighbouring rows belong to one rest where one still window holds both, so that a jump between two poses parts them.
    """
    if not len(still):
        return []
    size = len(time) - len(still) + 1
    begun = np.concatenate([[0], np.cumsum(still)])
    at = np.arange(len(time) - 1)
    # A window that holds rows k and k + 1 begins between k + 2 - size and k.
    joined = begun[np.minimum(at + 1, len(still))] > begun[np.clip(at + 2 - size, 0, len(still))]
    joined[parting_gaps(time)] = False
    if broken is not None:
        joined &= ~(broken[1:] | broken[:-1])
    begins, ends = runs_of(joined)
    dropped = round(SETTLING / period)
    rests = []
    for first, last in zip(begins.tolist(), ends.tolist(), strict=True):
        if time[last] - time[first] >= SHORTEST - 0.5 * period:
            rests.append(slice(first + dropped, last + 1 - dropped))
    return rests


def channel_noise(values: NDArray, size: int, lag: int) -> float:
    """Noise of a channel (N,), from differences over `lag` rows in the windows of `size` rows where they are least.

    A channel that is dead, or shows steps wider than its noise, decides nothing: its noise is infinite.
    """
    square = window_sums((values[lag:] - values[:-lag]) ** 2, size - lag)
    most = max(1, round(QUIETEST * len(square)))
    noise = float(np.sqrt(0.5 * np.maximum(np.partition(square, most - 1)[most - 1], 0.0) / (size - lag)))
    if noise > 0.0:
        return noise
    return np.inf


def window_scatter(values: NDArray, size: int) -> NDArray:
    """Standard deviation of a channel (N,) in each window of `size` rows, shape (N - size + 1,)."""
    centred = values - values.mean()
    mean = window_sums(centred, size) / size
    return np.sqrt(np.maximum(window_sums(centred**2, size) / size - mean**2, 0.0))


def window_sums(values: NDArray, size: int) -> NDArray:
    """Sums of values (N,) over windows of `size` rows, shape (N - size + 1,)."""
    sums = np.concatenate([[0.0], np.cumsum(values)])
    return sums[size:] - sums[:-size]


def parting_gaps(time: NDArray) -> Ints:
    """Rows before the gaps that end a rest; of stamps with a gap every few rows only the long ones do."""
    grid = grid_of(time)
    if len(grid.gaps) <= IRREGULAR * len(time):
        return grid.gaps
    return grid.gaps[np.diff(time)[grid.gaps] > WINDOW]


def _walks(values: NDArray, noise: NDArray) -> bool:
    """Return true if the first and last third of a stretch (n, 6) differ by more than noise."""
    third = max(1, len(values) // 3)
    return bool((np.abs(values[-third:].mean(axis=0) - values[:third].mean(axis=0)) > SLOW * noise).any())


def _steady_turns(rate: NDArray, force: NDArray, rests: list[slice], noise: NDArray) -> Bools:
    """Return the rests (K,) whose mean rate is far from the value expected from the others, gravity and time.

    Gyros that depend on gravity read something else in every pose. The least sum of sizes (least squares, reweighted)
    is not drawn to a few turns.
    """
    if not rests:
        return np.zeros(0, dtype=bool)
    means = np.array([rate[rows].mean(axis=0) for rows in rests])
    up = np.array([force[rows].mean(axis=0) for rows in rests])
    design = np.ones((len(rests), 1))
    if len(rests) >= FEWEST_POSES:
        middle = np.array([0.5 * (rows.start + rows.stop) for rows in rests])
        design = np.column_stack([design, middle / middle.max(), up / np.abs(up).max()])
    least = np.where(np.isfinite(noise), noise, 1.0)
    turns = np.zeros(len(rests), dtype=bool)
    for axis in range(3):
        residual = means[:, axis] - np.median(means[:, axis])
        for _ in range(REWEIGHTED):
            root = 1.0 / np.sqrt(np.maximum(np.abs(residual), 0.1 * least[axis] + 1e-300))
            solution = np.linalg.lstsq(design * root[:, None], means[:, axis] * root, rcond=1e-9)[0]
            residual = means[:, axis] - design @ solution
        turns |= np.abs(residual) > FAR * noise[axis]
    return turns


def _averaged(
    record: StrapdownRecord,
    sampling: RecordSampling,
    rows: tuple[slice, ...],
    noise: NDArray,
    *,
    bounds: bool,
) -> Rests:
    def means(values: NDArray) -> NDArray:
        return np.reshape(each(_mean, values, rows), (len(rows), *values.shape[1:]))

    def scatter(values: NDArray) -> NDArray | None:
        """Return bounds of the means' errors (K, 3); larger for rests shorter than the median, as for white noise."""
        deviation = deviation_at_dwell([values[r] for r in rows]) if bounds else None
        if deviation is None:
            return None
        longer = np.sqrt(np.maximum(1.0, np.median(length) / length))
        return SCATTER_FACTOR * longer[:, None] * deviation

    length = np.array([r.stop - r.start for r in rows], dtype=float)
    rate, force_scatter = once(rates_of, record), scatter(record.specific_force)
    rate_scatter = scatter(rate)
    step, off = reading_steps(record.specific_force, rows) if rows and bounds else (np.zeros(3), np.zeros(3))
    if force_scatter is not None:
        force_scatter = force_scatter + off
    temperature = None
    if record.temperature is not None:
        temperature = means(record.temperature)
    return Rests(
        count=len(rows),
        slow_turns_left_out=0,
        clipped_left_out=0,
        reading_step_mps2=step,
        time_s=means(record.time_s),
        length_s=length * sampling.period,
        force_bound_mps2=widened_for_rests(force_scatter),
        rate_bound_radps=widened_for_rests(rate_scatter),
        force_scatter=force_scatter,
        rate_scatter=rate_scatter,
        rows=rows,
        force=means(record.specific_force),
        rate=means(rate),
        temperature=temperature,
        noise=noise,
    )


def _mean(values: NDArray) -> NDArray:
    return values.mean(axis=0)


def reading_steps(values: Floats, rests: tuple[slice, ...]) -> tuple[NDArray, NDArray]:
    """Return steps (3,) of the readings (N, 3), and the error (3,) that they may cause in a mean at rest.

    Both are in the readings' unit; the step is 0 where the readings hide none in their noise. At least one rest.
    """
    step, off = np.zeros(3), np.zeros(3)
    for p, channel in enumerate(values.T):
        distinct = [np.unique(channel[rows]) for rows in rests]
        apart = np.diff(np.unique(np.concatenate(distinct)))
        if not len(apart):
            continue
        common, count = common_divisor(apart), float(np.median([len(different) for different in distinct]))
        if count > FEW_VALUES:
            off[p] = WIDE_NOISE * common / (count - 1.0)
        elif common > TOO_FINE * apart.max():
            step[p], off[p] = common, 0.5 * common
    return step, off


def common_divisor(values: Floats) -> float:
    """Return the largest number that divides all values (n,), positive, to a thousandth of it (Euclid's algorithm).

    Of readings without a step it is as small as their last digit, or smaller.
    """
    common = float(values.min())
    for _ in range(MOST_DIVISIONS):
        remainder = np.abs(values - np.round(values / common) * common)
        remainder = remainder[remainder > SAME_STEP * common]
        if not len(remainder):
            break
        common = float(remainder.min())
    return common


def rest_warnings(rests: Rests, gravity: float) -> list[str]:
    """Return warnings on the accelerometers at rest: limits and steps."""
    lines = []
    if rests.clipped:
        lines = [f"rests with an accelerometer at its limit: {rests.clipped}, left out"]
    for p in np.flatnonzero(rests.step):
        step = exactly(rests.step[p] / gravity, 3)
        lines.append(f"f{p + 1} reads in steps of {step} g: half of one counts in its means' bounds")
    return lines
