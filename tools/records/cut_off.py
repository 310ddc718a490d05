"""Readings at rest that are cut off at an end of the range: their scatter is no more that of the sensor.

Steps hide the spike that a limit makes of fine readings: the last step of a limited channel may hold fewer readings
than the next one. It still holds more than normal noise in the same steps leaves for an end without a tail behind it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from ...models.arrays import Bools, Floats, Ints
from ..memory import each, once
from .limits import rows_at_limit

End = Literal["upper", "lower"]
WINDOW = 128
"""Rows in which a bias is constant beside the noise."""
GRID = 0.25
"""Windows whose means differ by this part of the noise are of one group; bins are as wide at least."""
FEWEST_ROWS = 64
"""Rows of a group, at least."""
SHARE = 0.02
"""Part of the readings of a pose at an end, and beyond it, from which noise would be told too small."""
FEWEST_AT_END = 20
"""Fewer readings at an end are no limit."""
CODES = 3
"""Different values, at least: two are explained by noise of any size; three by some other distribution than normal."""
RISE = 40.0
"""Rise of twice the logarithm of the likelihood that shows a limit."""
SECOND_END = 10.0
"""Further rise by which two limits are likelier than one."""
MISFIT = 0.2
"""Misfit of normal noise with a limit, over that without one, that is explained at most."""
MOST = 0.8
"""Part of the readings at an end beyond which the others may be spikes."""
ROUNDING = 1e-12
"""Scatter over the readings that rounding makes."""
SEEN = 200
"""Windows of a long record that show its steps, at least."""
FLAT = 0.5
"""Scatter of a rest over that of the others below which it stays at an end, with this part of its readings."""
HIDDEN = 0.55
"""Scatter of readings over their step, below which the noise is hidden by the steps; that of two values is 0.5."""
LINE = 0.1
"""Part of the variance in one line of the spectrum from which readings are those of a vibration."""
DRIFTS = 64
"""Frequencies below this many cycles in the record are those of drifts."""


@dataclass(frozen=True)
class CutOff:
    """Readings of a channel at an end of its range, or at both.

    Attributes
    ----------
    ends : tuple of str
        "upper", "lower"
    rows : int
        readings at these ends
    beyond : float
        part of the readings that would lie beyond them
    certain : bool
        false where noise of another distribution, or a vibration, explains them too
    """

    ends: tuple[End, ...]
    rows: int
    beyond: float
    certain: bool


@dataclass(frozen=True, eq=False)
class CountedReadings:
    """Readings about one mean, counted: `edges` (k + 1,) of the values in ascending order, `counts` (k,) of each.

    `at` names the ends of the channel's range that the first and the last value are.
    """

    edges: Floats
    counts: Floats
    at: frozenset[End]

    def fit(self, ends: Sequence[End]) -> tuple[float, float]:
        """Return twice the negative logarithm of the likelihood of normal noise with limits, and the rows beyond."""
        limited = [end for end in ends if end in self.at]
        inner = self.edges.copy()
        inner[0] = -np.inf if "lower" in limited or "lower" not in self.at else inner[0]
        inner[-1] = np.inf if "upper" in limited or "upper" not in self.at else inner[-1]
        middle = 0.5 * (self.edges[1:] + self.edges[:-1])
        rows = self.counts.sum()
        mean = float(self.counts @ middle / rows)
        spread = float(np.sqrt(self.counts @ (middle - mean) ** 2 / rows))

        def cost(parameters: Floats) -> float:
            scaled = (inner - mean - spread * parameters[0]) / (spread * np.exp(parameters[1]))
            return float(-2.0 * self.counts @ log_between(scaled))

        best = scipy.optimize.minimize(cost, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 1e-2})
        scaled = (self.edges - mean - spread * best.x[0]) / (spread * np.exp(best.x[1]))
        beyond = 0.0
        if "lower" in limited:
            beyond += float(np.exp(scipy.special.log_ndtr(scaled[0])))
        if "upper" in limited:
            beyond += float(np.exp(scipy.special.log_ndtr(-scaled[-1])))
        return float(best.fun), beyond * rows

    @property
    def least(self) -> float:
        """Return the cost of any distribution that gives the counts."""
        return float(-2.0 * self.counts @ np.log(self.counts / self.counts.sum()))


@dataclass(frozen=True)
class LimitedNormal:
    """Normal noise with limits at some ends: twice the negative logarithm of its likelihood, the rows beyond them."""

    ends: tuple[End, ...]
    cost: float
    beyond: float

    @staticmethod
    def of(groups: Sequence[CountedReadings], ends: tuple[End, ...]) -> "LimitedNormal":
        """Return the explanation of all groups, each with a mean and a noise of its own."""
        fits = [group.fit(ends) for group in groups]
        return LimitedNormal(ends, sum(cost for cost, _ in fits), sum(beyond for _, beyond in fits))


def log_between(edges: Floats) -> Floats:
    """Return the logarithm of the probability of normal values between edges (k + 1,), in ascending order."""
    low, high = edges[:-1], edges[1:]
    mirrored = low > 0.0
    low, high = np.where(mirrored, -high, low), np.where(mirrored, -low, high)
    above, below = scipy.special.log_ndtr(high), scipy.special.log_ndtr(low)
    return above + np.log1p(-np.minimum(np.exp(below - above), 1.0 - 1e-15))


def cut_off(pieces: Sequence[Floats]) -> CutOff | None:
    """Return the readings of a channel at rest that are cut off at an end of its range; None where none are.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        readings at rest, each piece of one pose
    """
    values = np.concatenate(pieces)
    lowest, highest = values.min(), values.max()
    candidates: list[End] = []
    if np.sum(values == lowest) >= FEWEST_AT_END:
        candidates.append("lower")
    if np.sum(values == highest) >= FEWEST_AT_END:
        candidates.append("upper")
    if not candidates:
        return None
    windows = _windows(pieces)
    groups = _groups(windows, float(lowest), float(highest))
    if not groups:
        return None
    independent = _independent(windows)
    best = whole = LimitedNormal.of(groups, ())
    sets: list[tuple[End, ...]] = [(end,) for end in candidates]
    if len(candidates) == 2:
        sets.append(("lower", "upper"))
    for ends in sets:
        one = LimitedNormal.of(groups, ends)
        if one.cost < best.cost - (SECOND_END / independent if len(ends) == 2 else 0.0):
            best = one
    least = sum(group.least for group in groups)
    shown = independent * (whole.cost - best.cost) > RISE and best.cost - least < MISFIT * (whole.cost - least)
    if not (shown and best.beyond > SHARE * sum(group.counts.sum() for group in groups)):
        return None
    at_ends = [int(np.sum(values == (lowest if end == "lower" else highest))) for end in best.ends]
    shaped = (len(best.ends) == 1 or _piles_up(groups)) and max(at_ends) < MOST * len(values)
    shaped &= any(len(group.counts) > CODES for group in groups)
    certain = shaped and not any(map(_has_line, pieces))
    return CutOff(best.ends, sum(at_ends), best.beyond / len(values), certain)


def limited_rests(values: Floats, rests: Sequence[slice], moved: Sequence[Floats] = ()) -> Bools:
    """Return the rests (K, C) in which channels (N, C) are at an end of their range, so that their means are wrong.

    Such a rest holds readings that are cut off for certain, or scatters less than the others at an end of the range.
    Further channels (N,) that change in each move show that equal readings are those of a rest.
    """
    limited = np.zeros((len(rests), values.shape[1]), dtype=bool)
    if not len(rests):
        return limited
    spread = np.array(each(_spread, values, rests))
    for axis, channel in enumerate(values.T):
        pieces = [channel[rows] for rows in rests]
        at_rest = np.concatenate(pieces)
        at_end = once(_rows_at_limit, values, axis, *moved)
        end = cut_off(pieces)
        if end is not None and end.certain:
            for side in end.ends:
                at_end = at_end | (channel == (at_rest.max() if side == "upper" else at_rest.min()))
        if at_end.any():
            limited[:, axis] = [np.mean(at_end[rows]) > SHARE for rows in rests]
        limited[:, axis] |= _flat(pieces, spread[:, axis], at_rest)
    return limited


def _spread(values: Floats) -> Floats:
    return values.std(axis=0)


def _rows_at_limit(values: Floats, axis: int, *moved: Floats) -> Bools:
    return rows_at_limit(values[:, axis], [*np.delete(values, axis, axis=1).T, *moved])


def _flat(pieces: Sequence[Floats], spread: Floats, at_rest: Floats) -> Bools:
    """Return the pieces that stay at an end of the range, though the others scatter by more than their steps."""
    usual = float(np.median(spread))
    lowest, highest = at_rest.min(), at_rest.max()
    flat = spread < FLAT * usual
    if not flat.any() or usual <= ROUNDING * float(np.abs(at_rest).max()) or steps_hide_noise(pieces):
        return np.zeros(len(pieces), dtype=bool)
    for number in np.flatnonzero(flat).tolist():
        piece = pieces[number]
        flat[number] = max(np.mean(piece == highest), np.mean(piece == lowest)) > 1.0 - FLAT
    return flat


def steps_hide_noise(pieces: Sequence[Floats]) -> bool:
    """Return true if readings at rest scatter by less than their steps, so that a limit would not show."""
    windows = _windows(pieces)
    windows = windows[:: max(1, len(windows) // SEEN)]
    steps = np.diff(np.unique(np.concatenate(windows)))
    if not len(steps):
        return False
    spread = np.median([window.std() for window in windows])
    return bool(spread < HIDDEN * np.median(steps))


def _windows(pieces: Sequence[Floats]) -> list[Floats]:
    """Return the pieces in windows in which a bias is constant."""
    windows = []
    for piece in pieces:
        count = max(1, len(piece) // WINDOW)
        rows, longer = divmod(len(piece), count)
        end = 0
        for number in range(count):
            begin, end = end, end + rows + (number < longer)
            windows.append(piece[begin:end])
    return windows


def _groups(windows: Sequence[Floats], lowest: float, highest: float) -> list[CountedReadings]:
    """Return the windows with alike means that reach an end of the range, counted together."""
    means = np.array([window.mean() for window in windows])
    spread = float(np.median([window.std() for window in windows]))
    if spread == 0.0:
        return []
    place = np.round(means / (GRID * spread))
    groups = []
    for one in np.unique(place):
        values = np.concatenate([windows[k] for k in np.flatnonzero(place == one).tolist()])
        codes, counts = np.unique(values, return_counts=True)
        at: set[End] = set()
        if codes[0] == lowest and counts[0] >= 0.5 * SHARE * len(values):
            at.add("lower")
        if codes[-1] == highest and counts[-1] >= 0.5 * SHARE * len(values):
            at.add("upper")
        if at and len(codes) >= CODES and len(values) >= FEWEST_ROWS:
            groups.append(_group(codes, counts, GRID * spread, frozenset(at)))
    return groups


def _group(codes: Floats, counts: Ints, width: float, at: frozenset[End]) -> CountedReadings:
    """Return counted readings in bins of a least width; the first and the last value have a bin of their own."""
    middles = 0.5 * (codes[1:] + codes[:-1])
    kept = [0]
    for k in range(1, len(middles)):
        if middles[k] - middles[kept[-1]] >= width:
            kept.append(k)
    if kept[-1] != len(middles) - 1:
        kept.append(len(middles) - 1)
    first, last = 2.0 * codes[0] - middles[0], 2.0 * codes[-1] - middles[-1]
    edges = np.concatenate([[first], middles[kept], [last]])
    starts = np.concatenate([[0], np.array(kept) + 1])
    return CountedReadings(edges, np.add.reduceat(counts, starts).astype(np.float64), at)


def _independent(windows: Sequence[Floats]) -> float:
    """Return the part of the rows that count as independent, by the correlation of each with the next."""
    product, square = 0.0, 0.0
    for window in windows:
        deviation = window - window.mean()
        product += float(deviation[1:] @ deviation[:-1])
        square += float(deviation @ deviation)
    correlation = max(0.0, product / square)
    return (1.0 - correlation) / (1.0 + correlation)


def _piles_up(groups: Sequence[CountedReadings]) -> bool:
    """Return true if an end holds more readings than the value next to it."""
    at_lower = sum(group.counts[0] - group.counts[1] for group in groups if "lower" in group.at)
    at_upper = sum(group.counts[-1] - group.counts[-2] for group in groups if "upper" in group.at)
    return max(at_lower, at_upper) > 0.0


def _has_line(piece: Floats) -> bool:
    """Return true if one line holds much of the variance of readings above the frequencies of drifts."""
    power = np.abs(np.fft.rfft(piece - piece.mean())) ** 2
    above = power[DRIFTS:]
    if len(above) < DRIFTS:
        return False
    pairs = above[1:] + above[:-1]
    return bool(pairs.max() > LINE * above.sum())
