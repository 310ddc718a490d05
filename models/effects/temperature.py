"""Laws of temperature: of the gyros, and of second and third order of all sensors.

x is the temperature above 20 °C in units of 10 K, so that the coefficients of all orders are changes at 30 °C.

temperature_bias_quadratic, temperature_bias_cubic
    the bias of an accelerometer is a polynomial of x
temperature_scale_quadratic, temperature_scale_cubic
    the scale factor of an accelerometer is a polynomial of x
gyro_temperature_bias, gyro_temperature_scale
    biases, scale factors of the gyros are proportional to x
gyro_temperature_bias_quadratic, gyro_temperature_bias_cubic
    the biases of the gyros are polynomials of x
gyro_temperature_scale_quadratic, gyro_temperature_scale_cubic
    the scale factors of the gyros are polynomials of x
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from ..arrays import Floats
from ..restricted import TEMPERATURE, Vector
from .accelerometer import NOMINAL_TEMPERATURE, open_temperature
from .columns import Rows
from .definition import EffectParameter, EffectPlace, Sentence, accelerometer_effect, gyro_effect

TENS = 10.0
"""Kelvins in a unit of x."""
LARGEST_BIAS, LARGEST_SCALE = 1e-2, 1e-2
"""Changes at 30 °C of an accelerometer's bias [g] and scale factor."""
LARGEST_GYRO_BIAS, LARGEST_GYRO_SCALE = 0.05, 0.05
"""The same of a gyro, in rad/s and parts of one."""
UNIT_OF_BIAS = " 'rad/s'"
ORDERS, POWERS = ("linear", "square", "cube"), ("x", "x²", "x³")


def tens(temperature: float) -> float:
    """Return x: a temperature [degC] above 20 °C in units of 10 K."""
    return (temperature - NOMINAL_TEMPERATURE) / TENS


def of_orders(unit: str, order: int, largest: float) -> tuple[EffectParameter, ...]:
    """Return the coefficients of a polynomial of x: "linear", "square", and "cube" for order 3."""
    parameters = []
    for name, power in zip(ORDERS[:order], POWERS[:order], strict=True):
        parameters.append(EffectParameter(name, unit, f"the coefficient at {power}", largest))
    return tuple(parameters)


def open_polynomial(place: EffectPlace, size: Floats, rows: Rows, order: int) -> Floats:
    """Return the effect of half a last digit of the temperature on a polynomial, in the readings (N, 3).

    `size` (N,) is the value that the polynomial multiplies.
    """
    temperature = np.full(len(size), NOMINAL_TEMPERATURE) if rows.temperature is None else rows.temperature
    x = (temperature - NOMINAL_TEMPERATURE) / TENS
    slopes = [power * x ** (power - 1) / TENS for power in range(1, order + 1)]
    return open_temperature(place, np.abs(size) * np.linalg.norm(slopes, axis=0), rows)


def polynomial(sizes: Sequence[float]) -> str:
    """Return a polynomial of x without constant: "+1.0e-04 x -2.0e-05 x²"."""
    return " ".join(f"{size:+.2e} {power}" for size, power in zip(sizes, POWERS, strict=False))


def polynomial_sentence(words: str, unit: str) -> Sentence:
    """Return a sentence with the polynomial of an accelerometer."""

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        law = polynomial(list(values.values()))
        return f"{words} of accelerometer {place.index + 1} changes by {law}{unit}, x = (T - 20 °C)/10 K"

    return say


def temperature_bias_quadratic(context: Vector, n: Vector, p: int, linear: float, square: float, added: Vector) -> None:
    """Add c₁ x + c₂ x² to the reading of accelerometer p."""
    x = tens(context[TEMPERATURE])
    added[p] = added[p] + x * (linear + x * square)


BIAS_QUADRATIC = accelerometer_effect(
    temperature_bias_quadratic,
    of_orders("g", 2, LARGEST_BIAS),
    polynomial_sentence("the bias", " g"),
    open_argument=lambda place, rows: open_polynomial(place, np.ones(len(rows.hours)), rows, 2),
    contains=("temperature-bias",),
    formula="Δf_{p}/g = {linear} x + {square} x², x = (T − 20 °C)/(10 K)",
)


def temperature_bias_cubic(
    context: Vector, n: Vector, p: int, linear: float, square: float, cube: float, added: Vector
) -> None:
    """Add c₁ x + c₂ x² + c₃ x³ to the reading of accelerometer p."""
    x = tens(context[TEMPERATURE])
    added[p] = added[p] + x * (linear + x * (square + x * cube))


