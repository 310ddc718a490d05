"""Fresh records by a generator that shares nothing with the product: the exact model, written afresh.

Source: Golovan, Matasov, Tarygin 2022, section 1, and for a carried block the kinematics of a rigid body. It imports
numpy and nothing else, so that what it makes agrees with the product only where both are right.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

G = 9.80665
SIGMA = 1e-5
"""Bound of the error of an averaged reading [g]."""
PERIOD = 0.01
"""Of strapdown records [s]."""


@dataclass(frozen=True)
class Fresh:
    """A record in a file, and what nobody tells the diagnosis.

    `kind` is what is hidden, `hidden` the names (effect, place) under which it is known, none where no name is right;
    `values` the sizes of the effect by parameter, as far as they are its own; `targets` the true values of the
    calibration's targets, where the record is one of positions.
    """

    path: Path
    kind: str
    hidden: frozenset[tuple[str, str]]
    values: dict[str, float] = field(default_factory=dict)
    targets: dict[str, float] = field(default_factory=dict)


# Positions of a table


def turn(axis: int, angle: float) -> np.ndarray:
    """Components (3, 3) in a frame that is turned about its axis 0, 1 or 2."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array(
        (
            ((1, 0, 0), (0, c, s), (0, -s, c)),
            ((c, 0, -s), (0, 1, 0), (s, 0, c)),
            ((c, s, 0), (-s, c, 0), (0, 0, 1)),
        )[axis],
        dtype=float,
    )


def cross_matrix(v: np.ndarray) -> np.ndarray:
    """The matrix (3, 3) of a mounting error: [[0, v3, -v2], [-v3, 0, v1], [v2, -v1, 0]]."""
    return np.array([[0.0, v[2], -v[1]], [-v[2], 0.0, v[0]], [v[1], -v[0], 0.0]])


def turn_by(v: np.ndarray) -> np.ndarray:
    """exp of the matrix of a rotation vector."""
    angle, matrix = float(np.linalg.norm(v)), cross_matrix(v)
    if angle == 0.0:
        return np.eye(3)
    return np.eye(3) + np.sin(angle) / angle * matrix + (1.0 - np.cos(angle)) / angle**2 * matrix @ matrix


def vector_of(matrix: np.ndarray) -> np.ndarray:
    """The rotation vector of such a matrix."""
    odd = 0.5 * np.array([matrix[1, 2] - matrix[2, 1], matrix[2, 0] - matrix[0, 2], matrix[0, 1] - matrix[1, 0]])
    size = float(np.linalg.norm(odd))
    return odd if size == 0.0 else odd * np.arctan2(size, 0.5 * (np.trace(matrix) - 1.0)) / size


