"""Optimal plans on grids: the reference values, closed forms, and the full linear programme."""

from dataclasses import replace
from math import cos, radians, sin

import numpy as np
import pytest
from scipy.optimize import linprog

from planning_proof import ProofError, proven_gap
from planning_reference import COSTS, random_mounting
from trihedron.models.bench import TARGETS, admissible, regressors
from trihedron.tools.calibration.model import PRESETS, parametrise
from trihedron.tools.planning.forms import sheets
from trihedron.tools.planning.plan import Grid, Plans, optimal_plans


def costs(plans: Plans) -> np.ndarray:
    return np.array([plan.cost for plan in plans])


FEW = [("rz45", "tables"), ("tripod", "paper"), ("skew", "tables")]
"""Each mounting but one, and both rules."""


@pytest.mark.parametrize(
    ("mounting", "rule"),
    [pytest.param(*k, marks=[] if k in FEW else pytest.mark.acceptance) for k in sorted(COSTS)],
)
def test_all_targets_on_the_one_degree_grid(mounting: str, rule: str) -> None:
    plans = optimal_plans(admissible=rule, mounting=mounting)
    assert [plan.target for plan in plans] == list(TARGETS)
    np.testing.assert_allclose(costs(plans), COSTS[mounting, rule], atol=1e-9, rtol=0)
    assert max(plan.gap for plan in plans) < 2e-10
    assert max(len(plan.weights) for plan in plans) <= 18


@pytest.mark.parametrize(
    ("rule", "edge", "corner", "nearest_1", "nearest_3"),
    [("tables", 2, 10, sin(radians(2)) * sin(radians(50)), sin(radians(2))),
     ("paper", 1, 8, sin(radians(1)) * sin(radians(64)), sin(radians(1)))],
)  # fmt: skip
def test_closed_forms(rule: str, edge: int, corner: int, nearest_1: float, nearest_3: float) -> None:
    cost = dict(zip(TARGETS, costs(optimal_plans(admissible=rule)), strict=True))
    for target in ("X1", "X2", "X8", "-X12", "X13"):
        assert cost[target] == pytest.approx(1 / cos(radians(edge)), rel=1e-11)
    for target in ("X6+X8", "X7+X12", "X11+X13"):
        assert cost[target] == pytest.approx(2 / cos(radians(edge)), rel=1e-11)
    assert cost["X3"] == pytest.approx(1 / cos(radians(corner)) ** 2, rel=1e-11)
    scales = [("X4", nearest_1), ("X5", nearest_1), ("X9", nearest_1), ("X10", nearest_1), ("X14", nearest_3)]
    for target, nearest in [*scales, ("X15", nearest_3)]:
        assert cost[target] == pytest.approx(2 / (1 - nearest), rel=1e-10)
    for target, nearest in (("X16", nearest_1), ("X17", nearest_1), ("X18", nearest_3)):
        assert cost[target] == pytest.approx((1 + nearest) / (1 - nearest), rel=1e-10)


def test_targets_of_the_symmetric_convention() -> None:
    plans = {plan.target: plan.cost for plan in optimal_plans(admissible="tables", convention="A2")}
    halves = ("(X6+X8)/2", "(X7+X12)/2", "(X11+X13)/2", "(X8-X6)/2", "(X7-X12)/2", "(X13-X11)/2")
    assert [plans[target] for target in halves] == pytest.approx([1.0006095443] * 6, abs=1e-9)


def test_an_asymmetry_is_a_target_of_its_own() -> None:
    """X4 − X5 costs 4/(1 − δ) at Q = I, as much as its two parts; a multiple of a target costs the multiple."""
    difference, four, five, triple = costs(optimal_plans(["X4-X5", "X4", "X5", "3*X4-3*X5"], admissible="tables"))
    assert difference == pytest.approx(4 / (1 - sin(radians(2)) * sin(radians(50))), rel=1e-10)
    assert difference == pytest.approx(four + five, rel=1e-10)
    assert triple == pytest.approx(3 * difference, rel=1e-10)


