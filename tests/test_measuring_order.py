"""The order of measurement keeps positions apart that a plan has twice."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trihedron.tools.planning.measuring_order import SAME_PLACE, apart
from trihedron.tools.planning.request import stored_counts, stored_positions


def neighbours_alike(order: np.ndarray, commands: np.ndarray) -> int:
    """How many positions come right after one in the same place."""
    return int((np.abs(np.diff(commands[order], axis=0)).max(axis=1) < SAME_PLACE).sum())


@pytest.mark.parametrize("count", stored_counts())
def test_every_plan_that_the_package_holds_makes_as_many_rests_as_positions(count):
    places = stored_positions(count)
    assert places is not None
    order = apart(np.arange(count), places.angle)
    assert sorted(order) == list(range(count))
    assert neighbours_alike(order, places.angle) == 0


@given(st.lists(st.integers(0, 5), min_size=1, max_size=20))
def test_they_are_kept_apart_wherever_there_are_enough_others(kinds):
    commands = np.array([[k, 0.0] for k in kinds], dtype=float)
    order = apart(np.arange(len(kinds)), commands)
    assert sorted(order) == list(range(len(kinds)))
    before = neighbours_alike(np.arange(len(kinds)), commands)
    after = neighbours_alike(order, commands)
    assert after <= before
    most = max(kinds.count(k) for k in kinds)
    if most <= len(kinds) // 3:
        assert after == 0


def test_an_order_without_repetitions_stays_as_it_is():
    commands = np.random.default_rng(0).uniform(-3.0, 3.0, (12, 2))
    order = np.random.default_rng(1).permutation(12)
    assert apart(order, commands).tolist() == order.tolist()
