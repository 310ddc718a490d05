"""Pairs of place and quantity, for any law: of a table's rests, of a whole bench, of gyros.

The error of a gyro acts at every step. Its functions are therefore taken at nodes of their quantity, straight between
them. One matrix by the values at the nodes gives their sums over each piece.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import MotionRows, Rows
from ...models.effects.columns import is_inner_axis
from ...models.effects.definition import ACCELEROMETERS, GYRO_BLOCK
from ...models.effects.lookup import FROM, TURNS
from ...models.effects.mounting import MOUNTING
from ..bounded.programmes import column_space
from ..motion.norm import inputs_of
from .observation import Group, Observation, OnKnots, Travel
from .pairs import GYROS, TURN, Pair, Spread
from .references import Gravity
from .rows import Part, Pieces, rows_over

NODES, NODES_OF_TIME = 64, 192
"""Nodes of a function of a quantity, and of time."""
AROUND = 144
"""Nodes of a function of an angle of the whole bench: knots of all pieces round a circle are among them."""
BLUR = 2e-3
"""Error of functions on nodes, and of turns between the compared rows."""
COMMON: Mapping[str, str] = {"w1": "rate", "dw1": "acceleration", "n1": "force"}
"""A quantity of gyro 1 alone, and the same where each gyro has its own."""


def slow_quantities(hours: NDArray, temperature: NDArray | None) -> dict[str, Floats]:
    """Return time and temperature (N,), where they change."""
    slow = {"hours": hours}
    if temperature is not None:
        slow["temperature"] = temperature
    return {name: values for name, values in slow.items() if np.ptp(values) > 0.0}


def inputs_and_products(n: NDArray) -> tuple[dict[str, Floats], dict[str, Floats]]:
    """Return three inputs (N,) by name, and their products."""
    inputs = {f"n{axis + 1}": values for axis, values in enumerate(n.T)}
    products = {f"{first} {second}": inputs[first] * inputs[second] for first, second in combinations(inputs, 2)}
    return inputs, products


def through(slope: Floats) -> Spread:
    """Return the changes of readings (3 N, K) by functions (N, K), through a slope (N, 3)."""
    return lambda functions: (slope[:, :, None] * functions[:, None, :]).reshape(slope.size, -1)


# Rests on a table


def pairs_of_bench(rows: Rows) -> Iterator[Pair]:
    """Yield each accelerometer, turn and tilt of the table with every quantity of the record's rows."""
    for p in range(3):
        yield from pairs_of_accelerometer(p, rows)
    turns = np.moveaxis(rows.by_turns, 2, 0)
    for way in Way.every(rows):
        yield way.pair(way.values(rows), through(way.slope(rows, turns)))


def pairs_of_accelerometer(p: int, rows: Rows) -> Iterator[Pair]:
    """Yield the pairs of one accelerometer at positions of a table: quantities that its error may depend on."""
    place, slow = ACCELEROMETERS[p], slow_quantities(rows.hours, rows.temperature)
    inputs, products = inputs_and_products(rows.n)
    own_input = f"n{p + 1}"

    def pair(name: str, values: NDArray, factor: str = "", times: NDArray | float = 1.0) -> Pair:
        slope = np.zeros(rows.n.shape)
        slope[:, p] = times
        return Pair(place, name, values, through(slope), place, factor)

    for name, values in (inputs | slow).items():
        yield pair(name, values)
    for name, angle in (("alpha", rows.alpha), ("beta", rows.beta)):
        yield replace(pair(name, angle), circle=True)
    for name, values in products.items():
        yield pair(name, values)
    if rows.input_sense[:, p].any():
        yield replace(pair("sense", rows.input_sense[:, p]), told=True)
    for name, values in slow.items():
        yield pair(name, values, own_input, inputs[own_input])
        # A factor counts from its zero, where it has no effect.
        factor = values - FROM.get(name, 0.0)
        yield pair(own_input, inputs[own_input], name, factor / np.abs(factor).max())


