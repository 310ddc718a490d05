"""Algorithms in closed form, from the increments of one to five gyro samples.

From one sample, and where they need it the one before; from two, γ' and γ'' the increments of the two halves of a step;
from four, with every pair of increments on its own; and rotation vectors whose coefficients null the leading terms of
the drift under pure coning: φ = Σ γi + (Σ k_p γ_{N-p}) × γ_N with N - 1 coefficients, p the distance in samples. Under
coning the vector product of two increments has a mean that depends on their distance alone. The k_p solve, order by
order in x = Ω Δt, Σ k_p · 4 sin²(x/2) sin(p x) = (N x - sin N x)/2. In general motion they are of third order only.
"""

import math
from functools import partial

from ..restricted import Vector
from ..rotation import (
    add_cross,
    add_increment,
    clear,
    complete_rodrigues,
    complete_rotation_vector,
    complete_rotation_vector_by_series,
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


def two_sample_rotation_vector(g: Vector, turned: Vector) -> None:
    """φ = γ' + γ'' + (2/3) γ' × γ'', then the exact formulas of (25)."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    complete_rotation_vector(turned)


def two_sample_fifth_power(g: Vector, turned: Vector) -> None:
    """x = (1 + f/48 + f²/1920) φ/4, f = φ·φ, φ = γ' + γ'' + (2/3) γ' × γ'': tan(φ/4) to the fifth power."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    scale_vector(0.25 * (1.0 + square / 48.0 + square * square / 1920.0), turned)
    complete_rodrigues(turned)


def panov_rotation_vector(g: Vector, turned: Vector) -> None:
    """Equation (24): φ = Σ γi + (22/45)(γ1 + γ2) × (γ3 + γ4) + (32/45)(γ1 × γ2 + γ3 × γ4), in turned[1..3]."""
    sum_of_increments(g, 4, turned)
    for i in range(2):
        for j in range(2, 4):
            add_cross(22.0 / 45.0, g, i, g, j, turned)
    add_cross(32.0 / 45.0, g, 0, g, 1, turned)
    add_cross(32.0 / 45.0, g, 2, g, 3, turned)


def panov(g: Vector, turned: Vector) -> None:
    """Equations (24), (25)."""
    panov_rotation_vector(g, turned)
    complete_rotation_vector(turned)


def panov_series(g: Vector, turned: Vector) -> None:
    """Equation (24), and (25) as series: λ0 = 1 - f/8 + f²/384, λv = (1/2 - f/48 + f²/3840) φ."""
    panov_rotation_vector(g, turned)
    complete_rotation_vector_by_series(turned)


def panov_cut_off(g: Vector, turned: Vector) -> None:
    """Equation (24), and λ0 = 1 - f/8, λv = φ/2: what remark 3 blames for a loss of accuracy."""
    panov_rotation_vector(g, turned)
    turned[0] = 1.0 - square_of_vector(turned) / 8.0
    scale_vector(0.5, turned)


def four_sample_rotation_vector(g: Vector, turned: Vector) -> None:
    """φ with ½∫ α × ω dt exact for a cubic rate.

    φ = Σ γi + (736/945)(γ1 × γ2 + γ3 × γ4) + (334/945)(γ1 × γ3 + γ2 × γ4) + (526/945) γ1 × γ4 + (654/945) γ2 × γ3
    """
    sum_of_increments(g, 4, turned)
    add_cross(736.0 / 945.0, g, 0, g, 1, turned)
    add_cross(736.0 / 945.0, g, 2, g, 3, turned)
    add_cross(334.0 / 945.0, g, 0, g, 2, turned)
    add_cross(334.0 / 945.0, g, 1, g, 3, turned)
    add_cross(526.0 / 945.0, g, 0, g, 3, turned)
    add_cross(654.0 / 945.0, g, 1, g, 2, turned)
    complete_rotation_vector(turned)


def three_sample_coning(g: Vector, turned: Vector) -> None:
    """φ = Σ γi + ((9/20) γ1 + (27/20) γ2) × γ3."""
    sum_of_increments(g, 3, turned)
    add_cross(9.0 / 20.0, g, 0, g, 2, turned)
    add_cross(27.0 / 20.0, g, 1, g, 2, turned)
    complete_rotation_vector(turned)


def four_sample_coning(g: Vector, turned: Vector) -> None:
    """φ = Σ γi + ((54/105) γ1 + (92/105) γ2 + (214/105) γ3) × γ4."""
    sum_of_increments(g, 4, turned)
    add_cross(54.0 / 105.0, g, 0, g, 3, turned)
    add_cross(92.0 / 105.0, g, 1, g, 3, turned)
    add_cross(214.0 / 105.0, g, 2, g, 3, turned)
    complete_rotation_vector(turned)


def five_sample_coning(g: Vector, turned: Vector) -> None:
    """φ = Σ γi + ((250/504) γ1 + (525/504) γ2 + (650/504) γ3 + (1375/504) γ4) × γ5."""
    sum_of_increments(g, 5, turned)
    add_cross(250.0 / 504.0, g, 0, g, 4, turned)
    add_cross(525.0 / 504.0, g, 1, g, 4, turned)
    add_cross(650.0 / 504.0, g, 2, g, 4, turned)
    add_cross(1375.0 / 504.0, g, 3, g, 4, turned)
    complete_rotation_vector(turned)


_of_one = partial(Algorithm, samples=1)
_of_two = partial(Algorithm, samples=2, coning_order=4)
_of_four = partial(Algorithm, samples=4, coning_order=6)
_for_coning = partial(Algorithm, order=3, constant_rate=True)

ALGORITHMS = (
    _of_one(
        2,
        "one sample, mean angular rate",
        "Chelnokov et al. 2016, (7.18)",
        mean_rate,
        order=2,
        coning_order=2,
        constant_rate=True,
        max_increment=math.pi,
    ),
    _of_one(
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
    _of_one(
        4,
        "one sample and the one before, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (19)",
        one_sample_rodrigues,
        order=3,
        coning_order=4,
        previous=True,
        max_increment=1.15,
    ),
    _of_one(
        5,
        "one sample and the one before, modified Rodrigues parameters, second form",
        "Chelnokov et al. 2016, (20)",
        one_sample_rodrigues_symmetric,
        order=3,
        coning_order=4,
        previous=True,
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
        11,
        "two samples, rotation vector and exact formulas",
        "Miller 1983, two-sample; Chelnokov et al. 2016, (25)",
        two_sample_rotation_vector,
        order=4,
        constant_rate=True,
        max_increment=math.pi / 2,
    ),
    _of_two(
        12,
        "two samples, rotation vector, modified Rodrigues parameters to the fifth power",
        "(22) with the term in φ⁵ that it leaves out",
        two_sample_fifth_power,
        order=4,
        max_increment=0.94,
    ),
    _of_four(
        13,
        "four samples, Panov's rotation vector and exact formulas",
        "Chelnokov et al. 2016, (24), (25)",
        panov,
        order=4,
        constant_rate=True,
        max_increment=math.pi / 4,
    ),
    _of_four(
        14,
        "four samples, Panov's rotation vector and series",
        "Chelnokov et al. 2016, (24), (25) as series to the fifth power",
        panov_series,
        order=4,
        norm_order=5,
        max_increment=0.44,
    ),
    _of_four(
        15,
        "four samples, Panov's rotation vector and a series cut off too early",
        "Chelnokov et al. 2016, remark 3 (fitted to the published errors)",
        panov_cut_off,
        order=2,
        norm_order=3,
        max_increment=0.07,
    ),
    _of_four(
        16,
        "four samples, rotation vector of a cubic rate",
        "Jiang and Lin 1992, four-sample polynomial algorithm",
        four_sample_rotation_vector,
        order=4,
        constant_rate=True,
        max_increment=math.pi / 4,
    ),
    _for_coning(
        17,
        "three samples, optimised for coning",
        "Miller 1983, three-sample",
        three_sample_coning,
        samples=3,
        coning_order=6,
        max_increment=math.pi / 3,
    ),
    _for_coning(
        18,
        "four samples, optimised for coning",
        "Lee et al. 1990; Savage 1998",
        four_sample_coning,
        samples=4,
        coning_order=8,
        max_increment=math.pi / 4,
    ),
    _for_coning(
        19,
        "five samples, optimised for coning",
        "Savage 1998, five-sample",
        five_sample_coning,
        samples=5,
        coning_order=10,
        max_increment=math.pi / 5,
    ),
)
