"""Readings of table and block, extended by effects, at given encoder readings, times, temperatures and senses."""

from functools import cache

import numpy as np
from numpy.typing import ArrayLike

from named import Effects, Named
from trihedron.fmus.parameters import component_parameters
from trihedron.models.bench import TARGETS
from trihedron.models.effects import EffectPlace, Rows
from trihedron.tools.calibration import Linearisation, Positions, linearise, parametrise
from trihedron.tools.evidence import Circumstances, Visits

G = 9.80665
ROWS = 7
RNG = np.random.default_rng(3)
ALPHA, BETA = RNG.uniform(-3.0, 3.0, ROWS), RNG.uniform(-3.0, 3.0, ROWS)
HOURS = np.linspace(0.01, 2.0, ROWS)
TEMPERATURE = RNG.uniform(15.0, 30.0, ROWS)
SENSES = RNG.choice([-1.0, 1.0], (ROWS, 2))
APPROACH = 1e-3
"""Distance from which the table approaches each position [rad]."""
TRUTH = RNG.uniform(-0.005, 0.005, len(TARGETS))
PARAMETERS = component_parameters(dict(zip(TARGETS, TRUTH, strict=True)), G, np.eye(3))

WOBBLES = {
    EffectPlace("axis-wobble", "outer-axis", 2): (3e-3, 0.4),
    EffectPlace("axis-wobble", "inner-axis", 3): (2e-3, -1.0, 4e-3, 2.0),
    EffectPlace("axis-wobble", "inner-axis", 1): (3e-3, 0.9),
    EffectPlace("sag", "outer-axis"): (2e-3, 0.3),
    EffectPlace("sag", "inner-axis"): (3e-3, -0.5),
    EffectPlace("base-drift", "base"): (2.0, -3.0),
}
"""Geometry effects; the base drifts fast enough to show within seconds."""


def extended_instance(name: str, effects: Effects, **settings: ArrayLike) -> Named:
    """Return a component of the true bench, with its own effects, not yet initialised."""
    belonging = {place: values for place, values in effects.items() if place.definition.component == name}
    return Named(name, belonging, **(PARAMETERS.get(name, {}) | settings))


def forces(effects: Effects, row: int) -> np.ndarray:
    """Return the specific force (2, 3) [m/s²] at the start of a row's approach and at the row, at given encoder
    readings.

    The command is sought at which the encoders show the given angles.
    """
    expected = np.array([ALPHA[row], BETA[row]])
    command, force = expected.copy(), np.zeros((2, 3))
    for _ in range(16):
        begin = command - APPROACH * SENSES[row]
        table = extended_instance("TurntableMotion", effects, encoder_fluctuation_bound=0.0, initial_angle=begin)
        force[0] = table.put(temperature=TEMPERATURE[row]).begin()["specific_force"]
        force[1] = table.put(command=command).step(0.0, 3600.0 * HOURS[row])["specific_force"]
        miss = expected - table["angle_reading"]
        command = command + miss
        if np.abs(miss).max() < 1e-15:
            break
    return force


@cache
def nominal_forces(row: int) -> np.ndarray:
    """Return `forces` of the table without effects."""
    return forces({}, row)


def readings(effects: Effects, **settings: ArrayLike) -> np.ndarray:
    """Return readings (7, 3) [g] of table and block, with effects composed in, from the components themselves."""
    on_table = any(place.definition.component == "TurntableMotion" for place in effects)
    readings_of_rows = np.zeros((ROWS, 3))
    for row in range(ROWS):
        before, force = forces(effects, row) if on_table else nominal_forces(row)
        block = extended_instance("AccelerometerBlock", effects, **settings)
        angle = ALPHA[row] - TRUTH[TARGETS.index("X2")], BETA[row]
        block.put(temperature=TEMPERATURE[row], specific_force=before, angle=angle).begin()
        readings_of_rows[row] = block.put(specific_force=force).step(0.0, 3600.0 * HOURS[row])["reading"] / G
    return readings_of_rows


def true_bench() -> tuple[Linearisation, Rows]:
    """Return the model at the truth, and the rows for signatures there."""
    p = parametrise({"identity": np.eye(3)})
    at = Positions(ALPHA, BETA, np.zeros(ROWS, dtype=int))
    values = dict(zip(TARGETS, TRUTH, strict=True))
    point = np.array([values[symbol] for symbol in p.symbols])
    linearised = linearise(p, at, np.zeros((ROWS, 3)), point, np.full(3 * ROWS, 1e-5))
    circumstances = Circumstances(HOURS, TEMPERATURE, SENSES[:, 0], SENSES[:, 1], True)
    return linearised, Visits.of(linearised, circumstances).rows(point)
