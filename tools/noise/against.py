"""A record's noise held against that of a simulation: falsified or not, the smallest set of changes, and the gain."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .likelihood import Likelihood, NoiseFit
from .pieces import ChannelAtRest
from .processes import NUMBERS, SPECTRAL, Letter
from .result import BIAS_TAKEN, Against, HeldOut, variance_after
from .selection import Selection, select
from .simulated import Sizes
from .spectrum import bins_of

FALSIFIED = 25.0
"""Rise above which a simulation's noise is falsified: the largest of 2400 true channels is 22.5."""
EXPLAINED = 21.0
"""Largest rise of a change that explains a falsified channel: of true ones it is beyond in fewer than one of 500."""
MOST = 2
"""Largest number of processes that change."""
Verdict = Literal["consistent", "explained", "ambiguous", "falsified"]
VERDICTS: dict[int, Verdict] = {0: "falsified", 1: "explained"}
"""Verdict of a falsified channel by the number of smallest sets."""
CHANGES: tuple[Letter, ...] = (*SPECTRAL, "R")
DRIFTS = (1.0, 10.0, 60.0)
"""Drifts that are predicted [s]."""
FEWEST_WINDOWS = 20
BAND = 1.959964
"""Half-width of a 95 % band in standard deviations."""


@dataclass(frozen=True, eq=False)
class NoiseChange:
    """A set of processes whose coefficients change: the fit of these beside the unchanged ones."""

    letters: tuple[Letter, ...]
    fit: NoiseFit

    @property
    def sizes(self) -> dict[Letter, float]:
        """Return the new coefficients by their letters."""
        return {letter: self.fit.coefficient(letter) for letter in self.letters}


def held_against(channel: ChannelAtRest, step: float, selection: Selection, simulated: Sizes) -> Against:
    """Return the answer for one channel.

    Parameters
    ----------
    channel : ChannelAtRest
        readings at rest
    step : float
        time between readings [s]
    selection : Selection
        the processes of the record
    simulated : dict
        coefficients of the simulation by their letters [SI]
    """
    likelihood = selection.likelihood
    best = _largest(likelihood)
    rise = _changed(likelihood, simulated, ()).fit.cost - best
    verdict: Verdict = "consistent"
    chosen: list[NoiseChange] = []
    if rise > FALSIFIED:
        chosen = smallest_changes(likelihood, simulated, best + EXPLAINED)
        verdict = VERDICTS.get(len(chosen), "ambiguous")
    changed = chosen[0].sizes if chosen else {}
    held_out = []
    if chosen:
        held_out = predicted_drifts(channel, step, simulated, chosen[0].letters)
    return Against(
        channel=channel.name,
        verdict=verdict,
        rise=max(0.0, rise),
        simulated={letter: size for letter, size in simulated.items() if size != 0.0},
        changed=changed,
        alternatives=[" + ".join(change.letters) for change in chosen],
        held_out=held_out,
    )


def _largest(likelihood: Likelihood) -> float:
    """Return the least cost of all processes together."""
    trends: tuple[Letter | None, ...] = (None, "R", "W") if likelihood.bins.has_trends else (None,)
    return min(likelihood.fit(SPECTRAL, trend).cost for trend in trends)


def smallest_changes(likelihood: Likelihood, simulated: Sizes, limit: float) -> list[NoiseChange]:
    """Return all sets of changes of the fewest numbers whose cost is within a limit, the likeliest first."""
    by_size: dict[int, list[tuple[Letter, ...]]] = {}
    for count in range(1, MOST + 1):
        for letters in combinations(CHANGES, count):
            if "R" in letters and not likelihood.bins.has_trends:
                continue
            by_size.setdefault(sum(NUMBERS[letter] for letter in letters), []).append(letters)
    for size in sorted(by_size):
        changes = [_changed(likelihood, simulated, letters) for letters in by_size[size]]
        within = [change for change in changes if change.fit.cost <= limit]
        if within:
            return sorted(within, key=lambda change: change.fit.cost)
    return []


def _changed(likelihood: Likelihood, simulated: Sizes, letters: tuple[Letter, ...]) -> NoiseChange:
    """Return the best fit with the coefficients of some processes free, the others as simulated."""
    fixed = np.zeros(len(likelihood.bins.power))
    for letter, size in simulated.items():
        if letter in SPECTRAL and letter not in letters:
            fixed += size**2 * likelihood.column(letter, 0.0) * likelihood.unit
    spectral: list[Letter] = [letter for letter in SPECTRAL if letter in letters]
    trend = 0.0 if "R" in letters else None
    constants = likelihood.constants.tolist() if "M" in letters else [0.0]
    fits = [likelihood.fit_beside(fixed, tuple(spectral), constant, trend) for constant in constants]
    return NoiseChange(letters, min(fits, key=lambda fit: fit.cost))


def predicted_drifts(channel: ChannelAtRest, step: float, simulated: Sizes, letters: Sequence[Letter]) -> list[HeldOut]:
    """Return how well the second half's drifts are predicted, by the simulation's noise and by the extended one.

    The coefficients that change are those of the first half, with the upper ends of their intervals.
    """
    longest = max(channel.pieces, key=len)
    first, second = np.array_split(longest, 2)
    selection = select(bins_of([first], step)[0])
    change = _changed(selection.likelihood, simulated, tuple(letters))
    extended = dict(simulated)
    for letter in letters:
        extended[letter] = change.fit.coefficient(letter)
        if letter in ("B", "K") and letter in selection.fit.letters:
            extended[letter] = selection.likelihood.interval(selection.fit, letter)[1]
    results = []
    for time in DRIFTS:
        drifts = window_drifts(second, step, time)
        if len(drifts) < FEWEST_WINDOWS:
            continue
        before = drift_deviation(simulated, time, change.fit.constant)
        after = drift_deviation(extended, time, change.fit.constant)
        if not (before > 0.0 and after > 0.0):
            continue
        score = math.log(before / after) + 0.5 * float(np.mean((drifts / before) ** 2 - (drifts / after) ** 2))
        results.append(
            HeldOut(
                time_s=time,
                windows=len(drifts),
                coverage_simulated=float(np.mean(np.abs(drifts) <= BAND * before)),
                coverage_extended=float(np.mean(np.abs(drifts) <= BAND * after)),
                score=score,
            )
        )
    return results


def window_drifts(readings: NDArray[np.float64], step: float, time: float) -> NDArray[np.float64]:
    """Return drifts over a time, each less the bias of the minute before, one window after the other."""
    before, behind = round(BIAS_TAKEN / step), round(time / step)
    if behind == 0:
        return np.zeros(0)
    sums = np.concatenate([[0.0], np.cumsum(readings - readings[0])])
    starts = np.arange(before, len(readings) - behind, behind)
    bias = (sums[starts] - sums[starts - before]) / before
    return step * (sums[starts + behind] - sums[starts] - behind * bias)


def drift_deviation(sizes: Mapping[Letter, float], time: float, constant: float) -> float:
    """Return the standard deviation of such a drift by coefficients [SI]."""
    variance = 0.0
    for letter, size in sizes.items():
        if letter in SPECTRAL and size > 0.0:
            variance += size**2 * variance_after(letter, constant or 1.0, time)
    return math.sqrt(variance)
