"""Position programmes: which commanded position holds from which step on."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models.motion import move_duration
from ...models.position_programme import TICK_TOLERANCE
from ..errors import InputError, nearest
from ..scenario import RunSetting, Stimulus
from .grid import MOST_STEPS, Grid
from .interface import Interface, Value, Variable
from .stimuli import Drive, in_limits, input_variables
from .tables import NumberTable

ParameterValue = Callable[[str, Variable], Value | None]


@dataclass(frozen=True)
class Programme:
    """A position programme in whole steps: the command of row i holds from tick `begins[i]` on."""

    fmu: str
    variables: tuple[Variable, ...]
    command: np.ndarray
    begins: np.ndarray
    end: int


def resolve_programme(
    stimulus: Stimulus,
    table: NumberTable,
    run: RunSetting,
    interfaces: Mapping[str, Interface],
    parameter: ParameterValue,
) -> Programme:
    """Lay a position programme out in whole steps.

    Each position's slot is the move from the position before (the slower axis, limited rate and acceleration)
    and the dwell, rounded up to whole steps.

    Parameters
    ----------
    stimulus : Stimulus
        with `to`, the command of two angles [rad]
    table : NumberTable
        alpha_deg, beta_deg and, where it is there, dwell_s
    run : RunSetting
    interfaces : mapping
    parameter : callable
        (FMU, variable) -> the value that it starts with

    Raises
    ------
    InputError
        a column that a programme does not have, no dwell, or a target that is not a two-axis command
    """
    known = ["alpha_deg", "beta_deg", "dwell_s"]
    for name in table.columns:
        if name not in known:
            raise InputError(f"{table.label}: unknown column '{name}'; {nearest(name, known)}")
    for name in known[:2]:
        if name not in table.columns:
            raise InputError(f"{table.label}: column '{name}' is missing; a programme has {', '.join(known)}")
    assert stimulus.to is not None
    interface, variables = input_variables(stimulus.to, interfaces)
    if len(variables) != 2 or any(v.kind != "Real" for v in variables):
        raise InputError(f"'{stimulus.to}' cannot take a position programme: two angles are needed")
    for variable in variables:
        if variable.unit not in (None, "rad"):
            raise InputError(f"'{stimulus.to}' is in {variable.unit}; a position programme gives rad")
    limits = {}
    for name in ("max_rate", "max_acceleration", "initial_angle"):
        try:
            found = interface.find(name)
        except InputError as error:
            raise InputError(f"a position programme needs {name}[1..2] to time its moves: {error}") from error
        values = [parameter(interface.name, v) for v in found]
        if len(values) != 2 or not all(isinstance(v, float) for v in values):
            raise InputError(f"a position programme needs two numbers {name} of '{interface.name}' to time its moves")
        limits[name] = [float(v) for v in values if isinstance(v, float)]
        if name != "initial_angle" and min(limits[name]) <= 0.0:
            raise InputError(f"'{interface.name}.{name}' must be positive: {limits[name]}")
    if "dwell_s" in table.columns:
        dwell = table.columns["dwell_s"]
    elif stimulus.dwell_s is not None:
        dwell = np.full(len(table.lines), stimulus.dwell_s)
    else:
        raise InputError(f"{table.label}: has no column dwell_s, so the stimulus must give dwell_s")
    command = np.radians(np.column_stack([table.columns["alpha_deg"], table.columns["beta_deg"]]))
    begins, tick = [], 0
    before = limits["initial_angle"]
    for row, target in enumerate(command.tolist()):
        if dwell[row] <= 0.0:
            raise InputError(f"{table.row(row)}, column 'dwell_s': {dwell[row]} must be positive")
        for variable, angle in zip(variables, target, strict=True):
            in_limits(angle, variable, table.row(row))
        move = max(
            move_duration(abs(target[i] - before[i]), limits["max_rate"][i], limits["max_acceleration"][i])
            for i in range(2)
        )
        begins.append(tick)
        slot = (move + float(dwell[row])) / run.step_s
        if slot > MOST_STEPS:
            raise InputError(f"{table.row(row)}: takes {slot:.3g} steps; no run is that long")
        if slot <= TICK_TOLERANCE:
            raise InputError(f"{table.row(row)}: takes {slot:.3g} of a step; take a shorter run.step_s")
        tick += math.ceil(slot - TICK_TOLERANCE)
        before = target
    return Programme(interface.name, variables, command, np.array(begins), tick)


def drive_of_programme(programme: Programme, grid: Grid) -> Drive:
    """The programme's commands over the steps of the run; the last one holds to the end."""
    within = programme.begins < grid.steps
    return Drive(programme.fmu, programme.variables, programme.command[within], programme.begins[within])
