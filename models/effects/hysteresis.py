"""Hysteresis of an accelerometer: its reading lags the last change of its input."""

import numpy as np
from numpy.typing import NDArray

from ..restricted import SENSE_INPUT, Vector
from .definition import EffectParameter, EffectPlace, accelerometer_column, accelerometer_effect
from .rows import Rows


def hysteresis(context: Vector, n: Vector, p: int, width: float, added: Vector) -> None:
    """Add -sense·width/2 to the reading of accelerometer p; the sense is that of the last change of its input."""
    added[p] = added[p] - 0.5 * width * context[SENSE_INPUT + p]


def untold(place: EffectPlace, rows: Rows) -> NDArray[np.float64]:
    """Half of the width (N, 3), per unit of it, where the sense of the last change of the input is not told."""
    return accelerometer_column(place, np.where(rows.sense_told[:, place.index], 0.0, 0.5))[..., 0]


EFFECT = accelerometer_effect(
    hysteresis,
    EffectParameter("width", "g", "difference of readings after falling and after rising input", 1e-2, smallest=0.0),
    lambda place, rows: -0.5 * rows.input_sense[:, place.index],
    "accelerometer {p} reads {width:.2e} g less after a rising input than after a falling one",
    untold=untold,
    formula="Δf_{p}/g = − 'sense of the last change of' n_{p} · {width} / 2",
)
