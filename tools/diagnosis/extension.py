"""The record's positions simulated again by components that are extended by effects."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ...fmus.parameters import component_parameters
from ...models.bench import TARGETS
from ...models.effects import CATALOGUE
from ..calibration.model import Linearisation
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from .circumstances import Circumstances
from .disturbance import true_angles
from .extended_fit import ExtendedFit
from .senses import moved_axes

FAST = 1e3
"""Rate [rad/s] and acceleration [rad/s²] of a simulated table whose moves take no time to speak of."""
APPROACH = 0.02
"""From so far [rad] the simulated table comes to a position in the sense of the record."""
STEPS_PER_GAP = 16


def simulate_rows(
    here: Linearisation, fit: ExtendedFit, circumstances: Circumstances, rows: NDArray, gravity: float
) -> NDArray:
    """Readings (n, 3) over g that the FMUs, extended as `fit` says, give at some rows of the record."""
    readings = np.zeros((len(here.reading), 3))
    bench, coefficients = fit.estimate[: len(fit.point)], fit.estimate[len(fit.point) :]
    at = true_angles(here, bench, fit.places, coefficients, fit.blocks, circumstances)
    commands = np.stack((at.alpha, at.beta), axis=1)
    moved = np.stack(moved_axes(here.positions, circumstances), axis=1)
    p = here.parametrisation
    for index in range(len(p.mountings)):
        mine = np.flatnonzero(here.positions.mounting == index)
        if np.isin(mine, rows).any():
            values = dict(zip(TARGETS, p.selection[index] @ bench, strict=True))
            parameters = component_parameters(values, gravity, p.matrices[index])
            scenario = extended_scenario(
                parameters, effect_entries(fit), commands[mine], moved[mine], circumstances.selected(mine)
            )
            run = simulate(scenario).table
            time, seconds = run["time_s"].to_numpy(), 3600.0 * circumstances.hours[mine]
            for axis in range(3):
                readings[mine, axis] = np.interp(seconds, time, run[f"f{axis + 1}_mps2"].to_numpy()) / gravity
    return readings[rows]


def effect_entries(fit: ExtendedFit) -> list[dict[str, object]]:
    """Effects of a fit, with the sizes of least squares, as a scenario writes them."""
    coefficients = fit.estimate[len(fit.point) :]
    entries: list[dict[str, object]] = []
    for place, block, variant in zip(fit.places, fit.blocks, fit.variants, strict=True):
        effect = CATALOGUE[place.effect].at(place)
        values = (
            effect.from_coefficients(coefficients[block]) if variant is None else variant.values(fit.central[block])
        )
        entry: dict[str, object] = {"effect": place.effect, "where": place.where}
        if place.order is not None:
            entry["order"] = place.order
        if place.axes:
            entry["axes"] = list(place.axes)
        named = zip((parameter.name for parameter in effect.parameters), values, strict=True)
        entries.append({**entry, **dict(named)})
    return entries


def extended_scenario(
    parameters: Mapping[str, Mapping[str, object]],
    effects: Sequence[Mapping[str, object]],
    commands: NDArray,
    moved: NDArray,
    circumstances: Circumstances,
) -> Scenario:
    """A scenario in which table and block, calibrated and extended, stand at each position at its time.

    The table comes to each position in the sense of the record's last move, and its temperature is the record's.

    Parameters
    ----------
    parameters : mapping
        component -> variable -> value
    effects : sequence of mapping
        as in a scenario file
    commands : (n, 2) array
        commanded angles [rad]
    moved : (n, 2) array of bool
        whether the outer and the inner axis turned on the way: one that did not must not decide the inputs' senses
    circumstances : Circumstances
        of the n rows
    """
    seconds = 3600.0 * circumstances.hours
    gap = smallest_gap(circumstances)
    step = gap / STEPS_PER_GAP
    # The table arrives half a gap before each reading, so that the steps about it are at rest there.
    before = np.maximum(seconds - 0.5 * gap, 0.0)
    after = np.maximum(seconds - 0.25 * gap, 0.25 * step)
    senses = np.stack((circumstances.sense_alpha, circumstances.sense_beta), axis=1) * moved
    temperature = np.full(len(seconds), 20.0) if circumstances.temperature is None else circumstances.temperature
    rows = {
        "time_s": np.stack((before, after), axis=1).ravel(),
        "alpha_rad": np.stack((commands - APPROACH * senses, commands), axis=1)[:, :, 0].ravel(),
        "beta_rad": np.stack((commands - APPROACH * senses, commands), axis=1)[:, :, 1].ravel(),
        "temperature_degC": np.repeat(temperature, 2),
    }
    rows["time_s"][0] = 0.0
    steps = int(np.ceil(seconds[-1] / step)) + 1
    belongs = {component: [dict(e) for e in effects if home(e) == component] for component in parameters}
    return Scenario.model_validate(
        {
            "schema": "trihedron.scenario/1",
            "title": "the positions of a record, simulated again",
            "run": {"step_s": step, "stop_s": steps * step},
            "fmus": {
                "table": {
                    "component": "TurntableMotion",
                    "effects": belongs["TurntableMotion"],
                    "parameters": {
                        **parameters["TurntableMotion"],
                        "encoder_fluctuation_bound": 0.0,
                        "earth_rotation": False,
                        "max_rate": [FAST, FAST],
                        "max_acceleration": [FAST, FAST],
                        "initial_angle": (commands[0] - APPROACH * senses[0]).tolist(),
                    },
                },
                "block": {
                    "component": "AccelerometerBlock",
                    "effects": belongs["AccelerometerBlock"],
                    "parameters": {**parameters["AccelerometerBlock"], "noise_bound": 0.0},
                },
            },
            "connections": [{"from": "table.specific_force", "to": "block.specific_force"}],
            "stimuli": [
                {
                    "table": {name: values.tolist() for name, values in rows.items()},
                    "columns": {
                        "table.command[1]": "alpha_rad",
                        "table.command[2]": "beta_rad",
                        "table.temperature": "temperature_degC",
                        "block.temperature": "temperature_degC",
                    },
                }
            ],
            "record": {"columns": {f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)}},
        }
    )


def smallest_gap(circumstances: Circumstances) -> float:
    """Shortest time [s] between two rows."""
    return float(np.diff(3600.0 * circumstances.hours).min()) if len(circumstances.hours) > 1 else 8.0


def home(entry: Mapping[str, object]) -> str | None:
    """Component that an entry of a scenario's effects extends."""
    return CATALOGUE[str(entry["effect"])].component
