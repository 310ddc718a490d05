"""What a record leaves open of the quantities that effects depend on."""

import numpy as np

from ...models.effects import CATALOGUE
from ..calibration.model import Linearisation
from .circumstances import Circumstances
from .disturbance import rows_at
from .extended_fit import ExtendedFit


def left_open(fit: ExtendedFit, here: Linearisation, circumstances: Circumstances) -> float:
    """By how much a reading may differ, fractions of g, within what a record tells of its effects' arguments."""
    found = 0.0
    for place, block in zip(fit.places, fit.blocks, strict=True):
        slack = CATALOGUE[place.effect].at(place).open_argument
        if slack is not None:
            rows = rows_at(here, fit.point, here.positions, circumstances)
            found += float(np.linalg.norm(fit.central[block])) * slack(place, rows)
    return found
