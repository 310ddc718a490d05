"""The parameters and coefficients that bounds on errors leave possible: a polytope, or a union of several.

The same question is often asked about many similar sets: an effect beside each of the ways in which another one may
act. The readings that bound the first set bound the others nearly as well. So a programme's duals are moved to the rows
of the next set, by least squares over the readings that have one. The moved duals are a valid proof there; where it
suffices, no programme is solved.
"""

import math
from collections.abc import Callable, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from .programmes import EXACT, LEAST_VALUE, Growth, Interval, Polytope, SolverError, chebyshev_radius, moved_duals

ROOM = 1e-9
"""Relative growth of the bounds that keeps a fit at its bounds inside."""
EDGE = 1e-6
"""Room of an error beyond its bound, a part of the bound: a set of a radius above one has an interior, too."""
DETERMINED = 1e-6
"""Relative distance from the determined space within which a direction is determined."""
ENCLOSING, BOUNDING = 72, 16
"""Directions in which a pair of coefficients is enclosed, and in which only its length is bounded."""
SURELY_EMPTY = 1e-6
"""Relative enlargement of the bounds after which an empty set is surely empty."""
Reach = Callable[..., float]
"""Reach of a set in a direction (k,); the given lower value if it goes no farther."""
Proofs = dict[tuple[int, bytes], Floats]
"""Duals (M,) that bounded a direction, or proved that a set is empty, by its branch and the direction."""


class Steps:
    """A set of steps x (n,) of a model's columns, by its reach in each direction."""

    count: int

    def reach(self, weights: NDArray, least: float = -math.inf) -> float:
        """Return the greatest weights'x (n,); infinite if unbounded; at most `least` if it goes no farther."""
        raise NotImplementedError

    def bounded(self, weights: NDArray) -> float:
        """Return a known upper bound of weights'x (n,); infinite if none is known."""
        raise NotImplementedError

    def ends(self, column: int) -> Interval:
        """Return the least and the largest step of one column."""
        reach = self.among(np.array([column]))
        return -reach(-np.ones(1)), reach(np.ones(1))

    def among(self, columns: NDArray) -> Reach:
        """Return the reach of the steps of some columns (k,) in a direction (k,)."""

        def reach(direction: NDArray, least: float = -math.inf) -> float:
            weights = np.zeros(self.count)
            weights[columns] = direction
            return self.reach(weights, least)

        return reach


