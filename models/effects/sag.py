"""Sag: the table gives way under the weight it carries, behind its encoders."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import EffectParameter, EffectPlace, table_effect
from .rows import Rows


def sag(context: Vector, angles: Vector, axis: int, amplitude: float, phase: float, turns: Vector) -> None:
    """Add the elastic turn: outer amplitude·sin(α + phase), inner amplitude·sin α·cos(β + phase).

    Weight acts across the outer axis by the angle of what it carries; across the inner one by what gravity has across
    that axis, sin α, and the angle β.
    """
    if axis == 0:
        turns[1] = turns[1] + amplitude * math.sin(angles[0] + phase)
    else:
        turns[3] = turns[3] + amplitude * math.sin(angles[0]) * math.cos(angles[1] + phase)


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 2) per amplitude·cos(phase) and amplitude·sin(phase)."""
    small = np.zeros((len(rows.hours), 4, 2))
    if place.index == 0:
        small[:, 1] = np.stack((np.sin(rows.alpha), np.cos(rows.alpha)), axis=1)
    else:
        small[:, 3] = np.sin(rows.alpha)[:, None] * np.stack((np.cos(rows.beta), -np.sin(rows.beta)), axis=1)
    return small


def open_argument(place: EffectPlace, rows: Rows) -> float:
    """Whether the sine of the outer angle counts from the encoder's zero or from the vertical is of second order."""
    return abs(rows.from_vertical) if place.index == 1 else 0.0


EFFECT = table_effect(
    sag,
    (
        EffectParameter("amplitude", "rad", "amplitude of the elastic turn", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "phase of the elastic turn", math.pi),
    ),
    turns,
    "weight turns the table elastically about the {axis}, by up to {amplitude_arcsec:.1f} arcsec",
    stage="geometry_effects",
    open_argument=open_argument,
    formula="'elastic outer turn' = {amplitude} sin(α + ({phase}))",
    of_place=lambda place: EFFECT if place.index == 0 else INNER,
)
INNER = dataclasses.replace(EFFECT, formula="'elastic inner turn' = {amplitude} sin(α) cos(β + ({phase}))")
