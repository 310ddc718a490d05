"""What a strapdown record leaves possible: ends of the parameters, and sizes of effects that it excludes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.programmes import Polytope, SolverError
from ..evidence.evidence import Evidence, Fit

ROOM = 1e-9
"""What the bounds grow by, relatively, so that a fit at its bounds stays inside."""
MOST_ROWS = 2500
"""Of more rows so many are taken, spread over all parts."""
DETERMINED = 1e-6
"""A parameter whose direction lies in what the rows determine to this is determined."""


class Possible:
    """The steps from a fit that keep every error within its bound.

    Parameters
    ----------
    system : Evidence
    fit : Fit
        with a radius of at most one
    further : sequence of EffectPlace
        more effects, at zero in the fit
    """

    def __init__(self, system: Evidence, fit: Fit, further: Sequence[EffectPlace] = ()) -> None:
        matrix = system.matrix([*fit.places, *further])
        left = system.left_by(fit)
        if len(left) > MOST_ROWS:
            # Fewer rows leave more possible: what they bound is bounded.
            rows = np.linspace(0, len(left) - 1, MOST_ROWS).round().astype(int)
            matrix, left = matrix[rows], left[rows]
        bound = np.maximum(1.0, np.abs(left)) * (1.0 + ROOM)
        scale = np.abs(matrix).max(axis=0, initial=0.0)
        scale[scale == 0.0] = 1.0
        _, values, directions = np.linalg.svd(matrix / scale, full_matrices=False)
        self._span = directions[values > 1e-8 * values.max(initial=0.0)].T
        self._scale = scale
        self._polytope = Polytope(matrix / scale @ self._span, bound)
        self._polytope.confine(left - bound, left + bound)

    def ends(self, column: int) -> tuple[float, float]:
        """Least and largest step of one column; infinite where nothing bounds it."""
        weights = np.zeros(len(self._scale))
        weights[column] = 1.0 / self._scale[column]
        inside = self._span.T @ weights
        if np.linalg.norm(weights - self._span @ inside) > DETERMINED * np.linalg.norm(weights):
            return -np.inf, np.inf
        try:
            return -self._polytope.maximise(-inside)[0], self._polytope.maximise(inside)[0]
        except SolverError:
            return -np.inf, np.inf


def parameter_ends(system: Evidence, fit: Fit) -> NDArray[np.float64]:
    """Ends (P + k, 2) of the baseline's parameters and the coefficients of a fit's effects."""
    possible = Possible(system, fit)
    centre = fit.solution + np.concatenate([system.point, np.zeros(len(fit.solution) - len(system.point))])
    return np.array([np.add(possible.ends(k), centre[k]) for k in range(len(centre))]).reshape(-1, 2)


def excluded_sizes(system: Evidence, fit: Fit, places: Sequence[EffectPlace]) -> tuple[dict[str, Any], ...]:
    """Sizes above which effects that were not found contradict the record, each added to the model that stands.

    Returns
    -------
    tuple of dict
        ``effect``, ``where``, ``axes`` where it has them, ``parameter``, ``unit``, ``above``; those that the record
        does not bound below their largest possible size are left out
    """
    found = []
    for place in places:
        if place in fit.places:
            continue
        possible = Possible(system, fit, [place])
        for k, parameter in enumerate(CATALOGUE[place.effect].at(place).parameters):
            low, high = possible.ends(len(fit.solution) + k)
            above = max(-low, high)
            if above < parameter.largest:
                entry: dict[str, Any] = {"effect": place.effect, "where": place.where}
                if place.axes:
                    entry["axes"] = list(place.axes)
                found.append({**entry, "parameter": parameter.name, "unit": parameter.unit, "above": above})
    return tuple(found)
