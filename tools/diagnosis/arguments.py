"""What a record leaves open of the quantities that effects depend on."""

import numpy as np

from trihedron.calibration.linearisation import Linearisation
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.extended_fit import ExtendedFit
from trihedron.models.effects import CATALOGUE


def left_open(fit: ExtendedFit, here: Linearisation, circumstances: Circumstances) -> float:
    """By how much a reading may differ, fractions of g, within what a record tells of its effects' arguments.

    Temperatures are rounded to their last digit. The weight that bends the inner axis acts by the sine of the outer
    angle, and whether that counts from the encoder's zero or from the vertical, X2 away, is of second order.
    """
    found = 0.0
    for place, block in zip(fit.places, fit.blocks, strict=True):
        size = float(np.linalg.norm(fit.central[block]))
        if "temperature" in CATALOGUE[place.effect].needs:
            found += size * circumstances.temperature_resolution
        if place.effect == "sag" and place.where == "inner-axis":
            found += size * abs(float(fit.point[here.symbols.index("X2")]))
    return found
