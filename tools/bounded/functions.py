"""The functions of one quantity that bounds on errors leave possible, exactly, at every knot.

errors = jacobian x + columns g + noise within the bounds, with parameters x and the values g of an unknown function at
knots, straight between them. Told is what parameters cannot imitate: at as many knots as there are functions that they
do imitate it is zero. How much a function may bend is limited. The straight interpolation of a function bends no more
than the function does, so that what holds for all that bend so much on these knots holds for all functions that do.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr

from .programmes import Interval, Polytope, chebyshev_radius, column_space

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
    one by the changes of its slope, over the whole range of the knots.
    """

    knots: NDArray[np.float64]
    columns: NDArray[np.float64]
    period: float | None = None
    steps: bool = False

    @cached_property
    def bends(self) -> NDArray[np.float64]:
        """Rows (R, K) whose sizes add up to the bending of a function (K,)."""
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

    `knots` (k,) with the lower and upper end `low`, `high` (k,) of all functions; `zero_at`: knots where they are zero,
    as parameters imitate what they are there; `least` (K,): the values at all knots of a function that bends least;
    `bending`: how much functions in the band may bend.
    """

    knots: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    zero_at: tuple[float, ...]
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
        self.imitated = self._smooth(_null_space(columns - base @ (base.T @ columns)))
        """Functions (K, d) that parameters imitate."""
        self.zero = np.sort(qr(self.imitated.T, mode="economic", pivoting=True)[2][: self.imitated.shape[1]])
        """Numbers (d,) of the knots where the functions that are told are zero."""
        self._free = np.setdiff1d(np.arange(count), self.zero)
        # What parameters imitate may bend as it likes.
        bent = unknown.bends @ self.imitated
        bent = bent[:, np.abs(bent).max(axis=0, initial=0.0) > IMITATED]
        bends = np.hstack((unknown.bends[:, self._free], column_space(bent)))
        rows, self._first, more = len(bends), base.shape[1], bends.shape[1]
        own = np.zeros((len(left), more))
        own[:, : len(self._free)] = unknown.columns[:, self._free]
        # The parameters, the function's values, what imitated functions bend, and the size of each bend.
        matrix = np.block(
            [
                [base * bound[:, None], own, np.zeros((len(left), rows))],
                [np.zeros((rows, self._first)), bends, -np.eye(rows)],
                [np.zeros((rows, self._first)), -bends, -np.eye(rows)],
                [np.zeros((1, self._first + more)), np.ones((1, rows))],
            ]
        )
        self._bent = np.zeros(matrix.shape[1])
        self._bent[-rows:] = 1.0
        infinite = np.full(2 * rows, np.inf)
        self._polytope = Polytope(matrix, np.concatenate((bound, np.full(2 * rows + 1, bound.min()))))
        self._lower = np.concatenate((left - bound, -infinite, [0.0]))
        self._upper = np.concatenate((left + bound, 0.0 * np.ones(2 * rows)))

    def least(self) -> tuple[NDArray[np.float64], float]:
        """The function (K,) that bends least, and how much; a SolverError where none is possible."""
        self._polytope.confine(self._lower, np.append(self._upper, np.inf))
        bending, x, _ = self._polytope.maximise(-self._bent)
        values = np.zeros(len(self.unknown.knots))
        values[self._free] = x[self._first : self._first + len(self._free)]
        return values, max(0.0, -bending)

    def _smooth(self, functions: NDArray) -> NDArray[np.float64]:
        """Those combinations (K, d) of functions that bend little: functions of the quantity, not of a few rows."""
        slopes = replace(self.unknown, steps=False)
        _, _, directions = np.linalg.svd(slopes.bends @ functions, full_matrices=True)
        found = functions @ directions.T
        least = [slopes.bending(one) <= SMOOTH * np.abs(one).max(initial=0.0) for one in found.T]
        return found[:, np.array(least, dtype=bool)]

    def told(self, values: NDArray) -> NDArray[np.float64]:
        """What is told of a function (K,): less what parameters imitate of it, zero where all functions are."""
        return values - self.imitated @ np.linalg.solve(self.imitated[self.zero], values[self.zero])

    def band(self, at: NDArray[np.int_]) -> Band:
        """Ends of all possible functions at some knots (k,), given by their numbers."""
        least, own = self.least()
        bending = MARGIN * (own + HIDDEN * max(self._just_shows(least, own), *map(self._just_shows, self._plain())))
        self._polytope.confine(self._lower, np.append(self._upper, bending))
        ends = np.array([self._ends(int(k)) for k in at]).reshape(-1, 2)
        knots = self.unknown.knots
        return Band(knots[at], ends[:, 0], ends[:, 1], tuple(knots[self.zero].tolist()), least, bending)

    def _ends(self, knot: int) -> Interval:
        weights = np.zeros(len(self._bent))
        if knot in self.zero:
            return 0.0, 0.0
        weights[self._first + int(np.searchsorted(self._free, knot))] = 1.0
        return -self._polytope.maximise(-weights)[0], self._polytope.maximise(weights)[0]

    def _plain(self) -> list[NDArray[np.float64]]:
        """Functions (K,) as plain as can be: of an angle one wave, else a parabola, or one step in the middle."""
        knots = self.unknown.knots - self.unknown.knots.mean()
        if self.unknown.period is not None:
            return [np.cos(2.0 * np.pi * knots / self.unknown.period)]
        return [(knots > 0.0).astype(float) if self.unknown.steps else knots**2]

    def _just_shows(self, values: NDArray, bending: float | None = None) -> float:
        """How much a function (K,) bends that is of this shape and just shows; 0 where it never does."""
        jacobian, _, bound = self._data
        radius = chebyshev_radius(jacobian, self.unknown.columns @ values, bound)[0]
        bending = self.unknown.bending(values) if bending is None else bending
        return bending / radius if radius > IMITATED else 0.0


def _null_space(matrix: NDArray) -> NDArray[np.float64]:
    """Directions (K, d) of which nothing is left in a matrix (M, K), as orthonormal columns."""
    _, values, directions = np.linalg.svd(matrix)
    kept = np.zeros(matrix.shape[1], dtype=bool)
    kept[: len(values)] = values > IMITATED * np.linalg.norm(matrix, axis=0).max(initial=0.0)
    return directions[~kept].T
