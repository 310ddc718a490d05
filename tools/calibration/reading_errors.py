"""What the block's readings are off by at the corners of its input: from these its error is bounded at any input."""

from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...models.bench import TARGETS
from .parametrisation import Parametrisation

SCALE_TARGETS = (("X4", "X5"), ("X9", "X10"), ("X14", "X15"))
MISALIGNMENT_TARGETS = ((), ("X6+X8",), ("X7+X12", "X11+X13"))
BIAS_TARGETS = ("X16", "X17", "X18")


@dataclass(frozen=True)
class ReadingError:
    """What accelerometer `accelerometer` reads beyond its input at `input` (3,) [g], between `low` and `high` [g].

    None where the readings do not determine it.
    """

    accelerometer: int
    input: tuple[int, int, int]
    low: float | None
    high: float | None


def corners() -> list[tuple[int, tuple[int, int, int]]]:
    """Accelerometer and input for every combination of −1, 0, 1 that its reading depends on (Γ lower triangular)."""
    places = []
    for p in range(3):
        for own in product((-1, 0, 1), repeat=p + 1):
            places.append((p + 1, (*own, 0, 0)[:3]))
    return places


def error_weights(p: Parametrisation) -> NDArray:
    """Weights (39, P) of (Γ n + b) of each of the `corners`, by the parameters of the fit."""
    rows = np.zeros((len(corners()), len(TARGETS)))
    for row, (accelerometer, n) in zip(rows, corners(), strict=True):
        own = accelerometer - 1
        plus, minus = SCALE_TARGETS[own]
        row[TARGETS.index(plus if n[own] > 0 else minus)] += n[own]
        for c, target in enumerate(MISALIGNMENT_TARGETS[own]):
            row[TARGETS.index(target)] += n[c]
        row[TARGETS.index(BIAS_TARGETS[own])] += 1.0
    # the block is the same in every mounting
    return rows @ p.selection[0]


def reading_errors(intervals: NDArray) -> tuple[ReadingError, ...]:
    """The `corners` with their intervals (39, 2), NaN where there is none."""
    return tuple(
        ReadingError(accelerometer, n, *(None if np.isnan(end) else float(end) for end in ends))
        for (accelerometer, n), ends in zip(corners(), intervals, strict=True)
    )
