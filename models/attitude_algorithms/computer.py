"""The strapdown attitude computer: it collects angle increments and updates the attitude at every step of an algorithm.

`update` is one update by the chosen algorithm: the one entry for the computer, tests and comparisons.

It takes increments, rates at the ends of the samples, or both.

Rates, or rates with increments, become the increments of the algorithm. These are those of the polynomial of degree N
that has the N + 1 inputs of its step, where N is the number of samples of the algorithm.

* rates: those at the beginning, and at the end of each of the N samples;
* mixed: N/2 increments and the rates at their N/2 + 1 ends; each half of a sample is a sample of the algorithm.

Such an increment errs by the order N + 2, their sum by one order more for even N. So the attitude is of order N + 2 for
even N, of order N + 1 for odd N, or of the algorithm's own if that is lower. Mixed with N = 2 it is φ = γ + (h/10)(ω₀ ×
γ + γ × ω₁) - (h²/60) ω₀ × ω₁ except for terms of fifth order.
"""

import math
from collections.abc import Sequence
from fractions import Fraction
from functools import cache

from ..restricted import Vector
from ..rotation import MAX_INCREMENT, multiply, normalise
from .adaptive import adaptive_degree
from .definition import MOST_SAMPLES, Algorithm
from .iteration import (
    LARGEST_TABLE,
    MOST_INCREMENTS,
    functional_iteration,
    increments_iterated,
    prepare_functional_iteration,
    rodrigues_iteration,
)
from .products import (
    by_products,
    by_products_and_series,
    by_products_cut_off,
    mean_rate,
    one_sample_quaternion,
    one_sample_rodrigues,
    one_sample_rodrigues_symmetric,
    prepare_products,
    two_sample_fifth_power,
    two_sample_quaternion,
    two_sample_rodrigues,
    two_sample_rodrigues_second_iterate,
    two_sample_rodrigues_third_order,
    two_sample_textbook,
    two_sample_textbook_as_run,
)

STEP_SIZE = 3 * MOST_INCREMENTS
"""Length of the arrays with the increments of a step."""

TABLE_SIZE = LARGEST_TABLE
"""Length of `table`."""

START = 0
"""Place in `progress`: time of the start [s]"""
PERIOD = 1
"""time between increments [s]"""
TAKEN = 2
"""increments taken"""
WAITING = 3
"""increments that wait for an update"""
KNOWN = 4
"""1.0 if there was a previous step"""
SAMPLES = 5
"""increments of one update of the chosen algorithm"""
LONGEST = 6
"""longest increment in its valid range [rad]"""
READS_PREVIOUS = 7
"""1.0 if it reads the increments of the previous step"""
LEFT = 8
"""remaining time of a sample [s]; the sample period before its first part"""
PROGRESS_SIZE = 9
"""Length of `progress`."""

SAMPLE_TOLERANCE = 1e-3
"""Largest distance of the end of a step from that of a sample [samples]: hosts add up rounded times."""


def prepare_update(algorithm: float, catalogue: Vector, table: Vector) -> None:
    """Write the tables of an algorithm; called once, before the first update.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    catalogue : (N,)
        all products, as `prepare_products` takes them
    table : (TABLE_SIZE,)
        overwritten: with the factors of products if the attitude is not iterated
    """
    prepare_products(algorithm, catalogue, table)
    count = increments_iterated(algorithm)
    if count > 0:
        prepare_functional_iteration(count, table)
    if algorithm == 27.0:
        prepare_functional_iteration(8, table)


