"""Allan deviation of readings at rest, beside that of fitted processes."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from ..records.noise import allan_deviation_of_sums, sums_of
from .likelihood import Likelihood, NoiseFit
from .processes import difference_gain
from .result import AllanCurve

AN_OCTAVE = 2
"""Averaging times in an octave."""
LONGEST = 4
"""The longest averaging time is the longest stretch over this."""
CHANCE = 0.025
"""Chance outside each end of an interval."""


def averaging_rows(longest: int) -> list[int]:
    """Return the averaging times in rows, up to a quarter of the longest stretch (`longest` rows)."""
    rows = []
    exponent = 0
    while 2.0 ** (exponent / AN_OCTAVE) <= longest / LONGEST:
        rows.append(round(2.0 ** (exponent / AN_OCTAVE)))
        exponent += 1
    return sorted(set(rows))


def allan_curve(
    pieces: Sequence[NDArray[np.float64]], step: float, likelihood: Likelihood, fit: NoiseFit
) -> AllanCurve:
    """Return the overlapping Allan deviation of a channel with 95 % intervals, and the band of the fitted processes.

    The degrees of freedom are those of the processes, by the spectrum: the Allan variance is a weighted mean of the
    squares of the cosine coefficients.

    Parameters
    ----------
    pieces : sequence of ndarray, shape (n,)
        readings of each stretch
    step : float
        time between readings [s]
    likelihood, fit
        the spectrum, and the processes fitted to it
    """
    sums = [sums_of(piece[:, None]) for piece in pieces]
    longest = max(map(len, pieces))
    times, deviations, models, lows, highs, model_lows, model_highs = [], [], [], [], [], [], []
    for rows in averaging_rows(longest):
        deviation = allan_deviation_of_sums(sums, rows)
        if deviation is None:
            continue
        model, freedom = of_processes(likelihood, fit, rows, longest, len(pieces))
        low = math.sqrt(freedom / float(chdtri(freedom, CHANCE)))
        high = math.sqrt(freedom / float(chdtri(freedom, 1.0 - CHANCE)))
        times.append(rows * step)
        deviations.append(float(deviation[0]))
        lows.append(low * float(deviation[0]))
        highs.append(high * float(deviation[0]))
        models.append(model)
        model_lows.append(model / high)
        model_highs.append(model / low)
    return AllanCurve(
        tau_s=times,
        deviation=deviations,
        low=lows,
        high=highs,
        model=models,
        model_low=model_lows,
        model_high=model_highs,
    )


def of_processes(
    likelihood: Likelihood, fit: NoiseFit, rows: int, longest: int, pieces: int = 1
) -> tuple[float, float]:
    """Return the Allan deviation that fitted processes have in a stretch, and the degrees of freedom of its square.

    Parameters
    ----------
    likelihood, fit
        the spectrum, and the processes fitted to it
    rows : int
        averaging time
    longest : int
        rows of the stretch
    pieces : int
        number of such stretches
    """
    number = _numbers(longest)
    angle = math.pi * number / longest
    share = np.gradient(number)
    power = likelihood.spectrum(fit, angle) * difference_gain(angle, rows) * share / longest
    variance = float(power.sum())
    # a bin of `share` coefficients has `share` degrees of freedom
    freedom = 2.0 * variance**2 / float(np.sum(2.0 * power**2 / share)) * pieces
    trend = 0.0
    if fit.trend is not None and fit.trend.letter == "R":
        trend = 0.5 * (fit.trend.size * rows * likelihood.bins.step) ** 2
    return math.sqrt(variance + trend), max(1.0, freedom)


def _numbers(longest: int) -> NDArray[np.float64]:
    """Return the numbers of cosine coefficients at which a spectrum is added up: the lowest all, then 200 an octave."""
    if longest <= 512:
        return np.arange(1, longest, dtype=np.float64)
    wide = np.geomspace(512, longest - 1, 1 + math.ceil(200.0 * math.log2((longest - 1) / 512)))
    return np.concatenate([np.arange(1, 512), np.unique(np.round(wide))]).astype(np.float64)
