"""A scenario without stimuli: programmes as components, constants as parameters, so that FMUs alone make the run."""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...models.position_programme import POSITIONS
from ..errors import InputError, said_of
from ..orchestrator.grid import make_grid
from ..orchestrator.interface import Interface, Value, Variable, spread
from ..orchestrator.loading import Loaded, Sources, load
from ..orchestrator.parameters import value_at_start
from ..orchestrator.programme import Programme, resolve_programme
from ..orchestrator.stimuli import resolve_constant
from ..orchestrator.tables import NumberTable, read_table, table_from
from ..scenario import Scenario, Stimulus

PROGRAMME = "PositionProgramme"
"""Name of the component."""

TIMING = ("max_rate", "max_acceleration", "initial_angle")
"""What a programme must know of its table."""


def self_contained(scenario: Scenario) -> Scenario:
    """The scenario with FMUs and parameters in place of its stimuli; it gives the same run.

    Raises
    ------
    InputError
        timed rows, which no component carries, or a programme of too many positions
    """
    with tempfile.TemporaryDirectory(prefix="trihedron-ssp-", ignore_cleanup_errors=True) as folder:
        loaded = load(scenario, Sources(scenario.base_folder), Path(folder))
    interfaces = {name: entry.interface for name, entry in loaded.items()}
    written = scenario.model_dump(by_alias=True, exclude_none=True, exclude={"stimuli", "base_folder", "source"})
    fmus, connections = dict(written["fmus"]), list(written["connections"])
    ends, first = [], {}
    for number, stimulus in enumerate(scenario.stimuli, start=1):
        with said_of(f"stimuli[{number}]"):
            if stimulus.kind == "rows":
                raise InputError("timed rows cannot stand in an .ssp; give constants or a position programme")
            if stimulus.kind == "constant":
                drive = resolve_constant(stimulus, interfaces)
                given = dict(zip((v.name for v in drive.variables), drive.values[0], strict=True))
                _set(fmus, interfaces[drive.fmu], given)
                continue
            positions = _positions(scenario, stimulus, number)
            programme = resolve_programme(stimulus, positions, scenario.run, interfaces, _starts(loaded))
            ends.append(programme.end)
            name = _free_name("programme", [*fmus, *first])
            parameters = _parameters(programme, positions, stimulus, loaded[programme.fmu], scenario.run.step_s)
            first[name] = {"component": PROGRAMME, "parameters": parameters}
            connections.append({"from": f"{name}.command", "to": stimulus.to})
    stop = scenario.run.stop_s
    if stop is None:
        grid = make_grid(scenario.run, ends)
        stop = grid.time(grid.steps)
    run = {**written["run"], "stop_s": stop}
    paths = {"base_folder": scenario.base_folder, "source": scenario.source}
    # The programmes stand first: some tools step in this order.
    return Scenario.model_validate(
        {**written, **paths, "run": run, "fmus": {**first, **fmus}, "connections": connections}
    )


def _starts(loaded: Mapping[str, Loaded]) -> Any:
    def parameter(fmu: str, variable: Variable) -> Value | None:
        return value_at_start(variable, loaded[fmu].values)

    return parameter


def _free_name(wanted: str, taken: list[str]) -> str:
    names = [wanted, *(f"{wanted}_{i}" for i in range(2, len(taken) + 3))]
    return next(name for name in names if name not in taken)


def _set(fmus: dict[str, Any], interface: Interface, values: Mapping[str, Value]) -> None:
    """Give parameters or inputs, element by element, over what the scenario says of them."""
    setting = dict(fmus[interface.name])
    elements: dict[str, Value] = {}
    for name, value in setting.get("parameters", {}).items():
        elements |= {variable.name: item for variable, item in spread(value, interface.find(name), name)}
    fmus[interface.name] = {**setting, "parameters": {**elements, **values}}


def _positions(scenario: Scenario, stimulus: Stimulus, number: int) -> NumberTable:
    if stimulus.programme is None:
        return table_from(stimulus.table, f"stimuli[{number}].table", None)
    return read_table(scenario.base_folder / stimulus.programme, stimulus.programme, None)[0]


def _parameters(
    programme: Programme, positions: NumberTable, stimulus: Stimulus, table: Loaded, step: float
) -> dict[str, Any]:
    """The parameters of the component that commands what the programme does."""
    count = len(programme.command)
    if count > POSITIONS:
        raise InputError(f"{positions.label}: has {count} positions; the component {PROGRAMME} takes {POSITIONS}")
    dwell = positions.columns.get("dwell_s", np.full(count, stimulus.dwell_s))
    columns = {"alpha": programme.command[:, 0], "beta": programme.command[:, 1], "dwell_time": dwell}
    values: dict[str, Any] = {"positions": count, "period": step}
    for name in TIMING:
        values[name] = [value_at_start(v, table.values) for v in table.interface.find(name)]
    for name, numbers in columns.items():
        values |= {f"{name}[{i + 1}]": float(number) for i, number in enumerate(numbers)}
    return values
