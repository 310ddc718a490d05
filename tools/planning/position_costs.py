"""What a set of positions costs: the least guaranteed error of every target with the readings that it gives."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .master import Master
from .places import Places, Readings, Task, readings

NOT_DETERMINED = 1e3
"""A ratio above this says that the positions do not determine the target."""


@dataclass(frozen=True)
class Costs:
    """The cost of every target on a set of positions.

    Attributes
    ----------
    places : Places
    readings : Readings
    weights : (K, M) array
        Φ of each target's estimator
    duals : (K, P) array
        y: |F'y| ≤ 1 on the readings, a'y the cost
    ratio : (K,) array
        cost over the target's optimum over all angles
    """

    places: Places
    readings: Readings
    weights: NDArray
    duals: NDArray
    ratio: NDArray

    @property
    def worst(self) -> float:
        """The largest ratio."""
        return float(self.ratio.max())

    @property
    def mean(self) -> float:
        """The mean ratio."""
        return float(self.ratio.mean())

    @property
    def determined(self) -> NDArray:
        """Which targets (K,) the positions determine."""
        return self.ratio < NOT_DETERMINED


def costs(task: Task, places: Places) -> Costs:
    """Solve the linear programme of every target on the readings of these positions."""
    given = readings(task, places)
    size = task.regressor.shape[1]
    weights = np.zeros((len(task.targets), len(given.position)))
    duals, value = np.zeros((len(task.targets), size)), np.zeros(len(task.targets))
    master = Master(size)
    if len(given.position):
        master.add(given.regressor)
    for k, target in enumerate(task.targets):
        master.aim(target.weights)
        weights[k], duals[k], possible = master.solve()
        value[k] = duals[k] @ target.weights
        if possible:
            used = np.flatnonzero(weights[k])
            columns = given.regressor[used].T
            # The solver's tolerance, taken out.
            weights[k, used] += np.linalg.lstsq(columns, target.weights - columns @ weights[k, used], rcond=1e-12)[0]
    return Costs(places, given, weights, duals, value / task.best)
