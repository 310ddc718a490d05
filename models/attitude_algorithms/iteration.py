"""Functional iteration: the rate as the polynomial through N increments, the attitude iterated on Chebyshev nodes.

The method follows Wu 2018 (quaternion functional iterative integration). λ = 1 + ½∫ λ ∘ ω dt is iterated until the
remainder of the iteration is below rounding, at P = N + 7 Chebyshev nodes of the step. ω is the polynomial of degree N
- 1 that has the given increments. All terms of second order in the increments are kept, so the error is that of the
polynomial alone: of order N + 2 for even N and N + 1 for odd N. (The two-sample one is of order 4, like (22).) The
Rodrigues vector of Wu's first paper (RodFIter, IEEE Trans. AES 54(5), 2018; from its abstract and patent) is iterated
on the same nodes: the same error to rounding, at more cost and in a shorter range.
"""

import math

from ..restricted import Vector
from ..rotation import dot, scale_vector, square_of_vector
from .definition import MOST_SAMPLES, Algorithm

EXTRA_NODES = 7
"""Nodes of the attitude beyond the degree of the angle: the second power of the increments is exact."""

ITERATION_REMAINDER = 1e-17
"""The iteration ends when (½∫|ω|)^k / k!, the bound of the remainder, is below this."""

MOST_ITERATIONS = 40
"""Largest number of iterations: more mean a polynomial that swings by many radians, not a smooth rate."""

LONGEST_INCREMENT = 0.36
"""Valid range [rad]: up to here the nodes carry a constant rate to 1e-13 rad, for any number of increments."""

RODRIGUES_4 = 0.27
RODRIGUES_8 = 0.21
"""Valid ranges [rad] of the Rodrigues vector's iterations through 4 and 8 increments, found in the same way."""

FEWEST_INCREMENTS = 2
MOST_INCREMENTS = MOST_SAMPLES
LARGEST_TABLE = (2 * MOST_INCREMENTS + EXTRA_NODES + 1) * (MOST_INCREMENTS + EXTRA_NODES)
"""Length of the table for the most increments."""

VALUES = 4 * (MOST_INCREMENTS + EXTRA_NODES)
SLOPES = 2 * VALUES
SPACE_SIZE = 3 * VALUES
"""Places in the working space, and its length."""

QUATERNION = 1.0
RODRIGUES = 2.0
"""Steepness of the equation of the Rodrigues vector, relative to the quaternion's; selects the iterated variable."""


def increments_iterated(algorithm: float) -> int:
    """Return the number of increments through which the algorithm of a number iterates; 0 for others."""
    if algorithm >= 18.0 + FEWEST_INCREMENTS and algorithm <= 18.0 + MOST_INCREMENTS:
        return int(algorithm) - 18
    if algorithm >= 33.0:
        return 4 * (int(algorithm) - 32)
    return 0


