"""The strapdown attitude computer: collects angle increments and updates the attitude at every step of an algorithm."""

import math

from .attitude_algorithms import ALGORITHMS, MAX_INCREMENT, Algorithm
from .attitude_algorithms.update import STEP_SIZE, prepare_update, update
from .restricted import Vector
from .rotation import multiply, normalise

__all__ = ["ALGORITHMS", "MAX_INCREMENT", "Algorithm", "initialise", "step"]


def increment_effects(before: Vector, increment: Vector, effect: Vector, added: Vector) -> None:
    """Stage "increment": what effects add to an increment (3,) [rad], by the one before it; nominally nothing."""
    added[0] = 0.0
    added[1] = 0.0
    added[2] = 0.0


def initialise(
    time: float,
    algorithm: float,
    sample_period: float,
    initial_attitude: Vector,
    attitude: Vector,
    updated: Vector,
    start: Vector,
    period: Vector,
    samples: Vector,
    waiting: Vector,
    known: Vector,
    collected: Vector,
    previous: Vector,
    table: Vector,
    half_table: Vector,
    before: Vector,
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
    start[0] = time
    period[0] = sample_period
    samples[0] = 0.0
    waiting[0] = 0.0
    known[0] = 0.0
    for i in range(3):
        before[i] = 0.0
    for i in range(STEP_SIZE):
        collected[i] = 0.0
        previous[i] = 0.0
    prepare_update(algorithm, table, half_table)
    return 0


def step(
    time: float,
    step: float,
    increment: Vector,
    algorithm: float,
    effect: Vector,
    renormalise: float,
    attitude: Vector,
    updated: Vector,
    start: Vector,
    period: Vector,
    samples: Vector,
    waiting: Vector,
    known: Vector,
    collected: Vector,
    previous: Vector,
    samples_of_update: Vector,
    longest_increment: Vector,
    table: Vector,
    half_table: Vector,
    differences: Vector,
    rates: Vector,
    values: Vector,
    slopes: Vector,
    part: Vector,
    turned: Vector,
    before: Vector,
    added: Vector,
) -> int:
    """Take the increment over (time, time + step] and update the attitude when a step of the algorithm is full.

    Samples are counted in whole numbers; a step of 1e-14 s, with which some masters end, is no sample. Returns 0 or
    the number of a message.
    """
    if period[0] <= 0.0:
        period[0] = step
    if step <= 1e-9 * period[0]:
        return 0
    elapsed = (time + step - start[0]) / period[0]
    if not math.fabs(elapsed - (samples[0] + 1.0)) <= 1e-3:
        return 2
    size = 0.0
    for i in range(3):
        size = size + increment[i] * increment[i]
    if not size <= MAX_INCREMENT * MAX_INCREMENT:
        return 3
    chosen = int(algorithm) - 1
    if size > longest_increment[chosen] * longest_increment[chosen]:
        return 4
    if samples[0] == 0.0:
        # Before the first step the body turned as in it.
        for i in range(3):
            before[i] = increment[i]
    increment_effects(before, increment, effect, added)
    at = 3 * int(waiting[0])
    for i in range(3):
        collected[at + i] = increment[i] + added[i]
        before[i] = increment[i]
    samples[0] = samples[0] + 1.0
    waiting[0] = waiting[0] + 1.0
    updated[0] = 0.0
    if waiting[0] == samples_of_update[chosen]:
        failed = update(
            algorithm,
            previous,
            known[0],
            collected,
            table,
            half_table,
            differences,
            rates,
            values,
            slopes,
            part,
            turned,
        )
        if failed == 1:
            return 5
        multiply(attitude, turned, attitude)
        if renormalise == 1.0:
            normalise(attitude)
        for i in range(STEP_SIZE):
            previous[i] = collected[i]
        known[0] = 1.0
        waiting[0] = 0.0
        updated[0] = 1.0
    return 0
