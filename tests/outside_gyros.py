"""Carried records with a gyro's fault that is in no catalogue, by a generator that shares nothing with the product.

A block rests and is turned by hand, before a reference of attitude or without. One gyro reads too much by an unknown
function of one quantity, its own rate, another one's, a specific force or time. Sizes are in units of what white noise
at rest turns in a second.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from independent_bench import PERIOD, G, carried, up_in_body

WHITE, FLICKER = 8e-4, 2e-6
"""Noise of a gyro at a row, and the kicks of what wanders slowly [rad/s]."""
SEEN = 1e-4
"""Errors of the reference attitude [rad]."""
UNIT = 4e-3
"""A fault of size one is so large where it is largest [rad/s]."""
Shape = Callable[[np.ndarray], np.ndarray]


def bump(part: np.ndarray) -> np.ndarray:
    return np.exp(-(((part - 0.45) / 0.15) ** 2))


def sawtooth(part: np.ndarray) -> np.ndarray:
    return 2.0 * ((1.5 * part + 0.25) % 1.0) - 1.0


def fifth_power(part: np.ndarray) -> np.ndarray:
    return part**5


def wave(part: np.ndarray) -> np.ndarray:
    return np.sin(6.0 * part + 0.5)


def knee(part: np.ndarray) -> np.ndarray:
    return np.maximum(0.0, part - 0.2)


def bends_off(part: np.ndarray) -> np.ndarray:
    return part / (1.0 + 8.0 * part**2)


def jump(part: np.ndarray) -> np.ndarray:
    return (part > 0.3).astype(float)


def hump(part: np.ndarray) -> np.ndarray:
    return np.exp(-(((part - 0.1) / 0.3) ** 2))


def swing(part: np.ndarray) -> np.ndarray:
    return np.sin(2.0 * np.pi * 2.6 * part + 0.4)


SHAPES: tuple[tuple[Shape, str], ...] = (
    (bump, "own"),
    (sawtooth, "own"),
    (fifth_power, "own"),
    (wave, "force"),
    (knee, "own"),
    (bump, "other"),
    (bends_off, "own"),
    (jump, "own"),
    (swing, "hours"),
    (hump, "hours"),
    (wave, "other"),
    (knee, "force"),
)
"""Functions of a quantity over its largest size, from -1 to 1, and of which quantity of a gyro."""


@dataclass(frozen=True)
class OutsideGyro:
    """A record in a file with what nobody tells the diagnosis.

    `place` and `quantity` by the product's names; `fault` (N,) is what that gyro reads too much [rad/s] at values (N,)
    of the quantity.
    """

    path: Path
    shape: str
    place: str
    quantity: str
    with_truth: bool
    size: float
    fault: np.ndarray
    values: np.ndarray


def outside_gyro(path: Path, seed: int, index: int) -> OutsideGyro:
    """One record; every other one has a reference of attitude."""
    rng = np.random.default_rng([seed, index])
    function, of = SHAPES[index % len(SHAPES)]
    with_truth = (index + index // len(SHAPES)) % 2 == 0
    poses, rest, move = 20, 2.5, 1.5
    turns = rng.normal(size=(poses, 3))
    turns *= (rng.uniform(0.8, 2.6, poses) / np.linalg.norm(turns, axis=1))[:, None]
    swings, span = rng.uniform(-0.8, 0.8, (poses, 3)), rest + move
    count = round((poses * span + rest) / PERIOD) + 1

    def rate(times: np.ndarray) -> np.ndarray:
        number = np.minimum((times // span).astype(int), poses - 1)
        s = np.clip((times - number * span - rest) / move, 0.0, 1.0)
        bell, wave = (1.0 - np.cos(2.0 * np.pi * s)) / move, np.sin(2.0 * np.pi * s) * np.sin(np.pi * s) ** 2
        within = ((times - number * span) > rest) & (times < poses * span)
        return np.where(within[:, None], turns[number] * bell[:, None] + swings[number] * 4.0 * wave[:, None], 0.0)

    times = PERIOD * np.arange(count)
    true, q = rate(times), carried(rate, count)
    n = up_in_body(q)
    p, size = int(rng.integers(3)), float(rng.uniform(1.5, 6.0))
    other = (p + int(rng.integers(1, 3))) % 3
    quantity, values = {
        "own": (f"w{p + 1}", true[:, p]),
        "other": (f"w{other + 1}", true[:, other]),
        "force": (f"n{other + 1}", n[:, other]),
        "hours": ("hours", times / 3600.0),
    }[of]
    fault = size * UNIT * float(rng.choice([-1.0, 1.0])) * function(values / np.abs(values).max())
    gyro = true + rng.uniform(-3e-3, 3e-3, 3) + rng.normal(0.0, WHITE, (count, 3))
    flicker = np.zeros((count, 3))
    for k, kick in enumerate(rng.normal(0.0, FLICKER, (count - 1, 3))):
        flicker[k + 1] = 0.999 * flicker[k] + kick
    gyro += flicker
    gyro[:, p] += fault
    gamma = np.tril(rng.uniform(-3e-3, 3e-3, (3, 3)))
    force = n + n @ gamma.T + rng.uniform(-3e-3, 3e-3, 3) + rng.normal(0.0, 1e-3, (count, 3))
    names = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
    columns, formats = [times + PERIOD, *gyro.T, *(G * force.T)], ["%.4f", *["%.8f"] * 3, *["%.7f"] * 3]
    if with_truth:
        seen = q + 0.5 * SEEN * rng.normal(size=q.shape)
        names, formats = names + ",q0,q1,q2,q3", [*formats, *["%.9f"] * 4]
        columns += list((seen / np.linalg.norm(seen, axis=1)[:, None]).T)
    else:
        # Between rests the block counts as calibrated: each gyro has a scale factor and misalignments of its own.
        columns[1:4] = list((gyro + true @ rng.uniform(-2e-3, 2e-3, (3, 3)).T).T)
    np.savetxt(path, np.column_stack(columns), fmt=formats, delimiter=",", header=names, comments="")
    return OutsideGyro(path, function.__name__, f"gyro-{p + 1}", quantity, with_truth, size, fault, values)
