"""What the attitude computer takes: increments, rates at the ends of the samples, or both.

Rates, or rates with increments, become the increments that the algorithm takes: those of the polynomial of degree N
that has the N + 1 inputs of its step, N the samples of the algorithm.

* rates: those at the beginning, and at the end of each of the N samples;
* mixed: N/2 increments and the rates at their N/2 + 1 ends; each half of a sample is a sample of the algorithm.

An increment that is found so errs by the order N + 2, their sum by one order more for even N: so the attitude is of
order N + 2 for even N, of order N + 1 for odd N, or of the algorithm's own where that is lower. Mixed with N = 2 it is
φ = γ + (h/10)(ω₀ × γ + γ × ω₁) - (h²/60) ω₀ × ω₁ but for terms of fifth order.
"""

from collections.abc import Sequence
from fractions import Fraction

from ..restricted import Vector
from .computer import PERIOD, SAMPLES, TAKEN, WAITING, begin_attitude, collect, turn_attitude
from .definition import MAX_INCREMENT, MOST_SAMPLES, Algorithm

INPUT_KINDS = ("increments", "rates", "mixed")
"""What the inputs are, from 1 on."""
INCREMENTS = 1.0
RATES = 2.0
MIXED = 3.0

INPUTS_SIZE = 3 * (MOST_SAMPLES + 1)
"""Length of `inputs`: rates times the sample period and increments, one behind the other [rad]."""

WEIGHTS_OF_RATES = (MOST_SAMPLES * (MOST_SAMPLES + 1) * (MOST_SAMPLES + 2)) // 3
"""How many weights come before those of mixed inputs."""


def order_with(kind: str, algorithm: Algorithm) -> int | None:
    """Order of an algorithm with inputs of a kind; None where it does not take them: mixed in odd numbers."""
    samples = algorithm.samples
    if kind == "increments":
        return algorithm.order
    return None if kind == "mixed" and samples % 2 else min(algorithm.order, samples + 2 - samples % 2)


def weights_of(samples: int, mixed: bool) -> list[list[Fraction]]:
    """Weights (samples, samples + 1) of the inputs in the increments; mixed, a sample of the gyros is two of these."""
    powers = range(samples + 1)

    def integral(begin: int, end: int) -> list[Fraction]:
        return [Fraction(end ** (n + 1) - begin ** (n + 1), n + 1) for n in powers]

    def value(at: int, size: int) -> list[Fraction]:
        return [Fraction(size * at**n) for n in powers]

    integrals = [value(i, 1) for i in powers]
    if mixed:
        integrals = [integral(i - 1, i + 1) if i % 2 else value(i, 2) for i in powers]
    return solved(integrals, [integral(m, m + 1) for m in range(samples)])


def solved(rows: Sequence[Sequence[Fraction]], right: Sequence[Sequence[Fraction]]) -> list[list[Fraction]]:
    """The X of X A = B, A and B by their rows, by Gauss and Jordan."""
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


WEIGHTS = tuple(
    float(x)
    for mixed in (False, True)
    for samples in range(1, MOST_SAMPLES + 1)
    for row in (
        weights_of(samples, mixed) if not mixed or samples % 2 == 0 else [[Fraction()] * (samples + 1)] * samples
    )
    for x in row
)
"""Of rates, then of mixed inputs, for 1 to 8 samples."""


def increments_of_inputs(kind: float, samples: int, inputs: Vector, weights: Vector, g: Vector) -> None:
    """Write the increments (3 * samples,) of a step from its inputs (3 * (samples + 1),) by `WEIGHTS`."""
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
    period = progress[PERIOD]
    if period <= 0.0:
        period = step
    for k in range(3):
        turning[k] = period * rate[k]
    count = progress[TAKEN]
    if input_kind == RATES:
        # The rate at the end of a sample counts, not those within it.
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
                inputs[k] = period * inputs[k]
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
