"""Noise of an inertial sensor as its own processes: white, flicker, random walk, ramp and quantisation.

The readings of a step h are means over it. White noise adds N w/√h; a random walk adds the mean of b over the step; the
ramp adds R t. Quantisation adds (q_k - q_(k-1))/h with the remainder q of standard deviation Q. Flicker is a sum of
first-order Markov processes, two a decade, whose times begin at the first step h. They have variances (B²/π) ln r and
times h r^i, r = √10; a random walk and white noise close the two ends. Its Allan deviation is 0.664 B within 2 % from
two steps to a hundred thousand. Every process starts stationary: B is in the first minute, too.

Source: coefficients and spectra of IEEE Std 952-1997, annex C.
"""

import math

from .random_numbers import seed_generator, uniform
from .restricted import Vector

STATES = 12
"""Markov processes of flicker for each axis."""
RATIO = 3.1622776601683795
"""√10: ratio of their correlation times."""
LONGEST = 316227.7660168379
"""RATIO to the power of STATES - 1: longest correlation time over the first step."""
SHARE = 0.6053658393399102
"""Root of ln(r)/π: standard deviation of each of them over B."""
LONG_END = 0.5983290118618385
"""Root of 2/(π √r): coefficient of the random walk at the long end over B/√T."""
SHORT_END = 0.3975
"""Coefficient of the white noise at the short end over B √h, less what sampling the shortest processes adds to it."""
HELD = 2.0
"""A Markov process is advanced whenever its time over this has passed."""
LEVELS = 1024.0
"""Distinct levels of a driving number: one number of 32 bits holds three such numbers."""
DRIVE = 3.4641016151377544
"""√12: over the standard deviation of a uniform number between 0 and 1."""
FIRST_STEP, WALK, REMAINDER, FLICKER, WAITED, ROUNDED, SUM = 0, 1, 4, 7, 43, 55, 58
"""Places in the memory of noise: the first step [s]; for each axis the walk, the remainder, the Markov processes; the
time since each of these was advanced [s]. Last, for each axis, the number that its remainder is drawn from, and the sum
of its Markov processes."""
MEMORY_SIZE = 61
SPARE_SIZE = 2


def gaussian(generator: Vector, spare: Vector) -> float:
    """Draw a normal number of standard deviation one, by Box and Muller; `spare` (2,) keeps the second of a pair."""
    if spare[0] > 0.0:
        spare[0] = 0.0
        return spare[1]
    size = math.sqrt(-2.0 * math.log(uniform(generator)))
    angle = 2.0 * math.pi * uniform(generator)
    spare[0] = 1.0
    spare[1] = size * math.sin(angle)
    return size * math.cos(angle)


def draw_driving(generator: Vector, at: int, driving: Vector) -> None:
    """Draw three uniform numbers of mean zero and standard deviation one into places from `at` on.

    One number of the generator gives all three, by its first digits and those behind them.
    """
    drawn = uniform(generator)
    driving[at] = DRIVE * (drawn - 0.5)
    for p in range(1, 3):
        drawn = drawn * LEVELS
        drawn = drawn - math.floor(drawn)
        driving[at + p] = DRIVE * (drawn - 0.5)


def advance_flicker(step: float, instability: Vector, memory: Vector, generator: Vector, driving: Vector) -> None:
    """Advance the Markov processes of all axes by a step [s].

    A process that hardly changes over a step waits: when a part of its time has passed it is advanced, exactly, and the
    next slower one is looked at. Uniform numbers drive it: its spectrum equals that of normal numbers of the same
    variance.
    """
    time = memory[FIRST_STEP]
    passed = step
    for i in range(STATES):
        waited = memory[WAITED + i] + passed
        memory[WAITED + i] = waited
        if waited * HELD < time:
            return
        memory[WAITED + i] = 0.0
        decay = math.exp(-waited / time)
        spread = SHARE * math.sqrt(1.0 - decay * decay)
        draw_driving(generator, 0, driving)
        for p in range(3):
            at = FLICKER + STATES * p + i
            change = spread * instability[p] * driving[p] - (1.0 - decay) * memory[at]
            memory[at] = memory[at] + change
            memory[SUM + p] = memory[SUM + p] + change
        passed = waited
        time = time * RATIO


def seed_noise(seed: float, stream: float, memory: Vector, generator: Vector, spare: Vector) -> None:
    """Prepare the noise of a component with a seed and a stream of its own; the first step draws its processes."""
    seed_generator(seed, stream, generator)
    memory[FIRST_STEP] = 0.0
    spare[0] = 0.0


def start_noise(step: float, instability: Vector, memory: Vector, generator: Vector, spare: Vector) -> None:
    """Draw the processes as they stand at the first step [s]; `instability` (3,) is B."""
    memory[FIRST_STEP] = step
    for p in range(3):
        memory[WALK + p] = 0.0
        memory[REMAINDER + p] = 0.0
        memory[SUM + p] = 0.0
        for i in range(STATES):
            memory[WAITED + i] = 0.0
            memory[FLICKER + STATES * p + i] = 0.0
            if instability[p] > 0.0:
                memory[FLICKER + STATES * p + i] = SHARE * instability[p] * gaussian(generator, spare)
                memory[SUM + p] = memory[SUM + p] + memory[FLICKER + STATES * p + i]


def draw_noise(
    step: float,
    elapsed: float,
    white: Vector,
    instability: Vector,
    walk: Vector,
    ramp: Vector,
    quantisation: Vector,
    memory: Vector,
    generator: Vector,
    spare: Vector,
    noise: Vector,
) -> None:
    """Draw the noise (3,) of the mean reading over a step.

    Parameters
    ----------
    step, elapsed : float
        length of the step, and time since the start at its end [s]
    white, instability, walk, ramp, quantisation : (3,)
        N, B, K, R, Q
    memory, generator, spare : (61,), (6,), (2,)
        advanced; a first step of 0 in the memory: nothing was drawn yet
    noise : (3,)
        overwritten
    """
    if not memory[FIRST_STEP] > 0.0:
        start_noise(step, instability, memory, generator, spare)
    flickering = instability[0] + instability[1] + instability[2]
    if flickering > 0.0:
        advance_flicker(step, instability, memory, generator, noise)
    if flickering > 0.0 or walk[0] > 0.0 or walk[1] > 0.0 or walk[2] > 0.0:
        draw_driving(generator, 0, noise)
    if quantisation[0] > 0.0 or quantisation[1] > 0.0 or quantisation[2] > 0.0:
        draw_driving(generator, ROUNDED, memory)
    first = memory[FIRST_STEP]
    opening = SHORT_END * SHORT_END * first
    closing = LONG_END * LONG_END / (LONGEST * first)
    for p in range(3):
        value = ramp[p] * (elapsed - 0.5 * step)
        density = white[p] * white[p]
        wander = walk[p] * walk[p]
        if instability[p] > 0.0:
            value = value + memory[SUM + p]
            flicker = instability[p] * instability[p]
            density = density + opening * flicker
            wander = wander + closing * flicker
        variance = density / step + wander * step / 12.0
        if variance > 0.0:
            value = value + math.sqrt(variance) * gaussian(generator, spare)
        if wander > 0.0:
            change = math.sqrt(wander * step) * noise[p]
            value = value + memory[WALK + p] + 0.5 * change
            memory[WALK + p] = memory[WALK + p] + change
        if quantisation[p] > 0.0:
            remainder = quantisation[p] * memory[ROUNDED + p]
            value = value + (remainder - memory[REMAINDER + p]) / step
            memory[REMAINDER + p] = remainder
        noise[p] = value
