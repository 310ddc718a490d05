"""Geometry of the two-axis table: what the block undergoes at given angles of the axes.

From the base the frame is turned by κ about axis 2 (the outer axis dips below the horizon), by α about the outer axis,
by ε about axis 2 (the inner axis leans towards +outer), by β about the inner axis, then by the mounting Q and the
mounting error ϑ; each an exact rotation.

Source: Golovan, Matasov, Tarygin 2022, section 1; to first order this is (1.3).
"""

import math

from ..motion import AXIS_PLAN_SIZE, follow_move
from ..restricted import (
    ALPHA,
    BETA,
    CONTEXT_SIZE,
    HOURS,
    SENSE_ALPHA,
    SENSE_BETA,
    TEMPERATURE,
    Vector,
)
from ..rotation import multiply, set_quaternion, to_body, turn, turn_by_vector


def geometry_effects(context: Vector, angles: Vector, effect: Vector, turns: Vector) -> float:
    """Stage "geometry": small turns (4,) [rad] that effects add: to κ, about the outer axis, to ε, about the inner one.

    Returns whether there are any (1.0 or 0.0); the nominal table adds nothing.
    """
    for i in range(4):
        turns[i] = 0.0
    return 0.0


def set_table_context(elapsed: float, temperature: float, angles: Vector, senses: Vector, context: Vector) -> None:
    """Write the circumstances of the table, `elapsed` [s] after the start, into the context."""
    for i in range(CONTEXT_SIZE):
        context[i] = 0.0
    context[HOURS] = elapsed / 3600.0
    context[TEMPERATURE] = temperature
    context[ALPHA] = angles[0]
    context[BETA] = angles[1]
    context[SENSE_ALPHA] = senses[0]
    context[SENSE_BETA] = senses[1]


def attitude_in_base(
    alpha: float,
    beta: float,
    kappa: float,
    epsilon: float,
    mounting_attitude: Vector,
    attitude: Vector,
    work: Vector,
) -> None:
    """Attitude (4,) of the block against the base at the true angles; `work` (4,) is working space."""
    set_quaternion(math.cos(0.5 * kappa), 0.0, math.sin(0.5 * kappa), 0.0, attitude)
    turn(attitude, 0, alpha, work)
    turn(attitude, 1, epsilon, work)
    turn(attitude, 2, beta, work)
    multiply(attitude, mounting_attitude, attitude)


def update_senses(plan: Vector, rate: Vector, senses: Vector) -> None:
    """Senses (2,) of the last moves from the rates; of a move that began and ended within a step, from its plan."""
    for axis in range(2):
        if rate[axis] > 0.0:
            senses[axis] = 1.0
        elif rate[axis] < 0.0:
            senses[axis] = -1.0
        elif plan[AXIS_PLAN_SIZE * axis + 8] > 0.0:
            senses[axis] = plan[AXIS_PLAN_SIZE * axis + 7]


def observe(
    time: float,
    temperature: float,
    kappa: float,
    epsilon: float,
    alpha_shift: float,
    beta_shift: float,
    true_gravity: float,
    max_acceleration: Vector,
    effect: Vector,
    angle: Vector,
    rate: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    start: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    senses: Vector,
    motion: Vector,
    work: Vector,
    context: Vector,
    turns: Vector,
) -> None:
    """Angles, rates, senses, context, attitudes and specific force at `time`."""
    for axis in range(2):
        follow_move(plan, axis, max_acceleration[axis], time, motion)
        rate[axis] = motion[2 * axis + 1]
    angle[0] = motion[0] - alpha_shift
    angle[1] = motion[2] - beta_shift
    elapsed = time - start[0]
    update_senses(plan, rate, senses)
    set_table_context(elapsed, temperature, angle, senses, context)
    if geometry_effects(context, angle, effect, turns) > 0.0:
        attitude_in_base(
            angle[0] + turns[1],
            angle[1] + turns[3],
            kappa + turns[0],
            epsilon + turns[2],
            mounting_attitude,
            attitude,
            work,
        )
    else:
        attitude_in_base(angle[0], angle[1], kappa, epsilon, mounting_attitude, attitude, work)
    to_body(attitude, 0.0, 0.0, true_gravity, specific_force)
    set_quaternion(1.0, 0.0, 0.0, 0.0, attitude_inertial)
    turn_by_vector(
        attitude_inertial,
        earth_rate_in_base[0] * elapsed,
        earth_rate_in_base[1] * elapsed,
        earth_rate_in_base[2] * elapsed,
        work,
    )
    multiply(attitude_inertial, attitude, attitude_inertial)
