"""Attitude algorithms: each one small pure kernel beside its data.

A kernel takes the increments γ of the gyro samples of one step in a flat array, and writes the quaternion λ* of the
step: λ(t_n) = λ(t_{n-1}) ∘ λ*. x = tan(φ/4) e is the vector of the modified Rodrigues parameters of the step's rotation
vector φ e. The coefficients of the paper's algorithms are not printed in it; they follow from expanding
4 dx/dt = ω + 2 x×ω + 2 x(x·ω) - (x·x)ω, and tests in multiple precision hold the orders.

Source: Chelnokov, Perelyaev, Chelnokova 2016.
"""

from .adaptive_degree import ADAPTIVE_DEGREE
from .coning_optimised import (
    FIVE_SAMPLE_CONING,
    FOUR_SAMPLE_CONING,
    THREE_SAMPLE_CONING,
)
from .definition import MAX_INCREMENT, RANGE_ERROR, Algorithm
from .four_sample import (
    FOUR_SAMPLE_ROTATION_VECTOR,
    PANOV,
    PANOV_CUT_OFF,
    PANOV_SERIES,
)
from .functional_iteration import FUNCTIONAL_ITERATIONS
from .one_sample import (
    MEAN_RATE,
    ONE_SAMPLE_QUATERNION,
    ONE_SAMPLE_RODRIGUES,
    ONE_SAMPLE_RODRIGUES_SYMMETRIC,
)
from .two_sample import (
    TWO_SAMPLE_FIFTH_POWER,
    TWO_SAMPLE_QUATERNION,
    TWO_SAMPLE_RODRIGUES,
    TWO_SAMPLE_RODRIGUES_SECOND_ITERATE,
    TWO_SAMPLE_RODRIGUES_THIRD_ORDER,
    TWO_SAMPLE_ROTATION_VECTOR,
    TWO_SAMPLE_TEXTBOOK,
    TWO_SAMPLE_TEXTBOOK_AS_RUN,
)

__all__ = ["ALGORITHMS", "MAX_INCREMENT", "RANGE_ERROR", "Algorithm"]

ALGORITHMS = (
    TWO_SAMPLE_RODRIGUES,
    MEAN_RATE,
    ONE_SAMPLE_QUATERNION,
    ONE_SAMPLE_RODRIGUES,
    ONE_SAMPLE_RODRIGUES_SYMMETRIC,
    TWO_SAMPLE_RODRIGUES_SECOND_ITERATE,
    TWO_SAMPLE_RODRIGUES_THIRD_ORDER,
    TWO_SAMPLE_QUATERNION,
    TWO_SAMPLE_TEXTBOOK,
    TWO_SAMPLE_TEXTBOOK_AS_RUN,
    TWO_SAMPLE_ROTATION_VECTOR,
    TWO_SAMPLE_FIFTH_POWER,
    PANOV,
    PANOV_SERIES,
    PANOV_CUT_OFF,
    FOUR_SAMPLE_ROTATION_VECTOR,
    THREE_SAMPLE_CONING,
    FOUR_SAMPLE_CONING,
    FIVE_SAMPLE_CONING,
    *FUNCTIONAL_ITERATIONS,
    ADAPTIVE_DEGREE,
)
"""The algorithms, by number."""
