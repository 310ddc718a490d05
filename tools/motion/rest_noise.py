"""Noise of gyros and accelerometers at rest: white noise, flicker noise, and a test for anything more.

The noise comes from within the rests, over the times at which it is least. A change of bias between rests, or slowly
within one, is not noise; it is refused if the rests show more of it than flicker noise causes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.bench import EARTH_RATE
from ..memory import once
from ..records import StrapdownRecord
from ..records.noise import SCATTER_FACTOR, allan_deviation_of_sums, sums_of
from ..rounding import digits
from .rests import Rests, rates_of

FLICKER_TO_ALLAN = 2.0 * math.log(2.0)
"""Square of flicker noise's Allan deviation over its coefficient: a mean over τ wanders about the mean over T by the
coefficient times ln(T/τ), mean square."""
ANY_BEYOND = 5e-3
"""Probability that any of a record's errors of one kind is beyond its bound, were they Gaussian."""
BY_CHANCE = 0.25
"""Probability that the rests show less wandering than is taken for it."""
UNSTEADY = 1e-3
"""Probability that noise alone makes the means of rests differ as much as those that are called unsteady."""
SETTLING = 60
"""Time constants with which biases may settle, from the shortest rest to the record's length."""
SPARE = 4
"""Least number of rests beyond the number of terms."""
OCTAVES, SHORTEST = 4, 0.1
"""Averaging times at which noise is looked for: from half the median rest down, each half the one before, but not below
this [s], where filters hide it."""
LEAST_RATE = 1e-12
"""Bounds of rates are not taken for less [rad/s]: arithmetic has errors too."""


@dataclass(frozen=True, eq=False)
class RestNoise:
    """Noise of three gyros, or accelerometers, at rest: white noise and flicker noise of each.

    `white` (3,): mean square of a mean over one second [rad²/s²]. `flicker` (3,): square of the flat part of the Allan
    deviation [rad²/s²]. `least` (3,): square of its least value, white noise included, and `count` (3,) its degrees of
    freedom. `wander` (3,): mean square difference of the means at rest from one rest to the next, beside white noise
    [rad²/s²]; NaN where it is not known or no noise. `span`: length of the record [s]. `unsteady`: for each gyro whose
    means differ by more than noise its number, the difference, and that of noise, rms [rad/s]. `jumps`: whether noise
    explains the differences once the biases change at one time between two rests, or settle as an exponential of time;
    `wander` is beside that.
    """

    white: Floats
    flicker: Floats
    least: Floats
    count: Floats
    wander: Floats
    span: float
    unsteady: tuple[tuple[int, float, float], ...] = ()
    jumps: bool = False

    def rate_square(self, seconds: NDArray) -> Floats:
        """Mean square (S, 3) of a mean rate's error over times (S,) [rad²/s²]."""
        seconds = np.maximum(np.asarray(seconds, dtype=float), 1e-9)[:, None]
        wandering = self.flicker * self._octaves(seconds)
        slow = np.where(np.isfinite(self.wander), np.maximum(self.wander, self.flicker), wandering)
        return np.maximum(self.white / seconds + slow, LEAST_RATE**2)

    def angle_square(self, seconds: NDArray) -> Floats:
        """Mean square (S,) of the turn about any axis over times (S,) that is noise [rad²]."""
        return self.rate_square(seconds).max(axis=1) * np.asarray(seconds, dtype=float) ** 2

    def judged(self, scatter: NDArray, free: int, seconds: NDArray) -> "RestNoise":
        """Return the noise, judged by mean squares (3,) of the differences between means over times (K,).

        White noise and flicker noise limit the differences by the least Allan deviation and the length of the record;
        Earth's rate in poses of unknown heading adds to them. Differences beyond that, except by chance (an F test),
        are no noise.
        """
        white = self.white * float(np.mean(1.0 / seconds))
        expected = white + self.least * float(np.mean(self._octaves(seconds))) + EARTH_RATE**2
        refused = scatter > expected * scipy.special.fdtri(free, self.count, 1.0 - UNSTEADY)
        # So few rests may show too little of it by chance.
        surely = free / float(2.0 * scipy.special.gammaincinv(0.5 * free, BY_CHANCE))
        # If one gyro wanders, the scatter of the others is not taken for noise either.
        if refused.any():
            wander = np.full(3, np.nan)
        else:
            wander = np.maximum(surely * scatter - white, 0.0)
        apart = zip(np.sqrt(scatter).tolist(), np.sqrt(expected).tolist(), strict=True)
        pairs = []
        for k, pair in enumerate(apart):
            if refused[k]:
                pairs.append((k + 1, *pair))
        unsteady = tuple(pairs)
        return replace(self, wander=wander, unsteady=unsteady)

    @property
    def said(self) -> str | None:
        """Return a message if the gyros are not constant at rest beyond noise, or None."""
        if not self.unsteady:
            return None
        sentences = []
        for gyro, scatter, expected in self.unsteady:
            sentences.append(f"gyro {gyro} by {digits(scatter, 2)} rad/s rms, where noise makes {digits(expected, 2)}")
        gyros = ", ".join(sentences)
        once = ""
        if self.jumps:
            once = "; biases that change once, or settle, explain that"
        return (
            "the gyros are not constant at rest: beside what time, temperature and gravity explain, their means differ "
            f"from rest to rest, {gyros}{once}"
        )

    def _octaves(self, seconds: NDArray) -> Floats:
        """Return the mean square of means over times within the record, for flicker noise of unit Allan deviation."""
        return np.maximum(1.0, np.log(np.maximum(self.span / seconds, 1.0)) / FLICKER_TO_ALLAN)


