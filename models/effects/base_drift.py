"""Drift of the base: the foundation tilts with time, and the table with it."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import HOURS, Vector
from .definition import EffectParameter, EffectPlace, table_effect
from .rows import Rows


def base_drift(context: Vector, angles: Vector, kappa_rate: float, alpha_star_rate: float, turns: Vector) -> None:
    """Add rate·hours to κ and to α*; the true outer angle is the reading less α*."""
    turns[0] = turns[0] + kappa_rate * context[HOURS]
    turns[1] = turns[1] - alpha_star_rate * context[HOURS]


def turns(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Small turns (N, 4, 2) per rate of κ and of α*."""
    small = np.zeros((len(rows.hours), 4, 2))
    small[:, 0, 0] = rows.hours
    small[:, 1, 1] = -rows.hours
    return small


EFFECT = table_effect(
    base_drift,
    (
        EffectParameter("kappa_rate", "rad/h", "growth of κ with time", 1e-2),
        EffectParameter("alpha_star_rate", "rad/h", "growth of α* with time", 1e-2),
    ),
    turns,
    "the base tilts with time: κ by {kappa_rate_arcsec:+.1f} arcsec an hour, "
    "α* by {alpha_star_rate_arcsec:+.1f} arcsec an hour",
    stage="geometry_effects",
    places=(EffectPlace("base-drift", "base"),),
    formula="Δκ = {kappa_rate} t, Δα* = {alpha_star_rate} t, t 'in hours'",
)