class Possible(Steps):
    """The steps x from a fit that keep every error within its bound: |left - jacobian x| ≤ bound.

    The jacobian (M, n) may have any rank; the units of its columns do not matter. `left` (M,) are the errors at the
    fit; an error beyond its bound is allowed its size. At most `most_rows` rows are used, spread over all: fewer rows
    leave a larger set, so its bounds remain valid. With `growths` of the bounds about the fit the set is the union of
    their branches; the fit lies in the first. `proofs` of similar sets are used, and added to.

    `matrix`, `lower`, `upper`: the same set, or its first branch, as lower ≤ matrix y ≤ upper. `span` (n, rank):
    orthonormal basis of the determined space of the columns times their `scale` (n,), with x = span y / scale.
    """

    def __init__(
        self,
        jacobian: NDArray,
        left: NDArray,
        bound: NDArray,
        most_rows: int | None = None,
        growths: Sequence[Growth] = (),
        proofs: Proofs | None = None,
    ) -> None:
        if most_rows is not None and len(left) > most_rows:
            rows = np.linspace(0, len(left) - 1, most_rows).round().astype(int)
            jacobian, left, bound = jacobian[rows], left[rows], bound[rows]
            growths = [growth.of(rows) for growth in growths]
        now = growths[0].now if growths else 0.0
        bound = allowed_about(left, bound, now)
        self.count, self._proofs = jacobian.shape[1], {} if proofs is None else proofs
        self.scale = np.abs(jacobian).max(axis=0, initial=0.0)
        self.scale[self.scale == 0.0] = 1.0
        branches = [grown_rows(jacobian, left, bound, growth) for growth in growths]
        self._branches = [
            _Branch(rows / self.scale, size, lower, upper)
            for rows, size, lower, upper in branches or [(jacobian, bound, left - bound, left + bound)]
        ]

    @cached_property
    def span(self) -> Floats:
        """Basis (n, rank) of the space that the rows determine."""
        triangle = np.linalg.qr(self._branches[0].rows, mode="r")
        _, values, directions = np.linalg.svd(triangle, full_matrices=False)
        return directions[values > LEAST_VALUE * values.max(initial=0.0)].T

    @property
    def matrix(self) -> Floats:
        """Rows (M, rank) of the first branch."""
        return self._branches[0].rows @ self.span

    @property
    def lower(self) -> Floats:
        """Their lower ends (M,)."""
        return self._branches[0].lower

    @property
    def upper(self) -> Floats:
        """Their upper ends (M,)."""
        return self._branches[0].upper

    def reach(self, weights: NDArray, least: float = -math.inf) -> float:
        """Return the reach, as for every set of steps."""
        direction, farthest = weights / self.scale, least
        for number, branch in enumerate(self._branches):
            key = number, weights.tobytes()
            if branch.bounded(direction, self._proofs.get(key)) <= farthest or not self._is_some(number):
                continue
            inside = self.span.T @ direction
            if np.linalg.norm(direction - self.span @ inside) > DETERMINED * np.linalg.norm(direction):
                return math.inf
            try:
                reached, self._proofs[key] = branch.maximise(inside, self.span)
            except SolverError:
                return math.inf
            farthest = max(farthest, reached)
        return farthest

    def bounded(self, weights: NDArray) -> float:
        """Return an upper bound of weights'x (n,) from the proofs of other sets; infinite if they prove nothing."""
        direction, reached = weights / self.scale, -math.inf
        for number, branch in enumerate(self._branches):
            most = branch.bounded(direction, self._proofs.get((number, weights.tobytes())))
            if most > reached and self._is_some(number):
                reached = most
        return reached

    def _is_some(self, number: int) -> bool:
        """Return True if a branch is not empty: the fit's own contains it, any other may be empty."""
        return number == 0 or self._branches[number].is_some(self._proofs, number)


def allowed_about(left: NDArray, bound: NDArray, grown: NDArray | float) -> Floats:
    """Return bounds (M,) of a set about a fit: an error beyond its bound, less its growth, is allowed its size."""
    size = np.abs(left) - grown
    return np.where(size > bound * (1.0 + ROOM), size + EDGE * bound, bound * (1.0 + ROOM))


class AnyOf(Steps):
    """The union of sets of steps of the same columns."""

    def __init__(self, sets: Sequence[Steps]) -> None:
        self.count, self._sets, self._first = sets[0].count, sets, 0

    def reach(self, weights: NDArray, least: float = -math.inf) -> float:
        """Return the reach; the set that last reached farthest is asked first, then other candidates."""
        most, number = dict.fromkeys(range(len(self._sets)), math.inf), self._first
        while most[number] > least:
            del most[number]
            if (reached := self._sets[number].reach(weights, least)) > least:
                least, self._first = reached, number
            if not most or least == math.inf:
                break
            most = {place: min(end, self._sets[place].bounded(weights)) for place, end in most.items()}
            number = max(most, key=lambda place: most[place])
        return least


class _Branch:
    """{x: lower ≤ rows x ≤ upper}, rows (M, n) of a size (M,); the solver's model is made at its first use."""

    def __init__(self, rows: NDArray, size: NDArray, lower: NDArray, upper: NDArray) -> None:
        self.rows, self.size, self.lower, self.upper = rows, size, lower, upper
        self._polytope: Polytope | None = None
        self._is_some: bool | None = None

    def maximise(self, inside: NDArray, span: NDArray) -> tuple[float, Floats]:
        """Return the reach in a direction (r,) within a span (n, r) of its rows, and the duals (M,) that prove it."""
        if self._polytope is None:
            self._polytope = Polytope(self.rows @ span, self.size)
            self._polytope.confine(self.lower, self.upper)
        reached, _, duals = self._polytope.maximise(inside)
        return reached, duals

    def bounded(self, direction: NDArray, proof: NDArray | None) -> float:
        """Return an upper bound of the reach in a direction (n,), from the duals (M,) of another set."""
        if proof is None or len(proof) != len(self.rows):
            return math.inf
        active = np.flatnonzero(proof)
        rows, duals = self.rows[active], proof[active]
        duals = moved_duals(duals, rows, direction)
        missed = direction - duals @ rows
        if not missed @ missed <= (EXACT * np.abs(duals).sum()) ** 2:
            return math.inf
        return float(duals @ np.where(duals > 0.0, self.upper[active], self.lower[active]))

    def is_some(self, proofs: Proofs, number: int) -> bool:
        """Return True if there is any such x; a proof that there is none is kept by a number, and tried first."""
        if self._is_some is None:
            middle, half = 0.5 * (self.lower + self.upper), 0.5 * (self.upper - self.lower)
            nothing, key = np.zeros(self.rows.shape[1]), (number, b"")
            # For these duals the sum of |duals| half is one.
            self._is_some = not self.bounded(nothing, proofs.get(key)) < -SURELY_EMPTY
            if self._is_some:
                radius, _, duals = chebyshev_radius(self.rows, middle, half)
                self._is_some = radius <= 1.0
                if not self._is_some:
                    proofs[key] = -duals
        return self._is_some


