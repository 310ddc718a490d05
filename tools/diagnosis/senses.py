"""Senses of the last change of each accelerometer's input, as far as a record tells them."""

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.parametrisation import Parametrisation, Positions, predicted_input
from trihedron.diagnosis.circumstances import Circumstances

INPUT_CHANGE = 1e-4
"""Change of an input [g] between rows whose sense is certain; a smaller one says nothing."""
SAME_WAY = 0.02
"""Ways [rad] of the two axes that differ by less end together."""


def input_senses(p: Parametrisation, point: NDArray, at: Positions, circumstances: Circumstances) -> NDArray:
    """Senses (N, 3) of the last change of each accelerometer's input: with the approach, else from the row before.

    The first row comes from no input. At an approach the axis with the longer way, which arrives last where both set
    out together at equal rates, has the last word; both have it when the ways are equal or not known.
    """
    step = 1e-30
    n = predicted_input(p, point, at)
    if circumstances.approached or circumstances.before is None:
        first, second = later_axes(at, circumstances)
        moving = Positions(
            at.alpha + 1j * step * first * circumstances.sense_alpha,
            at.beta + 1j * step * second * circumstances.sense_beta,
            at.mounting,
            at.tilts,
        )
        return np.sign(np.imag(predicted_input(p, point, moving)))
    before = predicted_input(p, point, Positions(circumstances.before[:, 0], circumstances.before[:, 1], at.mounting))
    change = n - np.nan_to_num(before)
    return np.where(np.abs(change) > INPUT_CHANGE, np.sign(change), 0.0)


def later_axes(at: Positions, circumstances: Circumstances) -> tuple[NDArray, NDArray]:
    """Whether (N,) the outer and the inner axis still moved when the table came to each position."""
    both = np.ones(len(at.alpha), dtype=bool)
    if circumstances.before is None:
        return both, both
    senses = np.stack((circumstances.sense_alpha, circumstances.sense_beta), axis=1)
    ways = np.remainder(senses * (np.stack((at.alpha, at.beta), axis=1) - circumstances.before), 2.0 * np.pi)
    # An axis that stayed seems to have gone all the way round.
    longer = np.diff(np.where(ways > 2.0 * np.pi - SAME_WAY, 0.0, ways), axis=1)[:, 0]
    return ~(longer > SAME_WAY), ~(longer < -SAME_WAY)
