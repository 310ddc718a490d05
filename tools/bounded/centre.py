"""The analytic centre of the set that bounded errors leave possible: one point to state.

The set is {x: |residual − jacobian x| ≤ bound, low ≤ x ≤ high}. Its analytic centre maximises the product of all
slacks, Σ log(bound² − r²). It is always possible and unique, and independent of the units of x and of the coordinates.
A row that is listed twice counts twice: the centre moves a little away from that row's bounds, as a mean moves towards
a repeated value. If the set has no interior, the central programme takes over.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from .possible import DETERMINED, Possible
from .programmes import LEAST_VALUE, TOLERANCE, chebyshev_radius, first_rows, least_largest, shortened
from .work import charge

INTERIOR = 1e-7
"""Relative slack below which a set has no interior: the programmes are not more exact."""
CENTRED = 1e-9
"""Newton decrement at the centre: its largest error, in units of the ellipsoid of second order about it."""
NEARLY = 1e-6
"""Newton decrement with which rounding may end the search."""
MOST_STEPS = 200
MOST_ADDED = 100
TO_THE_EDGE = 0.99
"""Largest part of the way to the nearest bound in one step."""
NARROW = 1e-6
"""Smallest half-width that counts, relative to the greatest, or to that from a row's bound."""

Estimator = Literal["analytic centre", "central programme"]


@dataclass(frozen=True)
class Bounded:
    """The points x (P,) with |residual − jacobian x| ≤ bound and low ≤ x ≤ high.

    The jacobian (M, P) may have any rank; residual and bound are (M,), bounds positive. `low` and `high` (P,) are
    limits of single coefficients, infinite for none, with low < high.
    """

    jacobian: NDArray
    residual: NDArray
    bound: NDArray
    low: NDArray | None = None
    high: NDArray | None = None

    @cached_property
    def limits(self) -> tuple[NDArray, NDArray]:
        """Both limits (P,) of every coefficient."""
        free = np.full(self.jacobian.shape[1], math.inf)
        return (-free if self.low is None else self.low), (free if self.high is None else self.high)

    @cached_property
    def rows(self) -> tuple[NDArray, NDArray]:
        """Jacobian (K, P) and residual (K,) over their bounds: the rows, then coefficients with two limits."""
        low, high = self.limits
        two_sided = np.flatnonzero(np.isfinite(low) & np.isfinite(high))
        half = 0.5 * (high[two_sided] - low[two_sided])
        jacobian = np.vstack((self.jacobian / self.bound[:, None], np.eye(len(low))[two_sided] / half[:, None]))
        return jacobian, np.append(self.residual / self.bound, 0.5 * (high[two_sided] + low[two_sided]) / half)

    @cached_property
    def one_sided(self) -> tuple[NDArray, NDArray]:
        """Weights (L, P) and ends (L,) of weights'x ≤ end: coefficients with a limit on one side only."""
        low, high = self.limits
        identity = np.eye(len(low))
        above = np.isfinite(high) & ~np.isfinite(low)
        below = np.isfinite(low) & ~np.isfinite(high)
        return np.vstack((identity[above], -identity[below])), np.append(high[above], -low[below])

    @cached_property
    def directions(self) -> NDArray:
        """Directions that the rows determine: x = directions y (P, rank); (rows' jacobian) directions has
        orthonormal columns."""
        jacobian = self.rows[0]
        size = np.abs(jacobian).max(axis=0, initial=0.0)
        size[size == 0.0] = 1.0
        _, values, turned = np.linalg.svd(np.linalg.qr(shortened(jacobian / size), mode="r"), full_matrices=True)
        determined = values > LEAST_VALUE * values.max(initial=0.0)
        return turned[: len(values)][determined].T / values[determined] / size[:, None]

    def determines(self, weights: NDArray) -> bool:
        """Return True if the rows bound weights'x on both sides."""
        jacobian = self.rows[0]
        size = np.abs(jacobian).max(axis=0, initial=0.0)
        scaled = weights / np.where(size == 0.0, 1.0, size)
        span, _ = np.linalg.qr(self.directions * np.where(size == 0.0, 1.0, size)[:, None])
        return bool(np.linalg.norm(scaled - span @ (span.T @ scaled)) <= DETERMINED * np.linalg.norm(scaled))


@dataclass(frozen=True)
class Central:
    """The point (P,) to state, and the method that found it."""

    x: NDArray
    estimator: Estimator


def analytic_centre(bounded: Bounded, start: NDArray | None = None) -> Floats | None:
    """Return the x (P,) that maximises Σ log(bound² − (residual − jacobian x)²) + Σ log(slacks of limits).

    Damped Newton steps begin at `start` (P,) if it is inside, else at the Chebyshev centre. Undetermined directions
    stay at zero. Returns None if the set has no interior, or if only a limit on one side bounds a coefficient.

    Source: S. Boyd, L. Vandenberghe, Convex Optimization, 2004, section 8.5.3.
    """
    inside = _Inside(bounded)
    if not all(bounded.determines(row) for row in bounded.one_sided[0]):
        return None
    y = None if start is None else inside.coordinates(start)
    if y is None or not inside.slack(y) > INTERIOR:
        first = _chebyshev_start(bounded)
        y = None if first is None else inside.coordinates(first)
        if y is None or not inside.slack(y) > INTERIOR:
            return None
    last = math.inf
    for _ in range(MOST_STEPS):
        step, decrement = inside.newton(y)
        if decrement <= CENTRED or (decrement < NEARLY and decrement > 0.5 * last):
            return bounded.directions @ (y + step)
        y, last = y + inside.damped(y, step, decrement) * step, decrement
    return None


