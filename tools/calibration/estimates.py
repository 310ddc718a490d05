"""Each target's value, guaranteed error and exact interval, and the verdict's radius, at the fit."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track

from trihedron.calibration.linearisation import NOT_OUTSIDE, Linearisation
from trihedron.calibration.programmes import RELATIVE_TOLERANCE, Polytope, chebyshev_radius
from trihedron.calibration.result import Estimate
from trihedron.calibration.targets import Target

MANY_MEASUREMENTS = 5000
"""From here on the programmes take seconds and show their progress."""


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


def estimate_targets(
    here: Linearisation,
    wanted: list[Target],
    centre: NDArray | None,
    slack: float,
) -> list[Estimate]:
    """Each target's estimate, guaranteed error and exact interval.

    The ends are those of the linear programmes about the centre, moved outwards by what the remainder of the
    linearisation can do: the greatest that it is at any of the vertices, weighted by each programme's duals.

    Parameters
    ----------
    here : Linearisation
        at the fit
    wanted : list of Target
    centre : (P,) array or None
        the Chebyshev centre; None where the data falsify the model, then there are no intervals
    slack : float
        what a reading may be wrong by beside its noise (its last digit), as a fraction of g

    Returns
    -------
    list of Estimate
        with None for what the measurements do not determine
    """
    unknown = [Estimate(t.symbol, t.name, t.unit, None, None, None, None) for t in wanted]
    if here.span.shape[1] == 0:
        return unknown
    known = [k for k, target in enumerate(wanted) if is_determined(here, target.weights)]
    reduced = Polytope(here.jacobian @ here.span, here.bound)
    reduced.confine(-here.bound, here.bound)
    console = Console(stderr=True)
    quiet = not console.is_terminal or len(here.bound) < MANY_MEASUREMENTS
    estimates = unknown
    for k in track(known, "guaranteed errors", console=console, disable=quiet, transient=True):
        t = wanted[k]
        error, _, phi = reduced.maximise(here.span.T @ t.weights)
        value = float(t.weights @ here.point + phi @ here.residual)
        estimates[k] = Estimate(t.symbol, t.name, t.unit, value, error, None, None)
    if centre is None:
        return estimates
    residual = here.residual_at(centre)
    room = np.maximum(here.bound + slack, np.abs(residual)) * (1.0 + RELATIVE_TOLERANCE)
    reduced.confine(residual - room, residual + room)
    tops = {}
    remainder = np.zeros(len(residual))
    for k in track(known, "exact intervals", console=console, disable=quiet, transient=True):
        for sense in (-1.0, 1.0):
            value, step, phi = reduced.maximise(here.span.T @ (sense * wanted[k].weights))
            step = here.span @ step
            left = residual - here.residual_at(centre + step) - here.jacobian @ step
            remainder = np.maximum(remainder, np.abs(left))
            tops[k, sense] = value, np.abs(phi)
    for k in known:
        middle = float(wanted[k].weights @ centre)
        low, high = (middle + sense * (tops[k, sense][0] + tops[k, sense][1] @ remainder) for sense in (-1.0, 1.0))
        estimates[k] = replace(estimates[k], low=float(low), high=float(high))
    return estimates


def is_determined(here: Linearisation, weights: NDArray) -> bool:
    """Whether the measurements determine weights'X."""
    outside = float(np.linalg.norm(weights - here.span @ (here.span.T @ weights)))
    return outside <= NOT_OUTSIDE * float(np.linalg.norm(weights))
