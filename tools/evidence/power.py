"""The power of a record of rests: the size from which a fault that no catalogue lists would have shown.

A fault at a place is an unknown function of one quantity, perhaps times a known factor. The judged class holds all
functions that are straight between knots, of `PIECES` equal pieces over the range of the quantity, of `SECTORS` round a
circle. The model imitates some of them (a constant is a bias, a wave of α is a tilt); only the rest counts. The size of
a function with values v at the knots is max |P v|, where P subtracts from v its least-squares fit by all functions that
the model imitates anywhere on the bench.

Some noise and some parameters x hide a fault v as long as |J x + S v| nowhere exceeds the largest possible sum of
errors and residuals. Every fault of the class larger than the largest hidden one falsifies the model, for any noise.
One linear programme for each knot finds that size exactly: of any smaller size some fault can hide.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Floats
from ...models.effects import Rows
from ...models.effects.definition import AXES
from ...models.effects.mounting import MOUNTING
from ..bounded.functions import Unknown, imitated
from ..bounded.possible import DETERMINED, Possible
from ..bounded.programmes import column_space
from ..calibration.model import Parametrisation, Positions, parametrise, reading_jacobian
from ..result import finite_or_none
from .bench_visits import Circumstances, Visits
from .dependences import pairs_of_bench
from .pairs import GYROS, TURN, Form, Pair

PIECES, SECTORS = 6, 8
"""Pieces of a function over the range of a quantity, and round a circle."""
INPUTS = ("n1", "n2", "n3")
LARGEST = 1.0
"""Largest size of a fault: one g, one radian, one rad/s, or its factor itself. What larger ones alone would show says
nothing."""
LARGEST_INPUT = 1.01
"""Largest input of an accelerometer on a bench with errors [g]: the range of inputs has it at both ends."""
FINER = 4
"""Factor of the number of pieces for functions that the model imitates."""
IMITATED = 2e-3
"""Largest part of the sum of squares of a function that the model imitates and these pieces do not follow."""
OWN = 0.05
"""Least part of a function that others do not contain."""
SCATTERED = 300
"""Positions of each mounting that judge which functions the model imitates."""
LEAST = 1e-9
"""Relative size below which a value is rounding."""
Named = tuple[str, str, str]
"""Place, quantity and factor of a pair."""


@dataclass(frozen=True)
class Power:
    """Size [unit] from which every fault of a pair falsifies the model for any noise; infinite: never."""

    pair: Pair
    size: float

    @property
    def unit(self) -> str:
        """Unit of the function's values, times a time or temperature scaled to one at its largest."""
        if self.pair.where in GYROS:
            return {"w": "1", "d": "s"}.get(self.pair.factor[:1], "rad/s")
        if self.pair.factor in INPUTS:
            return "1"
        if self.pair.where in (*AXES, "base", MOUNTING):
            return "rad"
        return "g"

    @property
    def entry(self) -> dict[str, Any]:
        """The power as results write it: ``place``, ``quantity``, any ``factor``, ``size``, ``unit``."""
        entry: dict[str, Any] = {"place": self.pair.where, "quantity": self.pair.quantity}
        if self.pair.factor:
            entry["factor"] = self.pair.factor
        entry["size"] = finite_or_none(self.size) if self.size <= LARGEST else None
        entry["unit"] = self.unit
        return entry


def largest_hidden(columns: NDArray, counted: NDArray, room: NDArray) -> float:
    """Return the largest size of a hidden fault of a class; columns and counted values as of `class_of`."""
    possible = Possible(columns, np.zeros(len(room)), room)
    # Weights that give a value bound it; those of least squares are at hand.
    weights = counted / possible.scale @ possible.span @ np.linalg.pinv(possible.matrix / room[:, None])
    missed = np.abs(weights @ (columns / room[:, None]) - counted).max(axis=1)
    ceilings = np.where(missed > DETERMINED, np.inf, np.abs(weights).sum(axis=1))
    largest = 0.0
    for k in np.argsort(-ceilings, kind="stable"):
        if ceilings[k] > largest:
            largest = max(largest, possible.reach(counted[k]))
    return largest


def powers_of_record(pairs: Sequence[Pair], nominal: NDArray, room: NDArray) -> Iterator[Power]:
    """Yield the power against each pair of one place, for rows with the derivatives (M, P) of the model.

    The class is over the record's range of the quantity, and the model imitates the same functions as in this record.
    `room` (M,) is the largest distance of errors and residuals in a consistent model.
    """
    base, form = column_space(nominal), Form("pieces", PIECES)
    for pair in pairs:
        if pair.members or not np.ptp(pair.values) > 0.0:
            continue
        columns = pair.columns(form)
        by_model = imitated(base, columns, Unknown(form.knots(pair.values), columns))
        beyond = np.eye(PIECES + 1) - by_model @ by_model.T
        counted = np.hstack((np.zeros((PIECES + 1, nominal.shape[1])), beyond))
        yield Power(pair, largest_hidden(np.hstack((nominal, columns)), counted, room))


# Rests on a table


def judged_pairs(rows: Rows) -> Iterator[Pair]:
    """Return the judged pairs of rows: those whose quantity has a range, except turns of the block."""
    return (pair for pair in pairs_of_bench(rows) if not pair.told and pair.where != MOUNTING)


