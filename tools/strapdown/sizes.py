"""Sizes of parameters and effects: estimates, and what the record leaves possible."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ..diagnosis.result import Cause
from ..evidence.evidence import Evidence, Fit
from .intervals import parameter_ends
from .result import BaselineParameter


def estimates(system: Evidence, fit: Fit, *, ends: bool = False) -> tuple[BaselineParameter, ...]:
    """The baseline's parameters by a fit, with what the record leaves possible where that is asked for."""
    count = len(system.names)
    values = system.point + system.estimate(fit.places)[:count]
    limits = parameter_ends(system, fit)[:count] if ends else np.full((count, 2), np.nan)
    if ends:
        values = np.clip(values, limits[:, 0], limits[:, 1])
    return tuple(
        BaselineParameter(name, unit, float(value), *(float(end) if np.isfinite(end) else None for end in pair))
        for (name, unit), value, pair in zip(system.names, values, limits, strict=True)
    )


def causes_of(system: Evidence, fit: Fit, classes: Mapping[EffectPlace, tuple[EffectPlace, ...]]) -> tuple[Cause, ...]:
    """A set of effects with their sizes by least squares and what the record leaves possible of them."""
    ends = parameter_ends(system, fit)[len(system.names) :]
    solution = system.estimate(fit.places)
    solution[len(system.names) :] = np.clip(solution[len(system.names) :], ends[:, 0], ends[:, 1])
    values = system.values_of(fit.places, solution)
    found, at = [], 0
    for place in fit.places:
        count = len(CATALOGUE[place.effect].at(place).parameters)
        own = tuple((float(low), float(high)) for low, high in ends[at : at + count])
        found.append(Cause.found(place, classes.get(place, ()), [float(v) for v in values[place]], own))
        at += count
    return tuple(found)


def left_of(system: Evidence, fit: Fit) -> tuple[NDArray[np.float64], ...]:
    """Errors that a fit leaves, for each part (S, d) [rad]."""
    return tuple(system.split(system.left_by(fit)))
