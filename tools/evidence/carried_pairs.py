"""Places and quantities of a block that is carried: on what the error of a gyro or an accelerometer may depend.

What a gyro reads too much acts at every row. Its functions are therefore taken at nodes of their quantity, straight
between them, and their turns are integrated over each piece: one matrix tells what the value at each node adds.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import MotionRows
from ...models.effects.definition import ACCELEROMETERS, GYRO_BLOCK
from ..motion.norm import inputs_of
from .evidence import Evidence, rows_over
from .onsets import Onsets
from .pairs import GYROS, Pair, Spread
from .references import Gravity, turning

NODES, NODES_OF_TIME = 64, 192
"""Nodes of a function of a quantity, and of time."""


@dataclass(frozen=True, eq=False)
class GyroPairs:
    """The gyros of evidence with every quantity of its rows in motion."""

    evidence: Evidence
    onsets: Onsets

    @cached_property
    def seen(self) -> MotionRows:
        """Rows as the effects see them, after the first."""
        onsets = self.onsets
        return onsets.motion.rows(1, len(onsets.motion), onsets.model.inverse, onsets.model.bias)

    @cached_property
    def turning(self) -> NDArray[np.float64]:
        """Turns (N - 1, 3, 3) by a unit of what each gyro reads too much."""
        onsets = self.onsets
        return turning(onsets.motion, onsets.model, onsets.attitude, 1, len(onsets.motion))

    @cached_property
    def slow(self) -> dict[str, NDArray[np.float64]]:
        """Time and temperature (N - 1,)."""
        found = {"hours": self.seen.hours}
        if self.seen.temperature is not None and np.ptp(self.seen.temperature) > 0.0:
            found["temperature"] = self.seen.temperature
        return found

    @cached_property
    def boundaries(self) -> NDArray[np.int_]:
        """Rows at which pieces begin or end, in order."""
        return np.unique(np.concatenate([rows for p in self.onsets.pieces for rows in (p.first, p.last)]))

    def pairs(self) -> Iterator[Pair]:
        """Each gyro by itself, then all three, each with a function of its own."""
        alone = [dict(self.of_gyro(p)) for p in range(3)]
        for own in alone:
            yield from own.values()
        for name in alone[0]:
            if all(name in own for own in alone) and not name[0].isdigit():
                first, *others = (own[name] for own in alone)
                quantity, factor = COMMON.get(first.quantity, first.quantity), COMMON.get(first.factor, first.factor)
                yield Pair(
                    GYRO_BLOCK,
                    quantity,
                    first.values,
                    first.spread,
                    GYRO_BLOCK,
                    factor,
                    waves=first.waves,
                    anything=True,
                    members=(first, *others),
                )

    def of_gyro(self, p: int) -> Iterator[tuple[str, Pair]]:
        """Pairs of one gyro; what is not the gyro's own has a number before its name."""
        rows, rate, force = self.seen, f"w{p + 1}", f"n{p + 1}"
        turn, own = f"dw{p + 1}", rows.rate[:, p]
        growing = rows.acceleration[:, p]
        yield "rate", self.pair(p, rate, own)
        yield "acceleration", self.pair(p, turn, growing)
        yield "force", self.pair(p, force, rows.specific_force[:, p])
        for name, values in self.slow.items():
            yield name, self.pair(p, name, values)
            yield f"{name} rate", self.pair(p, name, values, rate, own)
            yield f"{name} acceleration", self.pair(p, name, values, turn, growing)
        for q in range(3):
            if q != p:
                yield f"{q} rate", self.pair(p, f"w{q + 1}", rows.rate[:, q])
                yield f"{q} force", self.pair(p, f"n{q + 1}", rows.specific_force[:, q])
        for i, j in combinations(range(3), 2):
            yield f"{i}{j} rate", self.pair(p, f"w{i + 1} w{j + 1}", rows.rate[:, i] * rows.rate[:, j])
            product = rows.specific_force[:, i] * rows.specific_force[:, j]
            yield f"{i}{j} force", self.pair(p, f"n{i + 1} n{j + 1}", product)

    def pair(self, p: int, name: str, values: NDArray, factor: str = "", times: NDArray | float = 1.0) -> Pair:
        """One gyro's error as a function of values (N - 1,), times a factor (N - 1,)."""
        time = name == "hours"
        nodes = np.linspace(values.min(), values.max(), NODES_OF_TIME if time else NODES)
        if not time and nodes[0] < 0.0 < nodes[-1]:
            # At rest it is zero: what is taken there is exact.
            nodes[np.abs(nodes).argmin()] = 0.0
        spread = OnNodes(self, p, nodes, values, times)
        return Pair(GYROS[p], name, nodes, spread, GYROS[p], factor, waves=time, anything=True)


