"""Algorithms each with a formula of its own: from one gyro sample, and where they need it the one before, or from two.

γ' and γ'' are the increments of the two halves of a step. Their products are those that a rotation vector of the same
accuracy has: velocity goes by them.
"""

import math
from fractions import Fraction
from functools import partial

from ..restricted import Vector
from ..rotation import (
    add_cross,
    add_increment,
    clear,
    complete_rodrigues,
    complete_rotation_vector,
    dot,
    scale_vector,
    square_of_vector,
    sum_of_increments,
)
from .definition import Algorithm


def mean_rate(g: Vector, turned: Vector) -> None:
    """Equation (7.18): φ = γ."""
    sum_of_increments(g, 1, turned)
    complete_rotation_vector(turned)


def one_sample_quaternion(previous: Vector, g: Vector, turned: Vector) -> None:
    """Equation (7.20): λ0 = 1 - γ·γ/8, λv = (1/2 - γ·γ/48) γ + (γ* × γ)/24."""
    square = dot(g, 0, g, 0)
    clear(turned)
    turned[0] = 1.0 - square / 8.0
    add_increment(0.5 - square / 48.0, g, 0, turned)
    add_cross(1.0 / 24.0, previous, 0, g, 0, turned)


def one_sample_rodrigues(previous: Vector, g: Vector, turned: Vector) -> None:
    """Equation (19): x = γ/4 + (γ* × γ)/48 - ((γ·γ) γ* - 2 (γ·γ*) γ)/192."""
    clear(turned)
    add_increment(0.25 + dot(g, 0, previous, 0) / 96.0, g, 0, turned)
    add_increment(-dot(g, 0, g, 0) / 192.0, previous, 0, turned)
    add_cross(1.0 / 48.0, previous, 0, g, 0, turned)
    complete_rodrigues(turned)


def one_sample_rodrigues_symmetric(previous: Vector, g: Vector, turned: Vector) -> None:
    """Equation (20): x = γ/4 + (γ* × γ)/48 + ((γ*·γ*) γ* + (γ·γ) γ)/384."""
    clear(turned)
    add_increment(0.25 + dot(g, 0, g, 0) / 384.0, g, 0, turned)
    add_increment(dot(previous, 0, previous, 0) / 384.0, previous, 0, turned)
    add_cross(1.0 / 48.0, previous, 0, g, 0, turned)
    complete_rodrigues(turned)


def two_sample_rodrigues(g: Vector, turned: Vector) -> None:
    """Equation (22): x = (1/4 + γ'·γ'/48) γ' + (1/4 + γ''·γ''/48) γ'' + (γ' × γ'')/6."""
    clear(turned)
    add_increment(0.25 + dot(g, 0, g, 0) / 48.0, g, 0, turned)
    add_increment(0.25 + dot(g, 1, g, 1) / 48.0, g, 1, turned)
    add_cross(1.0 / 6.0, g, 0, g, 1, turned)
    complete_rodrigues(turned)


def two_sample_rodrigues_second_iterate(g: Vector, turned: Vector) -> None:
    """Equation (23); the term -(1/2)∫ ω × x dt that (22) has is left out, so it is of third order, not of fourth.

    x = (1/4 + (γ'·γ' + γ'·γ'' + γ''·γ'')/48) γ' + (1/4 + (γ''·γ'' - γ'·γ'' - γ'·γ')/48) γ'' + (γ' × γ'')/6
    """
    first = dot(g, 0, g, 0)
    mixed = dot(g, 0, g, 1)
    second = dot(g, 1, g, 1)
    clear(turned)
    add_increment(0.25 + (first + mixed + second) / 48.0, g, 0, turned)
    add_increment(0.25 + (second - mixed - first) / 48.0, g, 1, turned)
    add_cross(1.0 / 6.0, g, 0, g, 1, turned)
    complete_rodrigues(turned)


def two_sample_rodrigues_third_order(g: Vector, turned: Vector) -> None:
    """Equation (21): x = (γ' + γ'')/4 + (γ' × γ'')/6 - (γ'' ∘ γ' ∘ γ'')/24."""
    clear(turned)
    add_increment(0.25 - dot(g, 1, g, 1) / 24.0, g, 0, turned)
    add_increment(0.25 + dot(g, 0, g, 1) / 12.0, g, 1, turned)
    add_cross(1.0 / 6.0, g, 0, g, 1, turned)
    complete_rodrigues(turned)


