"""The simulation with and without the effect that was found, run again over positions that were not used."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from trihedron.calibration.linearisation import Linearisation, linearise
from trihedron.calibration.parametrisation import Positions
from trihedron.calibration.result import component_parameters
from trihedron.diagnosis.circumstances import Circumstances
from trihedron.diagnosis.disturbance import added_bound, disturbed, rows_at, true_angles
from trihedron.diagnosis.extended_fit import ExtendedFit, fit_nearest
from trihedron.diagnosis.senses import moved_axes
from trihedron.fmus import build
from trihedron.models.bench import TARGETS
from trihedron.models.effects import CATALOGUE, EffectPlace
from trihedron.orchestrator import simulate
from trihedron.scenario import Scenario

HELD_OUT_EVERY = 4
"""One position in so many is held out."""
FEWEST_SCORED = 3
MAX_LEVERAGE = 1.0
"""A held-out reading is scored when its prediction is at most so many times as uncertain (rms) as a reading."""
FAST = 1e3
"""Rate [rad/s] and acceleration [rad/s²] of a simulated table whose moves take no time to speak of."""
APPROACH = 0.02
"""From so far [rad] the simulated table comes to a position in the sense of the record."""
STEPS_PER_GAP = 16
MAX_STEPS = 100_000
"""A record whose rows crowd together within a long time is not simulated again."""


@dataclass(frozen=True)
class Gain:
    """What the extension does to readings that were not used to find its size.

    Attributes
    ----------
    positions : (H,) array of int
        rows of the record that were held out
    scored : (H, 3) array of bool
        readings that the others predict well enough to be scored
    before, after : (H, 3) array
        measurement less simulation, fractions of g, without and with the effect
    """

    positions: NDArray
    scored: NDArray
    before: NDArray
    after: NDArray

    def summary(self) -> dict[str, float]:
        """Root mean square and maximum of the scored errors, before and after."""
        before, after = self.before[self.scored], self.after[self.scored]
        return {
            "held_out_rms_before": float(np.sqrt(np.mean(before**2))),
            "held_out_rms_after": float(np.sqrt(np.mean(after**2))),
            "held_out_max_before": float(np.abs(before).max()),
            "held_out_max_after": float(np.abs(after).max()),
        }

    @property
    def improves(self) -> bool:
        """Whether held-out readings are predicted better with the effects, on the whole."""
        summary = self.summary()
        return summary["held_out_rms_after"] < summary["held_out_rms_before"]


def subset(here: Linearisation, rows: NDArray) -> Linearisation:
    """The linearisation of some rows (n,) of int of the record, at the same point."""
    at = here.positions
    measured = (3 * rows[:, None] + np.arange(3)).ravel()
    return linearise(
        here.parametrisation,
        Positions(at.alpha[rows], at.beta[rows], at.mounting[rows]),
        here.reading[rows],
        here.point,
        here.bound[measured],
        here.sign[rows],
    )


def held_out_rows(here: Linearisation, fit: ExtendedFit) -> tuple[NDArray, NDArray] | None:
    """Rows to hold out and which of their readings (H, 3) can be scored; None where the others would not do.

    Of the ways to hold out every fourth position the one with most scored readings is taken: the others must keep the
    rank of the extended model.
    """
    count = len(here.reading)
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


def measure_gain(
    here: Linearisation, circumstances: Circumstances, fit: ExtendedFit, gravity: float, resolution: float
) -> Gain | None:
    """Fit without every fourth position, simulate those by the orchestrator without and with the effect, compare.

    Parameters
    ----------
    here : Linearisation
        the nominal model at its fit
    circumstances : Circumstances
        of the rows
    fit : ExtendedFit
        the model with an effect that has a kernel
    gravity : float
        the model's g [m/s²]
    resolution : float
        half a last digit of the readings, as a fraction of g

    Returns
    -------
    Gain or None
        None where too few positions remain to judge
    """
    chosen = held_out_rows(here, fit)
    hours = circumstances.hours
    if chosen is None or 3600.0 * hours[-1] * STEPS_PER_GAP > MAX_STEPS * smallest_gap(circumstances):
        return None
    out, scored = chosen
    kept = np.setdiff1d(np.arange(len(here.reading)), out)
    errors = []
    for places in ((), fit.places):
        trained = fit_nearest(subset(here, kept), circumstances.selected(kept), places, fit, resolution)
        if trained is None:
            return None
        simulated = simulate_rows(here, trained, circumstances, out, gravity)
        errors.append(here.reading[out] - simulated)
        scored = scored & ~undecided(here, circumstances, trained)[out]
    return Gain(out, scored, errors[0], errors[1]) if scored.sum() >= FEWEST_SCORED else None


def undecided(here: Linearisation, circumstances: Circumstances, fit: ExtendedFit) -> NDArray:
    """Readings (N, 3) of bool of which a fit leaves open what its effects do to them: no simulation can tell."""
    at = disturbed(here, fit.point, fit.places, fit.coefficients, fit.blocks, circumstances)
    rows = rows_at(here, fit.point, at, circumstances)
    found = added_bound(fit.places, rows).reshape(-1, 3) > 0.0
    for variant in fit.variants:
        if variant is not None:
            found |= variant.undecided(rows, float(here.bound.min()))
    return found


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
            parameters = component_parameters(values, p.matrices[index], gravity)
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


def export_extended(places: Sequence[EffectPlace], folder: Path) -> list[Path]:
    """Write the FMUs of the components that effects extend into a folder."""
    components = sorted({c for place in places if (c := CATALOGUE[place.effect].component) is not None})
    return [build(c, folder, [p for p in places if CATALOGUE[p.effect].component == c]) for c in components]