BIAS_CUBIC = accelerometer_effect(
    temperature_bias_cubic,
    of_orders("g", 3, LARGEST_BIAS),
    polynomial_sentence("the bias", " g"),
    open_argument=lambda place, rows: open_polynomial(place, np.ones(len(rows.hours)), rows, 3),
    contains=("temperature-bias", "temperature-bias-quadratic"),
    formula="Δf_{p}/g = {linear} x + {square} x² + {cube} x³, x = (T − 20 °C)/(10 K)",
)


def temperature_scale_quadratic(
    context: Vector, n: Vector, p: int, linear: float, square: float, added: Vector
) -> None:
    """Add (c₁ x + c₂ x²) n_p to the reading of accelerometer p."""
    x = tens(context[TEMPERATURE])
    added[p] = added[p] + x * (linear + x * square) * n[p]


SCALE_QUADRATIC = accelerometer_effect(
    temperature_scale_quadratic,
    of_orders("1", 2, LARGEST_SCALE),
    polynomial_sentence("the scale factor", ""),
    open_argument=lambda place, rows: open_polynomial(place, rows.n[:, place.index], rows, 2),
    contains=("temperature-scale",),
    degree=1,
    formula="Δf_{p}/g = ({linear} x + {square} x²) n_{p}, x = (T − 20 °C)/(10 K)",
)


def temperature_scale_cubic(
    context: Vector, n: Vector, p: int, linear: float, square: float, cube: float, added: Vector
) -> None:
    """Add (c₁ x + c₂ x² + c₃ x³) n_p to the reading of accelerometer p."""
    x = tens(context[TEMPERATURE])
    added[p] = added[p] + x * (linear + x * (square + x * cube)) * n[p]


SCALE_CUBIC = accelerometer_effect(
    temperature_scale_cubic,
    of_orders("1", 3, LARGEST_SCALE),
    polynomial_sentence("the scale factor", ""),
    open_argument=lambda place, rows: open_polynomial(place, rows.n[:, place.index], rows, 3),
    contains=("temperature-scale", "temperature-scale-quadratic"),
    degree=1,
    formula="Δf_{p}/g = ({linear} x + {square} x² + {cube} x³) n_{p}, x = (T − 20 °C)/(10 K)",
)


def of_gyros(unit: str, order: int, largest: float) -> tuple[EffectParameter, ...]:
    """Return the coefficients of three polynomials of x: "linear_1", "square_1", ..., gyro by gyro."""
    parameters = []
    for gyro in (1, 2, 3):
        for one in of_orders(unit, order, largest):
            parameters.append(replace(one, name=f"{one.name}_{gyro}", description=f"{one.description}, gyro {gyro}"))
    return tuple(parameters)


def gyro_sentence(words: str, order: int, unit: str) -> Sentence:
    """Return a sentence that lists the polynomials of the gyros."""

    def say(place: EffectPlace, values: Mapping[str, float]) -> str:
        sizes = list(values.values())
        laws = []
        for first in range(0, len(sizes), order):
            laws.append(polynomial(sizes[first : first + order]))
        return f"{words} change by {', '.join(laws)}{unit}, x = (T - 20 °C)/10 K"

    return say


def gyro_formula(order: int, factor: str) -> str:
    """Return the formula of three polynomials of x, times a quantity of each gyro, "ω" or nothing."""
    laws = []
    for gyro in (1, 2, 3):
        terms = [f"{{{name}_{gyro}}} {power}" for name, power in zip(ORDERS[:order], POWERS, strict=False)]
        laws.append(f"({' + '.join(terms)}) {factor}_{gyro}" if factor else " + ".join(terms))
    return f"Δω = ({', '.join(laws)}){'' if factor else UNIT_OF_BIAS}, x = (T − 20 °C)/(10 K)"


def gyro_temperature_bias(
    context: Vector, rate: Vector, linear_1: float, linear_2: float, linear_3: float, added: Vector
) -> None:
    """Add c₁ x to the reading of each gyro."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * linear_1
    added[1] = added[1] + x * linear_2
    added[2] = added[2] + x * linear_3


GYRO_BIAS = gyro_effect(
    gyro_temperature_bias,
    of_gyros("rad/s", 1, LARGEST_GYRO_BIAS),
    gyro_sentence("the biases of the gyros", 1, " rad/s"),
    formula=gyro_formula(1, ""),
)


def gyro_temperature_bias_quadratic(
    context: Vector,
    rate: Vector,
    linear_1: float,
    square_1: float,
    linear_2: float,
    square_2: float,
    linear_3: float,
    square_3: float,
    added: Vector,
) -> None:
    """Add c₁ x + c₂ x² to the reading of each gyro."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * (linear_1 + x * square_1)
    added[1] = added[1] + x * (linear_2 + x * square_2)
    added[2] = added[2] + x * (linear_3 + x * square_3)


