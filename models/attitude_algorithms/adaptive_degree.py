"""The algorithm that chooses its degree by what the increments support, without knowing anything of the motion.

The N-th difference of the increments is the error with which N of them predict the next one. Taken over the last 16
increments in the root mean square, a polynomial of higher degree is supported

* where each further difference is at most half of the one before: the fourth a quarter of the second, the eighth a
  sixteenth of the fourth. Noise and quantisation double with every difference, and vibration above a sixth of half the
  sample rate does not halve: there a high degree would only carry more of the quantisation into the attitude; or
* where the differences fall from the second to the fifteenth, the last that there is: then no noise is to be seen.
"""

import math

from ..restricted import Vector
from ..rotation import multiply, set_quaternion
from .definition import Algorithm
from .functional_iteration import functional_iteration
from .quaternion_forms import (
    add_cross,
    add_increment,
    clear,
    complete_rodrigues,
    dot,
    scale_vector,
)

WINDOW = 8
"""Increments of one update."""


def supported_degree(previous: Vector, known: float, g: Vector, differences: Vector) -> int:
    """How many increments at a time (2, 4 or 8) the last ones support.

    Parameters
    ----------
    previous, g : (24,)
        increments of the window before and of this one
    known : float
        1.0 where there is a window before
    differences : (48,)
        working space
    """
    length = WINDOW
    if known == 1.0:
        length = 2 * WINDOW
        for i in range(3 * WINDOW):
            differences[i] = previous[i]
            differences[3 * WINDOW + i] = g[i]
    else:
        for i in range(3 * WINDOW):
            differences[i] = g[i]
    # No more than half a turn is given to one polynomial.
    longest = 0.0
    for i in range(WINDOW):
        longest = longest + math.sqrt(g[3 * i] * g[3 * i] + g[3 * i + 1] * g[3 * i + 1] + g[3 * i + 2] * g[3 * i + 2])
    second = 0.0
    fourth = 0.0
    eighth = 0.0
    last = 0.0
    for n in range(1, length):
        total = 0.0
        for i in range(3 * (length - n)):
            differences[i] = differences[i + 3] - differences[i]
            total = total + differences[i] * differences[i]
        last = total / (length - n)
        if n == 2:
            second = last
        if n == 4:
            fourth = last
        # The first eight increments have no eighth difference: their seventh stands for it.
        if n == 7 or n == 8:
            eighth = last
    if longest > math.pi:
        return 2
    falling = 0.0
    if length == 2 * WINDOW and last <= eighth and eighth <= fourth and fourth <= second:
        falling = 1.0
    chosen = 2
    if fourth <= second / 16.0:
        chosen = 4
        if eighth <= fourth / 256.0:
            chosen = 8
    if falling == 1.0:
        chosen = 8
    return chosen


def pair_of_increments(g: Vector, first: int, part: Vector) -> None:
    """Quaternion of increments `first` and `first` + 1 by (22), its series completed to tan(φ/4).

    (22) is x = (1 + y²/3) y e for a constant rate, y = φ/4; the factor makes it tan(y) e, and is 1 + 2 y⁴/15 elsewhere.
    """
    clear(part)
    add_increment(0.25 + dot(g, first, g, first) / 48.0, g, first, part)
    add_increment(0.25 + dot(g, first + 1, g, first + 1) / 48.0, g, first + 1, part)
    add_cross(1.0 / 6.0, g, first, g, first + 1, part)
    square = (dot(g, first, g, first) + 2.0 * dot(g, first, g, first + 1) + dot(g, first + 1, g, first + 1)) / 16.0
    factor = 1.0 + 2.0 * square * square / 15.0
    if square > 1e-5:
        y = math.sqrt(square)
        factor = math.sin(y) / (math.cos(y) * y * (1.0 + square / 3.0))
    scale_vector(factor, part)
    complete_rodrigues(part)


def adaptive_degree(
    previous: Vector,
    known: float,
    g: Vector,
    table: Vector,
    half_table: Vector,
    differences: Vector,
    rates: Vector,
    values: Vector,
    slopes: Vector,
    part: Vector,
    turned: Vector,
) -> None:
    """Quaternion of a window of eight increments, taken two, four or eight at a time.

    Parameters
    ----------
    previous, g : (24,)
        increments of the window before and of this one
    known : float
        1.0 where there is a window before
    table, half_table : from `prepare_functional_iteration` for 8 and 4 increments
    differences, rates, values, slopes : (48,), (39,), (52,), (52,)
        working space
    part, turned : (4,)
        working space; the quaternion of the window
    """
    chosen = supported_degree(previous, known, g, differences)
    if chosen == 8 and functional_iteration(8, g, 0, table, rates, values, slopes, turned) == 1:
        chosen = 4
    if chosen == 4:
        set_quaternion(1.0, 0.0, 0.0, 0.0, turned)
        for half in range(2):
            if functional_iteration(4, g, 4 * half, half_table, rates, values, slopes, part) == 1:
                chosen = 2
            multiply(turned, part, turned)
    if chosen == 2:
        set_quaternion(1.0, 0.0, 0.0, 0.0, turned)
        for pair in range(4):
            pair_of_increments(g, 2 * pair, part)
            multiply(turned, part, turned)


ALGORITHMS = (
    Algorithm(
        27,
        "two, four or eight samples at a time, by what the increments support",
        "Trihedron: the degree whose differences still halve",
        adaptive_degree,
        samples=WINDOW,
        order=10,
        coning_order=10,
        previous=True,
        constant_rate=True,
        max_increment=math.pi / 2,
    ),
)
