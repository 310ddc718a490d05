"""The analytic centre: always possible, at the centre of all slacks, the same in any coordinates."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog

from trihedron.tools.bounded import Bounded, Possible, analytic_centre, central, central_programme

UNITS = np.array([1.0, 1e-4, 1e3, 1.0])


def problem(seed: int, rows: int = 24, columns: int = 4, units=UNITS) -> Bounded:
    """Return errors within bounds of different sizes about some x, and columns in very different units."""
    rng = np.random.default_rng(seed)
    bound = rng.uniform(1e-6, 1e-4, rows)
    jacobian = rng.normal(size=(rows, columns)) * np.resize(units, columns)
    truth = rng.normal(size=columns) * 1e-3 / np.resize(units, columns)
    return Bounded(jacobian, jacobian @ truth + rng.uniform(-1.0, 1.0, rows) * bound, bound)


def slacks(bounded: Bounded, x: np.ndarray) -> np.ndarray:
    """Return the slack of every row to its bound [1]."""
    return 1.0 - np.abs(bounded.residual - bounded.jacobian @ x) / bounded.bound


def solved(bounded: Bounded, **limits: np.ndarray) -> np.ndarray:
    x = analytic_centre(bounded, **limits)
    assert x is not None
    return x


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("rows", [6, 24, 1500])
def test_nothing_pulls_at_the_centre_and_it_is_inside(seed, rows):
    """The gradient of the sum of logarithms, written by hand, is zero beside its own terms."""
    bounded = problem(seed, rows)
    x = solved(bounded)
    assert slacks(bounded, x).min() > 0.0
    slack = bounded.residual - bounded.jacobian @ x
    terms = (1.0 / (bounded.bound - slack) - 1.0 / (bounded.bound + slack))[:, None] * bounded.jacobian
    np.testing.assert_array_less(np.abs(terms.sum(axis=0)), 1e-8 * np.abs(terms).max(axis=0))


def test_of_one_constant_by_hand():
    """Two readings 0 and 1 with bounds of 1 leave 0 to 1: by symmetry one half; the first twice, log'(2 − x²) balances:
    4 x / (1 − x²) = 2 (1 − x) / (1 − (1 − x)²), so 2 x² (2 − x) = (1 − x)² (1 + x)."""
    assert solved(Bounded(np.ones((2, 1)), np.array([0.0, 1.0]), np.ones(2))) == pytest.approx([0.5], abs=1e-9)
    x = solved(Bounded(np.ones((3, 1)), np.array([0.0, 0.0, 1.0]), np.ones(3)))[0]
    assert 2.0 * x**2 * (2.0 - x) == pytest.approx((1.0 - x) ** 2 * (1.0 + x), abs=1e-9)
    assert 0.0 < x < 0.5


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(5, 60))
def test_neither_coordinates_nor_where_it_begins_move_it(seed, rows):
    bounded = problem(seed, rows)
    rng = np.random.default_rng(seed + 1)
    turn = np.diag(1.0 / UNITS) @ np.linalg.qr(rng.normal(size=(4, 4)))[0] @ np.diag(10.0 ** rng.integers(-4, 5, 4))
    x = solved(bounded)
    second = turn @ solved(Bounded(bounded.jacobian @ turn, bounded.residual, bounded.bound))
    room = Possible(bounded.jacobian, bounded.residual - bounded.jacobian @ x, bounded.bound)
    size = np.array([room.reach(unit) for unit in np.eye(4)]) + 1e-12 / UNITS
    assert (np.abs(second - x) <= 1e-6 * size).all()
    # Each of the four columns may take its share of the least slack, and no more.
    start = x + 0.9 / 4 * slacks(bounded, x).min() * bounded.bound.min() / np.abs(bounded.jacobian).sum(axis=0)
    assert slacks(bounded, start).min() > 0.0
    assert (np.abs(solved(bounded, start=start) - x) <= 1e-6 * size).all()


def test_a_reading_listed_twice_moves_it_away_from_the_bound_of_that_reading():
    bounded = problem(5)
    x = solved(bounded)
    slack = slacks(bounded, x)
    row = int(slack.argmin())
    twice = [np.append(part, part[[row]], axis=0) for part in (bounded.jacobian, bounded.residual, bounded.bound)]
    moved = solved(Bounded(*twice))
    assert slacks(bounded, moved)[row] > 1.01 * slack[row]
    assert slacks(bounded, moved).min() > 0.0


def test_limits_count_like_bounds_and_hold():
    bounded = problem(7)
    x = solved(bounded)
    free = np.full(4, math.inf)
    for k in range(4):
        second = np.arange(4) == k
        least = Possible(bounded.jacobian, bounded.residual, bounded.bound).reach(-np.eye(4)[k])
        # from the centre, and from slightly above the least possible value
        for end in (x[k], -least + 0.01 * (x[k] + least)):
            limited = Bounded(bounded.jacobian, bounded.residual, bounded.bound, low=np.where(second, end, -free))
            inside = solved(limited)
            assert inside[k] > end
            assert inside[k] > x[k]
            assert slacks(limited, inside).min() > 0.0
            slack = limited.residual - limited.jacobian @ inside
            pull = (2.0 * slack / (limited.bound**2 - slack**2)) @ limited.jacobian
            expected = np.where(second, -1.0 / (inside[k] - end), 0.0)
            scale = np.abs((2.0 * slack / (limited.bound**2 - slack**2))[:, None] * limited.jacobian).max(axis=0)
            assert (np.abs(pull - expected) <= 1e-7 * scale).all()
    # a limit on both sides is a reading of its middle
    low, high = np.append(x[0] - 1e-7, -free[1:]), np.append(x[0] + 3e-7, free[1:])
    two_sided = solved(Bounded(bounded.jacobian, bounded.residual, bounded.bound, low, high))
    as_row = [
        np.append(bounded.jacobian, [np.eye(4)[0]], axis=0),
        np.append(bounded.residual, x[0] + 1e-7),
        np.append(bounded.bound, 2e-7),
    ]
    np.testing.assert_allclose(two_sided, solved(Bounded(*as_row)), rtol=1e-9)


def test_what_nothing_bounds_stays_at_zero_and_moves_nothing():
    bounded = problem(8, columns=3)
    padded = Bounded(np.column_stack((bounded.jacobian, np.zeros(24))), bounded.residual, bounded.bound)
    np.testing.assert_allclose(solved(padded), np.append(solved(bounded), 0.0), rtol=1e-9)
    open_limit = Bounded(padded.jacobian, padded.residual, padded.bound, low=np.array([-math.inf] * 3 + [0.0]))
    assert analytic_centre(open_limit) is None


def without_interior(seed: int) -> tuple[Bounded, np.ndarray]:
    """Noise exactly at its bound leaves one point; one more column, of a few rows, leaves a line."""
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(60, 4))
    noise = rng.choice([-1e-5, 1e-5], 60)
    jacobian[:, 3] = np.append(np.zeros(58), [1.0, 0.5])
    noise[58:] = [0.2e-5, -0.1e-5]
    truth = rng.normal(size=4) * 1e-3
    return Bounded(jacobian, jacobian @ truth + noise, np.full(60, 1e-5)), truth


@pytest.mark.parametrize("seed", range(3))
def test_a_set_without_interior_has_no_analytic_centre_but_a_middle(seed):
    bounded, truth = without_interior(seed)
    assert analytic_centre(bounded) is None
    # the line: |0.2e-5 − (x − truth)| ≤ 1e-5 and |−0.1e-5 − (x − truth) / 2| ≤ 1e-5
    ends = np.stack((truth, truth), axis=1)
    ends[3] += [-0.8e-5, 1.2e-5]
    stated = central(bounded, np.eye(4), ends)
    assert stated.estimator == "central programme"
    np.testing.assert_allclose(stated.x, [*truth[:3], truth[3] + 0.2e-5], atol=1e-13)
    assert central(problem(1), np.eye(4), np.zeros((4, 2))).estimator == "analytic centre"


@pytest.mark.parametrize("rows", [24, 1200])
def test_the_central_programme_is_possible_and_nothing_is_nearer_to_the_middles(rows):
    """Compare with another solver, with another formulation."""
    bounded = problem(3, rows, units=np.ones(1))
    weights = np.vstack((np.eye(4), [1.0, -1.0, 0.0, 0.5]))
    x = solved(bounded)
    room = Possible(bounded.jacobian, bounded.residual - bounded.jacobian @ x, bounded.bound)
    ends = np.array([[-room.reach(-w), room.reach(w)] for w in weights]) + (weights @ x)[:, None]
    stated = central_programme(bounded, weights, ends)
    middle, half = ends.mean(axis=1), 0.5 * np.diff(ends, axis=1).ravel()
    assert slacks(bounded, stated).min() > -1e-8
    distance = np.abs((weights @ stated - middle) / half).max()
    rows_of = np.hstack((bounded.jacobian / bounded.bound[:, None] * 1e-5, np.zeros((rows, 1))))
    target = (bounded.residual - bounded.jacobian @ x) / bounded.bound
    near = np.hstack((weights * 1e-5 / half[:, None], -np.ones((5, 1))))
    far = np.hstack((-weights * 1e-5 / half[:, None], -np.ones((5, 1))))
    about = (middle - weights @ x) / half
    second = linprog(
        [0.0] * 4 + [1.0],
        A_ub=np.vstack((rows_of, -rows_of, near, far)),
        b_ub=np.concatenate((1.0 + target, 1.0 - target, about, -about)),
        bounds=[(None, None)] * 4 + [(0.0, None)],
        method="highs-ds",
    )
    assert distance == pytest.approx(second.fun, abs=1e-5)


def test_a_limit_on_one_side_holds_in_the_central_programme():
    bounded = problem(9)
    x = solved(bounded)
    limited = Bounded(
        bounded.jacobian, bounded.residual, bounded.bound, low=np.append(x[0] + 1e-7, np.full(3, -math.inf))
    )
    ends = np.stack((x - 1e-6, x + 1e-6), axis=1)
    assert central_programme(limited, np.eye(4), ends)[0] >= x[0] + 1e-7 * (1.0 - 1e-6)
