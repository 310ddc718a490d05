"""The two-axis turntable in time: moves, geometric errors, encoders, and the motion of a block on it.

Angles: the servo brings the encoder reading to the command, so the true angle is the angle of the move less its offset.
From the base the frame is turned by κ about axis 2 (the outer axis dips below the horizon), and by α about the outer
axis. Then by ε about axis 2 (the inner axis leans towards +outer), and by β about the inner axis. Last come the
mounting Q, the mounting error ϑ, and the turns of the block on the table by effects; each is an exact rotation.

Increments, the integral of the block's angular rate against inertial space, are exact to rounding.

Source: Golovan, Matasov, Tarygin 2022, section 1; to first order this is (1.3).
"""

import math

from ..random_numbers import seed_generator, symmetric
from ..restricted import ALPHA, BETA, HOURS, INPUT, RATE, SENSE_ALPHA, TEMPERATURE, Vector
from ..rotation import (
    is_rotation,
    multiply,
    quaternion_of_matrix,
    set_quaternion,
    to_body,
    turn,
    turn_by_vector,
)
from ..table_commands import AXIS_PLAN_SIZE, fastest_rate, follow_move, phase_ends, plan_move

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth [rad/s] (WGS 84)."""

STAND_SIZE = 12
"""Length of the vector of constants of a run; the following constants are its places."""
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
    """Stage "geometry": small turns (7,) [rad] by effects: of κ, about the outer axis, of ε, about the inner one.

    The last three are the rotation vector, in block axes, by which the block turns further on the table; it may jump.
    Returns 1.0 if there are any, else 0.0; the nominal table adds nothing.
    """
    for i in range(7):
        turns[i] = 0.0
    return 0.0


def set_table_context(elapsed: float, angles: Vector, context: Vector) -> None:
    """Write the true angles of the table, `elapsed` [s] after the start, into the context; keep the rest."""
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
    """Compute the attitude (4,) of the block against the base at the true angles; `work` (4,) is working space."""
    set_quaternion(math.cos(0.5 * kappa), 0.0, math.sin(0.5 * kappa), 0.0, attitude)
    turn(attitude, 0, alpha, work)
    turn(attitude, 1, epsilon, work)
    turn(attitude, 2, beta, work)
    multiply(attitude, mounting_attitude, attitude)


def set_inputs(
    angle: Vector, stand: Vector, mounting_attitude: Vector, attitude: Vector, work: Vector, context: Vector
) -> None:
    """Write the accelerometers' inputs from gravity [g], without effects, at the true angles into the context.

    The attitude (4,) is overwritten by that against the base; `work` (4,) is working space.
    """
    attitude_in_base(angle[0], angle[1], stand[KAPPA], stand[EPSILON], mounting_attitude, attitude, work)
    to_body(attitude, 0.0, 0.0, 1.0, work)
    for i in range(3):
        context[INPUT + i] = work[i]


def move_axes(
    time: float, stand: Vector, plan: Vector, motion: Vector, angle: Vector, rate: Vector, context: Vector
) -> None:
    """Compute true angles and rates of both axes at `time`, and the context.

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
    """Compute the attitude against the base, and the specific force, at the true angles."""
    alpha = angle[0]
    beta = angle[1]
    kappa = stand[KAPPA]
    epsilon = stand[EPSILON]
    set_inputs(angle, stand, mounting_attitude, attitude, work, context)
    turned = geometry_effects(context, angle, effect, turns)
    if turned > 0.0:
        alpha = alpha + turns[1]
        beta = beta + turns[3]
        kappa = kappa + turns[0]
        epsilon = epsilon + turns[2]
        attitude_in_base(alpha, beta, kappa, epsilon, mounting_attitude, attitude, work)
        turn_by_vector(attitude, turns[4], turns[5], turns[6], work)
    to_body(attitude, 0.0, 0.0, stand[TRUE_GRAVITY], specific_force)


def find_block_rate(stand: Vector, mounting_attitude: Vector, angle: Vector, rate: Vector, block_rate: Vector) -> None:
    """Compute the angular rate (3,) of the block against the base, in block axes, without small turns by effects."""
    along = rate[0] * math.cos(stand[EPSILON])
    third = rate[0] * math.sin(stand[EPSILON]) + rate[1]
    to_body(mounting_attitude, along * math.cos(angle[1]), -along * math.sin(angle[1]), third, block_rate)