@dataclass(frozen=True, eq=False)
class OnNodes:
    """What the values of a function at nodes (n,) of a quantity add to the rows of evidence, at one gyro `p`."""

    of: GyroPairs
    p: int
    nodes: NDArray[np.float64]
    values: NDArray[np.float64]
    times: NDArray[np.float64] | float

    def __call__(self, functions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Rows (M, K) of functions (n, K)."""
        return self.matrix @ functions

    @cached_property
    def matrix(self) -> NDArray[np.float64]:
        """Rows (M, n) over their bounds of a unit at each node."""
        onsets, p = self.of.onsets, self.p
        integral, mean = self._integrated()
        found = []
        for k, (part, turns) in enumerate(zip(self.of.evidence.parts, onsets.turns, strict=True)):
            after, before = (np.searchsorted(self.of.boundaries, r) for r in (part.pieces.last, part.pieces.first))
            mine = turns @ (integral[after] - integral[before])
            if onsets.bias is not None:
                # The mean at rest is taken out of every reading.
                mine = mine - onsets.bias[k][..., p, None] * mean
            found.append(rows_over(mine, part.bound))
        return np.concatenate(found)

    def _integrated(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The integral (B, 3, n) up to each boundary, and the part of the mean over all rests (n,)."""
        onsets, nodes, count = self.of.onsets, self.nodes, len(self.nodes)
        after = np.clip(np.searchsorted(nodes, self.values), 1, count - 1)
        share = (self.values - nodes[after - 1]) / (nodes[after] - nodes[after - 1])
        weights = (self.times * (1.0 - share), self.times * share)
        until = np.searchsorted(self.of.boundaries, np.arange(1, len(self.values) + 1))
        ends, total = len(self.of.boundaries) + 1, np.zeros((3, (len(self.of.boundaries) + 1) * count))
        mean, resting = np.zeros(count), onsets.rests[1:]
        for at, weight in zip((after - 1, after), weights, strict=True):
            cells = until * count + at
            for axis in range(3):
                turned = self.of.turning[:, axis, self.p] * weight
                total[axis] += np.bincount(cells, turned, total.shape[1])
            mean += np.bincount(at[resting], weight[resting], count)
        integral = np.cumsum(total.reshape(3, ends, count)[:, :-1], axis=1)
        return integral.transpose(1, 0, 2), mean / max(int(resting.sum()), 1)


COMMON: Mapping[str, str] = {"w1": "rate", "dw1": "acceleration", "n1": "force"}
"""A quantity of gyro 1 alone, and the same where each gyro has its own."""


def pairs_of_accelerometers(evidence: Evidence, reference: Gravity, x: NDArray, attitude: NDArray) -> Iterator[Pair]:
    """Each accelerometer with every quantity of its rests, where gravity is the reference.

    `x` are their nine parameters; the attitude (N, 4) was carried.
    """
    n, rests = inputs_of(x, reference.reading), reference.rests
    of_readings = reference.of_readings(x, attitude)
    slow = {"hours": (rests.time_s - rests.time_s[0]) / 3600.0}
    if rests.temperature is not None and np.ptp(rests.temperature) > 0.0:
        slow["temperature"] = rests.temperature
    inputs = {f"n{k + 1}": n[:, k] for k in range(3)}
    products = {f"{one} {other}": inputs[one] * inputs[other] for one, other in combinations(inputs, 2)}
    for p, place in enumerate(ACCELEROMETERS):
        matrix = np.concatenate(
            [
                rows_over(of_readings[part.label][..., p], part.bound)
                if part.label in of_readings
                else np.zeros((part.bound.size, len(n)))
                for part in evidence.parts
            ]
        )
        for name, values in (inputs | slow | products).items():
            yield Pair(place, name, values, on_rests(matrix), place)
        for name, values in slow.items():
            yield Pair(place, name, values, on_rests(matrix * n[:, p]), place, f"n{p + 1}")


def on_rests(matrix: NDArray[np.float64]) -> Spread:
    """Functions (K, k) of the rests on rows by a matrix (M, K)."""
    return lambda functions: matrix @ functions
