"""Records with one hidden effect, made by simulation in time; the diagnosis gets the record and nothing else."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..fmus.units import STANDARD_GRAVITY
from ..models.effects import CATALOGUE
from .errors import InputError
from .files import write_text
from .hidden_cases import DWELL_S, NOISE_BOUND, HiddenCase, draw_case, temperature_at
from .orchestrator import simulate
from .records import PositionRecord, RawRecord, write_record
from .records.rests import average_rests, find_rests
from .scenario import Scenario
from .shown import Shown

if TYPE_CHECKING:
    from polars import DataFrame

ENCODER_FLUCTUATION = math.radians(0.4 / 3600.0)
"""Bound of the fluctuation of each encoder [rad]; its effect on a reading stays below it, to 3 %."""
BLOCK_NOISE = NOISE_BOUND - 1.05 * ENCODER_FLUCTUATION
"""Bound of the block's own error [g]."""
STEP_S = 0.25
LONGEST_RUN_S = 4000.0
"""The temperature is laid down for so long."""
START_APART = 0.3
"""So far [rad] from its first position the table starts."""
RECORD_DECIMALS = 9
"""Decimals of a record's numbers, as laboratories write them."""


def raw_record_scenario(case: HiddenCase, seed: int) -> Scenario:
    """The scenario in which the bench, with its secret composed into the components, is measured."""
    entries = []
    if case.place is not None and CATALOGUE[case.place.effect].component is not None:
        answer = case.answer()
        entries = [{**answer.pop("parameters"), **answer}]
    table: dict[str, Any] = {**case.truth["TurntableMotion"], "encoder_fluctuation_bound": ENCODER_FLUCTUATION}
    block: dict[str, Any] = {
        **case.truth["AccelerometerBlock"],
        "noise_bound": BLOCK_NOISE,
        "held_fraction": 0.8,
    }
    return bench_scenario(table, block, entries, case.alpha, case.beta, seed)


def bench_scenario(
    table: Mapping[str, Any],
    block: Mapping[str, Any],
    effects: Sequence[Mapping[str, Any]],
    alpha: NDArray,
    beta: NDArray,
    seed: int,
    step_s: float = STEP_S,
) -> Scenario:
    """The scenario in which the table carries the block from position to position and dwells at each.

    Parameters
    ----------
    table, block : mapping
        parameters of the two components, but for the seed and where the table starts
    effects : sequence of mapping
        as in a scenario file
    alpha, beta : (N,) array
        commanded angles [rad]
    seed : int
        of the components' errors
    step_s : float
        communication step [s]
    """
    own = {
        component: [dict(e) for e in effects if CATALOGUE[str(e["effect"])].component == component]
        for component in ("TurntableMotion", "AccelerometerBlock")
    }
    seconds = np.arange(0.0, LONGEST_RUN_S, 1.0)
    return Scenario.model_validate(
        {
            "schema": "trihedron.scenario/1",
            "title": "a measured record",
            "run": {"step_s": step_s},
            "fmus": {
                "table": {
                    "component": "TurntableMotion",
                    "effects": own["TurntableMotion"],
                    "parameters": {
                        **table,
                        # Every position has a move before it, whose sense the record can tell.
                        "initial_angle": [float(alpha[0]) - START_APART, float(beta[0]) - START_APART],
                        "seed": seed % 2**31,
                    },
                },
                "block": {
                    "component": "AccelerometerBlock",
                    "effects": own["AccelerometerBlock"],
                    "parameters": {**block, "seed": seed % 2**31},
                },
            },
            "connections": [
                {"from": "table.specific_force", "to": "block.specific_force"},
                {"from": "table.dwell", "to": "block.dwell"},
            ],
            "stimuli": [
                {
                    "to": "table.command",
                    "table": {"alpha_deg": np.degrees(alpha).tolist(), "beta_deg": np.degrees(beta).tolist()},
                    "dwell_s": DWELL_S,
                },
                {
                    "table": {
                        "time_s": seconds.tolist(),
                        "temperature_degC": temperature_at(seconds / 3600.0).tolist(),
                    },
                    "columns": {
                        "table.temperature": "temperature_degC",
                        "block.temperature": "temperature_degC",
                    },
                },
            ],
            "record": {
                "columns": {
                    "alpha_deg": "table.angle_reading[1]",
                    "beta_deg": "table.angle_reading[2]",
                    **{f"f{p}_mps2": f"block.reading[{p}]" for p in (1, 2, 3)},
                    "temperature_degC": "block.temperature",
                }
            },
        }
    )