def factor_for(rows: int) -> float:
    """Return a ratio of bound to standard deviation that none of `rows` errors is likely to exceed; at least three."""
    return max(SCATTER_FACTOR, -float(scipy.special.ndtri(0.5 * ANY_BEYOND / max(rows, 1))))


def gyro_noise(record: StrapdownRecord, rests: Rests, period: float, up: Floats | None = None) -> RestNoise | None:
    """Return the noise of the gyros from the rests; None if these are too few or too short.

    Differences between the rests' means that no drift, gravity or temperature explains count as noise too, up to the
    size that flicker noise causes. `up` (K, 3) are the directions of gravity at the rests, where known.
    """
    noise = once(rest_noise, once(rates_of, record), record.time_s, rests, period)
    scatter = None
    if noise is not None:
        scatter = rest_scatter(rests, up)
    if noise is None or scatter is None:
        return noise
    lengths = rest_lengths(rests, period)
    judged = noise.judged(*scatter, lengths)
    if not judged.unsteady:
        return judged
    # Beside the rests before and after it a change at one of them could be anything.
    time = rests.time_s - rests.time_s[0]
    changes = []
    for k in range(2, len(rests) - 1):
        changes.append((time >= time[k]).astype(float))
    changes += [np.exp(-time / constant) for constant in np.geomspace(lengths.min(), time[-1] + lengths[-1], SETTLING)]
    candidates = []
    for column in changes:
        scatter_of_rests = rest_scatter(rests, up, column)
        if scatter_of_rests is not None:
            candidates.append(noise.judged(*scatter_of_rests, lengths))
    steady = [candidate for candidate in candidates if not candidate.unsteady]
    if not steady:
        return judged
    least = min(steady, key=lambda candidate: float(candidate.wander.sum()))
    return replace(least, unsteady=judged.unsteady, jumps=True)


