"""A plan's promises are nearly attained: by a truth, a position, a set that the planner itself could not exclude."""

from dataclasses import replace
from fractions import Fraction
from itertools import combinations

import numpy as np
import pytest

import trihedron as th
from planning_tasks import stored, tables_task
from trihedron.models.bench import admissible, regressors
from trihedron.tools.calibration import PRESETS, expression_weights, parametrise
from trihedron.tools.planning import Optimum, Places, Plan, Task, bound_positions, clearance, costs, sheets, task_of
from trihedron.tools.planning.bounds import HittingSet, PositionPool
from trihedron.tools.planning.certificate import MOST_TERMS, _expand, _upper, lower_bound
from trihedron.tools.planning.forms import dual_forms, x_from_targets
from trihedron.tools.planning.search import random_places
from trihedron.tools.planning.targets import PositionGrid
from trihedron.tools.planning.task import clearances, readings


def every_reading(step_deg: float, rule: str, bounds: tuple[float, float]) -> np.ndarray:
    """Return F (M, 18) of every reading of a grid whose sign is certain, by the regressors of the paper."""
    angle = np.radians(np.arange(0.0, 360.0, step_deg))
    alpha, beta = np.tile(angle, len(angle)), np.repeat(angle, len(angle))
    certain = admissible(alpha, beta, np.eye(3), bounds=bounds, rule=rule)
    return (regressors(alpha, beta, np.eye(3)) @ x_from_targets())[certain]


@pytest.fixture(scope="module", params=["paper", "tables"])
def planned(request: pytest.FixtureRequest) -> tuple[str, list[Plan]]:
    return request.param, list(th.plan("X3", "X4", "X17", "X4-X5", grid=3.0, admissible=request.param))


def test_the_guaranteed_error_is_that_of_some_truth(planned: tuple[str, list[Plan]]) -> None:
    """Two truths, ±y σ, that no readings of the grid separate differ in the target by twice the guaranteed error."""
    rule, plans = planned
    f = every_reading(3.0, rule, plans[0].bounds)
    for plan in plans:
        truth = np.array(list(plan.dual.values()))
        hidden = float(np.abs(f @ truth).max())
        assert hidden <= 1.0 + 2e-10, plan.target
        target = expression_weights(plan.target, plan.parametrisation)
        assert target @ truth == pytest.approx(plan.cost, rel=1e-9)
        assert plan.lower_bound <= target @ truth / hidden * (1 + 1e-15)
        assert plan.lower_bound >= plan.cost * (1.0 - 1e-9)


def test_the_guaranteed_error_is_attained_by_some_errors_of_the_readings(planned: tuple[str, list[Plan]]) -> None:
    """Use errors of σ with the signs of the weights; the estimate without errors is the truth."""
    rule, plans = planned
    truth = np.random.default_rng(1).normal(size=18)
    for plan in plans:
        best = plan.optimum
        f = regressors(best.alpha, best.beta, np.eye(3))[np.arange(len(best.alpha)), best.accelerometer]
        reading = f @ x_from_targets() @ truth
        aimed = expression_weights(plan.target, plan.parametrisation) @ truth
        assert best.weights @ reading == pytest.approx(aimed, abs=1e-12)
        assert best.weights @ (reading + np.sign(best.weights)) - aimed == pytest.approx(plan.cost, rel=1e-12)
        certain = admissible(best.alpha, best.beta, np.eye(3), bounds=plan.bounds, rule=rule)
        assert certain[np.arange(len(best.alpha)), best.accelerometer].all()


@pytest.mark.acceptance
def test_a_lower_bound_is_rounded_down_and_no_further() -> None:
    """Compare with exact fractions: never above the dual's proof, and hardly below."""
    rng = np.random.default_rng(0)
    for _ in range(2000):
        size = int(rng.integers(1, 19))
        target, dual = rng.normal(size=size), rng.normal(size=size)
        dual = np.sign(target @ dual or 1.0) * dual
        ceiling = float(rng.choice([0.5, 1.0, 1.0 + 1e-10 * rng.random(), 1.0 + rng.random()]))
        proven = sum(Fraction(float(a)) * Fraction(float(y)) for a, y in zip(target, dual, strict=True))
        proven /= max(Fraction(ceiling), 1)
        bound = lower_bound(target, dual, ceiling)
        assert Fraction(bound) <= proven
        assert float(proven) - bound <= 100 * np.finfo(float).eps * float(np.abs(target) @ np.abs(dual))
        none = np.zeros(0)
        optimum = Optimum(none, none, none, np.ones(1), dual, bound, none, none)
        factor = float(rng.uniform(0.1, 10.0))
        assert Fraction(optimum.times(factor).lower_bound) <= Fraction(factor) * Fraction(bound) or bound < 0.0