def update(
    algorithm: float,
    previous: Vector,
    known: float,
    g: Vector,
    table: Vector,
    space: Vector,
    part: Vector,
    turned: Vector,
) -> int:
    """Write the quaternion λ* of a step.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    previous, g : (STEP_SIZE,)
        increments of the previous step and of this one, sample after sample [rad]
    known : float
        1.0 if there is a previous step; otherwise `previous` is zero
    table : from `prepare_update`
    space, part : (SPACE_SIZE,), (4,)
        working space
    turned : (4,)
        the quaternion; on the unit sphere except for the terms that the algorithm cuts off

    Returns
    -------
    int
        0, or 1 if a functional iteration does not end
    """
    count = increments_iterated(algorithm)
    if algorithm == 1.0:
        two_sample_rodrigues(g, turned)
    elif algorithm == 2.0:
        mean_rate(g, turned)
    elif algorithm == 3.0:
        one_sample_quaternion(previous, g, turned)
    elif algorithm == 4.0:
        one_sample_rodrigues(previous, g, turned)
    elif algorithm == 5.0:
        one_sample_rodrigues_symmetric(previous, g, turned)
    elif algorithm == 6.0:
        two_sample_rodrigues_second_iterate(g, turned)
    elif algorithm == 7.0:
        two_sample_rodrigues_third_order(g, turned)
    elif algorithm == 8.0:
        two_sample_quaternion(g, turned)
    elif algorithm == 9.0:
        two_sample_textbook(g, turned)
    elif algorithm == 10.0:
        two_sample_textbook_as_run(g, turned)
    elif algorithm == 12.0:
        two_sample_fifth_power(g, turned)
    elif algorithm == 14.0:
        by_products_and_series(previous, g, table, part, turned)
    elif algorithm == 15.0:
        by_products_cut_off(previous, g, table, part, turned)
    elif algorithm == 27.0:
        adaptive_degree(previous, known, g, table, space, part, turned)
    elif algorithm >= 33.0:
        return rodrigues_iteration(count, g, 0, table, space, turned)
    elif count > 0:
        return functional_iteration(count, g, 0, table, space, turned)
    else:
        by_products(previous, g, table, part, turned)
    return 0


def increment_effects(before: Vector, increment: Vector, effect: Vector, added: Vector) -> float:
    """Stage "increment": add effects to an increment (3,) [rad], which may depend on the one before it; nominally
    nothing.

    Returns 1.0 if there are any, else 0.0.
    """
    added[0] = 0.0
    added[1] = 0.0
    added[2] = 0.0
    return 0.0


def begin_attitude(
    time: float,
    algorithm: float,
    sample_period: float,
    initial_attitude: Vector,
    attitude: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    table: Vector,
    before: Vector,
    sample: Vector,
    algorithms: Vector,
    products: Vector,
) -> int:
    """Begin at the initial attitude; returns 0 or the number of a message."""
    square = 0.0
    for i in range(4):
        attitude[i] = initial_attitude[i]
        square = square + initial_attitude[i] * initial_attitude[i]
    if not math.fabs(square - 1.0) <= 2e-3:
        return 1
    normalise(attitude)
    updated[0] = 1.0
    for i in range(3):
        before[i] = 0.0
        sample[i] = 0.0
    for i in range(STEP_SIZE):
        collected[i] = 0.0
        previous[i] = 0.0
    prepare_update(algorithm, products, table)
    for place in range(PROGRESS_SIZE):
        progress[place] = 0.0
    progress[START] = time
    progress[PERIOD] = sample_period
    progress[LEFT] = sample_period
    for k in range(3):
        progress[SAMPLES + k] = algorithms[3 * (int(algorithm) - 1) + k]
    return 0


def collect(
    time: float,
    step: float,
    increment: Vector,
    effect: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    before: Vector,
    added: Vector,
    sample: Vector,
) -> int:
    """Take the increment over (time, time + step]; progress[SAMPLES] wait when a step of the algorithm is full.

    Samples are counted in whole numbers; increments over parts of a sample add up to it. A step of 1e-14 s, with which
    some masters end, does not count as a sample. Returns 0 or the number of a message.
    """
    if progress[PERIOD] <= 0.0:
        progress[PERIOD] = step
        progress[LEFT] = step
    period = progress[PERIOD]
    if step <= 1e-9 * period:
        return 0
    missing = (progress[TAKEN] + 1.0) * period - (time + step - progress[START])
    tolerance = SAMPLE_TOLERANCE * period
    if not missing >= -tolerance or not math.fabs(missing - (progress[LEFT] - step)) <= tolerance:
        return 2
    x = increment[0]
    y = increment[1]
    z = increment[2]
    if progress[LEFT] != period:
        x = sample[0] + x
        y = sample[1] + y
        z = sample[2] + z
    size = x * x + y * y + z * z
    if not size <= progress[LONGEST] * progress[LONGEST]:
        if size <= MAX_INCREMENT * MAX_INCREMENT:
            return 4
        return 3
    updated[0] = 0.0
    sample[0] = x
    sample[1] = y
    sample[2] = z
    if missing > tolerance:
        progress[LEFT] = missing
        return 0
    progress[LEFT] = period
    if progress[TAKEN] == 0.0:
        # Before the first step the body is assumed to turn as in it.
        for i in range(3):
            before[i] = sample[i]
    if increment_effects(before, sample, effect, added) == 1.0:
        for i in range(3):
            before[i] = sample[i]
        x = x + added[0]
        y = y + added[1]
        z = z + added[2]
    at = 3 * int(progress[WAITING])
    collected[at] = x
    collected[at + 1] = y
    collected[at + 2] = z
    progress[TAKEN] = progress[TAKEN] + 1.0
    progress[WAITING] = progress[WAITING] + 1.0
    return 0


