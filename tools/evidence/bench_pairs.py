"""Places and quantities of a table with a block: what may depend on what, whatever the law."""

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ...models.effects import Rows
from ...models.effects.definition import ACCELEROMETERS
from .pairs import Pair, Spread

ROOM_TEMPERATURE = 20.0
"""[degC]"""


def pairs_of_bench(rows: Rows) -> Iterator[Pair]:
    """Each accelerometer, turn and tilt of the table with every quantity of the record's rows."""
    slow = {"hours": rows.hours}
    if rows.temperature is not None:
        slow["temperature"] = rows.temperature
    slow = {name: values for name, values in slow.items() if np.ptp(values) > 0.0}
    for p, place in enumerate(ACCELEROMETERS):
        yield from _of_accelerometer(p, place, rows, slow)
    yield from _of_table(rows, slow)


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


def _of_table(rows: Rows, slow: dict[str, NDArray]) -> Iterator[Pair]:
    """What turns and tilts of the table's axes may depend on."""
    axes = (
        ("outer-axis", "alpha", rows.alpha, rows.by_alpha, rows.by_kappa, rows.sense_alpha),
        ("inner-axis", "beta", rows.beta, rows.by_beta, rows.by_epsilon, rows.sense_beta),
    )
    for place, name, angle, by_turn, by_tilt, sense in axes:
        yield Pair(place, name, angle, _by(by_turn), f"{place} turn", circle=True)
        yield Pair(place, name, angle, _by(by_tilt), f"{place} tilt", "tilt", circle=True)
        if sense.any():
            yield Pair(place, "sense", sense, _by(by_turn), f"{place} turn", told=True)
        for when, values in slow.items():
            yield Pair(place, when, values, _by(by_turn), f"{place} turn")
            yield Pair("base" if place == "outer-axis" else place, when, values, _by(by_tilt), f"{place} tilt", "tilt")
    # An inner axis that wobbles tilts about the outer axis, too; elastic turns grow with the load across the axis.
    yield Pair("inner-axis", "beta", rows.beta, _by(rows.by_alpha), "outer-axis turn", "outer tilt", circle=True)
    load = rows.by_beta * np.sin(rows.alpha)[:, None]
    yield Pair("inner-axis", "beta", rows.beta, _by(load), "inner-axis turn", "sin alpha", circle=True)


def _on(p: int, rows: Rows, factor: NDArray | float = 1.0) -> Spread:
    """Functions (N, K), times a factor (N,), on the readings (3 N, K) of one accelerometer."""
    times = np.zeros(rows.n.shape)
    times[:, p] = factor
    return _by(times)


def _by(slope: NDArray) -> Spread:
    """Functions (N, K) on readings (3 N, K) that change by a slope (N, 3) with it."""
    return lambda functions: (slope[:, :, None] * functions[:, None, :]).reshape(slope.size, -1)
