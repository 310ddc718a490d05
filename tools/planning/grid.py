"""Optimal plans on a grid of table positions, of any step, by column generation."""

from collections.abc import Sequence

import highspy
import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import PRIMAL_SIMPLEX, SolverError, solver
from ..errors import InputError
from .certificate import ROUNDING, Optimum, UndeterminedError, settled
from .forms import OUTSIDE, Ridges, Sheet, basis, clearance, dual_forms, value

TOLERANCE = 1e-10
"""|F'y| may exceed one by this on the grid: the cost is then optimal to this."""
ARTIFICIAL_COST = 1e4
"""Cost of an artificial column, in units of σ: a plan that costs more is of no use."""
SEEDS = 12
"""Rows and columns of the coarse grid that the search begins with."""
BEST_ROWS = 20
WHOLE = 480
"""Lines of a grid that is priced whole, at most."""
ROWS_AT_ONCE = 64
FINEST_DEG = 0.01


class Columns:
    """The restricted programme of column generation: min Σ|Φ| with Σ Φ F = a, over the columns found so far.

    One warm HiGHS model to which columns are added; a new target only changes the right-hand side. `regressors` (K, P)
    are F of the columns in the order in which they were added, for P parameters.
    """

    def __init__(self, size: int):
        self._size = size
        self.regressors = np.zeros((0, size))
        self._highs = solver()
        zero = np.zeros(size)
        empty = np.zeros(0, dtype=np.int32)
        self._highs.addRows(size, zero, zero, 0, np.zeros(size, dtype=np.int32), empty, np.zeros(0))  # pyright: ignore
        self._add_columns(ARTIFICIAL_COST, np.eye(size))

    def add(self, regressors: NDArray) -> None:
        """Add columns F (K, P); each may have a weight of either sign."""
        self._add_columns(1.0, regressors)
        self.regressors = np.vstack([self.regressors, regressors])

    def _add_columns(self, cost: float, regressors: NDArray) -> None:
        matrix = np.repeat(regressors, 2, axis=0)
        matrix[1::2] *= -1.0
        count = len(matrix)
        columns, rows = np.nonzero(matrix)
        self._highs.addCols(
            count,
            np.full(count, cost),  # pyright: ignore[reportArgumentType]
            np.zeros(count),  # pyright: ignore[reportArgumentType]
            np.full(count, highspy.kHighsInf),  # pyright: ignore[reportArgumentType]
            len(rows),
            np.searchsorted(columns, np.arange(count)).astype(np.int32),  # pyright: ignore[reportArgumentType]
            rows.astype(np.int32),  # pyright: ignore[reportArgumentType]
            matrix[columns, rows],  # pyright: ignore[reportArgumentType]
        )

    def close(self, columns: NDArray, *, closed: bool = True) -> None:
        """Keep columns (n,) out of every plan, or let them in again."""
        pairs = (2 * (self._size + np.asarray(columns))[:, None] + np.arange(2)).ravel().astype(np.int32)
        upper = np.full(len(pairs), 0.0 if closed else highspy.kHighsInf)
        self._highs.changeColsBounds(len(pairs), pairs, np.zeros(len(pairs)), upper)  # pyright: ignore

    def aim(self, target: NDArray) -> None:
        """Set the weights a (P,) of the target."""
        rows = np.arange(self._size, dtype=np.int32)
        self._highs.changeRowsBounds(self._size, rows, target, target)  # pyright: ignore

    def solve(self) -> tuple[NDArray, NDArray, bool]:
        """Φ (K,) of each column, at most P of them not zero; y (P,) with |F'y| ≤ 1 on the columns and a'y the cost.

        Last, whether the columns can determine the target.
        """
        self._highs.run()
        if self._highs.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            self._highs.clearSolver()
            self._highs.setOptionValue("simplex_strategy", PRIMAL_SIMPLEX)
            self._highs.run()
            self._highs.setOptionValue("simplex_strategy", 0)
        status = self._highs.getModelStatus()
        if status != highspy.HighsModelStatus.kOptimal:
            raise SolverError(f"a linear programme was not solved: {self._highs.modelStatusToString(status)}")
        solution = self._highs.getSolution()
        values = np.array(solution.col_value)
        pairs = values[0::2] - values[1::2]
        possible = bool(np.abs(pairs[: self._size]).max() <= 1e-9)
        return pairs[self._size :], np.array(solution.row_dual), possible


