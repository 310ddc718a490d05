"""σ from a standard deviation: the bound with which Gaussian errors leave 99 of 100 fitted models standing.

A fit follows some of the noise. The least largest residual of unit noise is near the quantile `usual` and seldom above
`largest`, by the number of readings and of the parameters that are fitted to them.
"""

import math
from dataclasses import dataclass
from statistics import NormalDist

from numpy.typing import NDArray

CHANNELS = 3
"""Accelerometers that are read at each position."""
FEW = 24
"""Number of positions below which the largest residual scatters more."""
ABSORBED = 0.4
"""The part of its parameters that a fit takes from the number of the largest readings."""
MOST_ABSORBED = 0.4
"""Largest part of the readings that a fit takes from that number."""
FALSE_ALARM = 0.01
"""Chance that σ falsifies a true model."""


@dataclass(frozen=True)
class Fitted:
    """Number of positions of three readings to which a model is fitted, and its number of parameters."""

    positions: int
    parameters: int = 18

    @property
    def usual(self) -> float:
        """The median of the least largest residual of Gaussian noise, over its standard deviation."""
        readings = CHANNELS * self.positions
        return upper_quantile(min(MOST_ABSORBED, 0.5 * ABSORBED * self.parameters / readings))

    @property
    def largest(self) -> float:
        """The same that one record in a hundred exceeds: σ over a standard deviation that is known."""
        readings = CHANNELS * self.positions
        if self.positions < FEW:
            return upper_quantile(0.25 / readings)
        return upper_quantile(0.5 / readings)

    def factor(self, freedom: int) -> float:
        """Return σ over a standard deviation that was estimated with `freedom` degrees of freedom."""
        of_noise = math.log(self.largest / self.usual)
        of_deviation = math.log(deviation_widening(freedom, FALSE_ALARM))
        return self.usual * math.exp(math.hypot(of_noise, of_deviation))


def pooled_deviation(squares: NDArray, freedom: int) -> tuple[float, int]:
    """Standard deviation of a reading and its degrees of freedom, by sums of squares (3,) of each channel's.

    The deviation is that of all channels together, or of the noisiest alone if it differs from the others by more than
    chance (an F test).
    """
    # late: a record is read without it
    from scipy.special import fdtri

    noisiest = float(squares.max())
    others = float(squares.sum()) - noisiest
    most = float(fdtri(freedom, 2 * freedom, 1.0 - FALSE_ALARM / CHANNELS))
    if noisiest > most * 0.5 * others:
        return math.sqrt(noisiest / freedom), freedom
    return math.sqrt((noisiest + others) / (CHANNELS * freedom)), CHANNELS * freedom


def upper_quantile(chance: float) -> float:
    """Return the value that a normal variable exceeds with this chance."""
    return -NormalDist().inv_cdf(chance)


def deviation_widening(freedom: int, chance: float) -> float:
    """Return the factor by which a standard deviation may be too small, except by chance.

    It is √(ν/χ²), with the lower quantile of χ².
    """
    # late: a record is read without it
    from scipy.special import chdtri

    return math.sqrt(freedom / float(chdtri(freedom, 1.0 - chance)))
