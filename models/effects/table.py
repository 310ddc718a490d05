"""Effects of the table beyond its nominal geometry: small turns behind its encoders, and errors of these.

encoder_harmonic
    the reading of an encoder is the true angle plus a harmonic of it
backlash
    the reading of an encoder depends on the sense of the last move of its axis
encoder_lag
    the reading of an encoder is late: it lacks the axis's turn within a time
axis_wobble
    the direction of an axis moves periodically as it turns
sag
    the table bends under the weight it carries, behind its encoders
base_drift
    the foundation tilts with time, and the table with it
"""

import dataclasses
import math
from itertools import product

import numpy as np

from ..arrays import Floats
from ..restricted import HOURS, RATE, SENSE_ALPHA, Vector
from .columns import Rows
from .definition import AXES, Effect, EffectParameter, EffectPlace, said, table_effect


def encoder_harmonic(
    context: Vector, angles: Vector, axis: int, order: int, amplitude: float, phase: float, added: Vector
) -> None:
    """Add amplitude·sin(h·true + phase) to the reading of the encoder of an axis."""
    added[axis] = added[axis] + amplitude * math.sin(order * angles[axis] + phase)


ENCODER_HARMONIC = table_effect(
    encoder_harmonic,
    (
        EffectParameter("amplitude", "rad", "amplitude of the harmonic", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "phase of the harmonic", math.pi),
    ),
    "the encoder of the {axis} errs by {amplitude_arcsec:.4g} arcsec, {times} a turn",
    stage="encoder_effects",
    places=tuple(EffectPlace("encoder-harmonic", where, order) for where, order in product(AXES, range(1, 7))),
    formula="{angle}_read = {angle} + {amplitude} sin({order} {angle} + ({phase}))",
)