@dataclass(frozen=True)
class Way:
    """A way in which table or mounting acts: one of the seven small turns of `models.effects`, by a quantity."""

    where: str
    quantity: str
    turn: int
    freedom: str
    factor: str = ""

    @staticmethod
    def every(rows: Rows) -> "Iterator[Way]":
        """Yield all ways whose quantity the rows have."""
        slow = slow_quantities(rows.hours, rows.temperature)
        axes = (("outer-axis", "alpha", rows.sense_alpha), ("inner-axis", "beta", rows.sense_beta))
        for k, (place, angle, sense) in enumerate(axes):
            yield Way(place, angle, 2 * k + 1, f"{place} turn")
            yield Way(place, angle, 2 * k, f"{place} tilt", "tilt")
            if sense.any():
                yield Way(place, "sense", 2 * k + 1, f"{place} turn")
            for when in slow:
                yield Way(place, when, 2 * k + 1, f"{place} turn")
                yield Way(place if k else "base", when, 2 * k, f"{place} tilt", "tilt")
        # An inner axis that wobbles tilts about the outer axis, too; elastic turns grow with the load across the axis.
        yield Way("inner-axis", "beta", 1, "outer-axis turn", "outer tilt")
        yield Way("inner-axis", "beta", 3, "inner-axis turn", "sin alpha")
        yield from Way.of_block(rows, slow)

    @staticmethod
    def of_block(rows: Rows, slow: Iterable[str]) -> "Iterator[Way]":
        """Yield turns of the block about its axes, but about one that is the inner axis: the table can do the same."""
        for k, factor in enumerate(TURNS):
            if not is_inner_axis(rows, k):
                for quantity in ("n1", "n2", "n3", "alpha", "beta", *slow):
                    yield Way(MOUNTING, quantity, 4 + k, f"{MOUNTING} {factor}", factor)

    @property
    def circle(self) -> bool:
        """Return whether the quantity is an angle."""
        return self.quantity in ("alpha", "beta")

    def values(self, rows: Rows) -> Floats:
        """Return the quantity (N,)."""
        if self.quantity == "sense":
            return {"outer-axis": rows.sense_alpha, "inner-axis": rows.sense_beta}[self.where]
        if self.quantity[0] == "n":
            return rows.n[:, int(self.quantity[1]) - 1]
        return np.asarray(getattr(rows, self.quantity))

    def slope(self, rows: Rows, turns: NDArray) -> Floats:
        """Return the effect (N, 3) of a unit, from those of the seven small turns (7, N, 3)."""
        if self.factor == "sin alpha":
            return turns[self.turn] * np.sin(rows.alpha)[:, None]
        return turns[self.turn]

    def pair(self, values: NDArray, spread: Spread) -> Pair:
        """Return the pair at values (n,) of the quantity."""
        told = self.quantity == "sense"
        return Pair(self.where, self.quantity, values, spread, self.freedom, self.factor, self.circle, told)


# A whole bench: the rows of its gyros' integrals follow those of the readings.


def pairs_of_whole(readings_rows: Rows, travel: Travel, bound: NDArray, nominal: NDArray) -> Iterator[Pair]:
    """Yield accelerometers, table and gyros with every quantity; of the table gyros are a second witness.

    `bound` (M,) of readings and integrals; `nominal` (M, P) the model over it.
    """
    base = column_space(nominal)
    of_readings, of_turns = np.split(bound, [readings_rows.n.size])
    for p in range(3):
        for pair in pairs_of_accelerometer(p, readings_rows):
            yield replace(pair, spread=_above(pair.spread, of_readings, len(bound)))
    for way in Way.every(readings_rows):
        yield imitated(_of_both(way, readings_rows, travel, bound), base)
    # Readings carry no information on the gyros.
    nowhere = np.zeros(len(readings_rows.hours), dtype=int)
    still = Group(Pieces("rests", "readings", nowhere, nowhere), np.zeros((len(readings_rows.hours), 3, 3)))
    observation = Observation((still, *travel.gyros.groups), travel.gyros.adds)
    bounds = [of_readings.reshape(-1, 3), of_turns.reshape(-1, 3)]
    for pair in GyroPairs(travel.motion, observation, bounds).pairs():
        members = tuple(imitated(member, base) for member in pair.members)
        yield replace(imitated(pair, base), members=members)


def _above(spread: Spread, bound: NDArray, count: int) -> Spread:
    """Return a spread on readings divided by their bounds, with zeros appended up to a count of rows."""

    def spread_on_all(functions: NDArray) -> Floats:
        upper = spread(functions) / bound[:, None]
        return np.vstack([upper, np.zeros((count - len(upper), upper.shape[1]))])

    return spread_on_all


