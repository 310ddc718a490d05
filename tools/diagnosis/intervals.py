"""The sizes of an effect that a record leaves possible."""

import math

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.programmes import Polytope, SolverError
from trihedron.diagnosis.extended_fit import ExtendedFit
from trihedron.models.effects import CATALOGUE

DIRECTIONS = 72
"""Directions in which a set of two coefficients is enclosed."""


def parameter_intervals(fit: ExtendedFit, room: float) -> tuple[tuple[float, float], ...]:
    """Ends of the values that each parameter of the only effect of a fit can have.

    Parameters
    ----------
    fit : ExtendedFit
        with one effect, consistent with the record
    room : float
        what the readings' rounding adds to their bounds, as a fraction of g

    Returns
    -------
    tuple of (low, high)
        one for each parameter; (-inf, inf) where the measurements do not determine it
    """
    effect = CATALOGUE[fit.places[0].effect]
    first = len(fit.point)
    centre = fit.residual - fit.jacobian @ fit.centre
    bound = np.maximum(fit.bound + room, np.abs(centre)) * (1.0 + 1e-9)
    columns = fit.jacobian.shape[1]
    scale = np.abs(fit.jacobian).max(axis=0)
    scale[scale == 0.0] = 1.0
    _, values, directions = np.linalg.svd(fit.jacobian / scale, full_matrices=True)
    values = np.append(values, np.zeros(columns - len(values)))
    span = directions[values > 1e-8 * values.max()].T
    if np.linalg.norm(np.eye(columns)[first:] - span[first:] @ span.T) > 1e-6:
        return ((-math.inf, math.inf),) * len(effect.parameters)
    polytope = Polytope(fit.jacobian / scale @ span, bound)
    polytope.confine(centre - bound, centre + bound)
    middle = fit.coefficients + fit.centre[first:]

    def reach(direction: NDArray) -> float:
        weights = np.zeros(columns)
        weights[first:] = direction / scale[first:]
        return float(direction @ middle + polytope.maximise(span.T @ weights)[0])

    try:
        if len(middle) == 1:
            return ((-reach(np.array([-1.0])), reach(np.array([1.0]))),)
        return polar_intervals(reach)
    except SolverError:
        return ((-math.inf, math.inf),) * len(effect.parameters)


def polar_intervals(reach) -> tuple[tuple[float, float], tuple[float, float]]:
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
