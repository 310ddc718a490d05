"""A single reading that went wrong: it marks a row and has no kernel."""

import numpy as np
from numpy.typing import NDArray

from .definition import Effect, EffectParameter, EffectPlace, said
from .rows import Rows


def place_of(position: int, accelerometer: int) -> EffectPlace:
    """The place of an outlier: the row's index from 1 in the record, and the accelerometer from 1."""
    return EffectPlace("outlier", f"position-{position}", axes=(accelerometer,))


def signature(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """One at one reading; the row is counted from 1 within `rows`."""
    columns = np.zeros((len(rows.alpha), 3, 1))
    columns[int(place.where.removeprefix("position-")) - 1, place.axes[0] - 1, 0] = 1.0
    return columns


EFFECT = Effect(
    name="outlier",
    places=(),
    parameters=(EffectParameter("size", "g", "by how much the reading is off", 10.0),),
    signature=signature,
    sentence=said("the reading of accelerometer {i} at {axis} is off by {size:+.2e} g"),
    formula="Δf_{i}/g = {size} 'at position' {p}",
)
