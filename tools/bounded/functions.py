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
        knots, columns = np.concatenate([p.knots for p in parts]), np.hstack([p.columns for p in parts])
        between = [p.between for p in parts if p.between is not None]
        # What is not straight bends somewhere: the errors differ by what the worst of them does to each.
        missed = np.max(between, axis=0) if between else None
        return Unknown(knots, columns, steps=parts[0].steps, between=missed, parts=tuple(parts))

    @property
    def of_slopes(self) -> "Unknown":
        """The same, of which the changes of the slope count."""
        return replace(self, steps=False, parts=tuple(part.of_slopes for part in self.parts))

    @property
    def plain(self) -> list[NDArray[np.float64]]:
        """Functions (K,) as plain as can be: of an angle one wave, else a parabola, or one step in the middle."""
        if self.parts:
            ends = np.cumsum([0, *(len(part.knots) for part in self.parts)])
            blocks = zip(self.parts, ends[:-1], ends[1:], strict=True)
            return [np.pad(one, (low, ends[-1] - high)) for part, low, high in blocks for one in part.plain]
        knots = self.knots - self.knots.mean()
        if self.period is not None:
            return [np.cos(2.0 * np.pi * knots / self.period)]
        return [(knots > 0.0).astype(float) if self.steps else knots**2]

    @cached_property
    def bends(self) -> NDArray[np.float64]:
        """Rows (R, K) whose sizes add up to the bending of a function (K,)."""
        if self.parts:
            return np.asarray(block_diag(*(part.bends for part in self.parts)))
        count, eye = len(self.knots), np.eye(len(self.knots))
        if self.period is None:
            knots, values = self.knots, eye
        else:
            knots, values = np.append(self.knots, self.knots[0] + self.period), np.vstack((eye, eye[:1]))
        jumps = np.diff(values, axis=0)
        if self.steps:
            return jumps
        slopes = jumps / np.diff(knots)[:, None] * (knots[-1] - knots[0])
        changes = np.diff(slopes, axis=0)
        return changes if self.period is None else np.vstack((changes, slopes[:1] - slopes[count - 1 :]))

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
    """The functions that |left − jacobian x − columns g| ≤ bound leaves possible.

    `jacobian` (M, P) may have any rank, and any units; `left`, `bound` (M,).
    """

    def __init__(self, jacobian: NDArray, left: NDArray, bound: NDArray, unknown: Unknown) -> None:
        self.unknown, count = unknown, len(unknown.knots)
        base, columns = column_space(jacobian / bound[:, None]), unknown.columns / bound[:, None]
        self._data = jacobian, left, bound
        self.imitated = imitated(base, columns, unknown)
        """Functions (K, d) that parameters imitate."""
        # Values count in units with which most of them, each by itself, move some error by the least bound.
        moved = np.abs(columns).max(axis=0)
        self._size = 1.0 / (float(np.median(moved[moved > 0.0])) * float(bound.min())) if moved.any() else 1.0
        # What parameters imitate may bend as it likes.
        bent, sizes, _ = np.linalg.svd(unknown.bends @ self.imitated, full_matrices=False)
        bends = np.hstack((unknown.bends, bent[:, sizes > IMITATED * np.linalg.norm(unknown.bends, 2)]))
        rows, self._first, more, out = len(bends), base.shape[1], bends.shape[1] - count, self.imitated.shape[1]
        # The parameters, the function's values, what imitated functions bend, and the size of each bend.
        matrix = np.block(
            [
                [base * bound[:, None], self._size * unknown.columns, np.zeros((len(left), more + rows))],
                [np.zeros((out, self._first)), self.imitated.T, np.zeros((out, more + rows))],
                [np.zeros((rows, self._first)), bends, -np.eye(rows)],
                [np.zeros((rows, self._first)), -bends, -np.eye(rows)],
                [np.zeros((1, self._first + count + more)), np.ones((1, rows))],
            ]
        )
        self._bent = np.zeros(matrix.shape[1])
        self._bent[-rows:] = 1.0
        infinite = np.full(2 * rows, np.inf)
        self._polytope = Polytope(matrix, np.concatenate((bound, np.full(out + 2 * rows + 1, bound.min()))))
        self._lower = np.concatenate((left - bound, np.zeros(out), -infinite, [0.0]))
        self._upper = np.concatenate((left + bound, np.zeros(out + 2 * rows)))

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
        least, own = self.least()
        bending = MARGIN * (
            own + HIDDEN * max(self._just_shows(least, own), *map(self._just_shows, self.unknown.plain))
        )
        lower, upper = self._lower.copy(), np.append(self._upper, bending / self._size)
        if self.unknown.between is not None:
            rows, more = slice(len(self.unknown.between)), bending * self.unknown.between
            lower[rows] -= more
            upper[rows] += more
        self._polytope.confine(lower, upper)
        # Next to each other ends of one side are at vertices that are near each other.
        low, high = (np.array([sign * self._farthest(int(k), sign) for k in at]) for sign in (-1.0, 1.0))
        return Band(self.unknown.knots[at], low, high, least, bending)

    def _farthest(self, knot: int, sign: float) -> float:
        weights = np.zeros(len(self._bent))
        weights[self._first + knot] = sign
        return self._size * self._polytope.maximise(weights)[0]

    def _just_shows(self, values: NDArray, bending: float | None = None) -> float:
        """How much a function (K,) bends that is of this shape and just shows; 0 where it never does."""
        jacobian, _, bound = self._data
        radius = chebyshev_radius(jacobian, self.unknown.columns @ values, bound)[0]
        bending = self.unknown.bending(values) if bending is None else bending
        return bending / radius if radius > IMITATED else 0.0


def imitated(base: NDArray, columns: NDArray, unknown: Unknown) -> NDArray[np.float64]:
    """Functions (K, d) of which columns (M, K), over their bounds, add nothing to a space (M, P), as orthonormal ones.

    Of these they are those that bend little: functions of the quantity, not of a few rows.
    """
    functions = _null_space(columns - base @ (base.T @ columns))
    slopes = unknown.of_slopes
    _, _, directions = np.linalg.svd(slopes.bends @ functions, full_matrices=True)
    found = functions @ directions.T
    least = [slopes.bending(one) <= SMOOTH * np.abs(one).max(initial=0.0) for one in found.T]
    return found[:, np.array(least, dtype=bool)]


def _null_space(matrix: NDArray) -> NDArray[np.float64]:
    """Directions (K, d) of which nothing is left in a matrix (M, K), as orthonormal columns."""
    _, values, directions = np.linalg.svd(matrix)
    kept = np.zeros(matrix.shape[1], dtype=bool)
    kept[: len(values)] = values > IMITATED * np.linalg.norm(matrix, axis=0).max(initial=0.0)
    return directions[~kept].T
