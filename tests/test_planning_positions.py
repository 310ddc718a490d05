"""Common sets of positions: what they cost, against the published table; what setting errors do; proven bounds."""

from itertools import combinations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import linprog

from trihedron.models.bench import TARGETS
from trihedron.models.regressors import admissible, regressors
from trihedron.tools.calibration.model import parametrise
from trihedron.tools.calibration.targets import convention_targets
from trihedron.tools.planning.forms import sheets, x_from_targets
from trihedron.tools.planning.improvement import improve
from trihedron.tools.planning.places import Places, Task, clearances, task_of
from trihedron.tools.planning.pool import Pool, pool_of
from trihedron.tools.planning.position_bound import HittingSet, bound_positions
from trihedron.tools.planning.position_costs import costs
from trihedron.tools.planning.position_search import drawn, search
from trihedron.tools.planning.request import stored_positions
from trihedron.tools.planning.ridges import arcs_at, stack
from trihedron.tools.planning.rounding import rounded
from trihedron.tools.planning.setting_check import check_settings
from trihedron.tools.planning.symmetry import symmetries

SCALE, ZERO, SINGLE, SUM, THIRD = 2.0475623761398, 1.0475623761398, 1.00026989733961, 2.00053979467921, 1.02897485655299
OPTIMA = np.array([SINGLE, SINGLE, THIRD, *[SCALE] * 6, *[SUM] * 3, *[SINGLE] * 3, *[ZERO] * 3])
"""Optima over all angles, mounting identity, the tables' admissible set, 3e-3 and 1e-2: closed forms."""

EXACT = {"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10}

TABLE = {6: 2.8293, 7: 1.4467, 8: 1.1947, 9: 1.1501, 10: 1.1074, 11: 1.142, 12: 1.0301, 13: 1.082, 14: 1.0267}
TABLE |= {15: 1.023, 16: 1.0107, 17: 1.018, 18: 1.0082, 20: 1.0074, 24: 1.0048, 30: 1.0032}
"""Worst ratios known before, by number of positions: polished where they were, else from swaps on a pool."""


def tables_task(**options: object) -> Task:
    p = parametrise({"identity": np.eye(3)})
    known = {"bounds": (3e-3, 1e-2), "rule": "tables", "best": OPTIMA}
    return task_of(p, convention_targets(p, "A1"), **{**known, **options})  # pyright: ignore[reportArgumentType]


def stored(count: int) -> Places:
    places = stored_positions(count)
    assert places is not None
    assert len(places) == count
    return places


def own_costs(alpha: NDArray, beta: NDArray, counts: NDArray) -> NDArray:
    """Costs of the targets by another way: SciPy, the regressors of the paper, readings (N, 3) that count."""
    f = regressors(alpha, beta, np.eye(3))[counts] @ x_from_targets()
    found = []
    for k in range(len(TARGETS)):
        a = np.eye(18)[k]
        solved = linprog(np.ones(2 * len(f)), A_eq=np.hstack([f.T, -f.T]), b_eq=a, method="highs-ds", options=EXACT)
        found.append(solved.fun if solved.status == 0 else np.inf)
    return np.array(found)


@pytest.mark.parametrize("count", range(6, 31))
def test_stored_sets_are_at_least_as_good_as_what_was_known(count: int) -> None:
    """Recomputed from the stored angles without the planner's own costs."""
    alpha, beta = stored(count).angle.T
    certain = admissible(alpha, beta, np.eye(3), rule="tables")
    worst = float((own_costs(alpha, beta, certain) / OPTIMA).max())
    known = max((n for n in TABLE if n <= count), key=int)
    assert worst <= TABLE[known]
    assert costs(tables_task(), stored(count)).worst == pytest.approx(worst, rel=1e-8)


def test_twelve_positions() -> None:
    assert costs(tables_task(), stored(12)).worst <= 1.031


def test_local_improvement_from_the_set_that_was_known() -> None:
    """The published twelve positions, 1.0350, are improved below what polishing had reached, 1.0301."""
    known = [(9.46, 10.77), (91.37, 272.0), (92.89, 88.6), (94.63, 1.61), (171.42, 345.99), (181.4, 3.6)]
    known += [(189.78, 170.4), (319.67, 70.29), (267.02, 267.42), (264.45, 358.05), (349.28, 190.24), (358.6, 3.14)]
    task = tables_task()
    start = costs(task, Places(np.radians(known), np.zeros(12, dtype=int)))
    assert start.worst == pytest.approx(1.0350, abs=1e-4)
    assert len(start.readings.position) == 34
    better = improve(task, start, criterion="worst", radius=0.1)
    assert better.worst < 1.0301
    assert improve(task, start, criterion="mean", radius=0.1).mean < start.mean


def test_the_search_repeats_and_improves() -> None:
    task = tables_task()
    one, two = (search(task, 10, seed=3, starts=3) for _ in range(2))
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.best.places.angle, two.best.places.angle)
    assert one.best.worst < 1.5


