"""Display of a field of a result: its name for a person, its unit, and the promise of its rounded number.

A field says it in its type: ``radius: Annotated[float, Quantity("largest residual", "σ", "residual")]``. Tables for
pages and terminals are made from these (`document.tables`).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from pydantic import BaseModel

from .rounding import Number, digits, downwards, exactly, interval, residual, to_bound, upwards

DEGREES = math.degrees(1.0)
"""Degrees in a radian."""
Rounding = Literal[
    "nearest", "up", "down", "exact", "residual", "as it is", "estimate", "low", "high", "to the estimate's place"
]
"""Promise of a number: see `rounding`. The last four are rounded to the place of the row's interval."""


@dataclass(frozen=True)
class Quantity:
    """Display of a field.

    Attributes
    ----------
    title : str
        its name at the head of a column or before its value
    unit : str
        the unit in which it is shown; empty where it has none, or where the row has a column for it
    rounding : str
        promise of the number; "as it is" for texts and counts
    count : int or None
        significant digits, by default those of the rounding
    factor : float
        by which the field's number becomes one in the unit that is shown
    """

    title: str
    unit: str = ""
    rounding: Rounding = "as it is"
    count: int | None = None
    factor: float = 1.0

    @property
    def heading(self) -> str:
        """The head of its column: "largest [deg]"."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


ROUNDED = {"nearest": digits, "up": upwards, "down": downwards, "exact": exactly, "residual": residual}


@cache
def quantities_of(kind: type[BaseModel]) -> dict[str, Quantity]:
    """Return the quantities of a result's fields that have one, by the names of the fields, in their order.

    Those of its properties stand in its `derived`.
    """
    quantities: dict[str, Quantity] = dict(getattr(kind, "derived", {}))
    for name, field in kind.model_fields.items():
        for note in field.metadata:
            if isinstance(note, Quantity):
                quantities[name] = note
    return quantities


def cell_of(row: BaseModel, name: str, quantity: Quantity) -> Any:
    """Return a field of a result as a table shows it: a rounded number, or a text or count as it is."""
    value = getattr(row, name)
    if value is None or quantity.rounding == "as it is":
        return value
    if quantity.rounding in ROUNDED:
        options = () if quantity.count is None else (quantity.count,)
        return ROUNDED[quantity.rounding](quantity.factor * value, *options)
    return _at_the_place_of_the_interval(row, value, quantity.rounding)


def _at_the_place_of_the_interval(row: Any, value: float, rounding: Rounding) -> Number:
    """Round a number of an estimate with an interval; the row has `central`, `low`, `high`, `error_bound`, `place`."""
    if rounding == "to the estimate's place":
        return to_bound(value, row.place)
    estimate, low, high = interval(row.central, row.low, row.high, row.error_bound)
    return {"estimate": estimate, "low": low, "high": high}[rounding]


def cells_of(row: BaseModel, names: Sequence[str]) -> list[Any]:
    """Return some fields of a result as a table shows them."""
    quantities = quantities_of(type(row))
    return [cell_of(row, name, quantities[name]) for name in names]
