"""Table positions that would tell candidate causes apart."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation, linearise
from trihedron.calibration.parametrisation import Positions
from trihedron.diagnosis.extended_fit import extended_reading
from trihedron.diagnosis.search import Candidate
from trihedron.models.regressors import admissible

GRID_STEP_DEG = 5.0


def separating_positions(
    here: Linearisation,
    hours: float,
    candidates: Sequence[Candidate],
    bounds: tuple[float, float],
    most: int = 6,
) -> list[dict[str, object]]:
    """For each pair of candidates the position at which their predictions are farthest apart.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    hours : float
        when the new positions would be measured, since the first row
    candidates : sequence of Candidate
        effects that explain the record equally well; outliers tell nothing about other positions and are left out
    bounds : (float, float)
        u^max and v^0max: only readings whose sign is certain count
    most : int
        at most so many positions

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, mounting where there are several, and what is separated
    """
    physical = [c for c in candidates if c.place.effect != "outlier"]
    p = here.parametrisation
    degrees = np.arange(0.0, 360.0, GRID_STEP_DEG)
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, range(len(p.mountings)), indexing="ij"))
    at = Positions(np.radians(alpha), np.radians(beta), mounting.astype(int))
    there = linearise(p, at, np.zeros((len(alpha), 3)), here.point, np.full(3 * len(alpha), here.bound.min()))
    certain = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds)
    predictions = [prediction(there, c, np.full(len(alpha), hours)) for c in physical]
    chosen: dict[int, list[str]] = {}
    for i, first in enumerate(predictions):
        for j, second in enumerate(predictions[:i]):
            apart = np.where(certain, np.abs(first - second).reshape(-1, 3), 0.0).max(axis=1)
            best = int(np.argmax(np.round(apart, 12)))
            names = chosen.setdefault(best, [])
            names += [t for t in (physical[j].place.title, physical[i].place.title) if t not in names]
    positions = []
    for index, names in list(chosen.items())[:most]:
        position: dict[str, object] = {"alpha_deg": float(alpha[index]), "beta_deg": float(beta[index])}
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(mounting[index])]
        positions.append({**position, "separates": names})
    return positions


def prediction(there: Linearisation, candidate: Candidate, hours: NDArray) -> NDArray:
    """Readings (3 N,) over g that the model with a candidate effect predicts at other positions."""
    fit = candidate.fit
    step = fit.centre[: len(fit.point)]
    coefficients = fit.coefficients + fit.centre[len(fit.point) :]
    return extended_reading(there, fit.point + step, fit.places, coefficients, hours)[0]
