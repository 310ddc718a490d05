"""The sets that bounded errors leave possible: no bound is too small, and an admissible point nearly attains each."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from other_solver import farthest, farthest_of_growing
from trihedron.tools.bounded import (
    BOUNDING,
    ENCLOSING,
    AnyOf,
    Growth,
    Polytope,
    Possible,
    chebyshev_radius,
    column_space,
    cosine,
    largest_length,
    least_squares,
    polar_intervals,
    same_space,
    spaces_beyond,
)
from trihedron.tools.bounded.possible import EDGE
from trihedron.tools.evidence.fit import Fit


def problem(seed: int, rows: int = 24, columns: int = 4):
    """Return errors at a fit, within bounds of different sizes, and columns in very different units."""
    rng = np.random.default_rng(seed)
    bound = rng.uniform(1e-6, 1e-4, rows)
    return (
        rng.normal(size=(rows, columns)) * [1.0, 1e-4, 1e3, 1.0][:columns],
        rng.uniform(-1.0, 1.0, rows) * bound,
        bound,
    )


@pytest.mark.parametrize("seed", range(4))
def test_ends_are_attained_and_nothing_is_beyond_them(seed):
    jacobian, residual, bound = problem(seed)
    possible = Possible(jacobian, residual, bound)
    for k, unit in enumerate(np.eye(4)):
        low, high = possible.ends(k)
        assert high == pytest.approx(farthest(jacobian, residual, bound, unit), rel=1e-6)
        assert high >= farthest(jacobian, residual, bound, unit) * (1.0 - 1e-12)
        assert -low == pytest.approx(farthest(jacobian, residual, bound, -unit), rel=1e-6)
    direction = np.array([0.3, -0.8])
    weights = np.array([0.0, *direction, 0.0])
    reach = possible.among(np.array([1, 2]))(direction)
    assert reach == pytest.approx(farthest(jacobian, residual, bound, weights), rel=1e-6)


def test_an_error_beyond_its_bound_is_allowed_as_much_and_hardly_more():
    jacobian, residual, bound = problem(7)
    residual[3] = 1.5 * bound[3]
    ends = Possible(jacobian, residual, bound).ends(0)
    for room, within in ((0.0, 1.0), (2.0 * EDGE, -1.0)):
        wider = Possible(jacobian, residual, np.where(np.arange(24) == 3, (1.5 + room) * bound, bound)).ends(0)
        assert within * (wider[0] - ends[0]) >= -1e-12 * abs(ends[0])
        assert within * (ends[1] - wider[1]) >= -1e-12 * abs(ends[1])
        assert wider == pytest.approx(ends, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("above", [0.0, 2e-9, 1e-8, 1e-5, 0.1])
def test_centre_and_ends_are_of_one_set_that_has_an_interior(seed, above):
    """Errors that are as large as the bound allows leave one point: by the slack of the bound there are more."""
    jacobian, residual, bound = problem(seed)
    radius, step, _ = chebyshev_radius(jacobian, residual, bound)
    bound = bound * radius / (1.0 + above)
    zero = np.zeros(4)
    fit = Fit((), (), zero, step, residual, bound, jacobian, 1.0 + above, zero, zero[:0])
    stated, ends = fit.centred().estimate, fit.ends()
    assert (ends[:, 0] <= stated).all()
    assert (stated <= ends[:, 1]).all()
    if above > 2e-9:
        # Both are inside by much more than programmes err.
        inside = np.minimum(stated - ends[:, 0], ends[:, 1] - stated)
        assert (inside > 0.1 * (ends[:, 1] - ends[:, 0])).all()
        left = np.abs(residual - jacobian @ stated)
        assert (left < np.maximum(bound, np.abs(fit.left) + EDGE * bound)).all()


def grown(rate, sign, size, column=0):
    """Return the growth by a coefficient's size, of one sign and up to a size, about a fit at which it is zero."""
    rows, low, high = np.zeros((len(rate), 4)), np.full(4, -np.inf), np.full(4, np.inf)
    rows[:, column] = sign * rate
    low[column], high[column] = sorted((0.0, sign * size))
    return Growth(np.zeros(len(rate)), rows, low, high)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("share", [0.3, 1.5], ids=["a little", "more than it moves"])
