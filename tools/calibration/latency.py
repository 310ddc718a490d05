"""The accelerometers' latency: readings in motion beside rests and turns, in one system.

All three lag by one time behind the encoders; where each of them sits in the block is not known, and tells itself by
how the reading depends on rate and acceleration. What this system leaves possible of the lag is guaranteed like the
rest; of everything else what rests and turns say stands, whatever is read in motion.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.bench import SYMMETRIC_PAIRS, TARGETS
from ...models.bench_turns import GYRO_PARAMETERS, LAG
from ...models.effects import CATALOGUE
from ..calibrated import LATENCIES
from .in_motion import InMotion
from .model import Positions, predicted_input, predicted_reading, reading_jacobian
from .targets import Target
from .turns import ROUNDS, STILL, WithTurns, fitted_step

FURTHER = ("A", *(f"r{p}{k}" for p in (1, 2, 3) for k in (1, 2, 3)))
"""Lag of the accelerometers [s]; places of each of them from where the axes cross [m]."""
PLAUSIBLE = np.array([1e-2, *[0.1] * 9])
NEAR = 1e-4
"""So far [s] before and after a moment."""


@dataclass(frozen=True)
class WithMotion(WithTurns):
    """Rests, turns and, behind them, readings in motion, with the parameters `FURTHER` behind those of the gyros.

    `gravity` is the model value [m/s²].
    """

    moving: InMotion
    gravity: float

    @property
    def symbols(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return (*super().symbols, *FURTHER)

    def residual_at(self, point: NDArray) -> NDArray:
        """Exact residuals of readings at rest [g], integrals [rad] and readings in motion [g] at another point."""
        at, sign, arms = self._moved(point)
        read = predicted_reading(self.parametrisation, point[: self.own], at, sign)
        left = (self.moving.reading - read).ravel() - arms @ point[-9:]
        return np.append(super().residual_at(point[: -len(FURTHER)]), left)

    def jacobian_at(self, point: NDArray) -> NDArray:
        """Exact derivatives at another point, but for how scale factors change what a place adds."""
        x, lag = point[: self.own], float(point[-len(FURTHER)])
        at, sign, arms = self._moved(point)
        by_bench = reading_jacobian(self.parametrisation, x, at, sign).reshape(-1, self.own)
        later, before = (self._moved(point, side * NEAR)[2] for side in (1.0, -1.0))
        by_lag = self.moving.by_lag(self.parametrisation, x, lag) + (later - before) @ point[-9:] / (2.0 * NEAR)
        none = np.zeros((len(by_bench), len(GYRO_PARAMETERS)))
        rows = np.hstack([by_bench, none, by_lag[:, None], arms])
        before = np.pad(super().jacobian_at(point[: -len(FURTHER)]), ((0, 0), (0, len(FURTHER))))
        return np.vstack([before, rows])

    def _moved(self, point: NDArray, later: float = 0.0) -> tuple[Positions, NDArray, NDArray[np.float64]]:
        """Where the table stood, signs (W, 3) of the inputs, and what a metre of each place adds (3 W, 9) [g].

        An accelerometer reads what its own place adds along its axis and, misaligned, along the others'.
        """
        lag, places = float(point[-len(FURTHER)]) + later, point[-9:].reshape(3, 3)
        targets, at = self.parametrisation.selection[0] @ point[: self.own], self.moving.at(lag)
        x = dict(zip(TARGETS, targets, strict=True))
        rows = self.moving.motion(self.turns.block_axes(targets), float(x["X3"]), self.gravity, lag)
        effect = CATALOGUE["lever-arm"]
        by_place = np.stack([effect.signature(place, rows)[:, p] for p, place in enumerate(effect.places)], axis=1)
        n = predicted_input(self.parametrisation, point[: self.own], at) + np.einsum("wpk,pk->wp", by_place, places)
        read = np.tile(np.eye(3), (len(n), 1, 1))
        read[:, 1, 0], read[:, 2, 0], read[:, 2, 1] = x["X6+X8"], x["X7+X12"], x["X11+X13"]
        for p, (plus, minus) in enumerate(SYMMETRIC_PAIRS):
            read[:, p, p] += np.where(n[:, p] >= 0.0, x[plus], x[minus])
        arms = np.zeros((len(n), 3, 3, 3))
        for p in range(3):
            arms[:, p, p] = np.einsum("wq,wqk->wk", read[:, p], by_place)
        return at, np.where(n >= 0.0, 1, -1), arms.reshape(-1, 9)


def with_motion(whole: WithTurns, moving: InMotion, gravity: float) -> WithMotion:
    """The model of rests and turns with readings in motion, fitted together by least squares; gravity [m/s²]."""
    point, bound = np.append(whole.point, np.zeros(len(FURTHER))), np.append(whole.bound, moving.bound)
    found, sizes = WithMotion(**vars(whole), moving=moving, gravity=gravity), np.append(whole.sizes, PLAUSIBLE)
    for _ in range(ROUNDS):
        found, step = fitted_step(found, point, bound, sizes)
        point = point + step
        if np.abs(step / sizes).max() < STILL:
            break
    return found


def lag_targets(count: int) -> list[Target]:
    """The accelerometers' lag behind the encoders, and the gyros' behind the accelerometers.

    That many parameters are those of bench, accelerometers and gyros.
    """
    behind = np.zeros(count + len(FURTHER))
    behind[count] = 1.0
    between = -behind
    between[count - len(GYRO_PARAMETERS) + LAG] = 1.0
    return [
        Target(LATENCIES[0], "accelerometer-lag", "s", behind),
        Target(LATENCIES[1], "gyro-lag-behind-accelerometers", "s", between),
    ]
