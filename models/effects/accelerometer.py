"""Effects on an accelerometer's reading.

Functions of the inputs n [g] at that moment:

quadratic, cubic, odd_quadratic
    c n_p², c n_p³ and c n_p |n_p|: the terms K2, K3 and Koq of the response
cross_product, cross_square
    c n_i n_j and c n_j²: the couplings Kip, Kio, Kpo, and Kpp, Koo, by the inputs of the others
bias_asymmetry, scale_asymmetry
    c sign(n_p), K0', and c |n_p|: bias and scale factor depend on the sign of the input

Functions of other quantities:

bias_drift, scale_drift
    a bias, a scale factor that grows with time
temperature_bias, temperature_scale
    a bias, a scale factor that depends on the temperature
hysteresis
    the reading lags the last change of the input
lever_arm
    the size effect: an accelerometer away from the block's centre senses the block's turning
accelerometer_lag
    the reading follows its input through a low-pass of the first order, to first order of its time constant
"""

import math
from itertools import product

import numpy as np

from ..arrays import Floats
from ..restricted import ANGULAR_ACCELERATION, BLOCK_RESPONSE, GRAVITY, HOURS, RATE, SENSE_INPUT, TEMPERATURE, Vector
from .columns import Rows
from .definition import (
    ACCELEROMETERS,
    EffectParameter,
    EffectPlace,
    accelerometer_column,
    accelerometer_effect,
)

NOMINAL_TEMPERATURE = 20.0
"""Temperature [degC] at which effects of temperature vanish."""


def quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p]


QUADRATIC = accelerometer_effect(
    quadratic,
    EffectParameter("coefficient", "1/g", "c of c n²: response to the square of the input", 1e-2),
    "accelerometer {p} responds to the square of its input: {coefficient:+.2e} n² (n in g)",
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p}²",
)


def cubic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p³ to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * n[p] * n[p]


CUBIC = accelerometer_effect(
    cubic,
    EffectParameter("coefficient", "1/g2", "c of c n³: response to the cube of the input", 1e-2),
    "accelerometer {p} responds to the cube of its input: {coefficient:+.2e} n³ (n in g)",
    degree=3,
    formula="Δf_{p}/g = {coefficient} n_{p}³",
)


