"""Records with one hidden effect, made by simulation in time; the diagnosis gets the record and nothing else."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.errors import InputError
from trihedron.hidden_cases import DWELL_S, NOISE_BOUND, HiddenCase, draw_case, temperature_at
from trihedron.models.effects import CATALOGUE
from trihedron.orchestrator import simulate
from trihedron.records import PositionRecord, RawRecord, write_position_record
from trihedron.records.rests import average_rests, find_rests
from trihedron.scenario import Scenario
from trihedron.writing import write_text

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
    effects: dict[str, list[dict[str, Any]]] = {name: [] for name in case.truth}
    if case.place is not None and (component := CATALOGUE[case.place.effect].component) is not None:
        answer = case.answer()
        effects[component].append({**answer.pop("parameters"), **answer})
    seconds = np.arange(0.0, LONGEST_RUN_S, 1.0)
    return Scenario.model_validate(
        {
            "schema": "trihedron.scenario/1",
            "title": "a measured record",
            "run": {"step_s": STEP_S},
            "fmus": {
                "table": {
                    "component": "TurntableMotion",
                    "effects": effects["TurntableMotion"],
                    "parameters": {
                        **case.truth["TurntableMotion"],
                        "encoder_fluctuation_bound": ENCODER_FLUCTUATION,
                        # Every position has a move before it, whose sense the record can tell.
                        "initial_angle": [float(case.alpha[0]) - START_APART, float(case.beta[0]) - START_APART],
                        "seed": seed % 2**31,
                    },
                },
                "block": {
                    "component": "AccelerometerBlock",
                    "effects": effects["AccelerometerBlock"],
                    "parameters": {
                        **case.truth["AccelerometerBlock"],
                        "noise_bound": BLOCK_NOISE,
                        "held_fraction": 0.8,
                        "seed": seed % 2**31,
                    },
                },
            },
            "connections": [
                {"from": "table.specific_force", "to": "block.specific_force"},
                {"from": "table.dwell", "to": "block.dwell"},
            ],
            "stimuli": [
                {
                    "to": "table.command",
                    "table": {
                        "alpha_deg": np.degrees(case.alpha).tolist(),
                        "beta_deg": np.degrees(case.beta).tolist(),
                    },
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
    run = simulate(raw_record_scenario(case, seed), progress=progress).table
    raw = RawRecord(
        time_s=run["time_s"].to_numpy(),
        alpha=np.radians(run["alpha_deg"].to_numpy()),
        beta=np.radians(run["beta_deg"].to_numpy()),
        specific_force=np.stack([run[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1),
        temperature=run["temperature_degC"].to_numpy(),
    )
    record = average_rests(raw, find_rests(raw))
    if case.place is not None and case.place.effect == "outlier":
        row = int(case.place.where.removeprefix("position-")) - 1
        record.specific_force[row, case.place.axes[0] - 1] += case.values[0] * 9.80665
    return record


def check_seed(seed: int) -> None:
    """Refuse a seed that the components' generators do not take."""
    if not 0 <= seed < 2**31:
        raise InputError(f"--seed {seed}: must be a whole number from 0 to {2**31 - 1}")


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
    check_seed(seed)
    case = draw_case(seed, effects=effects, symmetric=symmetric)
    record = measure(case, seed, progress=progress)
    if answer is not None:
        secret = {"hidden": case.answer(), "seed": seed, "truth": case.truth}
        write_text(answer, json.dumps(secret, indent=2) + "\n")
    try:
        write_position_record(record, path, decimals=RECORD_DECIMALS)
    except InputError:
        if answer is not None:
            answer.unlink(missing_ok=True)
        raise
