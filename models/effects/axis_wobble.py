"""Wobble of an axis: its direction moves periodically as it turns."""

import dataclasses
import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import Vector
from .definition import AXES, Effect, EffectParameter, EffectPlace, said, table_effect
from .rows import Rows

ORDERS = (1, 2, 3)


def outer_axis_wobble(
    context: Vector, angles: Vector, order: int, amplitude: float, phase: float, turns: Vector
) -> None:
    """Add amplitude·cos(h α + phase) to κ."""
    turns[0] = turns[0] + amplitude * math.cos(order * angles[0] + phase)


def inner_axis_first_wobble(
    context: Vector, angles: Vector, order: int, epsilon_amplitude: float, epsilon_phase: float, turns: Vector
) -> None:
    """Add epsilon_amplitude·cos(h β + epsilon_phase) to ε."""
    turns[2] = turns[2] + epsilon_amplitude * math.cos(order * angles[1] + epsilon_phase)


def inner_axis_wobble(
    context: Vector,
    angles: Vector,
    order: int,
    epsilon_amplitude: float,
    epsilon_phase: float,
    tilt_amplitude: float,
    tilt_phase: float,
    turns: Vector,
) -> None:
    """Add a harmonic of β to ε and another one to the turn about the outer axis."""
    turns[2] = turns[2] + epsilon_amplitude * math.cos(order * angles[1] + epsilon_phase)
    turns[1] = turns[1] + tilt_amplitude * math.cos(order * angles[1] + tilt_phase)


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 2 or 4) per amplitude·cos(phase) and amplitude·sin(phase) of each harmonic."""
    angle = (place.order or 1) * (rows.alpha if place.index == 0 else rows.beta)
    harmonic = np.stack((np.cos(angle), -np.sin(angle)), axis=1)
    columns = (0,) if place.index == 0 else (2,) if place.order == 1 else (2, 1)
    small = np.zeros((len(angle), 4, 2 * len(columns)))
    for k, column in enumerate(columns):
        small[:, column, 2 * k : 2 * k + 2] = harmonic
    return small


def of_place(place: EffectPlace) -> Effect:
    """The wobble of the outer axis, of the inner one with one harmonic, or with two."""
    return OUTER if place.index == 0 else INNER_FIRST if place.order == 1 else INNER


OUTER = table_effect(
    outer_axis_wobble,
    (
        EffectParameter("amplitude", "rad", "amplitude of the harmonic of κ", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "its phase", math.pi),
    ),
    turns,
    lambda place, values: said("the {axis} wobbles by {most_arcsec:.1f} arcsec, {times} a turn")(
        place, {"most": max(v for name, v in values.items() if name.endswith("amplitude"))}
    ),
    stage="geometry_effects",
    name="axis-wobble",
    places=tuple(EffectPlace("axis-wobble", where, order) for where in AXES for order in ORDERS),
    formula="Δκ = {amplitude} cos({order} α + ({phase}))",
    of_place=of_place,
)
INNER_FIRST = dataclasses.replace(
    OUTER,
    parameters=(
        EffectParameter("epsilon_amplitude", "rad", "amplitude of the harmonic of ε", 5e-3, smallest=0.0),
        EffectParameter("epsilon_phase", "rad", "its phase", math.pi),
    ),
    kernel=inner_axis_first_wobble,
    formula="Δε = {epsilon_amplitude} cos({order} β + ({epsilon_phase}))",
)
INNER = dataclasses.replace(
    OUTER,
    parameters=(
        *INNER_FIRST.parameters,
        EffectParameter("tilt_amplitude", "rad", "amplitude of the harmonic of the outer turn", 5e-3, smallest=0.0),
        EffectParameter("tilt_phase", "rad", "its phase", math.pi),
    ),
    kernel=inner_axis_wobble,
    formula=f"{INNER_FIRST.formula}, 'outer turn' = {{tilt_amplitude}} cos({{order}} β + ({{tilt_phase}}))",
)
EFFECT = OUTER
