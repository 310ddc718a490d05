"""What the record excludes, and what an extension does to the calibration."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.programmes import Polytope, SolverError
from ..calibration.model import Linearisation
from ..calibration.result import Calibration
from .circumstances import Circumstances
from .disturbance import added_bound, disturbed, is_linear, rows_at, signature_columns
from .extended_fit import ExtendedFit
from .intervals import feasible_set, scaled_by_gravity

DIRECTIONS = 16
"""Directions in which the amplitude of an effect is bounded."""


def excluded_sizes(
    here: Linearisation,
    circumstances: Circumstances,
    places: Sequence[EffectPlace],
    model: ExtendedFit,
    room: float,
    gravity_error: float,
) -> tuple[dict[str, Any], ...]:
    """Upper bounds of the effects that were not found, each added to the model that explains the record.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
    places : sequence of EffectPlace
        the catalogue
    model : ExtendedFit
        the model that explains the record
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g
    gravity_error : float
        bound of Δg/g

    Returns
    -------
    tuple of dict
        effect, where, order, axes, parameter, unit and ``above``: sizes above it are excluded; effects that the record
        does not bound are left out
    """
    at = disturbed(here, model.point, model.places, model.coefficients, model.blocks, circumstances)
    rows = rows_at(here, model.point, at, circumstances)
    found = []
    for place in places:
        if place in model.places or not is_linear(place) or added_bound([place], rows).any():
            continue
        columns = signature_columns([place], rows)
        reach = reaches(model, columns, room)
        for k, parameter in enumerate(CATALOGUE[place.effect].at(place).parameters):
            if parameter.name.endswith("phase"):
                continue
            above = largest_size(reach, columns.shape[1], k, paired=parameter.name.endswith("amplitude"))
            above = scaled_by_gravity((0.0, above), CATALOGUE[place.effect].at(place).degree, gravity_error)[1]
            if not above < parameter.largest:
                continue
            entry: dict[str, Any] = {"effect": place.effect, "where": place.where}
            if place.order is not None:
                entry["order"] = place.order
            if place.axes:
                entry["axes"] = list(place.axes)
            found.append({**entry, "parameter": parameter.name, "unit": parameter.unit, "above": above})
    return tuple(found)


def reaches(model: ExtendedFit, columns: NDArray, room: float) -> Callable[[NDArray], float]:
    """How far the coefficients of one more effect can go in a direction (K,); infinite where nothing bounds them."""
    polytope, span, scale = feasible_set(model, columns, room)
    first = model.jacobian.shape[1]

    def reach(direction: NDArray) -> float:
        weights = np.zeros(len(scale))
        weights[first:] = direction / scale[first:]
        if np.linalg.norm(weights - span @ (span.T @ weights)) > 1e-6 * np.linalg.norm(weights):
            return np.inf
        try:
            return polytope.maximise(span.T @ weights)[0]
        except SolverError:
            return np.inf

    return reach


def largest_size(reach: Callable[[NDArray], float], count: int, k: int, *, paired: bool) -> float:
    """Largest absolute value of coefficient k of `count`, or largest length of the pair that begins there."""
    unit = np.eye(count)
    if not paired:
        return max(reach(unit[k]), reach(-unit[k]))
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    heights = [reach(np.cos(angle) * unit[k] + np.sin(angle) * unit[k + 1]) for angle in angles]
    # The supporting lines enclose the set; between two directions it reaches farther by this factor at most.
    return max(heights) / float(np.cos(np.pi / DIRECTIONS))


def target_shifts(nominal: Calibration, fit: ExtendedFit, room: float) -> tuple[dict[str, Any], ...]:
    """The calibration's targets without and with the effects: what they moved by, and the intervals.

    Parameters
    ----------
    nominal : Calibration
        of the nominal model: its estimates, which the effects bias
    fit : ExtendedFit
        the model with the effects
    room : float
        as for `excluded_sizes`

    Returns
    -------
    tuple of dict
        symbol, unit, before, after, low, high; low and high are of the extended model, None where it leaves the target
        open
    """
    here = nominal.linearised
    polytope, span, scale = feasible_set(fit, np.zeros((len(fit.residual), 0)), room)
    centre = fit.point + fit.centre[: len(fit.point)]
    shifts = []
    for k, symbol in enumerate(here.symbols):
        weights = np.zeros(fit.jacobian.shape[1])
        weights[k] = 1.0 / scale[k]
        low, high = ends_of(polytope, span, weights, centre[k])
        shifts.append(
            {
                "symbol": symbol,
                "before": float(here.point[k]),
                "after": float(fit.estimate[k]),
                "low": low,
                "high": high,
            }
        )
    return tuple(shifts)


def ends_of(polytope: Polytope, span: NDArray, weights: NDArray, middle: float) -> tuple[float | None, float | None]:
    """Ends of a parameter over a polytope about its middle; None where it is not determined."""
    if np.linalg.norm(weights - span @ (span.T @ weights)) > 1e-6 * np.linalg.norm(weights):
        return None, None
    try:
        return middle - polytope.maximise(-span.T @ weights)[0], middle + polytope.maximise(span.T @ weights)[0]
    except SolverError:
        return None, None
