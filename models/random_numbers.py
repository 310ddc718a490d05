"""Random numbers in double arithmetic: the combined generator MRG32k3a.

Source: P. L'Ecuyer, "Good parameters and implementations for combined multiple recursive random number generators",
Operations Research 47 (1999) 159-164. Every product stays below 2**53, so each flavour draws the same numbers.
"""

from .restricted import Vector

GENERATOR_SIZE = 6
MODULUS_1 = 4294967087.0
MODULUS_2 = 4294944443.0
WHOLE_FROM = 6755399441055744.0
"""1.5 times 2**52: doubles of this size are whole numbers."""


def remainder(value: float, modulus: float) -> float:
    """Return the representative of `value` in [0, modulus), exact for |value| < 2**53."""
    # Adding and subtracting WHOLE_FROM leaves the nearest whole number, on several numbers at once where floor cannot.
    quotient = value * (1.0 / modulus) + WHOLE_FROM - WHOLE_FROM
    rest = value - quotient * modulus
    if rest < 0.0:
        rest = rest + modulus
    return rest


def uniform(generator: Vector) -> float:
    """Draw a number in the open interval (0, 1) and advance the generator (six floats)."""
    first = remainder(1403580.0 * generator[1] - 810728.0 * generator[0], MODULUS_1)
    generator[0] = generator[1]
    generator[1] = generator[2]
    generator[2] = first
    second = remainder(527612.0 * generator[5] - 1370589.0 * generator[3], MODULUS_2)
    generator[3] = generator[4]
    generator[4] = generator[5]
    generator[5] = second
    difference = first - second
    if difference <= 0.0:
        difference = difference + MODULUS_1
    return difference * 2.328306549295727688e-10


def seed_generator(seed: float, stream: float, generator: Vector) -> None:
    """Fill the generator from a whole number; each component has a stream of its own.

    Parameters
    ----------
    seed : float
        whole number from 0 to 2**31 - 1
    stream : float
        small whole number: components with the same seed must not draw the same errors
    generator : (6,)
        overwritten
    """
    value = remainder(seed + 1.0 + 104729.0 * stream, MODULUS_2)
    for i in range(GENERATOR_SIZE):
        value = remainder(40692.0 * value + 12345.0, MODULUS_2)
        generator[i] = value
        if generator[i] < 1.0:
            generator[i] = 1.0
    for _ in range(12):
        uniform(generator)


def symmetric(generator: Vector) -> float:
    """Draw a number that is uniform in (-1, 1)."""
    return 2.0 * uniform(generator) - 1.0
