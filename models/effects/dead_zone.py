"""Dead zone: an accelerometer does not feel a small input."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import INPUT, Vector
from .definition import EffectParameter, EffectPlace, last_stage_effect
from .rows import Rows, Variant, at_readings, variant

LARGEST_WIDTH = 0.05


def dead_zone(context: Vector, own: Vector, p: int, width: float, reading: Vector) -> None:
    """Take from the reading of accelerometer p what its own input adds, where |n_p| is below the width."""
    if math.fabs(context[INPUT + p]) < width:
        reading[p] = reading[p] - own[p]


def variants(place: EffectPlace, rows: Rows, reading: NDArray[np.float64], sigma: float) -> list[Variant]:
    """Only the set of readings below the width matters: the smallest inputs, then the two smallest, and so on."""
    p = place.index
    size = np.abs(rows.n[:, p])
    order = np.argsort(size, kind="stable")
    found = []
    for count in range(1, int((size < LARGEST_WIDTH).sum()) + 1):
        chosen = np.sort(order[:count])
        below = float(size[order[count - 1]])
        above = min(LARGEST_WIDTH, float(size[order[count]])) if count < len(size) else LARGEST_WIDTH
        if above > below:
            found.append(_variant(p, rows, chosen, (below, above)))
    return found


def _variant(p: int, rows: Rows, chosen: NDArray[np.int_], limits: tuple[float, float]) -> Variant:
    lost = at_readings(rows.n.shape, chosen, p)

    def stands(there: Rows, coefficients: NDArray[np.float64]) -> bool:
        size = np.abs(there.n[:, p])
        inside = bool(size[chosen].max() < LARGEST_WIDTH)
        return inside and bool(size[chosen].max() < np.delete(size, chosen).min(initial=np.inf))

    def undecided(others: Rows, sigma: float) -> NDArray[np.bool_]:
        size = np.abs(others.n[:, p])
        return at_readings(others.n.shape, np.flatnonzero((size > limits[0] - sigma) & (size < limits[1] + sigma)), p)

    offset = np.where(lost, -rows.own, 0.0)
    return variant(rows.n.shape, (limits,), offset=offset, lost=lost, stands=stands, undecided=undecided)


EFFECT = last_stage_effect(
    dead_zone,
    EffectParameter("width", "g", "inputs smaller than it are lost", LARGEST_WIDTH, smallest=0.0),
    variants,
    "accelerometer {p} does not feel inputs below {width:.2e} g",
    degree=-1,
    formula="n_{p} 'counts as' 0 'where' |n_{p}| < {width}",
)
