"""What errors of setting do to a plan: section 4 of Golovan, Matasov, Tarygin 2022, before anything is measured.

The plan's weights Φ, used at the angles where the table really stood, estimate with the bias Σ b X, b = Σ Φ F − a. It
is tolerable where Σ|b| X^max is small beside σ Σ|Φ|; else the weights are compensated by (4.2), l̃ = A L⁻¹ (Φ z) with
L = Σ Φ Fᵀ at the actual angles; or the programme is solved again on the actual angles, which nothing betters.

At the actual angles a reading counts where (1.7) as printed says so: what a plan keeps beyond that, the bias rows or a
reserve, is there to be used up.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.regressors import regressors
from ..errors import InputError
from .forms import x_from_targets
from .places import Places, Task, clearances, task_of
from .position_costs import NOT_DETERMINED, costs

TOLERABLE = 0.1
"""A bias that may add a tenth of the guaranteed error is tolerable."""
AS_GOOD = 1.01
"""Compensated weights that cost one per cent more than new ones are good enough."""
UNBIASED = 1e-9


@dataclass(frozen=True)
class TargetCheck:
    """What the actual angles mean for one target; all in units of σ.

    Attributes
    ----------
    target : str
    planned : float
        Σ|Φ| of the plan
    bias : float
        Σ|b| X^max / σ with the plan's weights at the actual angles
    compensated : float or None
        Σ|Φ| by (4.2); None where that is not possible
    solved : float or None
        Σ|Φ| of the programme on the actual angles; None where they do not determine the target
    advice : {"tolerable", "compensate", "re-solve", "measure again"}
    """

    target: str
    planned: float
    bias: float
    compensated: float | None
    solved: float | None
    advice: str


@dataclass(frozen=True)
class SettingCheck:
    """The check of all targets.

    Attributes
    ----------
    targets : tuple of TargetCheck
    lost : int
        readings with weight whose sign is no longer certain
    largest_deg : float
        largest error of setting [deg]
    noise_bound : float
        σ
    """

    targets: tuple[TargetCheck, ...]
    lost: int
    largest_deg: float
    noise_bound: float

    @property
    def advice(self) -> str:
        """What the worst target needs."""
        return max((check.advice for check in self.targets), key=ADVICE.index)


ADVICE = ("tolerable", "compensate", "re-solve", "measure again")
"""From the least trouble to the most."""


def check_settings(task: Task, planned: Places, actual: Places, noise_bound: float) -> SettingCheck:
    """Compare bias and noise of a plan's estimators at the angles where the table stood.

    Parameters
    ----------
    task : Task
        of one mounting, asymmetric
    planned, actual : Places
        position by position
    noise_bound : float
        σ

    Raises
    ------
    InputError
        when the planned positions do not determine every target, or for a symmetric baseline
    """
    p = task.parametrisation
    if p.symmetric or len(p.mountings) != 1:
        raise InputError("--check: is for the asymmetric baseline and one mounting")
    plan = costs(task, planned)
    if not plan.determined.all():
        missing = [t.symbol for t, known in zip(task.targets, plan.determined, strict=True) if not known]
        raise InputError(f"--check: the planned positions do not determine {', '.join(missing)}")
    where, sheet = plan.readings.position, plan.readings.sheet
    accelerometer = task.accelerometer[sheet]
    exact = task_of(p, task.targets, bounds=task.bounds, rule="paper", best=task.best)
    certain = clearances(exact, actual)[where, sheet] > 0.0
    used = (np.abs(plan.weights) > 1e-9).any(axis=0)
    weights = np.where(certain, plan.weights, 0.0)
    alpha, beta = actual.angle[where].T
    f = regressors(alpha, beta, p.matrices[0])[np.arange(len(where)), accelerometer]
    to_x = np.linalg.inv(x_from_targets() @ p.selection[0])
    wanted = task.weights @ to_x
    u, v = task.bounds
    largest = np.where(np.arange(18) < 3, u, v)
    bias = np.abs(weights @ f - wanted) @ largest / noise_bound
    reached = weights @ f
    mended = _compensated(wanted, reached, weights)
    solved = costs(exact, actual)
    checks = []
    for k, target in enumerate(task.targets):
        again = float(solved.ratio[k] * task.best[k]) if solved.ratio[k] < NOT_DETERMINED else None
        own = None if mended is None else float(np.abs(mended[k]).sum())
        cost = float(np.abs(plan.weights[k]).sum())
        advice = "re-solve"
        if again is None:
            advice = "measure again"
        elif bias[k] <= TOLERABLE * cost and certain[np.abs(plan.weights[k]) > 1e-9].all():
            advice = "tolerable"
        elif own is not None and own <= AS_GOOD * again:
            advice = "compensate"
        checks.append(TargetCheck(target.symbol, cost, float(bias[k]), own, again, advice))
    turned = np.degrees(np.abs(np.angle(np.exp(1j * (actual.angle - planned.angle)))))
    return SettingCheck(tuple(checks), int((used & ~certain).sum()), float(turned.max(initial=0.0)), noise_bound)


def _compensated(wanted: NDArray, reached: NDArray, weights: NDArray) -> NDArray | None:
    """Weights (K, M) of (4.2), unbiased at the actual angles; None where L cannot be solved."""
    if reached.shape[0] != reached.shape[1] or np.linalg.cond(reached) > 1e9:
        return None
    mended = wanted @ np.linalg.solve(reached, weights)
    return mended if np.abs(wanted @ np.linalg.solve(reached, reached) - wanted).max() < UNBIASED else None


def check_summary(check: SettingCheck) -> str:
    """What a person reads."""
    lines = [
        f"largest error of setting {check.largest_deg:.4g}°; bias bounded by Σ|b| X^max, "
        f"σ = {check.noise_bound:g}; all in units of σ",
        "",
        f"{'target':<10} {'plan Σ|Φ|':>10} {'Σ|b|X^max':>10} {'(4.2) Σ|Φ|':>11} {'re-solved':>10}  advice",
    ]
    for one in check.targets:
        compensated, solved = ("-" if x is None else f"{x:.4f}" for x in (one.compensated, one.solved))
        lines.append(
            f"{one.target:<10} {one.planned:>10.4f} {one.bias:>10.4g} {compensated:>11} {solved:>10}  {one.advice}"
        )
    said = {
        "tolerable": "the plan's weights may be used as they are",
        "compensate": "use the weights of (4.2)",
        "re-solve": "solve the programme on the actual angles, as `trihedron calibrate` does",
        "measure again": "the actual angles do not determine every target",
    }
    lines += ["", f"over all targets: {check.advice}: {said[check.advice]}"]
    if check.lost:
        lines.append(f"{check.lost} readings of the plan have lost the certainty of their sign and are left out")
    return "\n".join(lines)
