"""Attitude algorithms: each one small pure kernel beside its data.

A kernel takes the increments γ of the gyro samples of one step in a flat array. It writes the quaternion λ* of the
step: λ(t_n) = λ(t_{n-1}) ∘ λ*. x = tan(φ/4) e is the vector of the modified Rodrigues parameters of the step's rotation
vector φ e. The coefficients of the paper's algorithms are not printed in it. They follow from expanding 4 dx/dt = ω + 2
x×ω + 2 x(x·ω) - (x·x)ω, and tests in multiple precision hold the orders.

Source: Chelnokov, Perelyaev, Chelnokova 2016.
"""

from ..rotation import MAX_INCREMENT
from . import adaptive, iteration, products
from .computer import INPUT_KINDS, order_with
from .definition import RANGE_ERROR, Algorithm

__all__ = ["ALGORITHMS", "INPUT_KINDS", "MAX_INCREMENT", "PRODUCTS", "RANGE_ERROR", "Algorithm", "order_with"]

_ALL = products.ALGORITHMS + iteration.ALGORITHMS + adaptive.ALGORITHMS
ALGORITHMS = tuple(sorted(_ALL, key=lambda algorithm: algorithm.number))
"""The algorithms, by number."""


def _products() -> tuple[float, ...]:
    numbers: list[float] = []
    for algorithm in ALGORITHMS:
        for product in algorithm.products:
            numbers.append(float(algorithm.number))
            numbers += map(float, product)
    numbers.append(0.0)
    return tuple(numbers)


PRODUCTS = _products()
"""The products of all algorithms: number, i, j, k of each, and a final zero."""
