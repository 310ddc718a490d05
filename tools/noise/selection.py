"""Selection of the noise processes that a spectrum needs: all sets of the fewest numbers that no larger set beats."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

from .likelihood import Likelihood, NoiseFit
from .processes import NUMBERS, SPECTRAL, TRENDS, Letter
from .spectrum import Bins

NEEDED, NEEDED_WITH_TRENDS = 14.5, 17.5
"""Rise of twice the negative logarithm over the largest set with which a set is admissible, where trends are no
candidates, and where they are. Of 400 simulated true sets of N + B and of N + K 99.5 % rise by less than 14.2 and 16.1;
the limits leave 1.4 for rarer ones."""
LOW_BAND = 20
"""The band of the fit ends at the sampling rate over this: filters of sensors act above."""
FEWEST = 400
"""Least number of coefficients in the band, if the record has as many."""
FITS = 4.2
"""Largest deviation of a bin that a right fit shows, in 99 of 100 records."""


@dataclass(frozen=True, eq=False)
class Selection:
    """The processes of one channel.

    Attributes
    ----------
    fit : NoiseFit
        the chosen set: of those admissible with the fewest numbers the likeliest
    admissible : tuple of NoiseFit
        all of them, the chosen one first
    likelihood : Likelihood
        of the band of the fit
    band_hz : float
        upper end of the band
    worst_bin : float
        largest deviation of a bin from the fit, in standard deviations
    filtered : bool
        true where the spectrum above the band is not that of the set: a filter, or vibration
    """

    fit: NoiseFit
    admissible: tuple[NoiseFit, ...]
    likelihood: Likelihood
    band_hz: float
    worst_bin: float
    filtered: bool


def select(bins: Bins) -> Selection:
    """Return the processes that a spectrum needs.

    They are chosen in the band below the filters of sensors. Quantisation, which rises towards high frequencies, joins
    where the whole spectrum is that of the set with it.
    """
    nyquist = math.pi
    lowest = math.pi * FEWEST / float(bins.count.sum())
    band = min(nyquist, max(nyquist * 2.0 / LOW_BAND, lowest))
    of_band = Likelihood(bins.below(band))
    admissible = _admissible(of_band)
    whole = Likelihood(bins)
    chosen = _in_whole_band(admissible[0], of_band, whole)
    filtered = chosen is None
    if chosen is None:
        chosen, used = admissible[0], of_band
        end = band
    else:
        used, end = whole, nyquist
        if chosen.letters != admissible[0].letters:
            admissible = (chosen,)
    return Selection(chosen, admissible, used, end / (2.0 * math.pi * bins.step), used.worst_bin(chosen), filtered)


def _in_whole_band(fit: NoiseFit, of_band: Likelihood, whole: Likelihood) -> NoiseFit | None:
    """Return the set fitted to the whole band, with quantisation where it needs that; None if it is not the same."""
    trend = None if fit.trend is None else fit.trend.letter
    wide = whole.fit(fit.letters, trend)
    if "Q" not in fit.letters:
        with_quantisation = whole.fit((*fit.letters, "Q"), trend)
        if wide.cost - with_quantisation.cost > NEEDED:
            wide = with_quantisation
    if whole.worst_bin(wide) > FITS:
        return None
    same = of_band.fit(wide.letters, trend)
    moved = of_band.with_power(same, wide.power).cost - same.cost
    if wide.trend is None and moved > NEEDED:
        return None
    return wide


def _admissible(likelihood: Likelihood) -> tuple[NoiseFit, ...]:
    """Return all admissible sets of the fewest numbers, the likeliest first."""
    needed = NEEDED_WITH_TRENDS if likelihood.bins.has_trends else NEEDED
    largest = min(likelihood.fit(SPECTRAL, trend).cost for trend in _trends(likelihood))
    sizes: dict[int, list[tuple[tuple[Letter, ...], Letter | None]]] = {}
    for letters, trend in _sets(likelihood):
        size = sum(NUMBERS[letter] for letter in letters) + (NUMBERS[trend] if trend else 0)
        sizes.setdefault(size, []).append((letters, trend))
    for size in sorted(sizes):
        fits = []
        for letters, trend in sizes[size]:
            fit = likelihood.fit(letters, trend)
            if fit.cost - largest <= needed and all(power > 0.0 for power in fit.power):
                fits.append(fit)
        if fits:
            return tuple(sorted(fits, key=lambda fit: fit.cost))
    return (likelihood.fit(SPECTRAL),)


def _trends(likelihood: Likelihood) -> tuple[Letter | None, ...]:
    """Return no trend, and the letters of trends where the record is one piece."""
    if likelihood.bins.has_trends:
        return (None, *TRENDS)
    return (None,)


def _sets(likelihood: Likelihood) -> Iterator[tuple[tuple[Letter, ...], Letter | None]]:
    """Return all sets of processes, each with each trend."""
    for size in range(1, len(SPECTRAL) + 1):
        for letters in combinations(SPECTRAL, size):
            for trend in _trends(likelihood):
                yield letters, trend
