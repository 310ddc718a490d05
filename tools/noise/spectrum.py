"""The spectrum of pieces of a record: mean squares of cosine coefficients in bins of frequency.

The cosine transform makes white noise and random walks with an unknown mean independent exactly; a periodogram does
not.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct
from scipy.optimize import minimize_scalar
from scipy.special import chdtri

from ...models.arrays import Bools, Floats, Ints

SINGLE = 64
"""Lowest coefficients that are bins of their own."""
AN_OCTAVE = 12
"""Bins in an octave above."""
LINE_CHANCE = 0.01
"""Chance that white noise shows a line anywhere."""
ROUNDS = 4
"""Rounds in which lines are looked for."""
LINE_BLOCKS = 6
"""Bins in an octave of the levels that lines are held against."""
FEWEST_IN_LEVEL = 48
"""Coefficients whose median is a level, at least."""
MOST_LINES = 8
"""Largest number of lines that are named."""
SIDE_LOBE = 2.0
"""A line is a side lobe of a stronger one if its amplitude is less than this over their distance in coefficients, as a
part of the stronger one's."""
ONE_LINE = 2e-3
"""Lines that are nearer than this part of their frequency are one that wanders."""
WARM_UPS = 12
"""Time constants of a warm-up that are tried."""
SHORTEST_WARM_UP, LONGEST_WARM_UP = 100.0, 2.0
"""Time constants between the length of a record over the first and times the second."""
FARTHER = 0.3
"""A warm-up that is larger than this part of the noise beyond the single coefficients is taken out there."""
SMALLEST = 1e-12
"""Least size of readings whose rounding counts [rad/s] or [m/s²]."""


@dataclass(frozen=True, eq=False)
class LineInSpectrum:
    """A line of the spectrum: its frequency [Hz], and the amplitude of its sine in the unit of the readings."""

    frequency_hz: float
    amplitude: float

    def belongs_to(self, stronger: "LineInSpectrum", per_hz: float) -> bool:
        """Return true if this is part of a stronger line, with so many coefficients of the spectrum in a hertz."""
        distance = abs(self.frequency_hz - stronger.frequency_hz)
        lobe = SIDE_LOBE * stronger.amplitude / self.amplitude
        return distance * per_hz < lobe or distance < ONE_LINE * stronger.frequency_hz


@dataclass(frozen=True, eq=False)
class Bins:
    """Mean squares of the cosine coefficients of one channel.

    Attributes
    ----------
    angle : ndarray, shape (B,)
        ω at the middle of each bin [rad per reading]
    power : ndarray, shape (B,)
        mean square of the coefficients
    count : ndarray, shape (B,)
        coefficients in each bin
    step : float
        time between readings [s]
    single, number : ndarray, shape (S,)
        coefficients of the bins with one only, and their numbers; empty of several pieces, which have no trend
    is_single : ndarray of bool, shape (B,)
        true for those bins
    rows : int
        rows of the longest piece
    """

    angle: Floats
    power: Floats
    count: Floats
    step: float
    single: Floats
    number: Ints
    is_single: Bools
    rows: int

    @property
    def duration(self) -> float:
        """Return the length of the longest piece [s]."""
        return self.rows * self.step

    @property
    def has_trends(self) -> bool:
        """Return true if the bins are of one piece, which may have a trend."""
        return len(self.single) > 0

    @property
    def warm_ups(self) -> Floats:
        """Return the time constants of warm-ups that are tried [s]."""
        return np.geomspace(self.duration / 30.0, self.duration / 2.0, WARM_UPS)

    def trend(self, constant: float) -> Floats:
        """Return the single coefficients (S,) of a trend of size one: the ramp for 0, else a warm-up [s]."""
        return trend_coefficients(self.number, self.rows, self.step, constant)

    def below(self, angle: float) -> "Bins":
        """Return the bins up to a frequency ω [rad per reading]."""
        kept = self.angle <= angle
        of_single = kept[self.is_single]
        return replace(
            self,
            angle=self.angle[kept],
            power=self.power[kept],
            count=self.count[kept],
            single=self.single[of_single],
            number=self.number[of_single],
            is_single=self.is_single[kept],
        )


