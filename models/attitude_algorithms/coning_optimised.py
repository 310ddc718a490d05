"""Rotation vectors whose coefficients null the leading terms of the drift under pure coning.

φ = Σ γi + (Σ k_p γ_{N-p}) × γ_N with N - 1 coefficients, p the distance in samples: under coning the vector product of
two increments has a mean that depends on their distance alone. The k_p solve, order by order in x = Ω Δt,
Σ k_p · 4 sin²(x/2) sin(p x) = (N x - sin N x)/2. In general motion they are of third order only.
"""

import math
from functools import partial

from ..restricted import Vector
from .definition import Algorithm
from .quaternion_forms import add_cross, complete_rotation_vector, sum_of_increments


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


_algorithm = partial(Algorithm, order=3, constant_rate=True)

ALGORITHMS = (
    _algorithm(
        17,
        "three samples, optimised for coning",
        "Miller 1983, three-sample",
        three_sample_coning,
        samples=3,
        coning_order=6,
        max_increment=math.pi / 3,
    ),
    _algorithm(
        18,
        "four samples, optimised for coning",
        "Lee et al. 1990; Savage 1998",
        four_sample_coning,
        samples=4,
        coning_order=8,
        max_increment=math.pi / 4,
    ),
    _algorithm(
        19,
        "five samples, optimised for coning",
        "Savage 1998, five-sample",
        five_sample_coning,
        samples=5,
        coning_order=10,
        max_increment=math.pi / 5,
    ),
)
