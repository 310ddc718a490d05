"""The restricted linear programme of column generation: min Σ|Φ| with Σ Φ F = a, over the columns found so far."""

import highspy
import numpy as np
from numpy.typing import NDArray

from ..bounded.programmes import PRIMAL_SIMPLEX, SolverError, solver

ARTIFICIAL_COST = 1e4
"""Cost of an artificial column, in units of σ: a plan that costs more is of no use."""


class Master:
    """One warm HiGHS model to which columns are added; a new target only changes the right-hand side.

    Parameters
    ----------
    size : int
        P, the number of parameters
    """

    def __init__(self, size: int):
        self._size = size
        self._regressors = np.zeros((0, size))
        self._highs = solver()
        zero = np.zeros(size)
        empty = np.zeros(0, dtype=np.int32)
        self._highs.addRows(size, zero, zero, 0, np.zeros(size, dtype=np.int32), empty, np.zeros(0))  # pyright: ignore
        self._add_columns(ARTIFICIAL_COST, np.eye(size))

    def __len__(self) -> int:
        """The number of columns."""
        return len(self._regressors)

    @property
    def regressors(self) -> NDArray:
        """F of the columns (K, P), in the order in which they were added."""
        return self._regressors

    def add(self, regressors: NDArray) -> None:
        """Add columns F (K, P); each may have a weight of either sign."""
        self._add_columns(1.0, regressors)
        self._regressors = np.vstack([self._regressors, regressors])

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
        """Solve, warm.

        Returns
        -------
        weights : (K,) array
            Φ of each column, at most P of them other than zero
        dual : (P,) array
            y with |F'y| ≤ 1 on the columns and a'y the cost
        possible : bool
            False when the columns cannot determine the target
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
