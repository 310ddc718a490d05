"""Places and quantities of a table with a block: what may depend on what, whatever the law."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import Rows
from ...models.effects.definition import ACCELEROMETERS
from ..bounded.programmes import column_space
from .bench_travel import Travel
from .carried_pairs import NODES_OF_TIME, GyroPairs
from .observation import Group, Observation, OnKnots
from .pairs import TURN, Pair, Spread
from .rows import Pieces

AROUND = 144
"""Nodes of a function of an angle of the whole bench: knots of all pieces round a circle are among them."""
BLUR = 2e-3
"""Of functions on nodes, and of turns between rows that are looked at, about so much is not exact."""
ROOM_TEMPERATURE = 20.0
"""[degC]"""


def pairs_of_bench(rows: Rows) -> Iterator[Pair]:
    """Each accelerometer, turn and tilt of the table with every quantity of the record's rows."""
    for p, place in enumerate(ACCELEROMETERS):
        yield from _of_accelerometer(p, place, rows, slow_of(rows))
    yield from _of_table(rows)


def slow_of(rows: Rows) -> dict[str, NDArray[np.float64]]:
    """Time and temperature (N,), where they change."""
    found = {"hours": rows.hours} | ({} if rows.temperature is None else {"temperature": rows.temperature})
    return {name: values for name, values in found.items() if np.ptp(values) > 0.0}


def _of_accelerometer(p: int, place: str, rows: Rows, slow: dict[str, NDArray]) -> Iterator[Pair]:
    """What one accelerometer's error may depend on."""
    inputs = {f"n{k + 1}": rows.n[:, k] for k in range(3)}
    own = f"n{p + 1}"
    for name, values in (inputs | slow).items():
        yield Pair(place, name, values, _on(p, rows), place)
    for name, angle in (("alpha", rows.alpha), ("beta", rows.beta)):
        yield Pair(place, name, angle, _on(p, rows), place, circle=True)
    for one, other in combinations(inputs, 2):
        yield Pair(place, f"{one} {other}", inputs[one] * inputs[other], _on(p, rows), place)
    if rows.input_sense[:, p].any():
        yield Pair(place, "sense", rows.input_sense[:, p], _on(p, rows), place, told=True)
    for name, values in slow.items():
        # A factor counts from where it is zero: what it does there is nothing.
        zero = values - (ROOM_TEMPERATURE if name == "temperature" else 0.0)
        yield Pair(place, name, values, _on(p, rows, inputs[own]), place, own)
        yield Pair(place, own, inputs[own], _on(p, rows, zero / np.abs(zero).max()), place, name)


@dataclass(frozen=True)
class Way:
    """A way in which the table acts: small turns, of four as of `models.effects`, as functions of a quantity."""

    where: str
    quantity: str
    turn: int
    freedom: str
    factor: str = ""

    @staticmethod
    def every(rows: Rows) -> "Iterator[Way]":
        """All of which rows have the quantity."""
        axes = (("outer-axis", "alpha", rows.sense_alpha), ("inner-axis", "beta", rows.sense_beta))
        for k, (place, angle, sense) in enumerate(axes):
            yield Way(place, angle, 2 * k + 1, f"{place} turn")
            yield Way(place, angle, 2 * k, f"{place} tilt", "tilt")
            if sense.any():
                yield Way(place, "sense", 2 * k + 1, f"{place} turn")
            for when in slow_of(rows):
                yield Way(place, when, 2 * k + 1, f"{place} turn")
                yield Way(place if k else "base", when, 2 * k, f"{place} tilt", "tilt")
        # An inner axis that wobbles tilts about the outer axis, too; elastic turns grow with the load across the axis.
        yield Way("inner-axis", "beta", 1, "outer-axis turn", "outer tilt")
        yield Way("inner-axis", "beta", 3, "inner-axis turn", "sin alpha")

    @property
    def circle(self) -> bool:
        """Whether the quantity is an angle."""
        return self.quantity in ("alpha", "beta")

    def values(self, rows: Rows) -> NDArray[np.float64]:
        """The quantity (N,)."""
        name = (
            f"sense_{'alpha' if self.where == 'outer-axis' else 'beta'}" if self.quantity == "sense" else self.quantity
        )
        return np.asarray(getattr(rows, name))

    def slope(self, rows: Rows, axes: Sequence[NDArray]) -> NDArray[np.float64]:
        """What a unit does (N, 3), by what each of the four small turns does (N, 3)."""
        own = axes[self.turn]
        return own * np.sin(rows.alpha)[:, None] if self.factor == "sin alpha" else own

    def pair(self, values: NDArray, spread: Spread) -> Pair:
        """A pair at values (n,) of the quantity."""
        own = (self.freedom, self.factor, self.circle, self.quantity == "sense")
        return Pair(self.where, self.quantity, values, spread, *own)


