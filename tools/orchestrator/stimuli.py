"""Stimuli: which value drives which input over which step."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError, nearest
from ..scenario import Stimulus
from .grid import Grid
from .interface import Interface, Value, Variable, checked, refer, spread
from .quantities import conversion, is_angle
from .tables import NumberTable

ROW_TOLERANCE = 1e-3
"""How far (in steps) a row's time may be off a tick that it is meant for: digits that a file leaves off."""


@dataclass(frozen=True)
class Drive:
    """Values for some inputs of one FMU: from step `begins[i]` on row i of `values`; without `begins` one for ever."""

    fmu: str
    variables: tuple[Variable, ...]
    values: list[list[Value]] | np.ndarray
    begins: np.ndarray | None


def input_variables(text: str, interfaces: Mapping[str, Interface]) -> tuple[Interface, tuple[Variable, ...]]:
    """The inputs that a text names; anything but an input is refused."""
    interface, variables = refer(text, interfaces, ("input",))
    for variable in variables:
        if variable.causality != "input":
            inputs = [v.name for v in interface.variables.values() if v.causality == "input"]
            raise InputError(f"'{text}' is not an input ({variable.causality}); {nearest(variable.name, inputs)}")
    return interface, variables


def in_limits(value: Value, variable: Variable, where: str) -> Value:
    """A value as the variable's type takes it; what is wrong with it begins with its place."""
    try:
        return checked(value, variable)
    except InputError as error:
        raise InputError(f"{where}: {error}") from error


def resolve_constant(stimulus: Stimulus, interfaces: Mapping[str, Interface]) -> Drive:
    """A constant for an input or for each element of an array."""
    assert stimulus.to is not None
    assert stimulus.constant is not None
    interface, variables = input_variables(stimulus.to, interfaces)
    values = spread(stimulus.constant, variables, stimulus.to)
    return Drive(interface.name, variables, [[value for _, value in values]], None)


def _stretches(table: NumberTable, grid: Grid, *, at_end: bool, increments: bool) -> tuple[np.ndarray, np.ndarray]:
    """The rows that hold over some step, and the step from which each holds."""
    times = table.columns["time_s"]
    back = np.flatnonzero(np.diff(times) <= 0.0)
    if back.size:
        raise InputError(f"{table.row(int(back[0]) + 1)}, column 'time_s': does not come after the row before")
    ticks = (times - grid.start) / grid.step
    near = np.round(ticks)
    ticks = np.where(np.abs(ticks - near) <= ROW_TOLERANCE, near, ticks)
    if not at_end:
        if ticks[0] > 0.0:
            raise InputError(
                f"{table.row(0)}: begins at {times[0]:.9g} s, after the run's start {grid.start:.9g} s: "
                'the input has no value before (stamp = "end" where rows hold up to their time)'
            )
        return _held(np.ceil(ticks), grid)
    if ticks[-1] < grid.steps:
        raise InputError(
            f"{table.row(len(ticks) - 1)}: ends at {times[-1]:.9g} s, "
            f"before the run's end {grid.time(grid.steps):.9g} s"
        )
    width = ticks[1] - ticks[0] if len(ticks) > 1 else 1.0
    # Row i holds over the steps that end after the row before and not after it.
    rows, begins = _held(np.concatenate([[-math.inf], np.floor(ticks[:-1])]), grid)
    if rows[0] == 0 and ticks[0] - width > ROW_TOLERANCE:
        raise InputError(
            f"{table.row(0)}: its interval ends at {times[0]:.9g} s, "
            f"and nothing covers the run's start {grid.start:.9g} s"
        )
    lost = np.flatnonzero(np.diff(rows) > 1)
    if lost.size:
        at = int(lost[0]) + 1
        first, last = table.lines[rows[at] - 1], table.lines[rows[at]]
        raise InputError(
            f"{table.label}: rows {first} and {last} both end within the step that ends at "
            f"{grid.time(int(begins[at]) + 1):.9g} s, so that one is lost; take a shorter run.step_s"
        )
    again = np.flatnonzero(np.diff(np.append(begins, grid.steps)) > 1)
    if increments and again.size:
        row, step = int(rows[again[0]]), int(begins[again[0]]) + 1
        raise InputError(
            f"{table.row(row)}: an increment would be applied again in the step that ends at "
            f"{grid.time(step + 1):.9g} s; run.step_s must be the rows' interval"
        )
    return rows, begins


def _held(begins: np.ndarray, grid: Grid) -> tuple[np.ndarray, np.ndarray]:
    """Of rows that hold from fractional steps on, those that hold over a step, and their first steps."""
    first = np.clip(begins, 0.0, grid.steps).astype(np.int64)
    kept = np.flatnonzero(np.diff(np.append(first, grid.steps)) > 0)
    return kept, first[kept]


def resolve_rows(
    stimulus: Stimulus,
    read: Callable[[list[str]], NumberTable],
    grid: Grid,
    interfaces: Mapping[str, Interface],
) -> list[Drive]:
    """Timed rows for inputs, one drive for each FMU and type.

    Parameters
    ----------
    stimulus : Stimulus
        with `columns` and `stamp`
    read : callable
        names of columns -> the table
    grid : Grid
    interfaces : mapping

    Raises
    ------
    InputError
        a column that is missing, of another dimension than its variable, or rows that do not cover the run
    """
    assert stimulus.columns is not None
    wires: list[tuple[Interface, Variable, str, float, float]] = []
    for text, column in stimulus.columns.items():
        interface, variables = input_variables(text, interfaces)
        if len(variables) != 1:
            raise InputError(f"columns.'{text}' is an array; name each element: '{text}[1]' = \"...\"")
        variable = variables[0]
        if variable.kind == "String":
            raise InputError(f"columns.'{text}' is a String; rows are numbers")
        factor, offset = conversion(variable.unit, column, interface.scales)
        wires.append((interface, variable, column, factor, offset))
    table = read(["time_s", *(column for _, _, column, _, _ in wires)])
    increments = any(is_angle(variable.unit, interface.scales) for interface, variable, *_ in wires)
    rows, begins = _stretches(table, grid, at_end=stimulus.stamp == "end", increments=increments)
    groups: dict[tuple[str, str], list[tuple[Variable, np.ndarray]]] = {}
    for interface, variable, column, factor, offset in wires:
        values = table.columns[column]
        if (factor, offset) != (1.0, 0.0):
            values = (values - offset) / factor
        groups.setdefault((interface.name, variable.access), []).append((variable, values))
        _check_column(table, column, variable, values)
    return [
        Drive(fmu, tuple(v for v, _ in group), _chosen(np.column_stack([values for _, values in group]), rows), begins)
        for (fmu, _), group in groups.items()
    ]


def _chosen(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Some rows; where these are all of them, no copy: runs of an hour at 1 kHz are large."""
    return values if len(rows) == len(values) else values[rows]


def _check_column(table: NumberTable, column: str, variable: Variable, values: np.ndarray) -> None:
    """Refuse a value that the variable's type or limits do not take."""
    if variable.kind == "Real":
        low = -math.inf if variable.minimum is None else variable.minimum
        high = math.inf if variable.maximum is None else variable.maximum
        suspects = np.flatnonzero((values < low) | (values > high))
    else:
        suspects = np.arange(len(values))
    for index in suspects.tolist():
        value: Value = float(values[index])
        if variable.kind == "Boolean" and value in (0.0, 1.0):
            value = bool(value)
        elif variable.kind in ("Integer", "Enumeration") and value == math.floor(value):
            value = int(value)
        in_limits(value, variable, f"{table.row(index)}, column '{column}'")
