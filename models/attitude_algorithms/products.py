"""Rotation vectors with products of increments: φ = Σ γ_i + Σ k_ij γ_i × γ_j, each algorithm by its k_ij alone.

The sums are of the increments of a step, i = 0, 1, ...; negative i are those before it, the last of them -1; i = `SUM`
is the sum of the increments of the step before γ_j. So k_ij are the data of every family:

* of polynomial rates, exact in ½∫ α × ω dt;
* optimised for coning, compressed: under coning the vector product of two increments has a mean that depends on their
  distance alone, so that all pairs of one distance may be put into one, (Σ k_p γ_{N-p}) × γ_N. The k_p solve, order by
  order in x = Ω Δt, Σ k_p · 4 sin²(x/2) sin(p x) = (N x - sin N x)/2. In general motion they are of third order only.
  With increments before the step there are more k_p: the class of Ignagni 1996, of which the paper was not to be had;
* uncompressed, with the k_p shared among the pairs of a distance so that the products are exact for polynomial rates,
  too: the order of general motion comes back. Song, Wu and Pan 2013, by a table in the public domain that gives them
  after Song's thesis; tests of the orders hold them;
* recursive: the fast loop of Savage 1998, part 1, (46), (47): each increment with half the sum of those before it and
  1/12 of the one before it, which is exact for a linear rate, however many there are in a step.

Velocity has the same k_ij, by duality: `velocity`.
"""

import math
from collections.abc import Mapping
from fractions import Fraction
from functools import partial

from ..restricted import Vector
from ..rotation import (
    add_cross,
    complete_rotation_vector,
    complete_rotation_vector_by_series,
    scale_vector,
    square_of_vector,
    sum_of_increments,
)
from .definition import MOST_SAMPLES, SUM, Algorithm, Product

ROW = 2 * MOST_SAMPLES + 1
"""Length of a row of `products`: the factors of the products with one γ_j, of the increments before the step, of those
in it, of the sum of those before γ_j."""
PRODUCTS_SIZE = ROW * MOST_SAMPLES + 1
"""Length of `products`: a row for each γ_j, and the number of samples."""


def prepare_products(algorithm: float, catalogue: Vector, products: Vector) -> None:
    """Write the factors of an algorithm's products (PRODUCTS_SIZE,).

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    catalogue : (N,)
        of all algorithms: number, i, j, k_ij of each product, and a zero behind them
    """
    for place in range(PRODUCTS_SIZE):
        products[place] = 0.0
    at = 0
    while catalogue[at] != 0.0:
        if catalogue[at] == algorithm:
            j = int(catalogue[at + 2])
            products[ROW * j + MOST_SAMPLES + int(catalogue[at + 1])] = catalogue[at + 3]
            if j + 1.0 > products[PRODUCTS_SIZE - 1]:
                products[PRODUCTS_SIZE - 1] = j + 1.0
        at = at + 4


def weighted_before(products: Vector, j: int, previous: Vector, g: Vector, weighted: Vector) -> float:
    """Write Σ k_ij γ_i over all i before j into `weighted` (3,); returns 1.0 where there are any, else 0.0."""
    samples = int(products[PRODUCTS_SIZE - 1])
    found = 0.0
    for k in range(3):
        weighted[k] = 0.0
    for i in range(-samples, j):
        factor = products[ROW * j + MOST_SAMPLES + i]
        if factor != 0.0:
            found = 1.0
            for k in range(3):
                if i < 0:
                    weighted[k] = weighted[k] + factor * previous[3 * (samples + i) + k]
                else:
                    weighted[k] = weighted[k] + factor * g[3 * i + k]
    factor = products[ROW * j + MOST_SAMPLES + SUM]
    if factor != 0.0:
        found = 1.0
        for i in range(j):
            for k in range(3):
                weighted[k] = weighted[k] + factor * g[3 * i + k]
    return found


def rotation_vector(previous: Vector, g: Vector, products: Vector, weighted: Vector, turned: Vector) -> None:
    """Write φ into turned[1..3]; increments before the step and in it, factors of `prepare_products`, space (4,)."""
    samples = int(products[PRODUCTS_SIZE - 1])
    sum_of_increments(g, samples, turned)
    for j in range(samples):
        if weighted_before(products, j, previous, g, weighted) == 1.0:
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
    """Quaternion of φ by λ0 = 1 - f/8, λv = φ/2: what remark 3 of the paper blames for a loss of accuracy."""
    rotation_vector(previous, g, products, weighted, turned)
    turned[0] = 1.0 - square_of_vector(turned) / 8.0
    scale_vector(0.5, turned)


def over(divisor: int, numerators: Mapping[tuple[int, int], int]) -> tuple[Product, ...]:
    """Products with a common divisor, by (i, j)."""
    return tuple((i, j, Fraction(value, divisor)) for (i, j), value in numerators.items())


def compressed(divisor: int, *numerators: int) -> tuple[Product, ...]:
    """Products with the last increment of a step, of as many increments before it as there are numerators."""
    last = len(numerators)
    return over(divisor, {(i, last): value for i, value in enumerate(numerators)})


