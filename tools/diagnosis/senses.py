"""Senses of the last change of each accelerometer's input, as far as a record tells them."""

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Parametrisation, Positions, predicted_input
from .circumstances import Circumstances

INPUT_CHANGE = 1e-4
"""Change of an input [g] between rows whose sense is certain; a smaller one says nothing."""
MOVED = 1e-4
"""An axis whose reading changes by less [rad] from row to row has not moved."""


def input_senses(
    p: Parametrisation, point: NDArray, at: Positions, circumstances: Circumstances
) -> tuple[NDArray, NDArray]:
    """Senses of the last change of each accelerometer's input, and whether the record tells them.

    Without approach columns the sense is that of the change from the row before; the first row comes from no input.
    With them it is told where both axes, or the only one that moved, change the input in the same way when they come to
    the position: else it depends on which of them came last, which no record says.

    Returns
    -------
    sense : (N, 3) array
        +1, -1, or 0 where there was no change or it is not told
    told : (N, 3) array of bool
    """
    n = predicted_input(p, point, at)
    if not circumstances.approached and circumstances.before is not None:
        before = Positions(circumstances.before[:, 0], circumstances.before[:, 1], at.mounting)
        change = n - np.nan_to_num(predicted_input(p, point, before))
        return np.where(np.abs(change) > INPUT_CHANGE, np.sign(change), 0.0), np.ones(n.shape, dtype=bool)
    outer, inner = moved_axes(at, circumstances)
    ways = [
        np.sign(_slope(p, point, at, outer * circumstances.sense_alpha, np.zeros(len(outer)))),
        np.sign(_slope(p, point, at, np.zeros(len(outer)), inner * circumstances.sense_beta)),
    ]
    told = ways[0] * ways[1] >= 0.0
    return np.where(told, np.sign(ways[0] + ways[1]), 0.0), told


def _slope(p: Parametrisation, point: NDArray, at: Positions, alpha: NDArray, beta: NDArray) -> NDArray:
    """Change of the inputs (N, 3) as the axes turn at these rates (N,)."""
    step = 1e-30
    moving = Positions(at.alpha + 1j * step * alpha, at.beta + 1j * step * beta, at.mounting, at.tilts)
    return np.imag(predicted_input(p, point, moving)) / step


def moved_axes(at: Positions, circumstances: Circumstances) -> tuple[NDArray, NDArray]:
    """Whether (N,) the outer and the inner axis turned on the way to each position; both where that is not known."""
    both = np.ones(len(at.alpha), dtype=bool)
    if circumstances.before is None:
        return both, both
    ways = np.abs(np.stack((at.alpha, at.beta), axis=1) - circumstances.before)
    stayed = ways < MOVED
    return ~stayed[:, 0], ~stayed[:, 1]
