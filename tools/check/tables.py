"""List all problems of a table: a record, commands for a table, the angles of a plan."""

import csv
from collections.abc import Sequence
from io import BytesIO
from typing import Any

import lazy_loader
import numpy as np
from numpy.typing import NDArray

from ...fmus.units import STANDARD_GRAVITY
from .. import by_hand, calibration, motion, orchestrator, planning
from ..errors import InputError, printable
from ..files import MAGIC
from ..records.columns import ANGLES, FORCE, VELOCITY, FileColumns, extra_warning, warnings
from ..records.even import times_unused
from ..records.kinds import PositionRecord, RawRecord, StrapdownRecord
from ..records.limits import channel_limits
from ..records.read import all_faults, read_record
from ..records.rests import position_record_of
from ..rounding import exactly
from .findings import Findings

polars: Any = lazy_loader.load("polars")
ALIGNED = np.eye(3)
"""Default mounting of a block."""
LONGEST_HEAD = 100_000
"""Largest number of bytes of a line with names."""


def check_table(
    findings: Findings, content: bytes, channels: Sequence[str], stamps: str | None = None, *, trust: bool
) -> None:
    """Check a table of measured or commanded numbers, CSV or Parquet.

    In a record, list every wrong field by row. If a series has none, check the limits of its channels, and the rests of
    a raw record.
    """
    names: list[str] = []
    if not content.startswith(MAGIC):
        names = _header(content)
    measured, commanded = set(FORCE) | set(VELOCITY), set(ANGLES) | {"time_s"}
    if names and measured.isdisjoint(names) and not commanded.isdisjoint(names):
        _check_commands(findings, names)
        return

    def listed():
        """Yield the faults; the reader's final value is the columns."""
        nonlocal columns
        columns = yield from all_faults(findings.path, content, any_times=times_unused(stamps))

    columns: FileColumns | None = None
    for fault in listed():
        text = fault.what
        if fault.column is not None:
            text = f"column {fault.column}: {text}"
        findings.add(text, line=fault.row)
    findings.kind = "record"
    if columns is None:
        return
    findings.kind = columns.layout.kind.name
    findings.warnings = extra_warning(columns)
    if findings.problems:
        return
    findings.warnings += warnings(columns)
    if content.startswith(MAGIC):
        names = list(polars.read_parquet_schema(BytesIO(content)))
    present = [name for name in columns.layout.present if name in names]
    findings.summary = (f"{len(columns.row)} rows, columns {', '.join(present)}",)
    record = read_record(findings.path, channels=channels, stamps=stamps)
    earlier = findings.warnings
    for line in record.warnings:
        if line not in earlier:
            findings.warnings += (line,)
    if not isinstance(record, PositionRecord):
        findings.warnings += tuple(channel_limits(record).lines)
    judged = record
    if isinstance(record, StrapdownRecord):
        judged = by_hand.parted_at_cuts(record, STANDARD_GRAVITY)
    told = motion.trust_of(judged).known(trust)
    findings.warnings += told.warnings
    for line in told.faults:
        findings.add(line)
    if isinstance(record, PositionRecord):
        findings.warnings += channels_warning(record)
    if not isinstance(record, RawRecord):
        return
    with findings.of():
        averaged = position_record_of(record)
        findings.warnings += channels_warning(averaged)
        findings.summary += (f"{len(averaged.rests)} rests, {len(averaged)} of them good",)


def channels_warning(record: PositionRecord | RawRecord, mounting: NDArray | None = ALIGNED) -> tuple[str, ...]:
    """Return the advice of `calibrate` or `diagnose` on the channels of a table's record.

    `mounting` (3, 3) gives block axes from axes of the inner frame. There is no advice for several or unknown
    mountings, or for a record without rests.
    """
    if isinstance(record, RawRecord):
        try:
            record = position_record_of(record)
        except InputError:
            return ()
    if record.mounting is not None or mounting is None:
        return ()
    at = calibration.Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    advice = calibration.channels_advice(
        record, record.specific_force / STANDARD_GRAVITY, calibration.parametrise({"": mounting}), at
    )
    if not advice:
        return ()
    return (advice,)


def _header(content: bytes) -> list[str]:
    """Return the names in the first written line, behind comments of any length; empty if there is none."""
    for written in BytesIO(content):
        for line in written[:LONGEST_HEAD].decode("utf-8-sig", "replace").split("\r"):
            if not line.strip() or line.startswith("#"):
                continue
            try:
                return [name.strip() for name in next(csv.reader([line]))]
            except (csv.Error, StopIteration):
                return []
    return []


def _check_commands(findings: Findings, names: list[str]) -> None:
    """Check a table without readings: a position programme, the set angles of a plan, or rows for inputs."""
    findings.kind = "table of numbers"
    if set(names) <= set(ANGLES) | {"dwell_s"}:
        findings.kind = "position programme"
    try:
        if any(name.startswith("planned_") for name in names):
            findings.kind = "angles of a plan"
            findings.summary = (f"{len(planning.read_settings(findings.path)[0])} positions",)
            return
        table, _ = orchestrator.read_number_table(
            findings.path, str(findings.path), [name for name in names if name != "mounting"]
        )
    except InputError as error:
        findings.add(str(error).removeprefix(f"{findings.path}").lstrip(":, "))
        return
    for value, line in zip(table.columns.get("dwell_s", ()), table.lines, strict=False):
        if value <= 0.0:
            findings.add(f"column 'dwell_s': {exactly(value)} must be positive", line=int(line))
    findings.summary = (f"{len(table.lines)} rows, columns {printable(', '.join(names))}",)
