"""A strapdown record through several attitude algorithms, side by side."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from ...models.attitude_algorithms import ALGORITHMS, Algorithm
from ..errors import InputError
from ..files import write_text
from ..progress import progress_bar
from ..records import StrapdownRecord
from .measured import attitude_of_record
from .run import AttitudeRun, attitude_error

REFERENCE = "adaptive-degree"
"""The algorithm that the others are compared with, at the record's own rate."""


@dataclass(frozen=True)
class ComparedAlgorithm:
    """One row of a comparison; None where it cannot be told.

    Attributes
    ----------
    algorithm : Algorithm
    updates : int
        how many updates the run made
    apart : float or None
        largest angle to the reference's attitude at common moments [rad]
    rms, maximum : float or None
        of the error against the true attitude [rad]
    refused : str
        why the algorithm does not take this record; empty where it does
    """

    algorithm: Algorithm
    updates: int
    apart: float | None
    rms: float | None
    maximum: float | None
    refused: str = ""


def compare_algorithms(
    record: StrapdownRecord,
    *,
    rates: str = "instantaneous",
    rate_divisor: int = 1,
    algorithms: Sequence[Algorithm] = ALGORITHMS,
    progress: bool = False,
) -> list[ComparedAlgorithm]:
    """Run algorithms over a record through the attitude computer's FMU.

    Parameters
    ----------
    record : StrapdownRecord
    rates, rate_divisor
        as of `attitude_of_record`; the reference runs at the record's own rate
    algorithms : sequence of Algorithm
    progress : bool
        show a bar on standard error, where that is a terminal

    Raises
    ------
    InputError
        a record that no algorithm can take
    """
    rows = []
    with progress_bar("attitude", 1 + len(algorithms), show=progress) as advance:
        reference = attitude_of_record(record, algorithm=REFERENCE, rates=rates)
        advance(1)
        for algorithm in algorithms:
            try:
                run = attitude_of_record(record, algorithm=algorithm.name, rates=rates, rate_divisor=rate_divisor)
            except InputError as error:
                rows.append(ComparedAlgorithm(algorithm, 0, None, None, None, str(error)))
            else:
                rows.append(
                    ComparedAlgorithm(algorithm, len(run.row) - 1, _apart(run, reference), run.rms, run.maximum)
                )
            advance(1)
    if all(row.refused for row in rows):
        raise InputError(rows[0].refused)
    return rows


def comparison_text(rows: Sequence[ComparedAlgorithm]) -> str:
    """The comparison as lines for a person, angles in degrees."""
    width = max(len(row.algorithm.name) for row in rows)
    lines = [f"{'algorithm':{width}}  order  updates  from {REFERENCE}  error rms  error max   [deg]"]
    for row in rows:
        start = f"{row.algorithm.name:{width}}  {row.algorithm.order:5d}"
        if row.refused:
            lines.append(f"{start}  not taken: {row.refused}")
        else:
            angles = "  ".join(_degrees(angle, size) for angle, size in zip(_angles(row), (20, 9, 9), strict=True))
            lines.append(f"{start}  {row.updates:7d}  {angles}")
    return "\n".join(lines)


def comparison_json(rows: Sequence[ComparedAlgorithm]) -> dict[str, Any]:
    """The object of schema trihedron.attitude-comparison/1, angles in radians."""
    compared = [
        {
            "algorithm": row.algorithm.name,
            "order": row.algorithm.order,
            "updates": row.updates,
            "from_reference_rad": row.apart,
            "error_rms_rad": row.rms,
            "error_max_rad": row.maximum,
            "not_taken": row.refused,
        }
        for row in rows
    ]
    return {"schema": "trihedron.attitude-comparison/1", "reference": REFERENCE, "algorithms": compared}


def write_comparison(rows: Sequence[ComparedAlgorithm], path: Path) -> None:
    """Write a comparison as CSV, whole or not at all; empty where a number cannot be told."""
    columns = ("from_reference_deg", "error_rms_deg", "error_max_deg")
    table = pl.DataFrame(
        {
            "algorithm": [row.algorithm.name for row in rows],
            "order": [row.algorithm.order for row in rows],
            "samples": [row.algorithm.samples for row in rows],
            "updates": [row.updates for row in rows],
            **{
                name: pl.Series([None if a is None else math.degrees(a) for a in angles], dtype=pl.Float64)
                for name, angles in zip(columns, zip(*(_angles(row) for row in rows), strict=True), strict=True)
            },
            "not_taken": [row.refused for row in rows],
        }
    )
    write_text(path, table.write_csv())


def _angles(row: ComparedAlgorithm) -> tuple[float | None, float | None, float | None]:
    return row.apart, row.rms, row.maximum


def _degrees(angle: float | None, width: int) -> str:
    return f"{'-' if angle is None else f'{math.degrees(angle):.2e}':>{width}}"


def _apart(run: AttitudeRun, reference: AttitudeRun) -> float | None:
    """Largest angle between two runs after the start, at moments when both were updated [rad]."""
    _, mine, others = np.intersect1d(run.row[1:], reference.row[1:], assume_unique=True, return_indices=True)
    if not mine.size:
        return None
    difference = attitude_error(run.attitude[1:][mine], reference.attitude[1:][others])
    return float(np.linalg.norm(difference, axis=1).max())
