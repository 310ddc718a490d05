"""Periodic error of an encoder: its reading is the true angle plus a harmonic of it."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import AXES, EffectParameter, EffectPlace, table_effect
from .rows import Rows

ORDERS = (1, 2, 3, 4, 5, 6)


def encoder_harmonic(
    context: Vector, angles: Vector, axis: int, order: int, amplitude: float, phase: float, added: Vector
) -> None:
    """Add amplitude·sin(h·true + phase) to the reading of the encoder of an axis."""
    added[axis] = added[axis] + amplitude * math.sin(order * angles[axis] + phase)


def encoder_error(place: EffectPlace, alpha: NDArray[np.float64], beta: NDArray[np.float64]) -> NDArray[np.float64]:
    """Errors (N, 2, 2) of both encoders per amplitude·cos(phase) and amplitude·sin(phase)."""
    angle = (place.order or 1) * (alpha if place.index == 0 else beta)
    errors = np.zeros((len(angle), 2, 2))
    errors[:, place.index] = np.stack((np.sin(angle), np.cos(angle)), axis=1)
    return errors


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 2) at given readings: the true angle is the reading less the harmonic."""
    small = np.zeros((len(rows.hours), 4, 2))
    small[:, 1::2] = -encoder_error(place, rows.alpha, rows.beta)
    return small


EFFECT = table_effect(
    encoder_harmonic,
    (
        EffectParameter("amplitude", "rad", "amplitude of the harmonic", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "phase of the harmonic", math.pi),
    ),
    turns,
    "the encoder of the {axis} errs by {amplitude_arcsec:.1f} arcsec, {times} a turn",
    stage="encoder_effects",
    places=tuple(EffectPlace("encoder-harmonic", where, order) for where in AXES for order in ORDERS),
    formula="{angle}_read = {angle} + {amplitude} sin({order} {angle} + ({phase}))",
)
