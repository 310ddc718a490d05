"""Noise of small instruments: white noise and flicker noise, both bounded."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

OCTAVES = 4.0
"""Ratio of the time constants of neighbouring processes, whose sum is nearly flicker noise."""


@dataclass(frozen=True)
class Noise:
    """Errors of three instruments.

    Attributes
    ----------
    white : float
        density of the white noise, one-sided [unit/√Hz]
    flicker : float
        the flat part of the Allan deviation [unit]
    """

    white: float
    flicker: float

    def bound(self, period: float) -> float:
        """Bound of uniform errors that have the density, one drawn every period [unit]."""
        return math.sqrt(3.0) * self.white / math.sqrt(2.0 * period)


def flicker_noise(rng: np.random.Generator, rows: int, period: float, coefficient: float) -> NDArray[np.float64]:
    """Flicker noise (rows, 3): a sum of bounded processes of the first order, with time constants from rows to record.

    Parameters
    ----------
    rng : Generator
    rows : int
    period : float
        [s]
    coefficient : float
        the flat part of its Allan deviation, in the unit of the noise
    """
    total = np.zeros((rows, 3))
    # Flicker noise has as much mean square in each octave of time; its Allan variance is 2 ln 2 of that in e-folds.
    each = coefficient * math.sqrt(math.log(OCTAVES) / (2.0 * math.log(2.0)))
    time = 2.0 * period
    while time < 2.0 * rows * period:
        kept = math.exp(-period / time)
        drive = rng.uniform(-1.0, 1.0, (rows, 3)) * math.sqrt(3.0 * (1.0 - kept**2))
        # The state at the start is drawn as the process has it at any time.
        drive[0] = rng.uniform(-math.sqrt(3.0), math.sqrt(3.0), 3)
        total += each * np.asarray(lfilter([1.0], [1.0, -kept], drive, axis=0))
        time *= OCTAVES
    return total
