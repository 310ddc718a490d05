"""The sizes of an effect that a record leaves possible."""

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectParameter, EffectPlace
from ...models.effects.rows import Variant
from ..bounded.programmes import Polytope, SolverError
from .extended_fit import ExtendedFit

DIRECTIONS = 72
"""Directions in which a set of two coefficients is enclosed."""


Interval = tuple[float, float]


def feasible_set(fit: ExtendedFit, columns: NDArray, room: float) -> tuple[Polytope, NDArray, NDArray]:
    """The steps from a fit's Chebyshev centre that keep every residual within its bound.

    Parameters
    ----------
    fit : ExtendedFit
        consistent with the record
    columns : (M, C) array
        of further effects, beside those of the fit
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g

    Returns
    -------
    polytope : Polytope
        in the coordinates `span`
    span : (P + K + C, rank) array
        orthonormal basis of what the measurements determine, of parameters times their scale
    scale : (P + K + C,) array
    """
    matrix, lower, upper, span, scale = feasible_rows(fit, columns, room)
    polytope = Polytope(matrix, 0.5 * (upper - lower))
    polytope.confine(lower, upper)
    return polytope, span, scale


def feasible_rows(
    fit: ExtendedFit, columns: NDArray, room: float
) -> tuple[NDArray, NDArray, NDArray, NDArray, NDArray]:
    """The set of `feasible_set` as lower ≤ matrix x ≤ upper (M, rank), with its `span` and `scale`."""
    left = fit.residual - fit.jacobian @ fit.centre
    bound = np.maximum(fit.bound + room, np.abs(left)) * (1.0 + 1e-9)
    jacobian = np.hstack((fit.jacobian, columns))
    scale = np.abs(jacobian).max(axis=0)
    scale[scale == 0.0] = 1.0
    _, values, directions = np.linalg.svd(jacobian / scale, full_matrices=len(jacobian) < jacobian.shape[1])
    values = np.append(values, np.zeros(len(directions) - len(values)))
    span = directions[values > 1e-8 * values.max()].T
    return jacobian / scale @ span, left - bound, left + bound, span, scale


def parameter_intervals(
    fit: ExtendedFit, room: float, bounds: tuple[float, float] = (0.0, 0.0)
) -> tuple[tuple[Interval, ...], ...]:
    """Ends of the values that each parameter of each effect of a fit can have.

    Parameters
    ----------
    fit : ExtendedFit
        consistent with the record
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g
    bounds : (float, float)
        of Δβ and of Δg/g: the readings tell neither. Phases of the inner axis are known up to multiples of the former,
        coefficients of inputs up to powers of 1 − Δg/g

    Returns
    -------
    tuple of tuple of (low, high)
        for each effect, for each of its parameters; (-inf, inf) where the measurements do not determine it
    """
    count = fit.jacobian.shape[1]
    polytope, span, scale = feasible_set(fit, np.zeros((len(fit.residual), 0)), room)
    at = fit.central
    found: list[tuple[Interval, ...]] = []
    for place, block, variant in zip(fit.places, fit.blocks, fit.variants, strict=True):
        parameters = CATALOGUE[place.effect].at(place).parameters
        own = np.arange(block.start, block.stop)
        columns = len(fit.point) + own
        determined = np.linalg.norm(np.eye(count)[columns] - span[columns] @ span.T) <= 1e-6
        unknown = ((-math.inf, math.inf),) * len(parameters)

        def reach(direction: NDArray, own: NDArray = own, columns: NDArray = columns) -> float:
            weights = np.zeros(count)
            weights[columns] = direction / scale[columns]
            return float(direction @ at[own] + polytope.maximise(span.T @ weights)[0])

        try:
            if variant is not None:
                found.append(variant_intervals(variant, reach))
            else:
                found.append(effect_intervals(parameters, reach) if determined else unknown)
        except SolverError:
            found.append(unknown)
    return tuple(as_readings_tell(place, intervals, bounds) for place, intervals in zip(fit.places, found, strict=True))