def backlash(context: Vector, angles: Vector, axis: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of the encoder of an axis."""
    added[axis] = added[axis] - 0.5 * width * context[SENSE_ALPHA + axis]


BACKLASH = table_effect(
    backlash,
    EffectParameter("width", "rad", "what the axis turns on reversal before the encoder", 5e-3, smallest=0.0),
    "the {axis} has {width_arcsec:.4g} arcsec of backlash",
    stage="encoder_effects",
    formula="{angle}_read = {angle} − 'sense of the last move' · {width} / 2",
)


def encoder_lag(context: Vector, angles: Vector, axis: int, time: float, added: Vector) -> None:
    """Add -time·rate to the reading of the encoder of an axis."""
    added[axis] = added[axis] - time * context[RATE + axis]


ENCODER_LAG = table_effect(
    encoder_lag,
    EffectParameter("time", "s", "by which the encoder lags; negative: it leads", 1e-2),
    lambda place, values: f"the encoder of the {place.where.replace('-', ' ')} lags by {1e3 * values['time']:.4g} ms",
    stage="encoder_effects",
    formula="{angle}_read = {angle} − {time} 's' d{angle}/dt",
)


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


def wobble_at(place: EffectPlace) -> Effect:
    """Return the wobble of the outer axis, of the inner one with one harmonic, or with two."""
    return OUTER_WOBBLE if place.index == 0 else INNER_WOBBLE_FIRST if place.order == 1 else INNER_WOBBLE


OUTER_WOBBLE = table_effect(
    outer_axis_wobble,
    (
        EffectParameter("amplitude", "rad", "amplitude of the harmonic of κ", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "its phase", math.pi),
    ),
    lambda place, values: said("the {axis} wobbles by {most_arcsec:.4g} arcsec, {times} a turn")(
        place, {"most": max(v for name, v in values.items() if name.endswith("amplitude"))}
    ),
    stage="geometry_effects",
    name="axis-wobble",
    places=tuple(EffectPlace("axis-wobble", where, order) for where, order in product(AXES, range(1, 4))),
    formula="Δκ = {amplitude} cos({order} α + ({phase}))",
    of_place=wobble_at,
)
INNER_WOBBLE_FIRST = dataclasses.replace(
    OUTER_WOBBLE,
    parameters=(
        EffectParameter("epsilon_amplitude", "rad", "amplitude of the harmonic of ε", 5e-3, smallest=0.0),
        EffectParameter("epsilon_phase", "rad", "its phase", math.pi),
    ),
    kernel=inner_axis_first_wobble,
    formula="Δε = {epsilon_amplitude} cos({order} β + ({epsilon_phase}))",
)
INNER_WOBBLE = dataclasses.replace(
    OUTER_WOBBLE,
    parameters=(
        *INNER_WOBBLE_FIRST.parameters,
        EffectParameter("tilt_amplitude", "rad", "amplitude of the harmonic of the outer turn", 5e-3, smallest=0.0),
        EffectParameter("tilt_phase", "rad", "its phase", math.pi),
    ),
    kernel=inner_axis_wobble,
    formula=f"{INNER_WOBBLE_FIRST.formula}, 'outer turn' = {{tilt_amplitude}} cos({{order}} β + ({{tilt_phase}}))",
)


def sag(context: Vector, angles: Vector, axis: int, amplitude: float, phase: float, turns: Vector) -> None:
    """Add the elastic turn: outer amplitude·sin(α + phase), inner amplitude·sin α·cos(β + phase).

    The weight acts across the outer axis by the angle of its load; across the inner one by gravity's part across that
    axis, sin α, and the angle β.
    """
    if axis == 0:
        turns[1] = turns[1] + amplitude * math.sin(angles[0] + phase)
    else:
        turns[3] = turns[3] + amplitude * math.sin(angles[0]) * math.cos(angles[1] + phase)


def open_sine(place: EffectPlace, rows: Rows) -> Floats:
    """Return the effect of the sine's origin, the encoder's zero or the vertical, which is of second order."""
    return np.abs(rows.by_beta) * (abs(rows.from_vertical) if place.index == 1 else 0.0)


SAG = table_effect(
    sag,
    (
        EffectParameter("amplitude", "rad", "amplitude of the elastic turn", 5e-3, smallest=0.0),
        EffectParameter("phase", "rad", "phase of the elastic turn", math.pi),
    ),
    "weight turns the table elastically about the {axis}, by up to {amplitude_arcsec:.4g} arcsec",
    stage="geometry_effects",
    open_argument=open_sine,
    formula="'elastic outer turn' = {amplitude} sin(α + ({phase}))",
    of_place=lambda place: SAG if place.index == 0 else INNER_SAG,
)
INNER_SAG = dataclasses.replace(SAG, formula="'elastic inner turn' = {amplitude} sin(α) cos(β + ({phase}))")


def base_drift(context: Vector, angles: Vector, kappa_rate: float, alpha_star_rate: float, turns: Vector) -> None:
    """Add rate·hours to κ and to α*; the true outer angle is the reading less α*."""
    turns[0] = turns[0] + kappa_rate * context[HOURS]
    turns[1] = turns[1] - alpha_star_rate * context[HOURS]


BASE_DRIFT = table_effect(
    base_drift,
    (
        EffectParameter("kappa_rate", "rad/h", "growth of κ with time", 1e-2),
        EffectParameter("alpha_star_rate", "rad/h", "growth of α* with time", 1e-2),
    ),
    "the base tilts with time: κ by {kappa_rate_arcsec:+.4g} arcsec an hour, "
    "α* by {alpha_star_rate_arcsec:+.4g} arcsec an hour",
    stage="geometry_effects",
    places=(EffectPlace("base-drift", "base"),),
    formula="Δκ = {kappa_rate} t, Δα* = {alpha_star_rate} t, t 'in hours'",
)

EFFECTS = (ENCODER_HARMONIC, BACKLASH, ENCODER_LAG, OUTER_WOBBLE, SAG, BASE_DRIFT)