def rest_noise(readings: NDArray, time_s: NDArray, rests: Rests, period: float) -> RestNoise | None:
    """Return the noise of readings (N, 3) within rests, without changes between rests; None if undetermined.

    White noise falls with the averaging time and flicker noise does not: two Allan deviations an octave apart tell them
    apart, the least one and that before it. Slow errors, which grow with the time, are behind these.
    """
    pieces = [readings[rows] for rows in rests.rows]
    rows = 0
    if pieces:
        rows = int(np.median([len(piece) for piece in pieces]))
    if rows < 8:
        return None
    sizes = [rows >> octave for octave in range(1, OCTAVES + 2)]
    longer = []
    for size in sizes[2:]:
        if size * period >= SHORTEST:
            longer.append(size)
    sizes = np.array(sizes[:2] + longer)
    sums = [sums_of(piece) for piece in pieces]
    of_sizes = np.array([allan_square(sums, size) for size in sizes.tolist()])
    squares, counts = of_sizes[:, 0], of_sizes[:, 1]
    channels, at = np.arange(3), np.argmin(squares[:-1], axis=0)
    half, quarter = squares[at, channels], squares[at + 1, channels]
    # At half the time white noise has twice the mean square.
    part = np.clip(2.0 * (quarter - half), 0.0, quarter)
    white, flicker = part * sizes[at + 1] * period, np.maximum(half - 0.5 * part, 0.0)
    span, unknown = float(time_s[-1] - time_s[0]), np.full(3, np.nan)
    return RestNoise(white, flicker, half, counts[at, channels], unknown, span)


def allan_square(sums: Sequence[NDArray], size: int) -> tuple[Floats, Floats]:
    """Square (3,) of the Allan deviation of averages over `size` rows, and its degrees of freedom (3,).

    `sums` are those of `sums_of` each rest of n rows. Rests that scatter as no noise of the others does are left out:
    something happened there.
    """
    lengths, squares = [], []
    for of_rest in sums:
        if (deviation := allan_deviation_of_sums([of_rest], size)) is not None:
            lengths.append(len(of_rest) - 1)
            squares.append(deviation**2)
    long = np.array(lengths, dtype=float)
    square = np.array(squares)
    count = long - 2 * size + 1
    # For overlapping averages of white noise (D. A. Howe, D. W. Allan, J. A. Barnes, 1981), nearly.
    free = np.maximum(1.5 * long / size - 2.0, 1.0)
    usual = np.median(square / (2.0 * scipy.special.gammaincinv(0.5 * free, 0.5) / free)[:, None], axis=0)
    usual_pieces = square <= usual * (scipy.special.chdtri(free, UNSTEADY) / free)[:, None]
    weight = usual_pieces * count[:, None]
    return (square * weight).sum(axis=0) / weight.sum(axis=0), (usual_pieces * free[:, None]).sum(axis=0)


def rest_lengths(rests: Rests, period: float) -> Floats:
    """Length (K,) of each rest [s]."""
    return np.array([rows.stop - rows.start for rows in rests.rows], dtype=float) * period


def rest_scatter(rests: Rests, up: NDArray | None, change: NDArray | None = None) -> tuple[Floats, int] | None:
    """Return the mean square (3,) of the means at rest [rad²/s²], and its degrees of freedom; None if undetermined.

    Everything that an effect could do at rest is fitted and subtracted. That is growth with time, with temperature,
    with gravity and, with enough rests, with its products; and a column `change` (K,), where given.
    """
    columns = [np.ones(len(rests)), rests.time_s - rests.time_s[0]]
    if change is not None:
        columns.append(change)
    if rests.temperature is not None:
        columns.append(rests.temperature)
    if up is not None:
        columns += list(up.T)
        products = []
        for i in range(3):
            for j in range(i, 3):
                products.append(up[:, i] * up[:, j])
        # One product follows from the others and the constant.
        if len(rests) < len(columns) + len(products) - 1 + SPARE:
            return None
        columns += products
    design = np.stack(columns, axis=1)
    design = design / np.maximum(np.abs(design).max(axis=0), 1e-300)
    free = len(design) - int(np.linalg.matrix_rank(design, tol=1e-6))
    if free < SPARE:
        return None
    residual = rests.rate - design @ np.linalg.lstsq(design, rests.rate, rcond=1e-8)[0]
    return (residual**2).sum(axis=0) / free, free
