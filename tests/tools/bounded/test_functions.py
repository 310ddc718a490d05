"""Functions that bounds leave possible: attained ends, truths inside, parts that parameters imitate."""

import numpy as np
import pytest
from scipy.optimize import linprog

from trihedron.tools.bounded import Band, Functions, Unknown

TURN = 2.0 * np.pi


def hats(values: np.ndarray, knots: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(values, knots, unit) for unit in np.eye(len(knots))], axis=1)


def assert_in_band(functions: Functions, truth: np.ndarray) -> Band:
    """Check that every value of the truth, without the part that parameters imitate, is between the ends."""
    band, shown = functions.band(np.arange(len(truth))), functions.told(truth)
    assert (band.low - 1e-9 <= shown).all()
    assert (shown <= band.high + 1e-9).all()
    return band


def straight(q: np.ndarray, **more) -> tuple[np.ndarray, Unknown]:
    """Return parameters that are a line and a jumping column, and a function of q (N,)."""
    jumping = np.cos(40.0 * np.arange(len(q)) ** 2)
    knots = np.unique(q)
    return np.stack((np.ones_like(q), q, jumping), axis=1), Unknown(knots, hats(q, knots), **more)


@pytest.mark.parametrize("shape", [lambda q: q**5, lambda q: np.exp(-(((q - 0.3) / 0.2) ** 2)), np.abs, np.sin])
def test_the_truth_is_in_the_band_and_lines_are_no_part_of_it(shape):
    random = np.random.default_rng(3)
    q = np.sort(random.uniform(-1.0, 1.0, 40))
    jacobian, unknown = straight(q)
    truth = 6.0 * shape(q)
    residual = truth + jacobian @ [3.0, -5.0, 2.0] + random.uniform(-1.0, 1.0, len(q))
    functions = Functions(jacobian, residual, np.ones(len(q)), unknown)
    assert_in_band(functions, truth)
    shown = functions.told(truth)
    assert functions.imitated.shape[1] == 2
    assert functions.told(truth + 3.0 - 4.0 * q) == pytest.approx(shown, abs=1e-9)
    assert np.polyfit(q, shown, 1) == pytest.approx([0.0, 0.0], abs=1e-9)


def test_a_parabola_read_between_knots_is_in_the_band():
    """The noise is on one side, which excludes the straight lines between the parabola's values at the knots."""
    q, knots = np.linspace(-1.0, 1.0, 200), np.linspace(-1.0, 1.0, 9)
    cell = np.clip(np.searchsorted(knots, q), 1, 8)
    between = (q - knots[cell - 1]) * (knots[cell] - q) / (knots[cell] - knots[cell - 1]) / 2.0
    residual, jumping = 80.0 * q**2 - 0.999, np.cos(40.0 * np.arange(200) ** 2)[:, None]
    for missed in (None, between):
        functions = Functions(jumping, residual, np.ones(200), Unknown(knots, hats(q, knots), between=missed))
        band = functions.band(np.arange(9))
        assert band.bending > Unknown(knots, hats(q, knots)).bending(80.0 * knots**2)
        inside = (band.low <= functions.told(80.0 * knots**2)) & (functions.told(80.0 * knots**2) <= band.high)
        assert inside.all() == (missed is not None)


