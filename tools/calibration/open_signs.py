"""Readings whose input has no certain sign: kept, with a bound that covers either scale factor."""

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import NOT_OUTSIDE, Linearisation, determined
from trihedron.calibration.parametrisation import direction_jacobian
from trihedron.models.regressors import sign_margin


def widening(here: Linearisation, certain: NDArray, noise_bound: float, bounds: tuple[float, float]) -> NDArray:
    """|Γ⁺ − Γ⁻| |n|, as large as the data allow, where the sign of an input is open; 0 elsewhere.

    How far an input may be from its estimate follows from any weights that are unbiased on the measurements
    with certain signs; those of least squares are at hand. Truth is within σ of the readings, the fit within
    its residuals. Where those measurements do not determine an input, (1.7) bounds it.

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
    excess = 1.0 + min(3.0, float(np.abs(here.residual).max()) / noise_bound)
    size = np.abs(here.input)
    while True:
        spread = _spread(here, certain.ravel(), excess * noise_bound)
        uncertainty = np.zeros(here.input.shape)
        for i, k in zip(*np.nonzero(~certain), strict=True):
            uncertainty[i, k] = min(spread(gradient[i, k]), max(margin[i, k], size[i, k]))
        settled = ~certain & (size > uncertainty)
        if not settled.any():
            break
        certain = certain | settled
    for i, k in zip(*np.nonzero(~certain), strict=True):
        difference = p.selection[0, 3 + 2 * k] - p.selection[0, 4 + 2 * k]
        estimate = abs(float(difference @ here.point))
        asymmetry = min(estimate + spread(difference), max(estimate, 2.0 * bounds[1]))
        extra[i, k] = asymmetry * (size[i, k] + uncertainty[i, k])
    return extra.ravel()


def _spread(here: Linearisation, rows: NDArray, noise: float):
    """How far a linear function of the parameters may be from its estimate, by the measurements `rows` alone."""
    jacobian = here.jacobian[rows]
    if not rows.any():
        return lambda direction: np.inf
    span = determined(jacobian, float(here.bound.min()))
    weights = span @ np.linalg.pinv(jacobian @ span)

    def spread(direction: NDArray) -> float:
        outside = float(np.linalg.norm(direction - span @ (span.T @ direction)))
        if outside > NOT_OUTSIDE:
            return np.inf
        return noise * float(np.abs(direction @ weights).sum())

    return spread
