"""Turns of the block against the table that its fixture allows.

fixture_flexure
    the fixture bends under the block's weight: a turn about one axis of the block, in proportion to one input
mounting_drift, mounting_temperature
    the block creeps on the table with time; its fixture warps with temperature
"""

from itertools import product

import numpy as np

from ..arrays import Floats
from ..restricted import HOURS, INPUT, TEMPERATURE, Vector
from .accelerometer import NOMINAL_TEMPERATURE
from .columns import Rows
from .definition import EffectParameter, EffectPlace, table_effect

MOUNTING = "mounting"
BLOCK_AXES = (1, 2, 3)


def fixture_flexure(context: Vector, angles: Vector, i: int, j: int, coefficient: float, turns: Vector) -> None:
    """Turn the block about its axis i in proportion to input j."""
    turns[4 + i] = turns[4 + i] + coefficient * context[INPUT + j]


FIXTURE_FLEXURE = table_effect(
    fixture_flexure,
    EffectParameter("coefficient", "rad/g", "turn of the block for one g of the input", 5e-3),
    "the block turns about its axis {i} by {coefficient:+.2e} rad per g of input {j} (as a bending fixture would)",
    stage="geometry_effects",
    places=tuple(EffectPlace("fixture-flexure", MOUNTING, axes=axes) for axes in product(BLOCK_AXES, repeat=2)),
    degree=1,
    formula="Δθ_{i} = {coefficient} n_{j}",
)


def mounting_drift(context: Vector, angles: Vector, rate_1: float, rate_2: float, rate_3: float, turns: Vector) -> None:
    """Turn the block by rate·hours about each of its axes."""
    turns[4] = turns[4] + rate_1 * context[HOURS]
    turns[5] = turns[5] + rate_2 * context[HOURS]
    turns[6] = turns[6] + rate_3 * context[HOURS]


MOUNTING_DRIFT = table_effect(
    mounting_drift,
    tuple(EffectParameter(f"rate_{k}", "rad/h", f"turn about axis {k} of the block", 1e-2) for k in BLOCK_AXES),
    "the block turns on the table with time: by {rate_1_arcsec:+.4g}, {rate_2_arcsec:+.4g} and {rate_3_arcsec:+.4g} "
    "arcsec an hour about its axes",
    stage="geometry_effects",
    places=(EffectPlace("mounting-drift", MOUNTING),),
    formula="Δθ = ({rate_1}, {rate_2}, {rate_3}) t, t 'in hours'",
)


def mounting_temperature(
    context: Vector, angles: Vector, slope_1: float, slope_2: float, slope_3: float, turns: Vector
) -> None:
    """Turn the block by slope (T - 20) about each of its axes."""
    warmer = context[TEMPERATURE] - NOMINAL_TEMPERATURE
    turns[4] = turns[4] + slope_1 * warmer
    turns[5] = turns[5] + slope_2 * warmer
    turns[6] = turns[6] + slope_3 * warmer


def open_temperature(place: EffectPlace, rows: Rows) -> Floats:
    """Return the effect of half a last digit of the temperature on a slope in the readings (N, 3)."""
    return np.linalg.norm(rows.by_slip, axis=2) * rows.temperature_resolution


MOUNTING_TEMPERATURE = table_effect(
    mounting_temperature,
    tuple(
        EffectParameter(f"slope_{k}", "rad/K", f"turn about axis {k} of the block for one kelvin", 1e-3)
        for k in BLOCK_AXES
    ),
    "the block turns on the table with temperature: by {slope_1_arcsec:+.4g}, {slope_2_arcsec:+.4g} and "
    "{slope_3_arcsec:+.4g} arcsec per kelvin about its axes",
    stage="geometry_effects",
    places=(EffectPlace("mounting-temperature", MOUNTING),),
    open_argument=open_temperature,
    formula="Δθ = ({slope_1}, {slope_2}, {slope_3}) (T − 20 °C)",
)

EFFECTS = (FIXTURE_FLEXURE, MOUNTING_DRIFT, MOUNTING_TEMPERATURE)
