"""The inverse of the gyro block to second order in its effects: increments that were read to increments of the body.

The block reads r = (I + Γ) ω + b + e(ω), with e what effects add to a step, by the steps before too. With
ω₀ = (I + Γ)⁻¹ (r − b) and ω₁ = ω₀ − (I + Γ)⁻¹ e(ω₀), the rate is ω = ω₀ − (I + Γ)⁻¹ e(ω₁): two terms of Neumann's
series. Nothing is fed back, so what the series leaves out cannot grow; an exact inverse of a lag of a step and more
would.

Source: P. Groves, "Principles of GNSS, inertial, and multisensor integrated navigation systems", 2nd ed. 2013,
section 4.4, solved for the rate.
"""

import math

from .gyro import describe_step, keep_rate, reading_effects
from .restricted import PREVIOUS_STEPS, Vector


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
    """1.0 where each gyro follows its own axis more than the two others together, else 0.0."""
    certain = 1.0
    for p in range(3):
        others = 0.0
        for q in range(3):
            if q != p:
                others = others + math.fabs(scale_misalignment[3 * p + q])
        if not 1.0 + scale_misalignment[4 * p] > others:
            certain = 0.0
    return certain


def initialise(
    time: float,
    gravity: float,
    scale_misalignment: Vector,
    rate: Vector,
    increment: Vector,
    start: Vector,
    hours: Vector,
    last_step: Vector,
    nominal_rates: Vector,
    corrected_rates: Vector,
    nominal: Vector,
    corrected: Vector,
) -> int:
    """Begin at `time`, without a rate: there is no increment yet. Returns 0 or the number of a message."""
    if not gravity > 0.0:
        return 1
    certain = can_be_solved(scale_misalignment)
    if not certain > 0.0:
        return 2
    start[0] = time
    hours[0] = 0.0
    last_step[0] = 0.0
    for p in range(3):
        rate[p] = 0.0
        increment[p] = 0.0
        nominal[p] = 0.0
        corrected[p] = 0.0
        for k in range(PREVIOUS_STEPS):
            nominal_rates[3 * k + p] = 0.0
            corrected_rates[3 * k + p] = 0.0
    return 0


def take_out(
    scale_misalignment: Vector, nominal: Vector, added: Vector, right: Vector, n: Vector, result: Vector
) -> None:
    """Rates (3,) without what effects add: ω₀ − (I + Γ)⁻¹ e."""
    for p in range(3):
        right[p] = added[p]
    solve_response(scale_misalignment, right, n)
    for p in range(3):
        result[p] = nominal[p] - n[p]


def step(
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
    hours: Vector,
    last_step: Vector,
    nominal_rates: Vector,
    corrected_rates: Vector,
    nominal: Vector,
    corrected: Vector,
    context: Vector,
    added: Vector,
    right: Vector,
    n: Vector,
) -> int:
    """Rates and increments of the body over (time, time + step]; returns 0 or the number of a message.

    A step of 1e-14 s, with which some masters end, is no sample.
    """
    if step <= 1e-9 * last_step[0]:
        return 0
    certain = can_be_solved(scale_misalignment)
    if not certain > 0.0:
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
        keep_rate(0, nominal, nominal_rates)
        keep_rate(0, corrected, corrected_rates)
    for p in range(3):
        right[p] = increment_reading[p] / step - bias[p]
    solve_response(scale_misalignment, right, nominal)
    if last_step[0] == 0.0:
        keep_rate(1, nominal, nominal_rates)
    first = last_step[0]
    last_step[0] = step
    hours[0] = (time + step - start[0]) / 3600.0
    describe_step(temperature, specific_force, interval, gravity, hours, last_step, nominal_rates, context)
    reading_effects(context, nominal, effect, added)
    take_out(scale_misalignment, nominal, added, right, n, corrected)
    if first == 0.0:
        keep_rate(1, corrected, corrected_rates)
    describe_step(temperature, specific_force, interval, gravity, hours, last_step, corrected_rates, context)
    reading_effects(context, corrected, effect, added)
    take_out(scale_misalignment, nominal, added, right, n, rate)
    for p in range(3):
        increment[p] = rate[p] * step
    return 0
