"""Moves of the axes keep their limits, arrive, and do not depend on where steps fall."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from trihedron.models.table_commands import AXIS_PLAN_SIZE, follow_move, move_duration, phase_ends, plan_move

angles = st.floats(-7.0, 7.0)
limits = st.floats(0.01, 3.0)


def planned(distance: float, rate: float, max_rate: float, max_acceleration: float) -> list[float]:
    plan = [0.0] * (2 * AXIS_PLAN_SIZE)
    plan_move(plan, 0, 0.0, 0.0, rate, distance, max_rate, max_acceleration)
    return plan


def at(plan: list[float], max_acceleration: float, time: float) -> tuple[float, float]:
    motion = [0.0] * 4
    follow_move(plan, 0, max_acceleration, time, motion)
    return motion[0], motion[1]


@given(angles, st.floats(-1.0, 1.0), limits, limits)
def test_a_move_keeps_its_limits_is_continuous_and_arrives(distance, fraction, max_rate, max_acceleration):
    rate = fraction * max_rate
    plan = planned(distance, rate, max_rate, max_acceleration)
    duration = plan[4] + plan[5] + plan[6]
    before = at(plan, max_acceleration, 0.0)
    assert before == pytest.approx((0.0, rate), abs=1e-12)
    pieces = 200
    for i in range(1, pieces + 1):
        now = at(plan, max_acceleration, duration * i / pieces)
        step = duration / pieces
        assert abs(now[1]) <= max_rate * (1 + 1e-12)
        assert abs(now[1] - before[1]) <= max_acceleration * step * (1 + 1e-9) + 1e-12
        # Between two moments the rate is nearly linear, so its mean gives the turn up to a kink.
        assert abs(now[0] - before[0] - 0.5 * (now[1] + before[1]) * step) <= 0.26 * max_acceleration * step**2 + 1e-12
        before = now
    assert at(plan, max_acceleration, duration * (1 + 1e-12)) == (distance, 0.0)


@given(angles, limits, limits, st.floats(0.05, 0.95))
def test_planning_anew_on_the_way_changes_nothing(distance, max_rate, max_acceleration, fraction):
    plan = planned(distance, 0.0, max_rate, max_acceleration)
    duration = plan[4] + plan[5] + plan[6]
    moment = fraction * duration
    angle, rate = at(plan, max_acceleration, moment)
    again = [0.0] * (2 * AXIS_PLAN_SIZE)
    plan_move(again, 0, moment, angle, rate, distance, max_rate, max_acceleration)
    assert again[4] + again[5] + again[6] == pytest.approx(duration - moment, abs=1e-6 * (1 + duration))


def test_durations_by_hand():
    # triangle: 2 sqrt(d/a); trapezoid: d/v + v/a
    assert move_duration(1.0, 10.0, 1.0) == pytest.approx(2.0, rel=1e-15)
    assert move_duration(-6.0, 1.0, 0.5) == pytest.approx(6.0 + 2.0, rel=1e-15)
    assert move_duration(0.0, 1.0, 1.0) == 0.0


def test_ends_of_phases_come_in_order():
    plan = planned(3.0, 0.0, 1.0, 0.5)
    plan_move(plan, 1, 0.0, 0.0, 0.0, -1.0, 1.0, 0.5)
    times = [0.0] * 10
    count = phase_ends(plan, 0.0, 10.0, times)
    assert times[:count] == sorted(times[:count])
    # outer: speeds up to 2 s, cruises to 3 s, brakes to 5 s; inner: sqrt(2) s and 2 sqrt(2) s
    assert times[:count] == pytest.approx([0.0, math.sqrt(2), math.sqrt(2), 2.0, 2 * math.sqrt(2), 3.0, 5.0, 10.0])
