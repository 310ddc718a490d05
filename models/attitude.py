"""Attitude from angle increments: the algorithms as data and one small kernel each.

Source: Chelnokov, Perelyaev, Chelnokova 2016. x = tan(φ/4) e is the vector of the modified Rodrigues parameters of a
step's rotation vector φ e; λ* = ((1 - x·x), 2x) / (1 + x·x), λ(t_n) = λ(t_{n-1}) ∘ λ*. The coefficients are not printed
in the paper; they follow from expanding 4 dx/dt = ω + 2 x×ω + 2 x(x·ω) - (x·x)ω, and a test holds the orders.
"""

import math
from dataclasses import dataclass

from trihedron.models.restricted import Vector
from trihedron.models.rotation import multiply, normalise, set_quaternion

MAX_INCREMENT = math.pi
"""Largest increment over one sample [rad] that is taken: beyond half a turn nothing can be said."""


@dataclass(frozen=True)
class Algorithm:
    """An attitude algorithm as data.

    Attributes
    ----------
    number : int
        value of the parameter `algorithm`
    name, title, source : str
        how it is chosen, how it is shown, where it stands
    samples : int
        gyro samples that one update takes
    order : int
        observed order of the attitude's error in the step over a fixed time
    """

    number: int
    name: str
    title: str
    source: str
    samples: int
    order: int


ALGORITHMS = (
    Algorithm(
        1,
        "two-sample-rodrigues",
        "two samples, modified Rodrigues parameters",
        "Chelnokov et al. 2016, (22)",
        2,
        4,
    ),
    Algorithm(2, "mean-rate", "one sample, mean angular rate", "Chelnokov et al. 2016, (7.18)", 1, 2),
)
"""The algorithms, by number."""


def two_sample_rodrigues(first: Vector, second: Vector, x: Vector) -> None:
    """Write tan(φ/4) e (3,) from the increments (3,) of the two halves of a step: equation (22)."""
    a = 0.25 + (first[0] * first[0] + first[1] * first[1] + first[2] * first[2]) / 48.0
    b = 0.25 + (second[0] * second[0] + second[1] * second[1] + second[2] * second[2]) / 48.0
    x[0] = a * first[0] + b * second[0] + (first[1] * second[2] - first[2] * second[1]) / 6.0
    x[1] = a * first[1] + b * second[1] + (first[2] * second[0] - first[0] * second[2]) / 6.0
    x[2] = a * first[2] + b * second[2] + (first[0] * second[1] - first[1] * second[0]) / 6.0


def quaternion_of_rodrigues(x: Vector, result: Vector) -> None:
    """Quaternion (4,) of tan(φ/4) e (3,)."""
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    scale = 1.0 / (1.0 + square)
    set_quaternion((1.0 - square) * scale, 2.0 * x[0] * scale, 2.0 * x[1] * scale, 2.0 * x[2] * scale, result)


def quaternion_of_mean_rate(increment: Vector, result: Vector) -> None:
    """Quaternion (4,) of a turn at constant rate: equation (7.18)."""
    angle = math.sqrt(increment[0] * increment[0] + increment[1] * increment[1] + increment[2] * increment[2])
    half = 0.5 * angle
    if angle < 1e-4:
        scale = 0.5 - half * half / 12.0
    else:
        scale = math.sin(half) / angle
    set_quaternion(math.cos(half), scale * increment[0], scale * increment[1], scale * increment[2], result)


def initialise(
    time: float,
    sample_period: float,
    initial_attitude: Vector,
    attitude: Vector,
    updated: Vector,
    start: Vector,
    period: Vector,
    samples: Vector,
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
    return 0


def step(
    time: float,
    step: float,
    increment: Vector,
    algorithm: float,
    attitude: Vector,
    updated: Vector,
    start: Vector,
    period: Vector,
    samples: Vector,
    collected: Vector,
    x: Vector,
    turned: Vector,
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
    samples[0] = samples[0] + 1.0
    updated[0] = 0.0
    if algorithm == 2.0:
        quaternion_of_mean_rate(increment, turned)
        updated[0] = 1.0
    else:
        if samples[0] - 2.0 * math.floor(0.5 * samples[0]) == 1.0:
            for i in range(3):
                collected[i] = increment[i]
        else:
            two_sample_rodrigues(collected, increment, x)
            quaternion_of_rodrigues(x, turned)
            updated[0] = 1.0
    if updated[0] == 1.0:
        multiply(attitude, turned, attitude)
        normalise(attitude)
    return 0
