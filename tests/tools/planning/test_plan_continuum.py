"""Optimal plans over all angles: closed forms, and proofs that hold."""

from dataclasses import replace
from math import asin, atan2, cos, hypot, sin

import numpy as np
import pytest
from scipy.optimize import brentq

from planning_proof import ProofError, proven_gap
from planning_reference import random_mounting
from trihedron.models.bench import admissible
from trihedron.tools.planning.plan import Plans, optimal_plans

GAP = 1e-9
"""What the proof may leave open, relative."""


def nearest_to_zero_input(u: float, v: float, bias: float) -> float:
    """θ0: the angle from zero input at which the sign is certain, at Q = I."""
    return asin(bias / hypot(1 - v, u + v)) + atan2(u + v, 1 - v)


def closed_forms(u: float, v: float, rule: str) -> dict[str, float]:
    """Costs [σ] at Q = I, all angles."""
    bias = v if rule == "tables" else 0.0
    theta = nearest_to_zero_input(u, v, bias)
    single, scale, zero = 1 / cos(theta), 2 / (1 - sin(theta)), (1 + sin(theta)) / (1 - sin(theta))
    cost = dict.fromkeys(("X1", "X2", "X8", "-X12", "X13"), single)
    cost |= dict.fromkeys(("X6+X8", "X7+X12", "X11+X13"), 2 * single)
    cost |= dict.fromkeys(("X4", "X5", "X9", "X10", "X14", "X15"), scale)
    cost |= dict.fromkeys(("X16", "X17", "X18"), zero)
    return cost | {"X3": 1 / greatest_third_regressor(u, v, bias)}


def greatest_third_regressor(u: float, v: float, bias: float) -> float:
    """The greatest |cos α cos β| where sin α sin β is certain, by one-dimensional roots and a fine search."""

    def clear(alpha: float, beta: float) -> float:
        s = (sin(alpha) * sin(beta), sin(alpha) * cos(beta), cos(alpha))
        stand = abs(cos(beta)) + abs(cos(alpha) * sin(beta)) + abs(cos(alpha) * cos(beta))
        return s[0] - u * stand - v * sum(map(abs, s)) - bias

    def at(alpha: float) -> float:
        return cos(alpha) * cos(float(brentq(lambda beta: clear(alpha, beta), 1e-6, 1.2, xtol=1e-15)))  # pyright: ignore

    low, high = 1e-4, 0.6
    for _ in range(60):
        trial = np.linspace(low, high, 9)
        value = [at(a) if clear(a, 1.2) > 0 > clear(a, 1e-6) else -1.0 for a in trial]
        best = int(np.argmax(value))
        low, high = trial[max(best - 1, 0)], trial[min(best + 1, 8)]
    return at(0.5 * (low + high))


KNOWN = {
    "tables": (1.00026989733961, 2.0475623761398, 1.0475623761398, 1.02897485655299),
    "paper": (1.00008621197602, 2.02660975318464, 1.02660975318464, 1.01803824230414),
}
"""Of X1, X4, X16, X3 for 3e-3 and 1e-2."""
SOME = ("X2", "X3", "X9", "X17")


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("bounds", "rule", "targets"),
    [
        ((3e-3, 1e-2), "paper", ("X1", "X4", "X16", "X3")),
        ((3e-3, 1e-2), "tables", ()),
        ((3e-3, 5e-2), "tables", SOME),
        ((0.0, 1e-4), "tables", SOME),
    ],
)
def test_closed_forms_at_the_identity(bounds: tuple[float, float], rule: str, targets: tuple[str, ...]) -> None:
    """To 1e-9 and better, each with a proof; the values of the reference table follow from the closed forms."""
    expected = closed_forms(*bounds, rule)
    if bounds == (3e-3, 1e-2):
        assert [expected[t] for t in ("X1", "X4", "X16", "X3")] == pytest.approx(KNOWN[rule], abs=5e-13)
    for plan in optimal_plans(targets, grid=None, admissible=rule, bounds=bounds):
        assert plan.cost == pytest.approx(expected[plan.target], rel=1e-9 if targets else 1e-10), plan.target
        assert plan.gap < GAP
        assert len(plan.weights) <= 18


def check(plans: Plans) -> None:
    """Each plan is admissible, unbiased, and proven from nothing but its weights and dual."""
    for plan in plans:
        assert proven_gap(plan) < GAP, plan.target
        best = plan.optimum
        matrix = np.array(next(iter(plan.mounting.values())))
        certain = admissible(best.alpha, best.beta, matrix, bounds=plan.bounds, rule=plan.admissible)
        assert certain[np.arange(len(best.alpha)), best.accelerometer].all()


@pytest.mark.parametrize(
    ("seed", "targets"),
    [
        pytest.param(2, ("X4", "-X12"), marks=pytest.mark.acceptance),
        (1, ("X1", "X17", "X9-X10")),
        *(pytest.param(seed, (), marks=pytest.mark.acceptance) for seed in range(20)),
    ],
)
def test_proofs_at_random_mountings(seed: int, targets: tuple[str, ...]) -> None:
    mounting = {"random": random_mounting(seed)}
    check(optimal_plans(targets, grid=None, admissible=("paper", "tables")[seed % 2], mounting=mounting))


def test_proofs_of_the_symmetric_block() -> None:
    """One scale factor, every position: scale and bias cost one σ, whatever the mounting."""
    plans = optimal_plans(grid=None, baseline="symmetric", mounting="skew")
    for plan in plans:
        if plan.target in ("X4", "X9", "X14", "X16", "X17", "X18", "X8", "X13"):
            assert plan.cost == pytest.approx(1.0, rel=1e-9)
        assert proven_gap(plan) < GAP


def test_a_wrong_dual_is_refused() -> None:
    plan = optimal_plans(["X16"], grid=None, mounting="ry45")[0]
    assert proven_gap(plan) < GAP
    for wrong in (1.00001 * plan.optimum.dual, plan.optimum.dual + 1e-4 * np.eye(18)[4]):
        with pytest.raises(ProofError, match="dual is not admissible"):
            proven_gap(plan.model_copy(update={"optimum": replace(plan.optimum, dual=wrong)}))
    weak = replace(plan.optimum, dual=0.5 * plan.optimum.dual)
    assert proven_gap(plan.model_copy(update={"optimum": weak})) == pytest.approx(0.5, abs=1e-6)


@pytest.mark.acceptance
def test_a_turn_of_the_block_by_the_inner_axis_costs_nothing() -> None:
    """Rz only renames β for the outer angle's offset: X2 costs the same."""
    here, turned = (optimal_plans(["X2"], grid=None, admissible="tables", mounting=m)[0] for m in ("identity", "rz45"))
    assert here.cost == pytest.approx(turned.cost, rel=1e-9)


@pytest.mark.acceptance
def test_the_order_of_targets_does_not_matter() -> None:
    names = ("X18", "X3", "X4")
    forth = {p.target: p.cost for p in optimal_plans(names, grid=None, mounting="tripod")}
    back = {p.target: p.cost for p in optimal_plans(names[::-1], grid=None, mounting="tripod")}
    assert forth == pytest.approx(back, rel=1e-9)
