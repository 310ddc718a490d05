"""Dead zone: an accelerometer does not feel a small input."""

import math

import numpy as np
from numpy.typing import NDArray

from ..restricted import INPUT, Vector
from .definition import (
    Effect,
    EffectParameter,
    EffectPlace,
    accelerometer_number,
    no_coefficients,
    no_signature,
    on_accelerometers,
)
from .rows import Rows, Variant, at_readings

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

    return Variant(
        offset=np.where(lost, -rows.own, 0.0),
        columns=np.zeros((*rows.n.shape, 0)),
        widening=np.zeros_like(rows.n),
        low=np.zeros(0),
        high=np.zeros(0),
        values=lambda coefficients: (0.5 * (limits[0] + limits[1]),),
        limits=(limits,),
        lost=lost,
        fixed=np.zeros_like(lost),
        stands=stands,
        undecided=undecided,
    )


EFFECT = Effect(
    name="dead-zone",
    places=on_accelerometers("dead-zone"),
    parameters=(EffectParameter("width", "g", "inputs smaller than it are lost", LARGEST_WIDTH, smallest=0.0),),
    component="AccelerometerBlock",
    stage="final_effects",
    kernel=dead_zone,
    place_numbers=accelerometer_number,
    signature=no_signature,
    from_coefficients=no_coefficients,
    sentence=lambda place, values: (
        f"accelerometer {place.index + 1} does not feel inputs below {values['width']:.2e} g"
    ),
    variants=variants,
    degree=-1,
    formula="n_{p} 'counts as' 0 'where' |n_{p}| < {width}",
)
