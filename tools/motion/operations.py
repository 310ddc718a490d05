"""Operations of an attitude algorithm, counted by running its kernel on numbers that count."""

import math
from collections.abc import Callable
from types import FunctionType, SimpleNamespace
from typing import Any

import numpy as np

from ...models.attitude_algorithms import PRODUCTS, Algorithm
from ...models.attitude_algorithms.computer import TABLE_SIZE, prepare_update
from ...models.attitude_algorithms.iteration import SPACE_SIZE
from ...models.rotation import multiply

COSTLY = 10
"""What a division, a root, a sine, a cosine or an arctangent counts as, in additions or multiplications."""


def operations_of_update(algorithm: Algorithm, increments: np.ndarray) -> int:
    """Operations of one step of an algorithm and of the quaternion product that follows it.

    Parameters
    ----------
    increments : ndarray, shape (2 * samples, 3)
        of the step before and of this one [rad]: what some algorithms do depends on them
    """
    tally = [0]
    number = _counting_number(tally)
    table = [0.0] * TABLE_SIZE
    prepare_update(float(algorithm.number), list(PRODUCTS), table)
    values = [number(value) for value in np.asarray(increments).reshape(-1)]
    half = 3 * algorithm.samples
    given: dict[str, Any] = {
        "previous": values[:half],
        "known": 1.0,
        "g": values[half:],
        "count": algorithm.samples,
        "first": 0,
        "table": table,
        "turned": [number(0.0)] * 4,
        "part": [number(0.0)] * 4,
        "products": table,
        "weighted": [number(0.0)] * 4,
    }
    kernel = algorithm.kernel
    names = kernel.__code__.co_varnames[: kernel.__code__.co_argcount]
    _counting(kernel, tally)(*(given[name] if name in given else [number(0.0)] * SPACE_SIZE for name in names))
    attitude = [number(1.0), number(0.0), number(0.0), number(0.0)]
    multiply(attitude, given["turned"], attitude)
    return tally[0]


def _counting_number(tally: list[int]) -> type[float]:
    """A float whose arithmetic is counted; results count too."""

    def counted(operation: Callable[[float, float], float], cost: int) -> Callable[[float, float], float]:
        def apply(a: float, b: float) -> float:
            tally[0] += cost
            return Number(operation(float(a), float(b)))

        return apply

    class Number(float):
        __add__ = __radd__ = counted(lambda a, b: a + b, 1)
        __sub__ = counted(lambda a, b: a - b, 1)
        __rsub__ = counted(lambda a, b: b - a, 1)
        __mul__ = __rmul__ = counted(lambda a, b: a * b, 1)
        __truediv__ = counted(lambda a, b: a / b, COSTLY)
        __rtruediv__ = counted(lambda a, b: b / a, COSTLY)

    return Number


def _counting(kernel: Any, tally: list[int]) -> FunctionType:
    """The kernel with functions of `math` that are counted, in all that it calls."""

    def counted(function: Callable[..., float]) -> Callable[..., float]:
        def apply(*arguments: float) -> float:
            tally[0] += COSTLY
            return function(*arguments)

        return apply

    functions = {name: counted(getattr(math, name)) for name in ("sqrt", "sin", "cos", "atan2")}
    replaced = SimpleNamespace(**functions, floor=math.floor, fabs=math.fabs, pi=math.pi)
    names = {name: kernel.__globals__[name] for name in kernel.__code__.co_names if name in kernel.__globals__}
    for name, value in names.items():
        if name == "math":
            names[name] = replaced
        elif isinstance(value, FunctionType):
            names[name] = _counting(value, tally)
    return FunctionType(kernel.__code__, names, kernel.__name__)
