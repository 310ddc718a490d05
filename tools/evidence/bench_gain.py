"""What an extension of the bench gains: positions that were not used to find it, simulated without and with it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.parameters import component_parameters
from ...models.bench import TARGETS
from ...models.effects import CATALOGUE, EffectPlace
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from .bench_effects import Circumstances, added_bound, is_linear
from .bench_model import Cast, Readings, fitted
from .evidence import Fit, Gain

FAST = 1e3
"""Rate [rad/s] and acceleration [rad/s²] of a simulated table whose moves take no time to speak of."""
APPROACH = 0.02
"""From so far [rad] the simulated table comes to a position in the sense of the record."""
STEPS_PER_GAP = 16
HELD_OUT_EVERY = 4
"""One position in so many is held out."""
FEWEST_SCORED = 3
MAX_LEVERAGE = 1.0
"""A held-out reading is scored when its prediction is at most so many times as uncertain (rms) as a reading."""
MAX_STEPS = 100_000
"""A record whose rows crowd together within a long time is not simulated again."""


def held_out_rows(fit: Fit) -> tuple[NDArray, NDArray] | None:
    """Rows to hold out and which of their readings (H, 3) can be scored; None where the others would not do.

    Of the ways to hold out every fourth position the one with most scored readings is taken: the others must keep the
    rank of the extended model.
    """
    count = len(fit.residual) // 3
    jacobian = fit.jacobian / np.abs(fit.jacobian).max(axis=0, initial=1e-300)
    rank = np.linalg.matrix_rank(jacobian, tol=1e-8 * np.linalg.norm(jacobian, 2))
    best: tuple[NDArray, NDArray] | None = None
    # The first position is never held out: the simulation begins there, and no move leads to it.
    for offset in range(1, HELD_OUT_EVERY + 1):
        out = np.arange(offset, count, HELD_OUT_EVERY)
        kept = np.setdiff1d(np.arange(count), out)
        used = jacobian.reshape(count, 3, -1)[kept].reshape(-1, jacobian.shape[1])
        if len(out) == 0 or len(used) <= rank:
            continue
        if np.linalg.matrix_rank(used, tol=1e-8 * np.linalg.norm(used, 2)) < rank:
            continue
        weights = jacobian.reshape(count, 3, -1)[out] @ np.linalg.pinv(used, rcond=1e-8)
        scored = np.linalg.norm(weights, axis=2) <= MAX_LEVERAGE
        if best is None or scored.sum() > best[1].sum():
            best = (out, scored)
    if best is None or best[1].sum() < FEWEST_SCORED:
        return None
    return best


def measure_gain(readings: Readings, start: NDArray, fit: Fit, gravity: float) -> Gain | None:
    """Fit without every fourth position, simulate those by the orchestrator without and with the effect, compare.

    Parameters
    ----------
    readings : Readings
    start : (P,) array
        parameters of the bench where fits begin
    fit : Fit
        the model with effects that have kernels
    gravity : float
        the model's g [m/s²]

    Returns
    -------
    Gain or None
        None where too few positions remain to judge
    """
    chosen, circumstances = held_out_rows(fit), readings.visits.circumstances
    if chosen is None or 3600.0 * circumstances.hours[-1] * STEPS_PER_GAP > MAX_STEPS * smallest_gap(circumstances):
        return None
    out, scored = chosen
    others = readings.selected(np.setdiff1d(np.arange(len(readings)), out))
    errors = []
    for places in ((), fit.places):
        trained = fitted_like(others, places, start, fit)
        if trained is None:
            return None
        errors.append(readings.reading[out] - simulate_rows(readings, trained, out, gravity))
        scored = scored & ~undecided(readings, trained)[out]
    if scored.sum() < FEWEST_SCORED:
        return None
    figures: dict[str, Any] = {"rows": out}
    for name, error in zip(("before", "after"), errors, strict=True):
        counted = error[scored]
        figures |= {f"held_out_rms_{name}": float(np.sqrt(np.mean(counted**2)))}
        figures |= {f"held_out_max_{name}": float(np.abs(counted).max()), name: np.where(scored, error, np.nan)}
    return Gain(**figures)


def fitted_like(readings: Readings, places: Sequence[EffectPlace], start: NDArray, like: Fit) -> Fit | None:
    """Fit effects to other readings; what is not linear acts in the way whose parameters are nearest to `like`'s."""
    rows, ways = readings.visits.rows(like.point), {}
    wanted = dict(zip(like.places, like.values(), strict=True))
    for place in places:
        if is_linear(place):
            continue
        seen = readings.variants(place, rows)
        if not seen:
            return None
        value, limits = wanted[place][0], [variant.limits[0] for variant in seen]
        ways[place] = int(np.argmin([max(low - value, value - high, 0.0) for low, high in limits]))
    return fitted(readings, Cast(tuple(places), ways), start)


def undecided(readings: Readings, fit: Fit) -> NDArray:
    """Readings (N, 3) of bool of which a fit leaves open what its effects do to them: no simulation can tell."""
    visits = readings.visits
    rows = visits.rows(fit.point, visits.disturbed(fit.point, fit.sized))
    found = added_bound(fit.places, rows).reshape(-1, 3) > 0.0
    for _, _, variant in fit.ways:
        if variant is not None:
            found |= variant.undecided(rows, float(readings.bound.min()))
    return found


def simulate_rows(readings: Readings, fit: Fit, rows: NDArray, gravity: float) -> NDArray:
    """Readings (n, 3) over g that the FMUs, extended as `fit` says, give at some rows of the record."""
    simulated, visits = np.zeros((len(readings), 3)), readings.visits
    bench, coefficients = np.split(fit.estimate, [len(fit.point)])
    at = visits.true_angles(bench, [(place, coefficients[block]) for place, block, _ in fit.ways])
    commands = np.stack((at.alpha, at.beta), axis=1)
    moved = np.stack(visits.moved_axes(), axis=1)
    p = visits.parametrisation
    for index in range(len(p.mountings)):
        mine = np.flatnonzero(at.mounting == index)
        if np.isin(mine, rows).any():
            values = dict(zip(TARGETS, p.selection[index] @ bench, strict=True))
            parameters = component_parameters(values, gravity, p.matrices[index])
            circumstances = visits.circumstances.selected(mine)
            scenario = extended_scenario(parameters, effect_entries(fit), commands[mine], moved[mine], circumstances)
            run = simulate(scenario).table
            time, seconds = run["time_s"].to_numpy(), 3600.0 * circumstances.hours
            for axis in range(3):
                simulated[mine, axis] = np.interp(seconds, time, run[f"f{axis + 1}_mps2"].to_numpy()) / gravity
    return simulated[rows]


def effect_entries(fit: Fit) -> list[dict[str, object]]:
    """Effects of a fit, with the sizes of least squares, as a scenario writes them."""
    coefficients = fit.estimate[len(fit.point) :]
    entries: list[dict[str, object]] = []
    for (place, block, variant), central in zip(fit.ways, fit.values(), strict=True):
        effect = CATALOGUE[place.effect].at(place)
        values = effect.from_coefficients(coefficients[block]) if variant is None else central
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
