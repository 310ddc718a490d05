"""Geometry of the two-axis table: what the block undergoes at given angles of the axes, and over a step between them.

From the base the frame is turned by κ about axis 2 (the outer axis dips below the horizon), by α about the outer axis,
by ε about axis 2 (the inner axis leans towards +outer), by β about the inner axis, then by the mounting Q, the mounting
error ϑ, and what effects turn the block on the table by; each an exact rotation.

Increments, the integral of the block's angular rate against inertial space, are exact to rounding.

Source: Golovan, Matasov, Tarygin 2022, section 1; to first order this is (1.3).
"""

import math

from .restricted import ALPHA, BETA, HOURS, RATE, SENSE_ALPHA, Vector
from .rotation import multiply, set_quaternion, to_body, turn, turn_by_vector
from .table_commands import AXIS_PLAN_SIZE, fastest_rate, follow_move, phase_ends

STAND_SIZE = 12
"""What stays as it is over a run, in one vector; these constants are its places."""
START = 0
"""time of the start [s]"""
KAPPA = 1
"""κ [rad]"""
EPSILON = 2
"""ε [rad]"""
SHIFT = 3
"""readings of the encoders less true angles, Δα + α* and Δβ [rad] (two places)"""
TRUE_GRAVITY = 5
"""gravity [m/s²]"""
FLUCTUATION_BOUND = 6
"""bound of the encoders' fluctuation [rad]"""
ACCELERATION = 7
"""limits of the axes' accelerations [rad/s²] (two places)"""
EARTH_IN_BASE = 9
"""rotation of the Earth in base axes [rad/s] (three places)"""

MAX_ANGLE_PER_QUADRATURE = 0.25
"""Longest turn [rad] that one five-point Gauss rule integrates to rounding."""
DIFFERENCE_ANGLE = 5e-3
"""Spacing [rad] of the differences of small turns by an angle: the sixth order errs by 1e-13 of a third harmonic."""
DIFFERENCE_HOURS = 1e-2
"""Spacing [h] of their differences by time."""


def geometry_effects(context: Vector, angles: Vector, effect: Vector, turns: Vector) -> float:
    """Stage "geometry": small turns (7,) [rad] that effects add: to κ, about the outer axis, to ε, about the inner one.

    The last three are the rotation vector, in block axes, by which the block turns further on the table; it may jump.
    Returns whether there are any (1.0 or 0.0); the nominal table adds nothing.
    """
    for i in range(7):
        turns[i] = 0.0
    return 0.0


def set_table_context(elapsed: float, angles: Vector, context: Vector) -> None:
    """Write the true angles of the table, `elapsed` [s] after the start, into the context; the rest stands there."""
    context[HOURS] = elapsed / 3600.0
    context[ALPHA] = angles[0]
    context[BETA] = angles[1]


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


def move_axes(
    time: float, stand: Vector, plan: Vector, motion: Vector, angle: Vector, rate: Vector, context: Vector
) -> None:
    """True angles and rates of both axes at `time`, and the context.

    The sense of a move that began and ended within a step is that of its plan.
    """
    for axis in range(2):
        follow_move(plan, axis, stand[ACCELERATION + axis], time, motion)
        angle[axis] = motion[2 * axis] - stand[SHIFT + axis]
        rate[axis] = motion[2 * axis + 1]
        context[RATE + axis] = rate[axis]
        if rate[axis] > 0.0:
            context[SENSE_ALPHA + axis] = 1.0
        elif rate[axis] < 0.0:
            context[SENSE_ALPHA + axis] = -1.0
        elif plan[AXIS_PLAN_SIZE * axis + 8] > 0.0:
            context[SENSE_ALPHA + axis] = plan[AXIS_PLAN_SIZE * axis + 7]
    set_table_context(time - stand[START], angle, context)