def two_sample_quaternion(g: Vector, turned: Vector) -> None:
    """Equation (7.22): with s = γ' + γ'', λ0 = 1 - s·s/8, λv = (1/2 - s·s/48) s + (γ' × γ'')/3."""
    sum_of_increments(g, 2, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0
    scale_vector(0.5 - square / 48.0, turned)
    add_cross(1.0 / 3.0, g, 0, g, 1, turned)


def two_sample_textbook(g: Vector, turned: Vector) -> None:
    """[1, p. 355]: φ = γ' + γ'' + (2/3) γ' × γ'', f = φ·φ, λ0 = 1 - f/8 + f²/384, λv = (1/2 - f/48) φ."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0 + square * square / 384.0
    scale_vector(0.5 - square / 48.0, turned)


def two_sample_textbook_as_run(g: Vector, turned: Vector) -> None:
    """[1, p. 355] without f²/384: λ0 = 1 - s·s/8, λv = (1/2 - s·s/48) s + (1/3)(1 - s·s/24) γ' × γ''."""
    sum_of_increments(g, 2, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0
    scale_vector(0.5 - square / 48.0, turned)
    add_cross((1.0 - square / 24.0) / 3.0, g, 0, g, 1, turned)


def two_sample_fifth_power(g: Vector, turned: Vector) -> None:
    """x = (1 + f/48 + f²/1920) φ/4, f = φ·φ, φ = γ' + γ'' + (2/3) γ' × γ'': tan(φ/4) to the fifth power."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    scale_vector(0.25 * (1.0 + square / 48.0 + square * square / 1920.0), turned)
    complete_rodrigues(turned)


_of_two = partial(Algorithm, samples=2, coning_order=4, products=((0, 1, Fraction(2, 3)),))
_with_the_one_before = partial(
    Algorithm, samples=1, order=3, coning_order=4, previous=True, products=((-1, 0, Fraction(1, 12)),)
)

ALGORITHMS = (
    Algorithm(
        2,
        "one sample, mean angular rate",
        "Chelnokov et al. 2016, (7.18)",
        mean_rate,
        samples=1,
        order=2,
        coning_order=2,
        constant_rate=True,
        max_increment=math.pi,
    ),
    _with_the_one_before(
        3,
        "one sample and the one before, series of the quaternion",
        "Chelnokov et al. 2016, (7.20)",
        one_sample_quaternion,
        norm_order=3,
        max_increment=0.86,
    ),
    _with_the_one_before(
        4,
        "one sample and the one before, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (19)",
        one_sample_rodrigues,
        max_increment=1.15,
    ),
    _with_the_one_before(
        5,
        "one sample and the one before, modified Rodrigues parameters, second form",
        "Chelnokov et al. 2016, (20)",
        one_sample_rodrigues_symmetric,
        max_increment=1.15,
    ),
    _of_two(
        1,
        "two samples, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (22)",
        two_sample_rodrigues,
        order=4,
        max_increment=0.57,
    ),
    _of_two(
        6,
        "two samples, modified Rodrigues parameters, second Picard iterate",
        "Chelnokov et al. 2016, (23)",
        two_sample_rodrigues_second_iterate,
        order=3,
        max_increment=0.57,
    ),
    _of_two(
        7,
        "two samples, modified Rodrigues parameters, third order",
        "Chelnokov et al. 2016, (21)",
        two_sample_rodrigues_third_order,
        order=3,
        max_increment=0.57,
    ),
    _of_two(
        8,
        "two samples, series of the quaternion",
        "Chelnokov et al. 2016, (7.22)",
        two_sample_quaternion,
        order=4,
        norm_order=3,
        max_increment=0.43,
    ),
    _of_two(
        9,
        "two samples, rotation vector and series, as the textbook has it",
        "Chelnokov et al. 2016, [1, p. 355]",
        two_sample_textbook,
        order=4,
        norm_order=5,
        max_increment=0.58,
    ),
    _of_two(
        10,
        "two samples, rotation vector and series, as the paper must have run it",
        "Chelnokov et al. 2016, [1, p. 355] (fitted to the published errors)",
        two_sample_textbook_as_run,
        order=4,
        norm_order=3,
        max_increment=0.43,
    ),
    _of_two(
        12,
        "two samples, rotation vector, modified Rodrigues parameters to the fifth power",
        "(22) with the term in φ⁵ that it leaves out",
        two_sample_fifth_power,
        order=4,
        max_increment=0.94,
    ),
)
