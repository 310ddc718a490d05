"""Algorithms that update at every second gyro sample; γ' and γ'' are the increments of the two halves of a step."""

import math

from ..restricted import Vector
from .definition import Algorithm
from .quaternion_forms import (
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

TWO_SAMPLE_RODRIGUES = Algorithm(
    number=1,
    name="two-sample-rodrigues",
    title="two samples, modified Rodrigues parameters",
    source="Chelnokov et al. 2016, (22)",
    kernel="two_sample_rodrigues",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=None,
    previous=False,
    constant_rate=False,
    max_increment=0.57,
)


def two_sample_rodrigues(g: Vector, turned: Vector) -> None:
    """Equation (22): x = (1/4 + γ'·γ'/48) γ' + (1/4 + γ''·γ''/48) γ'' + (γ' × γ'')/6."""
    clear(turned)
    add_increment(0.25 + dot(g, 0, g, 0) / 48.0, g, 0, turned)
    add_increment(0.25 + dot(g, 1, g, 1) / 48.0, g, 1, turned)
    add_cross(1.0 / 6.0, g, 0, g, 1, turned)
    complete_rodrigues(turned)


TWO_SAMPLE_RODRIGUES_SECOND_ITERATE = Algorithm(
    number=6,
    name="two-sample-rodrigues-second-iterate",
    title="two samples, modified Rodrigues parameters, second Picard iterate",
    source="Chelnokov et al. 2016, (23)",
    kernel="two_sample_rodrigues_second_iterate",
    samples=2,
    order=3,
    coning_order=4,
    norm_order=None,
    previous=False,
    constant_rate=False,
    max_increment=0.57,
)


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


TWO_SAMPLE_RODRIGUES_THIRD_ORDER = Algorithm(
    number=7,
    name="two-sample-rodrigues-third-order",
    title="two samples, modified Rodrigues parameters, third order",
    source="Chelnokov et al. 2016, (21)",
    kernel="two_sample_rodrigues_third_order",
    samples=2,
    order=3,
    coning_order=4,
    norm_order=None,
    previous=False,
    constant_rate=False,
    max_increment=0.57,
)


def two_sample_rodrigues_third_order(g: Vector, turned: Vector) -> None:
    """Equation (21): x = (γ' + γ'')/4 + (γ' × γ'')/6 - (γ'' ∘ γ' ∘ γ'')/24."""
    clear(turned)
    add_increment(0.25 - dot(g, 1, g, 1) / 24.0, g, 0, turned)
    add_increment(0.25 + dot(g, 0, g, 1) / 12.0, g, 1, turned)
    add_cross(1.0 / 6.0, g, 0, g, 1, turned)
    complete_rodrigues(turned)


TWO_SAMPLE_QUATERNION = Algorithm(
    number=8,
    name="two-sample-quaternion",
    title="two samples, series of the quaternion",
    source="Chelnokov et al. 2016, (7.22)",
    kernel="two_sample_quaternion",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=3,
    previous=False,
    constant_rate=False,
    max_increment=0.43,
)


def two_sample_quaternion(g: Vector, turned: Vector) -> None:
    """Equation (7.22): with s = γ' + γ'', λ0 = 1 - s·s/8, λv = (1/2 - s·s/48) s + (γ' × γ'')/3."""
    sum_of_increments(g, 2, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0
    scale_vector(0.5 - square / 48.0, turned)
    add_cross(1.0 / 3.0, g, 0, g, 1, turned)


TWO_SAMPLE_TEXTBOOK = Algorithm(
    number=9,
    name="two-sample-textbook",
    title="two samples, rotation vector and series, as the textbook has it",
    source="Chelnokov et al. 2016, [1, p. 355]",
    kernel="two_sample_textbook",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=5,
    previous=False,
    constant_rate=False,
    max_increment=0.58,
)


def two_sample_textbook(g: Vector, turned: Vector) -> None:
    """[1, p. 355]: φ = γ' + γ'' + (2/3) γ' × γ'', f = φ·φ, λ0 = 1 - f/8 + f²/384, λv = (1/2 - f/48) φ."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0 + square * square / 384.0
    scale_vector(0.5 - square / 48.0, turned)


TWO_SAMPLE_TEXTBOOK_AS_RUN = Algorithm(
    number=10,
    name="two-sample-textbook-as-run",
    title="two samples, rotation vector and series, as the paper must have run it",
    source="Chelnokov et al. 2016, [1, p. 355] (fitted to the published errors)",
    kernel="two_sample_textbook_as_run",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=3,
    previous=False,
    constant_rate=False,
    max_increment=0.43,
)


def two_sample_textbook_as_run(g: Vector, turned: Vector) -> None:
    """[1, p. 355] without f²/384: λ0 = 1 - s·s/8, λv = (1/2 - s·s/48) s + (1/3)(1 - s·s/24) γ' × γ''."""
    sum_of_increments(g, 2, turned)
    square = square_of_vector(turned)
    turned[0] = 1.0 - square / 8.0
    scale_vector(0.5 - square / 48.0, turned)
    add_cross((1.0 - square / 24.0) / 3.0, g, 0, g, 1, turned)


TWO_SAMPLE_ROTATION_VECTOR = Algorithm(
    number=11,
    name="two-sample-rotation-vector",
    title="two samples, rotation vector and exact formulas",
    source="Miller 1983, two-sample; Chelnokov et al. 2016, (25)",
    kernel="two_sample_rotation_vector",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=None,
    previous=False,
    constant_rate=True,
    max_increment=math.pi / 2,
)


def two_sample_rotation_vector(g: Vector, turned: Vector) -> None:
    """φ = γ' + γ'' + (2/3) γ' × γ'', then the exact formulas of (25)."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    complete_rotation_vector(turned)


TWO_SAMPLE_FIFTH_POWER = Algorithm(
    number=12,
    name="two-sample-fifth-power",
    title="two samples, rotation vector, modified Rodrigues parameters to the fifth power",
    source="(22) with the term in φ⁵ that it leaves out",
    kernel="two_sample_fifth_power",
    samples=2,
    order=4,
    coning_order=4,
    norm_order=None,
    previous=False,
    constant_rate=False,
    max_increment=0.94,
)


def two_sample_fifth_power(g: Vector, turned: Vector) -> None:
    """x = (1 + f/48 + f²/1920) φ/4, f = φ·φ, φ = γ' + γ'' + (2/3) γ' × γ'': tan(φ/4) to the fifth power."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    scale_vector(0.25 * (1.0 + square / 48.0 + square * square / 1920.0), turned)
    complete_rodrigues(turned)
