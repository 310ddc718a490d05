"""The least largest residual by exchange of rows, against linear programmes and its own proof."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from trihedron.tools.bounded import Corner, Growth, Polytope, any_centre, chebyshev_radius, exchanged, programmes


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(["normal", "at its bound", "whole numbers"]))
def test_what_is_found_is_that_of_the_programme_and_is_proven(seed, kind):
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(1, 9)), int(rng.integers(12, 90))
    matrix, target = rng.normal(size=(rows, columns)) * 10.0 ** rng.uniform(-6, 6, columns), rng.normal(size=rows)
    target = {"normal": target, "at its bound": np.sign(target), "whole numbers": np.round(3 * target)}[kind]
    solution = exchanged(matrix, target)
    radius = chebyshev_radius(matrix, target, np.ones(rows))[0]
    assert any_centre(matrix, target, np.ones(rows))[0] == pytest.approx(radius, rel=1e-9)
    assert solution is not None
    assert solution.radius == pytest.approx(radius, rel=1e-9)
    assert np.abs(target - matrix @ solution.x).max() == pytest.approx(radius, rel=1e-9)
    # No x misses these rows by less: their weights cancel in every column.
    multipliers = solution.multipliers
    assert np.abs(multipliers).sum() == pytest.approx(1.0, rel=1e-12)
    assert multipliers @ target[solution.rows] == pytest.approx(radius, rel=1e-9)
    assert np.abs(multipliers @ matrix[solution.rows]) == pytest.approx(0.0, abs=1e-10 * np.abs(matrix).max())


def test_columns_that_depend_on_each_other_are_left_to_the_programme():
    matrix, target = np.random.default_rng(1).normal(size=(30, 3)), np.random.default_rng(2).normal(size=30)
    solution = exchanged(matrix, target)
    assert solution is not None
    for extra in (matrix[:, :1], np.zeros((30, 1)), matrix[:, 1:2] + 1e-12 * matrix[:, 2:]):
        wider = np.hstack((matrix, extra))
        assert exchanged(wider, target) is None
        assert any_centre(wider, target, np.ones(30))[0] == pytest.approx(solution.radius, rel=1e-9)
    for few in (matrix[:3], matrix[:, :0]):
        assert exchanged(few, target[: len(few)]) is None


@pytest.mark.parametrize("paid", [False, True])
def test_of_many_rows_few_are_given_to_the_solver(paid, monkeypatch):
    """The result equals that of all rows, with duals that prove it."""
    rng = np.random.default_rng(3)
    jacobian, residual, bound = rng.normal(size=(3000, 6)), rng.normal(size=3000), rng.uniform(0.5, 2.0, 3000)
    ends = np.append(np.full(5, np.inf), 1.0)
    rate = np.hstack((np.zeros((3000, 5)), rng.uniform(0.0, 0.3, (3000, 1))))
    growth = Growth(np.zeros(3000), rate, np.append(np.full(5, -np.inf), 0.0), ends) if paid else None
    solved, counts = programmes._chebyshev, []
    monkeypatch.setattr(programmes, "_chebyshev", lambda rows, *extra: counts.append(len(rows)) or solved(rows, *extra))
    radius, x, duals = chebyshev_radius(jacobian, residual, bound, growth=growth)
    assert counts == [] if not paid else max(counts) < 1000
    monkeypatch.setattr(programmes, "MANY_ROWS", 5000)
    assert radius == pytest.approx(chebyshev_radius(jacobian, residual, bound, growth=growth)[0], rel=1e-9)
    grown = growth.at(x) if growth else 0.0
    assert ((np.abs(residual - jacobian @ x) - grown) / bound).max() <= radius * (1 + 1e-9)
    if not paid:
        assert np.abs(duals @ jacobian).max() < 1e-10
        assert duals @ residual / (np.abs(duals) @ bound) == pytest.approx(radius, rel=1e-9)


@pytest.mark.acceptance
@settings(max_examples=40)
@given(st.integers(0, 10**6), st.sampled_from(["normal", "whole numbers", "apart"]))
def test_the_vertex_that_goes_farthest_is_that_of_the_solver_and_is_proven(seed, kind):
    rng = np.random.default_rng(seed)
    columns, rows = int(rng.integers(1, 9)), int(rng.integers(12, 90))
    matrix, middle, half = rng.normal(size=(rows, columns)), rng.normal(size=rows), rng.uniform(0.5, 2.0, rows)
    if kind == "whole numbers":
        # Many vertices go equally far, and more rows meet than there are columns.
        matrix, middle, half = np.round(2 * matrix), 0.0 * middle, np.ones(rows)
        matrix[:columns] = np.eye(columns)
    elif kind == "apart":
        # Two blocks: the other one is arbitrary.
        matrix[::2, : columns // 2], matrix[1::2, columns // 2 :] = 0.0, 0.0
    middle = matrix @ rng.normal(size=columns) + 0.3 * half * np.sin(middle)
    corner, vertices = Corner.of(matrix), []
    weights = matrix[:1].sum(axis=0) if kind == "apart" else rng.normal(size=columns)
    if corner is None or not weights.any():
        return
    for toward in (weights, -weights, matrix[-1], weights):
        vertices.append(corner.farthest(matrix, middle, half, toward))
    solver = Polytope(matrix, np.ones(rows))
    solver._corner = None
    solver.confine(middle - half, middle + half)
    for vertex, toward in zip(vertices, (weights, -weights, matrix[-1], weights), strict=True):
        assert vertex is not None
        assert toward @ vertex.x == pytest.approx(solver.maximise(toward)[0], abs=1e-8)
        assert (np.abs(matrix @ vertex.x - middle) <= half + 1e-9).all()
        # By the weights of the rows that meet, nothing goes farther.
        assert vertex.duals @ matrix[vertex.rows] == pytest.approx(toward, abs=1e-10)
        most = vertex.duals @ middle[vertex.rows] + np.abs(vertex.duals) @ half[vertex.rows]
        assert most == pytest.approx(toward @ vertex.x, abs=1e-8)
    # From any start the walk ends at the same vertex of all that go equally far.
    assert vertices[0].x == pytest.approx(vertices[-1].x, abs=1e-9)


@pytest.mark.parametrize("rows", [36, 3000])
def test_many_directions_have_the_vertices_of_each_alone(rows):
    rng = np.random.default_rng(rows)
    matrix, scale = rng.normal(size=(rows, 9)), rng.uniform(0.5, 2.0, rows)
    middle = matrix @ rng.normal(size=9)
    alone, together = Polytope(matrix, scale), Polytope(matrix, scale)
    for polytope in (alone, together):
        polytope.confine(middle - scale, middle + scale)
    weights = [*rng.normal(size=(20, 9)), np.zeros(9), matrix[3], -matrix[3]]
    for row, (value, x, duals) in zip(weights, together.maximise_each(weights), strict=True):
        expected = alone.maximise(row)
        assert value == expected[0]
        assert np.array_equal(x, expected[1])
        assert np.array_equal(duals, expected[2])


def test_rows_that_leave_nothing_and_columns_that_are_not_determined_are_left_to_the_solver():
    matrix = np.array([[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]])
    corner = Corner.of(matrix)
    assert corner is not None
    assert corner.farthest(matrix, np.array([0.0, 0.0, 5.0]), np.ones(3), np.array([1.0, 0.0])) is None
    assert Corner.of(matrix[:, :1] * np.ones((1, 2))) is None
    assert Corner.of(matrix[:1]) is None
