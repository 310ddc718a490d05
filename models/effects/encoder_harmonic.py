"""Periodic error of an encoder: its reading is the true angle plus a harmonic of it."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import (
    AXES,
    Effect,
    EffectParameter,
    EffectPlace,
    polar_coefficients,
    turned,
)
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


EFFECT = Effect(
    name="encoder-harmonic",
    places=tuple(EffectPlace("encoder-harmonic", where, order) for where in AXES for order in ORDERS),
    parameters=(
        EffectParameter("amplitude", "rad", "amplitude of the harmonic", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "phase of the harmonic", math.pi),
    ),
    component="TurntableMotion",
    stage="encoder_effects",
    kernel=encoder_harmonic,
    place_numbers=lambda place: (place.index, place.order or 1),
    signature=lambda place, rows: turned(rows, turns(place, rows)),
    from_coefficients=polar_coefficients,
    sentence=lambda place, values: (
        f"the encoder of the {place.where.replace('-', ' ')} errs by "
        f"{math.degrees(values['amplitude']) * 3600.0:.1f} arcsec, {place.order} "
        f"time{'s' if place.order != 1 else ''} a turn"
    ),
    turns=turns,
    formula="{angle}_read = {angle} + {amplitude} sin({order} {angle} + ({phase}))",
)
