"""Rotation vectors with products of increments: φ = Σ γ_i + Σ k_ij γ_i × γ_j, each algorithm by its k_ij alone.

The sums are over the increments of a step, i = 0, 1, ...; negative i are those before it, the last of them -1. i =
`SUM` is the sum of the increments of the step before γ_j. So k_ij are the data of every family:

* polynomial rates, exact in ½∫ α × ω dt;
* optimised for coning, compressed. Under coning the vector product of two increments has a mean that depends only on
their distance. All pairs of one distance may therefore be combined to one, (Σ k_p γ_{N-p}) × γ_N. The k_p solve, order
by
  order in x = Ω Δt, Σ k_p · 4 sin²(x/2) sin(p x) = (N x - sin N x)/2. In general motion they are only of third order.
  With increments before the step there are more k_p: the class of Ignagni 1996, whose paper was not available;
* uncompressed: the pairs of a distance share the k_p so that the products are exact for polynomial rates, too, which
  restores the order of general motion. Song, Wu and Pan 2013, by a table in the public domain after Song's thesis;
  tests hold the orders;
* recursive: the fast loop of Savage 1998, part 1, (46), (47). Each increment is multiplied with half the sum of the
earlier ones and 1/12 of the previous one; this is exact for a linear rate, for any number of them in a step.

Velocity has the same k_ij, by duality: `velocity`.

The first algorithms have formulas for one gyro sample, some with the previous one, or for two: γ' and γ'' are the
increments of the two halves of a step. Their products are those of a rotation vector of the same accuracy, which
velocity uses.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from fractions import Fraction
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
from .definition import MOST_SAMPLES, SUM, Algorithm, Product


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


def two_sample_fifth_power(g: Vector, turned: Vector) -> None:
    """x = (1 + f/48 + f²/1920) φ/4, f = φ·φ, φ = γ' + γ'' + (2/3) γ' × γ'': tan(φ/4) to the fifth power."""
    sum_of_increments(g, 2, turned)
    add_cross(2.0 / 3.0, g, 0, g, 1, turned)
    square = square_of_vector(turned)
    scale_vector(0.25 * (1.0 + square / 48.0 + square * square / 1920.0), turned)
    complete_rodrigues(turned)


def prepare_products(algorithm: float, catalogue: Vector, products: Vector) -> None:
    """Write the products of an algorithm.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    catalogue : (N,)
        products of all algorithms: number, i, j, k_ij of each, and a final zero
    products : (3 * M + 2,) or longer
        overwritten: the number of samples, 0 without products; j + 1, i, k_ij of each, in the order of j and then of i;
        a final zero
    """
    products[0] = 0.0
    at = 1
    for j in range(MOST_SAMPLES):
        for i in range(-MOST_SAMPLES, SUM + 1):
            entry = 0
            while catalogue[entry] != 0.0:
                if catalogue[entry] == algorithm and catalogue[entry + 1] == i and catalogue[entry + 2] == j:
                    products[0] = j + 1.0
                    products[at] = j + 1.0
                    products[at + 1] = catalogue[entry + 1]
                    products[at + 2] = catalogue[entry + 3]
                    at = at + 3
                entry = entry + 4
    products[at] = 0.0


def weighted_before(products: Vector, at: int, previous: Vector, g: Vector, weighted: Vector) -> int:
    """Write Σ k_ij γ_i into `weighted` (3,), over the products from place `at` on that have one γ_j.

    Returns the place where those of the next γ_j begin.
    """
    samples = int(products[0])
    j = int(products[at])
    x = 0.0
    y = 0.0
    z = 0.0
    while products[at] == j:
        i = int(products[at + 1])
        factor = products[at + 2]
        if i == SUM:
            for n in range(j - 1):
                x = x + factor * g[3 * n]
                y = y + factor * g[3 * n + 1]
                z = z + factor * g[3 * n + 2]
        elif i < 0:
            i = 3 * (samples + i)
            x = x + factor * previous[i]
            y = y + factor * previous[i + 1]
            z = z + factor * previous[i + 2]
        else:
            i = 3 * i
            x = x + factor * g[i]
            y = y + factor * g[i + 1]
            z = z + factor * g[i + 2]
        at = at + 3
    weighted[0] = x
    weighted[1] = y
    weighted[2] = z
    return at


def rotation_vector(previous: Vector, g: Vector, products: Vector, weighted: Vector, turned: Vector) -> None:
    """Write φ into turned[1..3]; increments before the step and in it, products of `prepare_products`, space (4,)."""
    sum_of_increments(g, int(products[0]), turned)
    at = 1
    while products[at] > 0.0:
        j = int(products[at]) - 1
        at = weighted_before(products, at, previous, g, weighted)
        add_cross(1.0, weighted, 0, g, j, turned)


def by_products(previous: Vector, g: Vector, products: Vector, weighted: Vector, turned: Vector) -> None:
    """Quaternion of φ by the exact formulas of (25)."""
    rotation_vector(previous, g, products, weighted, turned)
    complete_rotation_vector(turned)


def by_products_and_series(previous: Vector, g: Vector, products: Vector, weighted: Vector, turned: Vector) -> None:
    """Quaternion of φ by series: λ0 = 1 - f/8 + f²/384, λv = (1/2 - f/48 + f²/3840) φ, f = φ·φ."""
    rotation_vector(previous, g, products, weighted, turned)
    complete_rotation_vector_by_series(turned)


def by_products_cut_off(previous: Vector, g: Vector, products: Vector, weighted: Vector, turned: Vector) -> None:
    """Write the quaternion of φ by λ0 = 1 - f/8, λv = φ/2: the loss of accuracy in remark 3 of the paper."""
    rotation_vector(previous, g, products, weighted, turned)
    turned[0] = 1.0 - square_of_vector(turned) / 8.0
    scale_vector(0.5, turned)


def over(divisor: int, numerators: Mapping[tuple[int, int], int]) -> tuple[Product, ...]:
    """Products with a common divisor, by (i, j)."""
    return tuple((i, j, Fraction(value, divisor)) for (i, j), value in numerators.items())


def compressed(divisor: int, *numerators: int) -> tuple[Product, ...]:
    """Return products with the last increment of a step, one for each numerator, from the first increment on."""
    last = len(numerators)
    return over(divisor, {(i, last): value for i, value in enumerate(numerators)})


def recursive(count: int) -> tuple[Product, ...]:
    """Return the products of the fast loop over this number of samples."""
    with_last = [(j - 1, j, Fraction(1, 12)) for j in range(count)]
    return (*with_last, *((SUM, j, Fraction(1, 2)) for j in range(1, count)))


def exact(
    number: int, name: str, title: str, source: str, orders: tuple[int, int], products: tuple[Product, ...]
) -> Algorithm:
    """Return an algorithm with the exact formulas of (25): it takes half a turn over a step."""
    samples = 1 + max(j for _, j, _ in products)
    return Algorithm(
        number,
        title,
        source,
        by_products,
        samples=samples,
        order=orders[0],
        coning_order=orders[1],
        previous=min(i for i, _, _ in products) < 0,
        constant_rate=True,
        max_increment=math.pi / samples,
        name=name,
        products=products,
    )


_of_two = partial(Algorithm, samples=2, coning_order=4, products=((0, 1, Fraction(2, 3)),))
_with_the_one_before = partial(
    Algorithm, samples=1, order=3, coning_order=4, previous=True, products=((-1, 0, Fraction(1, 12)),)
)

_BY_FORMULA = (
    Algorithm(
        2,
        "one sample, mean angular rate",
        "Chelnokov et al. 2016, (7.18)",
        mean_rate,
        samples=1,
        order=2,
        coning_order=2,
        constant_rate=True,
        max_increment=math.pi,
    ),
    _with_the_one_before(
        3,
        "one sample and the one before, series of the quaternion",
        "Chelnokov et al. 2016, (7.20)",
        one_sample_quaternion,
        norm_order=3,
        max_increment=0.86,
    ),
    _with_the_one_before(
        4,
        "one sample and the one before, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (19)",
        one_sample_rodrigues,
        max_increment=1.15,
    ),
    _with_the_one_before(
        5,
        "one sample and the one before, modified Rodrigues parameters, second form",
        "Chelnokov et al. 2016, (20)",
        one_sample_rodrigues_symmetric,
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
        12,
        "two samples, rotation vector, modified Rodrigues parameters to the fifth power",
        "(22) with the term in φ⁵ that it leaves out",
        two_sample_fifth_power,
        order=4,
        max_increment=0.94,
    ),
)

PANOV = exact(
    13,
    "panov",
    "four samples, Panov's rotation vector and exact formulas",
    "Chelnokov et al. 2016, (24), (25)",
    (4, 6),
    over(45, {(0, 2): 22, (0, 3): 22, (1, 2): 22, (1, 3): 22, (0, 1): 32, (2, 3): 32}),
)

ALGORITHMS = (
    *_BY_FORMULA,
    exact(
        11,
        "two-sample-rotation-vector",
        "two samples, rotation vector and exact formulas",
        "Miller 1983, two-sample; Chelnokov et al. 2016, (25)",
        (4, 4),
        over(3, {(0, 1): 2}),
    ),
    PANOV,
    replace(
        PANOV,
        number=14,
        title="four samples, Panov's rotation vector and series",
        source="Chelnokov et al. 2016, (24), (25) as series to the fifth power",
        kernel=by_products_and_series,
        norm_order=5,
        constant_rate=False,
        max_increment=0.44,
        name="panov-series",
    ),
    replace(
        PANOV,
        number=15,
        title="four samples, Panov's rotation vector and a series cut off too early",
        source="Chelnokov et al. 2016, remark 3 (fitted to the published errors)",
        kernel=by_products_cut_off,
        order=2,
        norm_order=3,
        constant_rate=False,
        max_increment=0.07,
        name="panov-cut-off",
    ),
    exact(
        16,
        "four-sample-rotation-vector",
        "four samples, rotation vector of a cubic rate",
        "Jiang and Lin 1992, four-sample polynomial algorithm",
        (4, 6),
        over(945, {(0, 1): 736, (2, 3): 736, (0, 2): 334, (1, 3): 334, (0, 3): 526, (1, 2): 654}),
    ),
    exact(
        17,
        "three-sample-coning",
        "three samples, optimised for coning",
        "Miller 1983, three-sample",
        (3, 6),
        compressed(20, 9, 27),
    ),
    exact(
        18,
        "four-sample-coning",
        "four samples, optimised for coning",
        "Lee et al. 1990; Savage 1998",
        (3, 8),
        compressed(105, 54, 92, 214),
    ),
    exact(
        19,
        "five-sample-coning",
        "five samples, optimised for coning",
        "Savage 1998, five-sample",
        (3, 10),
        compressed(504, 250, 525, 650, 1375),
    ),
    exact(
        28,
        "two-sample-coning-with-two-before",
        "two samples and two before, optimised for coning",
        "Ignagni 1996, the class; solved here",
        (3, 8),
        over(420, {(0, 1): 323, (-1, 1): -26, (-2, 1): 3}),
    ),
    exact(
        29,
        "three-sample-coning-with-three-before",
        "three samples and three before, optimised for coning",
        "Ignagni 1996, the class; solved here",
        (3, 12),
        over(27720, {(1, 2): 40461, (0, 2): 9642, (-1, 2): 1098, (-2, 2): -186, (-3, 2): 15}),
    ),
    exact(
        30,
        "three-sample-uncompressed",
        "three samples, uncompressed",
        "Song, Wu, Pan 2013, three-sample",
        (4, 6),
        over(40, {(0, 1): 27, (1, 2): 27, (0, 2): 18}),
    ),
    exact(
        31,
        "four-sample-uncompressed",
        "four samples, uncompressed",
        "Song, Wu, Pan 2013, four-sample",
        (4, 8),
        over(315, {(0, 1): 232, (2, 3): 232, (1, 2): 178, (0, 2): 138, (1, 3): 138, (0, 3): 162}),
    ),
    exact(
        32,
        "four-sample-recursive",
        "four samples in a fast loop, with the one before",
        "Savage 1998, part 1, two-speed recursive",
        (3, 4),
        recursive(4),
    ),
)