def observe(
    stand: Vector,
    mounting_attitude: Vector,
    effect: Vector,
    angle: Vector,
    context: Vector,
    turns: Vector,
    work: Vector,
    attitude: Vector,
    specific_force: Vector,
) -> None:
    """Attitude against the base, and specific force, at the true angles."""
    alpha = angle[0]
    beta = angle[1]
    kappa = stand[KAPPA]
    epsilon = stand[EPSILON]
    turned = geometry_effects(context, angle, effect, turns)
    if turned > 0.0:
        alpha = alpha + turns[1]
        beta = beta + turns[3]
        kappa = kappa + turns[0]
        epsilon = epsilon + turns[2]
    attitude_in_base(alpha, beta, kappa, epsilon, mounting_attitude, attitude, work)
    if turned > 0.0:
        turn_by_vector(attitude, turns[4], turns[5], turns[6], work)
    to_body(attitude, 0.0, 0.0, stand[TRUE_GRAVITY], specific_force)


def find_block_rate(stand: Vector, mounting_attitude: Vector, angle: Vector, rate: Vector, block_rate: Vector) -> None:
    """Angular rate (3,) of the block against the base, in block axes, but for small turns that effects add."""
    along = rate[0] * math.cos(stand[EPSILON])
    third = rate[0] * math.sin(stand[EPSILON]) + rate[1]
    to_body(mounting_attitude, along * math.cos(angle[1]), -along * math.sin(angle[1]), third, block_rate)


def add_slip(turns: Vector, slipped: Vector, increment: Vector) -> None:
    """Add to `increment` (3,) what the block turned on the table since the step before, as `observe` saw it.

    `slipped` (3,) is what earlier increments hold, overwritten: the end of the step before, found again from this one,
    may be a rounding later, and would count a jump twice.
    """
    for i in range(3):
        increment[i] = increment[i] + (turns[4 + i] - slipped[i])
        slipped[i] = turns[4 + i]


def turn_with_earth(elapsed: float, stand: Vector, attitude: Vector, work: Vector, attitude_inertial: Vector) -> None:
    """Attitude against the inertial frame that was the base's at the start, `elapsed` [s] ago."""
    set_quaternion(1.0, 0.0, 0.0, 0.0, attitude_inertial)
    x = stand[EARTH_IN_BASE] * elapsed
    y = stand[EARTH_IN_BASE + 1] * elapsed
    z = stand[EARTH_IN_BASE + 2] * elapsed
    turn_by_vector(attitude_inertial, x, y, z, work)
    multiply(attitude_inertial, attitude, attitude_inertial)


def find_turn_rates(
    motion: Vector, context: Vector, effect: Vector, shifted: Vector, turns: Vector, turn_rates: Vector
) -> None:
    """Rates (4,) [rad/s] of the small turns of the table that effects add, by central differences of sixth order.

    `context` is that of the moment; `shifted` (2,) and `turns` (7,) are working space.
    """
    hours = context[HOURS]
    for i in range(4):
        turn_rates[i] = 0.0
    for variable in range(3):
        rate = 1.0 / 3600.0
        spacing = DIFFERENCE_HOURS
        if variable < 2:
            rate = motion[2 * variable + 1]
            spacing = DIFFERENCE_ANGLE
        if rate != 0.0:
            for node in range(6):
                # Nodes -3, -2, -1, 1, 2, 3 with the weights -1/60, 3/20, -3/4, 3/4, -3/20, 1/60.
                distance = node - 3
                if node > 2:
                    distance = node - 2
                weight = 0.75
                if node == 1 or node == 4:
                    weight = -0.15
                if node == 0 or node == 5:
                    weight = 1.0 / 60.0
                if node < 3:
                    weight = -weight
                shifted[0] = motion[0]
                shifted[1] = motion[2]
                context[HOURS] = hours
                if variable < 2:
                    shifted[variable] = shifted[variable] + distance * spacing
                else:
                    context[HOURS] = hours + distance * spacing
                context[ALPHA] = shifted[0]
                context[BETA] = shifted[1]
                geometry_effects(context, shifted, effect, turns)
                for i in range(4):
                    turn_rates[i] = turn_rates[i] + weight * rate / spacing * turns[i]


