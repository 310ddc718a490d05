"""The functions of one quantity that bounds on errors leave possible, exactly, at every knot.

errors = jacobian x + columns g + noise within the bounds, with parameters x and the values g of an unknown function at
knots, straight between them. Told is what parameters cannot imitate: of the functions that they do imitate none has a
part in it, by least squares over the knots. How much a function may bend is limited. The straight interpolation of a
function bends no more than the function does: what holds for all that bend so much on these knots holds for all
functions that do.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, qr

from .programmes import Polytope, chebyshev_radius, column_space

IMITATED = 1e-6
"""Functions of which so little is left beside the parameters, relatively, are imitated."""
HIDDEN = 2.0
"""Noise within the bounds may hide, or feign, so many times what just shows."""
SMOOTH = 40.0
"""What parameters imitate is a function of the quantity where it bends, over its size, at most so much: two waves."""
MARGIN = 1.5
"""Functions may bend so many times as much as what is least possible and what noise may hide together."""


@dataclass(frozen=True, eq=False)
class Unknown:
    """A function of one quantity that is not known, by its values at knots.

    `knots` (K,) rise; `columns` (M, K) are what its value at each of them adds to the errors; `period` is that of an
    angle that goes round, None of other quantities. A function in `steps` bends by the sizes of its jumps, any other
    one by the changes of its slope, over the whole range of the knots. `between` (M,): by how much errors differ at
    most, for each unit that a function bends, where it is not straight between knots.

    `parts` are several functions that act together: their knots and columns one after the other, and what they bend
    counts in all.
    """

    knots: NDArray[np.float64]
    columns: NDArray[np.float64]
    period: float | None = None
    steps: bool = False
    between: NDArray[np.float64] | None = None
    parts: tuple["Unknown", ...] = ()

    @staticmethod
    def together(parts: Sequence["Unknown"]) -> "Unknown":
        """Several functions that act together; of one itself."""
        if len(parts) == 1:
            return parts[0]
        knots, columns, between = [], [], []
        for part in parts:
            knots.append(part.knots)
            columns.append(part.columns)
            if part.between is not None:
                between.append(part.between)
        together = Unknown(np.concatenate(knots), np.hstack(columns), steps=parts[0].steps, parts=tuple(parts))
        if not between:
            return together
        # What is not straight bends somewhere: the errors differ by what the worst of them does to each.
        return replace(together, between=np.max(between, axis=0))

    @property
    def of_slopes(self) -> "Unknown":
        """The same, of which the changes of the slope count."""
        return replace(self, steps=False, parts=tuple(part.of_slopes for part in self.parts))

    @property
    def plain(self) -> list[NDArray[np.float64]]:
        """Functions (K,) as plain as can be: of an angle one wave, else a parabola, or one step in the middle."""
        if self.parts:
            functions, before = [], 0
            for part in self.parts:
                after = len(self.knots) - before - len(part.knots)
                for function in part.plain:
                    functions.append(np.pad(function, (before, after)))
                before += len(part.knots)
            return functions
        knots = self.knots - self.knots.mean()
        if self.period is not None:
            return [np.cos(2.0 * np.pi * knots / self.period)]
        if self.steps:
            return [(knots > 0.0).astype(float)]
        return [knots**2]

    @cached_property
    def bends(self) -> NDArray[np.float64]:
        """Rows (R, K) whose sizes add up to the bending of a function (K,)."""
        if self.parts:
            return np.asarray(block_diag(*[part.bends for part in self.parts]))
        knots, values = self.knots, np.eye(len(self.knots))
        if self.period is not None:
            knots, values = np.append(knots, knots[0] + self.period), np.vstack((values, values[:1]))
        jumps = np.diff(values, axis=0)
        if self.steps:
            return jumps
        slopes = jumps / np.diff(knots)[:, None] * (knots[-1] - knots[0])
        changes = np.diff(slopes, axis=0)
        if self.period is None:
            return changes
        return np.vstack((changes, slopes[:1] - slopes[-1:]))

    def bending(self, values: NDArray) -> float:
        """How much the function with these values (K,) bends."""
        return float(np.abs(self.bends @ values).sum())


@dataclass(frozen=True, eq=False)
class Band:
    """What the functions that are possible have in common.

    `knots` (k,) with the lower and upper end `low`, `high` (k,) of all functions; `least` (K,): the values at all knots
    of a function that bends least; `bending`: how much functions in the band may bend.
    """

    knots: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    least: NDArray[np.float64]
    bending: float


class Functions:
    """The functions that |errors − jacobian x − columns g| ≤ bound leaves possible.

    `jacobian` (M, P) may have any rank, and any units; `errors`, `bound` (M,).
    """

    def __init__(self, jacobian: NDArray, errors: NDArray, bound: NDArray, unknown: Unknown) -> None:
        self.unknown, count = unknown, len(unknown.knots)
        base, columns = column_space(jacobian / bound[:, None]), unknown.columns / bound[:, None]
        self._jacobian, self._bound = jacobian, bound
        self.imitated = imitated(base, columns, unknown)
        """Functions (K, d) that parameters imitate."""
        # Values count in units with which most of them, each by itself, move some error by the least bound.
        moved = np.abs(columns).max(axis=0)
        self._size = 1.0
        if moved.any():
            self._size /= float(np.median(moved[moved > 0.0])) * float(bound.min())
        # What parameters imitate may bend as it likes.
        bent, sizes, _ = np.linalg.svd(unknown.bends @ self.imitated, full_matrices=False)
        bends = np.hstack((unknown.bends, bent[:, sizes > IMITATED * np.linalg.norm(unknown.bends, 2)]))
        rows, self._first, out = len(bends), base.shape[1], self.imitated.shape[1]
        of_imitated = bends.shape[1] - count
        # The parameters, the function's values, what imitated functions bend, and the size of each bend.
        matrix = np.block(
            [
                [base * bound[:, None], self._size * unknown.columns, np.zeros((len(errors), of_imitated + rows))],
                [np.zeros((out, self._first)), self.imitated.T, np.zeros((out, of_imitated + rows))],
                [np.zeros((rows, self._first)), bends, -np.eye(rows)],
                [np.zeros((rows, self._first)), -bends, -np.eye(rows)],
                [np.zeros((1, self._first + count + of_imitated)), np.ones((1, rows))],
            ]
        )
        self._bent = np.zeros(matrix.shape[1])
        self._bent[-rows:] = 1.0
        infinite = np.full(2 * rows, np.inf)
        self._polytope = Polytope(matrix, np.concatenate((bound, np.full(out + 2 * rows + 1, bound.min()))))
        self._lower = np.concatenate((errors - bound, np.zeros(out), -infinite, [0.0]))
        self._upper = np.concatenate((errors + bound, np.zeros(out + 2 * rows)))

    def least(self) -> tuple[NDArray[np.float64], float]:
        """The function (K,) that bends least, and how much; a SolverError where none is possible."""
        self._polytope.confine(self._lower, np.append(self._upper, np.inf))
        bending, x, _ = self._polytope.maximise(-self._bent)
        values = x[self._first : self._first + len(self.unknown.knots)]
        return self._size * values, self._size * max(0.0, -bending)

    def told(self, values: NDArray) -> NDArray[np.float64]:
        """What is told of a function (K,): less what parameters imitate of it."""
        return values - self.imitated @ (self.imitated.T @ values)

    @property
    def zero(self) -> tuple[int, ...]:
        """Numbers (d,) of knots where a function may be taken as zero, as parameters imitate what it is there."""
        *_, pivots = qr(self.imitated.T, mode="economic", pivoting=True)
        return tuple(int(k) for k in np.sort(np.asarray(pivots)[: self.imitated.shape[1]]))

    def band(self, at: NDArray[np.int_]) -> Band:
        """Ends of all possible functions at some knots (k,), given by their numbers."""
        least, least_bending = self.least()
        just_shows = self._just_shows(least, least_bending)
        for function in self.unknown.plain:
            just_shows = max(just_shows, self._just_shows(function))
        bending = MARGIN * (least_bending + HIDDEN * just_shows)
        lower, upper = self._lower.copy(), np.append(self._upper, bending / self._size)
        if self.unknown.between is not None:
            rows, missed = slice(len(self.unknown.between)), bending * self.unknown.between
            lower[rows] -= missed
            upper[rows] += missed
        self._polytope.confine(lower, upper)
        # Next to each other ends of one side are at vertices that are near each other.
        low = np.array([-self._farthest(int(knot), -1.0) for knot in at])
        high = np.array([self._farthest(int(knot), 1.0) for knot in at])
        return Band(self.unknown.knots[at], low, high, least, bending)

    def _farthest(self, knot: int, sign: float) -> float:
        weights = np.zeros(len(self._bent))
        weights[self._first + knot] = sign
        return self._size * self._polytope.maximise(weights)[0]

    def _just_shows(self, values: NDArray, bending: float | None = None) -> float:
        """How much a function (K,) bends that is of this shape and just shows; 0 where it never does."""
        radius = chebyshev_radius(self._jacobian, self.unknown.columns @ values, self._bound)[0]
        if radius <= IMITATED:
            return 0.0
        if bending is None:
            bending = self.unknown.bending(values)
        return bending / radius


def imitated(base: NDArray, columns: NDArray, unknown: Unknown) -> NDArray[np.float64]:
    """Functions (K, d) of which columns (M, K), over their bounds, add nothing to a space (M, P), as orthonormal ones.

    Of these they are those that bend little: functions of the quantity, not of a few rows.
    """
    functions = _null_space(columns - base @ (base.T @ columns))
    slopes = unknown.of_slopes
    _, _, directions = np.linalg.svd(slopes.bends @ functions, full_matrices=True)
    functions = functions @ directions.T
    smooth = [slopes.bending(values) <= SMOOTH * np.abs(values).max(initial=0.0) for values in functions.T]
    return functions[:, np.array(smooth, dtype=bool)]


def _null_space(matrix: NDArray) -> NDArray[np.float64]:
    """Directions (K, d) of which nothing is left in a matrix (M, K), as orthonormal columns."""
    _, values, directions = np.linalg.svd(matrix)
    remaining = np.zeros(matrix.shape[1], dtype=bool)
    remaining[: len(values)] = values > IMITATED * np.linalg.norm(matrix, axis=0).max(initial=0.0)
    return directions[~remaining].T
