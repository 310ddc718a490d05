"""The algorithm of adaptive degree: it chooses the degree that the increments support, without a model of the motion.

It takes windows of eight increments. The N-th difference of the increments is the error with which N of them predict
the next one. Its mean square over the last 16 increments may fall a hundredfold from the fourth to the eighth
difference. The rate is then smooth, and the functional iteration through eight takes the window. Otherwise (vibration,
coning above a tenth of the sample rate, quanta, noise, a hand's motion) a polynomial through many increments is a bad
interpolation. Then each increment is a step of its own with products of the eight before it,

    φ_n = γ_n + (Σ c_d γ_{n-d}) × γ_n + β_{n+1} - β_n,   β_{n+1} = (Σ b_p γ_{n-p}) × γ_n.

The c_d make the mean of the products correct for any motion without trend: in a cone of phase x a sample

    Σ c_d · 4 sin²(x/2) sin(d x) = (x - sin x)/2,

exactly to x⁷, and to 4e-5 of it up to x = 1.8 rad, three and a half samples a turn, in the least squares. The β cancel
except at the ends. With two of the b_p the products are exact if ω is of third degree in time, for all ∫ α × ω to the
fourth power of time. They are of order 4 in general. The other five minimise the remainder of vibrations at the ends,
of any two frequencies to 2.7 rad a sample and of a constant rate beside one. The minimum is in the least squares, over
the cube of the higher frequency.
"""

import math

from ..restricted import Vector
from ..rotation import (
    add_cross,
    add_increment,
    clear,
    complete_rodrigues,
    complete_rotation_vector,
    dot,
    multiply,
    scale_vector,
    set_quaternion,
)
from .definition import Algorithm
from .iteration import functional_iteration

WINDOW = 8
"""Increments of one update."""

SMOOTH = 0.01
"""Largest ratio of the mean square of the eighth differences to that of the fourth for a smooth rate. It is 184 for
noise, C(16, 8)/C(8, 4), and a fiftieth for a cone with ten samples a turn."""

ROUNDING = 1e-25
"""Ratio of the eighth differences' mean square to the increments' below which they are rounding of the angles:
smooth."""

OWN = 16
"""Place, in increments, of the previous and this window in the working space; the increments come first."""

OTHER = 32
"""Place of the velocity increments."""

B_1 = 0.10336729164156522
B_2 = -0.10492291009350661
B_3 = 0.08811748261514113
B_4 = -0.06770420897103384
B_5 = 0.042778159769310826
B_6 = -0.017638500517067085
B_7 = 0.0031102092174393886
C_1 = 0.1750123853818598
C_2 = -0.08097033532902534
C_3 = 0.03780382555778354
C_4 = -0.016078799208849893
C_5 = 0.00581627475766925
C_6 = -0.001657149244242517
C_7 = 0.0003274827312192124
C_8 = -3.318983373155112e-05


def place_window(previous: Vector, g: Vector, at: int, space: Vector) -> None:
    """Write the increments of the previous and this window into `space`, from increment `at` on."""
    for i in range(3 * WINDOW):
        space[3 * at + i] = previous[i]
        space[3 * (at + WINDOW) + i] = g[i]


def is_smooth(known: float, at: int, most: float, space: Vector) -> int:
    """Return 1 if the increments in `space` from number `at` on support a polynomial through eight, else 0.

    Parameters
    ----------
    known : float
        1.0 if there is a previous window
    most : float
        largest sum of the increments' lengths for one polynomial
    space : (96,) or longer
        the first 48 places are overwritten
    """
    first = WINDOW
    most_of_fourth = 1.0
    if known == 1.0:
        first = 0
        most_of_fourth = SMOOTH
    length = 2 * WINDOW - first
    for i in range(3 * length):
        space[i] = space[3 * (at + first) + i]
    fourth = 0.0
    last = 0.0
    for n in range(1, WINDOW + 1):
        # The first eight increments have no eighth difference: their seventh replaces it.
        if n < length:
            for i in range(3 * (length - n)):
                space[i] = space[i + 3] - space[i]
        if n == 4 or n == WINDOW:
            last = 0.0
            count = 3 * (length - n)
            if count == 0:
                count = 3
            for i in range(count):
                last = last + space[i] * space[i]
            last = last / count
        if n == 4:
            fourth = last
    square = 0.0
    for i in range(at + WINDOW, at + 2 * WINDOW):
        square = square + dot(space, i, space, i)
    if last > most_of_fourth * fourth and last > ROUNDING * square:
        return 0
    # The sum of the lengths is at most this.
    if math.sqrt(WINDOW * square) <= most:
        return 1
    return 0


def add_products(i: int, j: int, space: Vector, result: Vector) -> None:
    """Add the products of a step to result[1..3]: of the increment at place `j` with those up to place `i` before it.

    Both are places in `space`; its first 3 numbers are overwritten.
    """
    for k in range(3):
        at = 3 * i + k
        space[k] = (
            (C_1 + B_1) * space[at - 3]
            + (C_2 + B_2) * space[at - 6]
            + (C_3 + B_3) * space[at - 9]
            + (C_4 + B_4) * space[at - 12]
            + (C_5 + B_5) * space[at - 15]
            + (C_6 + B_6) * space[at - 18]
            + (C_7 + B_7) * space[at - 21]
            + C_8 * space[at - 24]
        )
    add_cross(1.0, space, 0, space, j, result)
    for k in range(3):
        at = 3 * i + k
        space[k] = (
            B_1 * space[at - 6]
            + B_2 * space[at - 9]
            + B_3 * space[at - 12]
            + B_4 * space[at - 15]
            + B_5 * space[at - 18]
            + B_6 * space[at - 21]
            + B_7 * space[at - 24]
        )
    add_cross(-1.0, space, 0, space, j - 1, result)


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
    space: Vector,
    part: Vector,
    turned: Vector,
) -> None:
    """Quaternion of a window of eight increments; arguments are those of `computer.update`."""
    place_window(previous, g, OWN, space)
    # No more than half a turn is given to one polynomial.
    smooth = is_smooth(known, OWN, math.pi, space)
    if smooth == 1 and functional_iteration(8, g, 0, table, space, turned) == 0:
        return
    place_window(previous, g, OWN, space)
    set_quaternion(1.0, 0.0, 0.0, 0.0, turned)
    if known == 1.0:
        for n in range(OWN + WINDOW, OWN + 2 * WINDOW):
            clear(part)
            add_increment(1.0, space, n, part)
            add_products(n, n, space, part)
            complete_rotation_vector(part)
            multiply(turned, part, turned)
    else:
        for pair in range(4):
            pair_of_increments(g, 2 * pair, part)
            multiply(turned, part, turned)


ALGORITHMS = (
    Algorithm(
        27,
        "eight samples at a time where the increments support it, else one with the eight before",
        "Trihedron: the degree that the differences support",
        adaptive_degree,
        samples=WINDOW,
        order=10,
        coning_order=10,
        previous=True,
        constant_rate=True,
        max_increment=math.pi / 2,
    ),
)