def recursive(count: int) -> tuple[Product, ...]:
    """Products of the fast loop over so many samples."""
    with_last = [(j - 1, j, Fraction(1, 12)) for j in range(count)]
    return (*with_last, *((SUM, j, Fraction(1, 2)) for j in range(1, count)))


PANOV = over(45, {(0, 2): 22, (0, 3): 22, (1, 2): 22, (1, 3): 22, (0, 1): 32, (2, 3): 32})

_of_four = partial(Algorithm, kernel=by_products, samples=4, order=4, coning_order=6, max_increment=math.pi / 4)
_for_coning = partial(Algorithm, kernel=by_products, order=3, constant_rate=True)

ALGORITHMS = (
    Algorithm(
        11,
        "two samples, rotation vector and exact formulas",
        "Miller 1983, two-sample; Chelnokov et al. 2016, (25)",
        by_products,
        samples=2,
        order=4,
        coning_order=4,
        constant_rate=True,
        max_increment=math.pi / 2,
        name="two-sample-rotation-vector",
        products=over(3, {(0, 1): 2}),
    ),
    _of_four(
        13,
        "four samples, Panov's rotation vector and exact formulas",
        "Chelnokov et al. 2016, (24), (25)",
        constant_rate=True,
        name="panov",
        products=PANOV,
    ),
    _of_four(
        14,
        "four samples, Panov's rotation vector and series",
        "Chelnokov et al. 2016, (24), (25) as series to the fifth power",
        kernel=by_products_and_series,
        norm_order=5,
        max_increment=0.44,
        name="panov-series",
        products=PANOV,
    ),
    _of_four(
        15,
        "four samples, Panov's rotation vector and a series cut off too early",
        "Chelnokov et al. 2016, remark 3 (fitted to the published errors)",
        kernel=by_products_cut_off,
        order=2,
        norm_order=3,
        max_increment=0.07,
        name="panov-cut-off",
        products=PANOV,
    ),
    _of_four(
        16,
        "four samples, rotation vector of a cubic rate",
        "Jiang and Lin 1992, four-sample polynomial algorithm",
        constant_rate=True,
        name="four-sample-rotation-vector",
        products=over(945, {(0, 1): 736, (2, 3): 736, (0, 2): 334, (1, 3): 334, (0, 3): 526, (1, 2): 654}),
    ),
    _for_coning(
        17,
        "three samples, optimised for coning",
        "Miller 1983, three-sample",
        samples=3,
        coning_order=6,
        max_increment=math.pi / 3,
        name="three-sample-coning",
        products=compressed(20, 9, 27),
    ),
    _for_coning(
        18,
        "four samples, optimised for coning",
        "Lee et al. 1990; Savage 1998",
        samples=4,
        coning_order=8,
        max_increment=math.pi / 4,
        name="four-sample-coning",
        products=compressed(105, 54, 92, 214),
    ),
    _for_coning(
        19,
        "five samples, optimised for coning",
        "Savage 1998, five-sample",
        samples=5,
        coning_order=10,
        max_increment=math.pi / 5,
        name="five-sample-coning",
        products=compressed(504, 250, 525, 650, 1375),
    ),
    _for_coning(
        28,
        "two samples and two before, optimised for coning",
        "Ignagni 1996, the class; solved here",
        samples=2,
        coning_order=8,
        previous=True,
        max_increment=math.pi / 2,
        name="two-sample-coning-with-two-before",
        products=over(420, {(0, 1): 323, (-1, 1): -26, (-2, 1): 3}),
    ),
    _for_coning(
        29,
        "three samples and three before, optimised for coning",
        "Ignagni 1996, the class; solved here",
        samples=3,
        coning_order=12,
        previous=True,
        max_increment=math.pi / 3,
        name="three-sample-coning-with-three-before",
        products=over(27720, {(1, 2): 40461, (0, 2): 9642, (-1, 2): 1098, (-2, 2): -186, (-3, 2): 15}),
    ),
    Algorithm(
        30,
        "three samples, uncompressed",
        "Song, Wu, Pan 2013, three-sample",
        by_products,
        samples=3,
        order=4,
        coning_order=6,
        constant_rate=True,
        max_increment=math.pi / 3,
        name="three-sample-uncompressed",
        products=over(40, {(0, 1): 27, (1, 2): 27, (0, 2): 18}),
    ),
    Algorithm(
        31,
        "four samples, uncompressed",
        "Song, Wu, Pan 2013, four-sample",
        by_products,
        samples=4,
        order=4,
        coning_order=8,
        constant_rate=True,
        max_increment=math.pi / 4,
        name="four-sample-uncompressed",
        products=over(315, {(0, 1): 232, (2, 3): 232, (1, 2): 178, (0, 2): 138, (1, 3): 138, (0, 3): 162}),
    ),
    _for_coning(
        32,
        "four samples in a fast loop, with the one before",
        "Savage 1998, part 1, two-speed recursive",
        samples=4,
        coning_order=4,
        previous=True,
        max_increment=math.pi / 4,
        name="four-sample-recursive",
        products=recursive(4),
    ),
)
