"""A run that is a scenario, simulated with other parameters; calibrated and diagnosed where it measures."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
import polars as pl

from ...models.bench import TARGETS
from ..calibration import calibrate
from ..errors import InputError, nearest
from ..orchestrator.load import SETTABLE
from ..orchestrator.run import PreparedScenario
from ..orchestrator.scenario import read_scenario
from ..records import PositionRecord, RawRecord
from ..records.rests import position_record_of
from .calibration_runs import record_table
from .design import Value, short_seed
from .file import Campaign
from .kinds import Output, Result
from .settings import Reduction, SimulationSetting

RAW_COLUMNS = ("alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2")


class SimulationRuns:
    """Simulations of a scenario, whose FMUs are loaded once.

    A parameter is `fmu.variable`, or `fmu.variable[k]` for an element. The scalars are those that the campaign file
    takes of the record's columns, or the last value of each, and with `calibrate` the verdict, radius, estimates and
    guaranteed errors of the rests' averages.
    """

    def __init__(self, campaign: Campaign, setting: SimulationSetting) -> None:
        self.setting, self.keep = setting, campaign.keep
        self.scenario = PreparedScenario(read_scenario(campaign.base_folder / setting.scenario))
        interfaces = self.scenario.interfaces
        for name in campaign.parameters:
            fmu, _, variable = name.partition(".")
            if fmu not in interfaces or not variable:
                known = nearest(fmu, list(interfaces))
                raise InputError(f"parameters.{name}: must begin with the name of an FMU and a dot; {known}")
            try:
                found = interfaces[fmu].find(variable, SETTABLE)
            except InputError as error:
                raise InputError(f"parameters.{name}: {error}") from error
            if len(found) != 1:
                raise InputError(f"parameters.{name}: has {len(found)} elements; sweep one: {name}[1]")
        columns = [column.name for column in self.scenario.columns]
        self.reductions = setting.scalars or {name: Reduction(column=name) for name in columns}
        for name, reduction in self.reductions.items():
            if reduction.column not in columns:
                known = nearest(reduction.column, columns)
                raise InputError(f"simulation.scalars.{name}: the record has no column '{reduction.column}'; {known}")
        self.measures = setting.calibrate or campaign.keep.diagnosis
        if self.measures:
            missing = [name for name in RAW_COLUMNS if name not in columns]
            if missing:
                raise InputError(f"simulation: to calibrate or diagnose, the record must have a column {missing[0]}")
        self.outputs: dict[str, Output] = {name: Output(pl.Float64) for name in self.reductions}
        if setting.calibrate:
            of_targets = {f"{s}_{what}": Output(pl.Float64) for s in TARGETS for what in ("estimate", "guaranteed")}
            verdict = Output(pl.String, good=("consistent",))
            self.outputs |= {"verdict": verdict, "radius": Output(pl.Float64, "lower"), **of_targets}
        swept = campaign.parameters
        self.seeded = [n for n, i in interfaces.items() if "seed" in i.variables and f"{n}.seed" not in swept]

    def run(self, number: int, values: Mapping[str, Value], seed: np.random.SeedSequence) -> Result:
        """Simulate the scenario."""
        parameters: dict[str, dict[str, Any]] = {}
        if self.setting.seeds == "derived":
            for name, own in zip(self.seeded, seed.spawn(len(self.seeded)), strict=True):
                parameters[name] = {"seed": short_seed(own)}
        for name, value in values.items():
            fmu, _, variable = name.partition(".")
            whole = isinstance(value, float) and self._is_whole(fmu, variable)
            parameters.setdefault(fmu, {})[variable] = int(value) if whole else value
        table = self.scenario.run(parameters)
        scalars: dict[str, Value | int | None] = {
            name: reduced(table[reduction.column].to_numpy(), reduction.take)
            for name, reduction in self.reductions.items()
        }
        told = None
        if self.measures:
            record = positions_of(table)
            sigma = self.setting.noise_bound
            if self.setting.calibrate:
                found = calibrate(record, noise_bound=sigma)
                scalars |= {"verdict": found.verdict, "radius": found.radius}
                for estimate in found.parameters:
                    scalars[f"{estimate.symbol}_estimate"] = estimate.estimate
                    scalars[f"{estimate.symbol}_guaranteed"] = estimate.guaranteed_error
            if self.keep.diagnosis:
                from ..diagnosis import diagnose

                diagnosis = diagnose(record, noise_bound=sigma, rerun=False).to_json()
                told = json.dumps(diagnosis, ensure_ascii=False, allow_nan=False)
            return Result(scalars, record_table(record) if self.keep.record else None, told)
        return Result(scalars, table if self.keep.record else None)

    def _is_whole(self, fmu: str, variable: str) -> bool:
        kind = self.scenario.interfaces[fmu].find(variable, SETTABLE)[0].kind
        return kind in ("Integer", "Enumeration") or "Int" in kind


def reduced(values: np.ndarray, take: str) -> float:
    """A number from a column."""
    x = np.asarray(values, dtype=float)
    size = {
        "last": lambda: x[-1],
        "first": lambda: x[0],
        "mean": lambda: x.mean(),
        "min": lambda: x.min(),
        "max": lambda: x.max(),
        "max-abs": lambda: np.abs(x).max(),
        "rms": lambda: np.sqrt(np.mean(x * x)),
        "std": lambda: x.std(),
    }
    return float(size[take]())


def positions_of(table: pl.DataFrame) -> PositionRecord:
    """The position record of a run that was recorded as a raw record."""
    temperature = table["temperature_degC"].to_numpy() if "temperature_degC" in table.columns else None
    raw = RawRecord(
        time_s=table["time_s"].to_numpy(),
        alpha=np.radians(table["alpha_deg"].to_numpy()),
        beta=np.radians(table["beta_deg"].to_numpy()),
        specific_force=np.stack([table[f"f{p}_mps2"].to_numpy() for p in (1, 2, 3)], axis=1),
        temperature=temperature,
    )
    return position_record_of(raw)
