"""A plan's proof, checked again only from its positions, weights and dual."""

import numpy as np

from trihedron.tools.calibration import expression_weights
from trihedron.tools.planning import Plan, SignSheet, clearance, sheets, value
from trihedron.tools.planning.certificate import ceiling, lower_bound
from trihedron.tools.planning.forms import dual_forms
from trihedron.tools.planning.targets import PositionGrid

LEVELS = (2e-11, 1e-10, 5e-10, 9e-10, 1e-8, 1e-6)
"""Excesses of |F'y| over one, tried in turn: the lower bound is divided by the proven one."""
BIAS = 1e-11


class ProofError(ValueError):
    """The positions, weights and dual prove nothing; the message has the reason."""


def proven_gap(plan: Plan) -> float:
    """Return the largest relative gain of another plan; the plan's `optimum.lower_bound` is not used.

    Raises ProofError if the weights are biased, a reading is not admissible, or |F'y| exceeds one somewhere.
    """
    best, target = plan.optimum, expression_weights(plan.target, plan.parametrisation)
    block = sheets(plan.parametrisation, bounds=plan.bounds, rule=plan.admissible)
    total = np.zeros(len(target))
    for accelerometer, alpha, beta, weight in zip(best.accelerometer, best.alpha, best.beta, best.weights, strict=True):
        signs = [sheet for sheet in block if sheet.accelerometer == accelerometer]
        sheet = max(signs, key=lambda s, a=alpha, b=beta: float(clearance(s, a, b)))
        if float(clearance(sheet, alpha, beta)) <= 0.0:
            raise ProofError(f"the sign of the input is not certain for {_place(accelerometer, alpha, beta)}")
        total += weight * value(sheet.regressor, alpha, beta)
    bias = float(np.abs(total - target).max())
    if bias > BIAS * max(1.0, float(np.abs(target).max())):
        raise ProofError(f"the weights are biased by {bias:.2g}")
    if plan.grid_deg is None:
        bound = _ceiling(block, best.dual)
    else:
        bound = PositionGrid(block, plan.grid_deg).ceiling(best.dual)
        if bound > 1.0 + LEVELS[-1]:
            raise ProofError(f"the dual is not admissible: |F'y| is {bound:.6g} on the grid")
    return max(best.cost - lower_bound(target, best.dual, bound), 0.0) / best.cost


def _ceiling(block: list[SignSheet], dual: np.ndarray) -> float:
    """Return a proven bound of |F'y| over all angles."""
    for excess in LEVELS:
        bounded = ceiling(block, dual, 1.0 + excess)
        if not len(bounded.violations):
            return bounded.bound
    k, _, alpha, beta = bounded.violations[0]
    worst = abs(float(value(dual_forms(block, dual)[int(k)], alpha, beta)))
    place = _place(block[int(k)].accelerometer, alpha, beta)
    raise ProofError(f"the dual is not admissible: |F'y| is {worst:.6g} for {place}")


def _place(accelerometer: int, alpha: float, beta: float) -> str:
    return f"accelerometer {accelerometer + 1} at alpha {np.degrees(alpha):.6g}°, beta {np.degrees(beta):.6g}°"
