"""What is recorded: columns with units in their names."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl

from trihedron.errors import InputError
from trihedron.orchestrator.grid import Grid
from trihedron.orchestrator.interface import Interface, Variable, refer
from trihedron.orchestrator.quantities import conversion, suffix_for


@dataclass(frozen=True)
class Column:
    """A column of the record: value = factor * variable + offset."""

    name: str
    fmu: str
    variable: Variable
    factor: float = 1.0
    offset: float = 0.0


def resolve_columns(columns: Mapping[str, str] | None, interfaces: Mapping[str, Interface]) -> list[Column]:
    """The columns of the record; every output of every FMU where none are named.

    Raises
    ------
    InputError
        an unknown variable, an array, a repeated name, or a suffix that does not fit the variable's unit
    """
    if columns is None:
        return [
            Column(_default_name(interface.name, variable), interface.name, variable)
            for interface in interfaces.values()
            for variable in interface.variables.values()
            if variable.causality == "output"
        ]
    resolved = []
    for name, text in columns.items():
        try:
            if name == "time_s" or not name.strip() or any(c in name for c in ',"\r\n'):
                raise InputError("is not a name for a column (time_s is there by itself)")
            interface, variables = refer(text, interfaces, ("output",))
            if len(variables) != 1:
                raise InputError(f"'{text}' has {len(variables)} elements; a column takes one: '{text}[1]'")
            factor, offset = conversion(variables[0].unit, name, interface.scales)
        except InputError as error:
            raise InputError(f"record.columns.{name}: {error}") from error
        resolved.append(Column(name, interface.name, variables[0], factor, offset))
    return resolved


def _default_name(fmu: str, variable: Variable) -> str:
    suffix = suffix_for(variable.unit)
    return f"{fmu}.{variable.name}_{suffix}" if suffix else f"{fmu}.{variable.name}"


def recorded_variables(columns: Iterable[Column], fmu: str) -> list[Variable]:
    """The variables of one FMU that are recorded, each once."""
    return list(dict.fromkeys(column.variable for column in columns if column.fmu == fmu))


def record_table(
    columns: Iterable[Column], values: Mapping[tuple[str, str], Any], grid: Grid, every: int
) -> pl.DataFrame:
    """The record as a table, time first.

    Parameters
    ----------
    columns : iterable of Column
    values : mapping
        (FMU, variable) -> its recorded values, in the variable's own unit
    grid : Grid
    every : int
        every n-th communication point is a row
    """
    ticks = np.arange(0, grid.steps + 1, every)
    series = [pl.Series("time_s", grid.start + ticks * grid.step)]
    for column in columns:
        found = values[column.fmu, column.variable.name]
        if column.variable.access == "Real":
            found = np.ascontiguousarray(found)
            if (column.factor, column.offset) != (1.0, 0.0):
                found = column.factor * found + column.offset
            series.append(pl.Series(column.name, found, dtype=pl.Float64))
        elif column.variable.access == "Boolean":
            series.append(pl.Series(column.name, np.asarray(found) != 0, dtype=pl.Boolean))
        elif column.variable.access == "Integer":
            series.append(pl.Series(column.name, np.ascontiguousarray(found), dtype=pl.Int32))
        else:
            series.append(pl.Series(column.name, found, dtype=pl.String))
    return pl.DataFrame(series)