def _of_both(way: Way, readings_rows: Rows, travel: Travel, bound: NDArray) -> Pair:
    """Return the pair of a way of the table, on readings and integrals alike."""
    at_readings, on_way = way.values(readings_rows), way.values(travel.rows)
    if way.circle:
        nodes = TURN * np.arange(AROUND + 1) / AROUND
    elif way.quantity == "sense":
        nodes = np.array([-1.0, 0.0, 1.0])
    else:
        values_anywhere = np.append(at_readings, on_way)
        nodes = np.linspace(values_anywhere.min(), values_anywhere.max(), NODES_OF_TIME)

    @cache
    def matrix() -> Floats:
        functions = OnKnots(nodes, circle=way.circle)
        slope = way.slope(readings_rows, np.moveaxis(readings_rows.by_turns, 2, 0))
        on_readings = through(slope)(functions.at(at_readings))
        on_turns = travel.turned(functions, on_way, way.slope(travel.rows, travel.axes))
        return np.vstack([on_readings, on_turns]) / bound[:, None]

    own_nodes = nodes
    if way.circle:
        own_nodes = nodes[:AROUND]
    pair = way.pair(own_nodes, lambda functions: matrix() @ functions)
    return replace(pair, anything=True)


def imitated(pair: Pair, base: NDArray) -> Pair:
    """Return a pair whose constant, straight line or wave is within the model's space (M, P) where it nearly is.

    On nodes, and between the rows used, functions are not exact: their remainders are not functions of the pair.
    """
    if pair.told:
        return pair
    values = pair.values
    plain = [np.ones(len(values)), values]
    if pair.circle:
        plain[1:] = np.cos(values), np.sin(values)
    space = np.linalg.qr(np.stack(plain, axis=1))[0]

    @cache
    def inexact() -> Floats:
        columns = pair.spread(space)
        remainder = columns - base @ (base.T @ columns)
        _, sizes, directions = np.linalg.svd(np.linalg.qr(remainder, mode="r"), full_matrices=False)
        near = directions[sizes <= BLUR * np.linalg.norm(columns @ directions.T, axis=0)]
        return (remainder @ near.T) @ (space @ near.T).T

    return replace(pair, spread=lambda functions: pair.spread(functions) - inexact() @ functions)


# Gyros, on a table or carried by hand


@dataclass(frozen=True, eq=False)
class GyroPairs:
    """Gyros with every quantity of steps in motion (R,), and an observation of additions to their rates.

    `bounds` (S, d) are those of the errors of its groups.
    """

    steps: MotionRows
    observation: Observation
    bounds: Sequence[Floats]

    @cached_property
    def moves(self) -> tuple[tuple[float, float], ...]:
        """Return the beginning and end [h] of each move, joined with those that overlap it."""
        first = np.concatenate([group.pieces.first for group in self.observation.groups])
        last = np.concatenate([group.pieces.last for group in self.observation.groups])
        order = np.argsort(first, kind="stable")
        first, last = first[order], last[order]
        until = np.maximum.accumulate(last)
        begins = np.flatnonzero(np.append(True, first[1:] >= until[:-1]))
        ends = np.append(begins[1:], len(first)) - 1
        hours, moves = self.steps.hours, []
        for begin, end in zip(first[begins].tolist(), until[ends].tolist(), strict=True):
            if end > begin:
                moves.append((float(hours[begin]), float(hours[min(end, len(hours)) - 1])))
        return tuple(moves)

    def pairs(self) -> Iterator[Pair]:
        """Yield each gyro by itself, then all three, each with a function of its own."""
        alone = [self.of_gyro(p) for p in range(3)]
        for gyro in alone:
            yield from gyro.values()
        for name, first in alone[0].items():
            if not name[0].isdigit():
                members = tuple(gyro[name] for gyro in alone)
                quantity, factor = COMMON.get(first.quantity, first.quantity), COMMON.get(first.factor, first.factor)
                gyro = replace(first, where=GYRO_BLOCK, freedom=GYRO_BLOCK, quantity=quantity, factor=factor)
                yield replace(gyro, moves=(), missed=None, members=members)

    def of_gyro(self, p: int) -> dict[str, Pair]:
        """Return the pairs of one gyro; those of other quantities than its own have a number before their name."""
        steps, rate, turn = self.steps, f"w{p + 1}", f"dw{p + 1}"
        own_rate, own_turn, force = steps.rate[:, p], steps.acceleration[:, p], steps.specific_force
        pairs = {
            "rate": self.pair(p, rate, own_rate),
            "acceleration": self.pair(p, turn, own_turn),
            "force": self.pair(p, f"n{p + 1}", force[:, p]),
        }
        slow = {"hours": steps.hours} | slow_quantities(steps.hours, steps.temperature)
        for name, values in slow.items():
            pairs[name] = self.pair(p, name, values)
            pairs[f"{name} rate"] = self.pair(p, name, values, rate, own_rate)
            pairs[f"{name} acceleration"] = self.pair(p, name, values, turn, own_turn)
        for q in range(3):
            if q != p:
                pairs[f"{q} rate"] = self.pair(p, f"w{q + 1}", steps.rate[:, q])
                pairs[f"{q} force"] = self.pair(p, f"n{q + 1}", force[:, q])
        for i, j in combinations(range(3), 2):
            pairs[f"{i}{j} rate"] = self.pair(p, f"w{i + 1} w{j + 1}", steps.rate[:, i] * steps.rate[:, j])
            pairs[f"{i}{j} force"] = self.pair(p, f"n{i + 1} n{j + 1}", force[:, i] * force[:, j])
        return pairs

    def pair(self, p: int, name: str, values: NDArray, factor: str = "", times: NDArray | float = 1.0) -> Pair:
        """Return one gyro's error as a function of values (R,), times a factor (R,)."""
        fields: dict[str, Any] = {}
        if name == "hours":
            nodes = np.linspace(values.min(), values.max(), NODES_OF_TIME)
            fields["waves"] = True
            if not factor:
                fields["moves"] = self.moves
        else:
            nodes = np.linspace(values.min(), values.max(), NODES)
            if nodes[0] < 0.0 < nodes[-1]:
                # The function is zero at rest: a node there is exact.
                nodes[np.abs(nodes).argmin()] = 0.0
        spread = OnNodes(self, p, nodes, values, times)
        return Pair(GYROS[p], name, nodes, spread, GYROS[p], factor, anything=True, missed=spread.missed, **fields)