def test_an_interrupted_search_keeps_its_best(monkeypatch: pytest.MonkeyPatch) -> None:
    task, calls = tables_task(), []

    def improved(task: Task, start, **options):
        calls.append(start)
        if len(calls) > 2:
            raise KeyboardInterrupt
        return start

    monkeypatch.setattr("trihedron.tools.planning.position_search.improve", improved)
    found = search(task, 12, starts=5, given=[stored(12)])
    assert found is not None
    assert (found.interrupted, found.starts) == (True, 2)
    assert found.best.worst <= 1.031


def test_reserve_holds_at_every_setting_error_within_it() -> None:
    """A reading that counts with a reserve is certain wherever the table stands within it."""
    task, bare = tables_task(reserve=np.radians(0.7)), tables_task()
    rng = np.random.default_rng(5)
    places = drawn(task, 400, rng)
    counts = clearances(task, places) > 0.0
    assert counts.any()
    for _ in range(50):
        moved = places.at(places.angle + np.radians(rng.uniform(-0.7, 0.7, places.angle.shape)))
        assert (clearances(bare, moved)[counts] > 0.0).all()
    for sense in combinations((-1.0, 1.0, -1.0, 1.0), 2):
        corner = places.at(places.angle + np.radians(0.7) * np.array(sense))
        assert (clearances(bare, corner)[counts] > 0.0).all()


def test_rounded_positions_stay_good() -> None:
    task = tables_task()
    found = rounded(task, costs(task, stored(8)), 0.5, "worst")
    degrees = np.degrees(found.places.angle) / 0.5
    np.testing.assert_allclose(degrees, degrees.round(), atol=1e-9)
    nearest = costs(task, found.places.at(np.radians(0.5 * np.round(np.degrees(stored(8).angle) / 0.5))))
    assert found.worst <= nearest.worst
    assert found.worst < 1.25


def test_symmetries_leave_the_worst_ratio_as_it_is() -> None:
    task = tables_task()
    group = symmetries(task)
    assert len(group) == 16
    before = costs(task, stored(9))
    for symmetry in group:
        after = costs(task, stored(9).at(symmetry.of(stored(9).angle)))
        np.testing.assert_allclose(np.sort(after.ratio), np.sort(before.ratio), rtol=1e-8)


def small_pool(task: Task) -> Pool:
    """The six positions of the stored set and few others, no images."""
    rng = np.random.default_rng(0)
    places = Places(np.vstack([stored(7).angle, drawn(task, 4, rng).angle]), np.zeros(11, dtype=int))
    whole = pool_of(task)
    from trihedron.tools.planning.places import readings

    given = readings(task, places)
    assert len(np.unique(given.position)) == 11
    return Pool(places, np.arange(11), given) if len(whole.places) else whole


def test_the_bound_against_all_sets_of_a_small_pool() -> None:
    """No set is better than the bound, and where all sets are counted the best one shows how far the bound is."""
    task = tables_task()
    pool = small_pool(task)
    sets = [costs(task, pool.places.chosen(list(rows))).worst for rows in combinations(range(11), 7)]
    bound = bound_positions(HittingSet(task, pool), 7, min(sets), 30)
    assert 1.0 < bound.ratio <= min(sets) * (1 + 1e-9)


def test_a_bound_on_the_whole_pool_is_below_what_was_found() -> None:
    task = tables_task()
    pool = pool_of(task, stored(7))
    bound = bound_positions(HittingSet(task, pool), 7, costs(task, stored(7)).worst, 6)
    assert 1.0 <= bound.ratio <= costs(task, stored(7)).worst
    assert bound.on == f"pool of {len(pool.places)} positions"


