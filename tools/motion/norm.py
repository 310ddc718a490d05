"""Equations of accelerometers by the norm of gravity over rests.

Reading/g = (I + Γ) n + b with |n| = 1 and Γ lower triangular. A turn of the block against its axes cannot be seen in
the norm: the first axis is the first accelerometer's and the second lies in the plane of the first two. With an error
|ρ| ≤ σ of each reading the residual |n| − 1 is within the sum of σ |(I + Γ)⁻ᵀ u|, u = n/|n|.
"""

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ..calibrated import Calibration
from .determinacy import COLUMNS, LEAST_SD, ROWS

NAMES = ("gamma_11", "gamma_21", "gamma_22", "gamma_31", "gamma_32", "gamma_33", "bias_1", "bias_2", "bias_3")
"""The nine parameters; Γ [1] row by row, then the biases [g]."""
UNITS_OF = dict.fromkeys(NAMES[:6], "1") | dict.fromkeys(NAMES[6:], "g")
LARGEST = 0.3
"""Beyond this a parameter is none of an instrument, and the linearisation fails."""


def norm_values(calibration: Calibration | None) -> Floats | None:
    """Return the nine parameters (9,) of a calibration by the norm of gravity; None where it has none."""
    if calibration is None or not all(p.determined for p in calibration.parameters):
        return None
    return np.array([p.estimate for p in calibration.parameters])


def norm_block(x: NDArray) -> tuple[NDArray, NDArray]:
    """I + Γ (3, 3) and b (3,) [g] of the nine parameters."""
    matrix = np.eye(3)
    matrix[ROWS, COLUMNS] += x[:6]
    return matrix, x[6:]


def inputs_of(x: NDArray, reading: NDArray) -> NDArray:
    """Inputs n (K, 3) [g] that readings (K, 3) [g] of a block with the nine parameters show."""
    matrix, bias = norm_block(x)
    return np.linalg.solve(matrix, (reading - bias).T).T


def norm_equations(x: NDArray, reading: NDArray, run: NDArray | None = None) -> tuple[NDArray, NDArray, NDArray]:
    """Return |n| − 1 (K,), its slopes (K, 6 + 3 R) by the parameters, and its sensitivity to reading errors (K, 3).

    x holds the six of Γ and the biases of R runs; `run` (K,) is the number of each reading's run, 0 if not given.
    """
    run = np.zeros(len(reading), dtype=int) if run is None else run
    matrix = norm_block(x)[0]
    n = np.linalg.solve(matrix, (reading - x[6:].reshape(-1, 3)[run]).T).T
    norm = np.linalg.norm(n, axis=1)
    back = np.linalg.solve(matrix.T, (n / norm[:, None]).T).T
    slopes = np.zeros((len(reading), len(x)))
    slopes[:, :6] = -back[:, ROWS] * n[:, COLUMNS]
    of_run = 6 + 3 * run[:, None] + np.arange(3)
    np.put_along_axis(slopes, of_run, -back, axis=1)
    return norm - 1.0, slopes, back


def standard_deviations(bound: NDArray) -> Floats:
    """Return the standard deviations (K,) [g] of means at rest whose bounds (K, 3) are three Allan deviations [g]."""
    return np.maximum(bound.max(axis=1) / 3.0, LEAST_SD)