class Grid:
    """A grid over [0°, 360°] × [0°, 360°] and the columns found on it so far, shared by all targets.

    Positions that coincide (0° and 360°) count once. A coarse grid is priced whole. Of a fine one no list of positions
    is ever made: its every n-th line gives the first columns, and then a row of it is looked at only where the greatest
    |F'y| over its β, known exactly, exceeds one. An InputError for a step that is not between 0.01 and 180 degrees.
    """

    def __init__(self, sheets: Sequence[Sheet], step_deg: float):
        if not FINEST_DEG <= step_deg <= 180.0:
            raise InputError(f"--grid {step_deg:g}: the step must be between {FINEST_DEG:g} and 180 degrees")
        count = int(360.0 / step_deg + 1e-9) + 1
        degrees = np.arange(count) * step_deg
        self._degrees = degrees[degrees < 360.0 - 1e-9 * step_deg]
        self._angle = np.radians(self._degrees)
        self._sheets, self._size = sheets, len(self._degrees)
        self._columns = Columns(sheets[0].regressor.shape[0])
        self._at = np.zeros((0, 3), dtype=int)
        lines = np.arange(0, self._size, -(-self._size // WHOLE))
        self._coarse = Lines(sheets, self._angle, lines)
        self._fine = Rows(sheets, self._angle) if len(lines) < self._size else None
        some = lines[np.unique(np.linspace(len(lines) // 90, len(lines) - 1, SEEDS).astype(int))]
        for k, sheet in enumerate(sheets):
            i, j = (g.ravel() for g in np.meshgrid(some, some, indexing="ij"))
            inside = clearance(sheet, self._angle[i], self._angle[j]) > 0.0
            self._add(np.column_stack([np.full(inside.sum(), k), i[inside], j[inside]]))

    def _add(self, places: NDArray) -> None:
        if len(places):
            angle = self._angle
            columns = [value(self._sheets[k].regressor, angle[i], angle[j]) for k, i, j in places]
            self._columns.add(np.array(columns))
            self._at = np.vstack([self._at, places])

    def ceiling(self, dual: NDArray) -> float:
        """What |F'y| does not exceed on the grid, rounding included."""
        forms = dual_forms(self._sheets, dual)
        return (self._fine.price(forms, None) if self._fine is not None else self._coarse.price(forms))[0]

    def _price(self, dual: NDArray) -> tuple[float, NDArray]:
        """As `Lines.price`, of the whole grid once its coarser lines and its best rows hold nothing above one."""
        forms = dual_forms(self._sheets, dual)
        bound, places = self._coarse.price(forms)
        if self._fine is not None:
            for most in (BEST_ROWS, None):
                if not len(places):
                    bound, places = self._fine.price(forms, most)
        return bound, places

    def optimum(self, target: NDArray) -> Optimum:
        """The plan of least cost for a target a (P,), with the dual that proves it.

        An UndeterminedError when the grid's positions cannot determine the target.
        """
        self._columns.aim(target)
        while True:
            weights, dual, possible = self._columns.solve()
            bound, places = self._price(dual)
            if not len(places):
                break
            self._add(places)
        if not possible:
            raise UndeterminedError
        used = np.flatnonzero(weights)
        sheet, i, j = self._at[used].T
        accelerometer = np.array([self._sheets[k].accelerometer for k in sheet])
        places = accelerometer, self._angle[i], self._angle[j], self._degrees[i], self._degrees[j]
        return settled(target, dual, bound, self._columns.regressors[used], weights[used], places)


class Lines:
    """A grid that is priced whole: every admissible position of the given lines of both angles (n,) [rad]."""

    def __init__(self, sheets: Sequence[Sheet], angle: NDArray, lines: NDArray):
        self._lines, self._basis = lines, basis(angle[lines])
        here = angle[lines]
        self._inside = [(clearance(s, here[:, None], here[None, :]) > 0.0).astype(float) for s in sheets]

    def price(self, forms: NDArray) -> tuple[float, NDArray]:
        """The greatest |F'y|, rounding included, and the worst positions (K, 3) (sheet, row, column) above one."""
        slack = _rounding(forms)
        found, ceiling = [], 0.0
        for k, (form, inside) in enumerate(zip(forms, self._inside, strict=True)):
            values = (self._basis @ form @ self._basis.T) * inside
            for worst in (int(values.argmax()), int(values.argmin())):
                ceiling = max(ceiling, abs(values.flat[worst]))
                if abs(values.flat[worst]) > 1.0 + TOLERANCE:
                    i, j = divmod(worst, len(self._lines))
                    found.append((k, self._lines[i], self._lines[j]))
        return ceiling + slack, np.array(found, dtype=int).reshape(-1, 3)


class Rows:
    """A grid of angles (n,) [rad] that is priced row by row, and only where a row may hold a position above one."""

    def __init__(self, sheets: Sequence[Sheet], angle: NDArray):
        self._sheets, self._angle, self._basis = sheets, angle, basis(angle)
        self._ridges = Ridges(sheets, OUTSIDE)
        self._arcs = [self._ridges.arcs(np.full(len(angle), k), angle) for k in range(len(sheets))]

    def price(self, forms: NDArray, most: int | None) -> tuple[float, NDArray]:
        """As `Lines.price`; of each sheet and sense at most `most` rows, the most promising, are looked at."""
        limit, slack = 1.0 + TOLERANCE, _rounding(forms)
        found, ceiling = [], limit
        for k, sheet in enumerate(self._sheets):
            for sense in (1.0, -1.0):
                height, _ = self._ridges.heights(self._arcs[k], forms, np.full(len(self._angle), sense))
                rows = np.flatnonzero(height + 2.0 * slack > limit)
                if most is not None:
                    rows = rows[np.argsort(-height[rows], kind="stable")[:most]]
                best, where = limit, None
                for block in np.array_split(rows, len(rows) // ROWS_AT_ONCE + 1):
                    values = sense * (self._basis[block] @ forms[k] @ self._basis.T)
                    i, j = np.nonzero(values + slack > best)
                    inside = clearance(sheet, self._angle[block[i]], self._angle[j]) > 0.0
                    i, j = i[inside], j[inside]
                    if len(i):
                        worst = int(values[i, j].argmax())
                        top = float(values[i[worst], j[worst]])
                        ceiling = max(ceiling, top)
                        if top > best:
                            best, where = top, (k, block[i[worst]], j[worst])
                if where is not None:
                    found.append(where)
        return ceiling + slack, np.array(found, dtype=int).reshape(-1, 3)


def _rounding(forms: NDArray) -> float:
    return ROUNDING * float(np.abs(forms).sum(axis=(1, 2)).max())
