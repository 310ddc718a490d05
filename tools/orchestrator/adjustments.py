"""Adjustments of a scenario by options of the command: values, a table of inputs, recorded variables, the solver."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import polars as pl

from ..errors import InputError, nearest
from ..result import checked_sections
from .scenario import FmuSetting, RunOptions, Scenario, Stimulus
from .stimuli import read_number_table

TIMES = ("time", "time_s", "t")
"""Heads of the column of times in a table of inputs; otherwise it is the first column."""


@dataclass(frozen=True)
class Adjustments:
    """Options of a run that act on FMUs, each with the name of a variable or of an FMU and its variable.

    `values` are texts `NAME=VALUE`; `inputs` is a table as FMPy and fmusim read it; `record` are the variables to
    record. `tolerance` is that of solvers; `interface` chooses between model exchange and co-simulation.
    """

    values: Sequence[str] = ()
    inputs: Path | None = None
    record: Sequence[str] = ()
    tolerance: float | None = None
    interface: Literal["me", "cs"] | None = None

    def __post_init__(self) -> None:
        if self.tolerance is not None and not 0.0 < self.tolerance < 1.0:
            raise InputError(f"--tolerance {self.tolerance:g}: must be between 0 and 1")

    def on(self, scenario: Scenario, options: RunOptions) -> Scenario:
        """Return the scenario with the options of the run and these adjustments.

        Raises InputError for an option that names nothing in the scenario.
        """
        adjusted = options.over(scenario)
        fmus = {name: self._setting(setting) for name, setting in adjusted.fmus.items()}
        for text in self.values:
            name, sign, value = text.partition("=")
            if not sign or not name.strip():
                raise InputError(f"--set {text}: write NAME=VALUE, as --set mass=2.5")
            fmu, variable = named(name.strip(), adjusted, "--set")
            parameters = {**fmus[fmu].parameters, variable: _literal(value.strip())}
            fmus[fmu] = fmus[fmu].model_copy(update={"parameters": parameters})
        changes: dict[str, Any] = {"fmus": fmus}
        if self.inputs is not None:
            changes["stimuli"] = [*adjusted.stimuli, self._stimulus(self.inputs, adjusted)]
        if self.record:
            columns = {}
            for text in self.record:
                reference = ".".join(named(text, adjusted, "--record"))
                columns[reference] = reference
            changes["record"] = adjusted.record.model_copy(update={"columns": columns, "own_units": True})
        return adjusted.model_copy(update=changes)

    def _setting(self, setting: FmuSetting) -> FmuSetting:
        """Return the setting of an FMU with the tolerance and the interface, if it is from a file."""
        if setting.fmu is None:
            return setting
        changes = {"tolerance": self.tolerance, "interface": self.interface}
        return setting.model_copy(update={key: value for key, value in changes.items() if value is not None})

    def _stimulus(self, path: Path, scenario: Scenario) -> Stimulus:
        """Return the rows of a table of inputs: times, and a column for each input by its name."""
        table, _ = read_number_table(path, str(path), None)
        heads = list(table.columns)
        time = next((head for head in heads if head in TIMES), heads[0])
        columns = {}
        for head in heads:
            if head != time:
                columns[".".join(named(head, scenario, f"--input {path}"))] = head
        if not columns:
            raise InputError(f"--input {path}: has no column of an input beside '{time}'")
        frame = pl.DataFrame({"time_s" if head == time else head: values for head, values in table.columns.items()})
        return checked_sections({"table": frame, "columns": columns, "interpolate": True}, Stimulus)


def named(text: str, scenario: Scenario, option: str) -> tuple[str, str]:
    """Return the FMU and the variable of a name; a single FMU need not be named.

    Raises InputError if the name begins with no FMU of the scenario.
    """
    parts = text.split(".")
    for count in range(len(parts) - 1, 0, -1):
        fmu = "_".join(parts[:count])
        if fmu in scenario.fmus:
            return fmu, ".".join(parts[count:])
    if len(scenario.fmus) == 1:
        return next(iter(scenario.fmus)), text
    close = nearest(parts[0], list(scenario.fmus))
    raise InputError(f"{option} {text}: name the FMU and its variable, FMU.NAME; {close}")


def _literal(text: str) -> Any:
    """Return the number, truth value, list or text that is written."""
    try:
        value = json.loads(text)
    except ValueError:
        return text
    if isinstance(value, Mapping) or value is None:
        return text
    if isinstance(value, float) and not math.isfinite(value):
        raise InputError(f"--set: {text} is not a finite number")
    return value
