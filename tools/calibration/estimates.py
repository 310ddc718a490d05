"""Each target's value, guaranteed error and exact interval, and the verdict's radius, at the fit."""

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import RELATIVE_TOLERANCE, Polytope, chebyshev_radius
from ..progress import tracked
from .linearisation import NOT_OUTSIDE, Linearisation
from .result import Estimate
from .targets import Target

MANY_MEASUREMENTS = 5000
"""From here on the programmes take seconds."""


def chebyshev_centre(here: Linearisation) -> tuple[float, NDArray, NDArray]:
    """The least max |z − f(X)| / bound of the exact model, where it is attained, and the duals that prove it.

    The programme is solved again about its own centre with exact residuals until it stays there: near the fit
    one more time is enough. Where the measurements leave parameters open, the programme at the fit stands.

    Returns
    -------
    radius : float
    centre : (P,) array
    duals : (M,) array
        as of `chebyshev_radius`
    """
    radius, step, duals = chebyshev_radius(here.jacobian, here.residual, here.bound)
    if here.deficient:
        return radius, here.point, duals
    best = here.point
    attained = float(np.abs(here.residual / here.bound).max())
    for _ in range(8):
        centre = best + step
        residual = here.residual_at(centre)
        worst = float(np.abs(residual / here.bound).max())
        if worst >= attained:
            break
        best, attained = centre, worst
        if attained - radius <= 1e-9 * radius:
            break
        radius, step, duals = chebyshev_radius(here.jacobian, residual, here.bound)
    return radius, best, duals


def estimate_targets(here: Linearisation, wanted: list[Target], intervals: NDArray) -> list[Estimate]:
    """Each target's estimate and guaranteed error, with its exact interval.

    Parameters
    ----------
    here : Linearisation
        at the fit
    wanted : list of Target
    intervals : (T, 2) array
        of `exact_intervals`; NaN where there is none

    Returns
    -------
    list of Estimate
        with None for what the measurements do not determine
    """
    estimates = [Estimate(t.symbol, t.name, t.unit, None, None, None, None) for t in wanted]
    if here.span.shape[1] == 0:
        return estimates
    reduced = Polytope(here.jacobian @ here.span, here.bound)
    reduced.confine(-here.bound, here.bound)
    known = _determined_rows(here, [t.weights for t in wanted])
    for k in tracked(known, "guaranteed errors", show=takes_long(here)):
        t = wanted[k]
        error, _, phi = reduced.maximise(here.span.T @ t.weights)
        value = float(t.weights @ here.point + phi @ here.residual)
        ends = (None if np.isnan(end) else float(end) for end in intervals[k])
        estimates[k] = Estimate(t.symbol, t.name, t.unit, value, error, *ends)
    return estimates


def exact_intervals(here: Linearisation, weights: NDArray, centre: NDArray, slack: float) -> NDArray:
    """The least and the greatest weights'X that the measurements leave possible.

    The ends are those of the linear programmes about the centre, moved outwards by what the remainder of the
    linearisation can do: the greatest that it is at any of the vertices, weighted by each programme's duals.

    Parameters
    ----------
    here : Linearisation
        at the fit
    weights : (K, P) array
    centre : (P,) array
        the Chebyshev centre
    slack : float
        what a reading may be wrong by beside its noise (its last digit), as a fraction of g

    Returns
    -------
    (K, 2) array
        NaN where the measurements do not determine it
    """
    intervals = np.full((len(weights), 2), np.nan)
    if here.span.shape[1] == 0:
        return intervals
    feasible, residual = feasible_set(here, centre, slack)
    tops = {}
    remainder = np.zeros(len(residual))
    known = _determined_rows(here, weights)
    for k in tracked(known, "exact intervals", show=takes_long(here)):
        for side, sense in enumerate((-1.0, 1.0)):
            value, step, phi = feasible.maximise(here.span.T @ (sense * weights[k]))
            step = here.span @ step
            left = residual - here.residual_at(centre + step) - here.jacobian @ step
            remainder = np.maximum(remainder, np.abs(left))
            used = np.flatnonzero(phi)
            tops[k, side] = value, used, np.abs(phi[used])
    for k in known:
        middle = float(weights[k] @ centre)
        for side, sense in enumerate((-1.0, 1.0)):
            value, used, phi = tops[k, side]
            intervals[k, side] = middle + sense * (value + phi @ remainder[used])
    return intervals


def feasible_set(here: Linearisation, centre: NDArray, slack: float) -> tuple[Polytope, NDArray]:
    """The steps from the centre, in coordinates of `span`, that keep every residual within its bound.

    Returns
    -------
    polytope : Polytope
    residual : (M,) array
        exact, at the centre
    """
    residual = here.residual_at(centre)
    room = np.maximum(here.bound + slack, np.abs(residual)) * (1.0 + RELATIVE_TOLERANCE)
    polytope = Polytope(here.jacobian @ here.span, here.bound)
    polytope.confine(residual - room, residual + room)
    return polytope, residual


def _determined_rows(here: Linearisation, weights: Iterable[NDArray]) -> list[int]:
    return [k for k, row in enumerate(weights) if is_determined(here, row)]


def takes_long(here: Linearisation) -> bool:
    """Whether there are so many measurements that progress is worth showing."""
    return len(here.bound) >= MANY_MEASUREMENTS


def is_determined(here: Linearisation, weights: NDArray) -> bool:
    """Whether the measurements determine weights'X."""
    outside = float(np.linalg.norm(weights - here.span @ (here.span.T @ weights)))
    return outside <= NOT_OUTSIDE * float(np.linalg.norm(weights))
