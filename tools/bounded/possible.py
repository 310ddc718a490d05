"""What bounded errors leave possible of parameters: ends, sizes, pairs of amplitude and phase."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from .programmes import Polytope, SolverError

ROOM = 1e-9
"""What the bounds grow by, relatively, so that a fit at its bounds stays inside."""
DETERMINED = 1e-6
"""A direction that lies, to this part, in what the rows determine is determined."""
ENCLOSING, BOUNDING = 72, 16
"""Directions in which a pair of coefficients is enclosed, and in which its length alone is bounded."""

Interval = tuple[float, float]
Reach = Callable[[NDArray], float]


class Possible:
    """The steps x from a fit that keep every error within its bound: |left - jacobian x| ≤ bound.

    Parameters
    ----------
    jacobian : (M, n) array
        of any rank; the units of its columns do not matter
    left : (M,) array
        errors at the fit; where one is beyond its bound, that much is allowed
    bound : (M,) array
    most_rows : int, optional
        of more rows so many are taken, spread over all: fewer rows leave more possible, so what they bound is bounded

    Attributes
    ----------
    matrix, lower, upper : arrays
        the same set as lower ≤ matrix y ≤ upper
    span : (n, rank) array
        orthonormal basis of what the rows determine of the columns times their scale: x = span y / scale
    scale : (n,) array
    """

    def __init__(self, jacobian: NDArray, left: NDArray, bound: NDArray, most_rows: int | None = None) -> None:
        if most_rows is not None and len(left) > most_rows:
            rows = np.linspace(0, len(left) - 1, most_rows).round().astype(int)
            jacobian, left, bound = jacobian[rows], left[rows], bound[rows]
        bound = np.maximum(bound, np.abs(left)) * (1.0 + ROOM)
        self.scale = np.abs(jacobian).max(axis=0, initial=0.0)
        self.scale[self.scale == 0.0] = 1.0
        scaled = jacobian / self.scale
        _, values, directions = np.linalg.svd(scaled, full_matrices=False)
        self.span = directions[values > 1e-8 * values.max(initial=0.0)].T
        self.matrix, self.lower, self.upper = scaled @ self.span, left - bound, left + bound
        self._polytope = Polytope(self.matrix, bound)
        self._polytope.confine(self.lower, self.upper)

    def reach(self, weights: NDArray) -> float:
        """How far weights'x (n,) can go; infinite where nothing bounds it."""
        weights = weights / self.scale
        inside = self.span.T @ weights
        if np.linalg.norm(weights - self.span @ inside) > DETERMINED * np.linalg.norm(weights):
            return math.inf
        try:
            return self._polytope.maximise(inside)[0]
        except SolverError:
            return math.inf

    def ends(self, column: int) -> Interval:
        """Least and largest step of one column."""
        reach = self.among(np.array([column]))
        return -reach(-np.ones(1)), reach(np.ones(1))

    def among(self, columns: NDArray) -> Reach:
        """How far the steps of some columns (k,) can go in a direction (k,)."""

        def reach(direction: NDArray) -> float:
            weights = np.zeros(len(self.scale))
            weights[columns] = direction
            return self.reach(weights)

        return reach


def largest_length(reach: Reach) -> float:
    """An upper bound of the length of a pair that is possible, as `reach` (direction (2,) -> how far) says."""
    angles = 2.0 * math.pi * np.arange(BOUNDING) / BOUNDING
    heights = [reach(np.array([math.cos(angle), math.sin(angle)])) for angle in angles]
    # The supporting lines enclose the set; between two directions it reaches farther by this factor at most.
    return max(heights) / math.cos(math.pi / BOUNDING)


def polar_intervals(reach: Reach) -> tuple[Interval, Interval]:
    """Intervals of amplitude and phase that hold a convex set of (amplitude·cos(phase), amplitude·sin(phase)).

    The set lies within the polygon of its supporting lines in `ENCLOSING` directions; the polygon's corners bound
    amplitude and phase. The phase is within (-π, π] at the middle and may reach beyond at the ends; (-π, π) when the
    set holds zero. Infinite where the set is not bounded.
    """
    angles = 2.0 * math.pi * np.arange(ENCLOSING) / ENCLOSING
    units = np.stack((np.cos(angles), np.sin(angles)), axis=1)
    heights = np.array([reach(unit) for unit in units])
    if not np.isfinite(heights).all():
        return (-math.inf, math.inf), (-math.inf, math.inf)
    following = np.roll(heights, -1)
    turn = 2.0 * math.pi / ENCLOSING
    along = (following - heights * math.cos(turn)) / math.sin(turn)
    corners = heights[:, None] * units + along[:, None] * np.stack((-units[:, 1], units[:, 0]), axis=1)
    high = float(np.linalg.norm(corners, axis=1).max())
    # The farthest that a line can separate the set from zero.
    low = float(max(0.0, (-heights).max()))
    if low == 0.0:
        return (0.0, high), (-math.pi, math.pi)
    middle = corners.mean(axis=0)
    phase = math.atan2(middle[1], middle[0])
    offsets = [math.remainder(math.atan2(y, x) - phase, 2.0 * math.pi) for x, y in corners]
    return (low, high), (phase + min(offsets), phase + max(offsets))
