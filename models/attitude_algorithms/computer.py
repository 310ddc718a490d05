"""The strapdown attitude computer: collects angle increments and updates the attitude at every step of an algorithm.

`update` is one update by whichever algorithm is chosen: the one entry that the computer, tests and comparisons use.
"""

import math

from ..restricted import Vector
from ..rotation import multiply, normalise
from .adaptive import adaptive_degree
from .definition import MAX_INCREMENT
from .formulas import (
    mean_rate,
    one_sample_quaternion,
    one_sample_rodrigues,
    one_sample_rodrigues_symmetric,
    two_sample_fifth_power,
    two_sample_quaternion,
    two_sample_rodrigues,
    two_sample_rodrigues_second_iterate,
    two_sample_rodrigues_third_order,
    two_sample_textbook,
    two_sample_textbook_as_run,
)
from .iteration import (
    LARGEST_TABLE,
    MOST_INCREMENTS,
    functional_iteration,
    increments_iterated,
    prepare_functional_iteration,
    rodrigues_iteration,
)
from .products import by_products, by_products_and_series, by_products_cut_off, prepare_products

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
"""1.0 where there was a step before"""
SAMPLES = 5
"""increments of one update of the algorithm that was chosen"""
LONGEST = 6
"""longest increment in its valid range [rad]"""
READS_PREVIOUS = 7
"""1.0 where it reads the increments of the step before"""
LEFT = 8
"""time that is left of a sample [s]; the sample period while no part has passed"""
PROGRESS_SIZE = 9
"""Length of `progress`."""

SAMPLE_TOLERANCE = 1e-3
"""How far the end of a step may be off that of a sample [samples]: hosts add up rounded times."""


def prepare_update(algorithm: float, catalogue: Vector, table: Vector) -> None:
    """Write the tables that an algorithm needs; called once, before the first update.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    catalogue : (N,)
        of all products, as `prepare_products` takes it
    table : (TABLE_SIZE,)
        overwritten: with the factors of products where the attitude is not iterated
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
        increments of the step before and of this one, sample after sample [rad]
    known : float
        1.0 where there is a step before; where not, `previous` is zero
    table : from `prepare_update`
    space, part : (SPACE_SIZE,), (4,)
        working space
    turned : (4,)
        the quaternion; on the unit sphere but for what the algorithm cuts off

    Returns
    -------
    int
        0, or 1 where a functional iteration does not end
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
    """Stage "increment": what effects add to an increment (3,) [rad], by the one before it; nominally nothing.

    Returns 1.0 where there are any, else 0.0.
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
    some masters end, is no sample. Returns 0 or the number of a message.
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
    if not size <= MAX_INCREMENT * MAX_INCREMENT:
        return 3
    if size > progress[LONGEST] * progress[LONGEST]:
        return 4
    updated[0] = 0.0
    sample[0] = x
    sample[1] = y
    sample[2] = z
    if missing > tolerance:
        progress[LEFT] = missing
        return 0
    progress[LEFT] = period
    if progress[TAKEN] == 0.0:
        # Before the first step the body turned as in it.
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
