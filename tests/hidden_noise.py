"""Records whose noise hides processes that their simulation lacks, and the diagnoses of the noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

import trihedron as th
from generator.noise import static_record
from trihedron.tools.noise import Noise

STEP, ROWS = 0.02, 90_000
DURATION = STEP * ROWS
WHITE = {"gyro": 1e-4, "accelerometer": 1e-3}
DETECTABLE = {"B": 14.0 / DURATION**0.5, "K": 50.0 / DURATION, "Q": 0.1}
"""Sizes over that of white noise that nine records in ten show twice over: B√T/N, KT/N; Q in seconds."""
PLAIN = 45.0
"""Expected gain of the likelihood by a process beside the others from which 99 of 100 records show it."""
SCENARIO = """
schema = "trihedron.scenario/1"
[run]
step_s = {step}
stop_s = 10.0
[fmus.block]
component = "AccelerometerBlock"
[fmus.block.parameters]
velocity_random_walk = [1e-3, 1e-3, 1e-3]
[fmus.gyro]
component = "GyroBlock"
[fmus.gyro.parameters]
angle_random_walk = [1e-4, 1e-4, 1e-4]
"""


@dataclass(frozen=True)
class HiddenNoise:
    """A secret: processes hidden in all gyros and in all accelerometers, with their sizes [SI]."""

    gyro: dict[str, float]
    accelerometer: dict[str, float]


def drawn(seed: int, count: int) -> HiddenNoise:
    """Return a secret with `count` processes for each sensor, of one to three times the detectable size.

    Of several processes the sizes go to twice it; a process that the others would hide is larger, so that each shows.
    """
    draws = np.random.default_rng(seed)
    largest = 3.0 if count == 1 else 2.0
    hidden = []
    for white in WHITE.values():
        letters = [str(one) for one in draws.permutation(list(DETECTABLE))[:count]]
        sizes = {one: DETECTABLE[one] * draws.uniform(1.0, largest) for one in letters}
        for letter in sorted(letters):
            while expected_gain(sizes, letter) < PLAIN:
                sizes[letter] *= 1.2
        hidden.append({letter: white * size for letter, size in sizes.items()})
    return HiddenNoise(*hidden)


def spectrum_of(letter: str) -> np.ndarray:
    """Return the spectrum of a process of size one at the frequencies of the record's cosine coefficients."""
    sine = 2.0 * np.sin(0.5 * np.pi * np.arange(1, ROWS) / ROWS)
    return {"N": 1.0 / STEP + 0.0 * sine, "Q": (sine / STEP) ** 2, "B": 1.0 / sine, "K": STEP / sine**2}[letter]


def expected_gain(sizes: Mapping[str, float], letter: str) -> float:
    """Return the expected rise of twice the logarithm of the likelihood if one process joins the others and N = 1."""
    parts = {one: spectrum_of(one) for one in ("N", *sizes)}
    truth = parts["N"] + sum(sizes[one] ** 2 * parts[one] for one in sizes)
    others = [one for one in parts if one != letter]

    def loss(logarithms: np.ndarray) -> float:
        ratio = truth / sum(np.exp(value) * parts[one] for value, one in zip(logarithms, others, strict=True))
        return float(np.sum(ratio - 1.0 - np.log(ratio)))

    start = [2.0 * np.log(sizes.get(one, 1.0)) for one in others]
    return float(minimize(loss, start, method="Nelder-Mead", options={"xatol": 1e-3, "fatol": 0.1}).fun)


def answered(secret: HiddenNoise, seed: int, folder: Path) -> Noise:
    """Return the answer of the diagnosis, which has only the record and the scenario without the secret."""
    folder.mkdir(exist_ok=True)
    scenario = folder / "simulation.toml"
    scenario.write_text(SCENARIO.format(step=STEP))
    gyro = {"N": WHITE["gyro"]} | secret.gyro
    accelerometer = {"N": WHITE["accelerometer"]} | secret.accelerometer
    return th.noise(static_record(ROWS, STEP, gyro, accelerometer, seed), against=scenario)


def counted(secret: HiddenNoise, result: Noise) -> tuple[int, int]:
    """Return the numbers of channels with the right set among the smallest, and with a wrong one alone."""
    right = wrong = 0
    for one in result.against:
        hidden = secret.gyro if one.channel.startswith("gyro") else secret.accelerometer
        sets = [frozenset(text.split(" + ")) for text in one.alternatives]
        right += frozenset(hidden) in sets or (not hidden and one.verdict == "consistent")
        wrong += bool(sets) and frozenset(hidden) not in sets and not any(frozenset(hidden) >= named for named in sets)
    return right, wrong
