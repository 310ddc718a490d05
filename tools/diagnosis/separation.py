"""Table positions that would tell candidate causes apart."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation, linearise
from trihedron.calibration.parametrisation import Positions
from trihedron.diagnosis.circumstances import Circumstances, standing_still
from trihedron.diagnosis.extended_fit import extended_reading
from trihedron.diagnosis.search import Explanation
from trihedron.models.effects import CATALOGUE
from trihedron.models.regressors import admissible

GRID_STEP_DEG = 5.0


def separating_positions(
    here: Linearisation,
    hours: float,
    candidates: Sequence[Explanation],
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
    candidates : sequence of Explanation
        sets of effects that explain the record; outliers say nothing about other positions
    bounds : (float, float)
        u^max and v^0max: only readings whose sign is certain count
    most : int
        at most so many positions

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, mounting where there are several, and what is separated
    """
    physical = [c for c in candidates if any(place.effect != "outlier" for place in c.places)]
    p = here.parametrisation
    degrees = np.arange(0.0, 360.0, GRID_STEP_DEG)
    alpha, beta, mounting = (g.ravel() for g in np.meshgrid(degrees, degrees, range(len(p.mountings)), indexing="ij"))
    at = Positions(np.radians(alpha), np.radians(beta), mounting.astype(int))
    there = linearise(p, at, np.zeros((len(alpha), 3)), here.point, np.full(3 * len(alpha), here.bound.min()))
    certain = admissible(at.alpha, at.beta, p.matrices[at.mounting], bounds=bounds)
    predictions = [prediction(there, c, standing_still(len(alpha), np.full(len(alpha), hours))) for c in physical]
    chosen: dict[int, list[str]] = {}
    for i, first in enumerate(predictions):
        for j, second in enumerate(predictions[:i]):
            apart = np.where(certain, np.abs(first - second).reshape(-1, 3), 0.0).max(axis=1)
            best = int(np.argmax(np.round(apart, 12)))
            names = chosen.setdefault(best, [])
            names += [t for t in (physical[j].title, physical[i].title) if t not in names]
    positions = []
    for index, names in list(chosen.items())[:most]:
        position: dict[str, object] = {"alpha_deg": float(alpha[index]), "beta_deg": float(beta[index])}
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(mounting[index])]
        positions.append({**position, "separates": names})
    return positions


def prediction(there: Linearisation, candidate: Explanation, circumstances: Circumstances) -> NDArray:
    """Readings (3 N,) over g that the model with a set of effects predicts at other positions; outliers stay behind."""
    fit = candidate.fit
    step = fit.centre[: len(fit.point)]
    coefficients = fit.coefficients + fit.centre[len(fit.point) :]
    kept, values, first = [], [], 0
    for place in fit.places:
        count = len(CATALOGUE[place.effect].parameters)
        if place.effect != "outlier":
            kept.append(place)
            values.append(coefficients[first : first + count])
        first += count
    joined = np.concatenate(values) if values else np.zeros(0)
    return extended_reading(there, fit.point + step, kept, joined, circumstances)[0]