SETTING = {0.01: 1.0008, 0.05: 1.0036, 0.1: 1.0090, 0.25: 1.0220, 0.5: 1.0498, 1.0: 1.1001}
"""Setting error [deg] to cost of (4.2) over the programme's on the same actual angles, for the published positions."""


@pytest.mark.parametrize("error", SETTING)
def test_setting_errors_known_from_the_encoders(error: float) -> None:
    """On the actual angles the programme is unbiased, and costs no more above the plan than (4.2) did."""
    task, planned = tables_task(), stored(24)
    rng = np.random.default_rng(1)
    actual = planned.at(planned.angle + np.radians(rng.uniform(-error, error, planned.angle.shape)))
    exact = tables_task(rule="paper")
    again = costs(exact, actual)
    np.testing.assert_allclose(again.weights @ again.readings.regressor, np.eye(18), atol=1e-9)
    nominal = costs(exact, planned)
    assert (again.ratio / nominal.ratio).max() <= {1.0: 1.0834, 0.5: 1.0368}.get(error, SETTING[error])
    check = check_settings(task, planned, actual, 1e-5)
    assert check.largest_deg <= error * (1 + 1e-9)
    for k, one in enumerate(check.targets):
        assert one.solved == pytest.approx(float(again.ratio[k] * OPTIMA[k]), rel=1e-8)
        assert one.solved is not None
        assert one.compensated is None or one.solved <= one.compensated * (1 + 1e-9)


def test_advice_before_measuring() -> None:
    task, planned = tables_task(), stored(12)
    rng = np.random.default_rng(2)
    advice = []
    for error in (0.0, 1e-4, 0.05, 8.0):
        actual = planned.at(planned.angle + np.radians(rng.uniform(-error, error, planned.angle.shape)))
        advice.append(check_settings(task, planned, actual, 1e-5).advice)
    assert advice[:3] == ["tolerable", "tolerable", "compensate"]
    assert advice[3] in ("re-solve", "measure again")


def test_the_bias_of_the_plan_at_other_angles() -> None:
    """Σ|b| X^max is the greatest error of the plan's weights over parameters within X^max, reached at a corner."""
    task, planned = tables_task(), stored(9)
    actual = planned.at(planned.angle + np.radians(0.02))
    check = check_settings(task, planned, actual, 1e-5)
    plan = costs(task, planned)
    where, accelerometer = plan.readings.position, task.accelerometer[plan.readings.sheet]
    alpha, beta = actual.angle[where].T
    f = regressors(alpha, beta, np.eye(3))[np.arange(len(where)), accelerometer]
    largest = np.where(np.arange(18) < 3, 3e-3, 1e-2)
    to_x = np.linalg.inv(x_from_targets())
    rng = np.random.default_rng(0)
    for k, one in enumerate(check.targets):
        b = plan.weights[k] @ f - to_x[k]
        x = largest * np.sign(b)
        assert (plan.weights[k] @ (f @ x) - to_x[k] @ x) / 1e-5 == pytest.approx(one.bias, rel=1e-6)
        inside = largest * rng.uniform(-1, 1, 18)
        assert abs(plan.weights[k] @ (f @ inside) - to_x[k] @ inside) / 1e-5 <= one.bias * (1 + 1e-9)


@pytest.mark.acceptance
def test_twelve_positions_from_nothing() -> None:
    """Without the stored set: at or below 1.031, and within 3 % of what is proven on the pool."""
    task = tables_task()
    found = search(task, 12, seed=1, starts=60)
    assert found is not None
    assert found.best.worst <= 1.031
    bound = bound_positions(HittingSet(task, pool_of(task, found.best.places)), 12, found.best.worst, 60)
    assert found.best.worst <= 1.03 * bound.ratio
    print(f"\n12 positions: {found.best.worst:.6f}; {bound.ratio:.6f} proven on a {bound.on} by {bound.cuts} cuts")


def test_bounds_of_next_to_nothing_give_arcs_without_a_warning():
    """Where a form does not depend on β its arc ends nowhere, however large the ratio that says so."""
    found = sheets(parametrise({"identity": np.eye(3)}), bounds=(1e-320, 1e-320))
    among = stack(found, 1e-6)
    alpha = np.linspace(0.0, np.pi, 8)
    ends = [arcs_at(among, np.full(8, k), alpha).ends for k in range(len(found))]
    assert any(np.isfinite(own).all(axis=1).any() for own in ends)
