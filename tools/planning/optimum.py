"""An optimal plan and its proof: positions with weights, and a dual that bounds the cost of every other plan."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

NO_WEIGHT = 1e-9
"""A weight so small is the solver's tolerance."""


class UndeterminedError(ArithmeticError):
    """The positions that are allowed cannot determine the target."""


@dataclass(frozen=True)
class Optimum:
    """The readings that estimate one target at least cost, and a bound of every other estimator's cost.

    Attributes
    ----------
    accelerometer : (n,) array of int
        from 0
    alpha, beta : (n,) array
        [rad]
    weights : (n,) array
        Φ
    dual : (P,) array
        y
    lower_bound : float
        proven: no plan costs less, in units of σ
    alpha_deg, beta_deg : (n,) array
        the same angles in degrees, as the grid has them
    """

    accelerometer: NDArray
    alpha: NDArray
    beta: NDArray
    weights: NDArray
    dual: NDArray
    lower_bound: float
    alpha_deg: NDArray
    beta_deg: NDArray

    @property
    def cost(self) -> float:
        """Σ|Φ|: the guaranteed error in units of σ."""
        return float(np.abs(self.weights).sum())

    @property
    def gap(self) -> float:
        """(cost − lower bound) / cost: what another plan could gain at most."""
        return max(self.cost - self.lower_bound, 0.0) / self.cost

    def times(self, factor: float) -> "Optimum":
        """The optimum of the target times a positive factor."""
        return replace(
            self,
            weights=factor * self.weights,
            lower_bound=factor * self.lower_bound * (1.0 - 1e-15),
        )


def settled(
    target: NDArray, dual: NDArray, ceiling: float, regressors: NDArray, near: NDArray, places: tuple[NDArray, ...]
) -> Optimum:
    """An optimum from a solver's weights: made unbiased to rounding, readings without weight left out.

    Parameters
    ----------
    target : (P,) array
        a
    dual : (P,) array
        y
    ceiling : float
        what |F'y| is proven not to exceed
    regressors : (n, P) array
        F of the readings, independent
    near : (n,) array
        weights, nearly right
    places : accelerometer, alpha, beta, alpha_deg, beta_deg
        of the readings, (n,) each
    """
    used = np.abs(near) > NO_WEIGHT
    if used.any() and np.linalg.lstsq(regressors[used].T, target, rcond=1e-12)[1].sum() > NO_WEIGHT**2:
        used = near != 0.0
    weights, columns = near[used], regressors[used]
    for _ in range(2):
        weights = weights + np.linalg.lstsq(columns.T, target - columns.T @ weights, rcond=1e-12)[0]
    accelerometer, alpha, beta, alpha_deg, beta_deg = (x[used] for x in places)
    order = np.lexsort((beta_deg, alpha_deg, accelerometer))
    return Optimum(
        accelerometer[order],
        alpha[order],
        beta[order],
        weights[order],
        dual,
        lower_bound(target, dual, ceiling),
        alpha_deg[order],
        beta_deg[order],
    )


def lower_bound(target: NDArray, dual: NDArray, ceiling: float) -> float:
    """What every plan costs at least, from a dual y with |F'y| ≤ ceiling: a'y / ceiling, rounded down."""
    rounding = 4 * len(dual) * np.finfo(float).eps * float(np.abs(target) @ np.abs(dual))
    return (float(target @ dual) - rounding) / (max(ceiling, 1.0) * (1.0 + 1e-15))
