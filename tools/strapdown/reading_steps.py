"""Steps in which accelerometers read, and what they leave of a mean at rest where noise does not average them out."""

import numpy as np
from numpy.typing import NDArray

FEW = 3
"""Where the readings of a rest take at most so many values, noise is no wider than a step, and the mean is off by up
to half of one."""
WIDE_NOISE = 0.1
"""Of noise as wide as k steps the mean is off by at most this part of one step, over k: the first harmonic of what is
rounded away, of a flat distribution, 1/π² of it; of a Gaussian one it is less."""


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
        smallest, count = float(apart.min()), float(np.median([len(different) for different in seen]))
        if count <= FEW:
            step[p], off[p] = smallest, 0.5 * smallest
        else:
            off[p] = WIDE_NOISE * smallest / (count - 1.0)
    return step, off