def add_increment(
    elapsed: float,
    weight: float,
    turned: float,
    stand: Vector,
    mounting_attitude: Vector,
    effect: Vector,
    motion: Vector,
    increment: Vector,
    attitude: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """Add `weight` [s] times the block's angular rate against inertial space, in block axes, to `increment` (3,).

    `turned` is 1.0 where effects add small turns; `turns` (7,) and `turn_rates` (4,) are zeros where not. Its own
    turn on the table is not in it, but the axes are those after it.
    """
    if turned > 0.0:
        shifted[0] = motion[0]
        shifted[1] = motion[2]
        set_table_context(elapsed, shifted, context)
        find_turn_rates(motion, context, effect, shifted, turns, turn_rates)
        shifted[0] = motion[0]
        shifted[1] = motion[2]
        set_table_context(elapsed, shifted, context)
        geometry_effects(context, shifted, effect, turns)
    alpha = motion[0] + turns[1]
    beta = motion[2] + turns[3]
    lean = stand[EPSILON] + turns[2]
    along = motion[1] + turn_rates[1]
    cos_lean = math.cos(lean)
    sin_lean = math.sin(lean)
    cos_beta = math.cos(beta)
    sin_beta = math.sin(beta)
    down = 0.0
    second = turn_rates[2]
    if turn_rates[0] != 0.0:
        down = -turn_rates[0] * math.sin(alpha)
        second = turn_rates[0] * math.cos(alpha) + turn_rates[2]
    first = along * cos_lean - down * sin_lean
    third = along * sin_lean + down * cos_lean
    x = first * cos_beta + second * sin_beta
    y = second * cos_beta - first * sin_beta
    to_body(mounting_attitude, x, y, third + motion[3] + turn_rates[3], shifted)
    attitude_in_base(alpha, beta, stand[KAPPA] + turns[0], lean, mounting_attitude, attitude, work)
    to_body(attitude, stand[EARTH_IN_BASE], stand[EARTH_IN_BASE + 1], stand[EARTH_IN_BASE + 2], work)
    for i in range(3):
        shifted[i] = shifted[i] + work[i]
    if turned > 0.0:
        set_quaternion(1.0, 0.0, 0.0, 0.0, attitude)
        turn_by_vector(attitude, turns[4], turns[5], turns[6], work)
        to_body(attitude, shifted[0], shifted[1], shifted[2], work)
        for i in range(3):
            shifted[i] = work[i]
    for i in range(3):
        increment[i] = increment[i] + weight * shifted[i]


def integrate_increment(
    begin: float,
    end: float,
    stand: Vector,
    mounting_attitude: Vector,
    effect: Vector,
    plan: Vector,
    motion: Vector,
    increment: Vector,
    attitude: Vector,
    times: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """Integrate the block's angular rate over (begin, end] into `increment` (3,) [rad].

    Gauss rules with five points between the ends of the phases of the moves, none over more than a quarter of a
    radian: the increments are exact to rounding at any step size, but for a step within which the block slips on the
    table: the rates see that from the middle of a piece on, and `add_slip` adds its own turn, one about one axis.
    """
    for i in range(3):
        increment[i] = 0.0
        shifted[i] = 0.0
    for i in range(4):
        turn_rates[i] = 0.0
    turned = geometry_effects(context, shifted, effect, turns)
    count = phase_ends(plan, begin, end, times)
    for k in range(count - 1):
        duration = times[k + 1] - times[k]
        fastest = fastest_rate(plan, 0, times[k]) + fastest_rate(plan, 1, times[k])
        pieces = 1 + int(math.floor(duration * fastest / MAX_ANGLE_PER_QUADRATURE))
        piece = duration / pieces
        for j in range(pieces):
            middle = times[k] + (j + 0.5) * piece
            for node in range(5):
                offset = 0.0
                weight = 128.0 / 225.0
                if node == 1 or node == 2:
                    offset = 0.53846931010568309
                    weight = 0.47862867049936647
                if node == 3 or node == 4:
                    offset = 0.90617984593866399
                    weight = 0.23692688505618909
                if node == 1 or node == 3:
                    offset = -offset
                moment = middle + 0.5 * piece * offset
                for axis in range(2):
                    follow_move(plan, axis, stand[ACCELERATION + axis], moment, motion)
                    motion[2 * axis] = motion[2 * axis] - stand[SHIFT + axis]
                add_increment(
                    moment - stand[START],
                    0.5 * piece * weight,
                    turned,
                    stand,
                    mounting_attitude,
                    effect,
                    motion,
                    increment,
                    attitude,
                    work,
                    context,
                    shifted,
                    turns,
                    turn_rates,
                )
