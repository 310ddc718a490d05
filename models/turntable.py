"""The two-axis turntable: commanded positions, geometric errors, encoders, and what a block on it undergoes.

Angles: the servo brings the encoder reading to the command, so the true angle is the angle of the move less the
encoder offset. Stages: the encoders' readings here, the geometry and the increments in `turntable_geometry`.

Source: Golovan, Matasov, Tarygin 2022, section 1.
"""

import math

from .random_numbers import seed_generator, symmetric
from .restricted import SENSE_ALPHA, TEMPERATURE, Vector
from .rotation import is_rotation, quaternion_of_matrix, turn_by_vector
from .table_commands import AXIS_PLAN_SIZE, follow_move, plan_move
from .turntable_geometry import (
    ACCELERATION,
    EARTH_IN_BASE,
    EPSILON,
    FLUCTUATION_BOUND,
    KAPPA,
    SHIFT,
    START,
    TRUE_GRAVITY,
    add_slip,
    find_block_rate,
    integrate_increment,
    move_axes,
    observe,
    turn_with_earth,
)

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth [rad/s] (WGS 84)."""


def encoder_effects(context: Vector, angles: Vector, effect: Vector, added: Vector) -> None:
    """Stage "encoder": what effects add to the readings of the two encoders [rad]; the nominal table adds nothing."""
    added[0] = 0.0
    added[1] = 0.0


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
    """Readings of both encoders at the moment that was observed."""
    encoder_effects(context, angle, effect, added)
    for axis in range(2):
        angle_reading[axis] = motion[2 * axis] + added[axis] + stand[FLUCTUATION_BOUND] * fluctuation[axis]


def step(
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
        # The encoders' fluctuation is one error for one rest, and another for the next.
        fluctuation[0] = symmetric(generator)
        fluctuation[1] = symmetric(generator)
    at_rest[0] = resting
    read_encoders(stand, effect, angle, fluctuation, motion, context, added, angle_reading)
    return 0


NEVER = 1e300
"""The time of an event that does not come [s]."""
JUST_AFTER = 1e-15
"""By so much of itself a time is later than one at which a phase of a move is over, whatever its rounding."""


def next_event(time: float, plan: Vector) -> float:
    """Time after `time` at which the next phase of a move is over: an acceleration changes, or a rest begins."""
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