def measure(case: HiddenCase, seed: int, *, progress: bool = False) -> PositionRecord:
    """Simulate the bench in time and average its rests.

    Parameters
    ----------
    case : HiddenCase
    seed : int
        of the errors

    Returns
    -------
    PositionRecord
        what a laboratory would hand over
    """
    record = record_of(raw_record_scenario(case, seed), progress=progress)
    if case.place is not None and case.place.effect == "outlier":
        row = int(case.place.where.removeprefix("position-")) - 1
        record.specific_force[row, case.place.axes[0] - 1] += case.values[0] * STANDARD_GRAVITY
    return record


def record_of(scenario: Scenario, *, every: bool = False, progress: bool = False) -> PositionRecord:
    """Run a scenario of `bench_scenario` and average its rests; with `every` those too whose readings drift."""
    run = simulate(scenario, progress=progress).table
    raw = RawRecord(
        time_s=run["time_s"].to_numpy(),
        alpha=np.radians(run["alpha_deg"].to_numpy()),
        beta=np.radians(run["beta_deg"].to_numpy()),
        specific_force=np.stack([run[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1),
        temperature=run["temperature_degC"].to_numpy(),
    )
    rests = find_rests(raw)
    return average_rests(raw, [replace(rest, refused=None) for rest in rests] if every else rests)


def check_seed(seed: int) -> None:
    """Refuse a seed that the components' generators do not take."""
    if not 0 <= seed < 2**31:
        raise InputError(f"--seed {seed}: must be a whole number from 0 to {2**31 - 1}")


@dataclass(frozen=True, repr=False)
class HiddenRecord(Shown):
    """A "measured" record, and what was hidden in it; printed, it keeps its secret."""

    record: PositionRecord
    secret: dict[str, Any]

    def lines(self) -> list[str]:
        """The record alone."""
        return str(self.record).split("\n")

    def to_polars(self) -> "DataFrame":
        """The record."""
        return self.record.to_polars()


def hidden_record(
    seed: int, *, effects: Sequence[str] | None = None, symmetric: bool = False, progress: bool = False
) -> HiddenRecord:
    """Draw a case and measure it; arguments as for `write_hidden_record`."""
    check_seed(seed)
    case = draw_case(seed, effects=effects, symmetric=symmetric)
    secret = {"hidden": case.answer(), "seed": seed, "truth": case.truth}
    return HiddenRecord(measure(case, seed, progress=progress), secret)


def write_hidden_record(
    path: Path,
    seed: int,
    answer: Path | None,
    *,
    effects: Sequence[str] | None = None,
    symmetric: bool = False,
    progress: bool = False,
) -> None:
    """Draw a case, measure it and write the record; the secret goes to `answer`, or nowhere.

    Parameters
    ----------
    path : Path
        position record (CSV)
    seed : int
        from 0 to 2**31 - 1
    answer : Path or None
        JSON file for the secret and the bench's true parameters
    effects, symmetric
        as for `draw_case`
    """
    hidden = hidden_record(seed, effects=effects, symmetric=symmetric, progress=progress)
    if answer is not None:
        write_text(answer, json.dumps(hidden.secret, indent=2) + "\n")
    try:
        write_record(hidden.record, path, decimals=RECORD_DECIMALS)
    except InputError:
        if answer is not None:
            answer.unlink(missing_ok=True)
        raise