GYRO_BIAS_QUADRATIC = gyro_effect(
    gyro_temperature_bias_quadratic,
    of_gyros("rad/s", 2, LARGEST_GYRO_BIAS),
    gyro_sentence("the biases of the gyros", 2, " rad/s"),
    contains=("gyro-temperature-bias",),
    formula=gyro_formula(2, ""),
)


def gyro_temperature_bias_cubic(
    context: Vector,
    rate: Vector,
    linear_1: float,
    square_1: float,
    cube_1: float,
    linear_2: float,
    square_2: float,
    cube_2: float,
    linear_3: float,
    square_3: float,
    cube_3: float,
    added: Vector,
) -> None:
    """Add c₁ x + c₂ x² + c₃ x³ to the reading of each gyro."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * (linear_1 + x * (square_1 + x * cube_1))
    added[1] = added[1] + x * (linear_2 + x * (square_2 + x * cube_2))
    added[2] = added[2] + x * (linear_3 + x * (square_3 + x * cube_3))


GYRO_BIAS_CUBIC = gyro_effect(
    gyro_temperature_bias_cubic,
    of_gyros("rad/s", 3, LARGEST_GYRO_BIAS),
    gyro_sentence("the biases of the gyros", 3, " rad/s"),
    contains=("gyro-temperature-bias", "gyro-temperature-bias-quadratic"),
    formula=gyro_formula(3, ""),
)


def gyro_temperature_scale(
    context: Vector, rate: Vector, linear_1: float, linear_2: float, linear_3: float, added: Vector
) -> None:
    """Add (c₁ x) ω_p to the reading of each gyro p."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * linear_1 * rate[0]
    added[1] = added[1] + x * linear_2 * rate[1]
    added[2] = added[2] + x * linear_3 * rate[2]


GYRO_SCALE = gyro_effect(
    gyro_temperature_scale,
    of_gyros("1", 1, LARGEST_GYRO_SCALE),
    gyro_sentence("the scale factors of the gyros", 1, ""),
    formula=gyro_formula(1, "ω"),
)


def gyro_temperature_scale_quadratic(
    context: Vector,
    rate: Vector,
    linear_1: float,
    square_1: float,
    linear_2: float,
    square_2: float,
    linear_3: float,
    square_3: float,
    added: Vector,
) -> None:
    """Add (c₁ x + c₂ x²) ω_p to the reading of each gyro p."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * (linear_1 + x * square_1) * rate[0]
    added[1] = added[1] + x * (linear_2 + x * square_2) * rate[1]
    added[2] = added[2] + x * (linear_3 + x * square_3) * rate[2]


GYRO_SCALE_QUADRATIC = gyro_effect(
    gyro_temperature_scale_quadratic,
    of_gyros("1", 2, LARGEST_GYRO_SCALE),
    gyro_sentence("the scale factors of the gyros", 2, ""),
    contains=("gyro-temperature-scale",),
    formula=gyro_formula(2, "ω"),
)


def gyro_temperature_scale_cubic(
    context: Vector,
    rate: Vector,
    linear_1: float,
    square_1: float,
    cube_1: float,
    linear_2: float,
    square_2: float,
    cube_2: float,
    linear_3: float,
    square_3: float,
    cube_3: float,
    added: Vector,
) -> None:
    """Add (c₁ x + c₂ x² + c₃ x³) ω_p to the reading of each gyro p."""
    x = tens(context[TEMPERATURE])
    added[0] = added[0] + x * (linear_1 + x * (square_1 + x * cube_1)) * rate[0]
    added[1] = added[1] + x * (linear_2 + x * (square_2 + x * cube_2)) * rate[1]
    added[2] = added[2] + x * (linear_3 + x * (square_3 + x * cube_3)) * rate[2]


GYRO_SCALE_CUBIC = gyro_effect(
    gyro_temperature_scale_cubic,
    of_gyros("1", 3, LARGEST_GYRO_SCALE),
    gyro_sentence("the scale factors of the gyros", 3, ""),
    contains=("gyro-temperature-scale", "gyro-temperature-scale-quadratic"),
    formula=gyro_formula(3, "ω"),
)

EFFECTS = (
    BIAS_QUADRATIC,
    BIAS_CUBIC,
    SCALE_QUADRATIC,
    SCALE_CUBIC,
    GYRO_BIAS,
    GYRO_BIAS_QUADRATIC,
    GYRO_BIAS_CUBIC,
    GYRO_SCALE,
    GYRO_SCALE_QUADRATIC,
    GYRO_SCALE_CUBIC,
)
