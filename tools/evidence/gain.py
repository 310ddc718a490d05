"""What an extension does to what was not used to find it: the extended FMUs are run without and with it.

Of a bench some positions are held out and simulated again; of a block that is carried, blocks in time.
"""

import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus import build
from ...fmus.parameters import component_parameters
from ...models.bench import TARGETS
from ...models.effects import CATALOGUE, EffectPlace
from ..bounded.spaces import least_squares
from ..orchestrator import simulate
from ..orchestrator.scenario import Scenario
from .bench_effects import Circumstances, added_bound, is_linear, readings_at
from .bench_model import Cast, Readings, fitted
from .evidence import Evidence, Fit, Gain, estimated

NAMED_FOR = {"GyroCompensation": "GyroBlock"}
"""The component whose effects another one takes out."""
ARCMIN = np.pi / 180.0 / 60.0
"""[rad]"""
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


def gain_of(before: NDArray, after: NDArray, unit: float = 1.0, **more: Any) -> Gain:
    """The gain by errors (S, d) without and with the effects, whose sizes are quoted in a unit."""
    figures = {}
    for name, errors in (("before", before), ("after", after)):
        sizes = np.linalg.norm(errors, axis=1) / unit
        figures |= {f"held_out_rms_{name}": float(np.sqrt(np.mean(sizes**2))), f"held_out_max_{name}": sizes.max()}
    return Gain(before=before, after=after, **figures, **more)


def export_extended(
    places: Sequence[EffectPlace], folder: Path, components: Sequence[str] = (), flavour: str = "python"
) -> dict[str, Path]:
    """Write FMUs that are extended by effects into a folder: component -> file.

    Parameters
    ----------
    places : sequence of EffectPlace
    folder : Path
    components : sequence of str
        by default those that the effects extend, and the compensation that takes the gyros' out
    flavour : str
        as for `trihedron.fmus.build`
    """
    extended = {c for place in places if (c := place.definition.component) is not None}
    if "GyroBlock" in extended:
        extended.add("GyroCompensation")
    of = {name: NAMED_FOR.get(name, name) for name in components or sorted(extended)}
    return {
        name: build(name, folder, [p for p in places if p.definition.component == own], flavour=flavour)
        for name, own in of.items()
    }


def gain_by_folds(
    evidence: Evidence,
    places: Sequence[EffectPlace],
    count: int,
    simulated: Callable[[Sequence[EffectPlace], Path], Callable[[NDArray, Sequence[NDArray]], list[NDArray]]],
    unit: float,
) -> list[Gain]:
    """The gain on each scored kind of pieces, cut into blocks in time.

    For each block the parameters are estimated on the others, without the effects and with them; the exported FMUs
    are run with these; the errors of the block's own pieces count.

    Parameters
    ----------
    evidence : Evidence
    places : sequence of EffectPlace
        the effects that were named
    count : int
        of blocks
    simulated : callable
        effects, an empty folder for FMUs -> (solution (P + k,), numbers of some pieces of each kind -> their errors)
    unit : float
        in which sizes of errors are quoted
    """
    folds, results = evidence.folds(count), []
    with tempfile.TemporaryDirectory(prefix="trihedron-extended-", ignore_cleanup_errors=True) as name:
        for number, chosen in enumerate(((), tuple(places))):
            folder = Path(name) / str(number)
            folder.mkdir()
            simulate, matrix = simulated(chosen, folder), evidence.matrix(chosen)
            errors = [np.full(evidence.parts[k].error.shape, np.nan) for k in evidence.scored]
            for fold in range(folds.count):
                used = folds.of_row != fold
                solution = estimated(matrix[used], evidence.residual[used])
                held = [np.flatnonzero(folds.of_piece[k] == fold) for k in evidence.scored]
                for error, at, mine in zip(errors, held, simulate(solution, held), strict=True):
                    error[at] = mine
            results.append(errors)
    return [
        gain_of(before, after, unit, over=evidence.parts[k].label, pieces=len(before))
        for k, before, after in zip(evidence.scored, *results, strict=True)
    ]


# Of a bench


def _leverages(jacobian: NDArray, kept: NDArray, held: NDArray) -> NDArray | None:
    """How uncertain (H,) readings that are held out are predicted, over the others; None where these lose the rank."""
    scale = np.abs(jacobian).max(axis=0, initial=0.0)
    unit = jacobian / np.where(scale > 0.0, scale, 1.0)
    rank = _rank(unit)
    if len(kept) <= rank or _rank(unit[kept]) < rank:
        return None
    return np.linalg.norm(unit[held] @ np.linalg.pinv(unit[kept], rcond=1e-8), axis=1)


def _rank(matrix: NDArray) -> int:
    values = np.linalg.svd(matrix, compute_uv=False)
    return int(np.count_nonzero(values > 1e-8 * values.max(initial=0.0)))


