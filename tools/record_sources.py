"""Whatever holds a record: a file, a table in memory, a record, a simulation."""

from pathlib import Path
from typing import Any, TypeAlias

from polars import DataFrame

from .bench_run import Simulation
from .errors import InputError
from .records import PositionRecord, RawRecord, StrapdownRecord, read_record
from .records.reading import TableRun, measured_run_of, record_of, table_run_of

TableSource: TypeAlias = str | Path | DataFrame | PositionRecord | RawRecord | TableRun | Simulation
"""What holds a position record, or a raw one."""
StrapdownSource: TypeAlias = str | Path | DataFrame | StrapdownRecord
"""What holds a strapdown record."""


def table_run(source: Any) -> TableRun:
    """The position record of whatever holds one: a file, a table in memory, a record, a simulation.

    Raises
    ------
    InputError
        when there is none, in one line
    """
    if isinstance(source, TableRun):
        return source
    if isinstance(source, Simulation):
        if source.positions is None:
            raise InputError(source.no_positions or "the simulation has recorded no position record of a table")
        return TableRun(source.positions)
    return table_run_of(source)


def measured_run(source: Any) -> TableRun | StrapdownRecord:
    """A strapdown record, or what `table_run` gives."""
    if isinstance(source, TableRun | Simulation):
        return table_run(source)
    return measured_run_of(source)


def strapdown_record(source: Any) -> StrapdownRecord:
    """The strapdown record of a file, a table in memory, or itself.

    Raises
    ------
    InputError
        when it is a record of a table
    """
    if isinstance(source, StrapdownRecord):
        return source
    found = read_record(Path(source)) if isinstance(source, str | Path) else record_of(source)
    if not isinstance(found, StrapdownRecord):
        raise InputError(f"{found.path}: is a table record; a strapdown record (w1_radps, ...) is needed")
    return found