@dataclass(frozen=True, eq=False)
class OnNodes:
    """Map from values of a function at nodes (n,) of a quantity to the rows of evidence, for one gyro `p`."""

    of: GyroPairs
    p: int
    nodes: Floats
    values: Floats
    times: Floats | float

    def __call__(self, functions: Floats) -> Floats:
        """Return rows (M, K) of functions (n, K)."""
        return self.matrix @ functions

    @cached_property
    def matrix(self) -> Floats:
        """Rows (M, n) over their bounds of a unit at each node."""
        return self._over_bounds(self.of.observation.on_knots(self.nodes, self.values, self.times, self.p))

    def missed(self, knots: Floats) -> Floats:
        """Return the error of rows (M,) over their bounds, for a function whose slope changes by one in all.

        The rows compared are those of a function that is straight between knots (k,) and has the same values there. At
        x between two knots a and b the two differ by (x - a)(b - x)/(b - a) at most, per unit of change between them.
        """
        after = np.clip(np.searchsorted(knots, self.values), 1, len(knots) - 1)
        low, high = knots[after - 1], knots[after]
        apart = np.abs(self.times) * np.maximum(0.0, (self.values - low) * (high - self.values)) / (high - low)
        # All steps of a piece may differ in the same sense, and so may the mean at rest that is removed.
        largest = self.of.observation.largest.of_functions(((after - 1, apart),), len(knots), self.p)
        return self._over_bounds(largest).max(axis=1, initial=0.0)

    def _over_bounds(self, columns: Sequence[NDArray]) -> Floats:
        """Return columns (S, d, K) of each group as rows (M, K) over their bounds."""
        pairs = zip(columns, self.of.bounds, strict=True)
        return np.concatenate([rows_over(columns_of_group, bound) for columns_of_group, bound in pairs])


def pairs_of_accelerometers(parts: Sequence[Part], reference: Gravity, x: NDArray, attitude: NDArray) -> Iterator[Pair]:
    """Yield each accelerometer with every quantity of its rests, where gravity is the reference.

    `x` are their nine parameters; the attitude (N, 4) was carried.
    """
    n, rests = inputs_of(x, reference.reading), reference.rests
    hours = (rests.time_s - rests.time_s[0]) / 3600.0
    slow = {"hours": hours} | slow_quantities(hours, rests.temperature)
    inputs, products = inputs_and_products(n)
    of_readings = reference.of_readings(x, attitude)

    def of_accelerometer(p: int, factor: NDArray | float = 1.0) -> Spread:
        """Return the changes of rows by functions (K, k) of one accelerometer's readings, times a factor (K,)."""

        def spread(functions: NDArray) -> Floats:
            added = np.reshape(factor, (-1, 1)) * functions
            return np.concatenate(
                [rows_over(of_readings[part.label].of_accelerometer(p, added), part.bound) for part in parts]
            )

        return spread

    for p, place in enumerate(ACCELEROMETERS):
        for name, values in (inputs | slow | products).items():
            yield Pair(place, name, values, of_accelerometer(p), place)
        for name, values in slow.items():
            yield Pair(place, name, values, of_accelerometer(p, n[:, p]), place, f"n{p + 1}")