def _of_table(rows: Rows) -> Iterator[Pair]:
    """What turns and tilts of the table's axes may depend on."""
    turns = rows.by_kappa, rows.by_alpha, rows.by_epsilon, rows.by_beta
    for way in Way.every(rows):
        yield way.pair(way.values(rows), _by(way.slope(rows, turns)))


def _on(p: int, rows: Rows, factor: NDArray | float = 1.0) -> Spread:
    """Functions (N, K), times a factor (N,), on the readings (3 N, K) of one accelerometer."""
    times = np.zeros(rows.n.shape)
    times[:, p] = factor
    return _by(times)


def _by(slope: NDArray) -> Spread:
    """Functions (N, K) on readings (3 N, K) that change by a slope (N, 3) with it."""
    return lambda functions: (slope[:, :, None] * functions[:, None, :]).reshape(slope.size, -1)


# A whole bench: what its gyros integrate stands behind the readings.


def pairs_of_whole(read: Rows, travel: Travel, bound: NDArray, nominal: NDArray) -> Iterator[Pair]:
    """Accelerometers and the table with every quantity of readings, the table with gyros as a second witness; gyros.

    `bound` (M,) of readings and integrals; `nominal` (M, P) the model over it.
    """
    base = column_space(nominal)
    readings = bound[: read.n.size]
    for p, place in enumerate(ACCELEROMETERS):
        for pair in _of_accelerometer(p, place, read, slow_of(read)):
            yield replace(pair, spread=_above(pair.spread, readings, len(bound)))
    for way in Way.every(read):
        yield _imitated(_of_both(way, read, travel, bound), base)
    # Readings say nothing of the gyros.
    nowhere = np.zeros(len(read.hours), dtype=int)
    still = Group(Pieces("rests", "readings", nowhere, nowhere), np.zeros((len(read.hours), 3, 3)))
    observation = Observation((still, *travel.gyros.groups), travel.gyros.adds)
    bounds = [readings.reshape(-1, 3), bound[read.n.size :].reshape(-1, 3)]
    every = GyroPairs(travel.motion, observation, bounds).pairs()
    for pair in every:
        alone = _imitated(pair, base)
        yield replace(alone, members=tuple(_imitated(own, base) for own in pair.members))


def _above(spread: Spread, bound: NDArray, count: int) -> Spread:
    """What is spread on readings, over their bounds, with zeros behind up to a count of rows."""

    def spread_on_all(functions: NDArray) -> NDArray[np.float64]:
        own = spread(functions) / bound[:, None]
        return np.vstack([own, np.zeros((count - len(own), own.shape[1]))])

    return spread_on_all


def _of_both(way: Way, read: Rows, travel: Travel, bound: NDArray) -> Pair:
    """A way of the table, on readings and integrals alike."""
    seen, here, there = travel.rows, way.values(read), way.values(travel.rows)
    if way.circle:
        nodes = TURN * np.arange(AROUND + 1) / AROUND
    elif way.quantity == "sense":
        nodes = np.array([-1.0, 0.0, 1.0])
    else:
        both = np.append(here, there)
        nodes = np.linspace(both.min(), both.max(), NODES_OF_TIME)
    turns = read.by_kappa, read.by_alpha, read.by_epsilon, read.by_beta

    @cache
    def matrix() -> NDArray[np.float64]:
        functions = OnKnots(nodes, circle=way.circle)
        on_readings = _by(way.slope(read, turns))(functions.at(here))
        on_turns = travel.turned(functions, there, way.slope(seen, list(travel.axes)))
        return np.vstack([on_readings, on_turns]) / bound[:, None]

    pair = way.pair(nodes[:AROUND] if way.circle else nodes, lambda functions: matrix() @ functions)
    return replace(pair, anything=True)


def _imitated(pair: Pair, base: NDArray) -> Pair:
    """A pair whose constant, straight line or wave is wholly within the model's space (M, P), where it nearly is.

    On nodes, and between rows that are looked at, functions are not exact: what is left of these is no function.
    """
    values = pair.values
    if pair.told:
        return pair
    plain = [np.cos(values), np.sin(values)] if pair.circle else [values]
    plain = np.linalg.qr(np.stack([np.ones(len(values)), *plain], axis=1))[0]

    @cache
    def inexact() -> NDArray[np.float64]:
        columns = pair.spread(plain)
        left = columns - base @ (base.T @ columns)
        _, sizes, directions = np.linalg.svd(left, full_matrices=False)
        near = directions[sizes <= BLUR * np.linalg.norm(columns @ directions.T, axis=0)]
        return (left @ near.T) @ (plain @ near.T).T

    return replace(pair, spread=lambda functions: pair.spread(functions) - inexact() @ functions)
