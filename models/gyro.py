"""The gyro block, scale factors and misalignment, bias, bounded errors, increments in whole quanta; its inverse.

The stages are those of the accelerometer block, on the mean rate ω over a step: reading = ω + Γ ω + b + effects +
error, then the last stage. The increment is the reading's integral, rounded, with its remainder carried on.

The inverse is one to second order in the effects. The block reads r = (I + Γ) ω + b + e(ω), with e the effects'
addition to a step, which may depend on earlier steps. With ω₀ = (I + Γ)⁻¹ (r − b) and ω₁ = ω₀ − (I + Γ)⁻¹ e(ω₀), the
rate is ω = ω₀ − (I + Γ)⁻¹ e(ω₁): two terms of Neumann's series. Nothing is fed back, so the remainder of the series
cannot grow; an exact inverse of a lag of a step and more would.

Source: P. Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd ed. 2013, section
4.4.
"""

import math

from .noise import draw_noise, seed_noise
from .random_numbers import seed_generator, symmetric
from .restricted import (
    HOURS,
    INPUT,
    INTERVAL,
    PREVIOUS_RATE,
    PREVIOUS_STEPS,
    RESPONSE,
    STEP_LENGTH,
    TEMPERATURE,
    Vector,
)

HELD_RATES = 2.0
"""Kind of input: rates that hold over the step."""
INSTANTANEOUS_RATES = 3.0
"""Kind of input: rates at the end of the step; their mean is the trapezoid's."""


def reading_effects(context: Vector, rate: Vector, effect: Vector, added: Vector) -> None:
    """Stage "reading": what effects add to the readings (3,) [rad/s]; the nominal block adds nothing."""
    added[0] = 0.0
    added[1] = 0.0
    added[2] = 0.0


def final_effects(context: Vector, own: Vector, effect: Vector, reading: Vector) -> None:
    """Last stage: change the finished readings (3,) [rad/s], errors included; nominally nothing.

    `own` (3,) [rad/s] is each gyro's reading of its own input.
    """


def describe_step(
    hours: float,
    step: float,
    temperature: float,
    specific_force: Vector,
    interval: float,
    gravity: float,
    scale_misalignment: Vector,
    context: Vector,
) -> None:
    """Write the circumstances of a step into `context` (47,), for the effects; the previous rates are there already."""
    context[HOURS] = hours
    context[TEMPERATURE] = temperature
    # Before the first step the body is assumed to turn steadily: any nonzero length will do.
    context[STEP_LENGTH] = 1.0
    if step > 0.0:
        context[STEP_LENGTH] = step
    context[INTERVAL] = context[STEP_LENGTH]
    if interval > 0.0 and step > 0.0:
        context[INTERVAL] = interval
    for p in range(3):
        context[INPUT + p] = specific_force[p] / gravity
        for q in range(3):
            context[RESPONSE + 3 * p + q] = scale_misalignment[3 * p + q]
        context[RESPONSE + 4 * p] = 1.0 + scale_misalignment[4 * p]


def read_rates(
    scale_misalignment: Vector,
    bias: Vector,
    effect: Vector,
    error: Vector,
    rate_of_step: Vector,
    context: Vector,
    rate_reading: Vector,
    added: Vector,
    own: Vector,
) -> None:
    """Compute readings (3,) [rad/s] at the mean rate `rate_of_step` (3,) [rad/s], with the drawn error [rad/s]."""
    reading_effects(context, rate_of_step, effect, added)
    for p in range(3):
        value = rate_of_step[p]
        for q in range(3):
            value = value + scale_misalignment[3 * p + q] * rate_of_step[q]
        own[p] = rate_of_step[p] + scale_misalignment[4 * p] * rate_of_step[p]
        rate_reading[p] = value + bias[p] + added[p] + error[p]
    final_effects(context, own, effect, rate_reading)


def draw_error(noise_bound: float, generator: Vector, error: Vector) -> None:
    """Draw the error (3,) [rad/s] of a sample, uniform within ± `noise_bound`."""
    for p in range(3):
        error[p] = noise_bound * symmetric(generator)


def read_in_quanta(
    step: float, quantum: float, rate_reading: Vector, carried: Vector, increment_reading: Vector
) -> None:
    """Integrate readings (3,) over a step into increments (3,) [rad]; the remainder of a quantum is carried on."""
    for p in range(3):
        angle = rate_reading[p] * step + carried[p]
        increment_reading[p] = angle
        if quantum > 0.0:
            increment_reading[p] = quantum * math.floor(angle / quantum + 0.5)
        carried[p] = angle - increment_reading[p]