@dataclass(frozen=True)
class Stand:
    """A bench and a block, with everything that the paper lets be wrong."""

    kappa: float
    epsilon: float
    alpha_error: float
    alpha_star: float
    beta_error: float
    gravity_error: float
    theta: np.ndarray
    gamma: np.ndarray
    plus: np.ndarray
    minus: np.ndarray
    bias: np.ndarray

    @staticmethod
    def drawn(rng: np.random.Generator) -> "Stand":
        """Parts of the bounds 3e-3 and 1e-2 of (1.7)."""
        share = rng.uniform(0.1, 1.0)
        u, v = 3e-3 * share, 1e-2 * share
        gamma = np.tril(rng.uniform(-v, v, (3, 3)), -1) / 2.0
        kappa, epsilon, alpha, star, beta, g = rng.uniform(-1.0, 1.0, 6) * np.array([u, u, u / 2, u / 2, v / 4, v / 4])
        plus, minus = rng.uniform(-v, v, (2, 3)) / 2.0
        theta, bias = rng.uniform(-v, v, 3) / 3.0, rng.uniform(-v, v, 3)
        return Stand(kappa, epsilon, alpha, star, beta, g, theta, gamma, plus, minus, bias)

    def inputs(self, alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
        """Specific force (N, 3) over the model's g at true readings of the encoders [rad]."""
        mounting, found = turn_by(self.theta), []
        for a, b in zip(alpha - self.alpha_error - self.alpha_star, beta - self.beta_error, strict=True):
            inner = turn(2, b) @ turn(1, self.epsilon) @ turn(0, a) @ turn(1, self.kappa)
            found.append(mounting @ inner @ np.array([0.0, 0.0, 1.0 - self.gravity_error]))
        return np.array(found)

    def readings(self, n: np.ndarray) -> np.ndarray:
        """Readings (N, 3) [g] at inputs (N, 3)."""
        return n + n @ self.gamma.T + np.where(n > 0.0, self.plus, self.minus) * n + self.bias

    def targets(self) -> dict[str, float]:
        """True values of the targets, exact in case (A1)."""
        left = 1.0 - self.gravity_error
        mounting = vector_of(turn_by(self.theta) @ turn(2, -self.beta_error))
        found = {"X1": self.kappa, "X2": self.alpha_error + self.alpha_star, "X3": self.epsilon}
        for p, (plus, minus) in enumerate((("X4", "X5"), ("X9", "X10"), ("X14", "X15"))):
            found[plus] = (1.0 + self.plus[p]) * left - 1.0
            found[minus] = (1.0 + self.minus[p]) * left - 1.0
            found[f"X{16 + p}"] = self.bias[p]
        for name, (row, column) in {"X6+X8": (1, 0), "X7+X12": (2, 0), "X11+X13": (2, 1)}.items():
            found[name] = self.gamma[row, column] * left
        return found | dict(zip(("X13", "-X12", "X8"), mounting, strict=True))


@dataclass(frozen=True)
class Session:
    """A bench and when it stood where: true readings of the encoders [rad], times [s], temperatures, (N,) each."""

    stand: Stand
    alpha: np.ndarray
    beta: np.ndarray
    time_s: np.ndarray
    temperature: np.ndarray

    @staticmethod
    def drawn(rng: np.random.Generator, count: int) -> "Session":
        """Positions anywhere; a temperature that swings and drifts."""
        stand = Stand.drawn(rng)
        alpha, beta = np.radians(np.round(rng.uniform(0.0, 360.0, (2, count)), 3))
        time_s = np.round(np.cumsum(rng.uniform(40.0, 80.0, count)) * rng.choice([1.0, 3.0]), 1)
        part = (time_s - time_s[0]) / (time_s[-1] - time_s[0])
        wave = np.sin(2.0 * np.pi * (rng.uniform(0.3, 1.5) * part + rng.uniform()))
        temperature = np.round(20.0 + rng.uniform(1.0, 6.0) * wave + rng.uniform(-3.0, 3.0) * part, 4)
        return Session(stand, alpha, beta, time_s, temperature)

    @property
    def hours(self) -> np.ndarray:
        """Since the first row."""
        return (self.time_s - self.time_s[0]) / 3600.0

    def write(
        self, path: Path, angles: tuple[np.ndarray, np.ndarray], reading: np.ndarray, rng: np.random.Generator
    ) -> None:
        """A record of readings (N, 3) [g] at angles that the encoders read; senses of approach are drawn."""
        senses = rng.choice([-1, 1], (2, len(reading)))
        names = (
            "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2,temperature_degC,approach_alpha,approach_beta"
        )
        lines = [
            f"{k + 1},{self.time_s[k]:.1f},{np.degrees(angles[0][k]):.9f},{np.degrees(angles[1][k]):.9f},"
            + ",".join(f"{value:.9f}" for value in G * reading[k])
            + f",{self.temperature[k]:.4f},{senses[0, k]},{senses[1, k]}"
            for k in range(len(reading))
        ]
        path.write_text("\n".join([names, *lines]) + "\n", encoding="utf-8")


def errors(rng: np.random.Generator, count: int) -> tuple[np.ndarray, str]:
    """Errors (N, 3) [g] within σ, and how they are distributed: uniform, Gaussian within it, or at it."""
    error = rng.uniform(-SIGMA, SIGMA, (count, 3))
    shape = str(rng.choice(["uniform", "gaussian", "bound"], p=[0.5, 0.3, 0.2]))
    if shape == "gaussian":
        error = np.clip(rng.normal(0.0, SIGMA / 2.5, (count, 3)), -SIGMA, SIGMA)
    if shape == "bound":
        error = SIGMA * rng.choice([-1.0, 1.0], (count, 3))
    return error, shape


def lagged(time_h: np.ndarray, temperature: np.ndarray, constant: float) -> np.ndarray:
    """Temperature (N,) behind a lag of first order [h], settled at the first row; linear between the rows."""
    found = [temperature[0]]
    for step, before, after in zip(np.diff(time_h), temperature[:-1], temperature[1:], strict=True):
        slope, left = (after - before) / step, np.exp(-step / constant)
        steady = before - slope * constant
        found.append(steady + (found[-1] - steady) * left + slope * step)
    return np.array(found)


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
    """A record of 16 to 100 positions with an effect; errors are uniform within σ, Gaussian within it, or at it."""
    rng = np.random.default_rng([POSITION_KINDS.index(kind), seed])
    count = int(rng.choice([16, 24, 30, 36, 40, 60, 100]))
    session = Session.drawn(rng, max(count, 30) if kind == "quantisation" else count)
    stand, alpha, beta = session.stand, session.alpha, session.beta
    hours, temperature = session.hours, session.temperature
    count, part = len(hours), hours / hours[-1]
    p = int(rng.integers(3))
    where, sign, size = f"accelerometer-{p + 1}", float(rng.choice([-1.0, 1.0])), float(rng.uniform(1.2, 5.0))
    read_alpha, read_beta = alpha, beta
    if kind == "encoder-bump":
        # The encoder reads the true angle and a bump about one of its angles.
        centre, width = rng.uniform(0.0, 2.0 * np.pi), np.radians(rng.uniform(10.0, 45.0))
        off = np.remainder(alpha - centre + np.pi, 2.0 * np.pi) - np.pi
        read_alpha = alpha + sign * 3e-5 * size * np.exp(-0.5 * (off / width) ** 2)
    n = stand.inputs(alpha, beta)
    reading = stand.readings(n)
    error, shape = errors(rng, count)
    if kind == "quantisation" and shape != "bound" and rng.uniform() < 0.5:
        error = SIGMA * rng.choice([-1.0, 1.0], (count, 3))
    hidden, values = {(kind, where)}, {}
    if kind == "clean":
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
    elif kind == "encoder-bump":
        hidden = set()
    elif kind == "thermal-lag":
        late = lagged(hours, temperature, rng.uniform(0.2, 1.0) * max(0.3, hours[-1]))
        reading[:, p] += sign * 3e-5 * size * (late - 20.0) / max(1.0, float(np.ptp(temperature)))
    elif kind == "fifth-power":
        reading[:, p] += sign * 8e-5 * size * n[:, p] ** 5
        hidden = set()
    elif kind == "warm-up":
        reading[:, p] += sign * 3e-5 * size * np.exp(-hours / (rng.uniform(0.2, 0.8) * hours[-1]))
    reading = reading + error
    if kind == "quantisation":
        values = {"step": float(rng.uniform(1.5e-4, 8e-4))}
        # Rounded last, so what is read is a multiple; noise within σ is added by what reads it out.
        clean = reading[:, p] - error[:, p]
        reading[:, p] = np.round(clean / values["step"]) * values["step"] + error[:, p]
    session.write(path, (read_alpha, read_beta), reading, rng)
    return Fresh(path, kind, frozenset(hidden), values, stand.targets())


# A block that is carried

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


def multiplied(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Product of two quaternions (4,), scalar first."""
    first, second = a[1:], b[1:]
    vector = a[0] * second + b[0] * first + np.cross(first, second)
    return np.append(a[0] * b[0] - first @ second, vector)


def carried(rate: Callable[[np.ndarray], np.ndarray], count: int) -> np.ndarray:
    """Attitudes (N, 4), body to reference, of true rates; eight midpoints in each interval."""
    fine = 8
    times = PERIOD * (np.arange((count - 1) * fine) + 0.5) / fine
    steps = rate(times) * PERIOD / fine
    q, found = np.array([1.0, 0.0, 0.0, 0.0]), [np.array([1.0, 0.0, 0.0, 0.0])]
    for k, step in enumerate(steps):
        angle = float(np.linalg.norm(step))
        half = np.sinc(0.5 * angle / np.pi) * 0.5 * step
        q = multiplied(q, np.append(np.cos(0.5 * angle), half))
        if (k + 1) % fine == 0:
            found.append(q / np.linalg.norm(q))
    return np.array(found)


def up_in_body(q: np.ndarray) -> np.ndarray:
    """The reference's third axis (N, 3) in the body."""
    w, x, y, z = q.T
    return np.stack((2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)), axis=1)


def strapdown_record(path: Path, kind: str, seed: int) -> Fresh:
    """A block that rests, is turned by hand, and rests again, two dozen times; noise and bias of a good MEMS unit."""
    rng = np.random.default_rng([100 + STRAPDOWN_KINDS.index(kind), seed])
    poses, rest, move = 24, 3.0, 1.5
    fast = 6.0 if kind == "fast-latency" else 1.0
    turns = rng.normal(size=(poses, 3))
    turns *= (fast * rng.uniform(1.0, 2.6, poses) / np.linalg.norm(turns, axis=1))[:, None]
    swings = fast * rng.uniform(-0.8, 0.8, (poses, 3))
    span = rest + move
    count = round((poses * span + rest) / PERIOD) + 1

    def rate(times: np.ndarray) -> np.ndarray:
        number = np.minimum((times // span).astype(int), poses - 1)
        s = np.clip((times - number * span - rest) / move, 0.0, 1.0)
        bell, wave = (1.0 - np.cos(2.0 * np.pi * s)) / move, np.sin(2.0 * np.pi * s) * np.sin(np.pi * s) ** 2
        within = ((times - number * span) > rest) & (times < poses * span)
        return np.where(within[:, None], turns[number] * bell[:, None] + swings[number] * 4.0 * wave[:, None], 0.0)

    times = PERIOD * np.arange(count)
    part, true = times / times[-1], rate(times)
    q = carried(rate, count)
    n = up_in_body(q)
    gamma = np.tril(rng.uniform(-3e-3, 3e-3, (3, 3)))
    force = n + n @ gamma.T + rng.uniform(-3e-3, 3e-3, 3) + rng.normal(0.0, 1e-3, (count, 3))
    of_gyros = rng.uniform(-2e-3, 2e-3, (3, 3)) if kind not in WITH_TRUTH else np.zeros((3, 3))
    seen, hidden = true, {(GYRO_NAMES[kind], "gyro-block")} if kind in GYRO_NAMES else set()
    size, signs = rng.uniform(0.5, 2.0), rng.choice([-1.0, 1.0], 3)
    late = part > rng.uniform(0.4, 0.6)
    bias = np.tile(rng.uniform(-3e-3, 3e-3, 3), (count, 1))
    if kind == "fast-latency":
        seen = rate(times - 4e-3 * size)
    elif kind == "late-latency":
        seen = np.where(late[:, None], rate(times - 1e-2 * size), true)
    elif kind == "rate-cubed":
        seen = true + 2e-3 * size * signs * true**3
    elif kind == "scale-drift":
        seen = true * (1.0 + 1e-2 * size * signs * part[:, None])
    elif kind == "gyro-step":
        bias = bias + 1e-3 * size * signs * late[:, None]
    elif kind == "gyro-sine":
        bias = bias + 1e-3 * size * signs * np.sin(2.0 * np.pi * times / rng.uniform(30.0, 60.0))[:, None]
    # A walk that settles stands for the flicker.
    flicker = np.zeros((count, 3))
    for k, kick in enumerate(rng.normal(0.0, 2e-6, (count - 1, 3))):
        flicker[k + 1] = 0.999 * flicker[k] + kick
    gyro = seen + seen @ of_gyros.T + bias + flicker + rng.normal(0.0, 8e-4, (count, 3))
    where = int(rng.integers(3))
    if kind == "clipping":
        level = 0.8 * np.abs(force[:, where]).max()
        force[:, where] = np.clip(force[:, where], -level, level)
        hidden = {("saturation", f"accelerometer-{where + 1}")}
    elif kind == "gyro-clipping":
        level = 0.8 * np.abs(gyro[:, where]).max()
        gyro[:, where] = np.clip(gyro[:, where], -level, level)
    names = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
    columns = [times + PERIOD, *gyro.T, *(G * force.T)]
    formats = ["%.4f", *["%.8f"] * 3, *["%.7f"] * 3]
    if kind in WITH_TRUTH:
        names, formats = names + ",q0,q1,q2,q3", [*formats, *["%.9f"] * 4]
        columns += list(q.T)
    np.savetxt(path, np.column_stack(columns), fmt=formats, delimiter=",", header=names, comments="")
    return Fresh(path, kind, frozenset(hidden))
