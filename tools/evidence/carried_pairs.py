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
from .onsets import CarriedOnsets
from .pairs import GYROS, TURN, Pair, Spread
from .references import Gravity, turning

NODES, NODES_OF_TIME = 64, 192
"""Nodes of a function of a quantity, and of time."""
Weights = Sequence[tuple[NDArray[np.int_], NDArray[np.float64]]]
"""Columns (N - 1,) to which rows add, and how much (N - 1,) of each."""


@dataclass(frozen=True, eq=False)
class Summed:
    """A part of evidence whose pieces, from rows `first` (S,) to `last` (S,), sum what is added at each row of motion.

    `turns` (S, d, 3): what a turn within a piece adds to its error; `bias` (S, d, 3) what a mean at rest adds that is
    taken out, None where none is; `bound` (S, d) of the errors.
    """

    first: NDArray[np.int_]
    last: NDArray[np.int_]
    turns: NDArray[np.float64]
    bias: NDArray[np.float64] | None
    bound: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GyroPairs:
    """Gyros with every quantity of rows in motion `seen`, N - 1 after the first.

    `turning` (N - 1, 3, 3): turns by a unit of what each gyro reads too much; `parts` of the evidence; `rests` (N - 1,)
    which rows make the mean that is taken out.
    """

    seen: MotionRows
    turning: NDArray[np.float64]
    parts: Sequence[Summed]
    rests: NDArray[np.bool_]

    @staticmethod
    def carried(evidence: Evidence, onsets: CarriedOnsets) -> "GyroPairs":
        """The gyros of a block that is carried."""
        count, model = len(onsets.motion), onsets.model
        means = onsets.bias or [None] * len(evidence.parts)
        every = zip(evidence.parts, onsets.turns, means, strict=True)
        return GyroPairs(
            onsets.motion.rows(1, count, model.inverse, model.bias),
            turning(onsets.motion, model, onsets.attitude, 1, count),
            [Summed(part.pieces.first, part.pieces.last, own, mean, part.bound) for part, own, mean in every],
            onsets.rests[1:],
        )

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
        return np.unique(np.concatenate([rows for part in self.parts for rows in (part.first, part.last)]))

    @cached_property
    def moves(self) -> tuple[tuple[float, float], ...]:
        """From when to when [h] each piece, with those that overlap it, goes."""
        pieces = np.concatenate([np.stack([part.first, part.last]) for part in self.parts], axis=1)
        first, last = pieces[:, np.argsort(pieces[0], kind="stable")]
        until = np.maximum.accumulate(last)
        begins = np.flatnonzero(np.append(True, first[1:] >= until[:-1]))
        hours = self.seen.hours
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
        count, parts = len(self.nodes), self.of.parts
        weights = [(at, self.times * weight) for at, weight in OnKnots(self.nodes).weights(self.values)]
        own = [part.turns for part in parts], [part.bias for part in parts]
        return self._rows(weights, count, self.of.turning[..., self.p], *own)

    def missed(self, knots: NDArray[np.float64]) -> NDArray[np.float64]:
        """By how much (M,) rows over their bounds differ at most, of a function whose slope changes by one in all.

        That is from the function that is straight between knots (k,) and has its values there. At x between two knots
        the two are (x - a)(b - x)/(b - a) apart at most, for each unit of change between a and b.
        """
        after = self._after(knots)
        low, high = knots[after - 1], knots[after]
        apart = np.abs(self.times) * np.maximum(0.0, (self.values - low) * (high - self.values)) / (high - low)
        turns = [np.abs(part.turns) for part in self.of.parts]
        # All rows of a piece may differ in the same sense, and so may the mean at rest that is taken out.
        means = [None if part.bias is None else -np.abs(part.bias) for part in self.of.parts]
        turning = np.abs(self.of.turning[..., self.p])
        found = self._rows(((after - 1, apart),), len(knots), turning, turns, means)
        return found.max(axis=1, initial=0.0)

    def _after(self, knots: NDArray) -> NDArray[np.int_]:
        """The knot after each value (N - 1,)."""
        return np.clip(np.searchsorted(knots, self.values), 1, len(knots) - 1)

    def _rows(
        self,
        weights: Weights,
        count: int,
        turning: NDArray,
        turns: Sequence[NDArray],
        bias: Sequence[NDArray | None],
    ) -> NDArray[np.float64]:
        """Rows (M, count) over their bounds, of weights (N - 1,) that add to columns (N - 1,)."""
        of, found = self.of, []
        integral = integrated(weights, count, turning, of.boundaries)
        mean, resting = np.zeros(count), of.rests
        for at, weight in weights:
            mean += np.bincount(at[resting], weight[resting], count)
        mean /= max(int(resting.sum()), 1)
        for part, own, taken_out in zip(of.parts, turns, bias, strict=True):
            after, before = (np.searchsorted(of.boundaries, rows) for rows in (part.last, part.first))
            mine = own @ (integral[after] - integral[before])
            if taken_out is not None:
                # The mean at rest is taken out of every reading.
                mine = mine - taken_out[..., self.p, None] * mean
            found.append(rows_over(mine, part.bound))
        return np.concatenate(found)


@dataclass(frozen=True, eq=False)
class OnKnots:
    """Functions that are straight between knots (k,); round a circle the last knot is the first."""

    knots: NDArray[np.float64]
    circle: bool = False

    @property
    def count(self) -> int:
        """How many functions are one at a knot each."""
        return len(self.knots) - self.circle

    def weights(self, values: NDArray) -> Weights:
        """Knots before and after values (n,), and what the function there counts."""
        values = values % TURN if self.circle else values
        after = np.clip(np.searchsorted(self.knots, values), 1, len(self.knots) - 1)
        share = (values - self.knots[after - 1]) / (self.knots[after] - self.knots[after - 1])
        return (after - 1, 1.0 - share), (after % self.count, share)

    def at(self, values: NDArray) -> NDArray[np.float64]:
        """The functions (n, K) at values (n,)."""
        found, rows = np.zeros((len(values), self.count)), np.arange(len(values))
        for at, weight in self.weights(values):
            found[rows, at] += weight
        return found


def integrated(weights: Weights, count: int, turning: NDArray, boundaries: NDArray) -> NDArray[np.float64]:
    """The integral (B, 3, count) up to each boundary of turns (N - 1, 3) times what weights add to columns."""
    until = np.searchsorted(boundaries, np.arange(1, len(turning) + 1))
    ends = len(boundaries) + 1
    total = np.zeros((3, ends * count))
    for at, weight in weights:
        cells = until * count + at
        for axis in range(3):
            total[axis] += np.bincount(cells, turning[:, axis] * weight, total.shape[1])
    return np.cumsum(total.reshape(3, ends, count)[:, :-1], axis=1).transpose(1, 0, 2)


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
