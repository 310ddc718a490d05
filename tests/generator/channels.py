"""Records whose channels are exchanged or reversed, and correct ones of every kind that might look so."""

from dataclasses import replace
from itertools import permutations, product
from pathlib import Path

import numpy as np

from generator import SIGMA, G
from generator.carried import camera_attitude, drawn_motion
from generator.stands import Stand
from trihedron.tools.records import PositionRecord, StrapdownRecord

WRONG = [(order, signs) for order in permutations(range(3)) for signs in product((1, -1), repeat=3)][1:]
"""The 47 ways of exchanging and reversing three channels that change something."""
PLANS = ("uniform", "uniform", "steps", "level", "one-plane", "two-planes", "six-faces", "cone")
BASIC = ("none", "quadratic", "asymmetry", "cross", "drift", "step", "harmonic", "outlier", "outliers", "saturation")
EFFECTS = (*BASIC, "quantisation", "hysteresis", "temperature")
GYRO_EFFECTS = ("scale", "bias-drift", "sensitivity", "lag", "quadratic", "step", "quantisation", "gap")


def plan(rng: np.random.Generator, kind: str, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return angles (N,) of the table [rad]: well spread, in steps of 45°, near level, in one plane or two, on
    faces."""
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    if kind == "steps":
        alpha, beta = np.radians(45.0) * rng.integers(0, 8, (2, count))
    elif kind == "level":
        alpha = np.radians(rng.uniform(-10.0, 10.0, count))
    elif kind == "one-plane":
        beta = np.full(count, beta[0])
    elif kind == "two-planes":
        beta = np.radians(rng.choice([20.0, 110.0], count))
    elif kind == "six-faces":
        faces = np.radians([(0, 0), (180, 0), (90, 0), (270, 0), (90, 90), (270, 90)])
        alpha, beta = faces[np.arange(count) % 6].T
    elif kind == "cone":
        alpha = np.full(count, alpha[0])
    return alpha, beta


def with_effect(rng: np.random.Generator, kind: str, size: float, n: np.ndarray, reading: np.ndarray) -> np.ndarray:
    """Return readings (N, 3) [g] at inputs (N, 3) with an effect of a size [g] on one accelerometer."""
    z, p, part = reading.copy(), int(rng.integers(3)), np.linspace(0.0, 1.0, len(reading))
    size *= rng.choice([-1.0, 1.0])
    added = {
        "quadratic": n[:, p] ** 2,
        "asymmetry": np.abs(n[:, p]),
        "cross": n[:, p] * n[:, (p + 1) % 3],
        "drift": part,
        "step": part > rng.uniform(),
        "harmonic": np.sin(np.arctan2(n[:, 0], n[:, 1]) * rng.integers(1, 4)) * n[:, (p + 1) % 3],
        "hysteresis": np.sign(np.diff(n[:, p], prepend=0.0)),
        "temperature": np.sin(6.0 * part) * n[:, p],
    }
    if kind in added:
        z[:, p] += size * added[kind]
    elif kind.startswith("outlier"):
        for _ in range(1 + kind.endswith("s")):
            z[rng.integers(len(z)), rng.integers(3)] += 10.0 * size
    elif kind == "saturation":
        z[:, p] = np.clip(z[:, p], -0.8, 0.8)
    elif kind == "quantisation":
        z[:, p] = size * np.round(z[:, p] / size)
    return z


def _record(reading: np.ndarray, alpha: np.ndarray, beta: np.ndarray) -> PositionRecord:
    """Return the record of readings (N, 3) [g] at angles [rad]."""
    number = np.arange(1, len(reading) + 1)
    return PositionRecord(number, 60.0 * number, alpha, beta, G * reading, path=Path("measured.csv"))


def right_record(seed: int) -> PositionRecord:
    """Return a correct record: few positions or many, bad plans, blocks and effects good and bad."""
    rng = np.random.default_rng([1, seed])
    count = int(rng.choice([8, 8, 10, 12, 14, 16, 24, 40, 100]))
    alpha, beta = plan(rng, str(rng.choice(PLANS)), count)
    stand, worse = Stand.drawn(rng), float(rng.choice([1.0, 1.0, 3.0, 8.0]))
    stand = replace(
        stand,
        gamma=worse * stand.gamma,
        plus=worse * stand.plus,
        minus=worse * stand.minus,
        bias=worse * stand.bias,
        theta=worse * stand.theta,
    )
    n = stand.inputs(alpha, beta)
    effect, size = str(rng.choice(EFFECTS)), 10.0 ** rng.uniform(-4.5, -1.3)
    noise = 10.0 ** rng.uniform(-5.0, -2.3)
    z = with_effect(rng, effect, size, n, stand.readings(n)) + rng.uniform(-noise, noise, (count, 3))
    return _record(z, alpha, beta)


def wrong_record(way: int, seed: int, *, hidden: bool) -> tuple[PositionRecord, np.ndarray]:
    """Return a record whose channels are exchanged in one of 47 ways, and the matrix (3, 3) that corrects them.

    `hidden`: beside an effect of five times σ.
    """
    rng = np.random.default_rng([2, seed, way])
    alpha, beta = plan(rng, str(rng.choice(PLANS[:3])), int(rng.choice([16, 24, 40, 60])))
    stand = Stand.drawn(rng)
    n = stand.inputs(alpha, beta)
    z = stand.readings(n)
    if hidden:
        z = with_effect(rng, str(rng.choice(EFFECTS[1:])), 5.0 * SIGMA, n, z)
    z += rng.uniform(-SIGMA, SIGMA, z.shape)
    order, signs = WRONG[way]
    matrix = np.eye(3)[list(order)] * np.array(signs)[:, None]
    return _record(z @ matrix.T, alpha, beta), matrix.T


def filmed_record(seed: int, effect: str = "", *, moves: int = 16) -> StrapdownRecord:
    """Return a block moved from rest to rest, filmed in some rows or all; an effect of ten times the noise."""
    rng = np.random.default_rng([3, seed])
    time, rate, n, attitude = drawn_motion(rng, moves)
    p, size = int(rng.integers(3)), float(rng.choice([-1.0, 1.0]))
    gyros = rate @ (np.eye(3) + rng.normal(0.0, 3e-3, (3, 3))).T + rng.normal(0.0, 0.01, 3)
    added = {
        "scale": 0.02 * rate[:, p],
        "bias-drift": 0.01 * time / time[-1],
        "sensitivity": 0.01 * n[:, (p + 1) % 3],
        "quadratic": 0.01 * rate[:, p] ** 2,
        "step": 0.01 * (time > rng.uniform() * time[-1]),
    }
    gyros[:, p] += size * added.get(effect, np.zeros(len(time)))
    if effect == "lag":
        gyros = np.roll(gyros, 3, axis=0)
    if effect == "quantisation":
        gyros = 0.01 * np.round(gyros / 0.01)
    gyros += 1e-3 * rng.standard_normal(gyros.shape)
    block = np.eye(3) + np.tril(rng.normal(0.0, 5e-3, (3, 3)))
    force = G * (n @ block.T + rng.normal(0.0, 5e-3, 3)) + 0.01 * rng.standard_normal(n.shape)
    attitudes = camera_attitude(rng, attitude, 10.0 ** rng.uniform(-4.0, -2.5))
    attitudes[np.arange(len(time)) % int(rng.choice([1, 1, 4, 10])) != 0] = np.nan
    recorded = np.ones(len(time), dtype=bool)
    if effect == "gap":
        recorded[len(time) // 3 : len(time) // 3 + 40] = False
    return StrapdownRecord(time[recorded], gyros[recorded], None, force[recorded], attitudes[recorded])