def turn_attitude(
    algorithm: float,
    renormalise: float,
    attitude: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    table: Vector,
    space: Vector,
    part: Vector,
    turned: Vector,
) -> int:
    """Update the attitude by the increments of a full step; returns 0 or the number of a message."""
    if update(algorithm, previous, progress[KNOWN], collected, table, space, part, turned) == 1:
        return 5
    multiply(attitude, turned, attitude)
    if renormalise == 1.0:
        normalise(attitude)
    if progress[READS_PREVIOUS] == 1.0:
        size = 3 * int(progress[SAMPLES])
        for i in range(size):
            previous[i] = collected[i]
    progress[KNOWN] = 1.0
    progress[WAITING] = 0.0
    updated[0] = 1.0
    return 0


# The kinds of input

INPUT_KINDS = ("increments", "rates", "mixed")
"""Kinds of input, from 1 on."""
INCREMENTS = 1.0
RATES = 2.0
MIXED = 3.0

INPUTS_SIZE = 3 * (MOST_SAMPLES + 1)
"""Length of `inputs`: rates times the sample period and increments, one behind the other [rad]."""

WEIGHTS_OF_RATES = (MOST_SAMPLES * (MOST_SAMPLES + 1) * (MOST_SAMPLES + 2)) // 3
"""Number of weights before those of mixed inputs."""


def order_with(kind: str, algorithm: Algorithm) -> int | None:
    """Return the order of an algorithm with inputs of a kind; None if it does not take them: mixed in odd numbers."""
    samples = algorithm.samples
    if kind == "increments":
        return algorithm.order
    return None if kind == "mixed" and samples % 2 else min(algorithm.order, samples + 2 - samples % 2)


def weights_of(samples: int, mixed: bool) -> list[list[Fraction]]:
    """Return weights (samples, samples + 1) of the inputs in the increments; mixed, a sample of the gyros is two of
    these."""
    powers = range(samples + 1)

    def integral(begin: int, end: int) -> list[Fraction]:
        return [Fraction(end ** (n + 1) - begin ** (n + 1), n + 1) for n in powers]

    def value(at: int, size: int) -> list[Fraction]:
        return [Fraction(size * at**n) for n in powers]

    integrals = [value(i, 1) for i in powers]
    if mixed:
        integrals = [integral(i - 1, i + 1) if i % 2 else value(i, 2) for i in powers]
    return gauss_jordan(integrals, [integral(m, m + 1) for m in range(samples)])