@pytest.mark.parametrize("most", [30.0, 0.2])
def test_bounds_that_grow_with_a_size_leave_the_union_over_its_signs(seed, share, most):
    jacobian, residual, bound = problem(seed)
    rng = np.random.default_rng(seed + 10)
    rate = share * np.abs(jacobian[:, 0]) * rng.integers(0, 2, 24)
    size = most * bound.max() / np.abs(jacobian[:, 0]).max()
    branches = [grown(rate, sign, size) for sign in (1.0, -1.0)]
    possible = Possible(jacobian, residual, bound, growths=branches)
    for weights in np.vstack((np.eye(4), [0.0, 0.3, -0.8, 0.0])):
        for signed in (weights, -weights):
            farthest = max(
                farthest_of_growing(jacobian, residual, bound, rate, sign, size, signed) for sign in (1.0, -1.0)
            )
            assert possible.reach(signed) == pytest.approx(farthest, rel=1e-6)
    # About another point of the first branch the set is the same.
    step = np.array([0.2 * size, 0.0, 0.0, 0.0])
    moved = Possible(jacobian, residual - jacobian @ step, bound, growths=[branch.moved(step) for branch in branches])
    if np.all(np.abs(residual - jacobian @ step) <= bound + branches[0].at(step)):
        assert moved.ends(0) == pytest.approx(np.subtract(possible.ends(0), step[0]), rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_radius_is_paid_for_by_the_size_that_it_takes(sign):
    """One reading is off by ten bounds and would be absorbed for nothing; its growth takes a size that others show."""
    jacobian, residual, bound = np.array([[0.0], [1.0], [1.0]]), np.array([10.0, 0.0, sign * 2.0]), np.ones(3)
    rate = np.array([1.0, 0.0, 0.0])
    growth = Growth(np.zeros(3), sign * rate[:, None], *np.sort([[0.0], [sign * 100.0]], axis=0))
    radius, step, _ = chebyshev_radius(jacobian, residual, bound, growth=growth)
    # 10 − c ≤ ρ and c ≤ ρ for a size c: the reading at rest pays half of it.
    assert (radius, sign * step[0]) == pytest.approx((5.0, 5.0))
    farthest = chebyshev_radius(
        jacobian, residual, bound, growth=Growth(growth.now, -growth.rows, -growth.high, -growth.low)
    )
    assert farthest[0] > 5.5
    assert chebyshev_radius(jacobian, residual, bound)[0] == pytest.approx(10.0)


def alike(seed: int, proofs: dict | None):
    """Return nine similar sets: their columns change little by little; the second branch of some is empty."""
    jacobian, residual, bound = problem(seed)
    rng = np.random.default_rng(seed + 20)
    change = 0.02 * rng.normal(size=jacobian.shape) * np.abs(jacobian).max(axis=0)
    rate = 0.1 * np.abs(jacobian[:, 0]) * rng.integers(0, 2, 24)
    size = 30.0 * bound.max() / np.abs(jacobian[:, 0]).max()
    for k in range(9):
        matrix = jacobian + k * change
        # The point needs a size of its first column that the other sign cannot give.
        step = np.array([(0.1 + 0.05 * k) * size, 0.0, 0.0, 0.0])
        branches = [grown(rate, sign, size).moved(step) for sign in (1.0, -1.0)]
        yield Possible(matrix, residual, bound, growths=branches, proofs={} if proofs is None else proofs)


@pytest.mark.parametrize("seed", range(4))
def test_what_bounds_one_set_bounds_the_union_of_those_alike_as_far_as_it_reaches(seed, monkeypatch):
    sets, solved = list(alike(seed, None)), []
    together = AnyOf(list(alike(seed, {})))
    directions = list(np.vstack((np.eye(4), -np.eye(4), [[0.0, 0.3, -0.8, 0.0]])))
    truth = [max(member.reach(weights) for member in sets) for weights in directions]
    maximise = Polytope.maximise
    monkeypatch.setattr(Polytope, "maximise", lambda *calls: solved.append(1) or maximise(*calls))
    for weights, end in zip(directions, truth, strict=True):
        assert together.reach(weights) == pytest.approx(end, rel=1e-9)
        # A set that goes no farther than `least` returns it, any other its reach.
        assert together.reach(weights, 1.01 * end) == 1.01 * end
        assert together.reach(weights, 0.99 * end) == pytest.approx(end, rel=1e-9)
    # This number would be a third of three questions for each set.
    assert len(solved) < len(directions) * len(sets)


def test_fewer_rows_leave_more_possible():
    jacobian, residual, bound = problem(8, rows=300)
    some, every = Possible(jacobian, residual, bound, most_rows=40), Possible(jacobian, residual, bound)
    assert len(some.matrix) == 40
    for k in range(4):
        assert some.ends(k)[0] <= every.ends(k)[0] < every.ends(k)[1] <= some.ends(k)[1]


def test_what_nothing_bounds_has_no_ends():
    jacobian, residual, bound = problem(9, columns=3)
    possible = Possible(np.column_stack((jacobian, jacobian[:, 0], np.zeros(24))), residual, bound)
    assert possible.ends(1)[1] < math.inf
    for column in (0, 3, 4):
        assert possible.ends(column) == (-math.inf, math.inf)
    assert polar_intervals(possible.among(np.array([3, 4])))[0] == (-math.inf, math.inf)


def of_points(points: np.ndarray):
    """Return the support function of a polygon with these corners (K, 2)."""
    return lambda direction, least=-math.inf: max(least, float((points @ direction).max()))


@settings(max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(0.1, 10.0))
def test_the_length_of_a_pair_is_bounded_whatever_its_direction(angle, length):
    """A corner halfway between two directions is the worst case: it attains the bound."""
    corner = length * np.array([[math.cos(angle), math.sin(angle)], [0.0, 0.0]])
    bound = largest_length(of_points(corner))
    assert length * (1.0 - 1e-12) <= bound <= length / math.cos(math.pi / BOUNDING) * (1.0 + 1e-12)


def test_the_bound_of_a_length_is_attained_between_two_directions():
    angle = math.pi / BOUNDING
    corner = np.array([[math.cos(angle), math.sin(angle)], [0.0, 0.0]])
    assert largest_length(of_points(corner)) == pytest.approx(1.0, rel=1e-12)


@settings(max_examples=60)
@given(st.floats(-math.pi, math.pi), st.floats(0.5, 3.0), st.floats(1e-3, 0.4))
def test_amplitude_and_phase_of_a_set_away_from_zero(angle, distance, size):
    """The corners of a small square about a point are within the intervals, which are hardly wider."""
    centre = distance * np.array([math.cos(angle), math.sin(angle)])
    corners = centre + size * distance * np.array([[1, 1], [1, -1], [-1, -1], [-1, 1]]) / 2.0
    (low, high), (begin, end) = polar_intervals(of_points(corners))
    lengths = np.linalg.norm(corners, axis=1)
    phases = [angle + math.remainder(math.atan2(y, x) - angle, 2.0 * math.pi) for x, y in corners]
    turn = 2.0 * math.pi * round((0.5 * (begin + end) - angle) / (2.0 * math.pi))
    assert lengths.max() <= high * (1.0 + 1e-12)
    assert high <= lengths.max() + 2.0 * size * distance * (1.0 / math.cos(math.pi / ENCLOSING) - 1.0) * 4.0
    # The nearest point of the square may lie on an edge.
    edge = min(np.linalg.norm(a + t * (b - a)) for a, b in zip(corners, np.roll(corners, 1, 0), strict=True)
               for t in np.linspace(0.0, 1.0, 101))  # fmt: skip
    assert low <= edge * (1.0 + 1e-12)
    turned = math.pi / ENCLOSING
    assert low >= edge * math.cos(turned) - 1.5 * size * distance * math.sin(turned)
    assert begin - turn <= min(phases) + 1e-12
    assert end - turn >= max(phases) - 1e-12
    assert end - begin <= (max(phases) - min(phases)) * 1.06 + 1e-9


def test_a_set_that_holds_zero_has_any_phase():
    square = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0]])
    (low, high), phase = polar_intervals(of_points(square))
    assert (low, phase) == (0.0, (-math.pi, math.pi))
    assert high == pytest.approx(math.sqrt(2.0), rel=1e-12)


