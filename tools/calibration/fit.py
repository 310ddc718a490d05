"""Least-squares fit of the exact model to a record, relinearised to convergence: coarse, then fine."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...models.regressors import admissible, nominal_input
from ..errors import InputError
from .linearisation import Linearisation, determined, linearise, nominal_jacobian
from .open_parameters import open_moves, undetermined_remainder
from .open_signs import widening
from .parametrisation import (
    Parametrisation,
    Positions,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)

ITERATIONS_BEFORE_SIGNS_REST = 8
"""From then on the signs of the inputs are kept, so that one at zero cannot keep the fit from converging."""
MAX_ITERATIONS = 60
COARSE = 1e-2
"""Singular values below this fraction of the largest are left out of the first, coarse estimate."""


def fit(
    parametrisation: Parametrisation,
    positions: Positions,
    reading: NDArray,
    noise_bound: float,
    bounds: tuple[float, float],
    extent: NDArray,
) -> Linearisation:
    """Fit the exact model by least squares, relinearising to convergence, and linearise at the fit.

    The first estimate is from measurements whose sign is certain by (1.7); then all are used, with the signs of the
    inputs from the estimate. Where the estimate leaves a sign open the bound is widened by |Γ⁺ − Γ⁻| |n|. Directions
    of the parameters that the measurements leave open stay at zero, and the bounds are widened by what they may do.

    Parameters
    ----------
    parametrisation, positions
        the parameters (P) and the positions (N)
    reading : (N, 3) array
        readings over g
    noise_bound : float
        σ, as a fraction of g
    bounds : (float, float)
        u^max and v^0max of (1.7)
    extent : (P,) array
        how large each parameter may be where the measurements leave it open

    Raises
    ------
    InputError
        when the fit does not converge
    """
    bound = np.full(reading.size, noise_bound)
    matrices = parametrisation.matrices[positions.mounting]
    certain = admissible(positions.alpha, positions.beta, matrices, bounds=bounds)
    nominal_sign = np.where(nominal_input(positions.alpha, positions.beta, matrices) >= 0.0, 1, -1)
    span = determined(nominal_jacobian(parametrisation, positions), noise_bound)
    problem = _Problem(parametrisation, positions, reading, span)
    point = np.zeros(len(parametrisation.symbols))
    point = point + problem.step(point, certain.ravel().astype(float), nominal_sign, COARSE)
    for _ in range(5):
        weight = noise_bound / bound
        point, sign, settled = problem.minimise(point, weight)
        here = linearise(parametrisation, positions, reading, point, bound, sign)
        if here.span.shape[1] < problem.span.shape[1]:
            problem = replace(problem, span=here.span)
            point, sign, settled = problem.minimise(np.zeros(len(point)), weight)
            here = linearise(parametrisation, positions, reading, point, bound, sign)
        if not settled:
            raise InputError(
                "the fit of the bench model does not converge: are the angles in degrees and the mounting right?"
            )
        if parametrisation.symmetric:
            break
        widened = noise_bound + widening(here, certain & (sign == nominal_sign), noise_bound, bounds)
        if np.allclose(widened, bound, rtol=1e-6, atol=0.0):
            break
        bound = widened
    if here.deficient:
        here = replace(here, bound=here.bound + undetermined_remainder(here, open_moves(here, extent)))
    return here


@dataclass(frozen=True)
class _Problem:
    """Weighted least squares of the exact model within the span of what measurements determine."""

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    span: NDArray

    def residual(self, point: NDArray, sign: NDArray | None = None) -> NDArray:
        """Readings less those predicted at a point (3 N,), fractions of g."""
        return (self.reading - predicted_reading(self.parametrisation, point, self.positions, sign)).ravel()

    def step(self, point: NDArray, weight: NDArray, sign: NDArray, cut: float | None = None) -> NDArray:
        """One linear step; directions with singular values below `cut` of the largest are left alone."""
        jacobian = reading_jacobian(self.parametrisation, point, self.positions, sign).reshape(-1, len(point))
        rows = (jacobian @ self.span) * weight[:, None]
        return self.span @ np.linalg.lstsq(rows, self.residual(point, sign) * weight, rcond=cut)[0]

    def misfit(self, point: NDArray, weight: NDArray, sign: NDArray | None) -> float:
        """Norm of the weighted residual at a point."""
        return float(np.linalg.norm(self.residual(point, sign) * weight))

    def minimise(self, point: NDArray, weight: NDArray) -> tuple[NDArray, NDArray, bool]:
        """Gauss-Newton from a point; the minimum, the signs of the inputs there, and whether it settled."""
        sign, last = np.zeros(self.reading.shape), np.inf
        for iteration in range(MAX_ITERATIONS):
            resting = iteration > ITERATIONS_BEFORE_SIGNS_REST
            if not resting:
                sign = np.where(predicted_input(self.parametrisation, point, self.positions) >= 0.0, 1, -1)
            step = self.step(point, weight, sign)
            size = float(np.abs(step).max())
            if size > 1e-6:
                signs = sign if resting else None
                now = self.misfit(point, weight, signs) * (1 + 1e-9)
                while self.misfit(point + step, weight, signs) > now and np.abs(step).max() > 1e-3 * size:
                    step = step / 2
            point = point + step
            still = size < 1e-11 and size >= 0.5 * last and resting
            if size < 1e-15 or still:
                return point, sign, True
            last = size
        return point, sign, last < 1e-8
