"""Fresh records in files, each with one hidden fault or none, and its secret truth."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from generator import SIGMA
from generator.carried import HandMotion, mems_force, wandering, write_strapdown
from generator.effects import lagged
from generator.positions import Session, errors
from generator.turns import up_in_body


@dataclass(frozen=True)
class Fresh:
    """A record in a file, and its secret.

    `kind` is the hidden fault. `hidden` are the names (effect, place) under which it is known, none if no name is
    correct. `values` are the sizes of the effect by parameter, where it has them; `targets` the true values of the
    calibration's targets, if the record is one of positions.
    """

    path: Path
    kind: str
    hidden: frozenset[tuple[str, str]]
    values: dict[str, float] = field(default_factory=dict)
    targets: dict[str, float] = field(default_factory=dict)


POSITION_KINDS = (
    "clean",
    "bias-step",
    "bias-drift",
    "outlier",
    "quantisation",
    "sign-reversal",
    "random-walk",
    "encoder-bump",
    "thermal-lag",
    "fifth-power",
    "warm-up",
)


def position_record(path: Path, kind: str, seed: int) -> Fresh:
    """Return a record of 16 to 100 positions with an effect; errors are uniform within σ, Gaussian within it, or at
    it."""
    rng = np.random.default_rng([POSITION_KINDS.index(kind), seed])
    count = int(rng.choice([16, 24, 30, 36, 40, 60, 100]))
    session = Session.drawn(rng, max(count, 30) if kind == "quantisation" else count)
    stand, alpha, beta = session.stand, session.alpha, session.beta
    hours, temperature = session.hours, session.temperature
    count, part = len(hours), hours / hours[-1]
    p = int(rng.integers(3))
    where, sign, size = f"accelerometer-{p + 1}", float(rng.choice([-1.0, 1.0])), float(rng.uniform(1.2, 5.0))
    encoder = alpha
    if kind == "encoder-bump":
        # The encoder reads the true angle and a bump about one of its angles.
        centre, width = rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(10.0, 45.0))
        off = np.remainder(alpha - centre + np.pi, 2.0 * np.pi) - np.pi
        encoder = alpha + sign * 3e-5 * size * np.exp(-0.5 * (off / width) ** 2)
    n = stand.inputs(alpha, beta)
    reading = stand.readings(n)
    error, shape = errors(rng, count)
    if kind == "quantisation" and shape != "bound" and rng.uniform() < 0.5:
        error = SIGMA * rng.choice([-1.0, 1.0], (count, 3))
    hidden, values = {(kind, where)}, {}
    if kind in ("clean", "encoder-bump"):
        hidden = set()
    elif kind == "bias-step":
        values = {"size": sign * 2.4e-5 * size}
        reading[:, p] += values["size"] * (part > rng.uniform(0.2, 0.92))
    elif kind == "bias-drift":
        values = {"rate": sign * 3e-5 * size / hours[-1]}
        reading[:, p] += values["rate"] * hours
    elif kind == "outlier":
        row, values = int(rng.integers(count)), {"size": sign * 3e-5 * size}
        reading[row, p] += values["size"]
        hidden = {("outlier", f"position-{row + 1}")}
    elif kind == "sign-reversal":
        late = part > rng.uniform(0.3, 0.8)
        reading[late, p] *= -1.0
        hidden = {("exchanged-readings", where), ("exchanged-readings", "block")}
    elif kind == "random-walk":
        reading[:, p] += np.cumsum(rng.normal(0.0, 6e-6 * size, count))
        hidden = {("bias-wander", where)}
    elif kind == "thermal-lag":
        behind = lagged(hours, temperature, rng.uniform(0.2, 1.0) * max(0.3, hours[-1]))
        reading[:, p] += sign * 3e-5 * size * (behind - 20.0) / max(1.0, float(np.ptp(temperature)))
    elif kind == "fifth-power":
        reading[:, p] += sign * 8e-5 * size * n[:, p] ** 5
        hidden = set()
    elif kind == "warm-up":
        reading[:, p] += sign * 3e-5 * size * np.exp(-hours / (rng.uniform(0.2, 0.8) * hours[-1]))
    elif kind == "quantisation":
        values = {"step": float(rng.uniform(1.5e-4, 8e-4))}
        # Rounded before the error is added, like electronics with noise in the readout.
        reading[:, p] = np.round(reading[:, p] / values["step"]) * values["step"]
    session.write(path, (encoder, beta), reading + error, rng)
    return Fresh(path, kind, frozenset(hidden), values, stand.targets())


STRAPDOWN_KINDS = (
    "nothing",
    "clipping",
    "gyro-clipping",
    "rate-cubed",
    "gyro-step",
    "gyro-sine",
    "fast-latency",
    "scale-drift",
    "late-latency",
)
WITH_TRUTH = ("rate-cubed", "fast-latency", "scale-drift", "late-latency")
GYRO_NAMES = {
    "rate-cubed": "gyro-rate-cubed",
    "gyro-step": "gyro-bias-step",
    "gyro-sine": "gyro-bias-wander",
    "fast-latency": "latency",
    "scale-drift": "gyro-scale-drift",
    "late-latency": "latency-step",
}


def strapdown_record(path: Path, kind: str, seed: int) -> Fresh:
    """Return a block that alternates rests and turns by hand, two dozen times; noise and bias of a good MEMS unit."""
    rng = np.random.default_rng([100 + STRAPDOWN_KINDS.index(kind), seed])
    fast = 6.0 if kind == "fast-latency" else 1.0
    motion = HandMotion.drawn(rng, 24, 3.0, (1.0, 2.6), fast=fast)
    times, rate, attitude = motion.times, motion.rate(motion.times), motion.attitudes()
    count, part = len(times), times / times[-1]
    force = mems_force(rng, up_in_body(attitude))
    matrix = np.zeros((3, 3)) if kind in WITH_TRUTH else rng.uniform(-2e-3, 2e-3, (3, 3))
    size, signs = rng.uniform(0.5, 2.0), rng.choice([-1.0, 1.0], 3)
    late = (part > rng.uniform(0.4, 0.6))[:, None]
    bias = np.tile(rng.uniform(-3e-3, 3e-3, 3), (count, 1))
    sensed = rate
    if kind == "fast-latency":
        sensed = motion.rate(times - 4e-3 * size)
    elif kind == "late-latency":
        sensed = np.where(late, motion.rate(times - 1e-2 * size), rate)
    elif kind == "rate-cubed":
        sensed = rate + 2e-3 * size * signs * rate**3
    elif kind == "scale-drift":
        sensed = rate * (1.0 + 1e-2 * size * signs * part[:, None])
    elif kind == "gyro-step":
        bias += 1e-3 * size * signs * late
    elif kind == "gyro-sine":
        bias += 1e-3 * size * signs * np.sin(2.0 * np.pi * times / rng.uniform(30.0, 60.0))[:, None]
    flicker = wandering(rng, count)
    gyro = sensed + sensed @ matrix.T + bias + flicker + rng.normal(0.0, 8e-4, (count, 3))
    p = int(rng.integers(3))
    hidden = {(GYRO_NAMES[kind], "gyro-block")} if kind in GYRO_NAMES else set()
    if kind == "clipping":
        level = 0.8 * np.abs(force[:, p]).max()
        force[:, p] = np.clip(force[:, p], -level, level)
        hidden = {("saturation", f"accelerometer-{p + 1}")}
    elif kind == "gyro-clipping":
        level = 0.8 * np.abs(gyro[:, p]).max()
        gyro[:, p] = np.clip(gyro[:, p], -level, level)
    write_strapdown(path, times, gyro, force, attitude if kind in WITH_TRUTH else None)
    return Fresh(path, kind, frozenset(hidden))
