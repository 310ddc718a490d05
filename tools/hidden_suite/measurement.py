"""The record of a case: the bench carried out in time by its components, errors within σ."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from ...models.effects import CATALOGUE, EffectPlace
from ..calibration.mountings import PRESETS
from ..hidden import BLOCK_NOISE, ENCODER_FLUCTUATION, RECORD_DECIMALS, STEP_S, bench_scenario, record_of
from ..hidden_cases import NOISE_BOUND
from ..records import PositionRecord
from .benches import Bench
from .cases import SuiteCase

HELD = 0.9
"""What remains of an error that wanders, from one position to the next."""
FINE_STEP_S = 0.05
NOISE_STREAM = 1
"""Number of the stream of random numbers that errors are drawn from."""


def measure_case(case: SuiteCase) -> PositionRecord:
    """Measure a bench: what a laboratory would hand over, and nothing else.

    Slews, dwells and temperature are simulated with the physical components, effects composed in. With two mountings
    the whole programme is run in each, and each gives the positions that are its own: the clock goes on. Uniform errors
    are the components' own; errors at ±σ, and those that wander, are added to the averaged readings. The record has
    nine decimals.
    """
    bench = case.bench
    entries = [entry_of(hidden.place, hidden.values) for hidden in case.hidden if component_of(hidden.place)]
    seed = int(np.random.default_rng([case.seed, case.index, 0]).integers(2**31))
    records = [
        record_of(mounted_scenario(bench, k, entries, seed + k, own_errors=case.noise == "uniform"), every=True)
        for k in range(len(bench.mountings))
    ]
    if any(len(record) != len(bench.alpha) for record in records):
        raise ValueError(f"case {case.index} of seed {case.seed}: a rest of the programme was not found")
    record = joined(bench, records)
    error = np.zeros((len(record), 3))
    if case.noise != "uniform":
        error = NOISE_BOUND * drawn_errors(np.random.default_rng([case.seed, case.index, NOISE_STREAM]), case)
    for hidden in case.hidden:
        if hidden.place.effect == "outlier":
            error[int(hidden.place.where.removeprefix("position-")) - 1, hidden.place.axes[0] - 1] += hidden.values[0]
    written = np.round(record.specific_force + STANDARD_GRAVITY * error, RECORD_DECIMALS)
    return dataclasses.replace(record, specific_force=written, resolution=0.5 * 10.0**-RECORD_DECIMALS)


def component_of(place: EffectPlace) -> str | None:
    """The component that an effect extends; None for an outlier."""
    return CATALOGUE[place.effect].component


def entry_of(place: EffectPlace, values: Sequence[float]) -> dict[str, Any]:
    """An effect as a scenario file writes it."""
    entry: dict[str, Any] = {"effect": place.effect, "where": place.where}
    if place.order is not None:
        entry["order"] = place.order
    if place.axes:
        entry["axes"] = list(place.axes)
    names = [parameter.name for parameter in CATALOGUE[place.effect].at(place).parameters]
    return {**entry, **dict(zip(names, values, strict=True))}


def mounted_scenario(bench: Bench, index: int, entries: Sequence[Mapping[str, Any]], seed: int, *, own_errors: bool):
    """The whole programme in one of the mountings."""
    table = {
        **bench.truth["TurntableMotion"],
        "mounting": PRESETS[bench.mountings[index]].ravel().tolist(),
        "mounting_error": list(bench.mounting_errors[index]),
        "encoder_fluctuation_bound": ENCODER_FLUCTUATION if own_errors else 0.0,
    }
    # An error that is held over a rest is uniform within its bound; a mean of several would be small.
    block = {
        **bench.truth["AccelerometerBlock"],
        "noise_bound": BLOCK_NOISE if own_errors else 0.0,
        "held_fraction": 1.0,
    }
    # Within a step it cannot be seen which axis changed an input last.
    step = FINE_STEP_S if any(entry["effect"] == "hysteresis" for entry in entries) else STEP_S
    return bench_scenario(table, block, entries, bench.alpha, bench.beta, seed % 2**31, step)


def joined(bench: Bench, records: Sequence[PositionRecord]) -> PositionRecord:
    """Each mounting's own rows, in the order of the programme."""
    first = records[0]
    if len(records) == 1:
        return first
    rows = np.arange(len(bench.mounting))

    def own(name: str) -> NDArray | None:
        columns = [getattr(record, name) for record in records]
        return None if any(column is None for column in columns) else np.stack(columns)[bench.mounting, rows]

    names = ("time_s", "alpha", "beta", "specific_force", "temperature", "approach_alpha", "approach_beta", "scatter")
    columns: dict[str, Any] = {name: own(name) for name in names}
    return dataclasses.replace(first, mounting=tuple(bench.mountings[k] for k in bench.mounting), **columns)


def drawn_errors(rng: np.random.Generator, case: SuiteCase) -> NDArray:
    """Errors (N, 3) in units of σ: at ±1, or wandering within; more positions leave the first ones' as they were."""
    signs = rng.choice([-1.0, 1.0], size=(len(case.bench.alpha), 3))
    if case.noise == "edge":
        return signs
    errors, state = np.zeros_like(signs), np.zeros(3)
    for row, sign in enumerate(signs):
        state = HELD * state + (1.0 - HELD) * sign
        errors[row] = state
    return errors
