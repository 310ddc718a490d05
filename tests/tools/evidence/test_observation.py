"""Errors of pieces as a linear functional of additions, against sums written step by step."""

import numpy as np
import pytest

from trihedron.tools.evidence import Observation
from trihedron.tools.evidence.observation import Group, OnKnots
from trihedron.tools.evidence.rows import Pieces

STEPS = 40
RNG = np.random.default_rng(11)
FIRST, LAST = np.array([0, 5, 17, 5]), np.array([9, 30, 40, 6])
PIECES = Pieces("turns", "turns", FIRST, LAST)
GAIN, MEAN = RNG.normal(size=(2, len(FIRST), 2, 3))
ADDS = RNG.normal(size=(STEPS, 3, 3))
RESTING = RNG.uniform(size=STEPS) < 0.3


def test_errors_sum_what_is_added_within_a_piece_less_the_mean_at_rest():
    added = RNG.normal(size=(STEPS, 3, 2))
    errors = Observation((Group(PIECES, GAIN, MEAN),), ADDS, RESTING).of(added)
    mean = added[RESTING].sum(axis=0) / RESTING.sum()
    for piece, (first, last) in enumerate(zip(FIRST, LAST, strict=True)):
        total = sum(ADDS[step] @ added[step] for step in range(first, last))
        expected = GAIN[piece] @ total - MEAN[piece] @ mean
        assert errors[2 * piece : 2 * piece + 2] == pytest.approx(expected, abs=1e-12)


def test_what_stands_at_a_row_counts_at_both_ends_and_turns_in_between():
    ends, added = RNG.normal(size=(STEPS + 1, 3, 4)), RNG.normal(size=(STEPS + 1, 4, 2))
    errors = Observation((Group(PIECES, GAIN),), ADDS, ends=ends).of(added)
    for piece, (first, last) in enumerate(zip(FIRST, LAST, strict=True)):
        total = ends[last] @ added[last] - ends[first] @ added[first]
        for step in range(first, last):
            total = total + 0.5 * ADDS[step] @ (ends[step] @ added[step] + ends[step + 1] @ added[step + 1])
        assert errors[2 * piece : 2 * piece + 2] == pytest.approx(GAIN[piece] @ total, abs=1e-12)


def test_what_sets_in_after_a_row_adds_from_there_on():
    added = RNG.normal(size=(STEPS, 3, 2))
    observation = Observation((group := Group(PIECES, GAIN),), ADDS)
    for row in (0, 6, 20, STEPS):
        later = added * (np.arange(STEPS) >= row)[:, None, None]
        columns = group.since(observation.sums(added), observation.mean(added), row)
        assert columns.reshape(-1, 2) == pytest.approx(observation.of(later), abs=1e-12)


@pytest.mark.parametrize("port", [0, 2])
def test_functions_on_knots_are_what_their_values_add_at_one_port(port):
    observation = Observation((Group(PIECES, GAIN, MEAN),), ADDS, RESTING)
    values, functions = RNG.uniform(-1.0, 1.0, STEPS), OnKnots(np.linspace(-1.0, 1.0, 7))
    added = np.zeros((STEPS, 3, 7))
    added[:, port] = functions.at(values)
    (errors,) = observation.of_functions(functions.weights(values), 7, port)
    assert errors.reshape(-1, 7) == pytest.approx(observation.of(added), abs=1e-12)


@pytest.mark.parametrize("resting", [None, RNG.uniform(size=5000) < 0.3], ids=["none at rest", "some at rest"])
@pytest.mark.parametrize("times", [1.0, RNG.normal(size=5000)], ids=["alone", "with a factor"])
def test_functions_of_many_rows_have_the_bits_of_their_weights(resting, times):
    adds, values = RNG.normal(size=(5000, 3, 3)), np.round(np.cumsum(RNG.normal(size=5000)), 1)
    first = np.sort(RNG.integers(0, 4500, 60))
    pieces = Pieces("turns", "turns", first, first + RNG.integers(1, 500, 60))
    gain, mean = RNG.normal(size=(2, 60, 2, 3))
    observation = Observation((Group(pieces, gain, None if resting is None else mean),), adds, resting)
    # One knot is a value, others lie between: the ends are the least and the greatest.
    knots = np.linspace(values.min(), values.max(), 64)
    knots[np.abs(knots).argmin()] = 0.0
    (errors,) = observation.on_knots(knots, values, times, 1)
    weights = [(knot, times * weight) for knot, weight in OnKnots(knots).weights(values)]
    (expected,) = observation.of_functions(weights, 64, 1)
    assert errors.tobytes() == expected.tobytes()


def test_no_signs_of_the_additions_give_a_larger_error_than_is_said():
    """Each component of the sums is taken at its largest."""
    observation = Observation((Group(PIECES, GAIN[:, :1]),), ADDS)
    weight, column = RNG.uniform(size=STEPS), np.zeros(STEPS, dtype=int)
    (largest,) = observation.largest.of_functions(((column, weight),), 1, 1)
    for piece, (first, last) in enumerate(zip(FIRST, LAST, strict=True)):
        slopes = np.abs(GAIN[piece, 0]) @ np.abs(ADDS[first:last, :, 1]).T
        exact = np.abs(GAIN[piece, 0] @ ADDS[first:last, :, 1].T) @ weight[first:last]
        assert largest[piece, 0, 0] == pytest.approx(slopes @ weight[first:last], abs=1e-12)
        assert exact <= largest[piece, 0, 0]
