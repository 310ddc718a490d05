"""What is recorded: columns with units in their names."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import polars as pl

from ..errors import InputError
from .blocks import Values
from .grid import Grid
from .interface import Interface, Variable, refer
from .quantities import conversion, suffix_for
from .value_types import VALUE_TYPES


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
            if variable.causality == "output" and variable.access in VALUE_TYPES
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
            _ = variables[0].value_type
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


def block_table(columns: Iterable[Column], values: Values, ticks: range, grid: Grid) -> pl.DataFrame:
    """Rows of the record as a table, time first.

    Parameters
    ----------
    columns : iterable of Column
    values : mapping
        (FMU, variable) -> its recorded values, in the variable's own unit
    ticks : range
        communication points of the rows
    grid : Grid
    """
    series = [pl.Series("time_s", grid.start + np.arange(ticks.start, ticks.stop, ticks.step) * grid.step)]
    for column in columns:
        variable, found = column.variable, values[column.fmu, column.variable.name]
        if variable.kind == "Real":
            found = np.array(found, dtype=np.float64)
            if (column.factor, column.offset) != (1.0, 0.0):
                found = column.factor * found + column.offset
            series.append(pl.Series(column.name, found))
        elif variable.kind == "Boolean":
            series.append(pl.Series(column.name, np.asarray(found) != 0, dtype=pl.Boolean))
        elif variable.kind == "String":
            series.append(pl.Series(column.name, found, dtype=pl.String))
        else:
            series.append(pl.Series(column.name, np.array(found)))
    return pl.DataFrame(series)
