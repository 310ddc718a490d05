"""Places and quantities of a block in motion: on what the error of a gyro or an accelerometer may depend.

What a gyro reads too much acts at every row. Its functions are therefore taken at nodes of their quantity, straight
between them, and their turns are integrated over each piece: one matrix tells what the value at each node adds.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import MotionRows
from ...models.effects.definition import ACCELEROMETERS, GYRO_BLOCK
from ..motion.norm import inputs_of
from .evidence import Evidence, rows_over
from .observation import Observation, OnKnots
from .pairs import GYROS, Pair, Spread
from .references import Gravity

NODES, NODES_OF_TIME = 64, 192
"""Nodes of a function of a quantity, and of time."""


@dataclass(frozen=True, eq=False)
class GyroPairs:
    """Gyros with every quantity of steps in motion (R,), by an observation of what is added to their rates.

    `bounds` (S, d) are those of the errors of its groups.
    """

    steps: MotionRows
    observation: Observation
    bounds: Sequence[NDArray[np.float64]]

    @cached_property
    def slow(self) -> dict[str, NDArray[np.float64]]:
        """Time and temperature (R,)."""
        found = {"hours": self.steps.hours}
        if self.steps.temperature is not None and np.ptp(self.steps.temperature) > 0.0:
            found["temperature"] = self.steps.temperature
        return found

    @cached_property
    def moves(self) -> tuple[tuple[float, float], ...]:
        """From when to when [h] each piece, with those that overlap it, goes."""
        first = np.concatenate([group.pieces.first for group in self.observation.groups])
        last = np.concatenate([group.pieces.last for group in self.observation.groups])
        order = np.argsort(first, kind="stable")
        first, last = first[order], last[order]
        until = np.maximum.accumulate(last)
        begins = np.flatnonzero(np.append(True, first[1:] >= until[:-1]))
        hours = self.steps.hours
        ends = np.append(begins[1:], len(first)) - 1
        rows = zip(first[begins].tolist(), until[ends].tolist(), strict=True)
        return tuple((float(hours[a]), float(hours[min(b, len(hours)) - 1])) for a, b in rows if b > a)

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
        rows, rate, force = self.steps, f"w{p + 1}", f"n{p + 1}"
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
        """One gyro's error as a function of values (R,), times a factor (R,)."""
        time = name == "hours"
        nodes = np.linspace(values.min(), values.max(), NODES_OF_TIME if time else NODES)
        if not time and nodes[0] < 0.0 < nodes[-1]:
            # At rest it is zero: what is taken there is exact.
            nodes[np.abs(nodes).argmin()] = 0.0
        spread, own = OnNodes(self, p, nodes, values, times), self.moves if time and not factor else ()
        known = {"waves": time, "moves": own, "anything": True, "missed": spread.missed}
        return Pair(GYROS[p], name, nodes, spread, GYROS[p], factor, **known)


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
        weights = [(knot, self.times * weight) for knot, weight in OnKnots(self.nodes).weights(self.values)]
        return self._over_bounds(self.of.observation.of_functions(weights, len(self.nodes), self.p))

    def missed(self, knots: NDArray[np.float64]) -> NDArray[np.float64]:
        """By how much (M,) rows over their bounds differ at most, of a function whose slope changes by one in all.

        That is from the function that is straight between knots (k,) and has its values there. At x between two knots
        the two are (x - a)(b - x)/(b - a) apart at most, for each unit of change between a and b.
        """
        after = self._after(knots)
        low, high = knots[after - 1], knots[after]
        apart = np.abs(self.times) * np.maximum(0.0, (self.values - low) * (high - self.values)) / (high - low)
        # All rows of a piece may differ in the same sense, and so may the mean at rest that is taken out.
        largest = self.of.observation.largest.of_functions(((after - 1, apart),), len(knots), self.p)
        return self._over_bounds(largest).max(axis=1, initial=0.0)

    def _after(self, knots: NDArray) -> NDArray[np.int_]:
        """The knot after each value (R,)."""
        return np.clip(np.searchsorted(knots, self.values), 1, len(knots) - 1)

    def _over_bounds(self, columns: Sequence[NDArray]) -> NDArray[np.float64]:
        """Columns (S, d, K) of each group as rows (M, K) over their bounds."""
        pairs = zip(columns, self.of.bounds, strict=True)
        return np.concatenate([rows_over(own, bound) for own, bound in pairs])


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
