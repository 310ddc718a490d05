"""The linear programmes of the guaranteed approach, solved by HiGHS to 1e-10 of the noise bound.

All are about the set {x: |r − J x| ≤ bound}. Rows are scaled to a bound of one and parameters to the smallest bound, so
that the tolerances are relative to the noise.
"""

from collections.abc import Sequence

import highspy
import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-10
"""Primal and dual feasibility tolerance, as a fraction of the noise bound."""
RELATIVE_TOLERANCE = 1e-9
"""What a programme's value may be wrong by, as a fraction of the noise bound."""


DUAL_SIMPLEX, PRIMAL_SIMPLEX = 1, 4
OTHER_STRATEGIES = ((DUAL_SIMPLEX, "off"), (PRIMAL_SIMPLEX, "off"), (DUAL_SIMPLEX, "on"), (PRIMAL_SIMPLEX, "on"))
"""How a programme is solved when its first strategy fails, as dual simplex does at times at these tolerances."""


class SolverError(ArithmeticError):
    """A programme that must have a solution was not solved."""


class Polytope:
    """{x: lower ≤ J x ≤ upper}, kept warm so that many objectives are cheap.

    Parameters
    ----------
    jacobian : (M, n) array
        of full column rank
    scale : (M,) array
        size of each row, positive: tolerances are relative to it
    """

    def __init__(self, jacobian: NDArray, scale: NDArray):
        self._unit = float(scale.min())
        self._scale = scale
        matrix = jacobian * (self._unit / scale)[:, None]
        rows, columns = matrix.shape
        free = np.full(columns, highspy.kHighsInf)
        self._highs = _model(np.zeros(columns), -free, free, matrix, np.zeros(rows), np.zeros(rows))
        self._highs.changeObjectiveSense(highspy.ObjSense.kMaximize)
        self._columns = np.arange(columns, dtype=np.int32)

    def confine(self, lower: NDArray, upper: NDArray) -> None:
        """Set the ends (M,) of every row."""
        rows = np.arange(len(lower), dtype=np.int32)
        self._highs.changeRowsBounds(len(rows), rows, lower / self._scale, upper / self._scale)  # pyright: ignore

    def maximise(self, weights: NDArray) -> tuple[float, NDArray, NDArray]:
        """The greatest weights'x over the set.

        Parameters
        ----------
        weights : (n,) array

        Returns
        -------
        value : float
        x : (n,) array
            where it is attained, a vertex
        duals : (M,) array
            Φ with Φ'J = weights: how the value changes with each row's active end
        """
        self._highs.changeColsCost(len(self._columns), self._columns, np.asarray(weights, dtype=float))
        solution = _solve(self._highs)
        x = np.array(solution.col_value) * self._unit
        duals = np.array(solution.row_dual) * self._unit / self._scale
        return float(weights @ x), x, duals


def chebyshev_radius(jacobian: NDArray, residual: NDArray, bound: NDArray) -> tuple[float, NDArray, NDArray]:
    """The least possible max |residual − jacobian x| / bound, with the proof that nothing less is possible.

    Parameters
    ----------
    jacobian : (M, n) array
        of any rank; the units of its columns do not matter
    residual : (M,) array
    bound : (M,) array
        positive

    Returns
    -------
    radius : float
        above 1 no x keeps every residual within its bound
    x : (n,) array
        a centre
    duals : (M,) array
        jacobian'duals = 0, sum of bound·|duals| = 1, residual'duals = radius: the measurements with a dual other
        than zero, at most rank + 1, prove the radius by themselves
    """
    rows, columns = jacobian.shape
    target = residual / bound
    size = np.abs(jacobian / bound[:, None]).max(axis=0, initial=0.0) if rows else np.zeros(columns)
    size[size == 0.0] = 1.0
    matrix = jacobian / bound[:, None] / size
    stretch = max(1.0, float(np.abs(target).max(initial=0.0)))
    both = np.vstack([np.hstack([matrix, np.ones((rows, 1))]), np.hstack([matrix, -np.ones((rows, 1))])])
    infinite = np.full(rows, highspy.kHighsInf)
    free = np.full(columns, highspy.kHighsInf)
    highs = _model(
        np.append(np.zeros(columns), 1.0),
        np.append(-free, 0.0),
        np.append(free, highspy.kHighsInf),
        both,
        np.concatenate([target, -infinite]) / np.append(np.full(rows, stretch), np.ones(rows)),
        np.concatenate([infinite, target / stretch]),
    )
    solution = _solve(highs)
    values = np.array(solution.col_value) * stretch
    duals = np.array(solution.row_dual)
    return max(0.0, float(values[-1])), values[:-1] / size, (duals[:rows] + duals[rows:]) / bound


def _model(
    cost: NDArray, lower: NDArray, upper: NDArray, matrix: NDArray, row_lower: NDArray, row_upper: NDArray
) -> highspy.Highs:
    lp = highspy.HighsLp()
    lp.num_row_, lp.num_col_ = matrix.shape
    lp.col_cost_, lp.col_lower_, lp.col_upper_ = cost, lower, upper
    lp.row_lower_, lp.row_upper_ = row_lower, row_upper
    columns, rows = np.nonzero(matrix.T)
    lp.a_matrix_.format_ = highspy.MatrixFormat.kColwise
    lp.a_matrix_.start_ = np.searchsorted(columns, np.arange(lp.num_col_ + 1)).astype(np.int32)
    lp.a_matrix_.index_ = rows.astype(np.int32)
    lp.a_matrix_.value_ = matrix.T[columns, rows]
    highs = highspy.Highs()
    options: Sequence[tuple[str, object]] = (
        ("output_flag", False),
        ("threads", 1),
        ("parallel", "off"),
        ("solver", "simplex"),
        ("simplex_strategy", PRIMAL_SIMPLEX),
        ("presolve", "off"),
        ("primal_feasibility_tolerance", TOLERANCE),
        ("dual_feasibility_tolerance", TOLERANCE),
        ("small_matrix_value", 1e-12),
    )
    for name, value in options:
        highs.setOptionValue(name, value)
    if highs.passModel(lp) == highspy.HighsStatus.kError:
        raise SolverError("the linear programme was not accepted by the solver")
    return highs


def _solve(highs: highspy.Highs) -> highspy.HighsSolution:
    """Solve, warm if possible; when that fails, from nothing by one strategy after the other."""
    highs.run()
    status = highs.getModelStatus()
    for strategy, presolve in OTHER_STRATEGIES:
        if status == highspy.HighsModelStatus.kOptimal:
            break
        highs.clearSolver()
        highs.setOptionValue("simplex_strategy", strategy)
        highs.setOptionValue("presolve", presolve)
        highs.run()
        status = highs.getModelStatus()
    if status != highspy.HighsModelStatus.kOptimal:
        raise SolverError(f"a linear programme was not solved: {highs.modelStatusToString(status)}")
    solution = highs.getSolution()
    highs.setOptionValue("simplex_strategy", PRIMAL_SIMPLEX)
    highs.setOptionValue("presolve", "off")
    return solution