def add_slip(turns: Vector, slipped: Vector, increment: Vector) -> None:
    """Add the block's turn on the table since the previous step, as `observe` computed it, to `increment` (3,).

    `slipped` (3,) is the turn in earlier increments, overwritten: the end of the previous step, computed again from
    this one, may be a rounding later, and would count a jump twice.
    """
    for i in range(3):
        increment[i] = increment[i] + (turns[4 + i] - slipped[i])
        slipped[i] = turns[4 + i]


def turn_with_earth(elapsed: float, stand: Vector, attitude: Vector, work: Vector, attitude_inertial: Vector) -> None:
    """Compute the attitude against the inertial frame that was the base's at the start, `elapsed` [s] ago."""
    set_quaternion(1.0, 0.0, 0.0, 0.0, attitude_inertial)
    x = stand[EARTH_IN_BASE] * elapsed
    y = stand[EARTH_IN_BASE + 1] * elapsed
    z = stand[EARTH_IN_BASE + 2] * elapsed
    turn_by_vector(attitude_inertial, x, y, z, work)
    multiply(attitude_inertial, attitude, attitude_inertial)


def find_turn_rates(
    motion: Vector, context: Vector, effect: Vector, shifted: Vector, turns: Vector, turn_rates: Vector
) -> None:
    """Compute rates (4,) [rad/s] of the table's small turns by effects, by central differences of sixth order.

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

    `turned` is 1.0 if effects add small turns; otherwise `turns` (7,) and `turn_rates` (4,) are zeros. The block's own
    turn on the table is not included, but the axes are those after it.
    """
    if turned > 0.0:
        shifted[0] = motion[0]
        shifted[1] = motion[2]
        set_table_context(elapsed, shifted, context)
        find_turn_rates(motion, context, effect, shifted, turns, turn_rates)
        shifted[0] = motion[0]
        shifted[1] = motion[2]
        set_table_context(elapsed, shifted, context)
        set_inputs(shifted, stand, mounting_attitude, attitude, work, context)
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

    Gauss rules have five points between the ends of the phases of the moves, none over more than a quarter of a radian.
    They make the increments exact to rounding at any step size. An exception is a step within which the block slips on
    the table. The rates include the slip from the middle of a piece on, and `add_slip` adds its own turn about one
    axis.
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


def encoder_effects(context: Vector, angles: Vector, effect: Vector, added: Vector) -> None:
    """Stage "encoder": add effects to the readings of the two encoders [rad]; the nominal table adds nothing."""
    added[0] = 0.0
    added[1] = 0.0


def initialise_table(
    time: float,
    command: Vector,
    temperature: float,
    kappa: float,
    epsilon: float,
    alpha_offset: float,
    beta_offset: float,
    alpha_star: float,
    gravity: float,
    gravity_error: float,
    encoder_fluctuation_bound: float,
    mounting: Vector,
    mounting_error: Vector,
    max_rate: Vector,
    max_acceleration: Vector,
    initial_angle: Vector,
    earth_rotation: float,
    latitude: float,
    azimuth: float,
    seed: float,
    effect: Vector,
    angle: Vector,
    angle_reading: Vector,
    rate: Vector,
    block_rate: Vector,
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    dwell: Vector,
    at_rest: Vector,
    stand: Vector,
    last_step: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    generator: Vector,
    fluctuation: Vector,
    motion: Vector,
    slipped: Vector,
    work: Vector,
    context: Vector,
    added: Vector,
    turns: Vector,
) -> int:
    """Put the table at rest at its initial angles; returns 0 or the number of a message."""
    if is_rotation(mounting) == 0.0:
        return 1
    for axis in range(2):
        if not (max_rate[axis] > 0.0 and max_acceleration[axis] > 0.0):
            return 2
        initial = initial_angle[axis]
        plan_move(plan, axis, time, initial, 0.0, initial, max_rate[axis], max_acceleration[axis])
        stand[ACCELERATION + axis] = max_acceleration[axis]
        context[SENSE_ALPHA + axis] = 0.0
    last_step[0] = 0.0
    quaternion_of_matrix(mounting, mounting_attitude)
    turn_by_vector(mounting_attitude, mounting_error[0], mounting_error[1], mounting_error[2], work)
    earth = EARTH_RATE * earth_rotation
    stand[EARTH_IN_BASE] = earth * math.cos(latitude) * math.cos(azimuth)
    stand[EARTH_IN_BASE + 1] = earth * math.cos(latitude) * math.sin(azimuth)
    stand[EARTH_IN_BASE + 2] = earth * math.sin(latitude)
    stand[START] = time
    stand[KAPPA] = kappa
    stand[EPSILON] = epsilon
    stand[SHIFT] = alpha_offset + alpha_star
    stand[SHIFT + 1] = beta_offset
    stand[TRUE_GRAVITY] = gravity * (1.0 - gravity_error)
    stand[FLUCTUATION_BOUND] = encoder_fluctuation_bound
    seed_generator(seed, 1.0, generator)
    fluctuation[0] = symmetric(generator)
    fluctuation[1] = symmetric(generator)
    dwell[0] = 1.0
    at_rest[0] = 1.0
    context[TEMPERATURE] = temperature
    move_axes(time, stand, plan, motion, angle, rate, context)
    observe(stand, mounting_attitude, effect, angle, context, turns, work, attitude, specific_force)
    for i in range(3):
        increment[i] = 0.0
        slipped[i] = turns[4 + i]
    find_block_rate(stand, mounting_attitude, angle, rate, block_rate)
    turn_with_earth(time - stand[START], stand, attitude, work, attitude_inertial)
    read_encoders(stand, effect, angle, fluctuation, motion, context, added, angle_reading)
    return 0


