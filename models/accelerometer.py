"""The accelerometer block, scale factors that depend on the sign of the input, misalignment, bias, errors; its inverse.

Source: Golovan, Matasov, Tarygin 2022, (1.1): f' = (I + Γ) f_z + Δf⁰ + Δfˢ with Γ_pp = Γ⁺ or Γ⁻ by the sign of the
input of accelerometer p. Γ and the bias are fractions of gravity's model value, as in the paper.

The inverse takes readings r = A(s) n + b to the input n: it is (1.1), solved for the input. A = I + Γ, where the sign s
of each accelerometer's input selects its scale factor.
"""

import math

from .noise import draw_noise, seed_noise
from .random_numbers import seed_generator, symmetric
from .restricted import (
    ALPHA,
    ANGULAR_ACCELERATION,
    BETA,
    BLOCK_RESPONSE,
    GRAVITY,
    HOURS,
    INPUT,
    KEPT,
    RATE,
    SENSE_INPUT,
    TEMPERATURE,
    Vector,
)

ROUNDING = 1e-12
"""Change of an input [g] that may be rounding."""


def reading_effects(context: Vector, n: Vector, effect: Vector, added: Vector) -> None:
    """Stage "reading": what effects add to the readings (3,) [g]; the nominal block adds nothing."""
    added[0] = 0.0
    added[1] = 0.0
    added[2] = 0.0


def final_effects(context: Vector, own: Vector, effect: Vector, reading: Vector) -> None:
    """Last stage: change the finished readings (3,) [g], errors included, in declared order; nominally nothing.

    `own` (3,) [g] is each accelerometer's reading of its own input.
    """


def kept_effects(context: Vector, before: Vector, effect: Vector, kept: Vector) -> None:
    """Once a step: update the memory of effects for each accelerometer (3,); the nominal block has none.

    `before` (2,) are hours and temperature [degC] of the step before.
    """


def keep(temperature: float, effect: Vector, before: Vector, kept: Vector, context: Vector) -> None:
    """Update the memory of effects at the end of the step with this temperature [degC], at the context's time."""
    context[TEMPERATURE] = temperature
    kept_effects(context, before, effect, kept)
    before[0] = context[HOURS]
    before[1] = temperature
    for p in range(3):
        context[KEPT + p] = kept[p]


def respond(
    specific_force: Vector,
    temperature: float,
    angle: Vector,
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
    bias: Vector,
    effect: Vector,
    reading: Vector,
    error: Vector,
    context: Vector,
    n: Vector,
    added: Vector,
    own: Vector,
    waiting: Vector,
    last_reading: Vector,
    increment_reading: Vector,
) -> None:
    """Compute readings (3,) [m/s²] that follow the inputs at once, n + Γn + b and the error [g] of the last step.

    `waiting` (1,) is the length [s] of a step whose increments (3,) [m/s] still need its readings; negative: none.
    """
    for p in range(3):
        n[p] = specific_force[p] / gravity
    context[TEMPERATURE] = temperature
    context[ALPHA] = angle[0]
    context[BETA] = angle[1]
    context[GRAVITY] = gravity
    context[BLOCK_RESPONSE + 1] = gamma_12
    context[BLOCK_RESPONSE + 2] = gamma_13
    context[BLOCK_RESPONSE + 3] = gamma_21
    context[BLOCK_RESPONSE + 5] = gamma_23
    context[BLOCK_RESPONSE + 6] = gamma_31
    context[BLOCK_RESPONSE + 7] = gamma_32
    reading[0] = n[0] + gamma_12 * n[1] + gamma_13 * n[2] + bias[0]
    reading[1] = n[1] + gamma_21 * n[0] + gamma_23 * n[2] + bias[1]
    reading[2] = n[2] + gamma_31 * n[0] + gamma_32 * n[1] + bias[2]
    for p in range(3):
        context[INPUT + p] = n[p]
        scale_error = scale_error_minus[p]
        if n[p] > 0.0:
            scale_error = scale_error_plus[p]
        context[BLOCK_RESPONSE + 4 * p] = 1.0 + scale_error
        reading[p] = reading[p] + scale_error * n[p]
        own[p] = n[p] + scale_error * n[p]
    reading_effects(context, n, effect, added)
    for p in range(3):
        reading[p] = reading[p] + added[p] + error[p]
    final_effects(context, own, effect, reading)
    for p in range(3):
        reading[p] = gravity * reading[p]
    if waiting[0] >= 0.0:
        for p in range(3):
            if waiting[0] > 0.0:
                increment_reading[p] = 0.5 * waiting[0] * (last_reading[p] + reading[p])
            last_reading[p] = reading[p]
        waiting[0] = -1.0


