"""The ways in which an effect that is not linear in its parameters can act on the readings of a record."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..arrays import Bools, Floats, Ints
from .columns import Rows


@dataclass(frozen=True)
class Variant:
    """One way in which an effect that is not linear in its parameters can act on N rows: the readings that it changes.

    Within a variant the effect is linear: the prediction gains ``offset + columns @ coefficients``.

    Attributes
    ----------
    offset : (N, 3)
        addition to the prediction of the nominal model [g]
    columns : (N, 3, K)
        derivatives by the K remaining coefficients; K may be 0
    widening : (N, 3)
        growth of the bounds of the readings [g]
    low, high : (K,)
        limits of the coefficients
    values : callable
        K coefficients -> values of the parameters
    limits : tuple of (low, high)
        for each parameter, the values with which the effect acts in this way
    lost : (N, 3) of bool
        readings to which the accelerometer's own input adds nothing, with its derivatives by the bench's parameters
    fixed : (N, 3) of bool
        readings that do not depend on the bench at all
    stands : callable
        rows at another fit (with `own` and `prediction` of the nominal part), coefficients -> True if the effect would
        change exactly these readings there
    mixed : (N, 3, 3) or None
        matrix of exchanged channels, times the three readings; None if they are not exchanged
    undecided : callable
        other rows, σ [g] -> (N, 3) of bool: readings whose change the limits of the parameters leave open
    """

    offset: Floats
    columns: Floats
    widening: Floats
    low: Floats
    high: Floats
    values: Callable[[Floats], tuple[float, ...]]
    limits: tuple[tuple[float, float], ...]
    lost: Bools
    fixed: Bools
    mixed: Floats | None = None
    stands: Callable[[Rows, Floats], bool] = lambda rows, coefficients: True
    undecided: Callable[[Rows, float], Bools] = lambda rows, sigma: np.zeros(rows.n.shape, dtype=bool)

    one_sign: ClassVar[bool] = False
    """True if its coefficients all have one sign."""

    @property
    def directions(self) -> Floats:
        """The coefficients, which are the first of the parameters."""
        return np.eye(self.columns.shape[2])

    @property
    def touched(self) -> Bools:
        """Readings (N, 3) that the effect changes, beside a widening of their bounds."""
        changed = self.lost | self.fixed | (self.offset != 0.0) | np.any(self.columns != 0.0, axis=2)
        return changed if self.mixed is None else changed | np.any(self.mixed != np.eye(3), axis=2)


def variant(shape: tuple[int, ...], limits: tuple[tuple[float, float], ...], **fields: Any) -> Variant:
    """Return a variant on readings (N, 3) that by default adds nothing, widens nothing and has no coefficients.

    The values of the parameters are the middles of their limits; `fields` are the ones that differ.
    """
    none = np.zeros(shape, dtype=bool)
    middles = tuple(0.5 * (low + high) for low, high in limits)
    usual = {
        "offset": np.zeros(shape),
        "columns": np.zeros((*shape, 0)),
        "widening": np.zeros(shape),
        "low": np.zeros(0),
        "high": np.zeros(0),
        "values": lambda coefficients: middles,
        "lost": none,
        "fixed": none,
    }
    return Variant(limits=limits, **(usual | fields))


def at_readings(shape: tuple[int, ...], rows: Ints, accelerometer: int) -> Bools:
    """Return True (N, 3) at some rows (n,) of an accelerometer, 0 to 2."""
    chosen = np.zeros(shape, dtype=bool)
    chosen[rows, accelerometer] = True
    return chosen