def test_ends_are_those_of_one_programme_written_out():
    """The unknowns are two parameters, the function's values, the size of each change of slope."""
    random = np.random.default_rng(5)
    q = np.linspace(0.0, 1.0, 12)
    jacobian, unknown = straight(q)
    residual = 3.0 * np.abs(q - 0.4) + random.uniform(-0.1, 0.1, len(q))
    functions = Functions(jacobian, residual, np.full(len(q), 0.1), unknown)
    band = functions.band(np.arange(len(q)))
    slopes = np.diff(np.eye(12), axis=0) / np.diff(q)[:, None]
    changes = np.diff(slopes, axis=0)
    rows = np.block(
        [
            [jacobian, np.eye(12), np.zeros((12, 10))],
            [-jacobian, -np.eye(12), np.zeros((12, 10))],
            [np.zeros((10, 3)), changes, -np.eye(10)],
            [np.zeros((10, 3)), -changes, -np.eye(10)],
            [np.zeros((1, 15)), np.ones((1, 10))],
        ]
    )
    level = np.hstack((np.zeros((2, 3)), np.stack((np.ones(12), q)), np.zeros((2, 10))))
    most = np.concatenate((residual + 0.1, 0.1 - residual, np.zeros(20), [band.bending]))
    ends = [(None, None)] * 15 + [(0.0, None)] * 10
    for k in range(12):
        cost = np.zeros(25)
        cost[3 + k] = 1.0
        low, high = (
            sign * linprog(sign * cost, rows, most, level, np.zeros(2), bounds=ends).fun for sign in (1.0, -1.0)
        )
        assert (band.low[k], band.high[k]) == pytest.approx((low, high), abs=1e-7)


def test_what_bends_least_is_a_line_where_a_line_will_do():
    q = np.linspace(0.0, 2.0, 15)
    jacobian, unknown = straight(q)
    residual = 0.5 * np.cos(40.0 * np.arange(15) ** 2)
    least, bending = Functions(jacobian, residual, np.ones(15), unknown).least()
    assert bending == pytest.approx(0.0, abs=1e-8)
    assert least == pytest.approx(0.0, abs=1e-6)


def test_a_function_round_a_circle_has_no_ends():
    """A wave that is shifted along the circle bends as much, wherever its first knot lies."""
    random = np.random.default_rng(8)
    angle = np.sort(random.uniform(0.0, TURN, 30))
    columns = np.stack([np.interp(angle, np.append(angle, angle[0] + TURN), u) for u in np.eye(30, 31)], axis=1)
    columns[0, 0] = 1.0
    unknown = Unknown(angle, columns, period=TURN)
    bends = [unknown.bending(np.cos(2.0 * (angle - shift))) for shift in (0.0, 1.0, 2.0, 3.0)]
    assert bends == pytest.approx([TURN * 16.0] * 4, rel=0.1)
    functions = Functions(np.ones((30, 1)), 5.0 * np.cos(2.0 * angle), np.ones(30), unknown)
    assert functions.imitated.shape[1] == 1
    assert_in_band(functions, 5.0 * np.cos(2.0 * angle))


def test_a_step_is_limited_by_its_size_not_by_its_slope():
    random = np.random.default_rng(9)
    q = np.linspace(0.0, 1.0, 25)
    jacobian, unknown = straight(q, steps=True)
    truth = 6.0 * (q > 0.43)
    residual = truth + random.uniform(-1.0, 1.0, 25)
    functions = Functions(jacobian[:, :1], residual, np.ones(25), unknown)
    _least, bending = functions.least()
    assert 4.0 - 1e-9 <= bending <= 6.0 + 1e-9
    band = assert_in_band(functions, truth)
    early, late = q < 0.4, q > 0.5
    assert band.low[late].min() > band.high[early].max() - 4.0


def test_rounding_of_what_parameters_imitate_is_no_freedom_to_bend():
    """Imitate a line and a constant except for rounding: a function in steps still pays for its bends."""
    random = np.random.default_rng(8)
    q = np.linspace(-1.0, 1.0, 60)
    jacobian, unknown = straight(q, steps=True)
    columns = unknown.columns * (1.0 + 3e-8 * random.normal(size=unknown.columns.shape))
    functions = Functions(
        jacobian, 4.0 * (q > 0.2) + random.uniform(-1.0, 1.0, 60), np.ones(60), Unknown(q, columns, steps=True)
    )
    values, bending = functions.least()
    jumps = np.diff(values)
    # All steps alike are a line, which the model imitates.
    assert bending == pytest.approx(np.abs(jumps - np.median(jumps)).sum(), rel=1e-4)
