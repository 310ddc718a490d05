"""Functional iteration: the rate as the polynomial through N increments, the attitude iterated on Chebyshev nodes.

In the manner of Wu 2018 (quaternion functional iterative integration): λ = 1 + ½∫ λ ∘ ω dt is iterated with ω the
polynomial of degree N - 1 that has the given increments, at P = N + 5 Chebyshev nodes of the step, until the remainder
of the iteration is below rounding. Nothing of second order in the increments is left out, so that the error is that of
the polynomial alone: of order N + 2 for even N and N + 1 for odd N. (The two-sample one is of order 4, as (22) is.)
"""

import math

from ..restricted import Vector
from .definition import Algorithm
from .quaternion_forms import dot

EXTRA_NODES = 5
"""Nodes of the attitude beyond the degree of the angle; up to N = 6 the second power of the increments is exact."""

ITERATION_REMAINDER = 1e-17
"""The iteration ends when (½∫|ω|)^k / k!, the bound of what is left, is below this."""

MOST_ITERATIONS = 40
"""More mean a polynomial that swings by many radians: the increments are not those of a smooth rate."""

LONGEST_INCREMENT = 0.36
"""Valid range [rad]: to here the nodes carry a constant rate to 1e-13 rad, for any number of increments."""

FEWEST_INCREMENTS = 2
MOST_INCREMENTS = 8
LARGEST_TABLE = (2 * MOST_INCREMENTS + EXTRA_NODES + 1) * (MOST_INCREMENTS + EXTRA_NODES)
"""Length of the table for the most increments."""


def prepare_functional_iteration(count: int, table: Vector) -> None:
    """Write what depends on the number of increments alone.

    Parameters
    ----------
    count : int
        N, number of increments
    table : ((N + P + 1) * P,)
        overwritten: P rows with which the increments give the rates at the nodes, in units of half a step; P rows
        that integrate values at the nodes from the beginning to each node; one row that integrates to the end
    """
    nodes = count + EXTRA_NODES
    for i in range(nodes):
        # The step is [-1, 1]; the angle is known at u = 0, 1, ... N.
        s = -math.cos(math.pi * (i + 0.5) / nodes)
        u = 0.5 * count * (s + 1.0)
        for n in range(count):
            table[count * i + n] = 0.0
        for m in range(1, count + 1):
            derivative = 0.0
            for left in range(count + 1):
                if left != m:
                    product = 1.0 / (m - left)
                    for k in range(count + 1):
                        if k != m and k != left:
                            product = product * (u - k) / (m - k)
                    derivative = derivative + product
            # The angle at m is the sum of the first m increments.
            for n in range(m):
                table[count * i + n] = table[count * i + n] + 0.5 * count * derivative
    for i in range(nodes + 1):
        end = 1.0
        if i < nodes:
            end = -math.cos(math.pi * (i + 0.5) / nodes)
        for j in range(nodes):
            s = -math.cos(math.pi * (j + 0.5) / nodes)
            table[nodes * (count + i) + j] = node_integral(nodes, s, end)


def node_integral(nodes: int, s: float, end: float) -> float:
    """Integral from -1 to `end` of the polynomial that is 1 at the Chebyshev node `s` and 0 at the others."""
    # Values of Tk at the node and of T(k-1), Tk, T(k+1) at the end, from k = 1 on.
    last_at_node = 1.0
    at_node = s
    last = 1.0
    this = end
    total = (end + 1.0) / nodes
    sign = -1.0
    for k in range(1, nodes):
        following = 2.0 * end * this - last
        # The integral of Tk is (T(k+1)/(k+1) - T(k-1)/(k-1))/2; at -1 every Tk is 1 or -1.
        integral = 0.5 * (end * end - 1.0)
        if k > 1:
            integral = 0.5 * ((following + sign) / (k + 1) - (last + sign) / (k - 1))
        total = total + 2.0 / nodes * at_node * integral
        last = this
        this = following
        following = 2.0 * s * at_node - last_at_node
        last_at_node = at_node
        at_node = following
        sign = -sign
    return total


def functional_iteration(
    count: int, g: Vector, first: int, table: Vector, rates: Vector, values: Vector, slopes: Vector, turned: Vector
) -> int:
    """Quaternion of the step from `count` increments.

    Parameters
    ----------
    g : (3 * (first + N),) or longer
        the increments; those from number `first` on are taken
    table : ((N + P + 1) * P,)
        from `prepare_functional_iteration`
    rates, values, slopes : (3 * P,), (4 * P,), (4 * P,)
        working space: the rate, λ - 1 and its derivative at the nodes
    turned : (4,)
        the quaternion

    Returns
    -------
    int
        0, or 1 where the polynomial swings so far that the iteration does not end
    """
    nodes = count + EXTRA_NODES
    fastest = 0.0
    for i in range(nodes):
        for k in range(3):
            rate = 0.0
            for n in range(count):
                rate = rate + table[count * i + n] * g[3 * (first + n) + k]
            rates[3 * i + k] = rate
        fastest = max_of(fastest, dot(rates, i, rates, i))
        for k in range(4):
            values[4 * i + k] = 0.0
    # The step is two units long: ½∫|ω| is at most the fastest rate.
    fastest = math.sqrt(fastest)
    remainder = 1.0
    iterations = 0
    while remainder > ITERATION_REMAINDER and iterations < MOST_ITERATIONS:
        iterations = iterations + 1
        remainder = remainder * fastest / iterations
        for i in range(nodes):
            quaternion_slope(rates, i, values, slopes)
        for i in range(nodes):
            for k in range(4):
                value = 0.0
                for j in range(nodes):
                    value = value + table[nodes * (count + i) + j] * slopes[4 * j + k]
                values[4 * i + k] = value
    if not remainder <= ITERATION_REMAINDER:
        return 1
    for i in range(nodes):
        quaternion_slope(rates, i, values, slopes)
    for k in range(4):
        value = 0.0
        for j in range(nodes):
            value = value + table[nodes * (count + nodes) + j] * slopes[4 * j + k]
        turned[k] = value
    turned[0] = 1.0 + turned[0]
    return 0


def max_of(a: float, b: float) -> float:
    """The larger of two numbers."""
    if a > b:
        return a
    return b


def quaternion_slope(rates: Vector, i: int, values: Vector, slopes: Vector) -> None:
    """½ λ ∘ ω at node i, with λ - 1 in `values`."""
    x = 0.5 * rates[3 * i]
    y = 0.5 * rates[3 * i + 1]
    z = 0.5 * rates[3 * i + 2]
    w = 1.0 + values[4 * i]
    a = values[4 * i + 1]
    b = values[4 * i + 2]
    c = values[4 * i + 3]
    slopes[4 * i] = -(a * x + b * y + c * z)
    slopes[4 * i + 1] = w * x + (b * z - c * y)
    slopes[4 * i + 2] = w * y + (c * x - a * z)
    slopes[4 * i + 3] = w * z + (a * y - b * x)


ALGORITHMS = tuple(
    Algorithm(
        18 + count,
        f"functional iteration through {count} samples",
        "Wu 2018, functional iteration on Chebyshev nodes",
        functional_iteration,
        samples=count,
        order=count + 2 if count % 2 == 0 else count + 1,
        coning_order=count + 2 if count % 2 == 0 else count + 1,
        constant_rate=True,
        name=f"functional-iteration-{count}",
        max_increment=LONGEST_INCREMENT,
    )
    for count in range(FEWEST_INCREMENTS, MOST_INCREMENTS + 1)
)