@pytest.mark.parametrize("symmetric", [False, True])
def test_column_generation_is_the_full_programme(symmetric: bool) -> None:
    """Against min Σ|Φ| over every position of a 12° grid, given whole to HiGHS; the regressors are the model's own."""
    q = random_mounting(5)
    degrees = np.arange(0, 360, 12)
    alpha, beta = (np.radians(g.ravel()) for g in np.meshgrid(degrees, degrees, indexing="ij"))
    rows = regressors(alpha, beta, q, symmetric=symmetric)
    kept = np.ones((len(alpha), 3), dtype=bool) if symmetric else admissible(alpha, beta, q)
    columns = rows[kept]
    names = [f"X{k + 1}" for k in range(18)]
    if symmetric:
        names = [name for name in names if name not in ("X5", "X10", "X15")]
    wanted = ["X1", "X4", "X14", "X6+X8", "-X12", "X16"]
    plans = optimal_plans(wanted, grid=12.0, mounting={"q": q}, baseline="symmetric" if symmetric else "asymmetric")
    for target, cost in zip(wanted, costs(plans), strict=True):
        a = np.zeros(len(names))
        for part in target.replace("-", "+-").split("+"):
            if part:
                a[names.index(part.lstrip("-"))] = -1.0 if part.startswith("-") else 1.0
        assert cost == pytest.approx(full_programme(columns, a), rel=1e-9)


def full_programme(columns: np.ndarray, a: np.ndarray) -> float:
    """max a'y with |F'y| ≤ 1."""
    both = np.vstack([columns, -columns])
    options = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}
    found = linprog(-a, A_ub=both, b_ub=np.ones(len(both)), bounds=(None, None), method="highs", options=options)
    return -found.fun


@pytest.mark.acceptance
def test_a_fine_grid_needs_no_list_of_its_positions() -> None:
    """0.1°, thirteen million positions: the first angle with a certain sign is 1.4°."""
    (plan,) = optimal_plans(["X2"], grid=0.1, admissible="tables")
    assert plan.cost == pytest.approx(1.0 / cos(radians(1.4)), rel=1e-10)
    assert plan.gap < 2e-10
    assert proven_gap(plan) < 2e-10


def test_a_finer_grid_is_never_worse_and_the_continuum_is_the_limit() -> None:
    found = [optimal_plans(["X4"], grid=step, mounting="skew")[0].cost for step in (4.0, 2.0, 1.0, 0.5, None)]
    assert found == sorted(found, reverse=True)
    assert found[-2] - found[-1] < 2e-3


def test_a_wrong_proof_is_refused() -> None:
    plan = optimal_plans(["X4"], grid=2.0)[0]
    assert proven_gap(plan) < 1e-10
    best = plan.optimum
    wrong = {
        "dual is not admissible": replace(best, dual=1.001 * best.dual),
        "biased": replace(best, weights=0.999 * best.weights),
        "not certain": replace(best, alpha=np.where(best.weights == best.weights[0], 0.0, best.alpha)),
    }
    for said, optimum in wrong.items():
        with pytest.raises(ProofError, match=said):
            proven_gap(plan.model_copy(update={"optimum": optimum}))


def test_a_step_that_does_not_divide_the_circle() -> None:
    """Positions are 0°, 7°, ..., 357°."""
    plan = optimal_plans(["X1"], grid=7.0)[0]
    assert {round(a) % 7 for a in (*plan.optimum.alpha_deg, *plan.optimum.beta_deg)} == {0}
    assert proven_gap(plan) < 1e-9


def test_one_search_serves_all_targets_in_any_order() -> None:
    search = Grid(sheets(parametrise({"tripod": PRESETS["tripod"]})), 3.0)
    first = [search.optimum(a).cost for a in np.eye(18)]
    again = [search.optimum(a).cost for a in np.eye(18)[::-1]][::-1]
    np.testing.assert_allclose(first, again, rtol=1e-10)