def initialise_gyros(
    time: float,
    rate: Vector,
    temperature: float,
    specific_force: Vector,
    interval: float,
    gravity: float,
    scale_misalignment: Vector,
    bias: Vector,
    noise_bound: float,
    seed: float,
    effect: Vector,
    rate_reading: Vector,
    increment_reading: Vector,
    error: Vector,
    generator: Vector,
    start: Vector,
    last_step: Vector,
    last_rate: Vector,
    rate_of_step: Vector,
    carried: Vector,
    context: Vector,
    added: Vector,
    own: Vector,
    noise_memory: Vector,
    noise_generator: Vector,
    noise_spare: Vector,
) -> int:
    """Read the rates at the start; there are no increments yet. Returns 0 or the number of a message."""
    if not gravity > 0.0:
        return 1
    start[0] = time
    last_step[0] = 0.0
    seed_generator(seed, 4.0, generator)
    seed_noise(seed, 14.0, noise_memory, noise_generator, noise_spare)
    for p in range(3):
        if not math.fabs(rate[p]) < 1e300:
            return 3
        last_rate[p] = rate[p]
        rate_of_step[p] = rate[p]
        carried[p] = 0.0
        increment_reading[p] = 0.0
        for k in range(PREVIOUS_STEPS):
            context[PREVIOUS_RATE + 3 * k + p] = rate[p]
    draw_error(noise_bound, generator, error)
    describe_step(0.0, 0.0, temperature, specific_force, interval, gravity, scale_misalignment, context)
    read_rates(scale_misalignment, bias, effect, error, rate_of_step, context, rate_reading, added, own)
    return 0


def keep_rate(first: int, rate_of_step: Vector, context: Vector) -> None:
    """Move the rate of the previous step into the history; before the first step the body is assumed to turn as in
    it."""
    for k in range(PREVIOUS_STEPS):
        at = PREVIOUS_RATE + 3 * (PREVIOUS_STEPS - 1 - k)
        for p in range(3):
            if first == 1 or at == PREVIOUS_RATE:
                context[at + p] = rate_of_step[p]
            else:
                context[at + p] = context[at - 3 + p]


def step_gyros(
    time: float,
    step: float,
    input_kind: float,
    rate: Vector,
    increment: Vector,
    temperature: float,
    specific_force: Vector,
    interval: float,
    gravity: float,
    scale_misalignment: Vector,
    bias: Vector,
    quantum: float,
    noise_bound: float,
    effect: Vector,
    rate_reading: Vector,
    increment_reading: Vector,
    error: Vector,
    generator: Vector,
    start: Vector,
    last_step: Vector,
    last_rate: Vector,
    rate_of_step: Vector,
    carried: Vector,
    context: Vector,
    added: Vector,
    own: Vector,
    angle_random_walk: Vector,
    bias_instability: Vector,
    rate_random_walk: Vector,
    rate_ramp: Vector,
    angle_quantisation: Vector,
    noise_memory: Vector,
    noise_generator: Vector,
    noise_spare: Vector,
    noise: Vector,
) -> int:
    """Read the rates and the increments over (time, time + step]; returns 0 or the number of a message.

    A step of 1e-14 s, with which some masters end, is not a sample.
    """
    if step <= 1e-9 * last_step[0]:
        return 0
    for p in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(specific_force[p]) < 1e300:
            return 2
        if not math.fabs(rate[p]) < 1e300:
            return 3
        if not math.fabs(increment[p]) < 1e300:
            return 4
    if not math.fabs(interval) < 1e300:
        return 5
    if last_step[0] > 0.0:
        keep_rate(0, rate_of_step, context)
    for p in range(3):
        if input_kind == HELD_RATES:
            rate_of_step[p] = rate[p]
        elif input_kind == INSTANTANEOUS_RATES:
            rate_of_step[p] = 0.5 * (last_rate[p] + rate[p])
        else:
            rate_of_step[p] = increment[p] / step
        last_rate[p] = rate[p]
    if last_step[0] == 0.0:
        keep_rate(1, rate_of_step, context)
    last_step[0] = step
    draw_error(noise_bound, generator, error)
    draw_noise(
        step,
        time + step - start[0],
        angle_random_walk,
        bias_instability,
        rate_random_walk,
        rate_ramp,
        angle_quantisation,
        noise_memory,
        noise_generator,
        noise_spare,
        noise,
    )
    for p in range(3):
        error[p] = error[p] + noise[p]
    hours = (time + step - start[0]) / 3600.0
    describe_step(hours, step, temperature, specific_force, interval, gravity, scale_misalignment, context)
    read_rates(scale_misalignment, bias, effect, error, rate_of_step, context, rate_reading, added, own)
    read_in_quanta(step, quantum, rate_reading, carried, increment_reading)
    return 0