def powers(rows: Rows, p: Parametrisation, jacobian: NDArray, room: NDArray) -> tuple[Power, ...]:
    """Return the power against each pair, for readings at rows with the derivatives (M, P) of the model.

    `room` (M,) is the largest distance of errors and residuals in a consistent model [g].
    """
    return tuple(Power(pair, largest_hidden(*class_of(pair, p, jacobian), room)) for pair in judged_pairs(rows))


def class_of(pair: Pair, p: Parametrisation, jacobian: NDArray) -> tuple[NDArray, NDArray]:
    """Return derivatives (M, P + K) by the parameters and the values at the knots, and the counted part (k, P + K)."""
    key = pair.where, pair.quantity, pair.factor
    beyond = _beyond_the_model(key, np.ascontiguousarray(p.matrices).tobytes(), p.symmetric)
    beyond = beyond[np.abs(beyond).max(axis=1) > LEAST]
    columns = pair.spread(_hats(pair, 1, pair.values))
    counted = np.hstack((np.zeros((len(beyond), jacobian.shape[1])), beyond))
    return np.hstack((jacobian, columns)), counted


def _hats(pair: Pair, finer: int, values: NDArray) -> Floats:
    """Return functions (n, K) of the class, or of a finer one, each one at a single knot, at values (n,)."""
    if pair.circle:
        return Form("around", finer * SECTORS).columns(values)
    ends = _range(pair)
    return Form("pieces", finer * PIECES).columns(np.append(values, ends))[: len(values)]


def _range(pair: Pair) -> Floats:
    """Return the ends (2,) of a quantity other than an angle: those of inputs, else those of the rows."""
    names = pair.quantity.split()
    if set(names) <= set(INPUTS):
        largest = LARGEST_INPUT ** len(names) / len(names)
        return np.array([-largest, largest])
    return np.array([pair.values.min(), pair.values.max()])


def _knots(pair: Pair, finer: int) -> Floats:
    """Return the knots (K,) between the pieces."""
    if pair.circle:
        return TURN * np.arange(finer * SECTORS) / (finer * SECTORS)
    low, high = _range(pair)
    return np.linspace(low, high, finer * PIECES + 1)


@lru_cache(maxsize=8)
def _scattered(matrices: bytes, symmetric: bool) -> tuple[dict[Named, Pair], Floats]:
    """Pairs at positions, times and temperatures scattered evenly over a faultless bench; the model's space (M, P)."""
    every = np.frombuffer(matrices).reshape(-1, 3, 3)
    names = map(str, range(len(every)))
    p = parametrise(dict(zip(names, every, strict=True)), symmetric=symmetric)
    index = np.arange(SCATTERED * len(every))
    # Multiples of irrational numbers, unrelated: no angle and no input comes twice.
    alpha, beta = index * 0.754878 % 1.0, index * 0.569840 % 1.0
    time, temperature = index * 0.618034 % 1.0, index * 0.414214 % 1.0
    at, point = Positions(TURN * alpha, TURN * beta, index % len(every)), np.zeros(len(p.symbols))
    visits = Visits(p, at, Circumstances(time, 20.0 + temperature, 0.0 * time, 0.0 * time, True))
    space = column_space(reading_jacobian(p, point, at).reshape(3 * len(index), -1))
    pairs = {}
    for pair in judged_pairs(visits.rows(point)):
        pairs[pair.where, pair.quantity, pair.factor] = pair
    return pairs, space


@lru_cache(maxsize=512)
def _beyond_the_model(name: Named, matrices: bytes, symmetric: bool) -> Floats:
    """Return the matrix P (K, K) that subtracts from values at the knots their fit by imitated functions."""
    pairs, space = _scattered(matrices, symmetric)
    pair = pairs[name]
    knots, fine = _knots(pair, 1), _knots(pair, FINER)
    # Functions within the class are subtracted exactly, a wave by its values at the knots.
    base = column_space(_imitated(pair, space, 1, LEAST))
    near = _imitated(pair, space, FINER, IMITATED)
    if pair.circle:
        fine, near = np.append(fine, TURN), np.vstack((near, near[:1]))
    values = np.array([np.interp(knots, fine, function) for function in near.T]).reshape(-1, len(knots)).T
    values = values / np.linalg.norm(values, axis=0)
    functions, parts, _ = np.linalg.svd(values - base @ (base.T @ values), full_matrices=False)
    base = np.hstack((base, functions[:, parts > OWN]))
    return np.eye(len(knots)) - base @ base.T


def _imitated(pair: Pair, space: NDArray, finer: int, most: float) -> Floats:
    """Return the functions (K, d) that the model imitates, except for a given part of the sum of squares."""
    columns = pair.spread(_hats(pair, finer, pair.values))
    remainder = columns - space @ (space.T @ columns)
    sizes, turned = np.linalg.eigh(columns.T @ columns)
    whitened = turned / np.sqrt(np.maximum(sizes, LEAST * sizes.max()))
    parts, functions = np.linalg.eigh(whitened.T @ (remainder.T @ remainder) @ whitened)
    return (whitened @ functions)[:, parts < most]
