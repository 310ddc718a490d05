"""Everything that is wrong with a record, or with a table of numbers that drives a simulation."""

import csv
from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError
from ..orchestrator.tables import read_table
from ..records.columns import ANGLES, FORCE, RAW, Columns, RecordError, extra_warning, warnings
from ..records.kinds import RawRecord
from ..records.read import MAGIC, all_faults, read_record
from ..records.rests import position_record_of
from .result import Check, Problem

MOST = 200
"""So many problems of a file are listed."""


def check_record(path: Path, data: bytes) -> Check:
    """Check a table of measured or commanded numbers.

    Parameters
    ----------
    path : Path
    data : bytes
        of the file, CSV or Parquet

    Returns
    -------
    Check
        every field that is wrong, by row; of a raw record without such fields also whether it has rests
    """
    names = [] if data.startswith(MAGIC) else _header(data)
    if names and not set(names) & set(FORCE) and set(names) & {*ANGLES, "time_s"}:
        return _check_commands(path, names)
    found: list[RecordError] = []
    reader = all_faults(path, data)
    while True:
        try:
            found.append(next(reader))
        except StopIteration as done:
            columns: Columns | None = done.value
            break
    kind = "record" if columns is None else columns.layout.kind.name
    said = () if columns is None else extra_warning(columns)
    problems = sorted((Problem(_text(fault), fault.row) for fault in found), key=lambda p: p.line or 0)
    if problems or columns is None:
        return Check(path, kind, tuple(problems[:MOST]), said, more=max(0, len(problems) - MOST))
    summary = [f"{len(columns.row)} rows, columns {', '.join(columns.layout.present)}"]
    rest_problems: tuple[Problem, ...] = ()
    if columns.layout.kind is RAW:
        rests, rest_problems = _rests(path)
        summary += rests
    return Check(path, kind, rest_problems, (*said, *warnings(columns)), tuple(summary))


def _text(fault: RecordError) -> str:
    return f"column {fault.column}: {fault.what}" if fault.column is not None else fault.what


def _header(data: bytes) -> list[str]:
    """The names in the first written line; none where there is no text."""
    for line in _written(data):
        try:
            return [name.strip() for name in next(csv.reader([line]))]
        except (csv.Error, StopIteration):
            return []
    return []


def _written(data: bytes) -> Iterator[str]:
    text = data[:100_000].decode("utf-8-sig", "replace")
    return (line for line in text.splitlines() if line.strip() and not line.startswith("#"))


def _check_commands(path: Path, names: list[str]) -> Check:
    """A table without readings: a position programme, the angles of a plan that were set, or rows for inputs."""
    kind = "position programme" if set(names) <= {*ANGLES, "dwell_s"} else "table of numbers"
    try:
        if any(name.startswith("planned_") for name in names):
            kind = "angles of a plan"
            from ..planning.check import read_angles

            planned, _ = read_angles(path)
            return Check(path, kind, summary=(f"{len(planned)} positions",))
        wanted = [name for name in names if name != "mounting"]
        table, _ = read_table(path, str(path), wanted)
    except InputError as error:
        return Check(path, kind, (Problem(str(error).removeprefix(f"{path}").lstrip(":, ")),))
    problems = [
        Problem(f"column '{name}': {value:g} must be positive", int(line))
        for name in ("dwell_s",)
        if name in table.columns
        for value, line in zip(table.columns[name], table.lines, strict=True)
        if value <= 0.0
    ]
    return Check(path, kind, tuple(problems), summary=(f"{len(table.lines)} rows, columns {', '.join(names)}",))


def _rests(path: Path) -> tuple[list[str], tuple[Problem, ...]]:
    """What the rests of a raw record are, and why they cannot be averaged."""
    record = read_record(path)
    assert isinstance(record, RawRecord)
    try:
        found = position_record_of(record)
    except InputError as error:
        return [], (Problem(str(error).removeprefix(f"{path}: ")),)
    return [f"{len(found.rests)} rests, {len(found)} of them good"], ()
