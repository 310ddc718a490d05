"""What an unexplained residual depends on, and how much of it anything could explain."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..calibration.model import Linearisation, predicted_input
from .circumstances import Circumstances

LENGTHS = (0.15, 0.35, 0.8, 2.0)
"""Lengths over which the functions that are tried vary: of the spread of a quantity, radians of an angle."""
NOISE_PARTS = (0.03, 0.3)
"""Parts of the residual's variance that are put down to noise in the fit of such a function."""
MOST_ROWS = 400
"""Of a longer record rows spread over it are taken."""


def residual_structure(here: Linearisation, circumstances: Circumstances) -> list[dict[str, Any]]:
    """How much of the residual a smooth function of one quantity predicts at readings that it was not fitted to.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances

    Returns
    -------
    list of dict
        ``accelerometer``, ``on`` (alpha, beta, input, time, temperature; "alpha and beta", "inputs": functions of all
        angles, of all three inputs), ``explained``: the part of the residual's sum of squares that is predicted when
        each reading is left out in turn; ``explainable``: the part that is more than noise within the bound, uniform,
        would be on average. The most telling quantity first, then those of several variables
    """
    rows = np.unique(np.linspace(0, len(here.reading) - 1, MOST_ROWS).round().astype(int))
    n = predicted_input(here.parametrisation, here.point, here.positions)[rows]
    alpha, beta = circle(here.positions.alpha[rows]), circle(here.positions.beta[rows])
    residuals, bounds = here.residual.reshape(-1, 3)[rows], here.bound.reshape(-1, 3)[rows]
    found, joint = [], []
    for p in range(3):
        quantities: dict[str, NDArray] = {"alpha": alpha, "beta": beta, "input": spread(n[:, p : p + 1])}
        quantities["time"] = spread(circumstances.hours[rows, None])
        if circumstances.temperature is not None:
            quantities["temperature"] = spread(circumstances.temperature[rows, None])
        several: Mapping[str, NDArray] = {"alpha and beta": np.hstack((alpha, beta)), "inputs": spread(n)}
        total = float((residuals[:, p] ** 2).sum())
        explainable = max(0.0, 1.0 - float((bounds[:, p] ** 2).sum()) / 3.0 / total) if total > 0.0 else 0.0
        for names, entries in ((quantities, found), (several, joint)):
            for on, coordinates in names.items():
                share = predicted_share(coordinates, residuals[:, p])
                entries.append({"accelerometer": p + 1, "on": on, "explained": share, "explainable": explainable})
    return [*sorted(found, key=telling), *sorted(joint, key=telling)]


def telling(entry: Mapping[str, Any]) -> float:
    """Key that puts the most telling entry first."""
    return -round(float(entry["explained"]), 9)


def circle(angle: NDArray) -> NDArray:
    """An angle (N,) as a point (N, 2) of the unit circle."""
    return np.stack((np.cos(angle), np.sin(angle)), axis=1)


def spread(values: NDArray) -> NDArray:
    """Quantities (N, k) in units of their standard deviation; zeros where they do not vary."""
    deviation = values.std(axis=0)
    return (values - values.mean(axis=0)) / np.where(
        deviation > 1e-12 * np.abs(values).max(initial=0.0), deviation, np.inf
    )


def predicted_share(coordinates: NDArray, residual: NDArray) -> float:
    """Part of the sum of squares that a smooth function of coordinates (N, k) predicts of readings left out in turn.

    Kernel regression with Gaussian functions of several lengths; the length and the noise that predict best are taken.
    The errors of readings left out follow from one decomposition: e_i = [K⁻¹ r]_i / [K⁻¹]_ii.
    """
    total = float((residual**2).sum())
    if total == 0.0 or not np.ptp(coordinates, axis=0).any():
        return 0.0
    square = ((coordinates[:, None, :] - coordinates[None, :, :]) ** 2).sum(axis=2)
    least = total
    for length in LENGTHS:
        values, vectors = np.linalg.eigh(np.exp(-0.5 * square / length**2))
        weights = vectors.T @ residual
        for noise in NOISE_PARTS:
            inverse = 1.0 / (np.maximum(values, 0.0) + noise)
            errors = (vectors @ (inverse * weights)) / ((vectors**2) @ inverse)
            least = min(least, float((errors**2).sum()))
    return max(0.0, 1.0 - least / total)
