"""A table with a block of accelerometers at rest, exactly, with every error of the papers.

Source: Golovan, Matasov, Tarygin 2022, section 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from generator import G
from generator.turns import about, rotation_vectors, turned
from trihedron.tools.records import PositionRecord

ALPHA, BETA = (np.radians(grid.ravel()) for grid in np.meshgrid(20 + 45 * np.arange(8), [25, 145, 265], indexing="ij"))
"""24 positions at which the signs of all inputs are certain."""


@dataclass(frozen=True)
class Stand:
    """Errors of the table [rad], of gravity, of the mounting [rad] and of the block: Γ (3, 3), Γ⁺, Γ⁻, bias [g]."""

    kappa: Any
    epsilon: Any
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
        """Draw parts of the bounds 3e-3 and 1e-2 of (1.7)."""
        share = rng.uniform(0.1, 1.0)
        u, v = 3e-3 * share, 1e-2 * share
        gamma = np.tril(rng.uniform(-v, v, (3, 3)), -1) / 2.0
        kappa, epsilon, alpha, star, beta, g = rng.uniform(-1.0, 1.0, 6) * np.array([u, u, u / 2, u / 2, v / 4, v / 4])
        plus, minus = rng.uniform(-v, v, (2, 3)) / 2.0
        theta, bias = rng.uniform(-v, v, 3) / 3.0, rng.uniform(-v, v, 3)
        return Stand(kappa, epsilon, alpha, star, beta, g, theta, gamma, plus, minus, bias)

    @staticmethod
    def of_elements(elements: ArrayLike) -> "Stand":
        """Return a stand from the 24 elementary parameters in the product's order."""
        e = np.asarray(elements, dtype=float)
        gamma = np.zeros((3, 3))
        gamma[[1, 2, 0, 2, 0, 1], [0, 0, 1, 1, 2, 2]] = e[15:21]
        kappa, epsilon, alpha_error, beta_error, alpha_star, gravity_error = e[:6].tolist()
        return Stand(
            kappa=kappa,
            epsilon=epsilon,
            alpha_error=alpha_error,
            alpha_star=alpha_star,
            beta_error=beta_error,
            gravity_error=gravity_error,
            theta=e[6:9],
            gamma=gamma,
            plus=e[9:12],
            minus=e[12:15],
            bias=e[21:24],
        )

    def inner_frames(self, alpha: np.ndarray, beta: np.ndarray) -> np.ndarray:
        """Return the axes (N, 3, 3) of the inner frame from those of the base, at true readings of the encoders
        [rad]."""
        outer = about(0, alpha - self.alpha_error - self.alpha_star) @ about(1, self.kappa)
        return about(2, beta - self.beta_error) @ about(1, self.epsilon) @ outer

    def inputs(self, alpha: np.ndarray, beta: np.ndarray, mounting: ArrayLike | None = None) -> np.ndarray:
        """Return the specific force (N, 3) over the model's g, with the block mounted by a matrix."""
        block = turned(self.theta) @ (np.eye(3) if mounting is None else np.asarray(mounting))
        return (1.0 - self.gravity_error) * (block @ self.inner_frames(alpha, beta))[:, :, 2]

    def own(self, n: np.ndarray) -> np.ndarray:
        """Return the part of each input (N, 3) in its own channel [g]."""
        return n * (1.0 + np.diagonal(self.gamma)) + np.where(n > 0.0, self.plus, self.minus) * n

    def readings(self, n: np.ndarray) -> np.ndarray:
        """Return readings (N, 3) [g] at inputs (N, 3)."""
        return n + n @ self.gamma.T + np.where(n > 0.0, self.plus, self.minus) * n + self.bias

    def targets(self) -> dict[str, float]:
        """Return true values of the targets, exact in case (A1)."""
        gravity = 1.0 - self.gravity_error
        mounting = rotation_vectors(turned(self.theta) @ about(2, -self.beta_error))
        values = {"X1": self.kappa, "X2": self.alpha_error + self.alpha_star, "X3": self.epsilon}
        for p, (plus, minus) in enumerate((("X4", "X5"), ("X9", "X10"), ("X14", "X15"))):
            values[plus] = (1.0 + self.plus[p]) * gravity - 1.0
            values[minus] = (1.0 + self.minus[p]) * gravity - 1.0
            values[f"X{16 + p}"] = self.bias[p]
        for name, (row, column) in {"X6+X8": (1, 0), "X7+X12": (2, 0), "X11+X13": (2, 1)}.items():
            values[name] = self.gamma[row, column] * gravity
        return values | dict(zip(("X13", "-X12", "X8"), mounting, strict=True))


def random_bench(rng: np.random.Generator, u: float = 3e-3, v: float = 1e-2) -> NDArray:
    """Draw elementary parameters (24,) of case (A1) with every X of the paper within u and v."""
    reach = np.full(24, v / 3)
    reach[:6] = u, u, u / 2, v / 3, u / 2, v / 3
    reach[9:15] = 2 * v / 3
    reach[17] = reach[19] = reach[20] = 0.0
    reach[21:] = v
    return rng.uniform(-reach, reach)


def record(
    reading: NDArray,
    alpha: ArrayLike = ALPHA,
    beta: ArrayLike = BETA,
    mounting: Sequence[str] | None = None,
    resolution: float = 0.0,
) -> PositionRecord:
    """Return the position record of readings (N, 3) [g], twice a minute."""
    count = len(reading)
    return PositionRecord(
        position=np.arange(1, count + 1),
        time_s=30.0 * np.arange(count),
        alpha=np.asarray(alpha, dtype=float),
        beta=np.asarray(beta, dtype=float),
        specific_force=reading * G,
        mounting=None if mounting is None else tuple(mounting),
        resolution=resolution,
    )


def simulated(
    bench: ArrayLike,
    alpha: ArrayLike = ALPHA,
    beta: ArrayLike = BETA,
    noise: ArrayLike = 0.0,
    mounting: ArrayLike | None = None,
) -> PositionRecord:
    """Return the record of a bench (24,) with noise (N, 3) [g], in one mounting."""
    stand = Stand.of_elements(bench)
    inputs = stand.inputs(np.asarray(alpha), np.asarray(beta), mounting)
    return record(stand.readings(inputs) + noise, alpha, beta)