def read_encoders(
    stand: Vector,
    effect: Vector,
    angle: Vector,
    fluctuation: Vector,
    motion: Vector,
    context: Vector,
    added: Vector,
    angle_reading: Vector,
) -> None:
    """Compute the readings of both encoders at the observed moment."""
    encoder_effects(context, angle, effect, added)
    for axis in range(2):
        angle_reading[axis] = motion[2 * axis] + added[axis] + stand[FLUCTUATION_BOUND] * fluctuation[axis]


def step_table(
    time: float,
    step: float,
    command: Vector,
    temperature: float,
    max_rate: Vector,
    effect: Vector,
    angle: Vector,
    angle_reading: Vector,
    rate: Vector,
    block_rate: Vector,
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    dwell: Vector,
    at_rest: Vector,
    stand: Vector,
    last_step: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    generator: Vector,
    fluctuation: Vector,
    motion: Vector,
    slipped: Vector,
    times: Vector,
    work: Vector,
    context: Vector,
    added: Vector,
    shifted: Vector,
    turns: Vector,
    turn_rates: Vector,
) -> int:
    """Move the table over (time, time + step]; returns 0 or the number of a message."""
    # Some masters end with a step of 1e-14 s: increments over it would mean nothing.
    if step <= 1e-9 * last_step[0]:
        return 0
    last_step[0] = step
    for axis in range(2):
        if not math.fabs(command[axis]) <= 1e6:
            return 3
        if command[axis] != plan[AXIS_PLAN_SIZE * axis + 3]:
            follow_move(plan, axis, stand[ACCELERATION + axis], time, motion)
            at = motion[2 * axis]
            fast = motion[2 * axis + 1]
            plan_move(plan, axis, time, at, fast, command[axis], max_rate[axis], stand[ACCELERATION + axis])
    context[TEMPERATURE] = temperature
    integrate_increment(
        time,
        time + step,
        stand,
        mounting_attitude,
        effect,
        plan,
        motion,
        increment,
        attitude,
        times,
        work,
        context,
        shifted,
        turns,
        turn_rates,
    )
    move_axes(time + step, stand, plan, motion, angle, rate, context)
    observe(stand, mounting_attitude, effect, angle, context, turns, work, attitude, specific_force)
    add_slip(turns, slipped, increment)
    find_block_rate(stand, mounting_attitude, angle, rate, block_rate)
    turn_with_earth(time + step - stand[START], stand, attitude, work, attitude_inertial)
    resting = 0.0
    if rate[0] == 0.0 and rate[1] == 0.0:
        resting = 1.0
    if resting > at_rest[0]:
        dwell[0] = dwell[0] + 1.0
        # The encoders' fluctuation is constant over a rest, and drawn anew for the next.
        fluctuation[0] = symmetric(generator)
        fluctuation[1] = symmetric(generator)
    at_rest[0] = resting
    read_encoders(stand, effect, angle, fluctuation, motion, context, added, angle_reading)
    return 0


NEVER = 1e300
"""Time of an event that never comes [s]."""
JUST_AFTER = 1e-15
"""Relative difference above which a time is later than the end of a phase of a move, for any rounding."""


def next_event(time: float, plan: Vector) -> float:
    """Return the time after `time` at which the next phase of a move ends: an acceleration changes, or a rest
    begins."""
    first = NEVER
    for axis in range(2):
        at = AXIS_PLAN_SIZE * axis
        moment = plan[at]
        for phase in range(3):
            moment = moment + plan[at + 4 + phase]
            over = moment + JUST_AFTER * math.fabs(moment)
            if plan[at + 4 + phase] > 0.0 and over > time and over < first:
                first = over
    return first
