"""From which size on a fault that no catalogue lists would have shown: the power of a record of rests.

A fault at a place is an unknown function of one quantity, perhaps times a known factor. The class that is judged: all
functions that are straight between knots, `PIECES` equal pieces over the range that was measured and `SECTORS` round a
circle. Where the model imitates some of them (a constant is a bias, of α a wave is a tilt), what is left beyond those
counts: the function's size is the largest of its values at the knots, less the least-squares fit to them of what the
model can imitate anywhere on the bench. A fault of size s is v with max |P v| = s, and is hidden by some noise and some
parameters x as long as |J x + S v| ≤ (1 + limit) bounds: from the greatest such s on every fault of the class
falsifies the model, whatever the noise. One linear programme for each knot finds it, so that it is exact.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace, Rows
from ...models.effects.definition import ACCELEROMETERS, AXES
from ...models.effects.lookup import TILT, values_of
from ..bounded.programmes import Possible, column_space
from ..calibration.model import Parametrisation, Positions, reading_jacobian
from .bench_predictions import DenseVisits
from .bench_visits import Circumstances, Visits, signature_columns

PIECES, SECTORS = 6, 8
"""Pieces of a function over the range of a quantity, and round a circle."""
FINER = 4
"""Functions that the model imitates are sought with so many times as many pieces."""
IMITATED = 2e-3
"""Part of a function's sum of squares that may be left of one that the model imitates: what knots cannot follow."""
SCATTERED = 600
"""Positions, for each mounting, at which it is judged what the model imitates."""
OWN = 0.05
"""So much of a function is its own beside others."""
LARGEST_INPUT = 1.01
"""Of an accelerometer [g], that of a bench with errors."""
LEAST = 1e-9
"""What is smaller, relatively, is rounding."""
TURN = 2.0 * np.pi
INPUTS = ("n1", "n2", "n3")
ANGLES = ("alpha", "beta")


@dataclass(frozen=True)
class Pair:
    """A place, the quantity of which a fault there is an unknown function, and what that function is multiplied by."""

    where: str
    quantity: str
    factor: str = ""

    def at(self, knots: NDArray) -> EffectPlace:
        """The table of such a function with these knots."""
        kind = "around" if self.quantity in ANGLES else "at"
        factor = f"{self.factor} times " if self.factor else ""
        return EffectPlace("lookup", self.where, law=f"{factor}{self.quantity} {kind} {' '.join(map(repr, knots.tolist()))}")

    def knots(self, values: NDArray, finer: int = 1) -> NDArray[np.float64]:
        """Knots (K,) over the range of values (N,), or round the circle."""
        if self.quantity in ANGLES:
            return TURN * np.arange(finer * SECTORS) / (finer * SECTORS)
        low, high = (-LARGEST_INPUT, LARGEST_INPUT) if self.quantity in INPUTS else (values.min(), values.max())
        return np.linspace(low, high, finer * PIECES + 1)

    @property
    def unit(self) -> str:
        """Of the function's values."""
        return "rad" if self.where in AXES else "1" if self.factor in INPUTS else "g"


def pairs_of(rows: Rows) -> Iterator[Pair]:
    """The pairs that a record can say something of: places with the quantities that vary in it."""
    passing = [q for q in ("hours", "temperature") if _varies(q, rows)]
    for k, where in enumerate(ACCELEROMETERS):
        yield from (Pair(where, quantity) for quantity in (*INPUTS, *ANGLES, *passing))
        yield from (Pair(where, quantity, INPUTS[k]) for quantity in passing)
    for where, angle in zip(AXES, ANGLES, strict=True):
        yield from (Pair(where, angle, factor) for factor in ("", TILT))
        yield from (Pair(where, quantity) for quantity in passing if quantity == "hours")


def _varies(quantity: str, rows: Rows) -> bool:
    return getattr(rows, quantity) is not None and float(np.ptp(values_of(quantity, rows))) > 0.0


def scattered(p: Parametrisation) -> DenseVisits:
    """Positions, times and temperatures scattered evenly, with every mounting, of a faultless bench."""
    index = np.arange(SCATTERED * len(p.mountings))
    # Multiples of irrational numbers, unrelated: no angle, no input comes twice.
    alpha, beta, time, temperature = (index * step % 1.0 for step in (0.754878, 0.569840, 0.618034, 0.414214))
    at, point = Positions(TURN * alpha, TURN * beta, index % len(p.mountings)), np.zeros(len(p.symbols))
    visits = Visits(p, at, Circumstances(time, temperature, 0.0 * time, 0.0 * time, True))
    return DenseVisits(visits.rows(point), column_space(reading_jacobian(p, point, at).reshape(3 * len(index), -1)))


def beyond_imitated(pair: Pair, dense: DenseVisits, knots: NDArray) -> NDArray[np.float64]:
    """The matrix (K, K) that takes off values at knots what fits them of functions that the model imitates anywhere."""
    exact = _imitated(pair, dense, 1, LEAST)
    fine = pair.knots(values_of(pair.quantity, dense.rows), FINER)
    near = _imitated(pair, dense, FINER, IMITATED)
    if pair.quantity in ANGLES:
        fine, near = np.append(fine, TURN), np.vstack((near, near[:1]))
    own = np.linspace(fine[0], fine[-1], len(knots)) if pair.quantity not in ANGLES else knots
    values = np.array([np.interp(own, fine, one) for one in near.T]).reshape(-1, len(knots)).T
    base = column_space(exact)
    sizes = np.linalg.norm(values, axis=0)
    more, parts, _ = np.linalg.svd((values - base @ (base.T @ values)) / sizes, full_matrices=False)
    base = np.hstack((base, more[:, parts > OWN]))
    return np.eye(len(knots)) - base @ base.T


def _imitated(pair: Pair, dense: DenseVisits, finer: int, most: float) -> NDArray[np.float64]:
    """Functions (K, d) of a class of which at most such a part of the sum of squares is left beside the model."""
    columns = signature_columns([pair.at(pair.knots(values_of(pair.quantity, dense.rows), finer))], dense.rows)
    left = columns - dense.bench @ (dense.bench.T @ columns)
    sizes, turned = np.linalg.eigh(columns.T @ columns)
    whitened = turned / np.sqrt(np.maximum(sizes, LEAST * sizes.max()))
    parts, functions = np.linalg.eigh(whitened.T @ (left.T @ left) @ whitened)
    return (whitened @ functions)[:, parts < most]


@dataclass(frozen=True)
class Power:
    """The size [unit] from which on every fault of a pair falsifies the model, whatever the noise; infinite: none does."""

    pair: Pair
    size: float


def powers(rows: Rows, dense: DenseVisits, jacobian: NDArray, bound: NDArray) -> list[Power]:
    """The power against each pair, of readings (M,) = (3 N,) with the derivatives (M, P) of the model at the rows.

    `bound` (M,) is what errors and fit may be away from each other together [g].
    """
    found = []
    for pair in pairs_of(rows):
        knots = pair.knots(values_of(pair.quantity, rows))
        columns = signature_columns([pair.at(knots)], rows)
        possible = Possible(np.hstack((jacobian, columns)), np.zeros(len(bound)), bound)
        free = np.zeros(jacobian.shape[1])
        told = beyond_imitated(pair, dense, knots)
        reached = [possible.reach(np.append(free, one)) for one in told if np.abs(one).max() > LEAST]
        found.append(Power(pair, max(reached, default=np.inf)))
    return found
