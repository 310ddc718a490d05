"""What table and block, extended by effects, read at given encoder readings, times, temperatures and senses."""

from collections.abc import Sequence
from functools import cache

import numpy as np

from trihedron.fmus import components
from trihedron.fmus.component import extend
from trihedron.fmus.parameters import component_parameters
from trihedron.fmus.source import instantiate, references
from trihedron.models.bench import TARGETS
from trihedron.models.effects import CATALOGUE, EffectPlace, Rows, parameter_name
from trihedron.tools.calibration.model import Linearisation, Positions, linearise, parametrise
from trihedron.tools.evidence.bench_effects import Circumstances, Visits

G = 9.80665
ROWS = 7
RNG = np.random.default_rng(3)
ALPHA, BETA = RNG.uniform(-3.0, 3.0, ROWS), RNG.uniform(-3.0, 3.0, ROWS)
HOURS = np.linspace(0.01, 2.0, ROWS)
TEMPERATURE = RNG.uniform(15.0, 30.0, ROWS)
SENSES = RNG.choice([-1.0, 1.0], (ROWS, 2))
APPROACH = 1e-3
"""From so far [rad] the table comes to each position."""
TRUTH = RNG.uniform(-0.005, 0.005, len(TARGETS))
PARAMETERS = component_parameters(dict(zip(TARGETS, TRUTH, strict=True)), G, np.eye(3))
Values = Sequence[Sequence[float]]


def extended_instance(name: str, places: Sequence[EffectPlace], values: Values, **settings):
    """An instance of a component of the true bench, with those effects that belong to it, not yet initialised."""
    own = [(place, v) for place, v in zip(places, values, strict=True) if CATALOGUE[place.effect].component == name]
    component = extend(components()[name], [place for place, _ in own])
    at = references(component)
    model = instantiate(component)
    for variable, value in {**PARAMETERS.get(name, {}), **settings}.items():
        for i, element in enumerate(np.ravel(value)):
            model.set(at[f"{variable}[{i + 1}]" if isinstance(value, list) else variable], float(element))
    for place, v in own:
        for parameter, value in zip(CATALOGUE[place.effect].at(place).parameters, v, strict=True):
            model.set(at[parameter_name(place, parameter.name)], value)
    return model, at


def forces(places: Sequence[EffectPlace], values: Values, row: int) -> np.ndarray:
    """Specific force (2, 3) [m/s²] where the approach of a row begins and at the row, at given encoder readings.

    The command is sought at which the encoders show the angles that are asked for.
    """
    wanted = np.array([ALPHA[row], BETA[row]])
    command, force = wanted.copy(), np.zeros((2, 3))
    for _ in range(16):
        begin = [*(command - APPROACH * SENSES[row])]
        table, at = extended_instance(
            "TurntableMotion", places, values, encoder_fluctuation_bound=0.0, initial_angle=begin
        )
        table.set(at["temperature"], TEMPERATURE[row])
        assert table.initialise(0.0) == 0
        force[0] = [table.get(at[f"specific_force[{i + 1}]"]) for i in range(3)]
        for i in range(2):
            table.set(at[f"command[{i + 1}]"], command[i])
        assert table.do_step(0.0, 3600.0 * HOURS[row]) == 0
        force[1] = [table.get(at[f"specific_force[{i + 1}]"]) for i in range(3)]
        miss = wanted - [table.get(at[f"angle_reading[{i + 1}]"]) for i in range(2)]
        command = command + miss
        if np.abs(miss).max() < 1e-15:
            break
    return force


@cache
def nominal_forces(row: int) -> np.ndarray:
    """`forces` of the table without effects."""
    return forces([], [], row)


def readings(places: Sequence[EffectPlace], values: Values, **settings) -> np.ndarray:
    """Readings (7, 3) [g] of table and block, with effects composed in; the components themselves read."""
    on_table = any(CATALOGUE[place.effect].component == "TurntableMotion" for place in places)
    shown = np.zeros((ROWS, 3))
    for row in range(ROWS):
        before, force = forces(places, values, row) if on_table else nominal_forces(row)
        block, at = extended_instance("AccelerometerBlock", places, values, **settings)
        block.set(at["temperature"], TEMPERATURE[row])
        for i in range(3):
            block.set(at[f"specific_force[{i + 1}]"], before[i])
        assert block.initialise(0.0) == 0
        for i in range(3):
            block.set(at[f"specific_force[{i + 1}]"], force[i])
        assert block.do_step(0.0, 3600.0 * HOURS[row]) == 0
        shown[row] = [block.get(at[f"reading[{i + 1}]"]) / G for i in range(3)]
    return shown


def true_bench() -> tuple[Linearisation, Rows]:
    """The model at the truth, and the rows that signatures see there."""
    p = parametrise({"identity": np.eye(3)})
    at = Positions(ALPHA, BETA, np.zeros(ROWS, dtype=int))
    values = dict(zip(TARGETS, TRUTH, strict=True))
    point = np.array([values[symbol] for symbol in p.symbols])
    here = linearise(p, at, np.zeros((ROWS, 3)), point, np.full(3 * ROWS, 1e-5))
    circumstances = Circumstances(HOURS, TEMPERATURE, SENSES[:, 0], SENSES[:, 1], True)
    return here, Visits.of(here, circumstances).rows(point)
