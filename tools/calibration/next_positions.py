"""Table positions that would mend a record which cannot determine what is asked."""

import numpy as np
from numpy.typing import NDArray

from ...models.regressors import admissible
from .linearisation import Linearisation
from .parametrisation import Positions, reading_jacobian

GRID_STEP_DEG = 15
WELL_DETERMINED = 2.0
"""Standard deviation of a target over that of a reading, with the positions added, that is good enough."""
MAX_POSITIONS = 24


def next_positions(here: Linearisation, weights: NDArray, bounds: tuple[float, float]) -> list[dict[str, float | str]]:
    """A few positions that, added to those measured, determine every target.

    Chosen one by one from a coarse grid, the one that adds most information (the determinant) first; only readings
    whose sign is certain by (1.7) count.

    Parameters
    ----------
    here : Linearisation
        what was measured
    weights : (T, P) array
        the targets
    bounds : (float, float)
        u^max and v^0max of (1.7)

    Returns
    -------
    list of dict
        alpha_deg, beta_deg, and mounting where there are several
    """
    p = here.parametrisation
    degrees = np.arange(0, 360, GRID_STEP_DEG)
    alpha_deg, beta_deg, mounting = (
        grid.ravel() for grid in np.meshgrid(degrees, degrees, range(len(p.mountings)), indexing="ij")
    )
    grid = Positions(np.radians(alpha_deg), np.radians(beta_deg), mounting)
    rows = reading_jacobian(p, here.point, grid)
    rows = np.where(admissible(grid.alpha, grid.beta, p.matrices[mounting], bounds=bounds)[..., None], rows, 0.0)
    information = here.jacobian.T @ here.jacobian
    chosen: list[dict[str, float | str]] = []
    while len(chosen) < MAX_POSITIONS and not _determines(information, weights):
        spread = np.linalg.inv(information + 1e-8 * np.eye(len(information)))
        gain = np.linalg.slogdet(np.eye(3) + rows @ spread @ rows.transpose(0, 2, 1))[1]
        best = int(np.argmax(np.round(gain, 9)))
        information = information + rows[best].T @ rows[best]
        position: dict[str, float | str] = {"alpha_deg": float(alpha_deg[best]), "beta_deg": float(beta_deg[best])}
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(mounting[best])]
        chosen.append(position)
    return chosen


def repeats(here: Linearisation, count: int = 4) -> list[dict[str, float | str]]:
    """Positions of the record, spread over it, that would tell the noise if they were measured again."""
    p, at = here.parametrisation, here.positions
    positions: list[dict[str, float | str]] = []
    for row in np.unique(np.linspace(0, len(at.alpha) - 1, count).round().astype(int)):
        position: dict[str, float | str] = {
            "alpha_deg": float(np.degrees(at.alpha[row])),
            "beta_deg": float(np.degrees(at.beta[row])),
        }
        if len(p.mountings) > 1:
            position["mounting"] = p.mountings[int(at.mounting[row])]
        positions.append(position)
    return positions


def _determines(information: NDArray, weights: NDArray) -> bool:
    spread = np.linalg.inv(information + 1e-8 * np.eye(len(information)))
    return bool((np.einsum("tp,pq,tq->t", weights, spread, weights) < WELL_DETERMINED**2).all())
