"""Accelerometers calibrated by the norm of gravity over rests: least squares and guaranteed bounds side by side.

Reading/g = (I + Γ) n + b with |n| = 1 and Γ lower triangular. A turn of the block against its axes cannot be seen in
the norm: the first axis is the first accelerometer's and the second lies in the plane of the first two. With an error
|ρ| ≤ σ of each reading the residual |n| − 1 is within the sum of σ |(I + Γ)⁻ᵀ u|, u = n/|n|.
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import Polytope, SolverError, chebyshev_radius
from ..calibrated import UNITS, Calibration, Open, Parameter, Sigma, Verdict
from .determinacy import COLUMNS, DETERMINED, LEAST_SD, ROWS, USABLE, Determinacy, candidate_poses, closing_poses

NAMES = ("gamma_11", "gamma_21", "gamma_22", "gamma_31", "gamma_32", "gamma_33", "bias_1", "bias_2", "bias_3")
"""The nine parameters; Γ [1] row by row, then the biases [g]."""
UNITS_OF = dict.fromkeys(NAMES[:6], "1") | dict.fromkeys(NAMES[6:], "g")
LARGEST = 0.3
"""Beyond this a parameter is none of an instrument, and the linearisation fails."""
ITERATIONS = 30


def norm_values(calibration: Calibration | None) -> NDArray[np.float64] | None:
    """Return the nine parameters (9,) of a calibration by the norm of gravity; None where it has none."""
    if calibration is None or not all(p.determined for p in calibration.parameters):
        return None
    return np.array([p.estimate for p in calibration.parameters])


def _calibration(
    verdict: Verdict,
    radius: float | None = None,
    missing: Sequence[str] = (),
    columns: Mapping[str, NDArray] = MappingProxyType({}),
) -> Calibration:
    """Return the calibration with some columns (9,) of numbers, and the poses that are missing, in words."""
    parameters = []
    for k, name in enumerate(NAMES):
        numbers: dict[str, float | None] = dict.fromkeys(("estimate", "standard_error", "low", "high"))
        for key, column in columns.items():
            numbers[key] = float(column[k])
        determined = "estimate" in columns
        parameters.append(Parameter(symbol=name, name=name, unit=UNITS_OF[name], determined=determined, **numbers))
    estimator = None
    if columns:
        estimator = "least squares"
    unseen = []
    for pose in missing:
        unseen.append(Open(parameters=list(NAMES), close_by=pose))
    return Calibration(
        verdict=verdict,
        sigma=Sigma.of(None, "three Allan deviations of each mean at rest"),
        radius=radius,
        estimator=estimator,
        parameters=parameters,
        open=unseen,
        units={"radius": "1", "parameters": UNITS["parameters"]},
    )


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


def standard_deviations(bound: NDArray) -> NDArray[np.float64]:
    """Return the standard deviations (K,) [g] of means at rest whose bounds (K, 3) are three Allan deviations [g]."""
    return np.maximum(bound.max(axis=1) / 3.0, LEAST_SD)


def calibrate_by_norm(reading: NDArray, bound: NDArray) -> Calibration:
    """Calibrate the accelerometers from rests of unknown direction.

    Parameters
    ----------
    reading : (K, 3) array
        mean readings at the rests [g]
    bound : (K, 3) array
        bounds of their errors [g], positive

    Returns
    -------
    Calibration with the parameters of NAMES: least squares, standard errors from their residuals, and the guaranteed
    ends. Poses, in words, would close open parameters
    """
    x = np.zeros(9)
    determinacy = Determinacy.of(norm_equations(x, reading)[1], standard_deviations(bound))
    missing = [pose.words for pose in closing_poses(determinacy, DETERMINED)]
    if len(reading) < 9 or determinacy.worst > USABLE:
        return _calibration("insufficient", missing=missing)
    for _ in range(ITERATIONS):
        residual, slopes, _ = norm_equations(x, reading)
        change = np.linalg.lstsq(slopes, -residual, rcond=None)[0]
        x = x + change
        if np.abs(x).max() > LARGEST:
            return _calibration("falsified", columns={"estimate": x})
        if np.abs(change).max() < 1e-14:
            break
    residual, slopes, back = norm_equations(x, reading)
    allowed = (np.abs(back) * bound).sum(axis=1)
    columns = {"estimate": x}
    freedom = len(reading) - 9
    if freedom:
        inverse = np.linalg.inv(slopes.T @ slopes)
        columns["standard_error"] = np.sqrt(np.diag(inverse) * (residual @ residual) / freedom)
    ends, radius = _guaranteed(x, reading, bound, allowed)
    if radius > 1.0:
        return _calibration("falsified", radius, columns=columns)
    if ends is None:
        return _calibration("insufficient", radius, missing or list(candidate_poses()), columns)
    return _calibration("consistent", radius, columns=columns | dict(zip(("low", "high"), ends, strict=True)))


def _guaranteed(
    x: NDArray, reading: NDArray, bound: NDArray, allowed: NDArray
) -> tuple[tuple[NDArray, NDArray] | None, float]:
    """Ends of the parameters and the radius.

    The error of linearisation comes from the exact equations at the 18 solutions at the ends. It is added to the bounds
    until these hold it; no proof covers other corners of the set.
    """
    residual, slopes, _ = norm_equations(x, reading)
    shift = float(np.linalg.norm(bound, axis=1).max())
    left_out, ends = np.full(len(reading), shift**2), None
    for _ in range(10):
        widened = allowed + left_out
        radius = chebyshev_radius(slopes, -residual, widened)[0]
        corners = None
        if radius <= 1.0:
            corners = _corners(slopes, -residual, widened)
        if corners is None or np.abs(corners).max() > LARGEST:
            return None, radius
        ends = (x + corners.min(axis=0), x + corners.max(axis=0))
        exact = np.array([norm_equations(x + corner, reading)[0] for corner in corners])
        needed = np.abs(exact - residual - corners @ slopes.T).max(axis=0) + shift**2
        if (needed <= left_out * 1.01).all():
            return ends, radius
        left_out = np.maximum(needed, left_out)
    return ends, radius


def _corners(slopes: NDArray, target: NDArray, bound: NDArray) -> NDArray | None:
    """Points (18, 9) of {x: |target − slopes x| ≤ bound} where each parameter is least, largest; None if unbounded."""
    polytope = Polytope(slopes, bound)
    polytope.confine(target - bound, target + bound)
    try:
        return np.array([polytope.maximise(objective)[1] for objective in np.vstack([-np.eye(9), np.eye(9)])])
    except SolverError:
        return None
