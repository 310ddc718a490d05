"""The exact model linearised at a point of its parameters: what every linear programme works on."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .parametrisation import (
    Parametrisation,
    Positions,
    predicted_input,
    predicted_reading,
    reading_jacobian,
)

NOT_OUTSIDE = 1e-4
"""Component of a unit vector outside the span that is put down to encoder errors."""


@dataclass(frozen=True)
class Linearisation:
    """The measurements near one point of the parameters: z ≈ f(point) + J (X − point).

    Measurements are ordered position by position, accelerometers 1, 2, 3 within each: M = 3 N.

    Attributes
    ----------
    parametrisation : Parametrisation
        the parameters and the mountings
    positions : Positions
        angles [rad] and mountings of the N positions
    reading : (N, 3) array
        readings over g
    point : (P,) array
        X̂, in the order of `parametrisation.symbols`
    prediction : (N, 3) array
        exact readings over g at the point
    residual : (M,) array
        reading less prediction
    jacobian : (M, P) array
        exact derivatives of the prediction
    bound : (M,) array
        σ, or more where the sign of the input is open, as fractions of g
    position, accelerometer : (M,) arrays of int
        index of the row in the record from 0, and accelerometer from 1
    input, sign : (N, 3) array
        inputs of the accelerometers [g] at the point, and the sign (+1, -1) that chose each scale factor
    span : (P, rank) array
        orthonormal basis of what the measurements determine, for an aligned bench or, when that is everything, at
        the point; the identity when they determine everything
    """

    parametrisation: Parametrisation
    positions: Positions
    reading: NDArray
    point: NDArray
    prediction: NDArray
    residual: NDArray
    jacobian: NDArray
    bound: NDArray
    position: NDArray
    accelerometer: NDArray
    input: NDArray
    sign: NDArray
    span: NDArray

    @property
    def deficient(self) -> bool:
        """Whether the measurements leave a parameter open."""
        return self.span.shape[1] < len(self.point)

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return self.parametrisation.symbols

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals (M,) at another point, with the signs of this one."""
        return (self.reading - predicted_reading(self.parametrisation, point, self.positions, self.sign)).ravel()


def linearise(
    parametrisation: Parametrisation,
    positions: Positions,
    reading: NDArray,
    point: NDArray,
    bound: NDArray,
    sign: NDArray | None = None,
) -> Linearisation:
    """Linearise the exact model at a point.

    Parameters
    ----------
    parametrisation, positions
        the parameters (P) and the positions (N)
    reading : (N, 3) array
        readings over g
    point : (P,) array
    bound : (3 N,) array
        noise bound of each measurement, as a fraction of g
    sign : (N, 3) array, optional
        signs of the inputs; by default those at the point
    """
    n = predicted_input(parametrisation, point, positions)
    sign = np.where(n >= 0.0, 1, -1) if sign is None else sign
    prediction = predicted_reading(parametrisation, point, positions, sign)
    jacobian = reading_jacobian(parametrisation, point, positions, sign).reshape(-1, len(point))
    span = determined(nominal_jacobian(parametrisation, positions), float(bound.min()))
    if span.shape[1] == len(point):
        span = determined(jacobian, float(bound.min()))
    count = len(reading)
    return Linearisation(
        parametrisation,
        positions,
        reading,
        point,
        prediction,
        (reading - prediction).ravel(),
        jacobian,
        bound,
        np.repeat(np.arange(count), 3),
        np.tile([1, 2, 3], count),
        n,
        sign,
        span,
    )


def nominal_jacobian(parametrisation: Parametrisation, positions: Positions) -> NDArray:
    """Derivatives (M, P) of the readings for a bench and a block without errors."""
    count = len(parametrisation.symbols)
    return reading_jacobian(parametrisation, np.zeros(count), positions).reshape(-1, count)


def determined(jacobian: NDArray, noise_bound: float) -> NDArray:
    """Orthonormal basis (P, rank) of the directions that measurements determine; the identity when they are all.

    A direction counts when its singular value exceeds √σ: then noise moves the estimate along it by so little that
    the second-order remainder of the move stays below the noise. Less than 1e-4 is what encoder errors alone give.

    Parameters
    ----------
    jacobian : (M, P) array
    noise_bound : float
        σ, as a fraction of g
    """
    missing = max(0, jacobian.shape[1] - len(jacobian))
    _, values, directions = np.linalg.svd(np.pad(jacobian, ((0, missing), (0, 0))), full_matrices=False)
    kept = values > max(1e-4, noise_bound**0.5)
    return np.eye(len(directions)) if kept.all() else directions[kept].T