def boxes(forms: np.ndarray, alpha: float, beta: float, radius: float) -> float:
    """Return the proven bound of f, the first form, on a box about a place."""
    mixed = np.linalg.norm(forms[:, :2, :2], 2, axis=(-2, -1))
    along = mixed + np.linalg.norm(forms[:, :2, 2], axis=-1), mixed + np.linalg.norm(forms[:, 2, :2], axis=-1)
    third = np.stack([along[0], mixed, along[1]], axis=-1)[None]
    values = _expand(forms[None], np.zeros(1, dtype=int), np.array([alpha]), np.array([beta]))
    size = np.abs(forms).sum(axis=(-2, -1))[None]
    return float(_upper(values, third, size, np.full((2, 1), radius), -np.inf)[0][0])


def exact(form: np.ndarray, alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Return values of a form in extended precision."""
    a, b = (np.stack([np.cos(x), np.sin(x), np.ones_like(x)], axis=-1) for x in (alpha, beta))
    return ((a @ form.astype(np.longdouble)) * b).sum(axis=-1)


@pytest.mark.acceptance
def test_a_box_is_bounded_from_above_and_tightly() -> None:
    """Use forms that rise from a level centre with the largest allowed third derivatives; and rounding, in a point."""
    rising = np.zeros((2 + MOST_TERMS, 3, 3))
    rising[0, 0, 1] = rising[0, 1, 0] = -1.0
    rising[0, 2, 1] = rising[0, 1, 2] = 1.0
    rising[1, 2, 2] = 1.0
    for radius in (0.3, 0.1, 1e-2):
        # sin α + sin β − sin(α + β) is r³ at the corner
        side = np.longdouble(radius) * np.linspace(-1, 1, 81).astype(np.longdouble)
        highest = float(exact(rising[0], np.tile(side, 81), np.repeat(side, 81)).max())
        bound = boxes(rising, 0.0, 0.0, radius)
        assert highest <= bound <= 1.75 * highest
    rng = np.random.default_rng(4)
    for _ in range(500):
        forms = np.zeros((2 + MOST_TERMS, 3, 3))
        forms[0], forms[1, 2, 2] = rng.normal(size=(3, 3)), 1.0
        alpha, beta = rng.uniform(0.0, 2 * np.pi, 2)
        true = exact(forms[0], *np.array([[alpha], [beta]], dtype=np.longdouble))[0]
        bound = boxes(forms, alpha, beta, 0.0)
        assert true <= bound <= true + 130 * np.finfo(float).eps * np.abs(forms[0]).sum()


def test_a_grid_s_ceiling_allows_for_rounding() -> None:
    """It is never below the greatest |F'y| of the grid in extended precision, and hardly above."""
    block = sheets(parametrise({"skew": PRESETS["skew"]}))
    grid, angle = PositionGrid(block, 30.0), np.radians(np.arange(0.0, 360.0, 30.0))
    alpha, beta = np.tile(angle, len(angle)), np.repeat(angle, len(angle))
    for seed in range(40):
        dual = np.random.default_rng(seed).normal(size=18)
        greatest = 0.0
        for sheet, form in zip(block, dual_forms(block, dual), strict=True):
            inside = clearance(sheet, alpha, beta) > 0.0
            places = alpha[inside].astype(np.longdouble), beta[inside].astype(np.longdouble)
            greatest = max(greatest, np.abs(exact(form, *places)).max())
        assert greatest <= grid.ceiling(dual) <= greatest * (1 + 1e-12)


def test_room_for_setting_errors_is_nearly_used_up() -> None:
    """The drop of the clearance inside the box of setting errors below its corners is nearly the allowance."""
    task = tables_task(reserve_deg=2.0)
    base = np.zeros_like(task.base)
    base[:, 0, 0] = base[:, 0, 2] = -1.0
    task = replace(task, base=base, terms=np.zeros_like(task.terms))
    corner = -np.cos(np.radians(2.0)) * (np.cos(np.radians(2.0)) + 1.0)
    stated = clearances(task, Places(np.zeros((1, 2)), np.zeros(1, dtype=int)))[0, 0]
    assert stated <= -2.0, "the clearance in the middle"
    assert corner - stated <= 1.2 * (corner + 2.0)


@pytest.fixture(scope="module")
def small_pool() -> tuple[Task, PositionPool]:
    """Return ten positions: the package's seven, and three at random."""
    extra = random_places(tables_task(), 3, np.random.default_rng(3)).angle
    places, task = Places(np.vstack([stored(7).angle, extra]), np.zeros(10, dtype=int)), tables_task(cuts=60, seed=2)
    return task, PositionPool(places, np.arange(10), readings(task, places))


@pytest.mark.acceptance
def test_a_bound_of_sets_is_that_of_the_best_set(small_pool: tuple[Task, PositionPool]) -> None:
    """Try every set of a small pool; if only worse sets are known, no more is proven."""
    task, pool = small_pool
    best, second = sorted(costs(task, pool.places.chosen(list(rows))).worst for rows in combinations(range(10), 7))[:2]
    assert second > 1.1 * best
    assert bound_positions(task, pool, 7, best).ratio == pytest.approx(best, rel=1e-7)
    assert 0.8 * best <= bound_positions(task, pool, 7, second).ratio <= best * (1 + 1e-9)


@pytest.mark.acceptance
def test_a_bound_where_some_are_measured_is_that_of_the_best_set(small_pool: tuple[Task, PositionPool]) -> None:
    task, pool = small_pool
    known = replace(task, measured=pool.places.chosen([0, 2, 3, 5]))
    sets = (pool.places.chosen(list(rows)).joined(known.measured) for rows in combinations(range(10), 3))
    best = min(costs(known, places).worst for places in sets)
    assert bound_positions(known, pool, 3, best).ratio == pytest.approx(best, rel=1e-7)


@pytest.mark.acceptance
def test_a_bound_of_a_goal_is_that_of_the_norm_of_its_targets(small_pool: tuple[Task, PositionPool]) -> None:
    task, pool = small_pool
    level = task_of(replace(task.request, goal="levelling", cuts=60), best=np.full(8, 2.0))
    sets = [list(rows) for rows in combinations(range(10), 7)]
    ratio = [costs(level, pool.places.chosen(rows)).worst for rows in sets]
    best = min(ratio)
    assert best > 1.02
    assert bound_positions(level, pool, 7, best).ratio == pytest.approx(best, rel=1e-7)
    two = np.random.default_rng(4).normal(size=(2, 18))
    alone = [pool.heights(two[:1]), pool.heights(two[1:])]
    for duals in (two, two[::-1]):
        np.testing.assert_allclose(pool.heights(duals), np.maximum(*alone), rtol=1e-12)
    hitting = HittingSet(level, pool)
    hitting.prove(7, 1.5 * best, 20)
    assert len(hitting) > 3
    for rows, reached in zip(sets, ratio, strict=True):
        # A set that reaches a ratio has a position in the region of every cut.
        assert (hitting._height[rows].max(axis=0) >= (1.0 - 1e-6) / reached).all()


def test_a_position_that_just_reaches_a_ratio_counts_for_its_cut(small_pool: tuple[Task, PositionPool]) -> None:
    """Position 0 reaches the first cut to rounding and the second surely: it alone hits both."""
    hitting = HittingSet(*small_pool)
    heights = np.zeros((10, 2))
    heights[:2, 0], heights[0, 1] = (1.0 - 1e-11, 2.0), 2.0
    hitting._height, hitting._measured_height = heights / 2.0, np.zeros(2)
    least, answer = hitting.least_count(2.0)
    assert 1.0 - 1e-8 <= least <= 1.0
    assert answer == pytest.approx(np.eye(10)[0])