def odd_quadratic(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c n_p |n_p| to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[p] * math.fabs(n[p])


ODD_QUADRATIC = accelerometer_effect(
    odd_quadratic,
    EffectParameter("coefficient", "1/g", "c of c n |n|: response to the signed square of the input", 1e-2),
    "accelerometer {p} responds to the signed square of its input: {coefficient:+.2e} n |n| (n in g)",
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{p} |n_{p}|",
)


def cross_product(context: Vector, n: Vector, p: int, i: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_i n_j to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[i] * n[j]


CROSS_PRODUCT = accelerometer_effect(
    cross_product,
    EffectParameter("coefficient", "1/g", "c of c n_i n_j: response to the product of two inputs", 1e-2),
    "accelerometer {p} responds to the product of the inputs {i} and {j}: {coefficient:+.2e} n{i} n{j} (n in g)",
    places=tuple(
        EffectPlace("cross-product", where, axes=axes)
        for where, axes in product(ACCELEROMETERS, ((1, 2), (1, 3), (2, 3)))
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i} n_{j}",
)


def cross_square(context: Vector, n: Vector, p: int, j: int, coefficient: float, added: Vector) -> None:
    """Add c n_j² to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * n[j] * n[j]


CROSS_SQUARE = accelerometer_effect(
    cross_square,
    EffectParameter("coefficient", "1/g", "c of c n_j²: response to the square of another input", 1e-2),
    "accelerometer {p} responds to the square of the input of accelerometer {i}: {coefficient:+.2e} n{i}² (n in g)",
    places=tuple(
        EffectPlace("cross-square", where, axes=(j,))
        for p, where in enumerate(ACCELEROMETERS, start=1)
        for j in (1, 2, 3)
        if j != p
    ),
    degree=2,
    formula="Δf_{p}/g = {coefficient} n_{i}²",
)


def scale_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c |n_p| to the reading of accelerometer p; c = (Γ⁺ - Γ⁻)/2."""
    added[p] = added[p] + coefficient * math.fabs(n[p])


SCALE_ASYMMETRY = accelerometer_effect(
    scale_asymmetry,
    EffectParameter("coefficient", "1", "c of c |n|: half of Γ⁺ - Γ⁻", 2e-2),
    "the scale factor of accelerometer {p} differs between the signs of its input: {coefficient:+.2e} |n|",
    within="asymmetric",
    degree=1,
    formula="Δf_{p}/g = {coefficient} |n_{p}|",
)


def bias_asymmetry(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c sign(n_p) to the reading of accelerometer p."""
    if n[p] > 0.0:
        added[p] = added[p] + coefficient
    if n[p] < 0.0:
        added[p] = added[p] - coefficient


BIAS_ASYMMETRY = accelerometer_effect(
    bias_asymmetry,
    EffectParameter("coefficient", "g", "c of c sign(n): half of the difference of the biases", 1e-2),
    "the bias of accelerometer {p} depends on the sign of its input: {coefficient:+.2e} g for a positive one, "
    "the opposite for a negative one",
    formula="Δf_{p}/g = {coefficient} sign(n_{p})",
)


def bias_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS]


BIAS_DRIFT = accelerometer_effect(
    bias_drift,
    EffectParameter("rate", "g/h", "growth of the bias with time", 1e-1),
    "the bias of accelerometer {p} drifts by {rate:+.2e} g an hour",
    formula="Δf_{p}/g = {rate} t, t 'in hours'",
)


def scale_drift(context: Vector, n: Vector, p: int, rate: float, added: Vector) -> None:
    """Add rate·hours·n_p to the reading of accelerometer p."""
    added[p] = added[p] + rate * context[HOURS] * n[p]


SCALE_DRIFT = accelerometer_effect(
    scale_drift,
    EffectParameter("rate", "1/h", "growth of the scale factor with time", 1e-1),
    "the scale factor of accelerometer {p} drifts by {rate:+.2e} an hour",
    degree=1,
    formula="Δf_{p}/g = {rate} t n_{p}, t 'in hours'",
)


def open_temperature(place: EffectPlace, values: Floats, rows: Rows) -> Floats:
    """Return the effect of half a last digit of the temperature on values (N,) per kelvin, in the readings (N, 3)."""
    return accelerometer_column(place, values * rows.temperature_resolution)[..., 0]


def temperature_bias(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE)


TEMPERATURE_BIAS = accelerometer_effect(
    temperature_bias,
    EffectParameter("coefficient", "g/K", "c of c (T - 20 degC): change of the bias with temperature", 1e-3),
    "the bias of accelerometer {p} changes by {coefficient:+.2e} g per kelvin",
    open_argument=lambda place, rows: open_temperature(place, np.ones(len(rows.hours)), rows),
    formula="Δf_{p}/g = {coefficient} (T − 20 °C)",
)


def temperature_scale(context: Vector, n: Vector, p: int, coefficient: float, added: Vector) -> None:
    """Add c (T - 20) n_p to the reading of accelerometer p."""
    added[p] = added[p] + coefficient * (context[TEMPERATURE] - NOMINAL_TEMPERATURE) * n[p]


TEMPERATURE_SCALE = accelerometer_effect(
    temperature_scale,
    EffectParameter("coefficient", "1/K", "c of c (T - 20 degC) n: change of the scale factor with temperature", 1e-3),
    "the scale factor of accelerometer {p} changes by {coefficient:+.2e} per kelvin",
    open_argument=lambda place, rows: open_temperature(place, np.abs(rows.n[:, place.index]), rows),
    degree=1,
    formula="Δf_{p}/g = {coefficient} (T − 20 °C) n_{p}",
)


def hysteresis(context: Vector, n: Vector, p: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of accelerometer p; the sense is that of the last change of its input."""
    added[p] = added[p] - 0.5 * width * context[SENSE_INPUT + p]


def hysteresis_untold(place: EffectPlace, rows: Rows) -> Floats:
    """Return half of the width (N, 3), per unit of it, where the sense of the last change of the input is unknown."""
    return accelerometer_column(place, np.where(rows.sense_told[:, place.index], 0.0, 0.5))[..., 0]


HYSTERESIS = accelerometer_effect(
    hysteresis,
    EffectParameter("width", "g", "difference of readings after falling and after rising input", 1e-2, smallest=0.0),
    "accelerometer {p} reads {width:.2e} g less after a rising input than after a falling one",
    untold=hysteresis_untold,
    formula="Δf_{p}/g = − 'sense of the last change of' n_{p} · {width} / 2",
)


def lever_arm(context: Vector, n: Vector, p: int, r_1: float, r_2: float, r_3: float, added: Vector) -> None:
    """Add the response of accelerometer p to ω × (ω × r) + ω' × r, over g, along its axis and, misaligned, the others.

    Source: P. Savage, "Strapdown inertial navigation integration algorithm design", part 2, 1998: the size effect.
    """
    x = context[RATE]
    y = context[RATE + 1]
    z = context[RATE + 2]
    along = x * r_1 + y * r_2 + z * r_3
    square = x * x + y * y + z * z
    turned = context[ANGULAR_ACCELERATION + 1] * r_3 - context[ANGULAR_ACCELERATION + 2] * r_2
    sensed = context[BLOCK_RESPONSE + 3 * p] * (x * along - square * r_1 + turned)
    turned = context[ANGULAR_ACCELERATION + 2] * r_1 - context[ANGULAR_ACCELERATION] * r_3
    sensed = sensed + context[BLOCK_RESPONSE + 3 * p + 1] * (y * along - square * r_2 + turned)
    turned = context[ANGULAR_ACCELERATION] * r_2 - context[ANGULAR_ACCELERATION + 1] * r_1
    sensed = sensed + context[BLOCK_RESPONSE + 3 * p + 2] * (z * along - square * r_3 + turned)
    added[p] = added[p] + sensed / context[GRAVITY]


LEVER_ARM = accelerometer_effect(
    lever_arm,
    tuple(
        EffectParameter(f"r_{k}", "m", f"position of the accelerometer along axis {k}, from the block's centre", 0.5)
        for k in (1, 2, 3)
    ),
    lambda place, values: (
        f"accelerometer {place.index + 1} is off the block's centre: "
        + ", ".join(f"{1e3 * value:+.3g}" for value in values.values())
        + " mm along the axes"
    ),
    formula="Δf_{p}/g = ((I + Γ) (ω × (ω × r) + dω/dt × r))_{p} / g, r = ({r_1}, {r_2}, {r_3}) 'm'",
)


def accelerometer_lag(context: Vector, n: Vector, p: int, time: float, added: Vector) -> None:
    """Add -τ times the change of the reading of accelerometer p with its inputs to it; for a block that turns below a
    vertical, the inputs change by -ω × n."""
    first = context[RATE + 1] * n[2] - context[RATE + 2] * n[1]
    second = context[RATE + 2] * n[0] - context[RATE] * n[2]
    third = context[RATE] * n[1] - context[RATE + 1] * n[0]
    change = context[BLOCK_RESPONSE + 3 * p] * first + context[BLOCK_RESPONSE + 3 * p + 1] * second
    added[p] = added[p] + time * (change + context[BLOCK_RESPONSE + 3 * p + 2] * third)


ACCELEROMETER_LAG = accelerometer_effect(
    accelerometer_lag,
    EffectParameter("time", "s", "time constant of the low-pass", 1e-2, smallest=0.0),
    lambda place, values: (
        f"accelerometer {place.index + 1} lags its input by {1e3 * values['time']:.4g} ms, more than the others do"
    ),
    formula="Δf_{p}/g = {time} 's' ((I + Γ) (ω × n))_{p}",
)

EFFECTS = (
    QUADRATIC,
    CUBIC,
    ODD_QUADRATIC,
    CROSS_PRODUCT,
    CROSS_SQUARE,
    BIAS_ASYMMETRY,
    SCALE_ASYMMETRY,
    BIAS_DRIFT,
    SCALE_DRIFT,
    TEMPERATURE_BIAS,
    TEMPERATURE_SCALE,
    HYSTERESIS,
    LEVER_ARM,
    ACCELEROMETER_LAG,
)
