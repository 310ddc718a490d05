"""Records whose noise hides processes that their simulation lacks, and what the diagnosis of the noise says of them."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

import trihedron as th
from generator.noise import static_record
from trihedron.tools.noise import Noise

STEP, ROWS = 0.02, 90_000
DURATION = STEP * ROWS
WHITE = {"gyro": 1e-4, "accelerometer": 1e-3}
DETECTABLE = {"B": 14.0 / DURATION**0.5, "K": 50.0 / DURATION, "Q": 0.1}
"""Sizes over that of white noise that nine records in ten show twice over: B√T/N, KT/N; Q in seconds."""
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
    """Return a secret with so many processes for each sensor, of sizes from one to three times the detectable one."""
    draws = np.random.default_rng(seed)
    hidden = []
    for white in WHITE.values():
        letters = draws.permutation(list(DETECTABLE))[:count]
        hidden.append({str(one): white * DETECTABLE[one] * draws.uniform(1.0, 3.0) for one in letters})
    return HiddenNoise(*hidden)


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
        wrong += bool(sets) and frozenset(hidden) not in sets and not any(frozenset(hidden) >= found for found in sets)
    return right, wrong