def bins_of(pieces: Sequence[Floats], step: float) -> tuple[Bins, tuple[LineInSpectrum, ...]]:
    """Return the spectrum of the pieces of one channel without its lines, and the lines.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        readings at equal steps, each piece with a mean of its own
    step : float
        time between readings [s]
    """
    parts = []
    lines: list[LineInSpectrum] = []
    for piece in pieces:
        coefficients = _coefficients(piece, step)
        masked = line_mask(coefficients)
        if not lines:
            lines = lines_of(coefficients, masked, step)
        # readings that repeat one value have the noise of their rounding
        floor = (np.finfo(np.float64).eps * max(float(np.abs(piece).max()), SMALLEST)) ** 2
        parts.append(_piece_bins(coefficients, masked, step, floor))
    joined = parts[0]
    if len(parts) > 1:
        joined = _joined(parts)
    return joined, tuple(lines)


def _coefficients(piece: Floats, step: float) -> Floats:
    """Return the cosine coefficients (n - 1,) of a piece; a strong warm-up is only in those that are single bins."""
    coefficients = np.asarray(dct(piece - piece[0], type=2, norm="ortho"))[1:]
    rows, single = len(piece), coefficients[:SINGLE]
    if rows < 4 * SINGLE:
        return coefficients
    number = np.arange(1, SINGLE + 1)
    duration = rows * step

    def unexplained(logarithm: float) -> float:
        shape = trend_coefficients(number, rows, step, math.exp(logarithm))
        return -(float(shape @ single) ** 2) / float(shape @ shape)

    ends = math.log(duration / SHORTEST_WARM_UP), math.log(duration * LONGEST_WARM_UP)
    best: Any = minimize_scalar(unexplained, bounds=ends, options={"xatol": 1e-6})
    shape = trend_coefficients(number, rows, step, math.exp(best.x))
    size = float(shape @ single) / float(shape @ shape)
    level = float(np.median(np.abs(coefficients[len(coefficients) // 2 :])))
    if abs(size * shape[-1]) < FARTHER * level:
        return coefficients
    warming = size * np.exp(-step * np.arange(rows) / math.exp(best.x))
    without = np.asarray(dct(piece - warming, type=2, norm="ortho"))[1:]
    return np.concatenate([single, without[SINGLE:]])


def _piece_bins(
    coefficients: Floats,
    masked: Bools,
    step: float,
    floor: float,
) -> Bins:
    """Return the bins of one piece; their power is a least one at least."""
    number = np.arange(1, len(coefficients) + 1)
    edges = bin_edges(len(coefficients))
    kept = ~masked
    count = np.add.reduceat(kept.astype(np.float64), edges)
    squares = np.add.reduceat(np.where(kept, coefficients**2, 0.0), edges)
    middle = np.add.reduceat(np.where(kept, number, 0), edges)
    filled = count > 0.0
    count = count[filled]
    size = len(coefficients) + 1
    single = np.zeros(len(edges), dtype=bool)
    single[: min(SINGLE, len(edges))] = True
    single = single[filled]
    of_single = edges[filled][single]
    return Bins(
        angle=math.pi * (middle[filled] / count) / size,
        power=np.maximum(squares[filled] / count, floor),
        count=count,
        step=step,
        single=coefficients[of_single],
        number=of_single + 1,
        is_single=single,
        rows=size,
    )


def bin_edges(count: int) -> NDArray[np.int64]:
    """Return the first index of each bin of the coefficients 1 to `count`, counted from 0."""
    edges = list(range(min(SINGLE, count)))
    at = float(SINGLE)
    while at < count:
        first = round(at)
        if edges[-1] < first < count:
            edges.append(first)
        at *= 2.0 ** (1.0 / AN_OCTAVE)
    return np.array(edges, dtype=np.int64)


def trend_coefficients(number: Ints, rows: int, step: float, constant: float) -> Floats:
    """Return the cosine coefficients of these numbers of a ramp of 1/s, for 0, or of a warm-up exp(-t/T).

    They are the sums over k of x_k cos(ω (k + 1/2)) times √(2/n).
    """
    angle = math.pi * number / rows
    if constant == 0.0:
        sums = -(number % 2) * step * np.cos(0.5 * angle) / (2.0 * np.sin(0.5 * angle) ** 2)
    else:
        exponent = -step / constant + 1j * angle
        sums = np.real(np.exp(0.5 * exponent) * np.expm1(exponent * rows) / np.expm1(exponent))
        # the transform counts from the middle of a row, the warm-up from its start
        sums *= math.exp(0.5 * step / constant)
    return sums * math.sqrt(2.0 / rows)


def _joined(parts: Sequence[Bins]) -> Bins:
    """Return the bins of all pieces side by side, without trends: each piece has a mean of its own."""
    first = parts[0]
    angle = np.concatenate([part.angle for part in parts])
    order = np.argsort(angle, kind="stable")
    return replace(
        first,
        angle=angle[order],
        power=np.concatenate([part.power for part in parts])[order],
        count=np.concatenate([part.count for part in parts])[order],
        single=np.zeros(0),
        number=np.zeros(0, dtype=np.int_),
        is_single=np.zeros(len(angle), dtype=bool),
        rows=max(part.rows for part in parts),
    )


def line_mask(coefficients: Floats) -> Bools:
    """Return true for the coefficients (n,) of lines and their neighbours, against the median level around them."""
    count = len(coefficients)
    squares = coefficients**2
    masked = np.zeros(count, dtype=bool)
    if count < 2 * SINGLE:
        return masked
    edges = _level_edges(count)
    limit = float(chdtri(1, LINE_CHANCE / count)) / float(chdtri(1, 0.5))
    for _ in range(ROUNDS):
        level = _levels(squares, masked, edges)
        above = squares > limit * level
        above[:SINGLE] = False
        wider = above.copy()
        wider[1:] |= above[:-1]
        wider[:-1] |= above[1:]
        if not np.any(wider & ~masked):
            break
        masked |= wider
    return masked


def _level_edges(count: int) -> NDArray[np.int64]:
    """Return the first index of each block of coefficients whose median is a level."""
    edges = [0]
    at = float(SINGLE)
    while at < count - FEWEST_IN_LEVEL:
        edges.append(round(at))
        at = max(at * 2.0 ** (1.0 / LINE_BLOCKS), at + FEWEST_IN_LEVEL)
    return np.array(edges, dtype=np.int64)


def _levels(squares: Floats, masked: Bools, edges: NDArray[np.int64]) -> Floats:
    """Return the median of the squares (n,) of each block that are no lines."""
    level = np.full(len(squares), np.inf)
    ends = [*edges[1:].tolist(), len(squares)]
    for first, end in zip(edges.tolist(), ends, strict=True):
        unmasked = squares[first:end][~masked[first:end]]
        if unmasked.size:
            level[first:end] = np.median(unmasked)
    return level


def lines_of(coefficients: Floats, masked: Bools, step: float) -> list[LineInSpectrum]:
    """Return the strongest lines: runs of masked coefficients, with the amplitude of one sine of their energy."""
    size = len(coefficients) + 1
    edges = np.flatnonzero(np.diff(np.concatenate([[False], masked, [False]]).astype(np.int8)))
    lines = []
    for first, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        squares = coefficients[first:end] ** 2
        energy = float(squares.sum())
        number = float(squares @ np.arange(first + 1, end + 1)) / energy
        lines.append(LineInSpectrum(number / (2.0 * size * step), math.sqrt(2.0 * energy / size)))
    lines.sort(key=lambda line: -line.amplitude)
    apart: list[LineInSpectrum] = []
    for line in lines:
        if not any(line.belongs_to(stronger, 2.0 * size * step) for stronger in apart):
            apart.append(line)
        if len(apart) == MOST_LINES:
            break
    return apart
