"""Exchanges with which wrong rows fit: of angles, of channels, of signs. None has a free number."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats, Ints
from ..calibration.model import Positions, predicted_reading, reading_jacobian
from .removal import held_by
from .table import SECOND_ORDER, TableRows

NEAR = 1e-3
"""Rows that fit with a change miss by less than this [g] before the parameters are fitted to them."""
CHANNELS = ("f1_mps2", "f2_mps2", "f3_mps2")
ORDERS = ((1, "f1, f2, f3 read as f2, f3, f1"), (2, "f1, f2, f3 read as f3, f1, f2"))
"""Channels that are shifted cyclically by this number of places."""
SIGNS = (
    ("the sign of α turned", {"alpha_deg": "sign"}, (-1.0, 1.0)),
    ("the sign of β turned", {"beta_deg": "sign"}, (1.0, -1.0)),
    ("the signs of both angles turned", {"alpha_deg": "sign", "beta_deg": "sign"}, (-1.0, -1.0)),
)


@dataclass(frozen=True)
class Exchange:
    """An exchange in words, which follow "It fits with", and as results have it; its angles (K, 2), readings (K, 3)."""

    words: str
    keys: Mapping[str, Any]
    angles: Floats
    reading: Floats


def exchanges(angles: NDArray, reading: NDArray) -> Iterator[Exchange]:
    """Yield every exchange of rows with angles (K, 2) [rad] and readings (K, 3) [g]."""
    yield Exchange("α and β exchanged", {"exchanged": ["alpha_deg", "beta_deg"]}, angles[:, ::-1], reading)
    for words, keys, signs in SIGNS:
        yield Exchange(words, keys, angles * signs, reading)
    for k, channel in enumerate(CHANNELS):
        signs = np.where(np.arange(3) == k, -1.0, 1.0)
        yield Exchange(f"the sign of f{k + 1} turned", {channel: "sign"}, angles, reading * signs)
    for i, j in combinations(range(3), 2):
        order = np.arange(3)
        order[[i, j]] = j, i
        keys = {"exchanged": [CHANNELS[i], CHANNELS[j]]}
        yield Exchange(f"f{i + 1} and f{j + 1} exchanged", keys, angles, reading[:, order])
    for places, words in ORDERS:
        yield Exchange(words, {"rotated": places}, angles, np.roll(reading, places, axis=1))


@dataclass(frozen=True, eq=False)
class WrongRows:
    """Rows (K,), from 0, that one change is to mend, and all wrong rows; the table is linear about a fit of the others.

    The readings of the K rows must fit together with those of all right rows.
    """

    table: TableRows
    rows: Ints
    wrong: Ints

    @cached_property
    def others(self) -> tuple[Floats, Floats]:
        """Derivatives and errors of the right rows over their bounds."""
        kept = self.table.readings_without(self.wrong)
        return self.table.matrix[kept], self.table.target[kept]

    @property
    def bound(self) -> Floats:
        """Bounds (K, 3) of the readings [g]."""
        return self.table.linear.bound.reshape(-1, 3)[self.rows]

    @property
    def reading(self) -> Floats:
        """Readings (K, 3) [g]."""
        return self.table.linear.reading[self.rows]

    @property
    def angles(self) -> Floats:
        """Angles (K, 2) as the record has them [rad]."""
        at = self.table.linear.positions
        return np.column_stack((at.alpha, at.beta))[self.rows]

    def at(self, angles: NDArray) -> Positions:
        """Positions of other angles (K, 2) in the rows' mounting; of one row any number of angles."""
        mounting = np.broadcast_to(self.table.linear.positions.mounting[self.rows], len(angles))
        return Positions(angles[:, 0], angles[:, 1], mounting)

    def predicted(self, angles: NDArray) -> Floats:
        """Readings (K, 3) at other angles (K, 2), at the fit of the others."""
        linear = self.table.linear
        return predicted_reading(linear.parametrisation, linear.point, self.at(angles))

    def derivatives(self, angles: NDArray) -> Floats:
        """Derivatives (3 K, P) of the readings at angles (K, 2), over the bounds."""
        linear = self.table.linear
        jacobian = reading_jacobian(linear.parametrisation, linear.point, self.at(angles))
        return (jacobian.reshape(3 * len(angles), -1) @ linear.span) / self.bound.reshape(-1, 1)

    def radius_with(self, matrix: NDArray, errors: NDArray) -> float:
        """The radius of the right rows with further readings: derivatives (M, P) and errors (M,) over the bounds."""
        right, target = self.others
        return held_by(np.vstack((right, matrix)), np.append(target, errors))[0]

    def fit(self, angles: NDArray, reading: NDArray) -> bool:
        """Return true if the rows fit with angles (K, 2) and readings (K, 3)."""
        error = reading - self.predicted(angles)
        if np.abs(error).max() > NEAR:
            return False
        radius = self.radius_with(self.derivatives(angles), (error / self.bound).ravel())
        return radius <= self.table.limit + SECOND_ORDER

    def exchanges(self) -> Iterator[Exchange]:
        """Yield the exchanges with which the rows fit."""
        for exchange in exchanges(self.angles, self.reading):
            if self.fit(exchange.angles, exchange.reading):
                yield exchange