def grown_rows(
    jacobian: NDArray, left: NDArray, bound: NDArray, growth: Growth
) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Return {x: |left − jacobian x| ≤ bound + growth(x)} as rows with their sizes, and lower and upper ends.

    A row that grows becomes two, one for each of its ends; their other ends lie as far as the growth can reach.
    """
    paid, split = np.flatnonzero(growth.rows.any(axis=0)), growth.rows.any(axis=1)
    slopes, low, high = growth.rows[:, paid], growth.low[paid], growth.high[paid]
    allowed, most = bound + growth.now, 2.0 * np.maximum(slopes * low, slopes * high).sum(axis=1)
    # An end of a coefficient is a row like the others, with its size in them.
    scale = np.maximum(np.abs(jacobian), np.abs(growth.rows)).max(axis=0)
    ends = np.diag(scale)[paid]
    rows = np.vstack((jacobian + growth.rows, (jacobian - growth.rows)[split], ends))
    size = np.concatenate((bound, bound[split], np.full(len(paid), bound.min())))
    lower = np.concatenate((left - allowed, (left - allowed - most)[split], low * scale[paid]))
    upper = np.concatenate((left + allowed + most, (left + allowed)[split], high * scale[paid]))
    return rows, size, lower, upper


def largest_length(reach: Reach) -> float:
    """Return an upper bound of the length of a possible pair, from `reach` (direction (2,) -> reach)."""
    heights: dict[int, float] = {}
    highest = -math.inf
    for stride in (4, 2, 1):
        for k in range(0, BOUNDING, stride):
            if k in heights:
                continue
            if stride < 4:
                # Between two directions a set reaches no farther than the corner of their supporting lines.
                corner = heights[k - stride] + heights[(k + stride) % BOUNDING]
                heights[k] = 0.5 * corner / math.cos(2.0 * math.pi * stride / BOUNDING)
                if heights[k] <= highest:
                    continue
            angle = 2.0 * math.pi * k / BOUNDING
            heights[k] = reach(np.array([math.cos(angle), math.sin(angle)]), highest)
            highest = max(highest, heights[k])
    # The supporting lines enclose the set; between two directions it reaches farther by this factor at most.
    return highest / math.cos(math.pi / BOUNDING)


def polar_intervals(reach: Reach) -> tuple[Interval, Interval]:
    """Return intervals of amplitude and phase that hold a convex set of (amplitude·cos(phase), amplitude·sin(phase)).

    The set lies within the polygon of its supporting lines in `ENCLOSING` directions; the polygon's corners bound
    amplitude and phase. The phase is within (-π, π] at the middle and may reach beyond at the ends; (-π, π) if the set
    contains zero. Infinite if the set is not bounded.
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
    # The greatest distance from zero of a line that separates the set from it.
    low = float(max(0.0, (-heights).max()))
    if low == 0.0:
        return (0.0, high), (-math.pi, math.pi)
    middle = corners.mean(axis=0)
    phase = math.atan2(middle[1], middle[0])
    offsets = [math.remainder(math.atan2(y, x) - phase, 2.0 * math.pi) for x, y in corners]
    return (low, high), (phase + min(offsets), phase + max(offsets))