def test_spaces_do_not_depend_on_units_and_know_what_is_imitated():
    rng = np.random.default_rng(5)
    columns = rng.normal(size=(30, 4))
    assert same_space(column_space(columns), column_space(columns @ np.diag([1.0, 1e-6, 1e5, -1.0])))
    assert not same_space(column_space(columns[:, :2]), column_space(columns[:, 1:3]))
    assert column_space(np.column_stack((columns, columns[:, 0]))).shape == (30, 4)
    mixed, inside = columns[:, [0]] + columns[:, [1]], 2.0 * columns[:, [0]]
    beyond = spaces_beyond(columns[:, :1], [columns[:, [1]], mixed, inside])
    assert cosine(beyond[0], beyond[1]) == pytest.approx(1.0, abs=1e-12)
    assert beyond[2].shape == (30, 0)
    assert cosine(beyond[0], beyond[2]) == 0.0


def test_least_squares_leaves_what_nothing_determines_at_zero():
    rng = np.random.default_rng(6)
    matrix, x = rng.normal(size=(20, 3)) * [1.0, 1e-7, 1e6], np.array([1.0, -2e7, 5e-7])
    padded = np.column_stack((matrix, np.zeros(20)))
    np.testing.assert_allclose(least_squares(padded, matrix @ x), [*x, 0.0], rtol=1e-10)
    twice = np.column_stack((matrix[:, 0], matrix[:, 0]))
    np.testing.assert_allclose(least_squares(twice, matrix[:, 0]), [0.5, 0.5], rtol=1e-12)
