"""The greatest size that a fault of a class can have and be hidden in a record: its power, whatever the record."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.effects.definition import AXES
from ..bounded.functions import Unknown, imitated
from ..bounded.possible import DETERMINED, Possible
from ..bounded.programmes import column_space
from ..result import finite_or_none
from .pairs import GYROS, Form, Pair

PIECES, SECTORS = 6, 8
"""Pieces of a function over the range of a quantity, and round a circle."""
INPUTS = ("n1", "n2", "n3")
LARGEST = 1.0
"""Of a fault: one g, one radian, one rad/s, or its factor itself. What larger ones alone would show says nothing."""


@dataclass(frozen=True)
class Power:
    """The size [unit] from which on every fault of a pair falsifies the model, whatever the noise; infinite: none."""

    pair: Pair
    size: float

    @property
    def unit(self) -> str:
        """Of the function's values; times a time or a temperature that is one at its largest."""
        if self.pair.where in GYROS:
            return {"w": "1", "d": "s"}.get(self.pair.factor[:1], "rad/s")
        if self.pair.factor in INPUTS:
            return "1"
        if self.pair.where in AXES or self.pair.where == "base":
            return "rad"
        return "g"

    @property
    def entry(self) -> dict[str, Any]:
        """As results write it: ``place``, ``quantity``, where there is one ``factor``, ``size``, ``unit``."""
        entry: dict[str, Any] = {"place": self.pair.where, "quantity": self.pair.quantity}
        if self.pair.factor:
            entry["factor"] = self.pair.factor
        entry["size"] = finite_or_none(self.size) if self.size <= LARGEST else None
        entry["unit"] = self.unit
        return entry


def largest_hidden(columns: NDArray, counted: NDArray, room: NDArray) -> float:
    """The greatest size that some fault of a class can have and be hidden; columns and what counts as of `class_of`."""
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
    """The power against each pair of one place, of rows with the derivatives (M, P) of the model.

    The class is over the range that the record has of the quantity, and the model imitates what it imitates in this
    record. `room` (M,): how far errors and residuals of a model that stands may be from each other.
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
