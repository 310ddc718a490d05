"""The possible set for columns that depend on one number: the union over all its values, exactly.

An effect that sets in after a row has other columns for each row. The question is the reach of the union of all
possible sets in a direction. A programme is solved for few values, and its duals are moved to all other values at once.
The moved duals are a valid proof there: of the greatest reach in the direction, or that nothing is possible. The value
with the weakest proof is next, until nothing can go farther.

For a continuous number each chosen value represents all up to the middles between it and its neighbours. Bounds that
grow by the difference of columns there, times their largest possible size, hold for all of these.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Bools, Floats, Ints
from .possible import ROOM, Possible, Proofs, Steps
from .programmes import EXACT, chebyshev_radius

SURELY = 1e-8
"""Relative margin above the limit with which a proven radius refuses a value."""
SAME = 1e-9
"""Relative difference below which neither of two goes farther."""
SET_FREE = 6
"""Largest number of moving columns that are freed for a set that only contains the union."""
RANGES = 16
"""Number of ranges of values that are tried first."""
AT_ONCE = 500
"""Number of values at a time: the memory does not grow with the total."""


def open_ranges(
    edges: Ints,
    among: Sequence[int],
    standing: Callable[[int, int, Sequence[int]], Sequence[int]],
) -> Iterator[tuple[int, int, Sequence[int]]]:
    """Yield the least ranges of values that are not refused, in order, each with the members that stand there.

    Parameters
    ----------
    edges : (E,)
        ends of the least ranges; fewer than two are none
    among : sequence of int
        candidates
    standing : callable
        first and last value of a range, candidates -> those that no bound refuses for all values of the range

    No value is missed: each lies in a least range, and in every range that was halved to it. A candidate that stands
    with the value stands in all of these, because `standing` refuses only candidates that no value of a range allows.
    """
    starts = np.unique(np.linspace(0, len(edges) - 1, RANGES + 1).round().astype(int)).tolist()
    ranges = [(low, high, among) for low, high in pairwise(starts)][::-1] if len(edges) > 1 else []
    while ranges:
        low, high, among = ranges.pop()
        begin, end = int(edges[low]), int(edges[high])
        among = standing(begin, end, among)
        if among and high - low == 1:
            yield begin, end, among
        elif among:
            middle = (low + high) // 2
            ranges += [(middle, high, among), (low, middle, among)]


@dataclass(frozen=True, eq=False)
class Rows:
    """Errors |residual − (fixed + moving ways[r], in columns `moving_columns`) x| ≤ bound, for R values r of a number.

    `fixed` (M, n) has the base of the columns `moving_columns` (k,), which is the same for all values; `moving` (M, t),
    `ways` (R, t, k).
    """

    fixed: Floats
    moving: Floats
    ways: Floats
    moving_columns: Ints
    residual: Floats
    bound: Floats

    def matrix(self, way: int) -> Floats:
        """Return the columns (M, n) of one value."""
        matrix = self.fixed.copy()
        matrix[:, self.moving_columns] += self.moving @ self.ways[way]
        return matrix

    @cached_property
    def scale(self) -> Floats:
        """Sizes (n,) of the columns; for moving ones those of the middle value."""
        sizes = np.abs(self.matrix(len(self.ways) // 2)).max(axis=0, initial=0.0)
        return np.where(sizes > 0.0, sizes, 1.0)

    def chosen(self, index: NDArray | slice) -> "Rows":
        """Return some of the rows."""
        fixed, moving = self.fixed[index], self.moving[index]
        return replace(self, fixed=fixed, moving=moving, residual=self.residual[index], bound=self.bound[index])

    def moved(self, duals: NDArray, way: int, direction: NDArray, *, weighted: bool) -> tuple[NDArray, NDArray]:
        """Return numbers (u,) of the rows of one value's duals (M,), and all values' duals (R, u) that sum to a
        direction (n,).

        NaN if they cannot be moved. `weighted`: the sum of bound·|duals| stays constant, too.
        """
        active = np.flatnonzero(duals)
        matrix, weights = self.matrix(way)[active] / self.scale, direction / self.scale
        if weighted:
            signed = self.bound[active] * np.sign(duals[active])
            matrix, weights = np.column_stack((matrix, signed)), np.append(weights, duals[active] @ signed)
        inverse = np.linalg.pinv(matrix, rcond=EXACT)
        inverse_own = inverse[self.moving_columns] / self.scale[self.moving_columns, None]
        moving, changes = self.moving[active], self.ways - self.ways[way]

        def missed_by(duals: NDArray) -> Floats:
            """Return the difference (R, n) of the columns of each value, weighted by duals (R, u), from the
            direction."""
            missed = weights - duals @ matrix
            missed[:, self.moving_columns] -= (
                np.einsum("rt,rtk->rk", duals @ moving, changes) / self.scale[self.moving_columns]
            )
            return missed

        # Columns that change by a few directions: the inverse of each follows from that of one.
        grown = np.eye(len(inverse_own)) + (inverse_own @ moving) @ changes
        size = np.abs(duals).sum()
        moved = np.tile(weights @ inverse, (len(changes), 1))
        with np.errstate(all="ignore"):
            for _ in range(2):
                missed = missed_by(moved)
                if (np.abs(missed).max(axis=1) <= EXACT * size).all():
                    break
                step = missed @ inverse
                change = np.einsum("rt,rtk->rk", step @ moving, changes)
                moved += step - _solved(grown, change) @ inverse_own
            missed = missed_by(moved)
        moved[~(np.abs(missed).max(axis=1) <= EXACT * np.abs(moved).sum(axis=1))] = np.nan
        return active, moved


def apart(rows: Rows, error: NDArray) -> Floats:
    """Return the largest distance (M, k) of a value's columns from the nearest of `rows`, for a continuous number.

    `error` (M, k): their largest distance from the straight line between the two neighbours.
    """
    largest, steps = np.zeros(error.shape), np.diff(rows.ways, axis=0)
    for first in range(0, len(steps), AT_ONCE):
        changes = np.abs(np.tensordot(rows.moving, steps[first : first + AT_ONCE], axes=(1, 1)))
        largest = np.maximum(largest, changes.max(axis=1))
    return 0.5 * largest + error


def largest_sizes(rows: Rows, limit: float, far: NDArray, largest: NDArray) -> Floats:
    """Return the largest sizes (k,) of the coefficients of columns that move, at any value of a continuous number.

    `far` (M, k) is that of `apart`; no size exceeds `largest` (k,). A set that is possible with residuals is within the
    set that is possible without them and with bounds larger by these, a convex set X about zero. Take coefficients x in
    X at a value between, shrunk until none is beyond twice the reach of X at the values of `rows`. They are in X at the
    nearest of these, except for a part η of the bounds: so none is beyond 1 + η times that.
    """
    bound = limit * rows.bound + np.abs(rows.residual)
    without = Swept(replace(rows, residual=np.zeros_like(bound), bound=bound), 1.0, np.zeros(rows.fixed.shape[1]))
    without.tried(len(rows.ways) // 2)
    most = np.array([without.reach(unit) for unit in np.eye(without.count)[rows.moving_columns]])
    part = float((far @ np.minimum(2.0 * most, largest) / bound).max(initial=0.0))
    if part >= 1.0:
        return largest
    return np.minimum((1.0 + part) * most, largest)


def _solved(matrices: NDArray, rows: NDArray) -> Floats:
    """Return y (R, k) with y M = row for each of matrices (R, k, k) and rows (R, k); NaN for those that have none."""
    regular = np.abs(np.linalg.det(matrices)) > EXACT
    solutions = np.full(rows.shape, np.nan)
    solutions[regular] = np.linalg.solve(matrices[regular].transpose(0, 2, 1), rows[regular][..., None])[..., 0]
    return solutions


@dataclass(eq=False)
class Swept(Steps):
    """Steps x (n,) from a point that are possible with any value of a number, and the possible values.

    A value stands with a radius up to `limit`. `radii` are those of tried values, with a centre (n,); `proven` (R,) is
    a lower bound of each radius. `proofs` of sets with the same rows are used, and added to.
    """

    rows: Rows
    limit: float
    origin: Floats
    radii: dict[int, tuple[float, Floats]] = field(default_factory=dict)
    proofs: Proofs = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.count = self.rows.fixed.shape[1]
        self.proven = np.zeros(len(self.rows.ways))
        self._sets: dict[int, Possible] = {}
        self._known: dict[bytes, Floats] = {}

    def tried(self, way: int) -> float:
        """Return the radius of one value; move its proof to all others."""
        if way not in self.radii:
            rows = self.rows
            radius, x, duals = chebyshev_radius(rows.matrix(way), rows.residual, rows.bound)
            self.radii[way] = radius, x
            active, moved = rows.moved(duals, way, np.zeros(self.count), weighted=True)
            with np.errstate(all="ignore"):
                least = np.abs(moved @ rows.residual[active]) / (np.abs(moved) @ rows.bound[active])
            self.proven = np.fmax(self.proven, least)
            self.proven[way] = radius
        return self.radii[way][0]

    @property
    def refused(self) -> Bools:
        """Mask (R,) of the values that are proven not to stand."""
        return self.proven > self.limit * (1.0 + SURELY)

    def search(self) -> Iterator[tuple[int, float]]:
        """Yield tried values with their radii: the one with the weakest proof is next.

        The search ends when no remaining value can have a radius below the least so far, or stand if none does.
        """
        way = len(self.proven) // 2
        while True:
            yield way, self.tried(way)
            least = min(radius for radius, _ in self.radii.values())
            untried = np.where(self.proven < least * (1.0 - SURELY), self.proven, np.inf)
            untried[list(self.radii)] = np.inf
            way = int(untried.argmin())
            if untried[way] == math.inf:
                return

    def beside(self, origin: NDArray, chosen: NDArray, room: float, further: NDArray | None, proofs: Proofs) -> Steps:
        """Return the same set about a point (n,), of some of the rows and with more room.

        With further columns (M, m) it is a set that contains them all: the columns that move, if few, count by
        themselves.
        """
        rows = self.rows
        bound = (rows.bound * self.limit * (1.0 + ROOM) + room)[chosen]
        centres = {way: x for way, (radius, x) in self.radii.items() if radius <= self.limit}
        if further is not None and centres and rows.moving.shape[1] <= SET_FREE:
            way, centre = next(iter(centres.items()))
            matrix = rows.matrix(way)
            residual = (rows.residual - matrix @ centre)[chosen]
            return Possible(np.hstack((matrix, further, rows.moving))[chosen], residual, bound, proofs=proofs)
        if further is None:
            further = np.zeros((len(rows.bound), 0))
        zeros, fixed = np.zeros(further.shape[1]), np.hstack((rows.fixed, further))[chosen]
        chosen_rows = Rows(fixed, rows.moving[chosen], rows.ways, rows.moving_columns, rows.residual[chosen], bound)
        radii = {way: (1.0, np.append(centre, zeros)) for way, centre in centres.items()}
        return Swept(chosen_rows, 1.0, np.append(origin, zeros), radii, proofs)

    def bounded(self, weights: NDArray) -> float:
        """Return an upper bound of weights'x (n,) from the proofs of other sets."""
        return float(self._most(weights).max()) - float(weights @ self.origin)

    def reach(self, weights: NDArray, least: float = -math.inf) -> float:
        """Return the reach, as for every set of steps."""
        most, shift = self._most(weights), float(weights @ self.origin)
        farthest, way = least + shift, int(most.argmax())
        if most[way] == math.inf:
            # A value that stands is known to reach somewhere.
            way = next((w for w, (radius, _) in self.radii.items() if radius <= self.limit), way)
        while most[way] > farthest:
            most[way] = -math.inf
            if self.tried(way) <= self.limit:
                reached, duals = self._reach(way, weights)
                most[way], farthest = reached, max(farthest, reached)
                if reached == math.inf:
                    return math.inf
                self._prove(most, duals, way, weights)
            most[self.refused] = -math.inf
            way = int(most.argmax())
            if math.isfinite(farthest) and most[way] - farthest <= SAME * abs(farthest - shift):
                break
        return farthest - shift

    def _most(self, weights: NDArray) -> Floats:
        """Return the known upper bound of the reach of each value (R,) in a direction (n,)."""
        key = weights.tobytes()
        if key not in self._known:
            self._known[key] = np.full(len(self.proven), np.inf)
            if (duals := self.proofs.get((0, key))) is not None:
                self._prove(self._known[key], duals, len(self.proven) // 2, weights)
        return self._known[key]

    def _prove(self, most: NDArray, duals: NDArray, way: int, weights: NDArray) -> None:
        """Lower the upper bound of each value (R,) by duals (M,) of one value, moved to the others."""
        rows = self.rows
        active, moved = rows.moved(duals, way, weights, weighted=False)
        most[:] = np.fmin(most, moved @ rows.residual[active] + np.abs(moved) @ rows.bound[active])

    def _reach(self, way: int, weights: NDArray) -> tuple[float, Floats]:
        """Return the reach of one value, and the duals (M,) that prove it."""
        rows, centre = self.rows, self.radii[way][1]
        if way not in self._sets:
            matrix = rows.matrix(way)
            self._sets[way] = Possible(matrix, rows.residual - matrix @ centre, rows.bound, proofs=self.proofs)
        step = self._sets[way].reach(weights)
        return step + float(weights @ centre), self.proofs.get((0, weights.tobytes()), np.zeros(len(rows.bound)))