def as_readings_tell(
    place: EffectPlace, intervals: Sequence[Interval], bounds: tuple[float, float]
) -> tuple[Interval, ...]:
    """Intervals of an effect's parameters, widened by what the readings do not tell of Δβ and Δg/g."""
    effect = CATALOGUE[place.effect].at(place)
    turned = bounds[0] * (place.order or 1) if place.where == "inner-axis" else 0.0
    return tuple(
        (low - turned, high + turned)
        if parameter.name.endswith("phase")
        else scaled_by_gravity((low, high), effect.degree, bounds[1])
        for parameter, (low, high) in zip(effect.parameters, intervals, strict=True)
    )


def scaled_by_gravity(ends: Interval, degree: int, gravity_error: float) -> Interval:
    """Ends of a coefficient of inputs of this degree, when the true inputs are up to 1 ∓ `gravity_error` times ours."""
    if degree == 0 or gravity_error == 0.0:
        return ends
    factors = [(1.0 + sign * gravity_error) ** -degree for sign in (-1.0, 1.0)]
    return min(ends[0] * factor for factor in factors), max(ends[1] * factor for factor in factors)


def variant_intervals(variant: Variant, reach: Callable[[NDArray], float]) -> tuple[Interval, ...]:
    """Intervals of the parameters of an effect that is not linear, for the way in which it acts."""
    if variant.columns.shape[2] == 0:
        return variant.limits
    unit = np.ones(1)
    low, high = variant.limits[0]
    return ((max(low, -reach(-unit)), min(high, reach(unit))),)


def effect_intervals(parameters: Sequence[EffectParameter], reach: Callable[[NDArray], float]) -> tuple[Interval, ...]:
    """Intervals of an effect's parameters: amplitudes and phases in pairs, others one by one."""
    names, count = [parameter.name for parameter in parameters], len(parameters)
    found: list[Interval] = []
    k = 0
    while k < count:
        unit = np.eye(count)
        if names[k].endswith("amplitude"):

            def in_plane(direction: NDArray, k: int = k, unit: NDArray = unit) -> float:
                return reach(direction[0] * unit[k] + direction[1] * unit[k + 1])

            found += polar_intervals(in_plane)
            k += 2
        else:
            least = parameters[k].smallest
            found.append((-reach(-unit[k]) if least is None else max(least, -reach(-unit[k])), reach(unit[k])))
            k += 1
    return tuple(found)


def polar_intervals(reach: Callable[[NDArray], float]) -> tuple[tuple[float, float], tuple[float, float]]:
    """Intervals of amplitude and phase that hold a convex set of (amplitude·cos(phase), amplitude·sin(phase)).

    The set lies within the polygon of its supporting lines in `DIRECTIONS` directions; the polygon's corners bound
    amplitude and phase. The phase is within (-π, π] at the middle and may reach beyond at the ends; (-π, π) when the
    set holds zero.
    """
    angles = 2.0 * math.pi * np.arange(DIRECTIONS) / DIRECTIONS
    units = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    heights = np.array([reach(unit) for unit in units])
    following = np.roll(heights, -1)
    turn = 2.0 * math.pi / DIRECTIONS
    along = (following - heights * math.cos(turn)) / math.sin(turn)
    corners = heights[:, None] * units + along[:, None] * np.stack((-units[:, 1], units[:, 0]), axis=1)
    high = float(np.linalg.norm(corners, axis=1).max())
    # The farthest that a line can separate the set from zero.
    low = float(max(0.0, (-heights).max()))
    if low == 0.0:
        return (0.0, high), (-math.pi, math.pi)
    middle = corners.mean(axis=0)
    phase = math.atan2(middle[1], middle[0])
    offsets = [math.remainder(math.atan2(y, x) - phase, 2.0 * math.pi) for x, y in corners]
    return (low, high), (phase + min(offsets), phase + max(offsets))