def draw_error(noise_bound: float, held_fraction: float, held: Vector, generator: Vector, error: Vector) -> None:
    """Draw the error (3,) [g] of a sample: held part plus white part, never more than `noise_bound`."""
    for p in range(3):
        white = symmetric(generator)
        error[p] = noise_bound * (held_fraction * held[p] + (1.0 - held_fraction) * white)


def follow_input(p: int, specific_force: float, gravity: float, context: Vector, previous_input: Vector) -> None:
    """Keep the sense of the last change of an input in the context; a change by rounding does not count."""
    change = specific_force - previous_input[p]
    if math.fabs(change) > ROUNDING * gravity:
        context[SENSE_INPUT + p] = 1.0
        if change < 0.0:
            context[SENSE_INPUT + p] = -1.0
        previous_input[p] = specific_force


def follow_rate(step: float, rate: Vector, turning: Vector, context: Vector) -> None:
    """Keep the rate at the end of a step in the context, and the angular acceleration there, to second order.

    The mean acceleration over a step is that of its middle. Its change since the step before leads on to the end.
    `turning` (4,) are that mean [rad/s²] and the length [s] of the step before; 0: there was none.
    """
    ahead = 0.0
    if turning[3] > 0.0:
        ahead = step / (step + turning[3])
    for p in range(3):
        mean = 0.0
        if step > 0.0:
            mean = (rate[p] - context[RATE + p]) / step
        context[ANGULAR_ACCELERATION + p] = mean + ahead * (mean - turning[p])
        context[RATE + p] = rate[p]
        turning[p] = mean
    turning[3] = step


def initialise_accelerometers(
    time: float,
    specific_force: Vector,
    temperature: float,
    dwell: float,
    rate: Vector,
    gravity: float,
    noise_bound: float,
    held_fraction: float,
    seed: float,
    effect: Vector,
    error: Vector,
    held: Vector,
    generator: Vector,
    held_dwell: Vector,
    start: Vector,
    context: Vector,
    turning: Vector,
    previous_input: Vector,
    before: Vector,
    kept: Vector,
    waiting: Vector,
    increment_reading: Vector,
    noise_memory: Vector,
    noise_generator: Vector,
    noise_spare: Vector,
) -> int:
    """Draw the first errors; returns 0 or the number of a message."""
    if not gravity > 0.0:
        return 1
    start[0] = time
    context[HOURS] = 0.0
    seed_generator(seed, 2.0, generator)
    seed_noise(seed, 12.0, noise_memory, noise_generator, noise_spare)
    for p in range(3):
        held[p] = symmetric(generator)
        # The first input is a change from none.
        context[SENSE_INPUT + p] = 0.0
        previous_input[p] = 0.0
        follow_input(p, specific_force[p], gravity, context, previous_input)
    turning[3] = 0.0
    follow_rate(0.0, rate, turning, context)
    before[0] = 0.0
    before[1] = temperature
    keep(temperature, effect, before, kept, context)
    held_dwell[0] = dwell
    draw_error(noise_bound, held_fraction, held, generator, error)
    waiting[0] = 0.0
    for p in range(3):
        increment_reading[p] = 0.0
    return 0


def step_accelerometers(
    time: float,
    step: float,
    specific_force: Vector,
    temperature: float,
    dwell: float,
    rate: Vector,
    angle: Vector,
    gravity: float,
    noise_bound: float,
    held_fraction: float,
    effect: Vector,
    error: Vector,
    held: Vector,
    generator: Vector,
    held_dwell: Vector,
    start: Vector,
    context: Vector,
    turning: Vector,
    previous_input: Vector,
    before: Vector,
    kept: Vector,
    waiting: Vector,
    velocity_random_walk: Vector,
    bias_instability: Vector,
    acceleration_random_walk: Vector,
    acceleration_ramp: Vector,
    velocity_quantisation: Vector,
    noise_memory: Vector,
    noise_generator: Vector,
    noise_spare: Vector,
    noise: Vector,
) -> int:
    """Draw the errors of a new sample, the held ones at each new dwell; returns 0 or the number of a message."""
    for p in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(specific_force[p]) < 1e300:
            return 2
        if not math.fabs(rate[p]) < 1e300:
            return 3
        follow_input(p, specific_force[p], gravity, context, previous_input)
    for axis in range(2):
        if not math.fabs(angle[axis]) < 1e300:
            return 4
    # A step of 1e-14 s, with which some masters end, gives no acceleration.
    if step > 1e-9:
        follow_rate(step, rate, turning, context)
    context[HOURS] = (time + step - start[0]) / 3600.0
    keep(temperature, effect, before, kept, context)
    if dwell != held_dwell[0]:
        held_dwell[0] = dwell
        for p in range(3):
            held[p] = symmetric(generator)
    draw_error(noise_bound, held_fraction, held, generator, error)
    # A step of 1e-14 s, with which some masters end, is not a sample.
    if step > 1e-9:
        draw_noise(
            step,
            time + step - start[0],
            velocity_random_walk,
            bias_instability,
            acceleration_random_walk,
            acceleration_ramp,
            velocity_quantisation,
            noise_memory,
            noise_generator,
            noise_spare,
            noise,
        )
        for p in range(3):
            error[p] = error[p] + noise[p] / gravity
    waiting[0] = step
    return 0


