"""The functions of one quantity that bounds on errors leave possible, exactly, at every knot.

errors = jacobian x + columns g + noise within the bounds, with parameters x and the values g of an unknown function at
knots, straight between them. Only the part that parameters cannot imitate is determined: by least squares over the
knots it has no part in the imitated functions. The bending of a function is limited. The straight interpolation of a
function bends no more than the function. A bound for all functions of limited bending on these knots therefore holds
for all functions of that bending.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, qr

from ...models.arrays import Floats, Ints
from .programmes import Polytope, chebyshev_radius, column_space

IMITATED = 1e-6
"""Relative remainder beside the parameters below which functions are imitated."""
HIDDEN = 2.0
"""Multiple of a just visible effect that noise within the bounds may hide or feign."""
SMOOTH = 40.0
"""Largest bending over size of an imitated function of the quantity: two waves."""
MARGIN = 1.5
"""Allowed bending, as a multiple of the least possible bending plus that hidden by noise."""


@dataclass(frozen=True, eq=False)
class Unknown:
    """An unknown function of one quantity, by its values at knots.

    `knots` (K,) rise; `columns` (M, K) are the effects of each value on the errors; `period` is that of an angle, None
    for other quantities. A function in `steps` bends by the sizes of its jumps, any other one by the changes of its
    slope, over the whole range of the knots. `between` (M,) is the largest change of the errors, for each unit of
    bending, by a function that is not straight between knots.

    `parts` are several functions that act together: their knots and columns one after the other, with the sum of their
    bending.
    """

    knots: Floats
    columns: Floats
    period: float | None = None
    steps: bool = False
    between: Floats | None = None
    parts: tuple["Unknown", ...] = ()

    @staticmethod
    def together(parts: Sequence["Unknown"]) -> "Unknown":
        """Return several functions that act together; a single one unchanged."""
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
        # A function that is not straight bends somewhere: the worst bend bounds the difference of each error.
        return replace(together, between=np.max(between, axis=0))

    @property
    def of_slopes(self) -> "Unknown":
        """Return the same function with the changes of its slope as bending."""
        return replace(self, steps=False, parts=tuple(part.of_slopes for part in self.parts))

    @property
    def plain(self) -> list[Floats]:
        """Return the plainest functions (K,): one wave for an angle, else a parabola, or one step in the middle."""
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
    def bends(self) -> Floats:
        """Return rows (R, K) whose sizes add up to the bending of a function (K,)."""
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
        """Return the bending of the function with these values (K,)."""
        return float(np.abs(self.bends @ values).sum())


@dataclass(frozen=True, eq=False)
class Band:
    """The band of all possible functions.

    `knots` (k,) with the lower and upper end `low`, `high` (k,) of all functions; `least` (K,): the values at all knots
    of the function that bends least. `bending`: largest bending in the band.
    """

    knots: Floats
    low: Floats
    high: Floats
    least: Floats
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
        # The unit of values is that with which most of them, each alone, move some error by the least bound.
        moved = np.abs(columns).max(axis=0)
        self._size = 1.0
        if moved.any():
            self._size /= float(np.median(moved[moved > 0.0])) * float(bound.min())
        # The bending of imitated parts is free.
        bent, sizes, _ = np.linalg.svd(unknown.bends @ self.imitated, full_matrices=False)
        bends = np.hstack((unknown.bends, bent[:, sizes > IMITATED * np.linalg.norm(unknown.bends, 2)]))
        rows, self._first, out = len(bends), base.shape[1], self.imitated.shape[1]
        of_imitated = bends.shape[1] - count
        # The parameters, the function's values, the bending of imitated functions, and the size of each bend.
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

    def least(self) -> tuple[Floats, float]:
        """Return the function (K,) that bends least, and its bending.

        Raises SolverError if no function is possible.
        """
        self._polytope.confine(self._lower, np.append(self._upper, np.inf))
        bending, x, _ = self._polytope.maximise(-self._bent)
        values = x[self._first : self._first + len(self.unknown.knots)]
        return self._size * values, self._size * max(0.0, -bending)

    def told(self, values: NDArray) -> Floats:
        """Return the determined part of a function (K,), without the part that parameters imitate."""
        return values - self.imitated @ (self.imitated.T @ values)

    @property
    def zero(self) -> tuple[int, ...]:
        """Numbers (d,) of knots at which a function may be taken as zero, because parameters imitate its value
        there."""
        *_, pivots = qr(self.imitated.T, mode="economic", pivoting=True)
        return tuple(int(k) for k in np.sort(np.asarray(pivots)[: self.imitated.shape[1]]))

    def band(self, at: Ints) -> Band:
        """Return the ends of all possible functions at some knots (k,), given by their numbers."""
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
        # In this order, neighbouring ends of one side have nearby vertices.
        low = np.array([-self._farthest(int(knot), -1.0) for knot in at])
        high = np.array([self._farthest(int(knot), 1.0) for knot in at])
        return Band(self.unknown.knots[at], low, high, least, bending)

    def _farthest(self, knot: int, sign: float) -> float:
        weights = np.zeros(len(self._bent))
        weights[self._first + knot] = sign
        return self._size * self._polytope.maximise(weights)[0]

    def _just_shows(self, values: NDArray, bending: float | None = None) -> float:
        """Return the bending of a function (K,) of this shape that just shows; 0 if it never does."""
        radius = chebyshev_radius(self._jacobian, self.unknown.columns @ values, self._bound)[0]
        if radius <= IMITATED:
            return 0.0
        if bending is None:
            bending = self.unknown.bending(values)
        return bending / radius


def imitated(base: NDArray, columns: NDArray, unknown: Unknown) -> Floats:
    """Return the functions (K, d) whose columns (M, K), over their bounds, lie in a space (M, P), as orthonormal ones.

    Only functions of little bending are returned: functions of the quantity, not of a few rows.
    """
    functions = _null_space(columns - base @ (base.T @ columns))
    slopes = unknown.of_slopes
    _, _, directions = np.linalg.svd(slopes.bends @ functions, full_matrices=True)
    functions = functions @ directions.T
    smooth = [slopes.bending(values) <= SMOOTH * np.abs(values).max(initial=0.0) for values in functions.T]
    return functions[:, np.array(smooth, dtype=bool)]


def _null_space(matrix: NDArray) -> Floats:
    """Return the null space (K, d) of a matrix (M, K), as orthonormal columns."""
    # The triangle has the same values and directions, without a large factor of the rows.
    _, values, directions = np.linalg.svd(np.linalg.qr(matrix, mode="r"), full_matrices=True)
    remaining = np.zeros(matrix.shape[1], dtype=bool)
    remaining[: len(values)] = values > IMITATED * np.linalg.norm(matrix, axis=0).max(initial=0.0)
    return directions[~remaining].T
