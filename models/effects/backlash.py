"""Backlash of an encoder: its reading depends on the sense of the last move of its axis."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import SENSE_ALPHA, Vector
from .definition import EffectParameter, EffectPlace, table_effect
from .rows import Rows


def backlash(context: Vector, angles: Vector, axis: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of the encoder of an axis."""
    added[axis] = added[axis] - 0.5 * width * context[SENSE_ALPHA + axis]


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 1) per width at given readings: the true angle is the reading plus sense·width/2."""
    small = np.zeros((len(rows.hours), 4, 1))
    small[:, 1 + 2 * place.index, 0] = 0.5 * (rows.sense_alpha if place.index == 0 else rows.sense_beta)
    return small


EFFECT = table_effect(
    backlash,
    EffectParameter("width", "rad", "what the axis turns on reversal before the encoder", 5e-3, smallest=0.0),
    turns,
    "the {axis} has {width_arcsec:.1f} arcsec of backlash",
    stage="encoder_effects",
    formula="{angle}_read = {angle} − 'sense of the last move' · {width} / 2",
)
