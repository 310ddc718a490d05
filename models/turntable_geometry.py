"""Geometry of the two-axis table: what the block undergoes at given angles of the axes, and over a step between them.

From the base the frame is turned by κ about axis 2 (the outer axis dips below the horizon), by α about the outer axis,
by ε about axis 2 (the inner axis leans towards +outer), by β about the inner axis, then by the mounting Q and the
mounting error ϑ; each an exact rotation.

Increments, the integral of the block's angular rate against inertial space, are exact to rounding.

Source: Golovan, Matasov, Tarygin 2022, section 1; to first order this is (1.3).
"""

import math

from .restricted import ALPHA, BETA, CONTEXT_SIZE, HOURS, SENSE_ALPHA, SENSE_BETA, TEMPERATURE, Vector
from .rotation import multiply, set_quaternion, to_body, turn, turn_by_vector
from .table_commands import AXIS_PLAN_SIZE, fastest_rate, follow_move, phase_ends

MAX_ANGLE_PER_QUADRATURE = 0.25
"""Longest turn [rad] that one five-point Gauss rule integrates to rounding."""
DIFFERENCE_ANGLE = 5e-3
"""Spacing [rad] of the differences of small turns by an angle: the sixth order errs by 1e-13 of a third harmonic."""
DIFFERENCE_HOURS = 1e-2
"""Spacing [h] of their differences by time."""


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


def add_angle_increment(
    motion: Vector,
    kappa: float,
    epsilon: float,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    weight: float,
    increment: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
) -> None:
    """Add `weight` [s] times the block's angular rate against inertial space, in block axes, to `increment` (3,)."""
    alpha_rate = motion[1]
    beta_rate = motion[3]
    across = alpha_rate * math.cos(epsilon)
    to_body(
        mounting_attitude,
        across * math.cos(motion[2]),
        -across * math.sin(motion[2]),
        alpha_rate * math.sin(epsilon) + beta_rate,
        vector,
    )
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]
    attitude_in_base(motion[0], motion[2], kappa, epsilon, mounting_attitude, attitude, work)
    to_body(attitude, earth_rate_in_base[0], earth_rate_in_base[1], earth_rate_in_base[2], vector)
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]


def find_turn_rates(
    motion: Vector, context: Vector, effect: Vector, shifted: Vector, turns: Vector, turn_rates: Vector
) -> None:
    """Rates (4,) [rad/s] of the small turns that effects add, by central differences of sixth order.

    `context` is that of the moment; `shifted` (2,) and `turns` (4,) are working space.
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


def add_turned_increment(
    motion: Vector,
    elapsed: float,
    temperature: float,
    kappa: float,
    epsilon: float,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    weight: float,
    effect: Vector,
    senses: Vector,
    increment: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """`add_angle_increment` with the small turns that effects add, and their rates."""
    shifted[0] = motion[0]
    shifted[1] = motion[2]
    set_table_context(elapsed, temperature, shifted, senses, context)
    find_turn_rates(motion, context, effect, shifted, turns, turn_rates)
    shifted[0] = motion[0]
    shifted[1] = motion[2]
    set_table_context(elapsed, temperature, shifted, senses, context)
    geometry_effects(context, shifted, effect, turns)
    alpha = motion[0] + turns[1]
    beta = motion[2] + turns[3]
    lean = epsilon + turns[2]
    along = motion[1] + turn_rates[1]
    down = -turn_rates[0] * math.sin(alpha)
    first = along * math.cos(lean) - down * math.sin(lean)
    second = turn_rates[0] * math.cos(alpha) + turn_rates[2]
    third = along * math.sin(lean) + down * math.cos(lean)
    to_body(
        mounting_attitude,
        first * math.cos(beta) + second * math.sin(beta),
        second * math.cos(beta) - first * math.sin(beta),
        third + motion[3] + turn_rates[3],
        vector,
    )
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]
    attitude_in_base(alpha, beta, kappa + turns[0], lean, mounting_attitude, attitude, work)
    to_body(attitude, earth_rate_in_base[0], earth_rate_in_base[1], earth_rate_in_base[2], vector)
    for i in range(3):
        increment[i] = increment[i] + weight * vector[i]


def integrate_increment(
    begin: float,
    end: float,
    temperature: float,
    plan: Vector,
    alpha_shift: float,
    beta_shift: float,
    kappa: float,
    epsilon: float,
    max_acceleration: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    effect: Vector,
    start: Vector,
    senses: Vector,
    increment: Vector,
    motion: Vector,
    times: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
    context: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> None:
    """Integrate the block's angular rate over (begin, end] into `increment` (3,) [rad].

    Gauss rules with five points between the ends of the phases of the moves, none over more than a quarter of a
    radian: the increments are exact to rounding at any step size.
    """
    for i in range(3):
        increment[i] = 0.0
    shifted[0] = 0.0
    shifted[1] = 0.0
    set_table_context(0.0, temperature, shifted, senses, context)
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
                follow_move(plan, 0, max_acceleration[0], moment, motion)
                follow_move(plan, 1, max_acceleration[1], moment, motion)
                motion[0] = motion[0] - alpha_shift
                motion[2] = motion[2] - beta_shift
                if turned > 0.0:
                    add_turned_increment(
                        motion,
                        moment - start[0],
                        temperature,
                        kappa,
                        epsilon,
                        mounting_attitude,
                        earth_rate_in_base,
                        0.5 * piece * weight,
                        effect,
                        senses,
                        increment,
                        attitude,
                        vector,
                        work,
                        context,
                        shifted,
                        turns,
                        turn_rates,
                    )
                else:
                    add_angle_increment(
                        motion,
                        kappa,
                        epsilon,
                        mounting_attitude,
                        earth_rate_in_base,
                        0.5 * piece * weight,
                        increment,
                        attitude,
                        vector,
                        work,
                    )
