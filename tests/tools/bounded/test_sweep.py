"""The union of possible sets over all values of a number agrees with a programme at each of them."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from trihedron.tools.bounded import Possible, Rows, Swept, apart, chebyshev_radius, largest_sizes, open_ranges

LIMIT = 1.0 + 1e-7


def drawn(seed: int, spread: float) -> Rows:
    """Draw rows of three columns, and two that change with 60 values of a number along a curve; noise within bounds."""
    rng = np.random.default_rng(seed)
    fixed, moving, bound = rng.normal(size=(80, 5)), np.zeros((80, 2)), rng.uniform(0.5, 1.5, 80)
    moving[:30] = rng.normal(size=(30, 2))
    part = np.linspace(-1.0, 1.0, 60)[:, None, None]
    ways = spread * (part * rng.normal(size=(2, 2)) + part**2 * rng.normal(size=(2, 2)))
    rows = Rows(fixed, moving, ways, np.array([3, 4]), np.zeros(80), bound)
    true = rows.matrix(int(rng.integers(60))) @ rng.normal(size=5)
    return Rows(fixed, moving, ways, rows.moving_columns, true + bound * rng.uniform(-1.0, 1.0, 80), bound)


def standing_at(rows: Rows) -> dict[int, tuple[Possible, NDArray]]:
    """Return a set for each value that stands, with its centre."""
    standing = {}
    for way in range(len(rows.ways)):
        radius, x, _ = chebyshev_radius(rows.matrix(way), rows.residual, rows.bound)
        if radius <= LIMIT:
            standing[way] = Possible(rows.matrix(way), rows.residual - rows.matrix(way) @ x, rows.bound), x
    return standing


@pytest.mark.first(1)
@pytest.mark.parametrize("spread", [0.1, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_union_reaches_as_far_as_the_farthest_of_its_values(seed: int, spread: float) -> None:
    rows = drawn(seed, spread)
    swept, single = Swept(rows, LIMIT, np.zeros(5)), standing_at(rows)
    for way, radius in swept.search():
        assert (radius <= LIMIT) == (way in single)
    assert not swept.refused[list(single)].any()
    shared = {}
    enclosing = swept.beside(np.zeros(5), np.arange(80), 0.0, None, shared)
    for weights in np.vstack((np.eye(5), -np.eye(5), [[1.0, -0.5, 0.2, 0.7, 0.3]])):
        most = max(possible.reach(weights) + weights @ x for possible, x in single.values())
        for union in (swept, enclosing):
            assert union.bounded(weights) >= most - 1e-6
            assert union.reach(weights) == pytest.approx(most, abs=1e-6)
            assert union.reach(weights, most + 1.0) == pytest.approx(most + 1.0)
            assert union.bounded(weights) == pytest.approx(most, abs=1e-5)
        third = swept.beside(np.zeros(5), np.arange(80), 0.0, None, dict(shared))
        assert third.reach(weights, most - 0.02) == pytest.approx(most, abs=1e-6)
    assert len(swept.radii) < 40


@pytest.mark.parametrize("seed", range(3))
def test_with_further_columns_it_holds_what_each_value_leaves_of_them(seed: int) -> None:
    rows, further = drawn(seed, 0.3), np.random.default_rng(seed).normal(size=(80, 1))
    swept = Swept(rows, LIMIT, np.zeros(5))
    assert swept.tried(30) <= LIMIT or any(radius <= LIMIT for _, radius in swept.search())
    enclosing = swept.beside(np.zeros(5), np.arange(80), 0.0, further, {})
    low, high = enclosing.ends(5)
    for way, (_, x) in standing_at(rows).items():
        matrix = np.hstack((rows.matrix(way), further))
        one = Possible(matrix, rows.residual - matrix @ np.append(x, 0.0), rows.bound)
        assert low - 1e-6 <= one.ends(5)[0] <= one.ends(5)[1] <= high + 1e-6


def test_what_no_value_explains_is_refused_by_a_few_of_them() -> None:
    rows = drawn(1, 0.3)
    beyond = Rows(
        rows.fixed,
        rows.moving,
        rows.ways,
        rows.moving_columns,
        rows.residual + 9.0 * rows.bound * (-1.0) ** np.arange(80),
        rows.bound,
    )
    swept = Swept(beyond, LIMIT, np.zeros(5))
    for _ in swept.search():
        if swept.refused.all():
            break
    assert swept.refused.all()
    assert len(swept.radii) <= 12
    radii = [chebyshev_radius(beyond.matrix(way), beyond.residual, beyond.bound)[0] for way in range(60)]
    assert (swept.proven <= np.array(radii) * (1.0 + 1e-6)).all()


@pytest.mark.parametrize("seed", range(3))
def test_bounds_that_grow_hold_for_every_value_between(seed: int) -> None:
    """The number is continuous: along a parabola, whose error between two values follows from its bend."""
    rng, none = np.random.default_rng(seed), np.zeros(5)
    rows, bends, slopes = drawn(seed, 0.3), rng.normal(size=(2, 2)), rng.normal(size=(2, 2))

    def ways(part: NDArray) -> NDArray:
        return 0.3 * (part[:, None, None] * slopes + part[:, None, None] ** 2 * bends)

    values = np.linspace(-1.0, 1.0, 60)
    true = Rows(rows.fixed, rows.moving, ways(np.array([0.2345])), rows.moving_columns, rows.residual, rows.bound)
    read = true.matrix(0) @ (3.0 * rng.normal(size=5)) + rows.bound * rng.uniform(-1.0, 1.0, 80)
    rows = Rows(rows.fixed, rows.moving, ways(values), rows.moving_columns, read, rows.bound)
    error = np.abs(rows.moving @ (0.3 * bends)) * (values[1] - values[0]) ** 2 / 4.0
    far = apart(rows, error)
    sizes = largest_sizes(rows, LIMIT, far, np.full(2, 1e3))
    grown = Swept(
        Rows(rows.fixed, rows.moving, rows.ways, rows.moving_columns, read, rows.bound + far @ sizes), LIMIT, none
    )
    assert any(radius <= LIMIT for _, radius in grown.search())
    was_standing = 0
    for part in rng.uniform(-1.0, 1.0, 40):
        (way,) = ways(np.array([part]))
        matrix = rows.fixed.copy()
        matrix[:, rows.moving_columns] += rows.moving @ way
        nearest = int(np.abs(values - part).argmin())
        assert (np.abs(rows.moving @ (way - rows.ways[nearest])) <= far + 1e-12).all()
        radius, x, _ = chebyshev_radius(matrix, read, rows.bound)
        if radius > LIMIT:
            continue
        was_standing += 1
        assert grown.tried(nearest) <= LIMIT
        one = Possible(matrix, read - matrix @ x, rows.bound)
        for unit in np.vstack((np.eye(5), -np.eye(5))):
            own = one.reach(unit) + unit @ x
            assert own <= grown.reach(unit) + 1e-6
            assert not unit[3:].any() or own <= sizes @ np.abs(unit[3:])
    assert was_standing


@given(
    st.lists(st.integers(0, 400), max_size=60, unique=True),
    st.lists(st.tuples(st.integers(0, 399), st.integers(0, 4)), max_size=8),
)
def test_ranges_lose_nothing_that_stands_at_a_value(edges: list[int], standing: list[tuple[int, int]]) -> None:
    """A standing value is never refused in a range that contains it, so it is in the least range with it."""

    def stands(begin: int, end: int, among: Sequence[int]) -> Sequence[int]:
        return [k for k in among if any(begin <= value < end for value, one in standing if one == k)]

    least = sorted(edges)
    ranges = list(open_ranges(np.array(least, dtype=int), range(5), stands))
    assert [begin for begin, _, _ in ranges] == sorted(begin for begin, _, _ in ranges)
    for begin, end, _ in ranges:
        assert least.index(end) == least.index(begin) + 1
    for value, one in standing:
        if least and least[0] <= value < least[-1]:
            assert any(begin <= value < end and one in among for begin, end, among in ranges)