def prepare_functional_iteration(count: int, table: Vector) -> None:
    """Write the tables that depend only on the number of increments.

    Parameters
    ----------
    count : int
        N, number of increments
    table : ((N + P + 1) * P,)
        overwritten: P rows map the increments to the rates at the nodes, in units of half a step; P rows integrate
        values at the nodes from the beginning to each node; one row integrates to the end
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
            for row in range(count + 1):
                if row != m:
                    product = 1.0 / (m - row)
                    for k in range(count + 1):
                        if k != m and k != row:
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


def rates_at_nodes(count: int, g: Vector, first: int, table: Vector, space: Vector) -> float:
    """Write the rates at the nodes, in units of half a step; return the fastest: a bound of ½∫|ω|."""
    nodes = count + EXTRA_NODES
    fastest = 0.0
    for i in range(nodes):
        x = 0.0
        y = 0.0
        z = 0.0
        for n in range(count):
            weight = table[count * i + n]
            x = x + weight * g[3 * (first + n)]
            y = y + weight * g[3 * (first + n) + 1]
            z = z + weight * g[3 * (first + n) + 2]
        space[3 * i] = x
        space[3 * i + 1] = y
        space[3 * i + 2] = z
        square = dot(space, i, space, i)
        if square > fastest:
            fastest = square
    return math.sqrt(fastest)


def functional_iteration(count: int, g: Vector, first: int, table: Vector, space: Vector, turned: Vector) -> int:
    """Write the quaternion of the step from `count` increments.

    Parameters
    ----------
    g : (3 * (first + N),) or longer
        the increments; those from number `first` on are taken
    table : ((N + P + 1) * P,)
        from `prepare_functional_iteration`
    space : (SPACE_SIZE,)
        working space: the rates at the nodes, from VALUES on λ - 1, from SLOPES on its derivative
    turned : (4,)
        the quaternion

    Returns
    -------
    int
        0, or 1 if the polynomial swings too far for the iteration to end
    """
    failed = iterate(QUATERNION, count, g, first, table, space, turned)
    turned[0] = 1.0 + turned[0]
    return failed


def rodrigues_iteration(count: int, g: Vector, first: int, table: Vector, space: Vector, turned: Vector) -> int:
    """Write the quaternion of the step by iterating the Rodrigues vector ρ = 2 tan(φ/2) e, dρ/dt = ω + ½ ρ × ω + ¼
    (ρ·ω) ρ.

    Arguments and result as of `functional_iteration`; half a turn is beyond any ρ.
    """
    failed = iterate(RODRIGUES, count, g, first, table, space, turned)
    # (1, ρ/2), brought to the unit sphere.
    turned[0] = 1.0 / math.sqrt(1.0 + 0.25 * square_of_vector(turned))
    scale_vector(0.5 * turned[0], turned)
    return failed


def iterate(steep: float, count: int, g: Vector, first: int, table: Vector, space: Vector, turned: Vector) -> int:
    """Write the step's change of λ or ρ, by `steep`; arguments and result as of `functional_iteration`."""
    nodes = count + EXTRA_NODES
    fastest = rates_at_nodes(count, g, first, table, space)
    for k in range(4 * nodes):
        space[VALUES + k] = 0.0
    remainder = 1.0
    iterations = 0
    while remainder > ITERATION_REMAINDER and iterations < MOST_ITERATIONS:
        iterations = iterations + 1
        remainder = remainder * steep * fastest / iterations
        slopes_at_nodes(steep, nodes, space)
        for i in range(nodes):
            weighted_sum(nodes, table, nodes * (count + i), space, space, VALUES + 4 * i)
    if not remainder <= ITERATION_REMAINDER:
        return 1
    slopes_at_nodes(steep, nodes, space)
    weighted_sum(nodes, table, nodes * (count + nodes), space, turned, 0)
    return 0


def slopes_at_nodes(steep: float, nodes: int, space: Vector) -> None:
    """Write the derivatives of λ or ρ at the nodes."""
    # dλ/dt = ½ λ ∘ ω
    size = 1.0
    if steep == QUATERNION:
        size = 0.5
    for i in range(nodes):
        x = size * space[3 * i]
        y = size * space[3 * i + 1]
        z = size * space[3 * i + 2]
        a = space[VALUES + 4 * i + 1]
        b = space[VALUES + 4 * i + 2]
        c = space[VALUES + 4 * i + 3]
        at = SLOPES + 4 * i
        if steep == QUATERNION:
            w = 1.0 + space[VALUES + 4 * i]
            space[at] = -(a * x + b * y + c * z)
            space[at + 1] = w * x + (b * z - c * y)
            space[at + 2] = w * y + (c * x - a * z)
            space[at + 3] = w * z + (a * y - b * x)
        else:
            # ρ has a zero before it, like the vector of a quaternion.
            along = 0.25 * (a * x + b * y + c * z)
            space[at] = 0.0
            space[at + 1] = x + 0.5 * (b * z - c * y) + along * a
            space[at + 2] = y + 0.5 * (c * x - a * z) + along * b
            space[at + 3] = z + 0.5 * (a * y - b * x) + along * c


def weighted_sum(nodes: int, table: Vector, row: int, space: Vector, result: Vector, at: int) -> None:
    """Sum of the slopes in `space`, weighted by `table` from `row` on, into result[at] and on.

    The four sums are made side by side: none waits for another.
    """
    w = 0.0
    x = 0.0
    y = 0.0
    z = 0.0
    for j in range(nodes):
        weight = table[row + j]
        w = w + weight * space[SLOPES + 4 * j]
        x = x + weight * space[SLOPES + 4 * j + 1]
        y = y + weight * space[SLOPES + 4 * j + 2]
        z = z + weight * space[SLOPES + 4 * j + 3]
    result[at] = w
    result[at + 1] = x
    result[at + 2] = y
    result[at + 3] = z


ALGORITHMS = (
    *(
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
    ),
    *(
        Algorithm(
            number,
            f"iteration of the Rodrigues vector through {count} samples",
            "Wu 2018, RodFIter, on the same nodes",
            rodrigues_iteration,
            samples=count,
            order=count + 2,
            coning_order=count + 2,
            constant_rate=True,
            name=f"rodrigues-iteration-{count}",
            max_increment=longest,
        )
        for number, count, longest in ((33, 4, RODRIGUES_4), (34, 8, RODRIGUES_8))
    ),
)