def initialise_inverse(
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
) -> int:
    """Check that each accelerometer follows its own input more than the two others together, for both signs.

    Then the readings grow with the inputs along every line, for any choice of scale factors. Each reading has exactly
    one input, whose signs select the same scale factors with which it was solved. Returns 0 or the number of a message.
    """
    if not gravity > 0.0:
        return 1
    for p in range(3):
        cross = math.fabs(gamma_12) + math.fabs(gamma_13)
        if p == 1:
            cross = math.fabs(gamma_21) + math.fabs(gamma_23)
        if p == 2:
            cross = math.fabs(gamma_31) + math.fabs(gamma_32)
        if not (1.0 + scale_error_plus[p] > cross and 1.0 + scale_error_minus[p] > cross):
            return 2
    return 0


def step_inverse(
    reading: Vector,
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
) -> int:
    """Check parameters, which may have been tuned, and readings; returns 0 or the number of a message."""
    refused = initialise_inverse(
        gravity, scale_error_plus, scale_error_minus, gamma_21, gamma_31, gamma_12, gamma_32, gamma_13, gamma_23
    )
    if refused > 0:
        return refused
    for p in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(reading[p]) < 1e300:
            return 3
    return 0


def solve(
    right: Vector,
    diagonal: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
    n: Vector,
) -> None:
    """Solve A n = right (3,) by Cramer's rule; `diagonal` (3,) is A's."""
    minor_1 = diagonal[1] * diagonal[2] - gamma_23 * gamma_32
    minor_2 = gamma_21 * diagonal[2] - gamma_23 * gamma_31
    minor_3 = gamma_21 * gamma_32 - diagonal[1] * gamma_31
    determinant = diagonal[0] * minor_1 - gamma_12 * minor_2 + gamma_13 * minor_3
    n[0] = (
        right[0] * minor_1
        + right[1] * (gamma_13 * gamma_32 - gamma_12 * diagonal[2])
        + right[2] * (gamma_12 * gamma_23 - gamma_13 * diagonal[1])
    ) / determinant
    n[1] = (
        right[1] * (diagonal[0] * diagonal[2] - gamma_13 * gamma_31)
        - right[0] * minor_2
        + right[2] * (gamma_13 * gamma_21 - diagonal[0] * gamma_23)
    ) / determinant
    n[2] = (
        right[2] * (diagonal[0] * diagonal[1] - gamma_12 * gamma_21)
        + right[0] * minor_3
        + right[1] * (gamma_12 * gamma_31 - diagonal[0] * gamma_32)
    ) / determinant


def respond_inverse(
    reading: Vector,
    gravity: float,
    scale_error_plus: Vector,
    scale_error_minus: Vector,
    gamma_21: float,
    gamma_31: float,
    gamma_12: float,
    gamma_32: float,
    gamma_13: float,
    gamma_23: float,
    bias: Vector,
    specific_force: Vector,
    right: Vector,
    signs: Vector,
    best: Vector,
    diagonal: Vector,
    n: Vector,
) -> None:
    """Compute the specific force (3,) [m/s²] for which the block gives these readings (3,) [m/s²].

    The signs of the readings less bias are tried first. If the resulting inputs have other signs, all eight patterns
    are tried in a fixed order. One of them fits if the inverse is certain (`initialise_inverse`). At an input that is
    zero to rounding none may fit exactly: then the pattern that misses least is taken, on which both scale factors
    agree to rounding.
    """
    for p in range(3):
        right[p] = reading[p] / gravity - bias[p]
        signs[p] = right[p]
    least = 1.0
    for pattern in range(9):
        if least > 0.0:
            rest = pattern - 1
            for p in range(3):
                if pattern > 0:
                    signs[p] = -1.0
                    if rest >= 4:
                        signs[p] = 1.0
                        rest = rest - 4
                    rest = 2 * rest
                diagonal[p] = 1.0 + scale_error_minus[p]
                if signs[p] > 0.0:
                    diagonal[p] = 1.0 + scale_error_plus[p]
            solve(right, diagonal, gamma_21, gamma_31, gamma_12, gamma_32, gamma_13, gamma_23, n)
            missed = 0.0
            for p in range(3):
                # An input of zero counts as negative, as in the block.
                wrong = n[p]
                if signs[p] > 0.0:
                    wrong = -n[p]
                if wrong > missed:
                    missed = wrong
            if pattern == 0 or missed < least:
                least = missed
                for p in range(3):
                    best[p] = n[p]
    for p in range(3):
        specific_force[p] = gravity * best[p]
