"""Backlash of an encoder: its reading depends on the sense of the last move of its axis."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import SENSE_ALPHA, Vector
from .definition import (
    AXES,
    Effect,
    EffectParameter,
    EffectPlace,
    only_coefficient,
    turned,
)
from .rows import Rows


def backlash(context: Vector, angles: Vector, axis: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of the encoder of an axis."""
    added[axis] = added[axis] - 0.5 * width * context[SENSE_ALPHA + axis]


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 1) per width at given readings: the true angle is the reading plus sense·width/2."""
    small = np.zeros((len(rows.hours), 4, 1))
    small[:, 1 + 2 * place.index, 0] = 0.5 * (rows.sense_alpha if place.index == 0 else rows.sense_beta)
    return small


EFFECT = Effect(
    name="backlash",
    places=tuple(EffectPlace("backlash", where) for where in AXES),
    parameters=(
        EffectParameter("width", "rad", "what the axis turns on reversal before the encoder", 5e-3, smallest=0.0),
    ),
    component="TurntableMotion",
    stage="encoder_effects",
    kernel=backlash,
    place_numbers=lambda place: (place.index,),
    signature=lambda place, rows: turned(rows, turns(place, rows)),
    from_coefficients=only_coefficient,
    sentence=lambda place, values: (
        f"the {place.where.replace('-', ' ')} has {math.degrees(values['width']) * 3600.0:.1f} arcsec of backlash"
    ),
    turns=turns,
    formula="{angle}_read = {angle} − 'sense of the last move' · {width} / 2",
)
