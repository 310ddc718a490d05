"""The turns of a bench record, simulated again: the gyro block as an FMU on the table's true motion.

The table's motion is that of its encoders by the exact geometry, with the turns that effects of the table add; the FMU
of the gyro block, extended by effects of the gyros, reads it.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.bench import BIAS, LAG, MATRIX, SENSITIVITY, small_turn
from ...models.effects import EffectPlace
from ..calibration.model import Positions, predicted_input
from ..calibration.turns import WithTurns
from ..orchestrator import run_scenario
from ..records import BenchRecord
from ..records.rests import without_turns
from .bench_in_time import SLIP, block_turns
from .carried import LATENCY
from .fit import composed
from .observation import Travel, interpolated

SENSITIVE = EffectPlace("gyro-g-sensitivity", "gyro-block")
MOST_ROWS = 120_000
"""A longer record is run at every second row, or third, and so on."""


def effects_of_model(gyros: NDArray) -> dict[EffectPlace, tuple[float, ...]]:
    """What the model of the gyros (22,) has beside biases, scale factors and misalignments, as effects of the block."""
    return {SENSITIVE: tuple(gyros[SENSITIVITY].tolist()), LATENCY: (float(gyros[LAG]),)}


def simulated_turns(
    raw: BenchRecord,
    fitted: WithTurns,
    travel: Travel,
    point: NDArray,
    effects: Mapping[EffectPlace, NDArray],
    set_in: Mapping[EffectPlace, float] | None = None,
) -> NDArray[np.float64]:
    """What the gyro block's FMU integrates over each piece (S, 3) [rad], extended by effects of given coefficients.

    `point` (P,) are parameters of bench, accelerometers and gyros; `set_in` times [h] of effects that have one.
    """
    own, time = fitted.own, raw.time_s
    gyros, turned = point[own:], block_turns(raw, fitted, point)
    alpha, beta = without_turns(raw.alpha), without_turns(raw.beta)
    on_gyros: list[tuple[EffectPlace, Sequence[float]]] = list(effects_of_model(gyros).items())
    for place, coefficients in effects.items():
        if place.definition.component == "GyroBlock":
            values = list(place.definition.from_coefficients(coefficients))
            if set_in is not None and place in set_in:
                values.append(set_in[place])
            on_gyros.append((place, values))
        elif place.definition.turns_table:
            added = (travel.table.sums(place.definition.turns(place, travel.rows)) @ coefficients) @ travel.to_block.T
            hours = (time - time[0]) / 3600.0
            turned = turned + interpolated(hours, travel.hours, added)
        elif place == SLIP:
            assert set_in is not None
            later = int(np.searchsorted((time - time[0]) / 3600.0, set_in[place]))
            behind = (turned[later:] - turned[later - 1]) @ small_turn(coefficients).T
            turned = np.vstack([turned[:later], turned[later - 1] + coefficients + behind])
    rows = np.unique(np.append(np.arange(0, len(time), -(-len(time) // MOST_ROWS)), len(time) - 1))
    period = float(time[-1] - time[0]) / (len(rows) - 1)
    even = time[0] + period * np.arange(len(rows))
    at = interpolated(even, time, turned)
    angles = Positions(np.interp(even, time, alpha), np.interp(even, time, beta), np.zeros(len(rows), dtype=int))
    force = STANDARD_GRAVITY * predicted_input(fitted.parametrisation, point[:own], angles)
    columns, driven, recorded = {"time_s": even[1:] - time[0]}, {}, {}
    for k in range(3):
        columns[f"w{k + 1}_rad"] = np.diff(at[:, k])
        driven[f"gyros.increment[{k + 1}]"] = f"w{k + 1}_rad"
        recorded[f"w{k + 1}_rad"] = f"gyros.increment_reading[{k + 1}]"
    for k in range(3):
        columns[f"f{k + 1}_mps2"] = 0.5 * (force[1:, k] + force[:-1, k])
        driven[f"gyros.specific_force[{k + 1}]"] = f"f{k + 1}_mps2"
    warm = raw.temperature
    if warm is None:
        warm = np.full(len(time), 20.0)
    columns["temperature_degC"] = np.interp(even, time, warm)[1:]
    driven["gyros.temperature"] = "temperature_degC"
    block: dict[str, Any] = {"bias": gyros[BIAS].tolist(), "scale_misalignment": gyros[MATRIX].tolist()}
    names = [parameters_of(place, values) for place, values in on_gyros]
    scenario = composed(
        "the turns of a bench record, simulated again",
        {"gyros": ("GyroBlock", {"gravity": STANDARD_GRAVITY, **block})},
        names,
        recorded,
        run={"step_s": period, "stop_s": (len(rows) - 1) * period},
        stimuli=[{"table": pl.DataFrame(columns), "stamp": "end", "columns": driven}],
    )
    increments = run_scenario(scenario).table.select(list(recorded)).to_numpy()
    sums = interpolated(time, even, np.cumsum(increments, axis=0))
    integrals = sums[fitted.turns.last] - sums[fitted.turns.first]
    for place, coefficients in effects.items():
        if place.definition.component == "AttitudeComputer":
            integrals = integrals + (travel.columns(place) @ coefficients).reshape(-1, 3)
    return integrals


def parameters_of(place: EffectPlace, values: Sequence[float]) -> dict[str, object]:
    """An effect as a scenario file writes it."""
    entry = dict(place.entry)
    for parameter, value in zip(place.definition.parameters, values, strict=True):
        entry[parameter.name] = float(value)
    return entry
