"""The columns of a run's record, and their rows during the run."""

import ctypes
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..errors import InputError, said_of
from .interface import VALUE_TYPES, FmuVariable, Interface, bytes_at, conversion, refer, suffix_for
from .program import Port, Ports
from .stimuli import StepGrid

BLOCK_BYTES = 16 << 20
MOST_LOCAL = 100
"""Largest number of local variables that are recorded because an FMU has neither outputs nor states."""
Keep = Callable[[pl.DataFrame, int], None]
"""Called for each block with its rows and the communication point of the last one."""


@dataclass(frozen=True)
class RecordColumn:
    """A column of the record: value = factor * variable + offset."""

    name: str
    fmu: str
    variable: FmuVariable
    factor: float = 1.0
    offset: float = 0.0

    def series(self, values: Any) -> pl.Series:
        """Return the column from the recorded values of its variable, in the variable's own unit."""
        if self.variable.value_type.by_address:
            return pl.Series(self.name, values, dtype=pl.String)
        if self.variable.kind == "Boolean":
            return pl.Series(self.name, np.asarray(values) != 0, dtype=pl.Boolean)
        if self.variable.kind != "Real":
            return pl.Series(self.name, np.array(values))
        numbers = np.array(values, dtype=np.float64)
        if (self.factor, self.offset) != (1.0, 0.0):
            numbers = self.factor * numbers + self.offset
        return pl.Series(self.name, numbers)


def has_outputs(interfaces: Mapping[str, Interface]) -> bool:
    """Return True if an FMU of the run has an output that can be recorded."""
    for interface in interfaces.values():
        for variable in interface.variables.values():
            if variable.causality == "output" and variable.access in VALUE_TYPES:
                return True
    return False


def default_variables(interface: Interface, interfaces: Mapping[str, Interface]) -> list[FmuVariable]:
    """Return the recorded variables of an FMU: its outputs; if no FMU has any, its states or local variables."""
    variables = [variable for variable in interface.variables.values() if variable.access in VALUE_TYPES]
    if has_outputs(interfaces):
        return [variable for variable in variables if variable.causality == "output"]
    states = [variable for variable in variables if variable.name in interface.states]
    local = []
    for variable in variables:
        if variable.causality == "local" and variable.variability not in ("constant", "fixed"):
            local.append(variable)
    return states or local[:MOST_LOCAL]


def _named_by_unit(fmu: str, variable: FmuVariable) -> RecordColumn:
    """Return the column of a variable in its own unit, named after both."""
    suffix = suffix_for(variable.unit)
    name = f"{fmu}.{variable.name}_{suffix}" if suffix else f"{fmu}.{variable.name}"
    return RecordColumn(name, fmu, variable)


def resolve_columns(
    columns: Mapping[str, str] | None, interfaces: Mapping[str, Interface], *, own_units: bool = False
) -> list[RecordColumn]:
    """Return the columns of the record; by default every output of every FMU, or the states if none has outputs.

    With `own_units` each column is in its variable's unit, and an array becomes a column for each element.

    Raises InputError for an unknown variable, an array, or a suffix that does not fit the variable's unit.
    """
    resolved = []
    if columns is None:
        for fmu, interface in interfaces.items():
            for variable in default_variables(interface, interfaces):
                resolved.append(_named_by_unit(fmu, variable))
        return resolved
    if own_units:
        for text in columns.values():
            with said_of(f"--record {text}"):
                interface, variables = refer(text, interfaces)
                for variable in variables:
                    _ = variable.value_type
                    resolved.append(_named_by_unit(interface.name, variable))
        return list(dict.fromkeys(resolved))
    for name, text in columns.items():
        with said_of(f"record.columns.{name}"):
            if name == "time_s" or not name.strip() or any(c in name for c in ',"\r\n'):
                raise InputError("is not a name for a column (time_s is there by itself)")
            interface, variables = refer(text, interfaces, ("output",))
            if len(variables) != 1:
                raise InputError(f"'{text}' has {len(variables)} elements; a column takes one: '{text}[1]'")
            scaled = conversion(variables[0].unit, name, interface.scales)
            _ = variables[0].value_type
            resolved.append(RecordColumn(name, interface.name, variables[0], *scaled))
    return resolved


def recorded_variables(columns: Iterable[RecordColumn], fmu: str) -> list[FmuVariable]:
    """Return the recorded variables of one FMU, each once."""
    return list(dict.fromkeys(column.variable for column in columns if column.fmu == fmu))


class Blocks:
    """Rows of recorded values, of every communication point or every n-th; a full block is handed on.

    The loops copy `records` (N, 3), for each row: target of row 0, source, bytes. Only Python keeps text (`has_text`).
    A block has `rows` rows; `row` is the next one.
    """

    def __init__(
        self, columns: Sequence[RecordColumn], ports: Mapping[str, Ports], grid: StepGrid, every: int, keep: Keep
    ) -> None:
        self._columns, self._grid, self._keep, self.every = columns, grid, keep, every
        self._tick = self.row = 0
        numbers: list[tuple[str, Port, int]] = []
        self._values: dict[tuple[str, str], NDArray] = {}
        self._texts: dict[tuple[str, str], list[str]] = {}
        self._addresses: list[tuple[list[str], Port, int]] = []
        for name, members in ports.items():
            for access, count in members.recorded.items():
                port = members.outputs[access]
                if not port.by_address:
                    numbers.append((name, port, count))
                    continue
                for at, variable in enumerate(port.variables[:count]):
                    texts = self._texts[name, variable.name] = []
                    self._addresses.append((texts, port, at))
        width = sum(count * port.values.itemsize for _, port, count in numbers)
        self.rows = max(1, min(grid.steps // every + 1, BLOCK_BYTES // max(width, 8)))
        copies = []
        for name, port, count in numbers:
            if count:
                table = np.zeros((self.rows, count), dtype=port.values.dtype)
                copies.append((table.ctypes.data, port.shown.ctypes.data, count * table.itemsize))
                for at, variable in enumerate(port.variables[:count]):
                    self._values[name, variable.name] = table[:, at]
        self.records = np.array(copies, dtype=np.int64).reshape(-1, 3)
        self.has_text = bool(self._texts)

    def room(self, step: int) -> int:
        """Return the number of steps, from this one on, for which the block has room."""
        return (self.rows - self.row) * self.every - step % self.every

    def record(self) -> None:
        """Record a row now."""
        for target, source, size in self.records.tolist():
            ctypes.memmove(target + self.row * size, source, size)
        self.keep_texts()
        self.advance(self.row + 1)

    def keep_texts(self) -> None:
        """Keep the strings of a row."""
        for texts, port, at in self._addresses:
            address = int(port.shown[at])
            if port.access == "Binary":
                texts.append(bytes_at(address).hex())
            else:
                content = ctypes.string_at(address) if address else b""
                texts.append(content.decode("utf-8", "replace"))

    def advance(self, row: int) -> None:
        """Note that this many rows of the block are recorded; hand on a full block."""
        self.row = row
        if row == self.rows:
            self.flush()

    def flush(self) -> None:
        """Hand on the recorded rows."""
        if not self.row:
            return
        end = self._tick + self.row * self.every
        ticks = np.arange(self._tick, end, self.every)
        series = [pl.Series("time_s", np.minimum(self._grid.start + ticks * self._grid.step, self._grid.stop))]
        for column in self._columns:
            at = (column.fmu, column.variable.name)
            series.append(column.series(self._texts[at] if at in self._texts else self._values[at][: self.row]))
        self._keep(pl.DataFrame(series), end - self.every)
        self._tick, self.row = end, 0
        for texts in self._texts.values():
            texts.clear()
