"""One possible point to state: the analytic centre of what bounded errors leave possible.

All is about the set {x: |residual − jacobian x| ≤ bound, low ≤ x ≤ high}. Its analytic centre makes the product of all
slacks greatest, Σ log(bound² − r²): it is always possible and unique, and neither the units of x nor another choice of
coordinates move it. A row that is listed twice counts twice: the centre moves a little, away from that row's bounds, as
a mean moves towards a value that is listed twice. Where the set has no interior the central programme takes over.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from .possible import DETERMINED, Possible
from .programmes import LEAST_VALUE, TOLERANCE, chebyshev_radius, first_rows, least_largest, shortened

INTERIOR = 1e-7
"""A set in which some slack stays below this part of its bound has no interior: the programmes are not exacter."""
CENTRED = 1e-9
"""Newton decrement at the centre: how far it may be off, in units of the ellipsoid of second order about it."""
NEARLY = 1e-6
"""Newton decrement with which rounding may end the search."""
MOST_STEPS = 200
MOST_ADDED = 100
TO_THE_EDGE = 0.99
"""A step goes at most so far towards the nearest bound."""
NARROW = 1e-6
"""No half-width counts for less than this part of the greatest, or of what a row's bound makes of it."""

Estimator = Literal["analytic centre", "central programme"]


@dataclass(frozen=True)
class Bounded:
    """The points x (P,) with |residual − jacobian x| ≤ bound and low ≤ x ≤ high.

    The jacobian (M, P) may have any rank; residual and bound (M,), bounds positive; low and high (P,) are limits of
    single coefficients, infinite where there are none, and hold low < high.
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
        """What the rows determine: x = directions y (P, rank), with (rows' jacobian) directions orthonormal columns."""
        jacobian = self.rows[0]
        size = np.abs(jacobian).max(axis=0, initial=0.0)
        size[size == 0.0] = 1.0
        _, values, turned = np.linalg.svd(np.linalg.qr(shortened(jacobian / size), mode="r"))
        determined = values > LEAST_VALUE * values.max(initial=0.0)
        return turned[: len(values)][determined].T / values[determined] / size[:, None]

    def determines(self, weights: NDArray) -> bool:
        """Whether the rows bound weights'x on both sides."""
        jacobian = self.rows[0]
        size = np.abs(jacobian).max(axis=0, initial=0.0)
        scaled = weights / np.where(size == 0.0, 1.0, size)
        span, _ = np.linalg.qr(self.directions * np.where(size == 0.0, 1.0, size)[:, None])
        return bool(np.linalg.norm(scaled - span @ (span.T @ scaled)) <= DETERMINED * np.linalg.norm(scaled))


@dataclass(frozen=True)
class Central:
    """The point (P,) to state, and by which of the two it was found."""

    x: NDArray
    estimator: Estimator


def analytic_centre(bounded: Bounded, start: NDArray | None = None) -> NDArray[np.float64] | None:
    """The x (P,) of the greatest Σ log(bound² − (residual − jacobian x)²) + Σ log(slacks of limits).

    From `start` (P,) where it is inside, else from the Chebyshev centre, by damped Newton steps. What the rows leave
    open stays at zero. None where the set has no interior, or a limit on one side is all that bounds a coefficient.

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


def _chebyshev_start(bounded: Bounded) -> NDArray[np.float64] | None:
    """A point (P,) with the least largest residual, where a limit on one side counts as wide as the rows leave it."""
    jacobian, residual = bounded.rows
    weights, ends = bounded.one_sided
    if len(ends):
        reach = Possible(jacobian, residual, np.ones(len(residual)))
        # From the limit to as far as the rows let go: where that is nothing, nothing is inside.
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

    def coordinates(self, x: NDArray) -> NDArray[np.float64]:
        """The y of a point (P,); what is not determined of it is left out."""
        return self._rows.T @ (self._jacobian @ x)

    def slack(self, y: NDArray) -> float:
        """The least slack over its bound; that of a limit on one side counts as it is where it is small."""
        of_rows = 1.0 - np.abs(self._residual - self._rows @ y)
        return float(min(of_rows.min(initial=1.0), 1.0 if (self._open(y) > 0.0).all() else 0.0))

    def _open(self, y: NDArray) -> NDArray:
        return self._ends - self._weights @ y

    def newton(self, y: NDArray) -> tuple[NDArray, float]:
        """Newton's step (rank,), and its decrement."""
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
        """How much of a step to take: inside, and enough gained."""
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


def central_programme(bounded: Bounded, weights: NDArray, intervals: NDArray) -> NDArray[np.float64]:
    """The possible x (P,) whose largest distance from the middles of intervals, in half-widths, is least.

    Weights (K, P) say of what; the intervals (K, 2) are those of weights'x, finite, and the rows determine each. It
    needs no interior, and depends on what is asked. What the rows leave open stays at zero.
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
    """The analytic centre, sought from zero, or where there is none the central programme's point.

    Arguments as of these.
    """
    x = analytic_centre(bounded, np.zeros(bounded.jacobian.shape[1]))
    if x is not None:
        return Central(x, "analytic centre")
    return Central(central_programme(bounded, weights, intervals), "central programme")
