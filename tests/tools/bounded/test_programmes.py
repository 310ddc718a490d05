"""The linear programmes, on cases that can be solved by hand or by another solver."""

import numpy as np
import pytest
from scipy.optimize import linprog

from trihedron.tools.bounded import Growth, Polytope, SolverError, chebyshev_radius, programmes, proven_radius


def test_two_readings_by_hand():
    """The radius of one constant is half the distance; a repeated column and a zero column change nothing; any size
    works."""
    radius, x, duals = chebyshev_radius(np.ones((2, 1)), np.array([0.0, 2.0]), np.ones(2))
    assert [radius, *x, *duals] == pytest.approx([1.0, 1.0, -0.5, 0.5], abs=1e-12)
    jacobian = np.array([[1.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    assert chebyshev_radius(jacobian, np.array([0.0, 1.0, 1.0]), np.ones(3))[0] == pytest.approx(0.5, abs=1e-12)
    for size in (0.0, 1e-12, 1e-3, 1e7):
        radius, _, _ = chebyshev_radius(np.ones((2, 1)), np.array([-size, size]), np.array([1e-5, 1e-5]))
        assert radius == pytest.approx(size / 1e-5, rel=1e-9)
    programme = Polytope(np.array([[1.0], [2.0]]), np.array([0.1, 0.1]))
    programme.confine(np.array([-0.1, -0.1]), np.array([0.1, 0.1]))
    value, x, duals = programme.maximise(np.array([1.0]))
    assert [value, *x, *duals] == pytest.approx([0.05, 0.05, 0.0, 0.5], abs=1e-12)


UNITS = np.array([1.0, 1e-3, 1e3, 1.0, 1.0, 1.0])


@pytest.mark.parametrize("seed", range(5))
def test_radius_agrees_with_another_formulation_and_its_duals_prove_it(seed):
    rng = np.random.default_rng(seed)
    jacobian, residual = rng.normal(size=(30, 6)), rng.normal(size=30)
    bound = rng.uniform(1e-6, 1e-4, 30)
    residual *= bound
    radius, x, duals = chebyshev_radius(jacobian * UNITS, residual, bound)
    scaled, target = jacobian / bound[:, None] * 1e-5, residual / bound
    ones = np.ones((30, 1))
    reference = linprog(
        [*[0.0] * 6, 1.0],
        A_ub=np.vstack([np.hstack([scaled, -ones]), np.hstack([-scaled, -ones])]),
        b_ub=np.concatenate([target, -target]),
        bounds=[(None, None)] * 6 + [(0, None)],
    )
    assert radius == pytest.approx(reference.fun, rel=1e-7)
    worst = np.abs(residual - jacobian * UNITS @ x) / bound
    assert worst.max() == pytest.approx(radius, rel=1e-8)
    np.testing.assert_allclose(jacobian.T @ duals * 1e-5, 0, atol=1e-9)
    assert duals @ residual == pytest.approx(radius, rel=1e-9)
    assert np.abs(duals) @ bound == pytest.approx(1.0, rel=1e-9)
    # The few readings that prove it have the same radius alone.
    witness = np.abs(duals) * bound > 1e-9
    assert witness.sum() <= 7
    alone, _, _ = chebyshev_radius(jacobian[witness] * UNITS, residual[witness], bound[witness])
    assert alone == pytest.approx(radius, rel=1e-9)


def test_weights_are_unbiased_and_their_norm_is_the_value():
    rng = np.random.default_rng(4)
    jacobian, bound = rng.normal(size=(40, 5)), rng.uniform(1e-6, 2e-5, 40)
    programme = Polytope(jacobian, bound)
    programme.confine(-bound, bound)
    for weights in np.eye(5):
        value, _, duals = programme.maximise(weights)
        np.testing.assert_allclose(duals @ jacobian, weights, rtol=0, atol=1e-9)
        assert np.abs(duals) @ bound == pytest.approx(value, rel=1e-9)
        assert np.count_nonzero(duals) <= 5


def test_an_empty_set_is_an_error_and_not_a_number():
    programme = Polytope(np.ones((2, 1)), np.ones(2))
    programme.confine(np.array([0.0, 2.0]), np.array([1.0, 3.0]))
    with pytest.raises(SolverError):
        programme.maximise(np.array([1.0]))


@pytest.mark.parametrize("seed", range(3))
def test_taking_in_rows_gives_the_same_as_all_at_once(seed, monkeypatch):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(3000, 6)) * rng.choice([1.0, 0.01], (3000, 1))
    bound = 1e-5 * rng.uniform(1.0, 5.0, 3000)
    residual = rng.uniform(-1.0, 1.0, 3000) * bound
    solutions = []
    for many, block in ((10**9, 10**9), (100, 10**9), (100, 64)):
        monkeypatch.setattr(programmes, "MANY_ROWS", many)
        monkeypatch.setattr(programmes, "BLOCK", block)
        polytope = Polytope(jacobian, bound)
        polytope.confine(residual - bound, residual + bound)
        weights = np.random.default_rng(9).normal(size=(5, 6))
        solutions.append((chebyshev_radius(jacobian, residual, bound), [polytope.maximise(w) for w in weights]))
    for (radius, _, duals), tops in solutions[1:]:
        assert radius == pytest.approx(solutions[0][0][0], rel=1e-9)
        np.testing.assert_allclose(jacobian.T @ duals, 0.0, atol=1e-6)
        assert residual @ duals == pytest.approx(radius, rel=1e-8)
        for (value, x, phi), (reference, _, _) in zip(tops, solutions[0][1], strict=True):
            assert value == pytest.approx(reference, rel=1e-9)
            assert np.all(np.abs(residual - jacobian @ x) <= bound * (1 + 1e-8))
            assert len(phi) == len(bound)


@pytest.mark.parametrize("seed", range(6))
def test_duals_of_a_programme_bound_the_radius_of_one_nearly_alike(seed):
    """The proven value is never above the radius, for any change of the columns, and close to it for a small one."""
    rng = np.random.default_rng(seed)
    jacobian, residual = rng.normal(size=(30, 4)), rng.normal(size=30)
    column, change = rng.normal(size=30), rng.normal(size=30)
    bound, spread = rng.uniform(0.3, 1.0, 30), 0.05 * rng.uniform(0.0, 1.0, 30)

    def programme(moved: float, sign: float, largest: float = 3.0):
        rows = np.zeros((30, 5))
        rows[:, 4] = sign * spread * (1.0 + moved)
        low, high = np.full((2, 5), np.inf) * [[-1.0], [1.0]]
        low[4], high[4] = sorted((0.0, sign * largest))
        matrix = np.column_stack((jacobian, column + moved * change))
        return (matrix, residual, bound), Growth(np.zeros(30), rows, low, high)

    for sign in (1.0, -1.0):
        duals_of_first, growth = programme(0.0, sign)
        radius, _, duals = chebyshev_radius(*duals_of_first, growth=growth)
        assert proven_radius(*duals_of_first, growth, duals) == pytest.approx(radius, rel=1e-8)
        for moved in (0.01, 0.1, 0.5, 3.0):
            for largest in (0.2, 3.0):
                duals_of_first, growth = programme(moved, sign, largest)
                least = chebyshev_radius(*duals_of_first, growth=growth)[0]
                assert proven_radius(*duals_of_first, growth, duals) <= least + 1e-9
                if moved == 0.01 and largest == 3.0:
                    assert proven_radius(*duals_of_first, growth, duals) >= 0.9 * least


def test_what_goes_round_in_circles_is_a_stated_failure(monkeypatch: pytest.MonkeyPatch):
    """For one bench, the usual strategy cycled for ever on one programme, and the next one solved it at once."""
    rng = np.random.default_rng(3)
    jacobian, residual = rng.normal(size=(60, 8)), 0.1 * rng.normal(size=60)
    ends = residual - 1.0, np.append(residual[1:], np.inf) + 1.0

    def farthest() -> float:
        polytope = Polytope(jacobian, np.ones(60))
        polytope.confine(*ends)
        return polytope.maximise(np.ones(8))[0]

    expected = linprog(
        -np.ones(8), np.vstack((jacobian[:59], -jacobian)), np.append(ends[1][:59], -ends[0]), bounds=(None, None)
    )
    assert farthest() == pytest.approx(-expected.fun, rel=1e-9)
    monkeypatch.setattr(programmes, "LEAST_LIMIT", 0)
    monkeypatch.setattr(programmes, "MOST_ITERATIONS", 0)
    with pytest.raises(SolverError, match="limit"):
        farthest()


def test_a_space_is_there_where_the_faster_decomposition_fails(monkeypatch: pytest.MonkeyPatch):
    columns = np.random.default_rng(1).normal(size=(30, 4))

    def failing(*_, **__):
        raise np.linalg.LinAlgError("SVD did not converge")

    expected = programmes.column_space(columns)
    monkeypatch.setattr(np.linalg, "svd", failing)
    space = programmes.column_space(columns)
    assert space @ space.T == pytest.approx(expected @ expected.T, abs=1e-12)


@pytest.mark.parametrize("away", [0.0, 0.3, 30.0], ids=["about zero", "beside zero", "far from zero"])
def test_of_many_rows_those_near_a_point_tell_as_much_as_all(away):
    rng = np.random.default_rng(20)
    matrix, middle = rng.normal(size=(20_000, 5)), np.full(5, away)
    error = rng.uniform(-1.0, 1.0, len(matrix)) + matrix @ middle
    some, every = (Polytope(matrix, np.ones(len(matrix))) for _ in range(2))
    some.confine(error - 1.0, error + 1.0)
    every.confine(error - 1.0, error + 1.0)
    assert some._near is not None
    every._near = None
    for weights in rng.normal(size=(4, 5)):
        (reached, x, duals), (by_all, *_) = some.maximise(weights), every.maximise(weights)
        assert reached == pytest.approx(by_all, rel=1e-12)
        assert (np.abs(matrix @ x - error) <= 1.0 + 1e-9).all()
        assert duals @ matrix == pytest.approx(weights, abs=1e-9)
