"""Steps in which accelerometers read, and what they leave of a mean at rest where noise does not average them out."""

import numpy as np
from numpy.typing import NDArray

FEW = 3
"""Where the readings of a rest take at most so many values, noise is no wider than a step, and the mean is off by up
to half of one."""
WIDE_NOISE = 0.1
"""Of noise as wide as k steps the mean is off by at most this part of one step, over k: the first harmonic of what is
rounded away, of a flat distribution, 1/π² of it; of a Gaussian one it is less."""


SAME_STEP = 1e-3
"""Multiples of a step are written with digits of their own: they may be off by so much of it."""
TOO_FINE = 1e-6
"""A step of so small a part of the range of the readings is a last digit: a record without noise has no other."""
MOST_DIVISIONS = 60


def reading_steps(values: NDArray[np.float64], rests: tuple[slice, ...]) -> tuple[NDArray, NDArray]:
    """Steps of the readings of each channel, and by how much they may put a mean at rest off.

    Parameters
    ----------
    values : (N, 3) array
        readings, in any unit
    rests : tuple of slice
        rows of each rest; at least one

    Returns
    -------
    step : (3,) array
        in that unit; 0 where the readings hide no step in their noise
    off : (3,) array
        largest error of a mean, in that unit
    """
    step, off = np.zeros(3), np.zeros(3)
    for p, channel in enumerate(values.T):
        seen = [np.unique(channel[rows]) for rows in rests]
        apart = np.diff(np.unique(np.concatenate(seen)))
        if not len(apart):
            continue
        common, count = common_divisor(apart), float(np.median([len(different) for different in seen]))
        if count > FEW:
            off[p] = WIDE_NOISE * common / (count - 1.0)
        elif common > TOO_FINE * apart.max():
            step[p], off[p] = common, 0.5 * common
    return step, off


def common_divisor(values: NDArray[np.float64]) -> float:
    """The largest number of which all values (n,), positive, are whole multiples to a thousandth of it, as Euclid does.

    Of readings without a step it is as small as their last digit, or smaller.
    """
    common = float(values.min())
    for _ in range(MOST_DIVISIONS):
        left = np.abs(values - np.round(values / common) * common)
        left = left[left > SAME_STEP * common]
        if not len(left):
            break
        common = float(left.min())
    return common
