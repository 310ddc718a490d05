"""Readings whose input has no certain sign: kept, with a bound that covers either scale factor."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...models.regressors import sign_margin
from .linearisation import NOT_OUTSIDE, Linearisation, determined
from .parametrisation import direction_jacobian

MAX_ROUNDS = 30
ENOUGH = 6000
"""So many measurements, spread over the record, are weighed: more would tell little more and take long."""


def widening(here: Linearisation, certain: NDArray, noise_bound: float, bounds: tuple[float, float]) -> NDArray:
    """|Γ⁺ − Γ⁻| |n|, as large as the data allow, where the sign of an input is open; 0 elsewhere.

    At first (1.7) says how far an input may be from its estimate. With the bounds that follow, all measurements
    together say it better, by any weights that are unbiased (those of least squares are at hand), and so on until
    nothing is gained: truth is within the bounds of the readings at every step, the fit within its residuals.

    Parameters
    ----------
    here : Linearisation
        at the fit
    certain : (N, 3) array of bool
        where the sign was certain before anything was known
    noise_bound : float
        σ, as a fraction of g
    bounds : (float, float)
        u^max and v^0max of (1.7)

    Returns
    -------
    (3 N,) array
        what to add to the bound of each measurement, as a fraction of g
    """
    extra = np.zeros(here.input.shape)
    if certain.all():
        return extra.ravel()
    p = here.parametrisation
    matrices = p.matrices[here.positions.mounting]
    margin = sign_margin(here.positions.alpha, here.positions.beta, matrices, bounds=bounds)
    gradient = direction_jacobian(p, here.point, here.positions)
    size = np.abs(here.input)
    uncertainty = np.where(certain, 0.0, np.maximum(margin, size))
    difference = p.selection[0, 3:9:2] - p.selection[0, 4:9:2]
    estimate = np.abs(difference @ here.point)
    asymmetry = np.maximum(estimate, 2.0 * bounds[1])
    for _ in range(MAX_ROUNDS):
        still_open = ~certain & (size <= uncertainty)
        last, extra = extra, np.where(still_open, asymmetry * (size + uncertainty), 0.0)
        if np.abs(extra - last).max() <= 1e-3 * noise_bound:
            break
        spread = _spread(here, noise_bound + extra.ravel())
        for i, k in zip(*np.nonzero(still_open), strict=True):
            uncertainty[i, k] = min(uncertainty[i, k], spread(gradient[i, k]))
        asymmetry = np.minimum(asymmetry, estimate + [spread(row) for row in difference])
    return extra.ravel()


def _spread(here: Linearisation, bound: NDArray) -> Callable[[NDArray], float]:
    """How far a linear function of the parameters may be from its estimate when readings are within `bound`."""
    every = len(bound) // ENOUGH + 1
    # three readings for each position: a stride of a multiple of three would leave accelerometers out
    every += every % 3 == 0
    jacobian = here.jacobian[::every] / bound[::every, None]
    span = determined(jacobian * bound.min(), float(bound.min()))
    if every > 1 and span.shape[1] < here.span.shape[1]:
        jacobian = here.jacobian / bound[:, None]
        span = determined(jacobian * bound.min(), float(bound.min()))
    weights = span @ np.linalg.pinv(jacobian @ span)
    excess = 1.0 + min(3.0, float(np.abs(here.residual / bound).max()))

    def spread(direction: NDArray) -> float:
        if np.linalg.norm(direction - span @ (span.T @ direction)) > NOT_OUTSIDE:
            return np.inf
        return excess * float(np.abs(direction @ weights).sum())

    return spread
