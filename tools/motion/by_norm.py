"""Accelerometers calibrated by the norm of gravity over rests: least squares and guaranteed bounds side by side."""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from ..calibrated import UNITS, Calibration, Open, Parameter, Sigma, Verdict
from .determinacy import DETERMINED, USABLE, Determinacy, candidate_poses, closing_poses
from .norm import LARGEST, NAMES, UNITS_OF, norm_equations, standard_deviations
from .possible import central_parameters, nearest_possible, possible_forces

ITERATIONS = 30


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
    residual, slopes, _ = norm_equations(x, reading)
    columns = {"estimate": x}
    freedom = len(reading) - 9
    if freedom:
        inverse = np.linalg.inv(slopes.T @ slopes)
        columns["standard_error"] = np.sqrt(np.diag(inverse) * (residual @ residual) / freedom)
    run = np.zeros(len(reading), dtype=int)
    possible = possible_forces(x, reading, bound, run)
    if possible.radius > 1.0:
        return _calibration("falsified", possible.radius, columns=columns)
    if possible.ends is None:
        return _calibration("insufficient", possible.radius, missing or list(candidate_poses()), columns)
    centre = central_parameters(x, reading, bound, run)[1]
    columns["estimate"] = nearest_possible(x, determinacy.covariance, centre, reading, bound, run)
    columns |= {"low": possible.ends[0], "high": possible.ends[1]}
    return _calibration("consistent", possible.radius, columns=columns)