def solve_response(scale_misalignment: Vector, right: Vector, n: Vector) -> None:
    """Solve (I + Γ) n = right (3,) by Cramer's rule."""
    a = 1.0 + scale_misalignment[0]
    e = 1.0 + scale_misalignment[4]
    i = 1.0 + scale_misalignment[8]
    b = scale_misalignment[1]
    c = scale_misalignment[2]
    d = scale_misalignment[3]
    f = scale_misalignment[5]
    g = scale_misalignment[6]
    h = scale_misalignment[7]
    x = right[0]
    y = right[1]
    z = right[2]
    determinant = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)
    n[0] = (x * (e * i - f * h) - b * (y * i - f * z) + c * (y * h - e * z)) / determinant
    n[1] = (a * (y * i - f * z) - x * (d * i - f * g) + c * (d * z - y * g)) / determinant
    n[2] = (a * (e * z - y * h) - b * (d * z - y * g) + x * (d * h - e * g)) / determinant


def can_be_solved(scale_misalignment: Vector) -> float:
    """Return 1.0 if each gyro follows its own axis more than the two others together, else 0.0."""
    for p in range(3):
        cross = 0.0
        for q in range(3):
            if q != p:
                cross = cross + math.fabs(scale_misalignment[3 * p + q])
        if not 1.0 + scale_misalignment[4 * p] > cross:
            return 0.0
    return 1.0


def initialise_gyro_inverse(
    time: float,
    gravity: float,
    scale_misalignment: Vector,
    rate: Vector,
    increment: Vector,
    start: Vector,
    last_step: Vector,
    nominal: Vector,
    corrected: Vector,
    context: Vector,
    corrected_context: Vector,
) -> int:
    """Begin at `time`, without a rate: there is no increment yet. Returns 0 or the number of a message."""
    if not gravity > 0.0:
        return 1
    if can_be_solved(scale_misalignment) == 0.0:
        return 2
    start[0] = time
    last_step[0] = 0.0
    for p in range(3):
        rate[p] = 0.0
        increment[p] = 0.0
        nominal[p] = 0.0
        corrected[p] = 0.0
        for k in range(PREVIOUS_STEPS):
            context[PREVIOUS_RATE + 3 * k + p] = 0.0
            corrected_context[PREVIOUS_RATE + 3 * k + p] = 0.0
    return 0


def take_out(
    scale_misalignment: Vector, nominal: Vector, added: Vector, right: Vector, n: Vector, result: Vector
) -> None:
    """Compute rates (3,) without effects: ω₀ − (I + Γ)⁻¹ e."""
    for p in range(3):
        right[p] = added[p]
    solve_response(scale_misalignment, right, n)
    for p in range(3):
        result[p] = nominal[p] - n[p]


def step_gyro_inverse(
    time: float,
    step: float,
    increment_reading: Vector,
    temperature: float,
    specific_force: Vector,
    interval: float,
    gravity: float,
    scale_misalignment: Vector,
    bias: Vector,
    effect: Vector,
    rate: Vector,
    increment: Vector,
    start: Vector,
    last_step: Vector,
    nominal: Vector,
    corrected: Vector,
    context: Vector,
    corrected_context: Vector,
    added: Vector,
    right: Vector,
    n: Vector,
) -> int:
    """Compute rates and increments of the body over (time, time + step]; returns 0 or the number of a message.

    A step of 1e-14 s, with which some masters end, is not a sample.
    """
    if step <= 1e-9 * last_step[0]:
        return 0
    if can_be_solved(scale_misalignment) == 0.0:
        return 2
    for p in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(increment_reading[p]) < 1e300:
            return 3
        if not math.fabs(specific_force[p]) < 1e300:
            return 4
    if not math.fabs(interval) < 1e300:
        return 5
    if last_step[0] > 0.0:
        keep_rate(0, nominal, context)
        keep_rate(0, corrected, corrected_context)
    for p in range(3):
        right[p] = increment_reading[p] / step - bias[p]
    solve_response(scale_misalignment, right, nominal)
    if last_step[0] == 0.0:
        keep_rate(1, nominal, context)
    first = last_step[0]
    last_step[0] = step
    hours = (time + step - start[0]) / 3600.0
    describe_step(hours, step, temperature, specific_force, interval, gravity, scale_misalignment, context)
    reading_effects(context, nominal, effect, added)
    take_out(scale_misalignment, nominal, added, right, n, corrected)
    if first == 0.0:
        keep_rate(1, corrected, corrected_context)
    describe_step(hours, step, temperature, specific_force, interval, gravity, scale_misalignment, corrected_context)
    reading_effects(corrected_context, corrected, effect, added)
    take_out(scale_misalignment, nominal, added, right, n, rate)
    for p in range(3):
        increment[p] = rate[p] * step
    return 0