def _chebyshev_start(bounded: Bounded) -> Floats | None:
    """Return a point (P,) with the least largest residual; a limit on one side counts as wide as the rows allow."""
    jacobian, residual = bounded.rows
    weights, ends = bounded.one_sided
    if len(ends):
        reach = Possible(jacobian, residual, np.ones(len(residual)))
        # From the limit to the farthest point that the rows allow: if the distance is zero, nothing is inside.
        half = np.array([0.5 * (end + reach.reach(-row)) for row, end in zip(weights, ends, strict=True)])
        if not (half > 0.0).all():
            return None
        jacobian = np.vstack((jacobian, weights / half[:, None]))
        residual = np.append(residual, ends / half - 1.0)
    return chebyshev_radius(jacobian, residual, np.ones(len(residual)))[1]


class _Inside:
    """The logarithms of all slacks in the coordinates y of `Bounded.directions`; rows have a bound of one."""

    def __init__(self, bounded: Bounded) -> None:
        rows, self._residual = bounded.rows
        weights, self._ends = bounded.one_sided
        self._directions = bounded.directions
        self._rows, self._weights = rows @ self._directions, weights @ self._directions
        self._jacobian = rows

    def coordinates(self, x: NDArray) -> Floats:
        """Return the y of a point (P,) without its undetermined part."""
        return self._rows.T @ (self._jacobian @ x)

    def slack(self, y: NDArray) -> float:
        """Return the least slack over its bound; a small slack of a limit on one side counts unscaled."""
        of_rows = 1.0 - np.abs(self._residual - self._rows @ y)
        return float(min(of_rows.min(initial=1.0), 1.0 if (self._open(y) > 0.0).all() else 0.0))

    def _open(self, y: NDArray) -> NDArray:
        return self._ends - self._weights @ y

    def newton(self, y: NDArray) -> tuple[NDArray, float]:
        """Return Newton's step (rank,), and its decrement."""
        charge(50.0 + 2e-3 * self._rows.size * self._rows.shape[1])
        r, room = self._residual - self._rows @ y, self._open(y)
        slack = (1.0 - r) * (1.0 + r)
        root = np.sqrt(2.0 * (1.0 + r * r)) / slack
        # Least squares, whose normal equations are Newton's: their condition is not squared.
        matrix = np.vstack((root[:, None] * self._rows, self._weights / room[:, None]))
        right = np.append(2.0 * r / slack / root, -np.ones(len(room)))
        system = shortened(np.column_stack((matrix, right)))
        q, triangle = np.linalg.qr(system[:, :-1])
        along = q.T @ system[:, -1]
        return np.linalg.solve(triangle, along), float(np.linalg.norm(along))

    def damped(self, y: NDArray, step: NDArray, decrement: float) -> float:
        """Return the part of a step that stays inside and gains enough."""
        r, moved = self._residual - self._rows @ y, self._rows @ step
        room, shrunk = self._open(y), self._weights @ step
        with np.errstate(divide="ignore"):
            reach = np.append((1.0 + np.sign(moved) * r) / np.abs(moved), room / np.maximum(shrunk, 0.0))
        size = min(1.0, TO_THE_EDGE * float(reach.min(initial=math.inf)))
        while True:
            now = r - size * moved
            gained = np.log1p((r - now) * (r + now) / ((1.0 - r) * (1.0 + r))).sum()
            gained += np.log1p(-size * shrunk / room).sum()
            if gained >= 0.25 * size * decrement**2 or size < 1e-9:
                return size
            size *= 0.5


def central_programme(bounded: Bounded, weights: NDArray, intervals: NDArray) -> Floats:
    """Return the possible x (P,) whose largest distance from the middles of intervals, in half-widths, is least.

    Weights (K, P) define the quantities; the intervals (K, 2) are those of weights'x, finite, and the rows determine
    each. The programme needs no interior, and its result depends on the weights. Undetermined directions stay at zero.
    """
    jacobian, residual = bounded.rows
    one_sided, ends = bounded.one_sided
    slopes = weights @ bounded.directions
    half, sizes = 0.5 * np.diff(intervals, axis=1), np.linalg.norm(slopes, axis=1, keepdims=True)
    half = np.maximum(half, NARROW * max(half.max(initial=0.0), sizes.max(initial=0.0)))
    slopes, offset = slopes / half, -(intervals.mean(axis=1) / half.ravel())
    matrix = np.vstack((jacobian, one_sided)) @ bounded.directions
    lower = np.append(residual - 1.0, np.full(len(ends), -math.inf))
    upper = np.append(residual + 1.0, ends)
    chosen = np.union1d(first_rows(matrix), np.arange(len(residual), len(matrix)))
    while True:
        y = least_largest(matrix[chosen], lower[chosen], upper[chosen], offset, slopes)[1]
        activity = matrix @ y
        violation = np.maximum(lower - activity, activity - upper)
        violation[chosen] = 0.0
        violated = np.argsort(-violation, kind="stable")[:MOST_ADDED]
        violated = violated[violation[violated] > TOLERANCE]
        if not len(violated):
            return bounded.directions @ y
        chosen = np.union1d(chosen, violated)


def central(bounded: Bounded, weights: NDArray, intervals: NDArray) -> Central:
    """Return the analytic centre, sought from zero, or the central programme's point if there is none.

    Arguments as for these two.
    """
    x = analytic_centre(bounded, np.zeros(bounded.jacobian.shape[1]))
    if x is not None:
        return Central(x, "analytic centre")
    return Central(central_programme(bounded, weights, intervals), "central programme")
