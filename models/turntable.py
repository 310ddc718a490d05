"""The two-axis turntable: commanded positions, geometric errors, encoders, and what a block on it undergoes.

Angles: the servo brings the encoder reading to the command, so the true angle is the angle of the move less the
encoder offset. Geometry (frames in the package's docstring): from the base the frame is turned by κ about axis 2 (the
outer axis dips below the horizon), by α about the outer axis, by ε about axis 2 (the inner axis leans towards +outer),
by β about the inner axis, then by the mounting Q and the mounting error ϑ; each an exact rotation.

Source: Golovan, Matasov, Tarygin 2022, section 1; to first order this is (1.3).
"""

import math

from trihedron.models.motion import AXIS_PLAN_SIZE, fastest_rate, follow_move, phase_ends, plan_move
from trihedron.models.random_numbers import seed_generator, symmetric
from trihedron.models.restricted import (
    ALPHA,
    BETA,
    CONTEXT_SIZE,
    HOURS,
    SENSE_ALPHA,
    SENSE_BETA,
    TEMPERATURE,
    Vector,
)
from trihedron.models.rotation import (
    is_rotation,
    multiply,
    quaternion_of_matrix,
    set_quaternion,
    to_body,
    turn,
    turn_by_vector,
)

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth [rad/s] (WGS 84)."""

MAX_ANGLE_PER_QUADRATURE = 0.25
"""Longest turn [rad] that one five-point Gauss rule integrates to rounding."""


def encoder_effects(context: Vector, angles: Vector, effect: Vector, added: Vector) -> None:
    """Stage "encoder": what effects add to the readings of the two encoders [rad]; the nominal table adds nothing."""
    added[0] = 0.0
    added[1] = 0.0


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


def integrate_increment(
    begin: float,
    end: float,
    plan: Vector,
    alpha_shift: float,
    beta_shift: float,
    kappa: float,
    epsilon: float,
    max_acceleration: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    increment: Vector,
    motion: Vector,
    times: Vector,
    attitude: Vector,
    vector: Vector,
    work: Vector,
) -> None:
    """Integrate the block's angular rate over (begin, end] into `increment` (3,) [rad].

    Gauss rules with five points between the ends of the phases of the moves, none over more than a quarter of a
    radian: the increments are exact to rounding at any step size.
    """
    for i in range(3):
        increment[i] = 0.0
    count = phase_ends(plan, begin, end, times)
    for k in range(count - 1):
        duration = times[k + 1] - times[k]
        fastest = fastest_rate(plan, 0, times[k]) + fastest_rate(plan, 1, times[k])
        pieces = 1 + math.floor(duration * fastest / MAX_ANGLE_PER_QUADRATURE)
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


def initialise(
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
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    dwell: Vector,
    at_rest: Vector,
    start: Vector,
    last_step: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    generator: Vector,
    fluctuation: Vector,
    senses: Vector,
    motion: Vector,
    work: Vector,
    context: Vector,
    added: Vector,
) -> int:
    """Put the table at rest at its initial angles; returns 0 or the number of a message."""
    if is_rotation(mounting) == 0.0:
        return 1
    for axis in range(2):
        if not (max_rate[axis] > 0.0 and max_acceleration[axis] > 0.0):
            return 2
        plan_move(
            plan,
            axis,
            time,
            initial_angle[axis],
            0.0,
            initial_angle[axis],
            max_rate[axis],
            max_acceleration[axis],
        )
        rate[axis] = 0.0
        senses[axis] = 0.0
    start[0] = time
    last_step[0] = 0.0
    quaternion_of_matrix(mounting, mounting_attitude)
    turn_by_vector(mounting_attitude, mounting_error[0], mounting_error[1], mounting_error[2], work)
    earth = EARTH_RATE * earth_rotation
    earth_rate_in_base[0] = earth * math.cos(latitude) * math.cos(azimuth)
    earth_rate_in_base[1] = earth * math.cos(latitude) * math.sin(azimuth)
    earth_rate_in_base[2] = earth * math.sin(latitude)
    for i in range(3):
        increment[i] = 0.0
    seed_generator(seed, 1.0, generator)
    fluctuation[0] = symmetric(generator)
    fluctuation[1] = symmetric(generator)
    dwell[0] = 1.0
    at_rest[0] = 1.0
    observe(
        time,
        kappa,
        epsilon,
        alpha_offset + alpha_star,
        beta_offset,
        gravity * (1.0 - gravity_error),
        max_acceleration,
        angle,
        rate,
        specific_force,
        attitude,
        attitude_inertial,
        start,
        plan,
        mounting_attitude,
        earth_rate_in_base,
        motion,
        work,
    )
    read_encoders(
        0.0,
        temperature,
        encoder_fluctuation_bound,
        effect,
        angle,
        angle_reading,
        rate,
        fluctuation,
        senses,
        motion,
        context,
        added,
    )
    return 0


def observe(
    time: float,
    kappa: float,
    epsilon: float,
    alpha_shift: float,
    beta_shift: float,
    true_gravity: float,
    max_acceleration: Vector,
    angle: Vector,
    rate: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    start: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    motion: Vector,
    work: Vector,
) -> None:
    """Angles, rates, attitudes and specific force at `time`."""
    for axis in range(2):
        follow_move(plan, axis, max_acceleration[axis], time, motion)
        rate[axis] = motion[2 * axis + 1]
    angle[0] = motion[0] - alpha_shift
    angle[1] = motion[2] - beta_shift
    attitude_in_base(angle[0], angle[1], kappa, epsilon, mounting_attitude, attitude, work)
    to_body(attitude, 0.0, 0.0, true_gravity, specific_force)
    elapsed = time - start[0]
    set_quaternion(1.0, 0.0, 0.0, 0.0, attitude_inertial)
    turn_by_vector(
        attitude_inertial,
        earth_rate_in_base[0] * elapsed,
        earth_rate_in_base[1] * elapsed,
        earth_rate_in_base[2] * elapsed,
        work,
    )
    multiply(attitude_inertial, attitude, attitude_inertial)


def read_encoders(
    elapsed: float,
    temperature: float,
    encoder_fluctuation_bound: float,
    effect: Vector,
    angle: Vector,
    angle_reading: Vector,
    rate: Vector,
    fluctuation: Vector,
    senses: Vector,
    motion: Vector,
    context: Vector,
    added: Vector,
) -> None:
    """Stage "encoder": readings of both encoders, `elapsed` [s] after the start."""
    for axis in range(2):
        if rate[axis] > 0.0:
            senses[axis] = 1.0
        if rate[axis] < 0.0:
            senses[axis] = -1.0
    for i in range(CONTEXT_SIZE):
        context[i] = 0.0
    context[HOURS] = elapsed / 3600.0
    context[TEMPERATURE] = temperature
    context[ALPHA] = angle[0]
    context[BETA] = angle[1]
    context[SENSE_ALPHA] = senses[0]
    context[SENSE_BETA] = senses[1]
    encoder_effects(context, angle, effect, added)
    for axis in range(2):
        angle_reading[axis] = motion[2 * axis] + added[axis] + encoder_fluctuation_bound * fluctuation[axis]


def step(
    time: float,
    step: float,
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
    max_rate: Vector,
    max_acceleration: Vector,
    effect: Vector,
    angle: Vector,
    angle_reading: Vector,
    rate: Vector,
    increment: Vector,
    specific_force: Vector,
    attitude: Vector,
    attitude_inertial: Vector,
    dwell: Vector,
    at_rest: Vector,
    start: Vector,
    last_step: Vector,
    plan: Vector,
    mounting_attitude: Vector,
    earth_rate_in_base: Vector,
    generator: Vector,
    fluctuation: Vector,
    senses: Vector,
    motion: Vector,
    times: Vector,
    vector: Vector,
    work: Vector,
    context: Vector,
    added: Vector,
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
            follow_move(plan, axis, max_acceleration[axis], time, motion)
            plan_move(
                plan,
                axis,
                time,
                motion[2 * axis],
                motion[2 * axis + 1],
                command[axis],
                max_rate[axis],
                max_acceleration[axis],
            )
    integrate_increment(
        time,
        time + step,
        plan,
        alpha_offset + alpha_star,
        beta_offset,
        kappa,
        epsilon,
        max_acceleration,
        mounting_attitude,
        earth_rate_in_base,
        increment,
        motion,
        times,
        attitude,
        vector,
        work,
    )
    observe(
        time + step,
        kappa,
        epsilon,
        alpha_offset + alpha_star,
        beta_offset,
        gravity * (1.0 - gravity_error),
        max_acceleration,
        angle,
        rate,
        specific_force,
        attitude,
        attitude_inertial,
        start,
        plan,
        mounting_attitude,
        earth_rate_in_base,
        motion,
        work,
    )
    resting = 0.0
    if rate[0] == 0.0 and rate[1] == 0.0:
        resting = 1.0
    if resting > at_rest[0]:
        dwell[0] = dwell[0] + 1.0
        # The encoders' fluctuation is one error for one rest, and another for the next.
        fluctuation[0] = symmetric(generator)
        fluctuation[1] = symmetric(generator)
    at_rest[0] = resting
    read_encoders(
        time + step - start[0],
        temperature,
        encoder_fluctuation_bound,
        effect,
        angle,
        angle_reading,
        rate,
        fluctuation,
        senses,
        motion,
        context,
        added,
    )
    return 0
