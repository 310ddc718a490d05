"""Algorithms that update at every gyro sample: from the increment and, where they need it, the one before."""

import math
from functools import partial

from ..restricted import Vector
from .definition import Algorithm
from .quaternion_forms import (
    add_cross,
    add_increment,
    clear,
    complete_rodrigues,
    complete_rotation_vector,
    dot,
    sum_of_increments,
)


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


_algorithm = partial(Algorithm, samples=1)

ALGORITHMS = (
    _algorithm(
        2,
        "one sample, mean angular rate",
        "Chelnokov et al. 2016, (7.18)",
        mean_rate,
        order=2,
        coning_order=2,
        constant_rate=True,
        max_increment=math.pi,
    ),
    _algorithm(
        3,
        "one sample and the one before, series of the quaternion",
        "Chelnokov et al. 2016, (7.20)",
        one_sample_quaternion,
        order=3,
        coning_order=4,
        norm_order=3,
        previous=True,
        max_increment=0.86,
    ),
    _algorithm(
        4,
        "one sample and the one before, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (19)",
        one_sample_rodrigues,
        order=3,
        coning_order=4,
        previous=True,
        max_increment=1.15,
    ),
    _algorithm(
        5,
        "one sample and the one before, modified Rodrigues parameters, second form",
        "Chelnokov et al. 2016, (20)",
        one_sample_rodrigues_symmetric,
        order=3,
        coning_order=4,
        previous=True,
        max_increment=1.15,
    ),
)