def gauss_jordan(rows: Sequence[Sequence[Fraction]], right: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """Return the X of X A = B, A and B by their rows, by Gauss and Jordan."""
    table = []
    for n in range(len(rows)):
        table.append([row[n] for row in rows] + [row[n] for row in right])
    for n in range(len(table)):
        at = next(k for k in range(n, len(table)) if table[k][n] != 0)
        table[n], table[at] = table[at], table[n]
        table[n] = [x / table[n][n] for x in table[n]]
        for k in range(len(table)):
            if k != n:
                table[k] = [x - table[k][n] * y for x, y in zip(table[k], table[n], strict=True)]
    solution = []
    for column in range(len(rows), len(rows) + len(right)):
        solution.append([row[column] for row in table])
    return solution


@cache
def all_weights() -> tuple[float, ...]:
    """Return the weights of rates, then of mixed inputs, for 1 to 8 samples."""
    weights: list[float] = []
    for mixed in (False, True):
        for samples in range(1, MOST_SAMPLES + 1):
            rows = [[Fraction()] * (samples + 1)] * samples
            if not mixed or samples % 2 == 0:
                rows = weights_of(samples, mixed)
            for row in rows:
                weights += map(float, row)
    return tuple(weights)


def increments_of_inputs(kind: float, samples: int, inputs: Vector, weights: Vector, g: Vector) -> None:
    """Write the increments (3 * samples,) of a step from its inputs (3 * (samples + 1),) by `all_weights`."""
    # The weights of fewer samples take the sum of n (n + 1) places.
    at = 0
    if kind == MIXED:
        at = WEIGHTS_OF_RATES
    for n in range(1, samples):
        at = at + n * (n + 1)
    for m in range(samples):
        for k in range(3):
            total = 0.0
            for i in range(samples + 1):
                total = total + weights[at + i] * inputs[3 * i + k]
            g[3 * m + k] = total
        at = at + samples + 1


def initialise_attitude(
    time: float,
    rate: Vector,
    input_kind: float,
    algorithm: float,
    sample_period: float,
    initial_attitude: Vector,
    attitude: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    inputs: Vector,
    table: Vector,
    before: Vector,
    sample: Vector,
    algorithms: Vector,
    products: Vector,
) -> int:
    """Begin at the initial attitude and rate; returns 0 or the number of a message."""
    refused = begin_attitude(
        time,
        algorithm,
        sample_period,
        initial_attitude,
        attitude,
        updated,
        progress,
        collected,
        previous,
        table,
        before,
        sample,
        algorithms,
        products,
    )
    for k in range(3):
        inputs[k] = rate[k]
    half = 2.0 * int(0.5 * progress[SAMPLES])
    if refused == 0 and input_kind == MIXED and half != progress[SAMPLES]:
        return 6
    return refused


def step_attitude(
    time: float,
    step: float,
    increment: Vector,
    rate: Vector,
    input_kind: float,
    algorithm: float,
    effect: Vector,
    renormalise: float,
    attitude: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    inputs: Vector,
    weights: Vector,
    table: Vector,
    space: Vector,
    part: Vector,
    turned: Vector,
    before: Vector,
    added: Vector,
    sample: Vector,
    turning: Vector,
) -> int:
    """Take the inputs and update the attitude when a step is full; returns 0 or the number of a message."""
    if input_kind != INCREMENTS:
        period = progress[PERIOD]
        if period <= 0.0:
            period = step
        for k in range(3):
            turning[k] = period * rate[k]
    count = progress[TAKEN]
    if input_kind == RATES:
        # Only the rate at the end of a sample counts, not those within it.
        for k in range(3):
            sample[k] = 0.0
        refused = collect(time, step, turning, effect, updated, progress, collected, before, added, sample)
    else:
        refused = collect(time, step, increment, effect, updated, progress, collected, before, added, sample)
    if refused > 0 or progress[TAKEN] == count:
        return refused
    needed = progress[SAMPLES]
    if input_kind != INCREMENTS:
        last = int(progress[WAITING])
        size = turning[0] * turning[0] + turning[1] * turning[1] + turning[2] * turning[2]
        if not size <= MAX_INCREMENT * MAX_INCREMENT:
            return 3
        for k in range(3):
            if count == 0.0:
                inputs[k] = progress[PERIOD] * inputs[k]
            if input_kind == MIXED:
                inputs[3 * (2 * last - 1) + k] = collected[3 * (last - 1) + k]
                inputs[6 * last + k] = turning[k]
            else:
                inputs[3 * last + k] = collected[3 * (last - 1) + k]
        if input_kind == MIXED:
            needed = 0.5 * needed
    if progress[WAITING] < needed:
        return 0
    if input_kind != INCREMENTS:
        samples = int(progress[SAMPLES])
        increments_of_inputs(input_kind, samples, inputs, weights, collected)
        for k in range(3):
            inputs[k] = inputs[3 * samples + k]
    return turn_attitude(
        algorithm, renormalise, attitude, updated, progress, collected, previous, table, space, part, turned
    )