def predicted_errors(
    jacobian: NDArray, residual: NDArray, bound: NDArray, kept: NDArray, held: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Errors (H,) of readings that were left out, and whether their leverage is bounded; None where rank is lost."""
    leverage = _leverages(jacobian, kept, held)
    if leverage is None:
        return None
    step = least_squares(jacobian[kept] / bound[kept, None], residual[kept] / bound[kept])
    return residual[held] - jacobian[held] @ step, leverage <= MAX_LEVERAGE


def held_out_rows(fit: Fit) -> tuple[NDArray, NDArray] | None:
    """Positions to hold out and which of their readings (H, 3) can be scored; None where the others would not do.

    Of the ways to hold out every fourth position the one with most scored readings is taken: the others must keep the
    rank of the extended model.
    """
    count = len(fit.residual) // 3
    best: tuple[NDArray, NDArray] | None = None
    # The first position is never held out: the simulation begins there, and no move leads to it.
    for offset in range(1, HELD_OUT_EVERY + 1):
        out = np.arange(offset, count, HELD_OUT_EVERY)
        held = readings_at(out)
        leverage = _leverages(fit.jacobian, np.setdiff1d(np.arange(3 * count), held), held)
        if len(out) and leverage is not None:
            scored = leverage.reshape(-1, 3) <= MAX_LEVERAGE
            if best is None or scored.sum() > best[1].sum():
                best = (out, scored)
    return None if best is None or best[1].sum() < FEWEST_SCORED else best


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
    chosen, circumstances = held_out_rows(fit), readings.circumstances
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
    rows, ways = readings.rows(like.point), {}
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
    rows = readings.rows_with(fit)
    found = added_bound(fit.places, rows).reshape(-1, 3) > 0.0
    for _, _, variant in fit.ways:
        if variant is not None:
            found |= variant.undecided(rows, float(readings.bound.min()))
    return found


def simulate_rows(readings: Readings, fit: Fit, rows: NDArray, gravity: float) -> NDArray:
    """Readings (n, 3) over g that the FMUs, extended as `fit` says, give at some rows of the record."""
    simulated = np.zeros((len(readings), 3))
    bench, coefficients = np.split(fit.estimate, [len(fit.point)])
    at = readings.true_angles(bench, [(place, coefficients[block]) for place, block, _ in fit.ways])
    commands = np.stack((at.alpha, at.beta), axis=1)
    moved = np.stack(readings.moved_axes(), axis=1)
    p = readings.parametrisation
    for index in range(len(p.mountings)):
        mine = np.flatnonzero(at.mounting == index)
        if np.isin(mine, rows).any():
            values = dict(zip(TARGETS, p.selection[index] @ bench, strict=True))
            parameters = component_parameters(values, gravity, p.matrices[index])
            circumstances = readings.circumstances.selected(mine)
            scenario = extended_scenario(parameters, effect_entries(fit), commands[mine], moved[mine], circumstances)
            run = simulate(scenario).table
            time, seconds = run["time_s"].to_numpy(), 3600.0 * circumstances.hours
            for axis in range(3):
                simulated[mine, axis] = np.interp(seconds, time, run[f"f{axis + 1}_mps2"].to_numpy()) / gravity
    return simulated[rows]


def effect_entries(fit: Fit) -> list[dict[str, object]]:
    """Effects of a fit, with the sizes of least squares, as a scenario writes them."""
    estimated_values = fit.values(fit.estimate[len(fit.point) :])
    entries = []
    for (place, _, variant), linear, stated in zip(fit.ways, estimated_values, fit.values(), strict=True):
        parameters = place.definition.parameters
        values = linear if variant is None else stated
        entries.append({**place.entry, **{p.name: value for p, value in zip(parameters, values, strict=True)}})
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
    away = commands - APPROACH * np.stack((circumstances.sense_alpha, circumstances.sense_beta), axis=1) * moved
    temperature = np.full(len(seconds), 20.0) if circumstances.temperature is None else circumstances.temperature
    rows = {
        "time_s": np.stack((before, after), axis=1).ravel(),
        "alpha_rad": np.stack((away, commands), axis=1)[:, :, 0].ravel(),
        "beta_rad": np.stack((away, commands), axis=1)[:, :, 1].ravel(),
        "temperature_degC": np.repeat(temperature, 2),
    }
    rows["time_s"][0] = 0.0
    table = {
        "encoder_fluctuation_bound": 0.0,
        "earth_rotation": False,
        "max_rate": [FAST, FAST],
        "max_acceleration": [FAST, FAST],
        "initial_angle": away[0].tolist(),
    }
    driven = {"table.command[1]": "alpha_rad", "table.command[2]": "beta_rad"}
    driven |= dict.fromkeys(("table.temperature", "block.temperature"), "temperature_degC")
    return composed(
        "the positions of a record, simulated again",
        {
            "table": ("TurntableMotion", {**parameters["TurntableMotion"], **table}),
            "block": ("AccelerometerBlock", {**parameters["AccelerometerBlock"], "noise_bound": 0.0}),
        },
        effects,
        {f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
        run={"step_s": step, "stop_s": (int(np.ceil(seconds[-1] / step)) + 1) * step},
        connections=[{"from": "table.specific_force", "to": "block.specific_force"}],
        stimuli=[{"table": {name: values.tolist() for name, values in rows.items()}, "columns": driven}],
    )


def composed(
    title: str,
    fmus: Mapping[str, tuple[str, Mapping[str, Any]]],
    effects: Sequence[Mapping[str, object]],
    columns: Mapping[str, str],
    **parts: Any,
) -> Scenario:
    """A scenario of components, each with those of the effects composed in that extend it.

    Parameters
    ----------
    title : str
    fmus : mapping
        name -> component and its parameters
    effects : sequence of mapping
        as in a scenario file
    columns : mapping
        of the record
    **parts
        other parts of a scenario file: ``run``, ``connections``, ``stimuli``
    """
    entries = [(CATALOGUE[str(entry["effect"])].component, dict(entry)) for entry in effects]
    described = {
        name: {
            "component": component,
            "effects": [entry for extended, entry in entries if extended == component],
            "parameters": values,
        }
        for name, (component, values) in fmus.items()
    }
    said = {"schema": "trihedron.scenario/1", "title": title, "fmus": described, "record": {"columns": columns}}
    return Scenario.model_validate(said | parts)


def smallest_gap(circumstances: Circumstances) -> float:
    """Shortest time [s] between two rows."""
    return float(np.diff(3600.0 * circumstances.hours).min()) if len(circumstances.hours) > 1 else 8.0
