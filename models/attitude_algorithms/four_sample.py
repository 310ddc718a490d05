"""Algorithms that update at every fourth gyro sample, with every pair of increments on its own."""

import math
from functools import partial

from ..restricted import Vector
from .definition import Algorithm
from .quaternion_forms import (
    add_cross,
    complete_rotation_vector,
    complete_rotation_vector_by_series,
    scale_vector,
    square_of_vector,
    sum_of_increments,
)


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


_algorithm = partial(Algorithm, samples=4, coning_order=6)

ALGORITHMS = (
    _algorithm(
        13,
        "four samples, Panov's rotation vector and exact formulas",
        "Chelnokov et al. 2016, (24), (25)",
        panov,
        order=4,
        constant_rate=True,
        max_increment=math.pi / 4,
    ),
    _algorithm(
        14,
        "four samples, Panov's rotation vector and series",
        "Chelnokov et al. 2016, (24), (25) as series to the fifth power",
        panov_series,
        order=4,
        norm_order=5,
        max_increment=0.44,
    ),
    _algorithm(
        15,
        "four samples, Panov's rotation vector and a series cut off too early",
        "Chelnokov et al. 2016, remark 3 (fitted to the published errors)",
        panov_cut_off,
        order=2,
        norm_order=3,
        max_increment=0.07,
    ),
    _algorithm(
        16,
        "four samples, rotation vector of a cubic rate",
        "Jiang and Lin 1992, four-sample polynomial algorithm",
        four_sample_rotation_vector,
        order=4,
        constant_rate=True,
        max_increment=math.pi / 4,
    ),
)
