"""The command that follows a diagnosis: it does what the advice says, and leads further than the same one again."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from .. import records
from .call import Call

if TYPE_CHECKING:
    from ..diagnosis.result import Explanation
    from ..records import PositionRecord

POSITIONS = 6
"""Positions that a plan adds to a record that leaves several causes open."""


def after_diagnosis(call: Call, result: Any) -> str:
    """Return the command that follows a diagnosis; empty where its page does."""
    if call.arguments.get("others"):
        return ""
    record, run = call.arguments["record"], result.made_of
    if not isinstance(run, records.PositionRecord):
        return _without_a_table(call, record, result)
    if result.verdict == "consistent":
        return call.line("calibrate", record, json="calibration.json")
    if result.verdict == "unexplained":
        return ""
    line = _without_fault(call, result.explanations[0], run) if result.explanations else ""
    if line:
        return line
    if result.verdict == "explained":
        return _after_causes(call, record, is_table=True)
    mountings = call.arguments.get("mounting") or tuple(dict.fromkeys(run.mounting or ())) or None
    no_goal = {"noise_bound": None, "noise_result": None}
    return call.line("plan positions", POSITIONS, **no_goal, measured=record, mountings=mountings, out="plan")


def _without_a_table(call: Call, record: object, result: Any) -> str:
    """Return the command that follows the diagnosis of a record without the angles of a table."""
    if result.verdict in ("consistent", "insufficient"):
        return call.line("plan hand", measured=record)
    return _after_causes(call, record, is_table=False) if result.verdict == "explained" and result.causes else ""


def _without_fault(call: Call, first: "Explanation", run: "PositionRecord") -> str:
    """Return the command on the record without its fault; empty where the fault cannot be left out.

    Effects beside the fault are still to be named: then the rest is diagnosed, else calibrated.
    """
    record = call.arguments["record"]
    if first.kind == "sigma" and first.change:
        return call.line("diagnose", record, noise_bound=first.change["noise_bound"], noise_sd=None, noise_result=None)
    wrong = set(first.rows or ()) if first.kind in ("rows", "stretch", "break") else set()
    if first.kind == "break":
        wrong |= _outside_largest_part(first, run)
    if not wrong:
        return ""
    before = call.arguments.get("without")
    rows = as_ranges(sorted(wrong | records.rows_of(before) if before else wrong))
    if any(cause.effect != "outlier" for cause in first.causes):
        return call.line("diagnose", record, without=rows)
    return call.line("calibrate", record, without=rows, json="calibration.json")


def _outside_largest_part(first: "Explanation", run: "PositionRecord") -> set[int]:
    """Return the rows outside the largest part of a record that no break divides, by their numbers."""
    in_time = sorted(zip(run.time_s.tolist(), run.numbers.tolist(), strict=True), key=lambda row: row[0])
    numbers = [number for _, number in in_time]
    gaps = set()
    if first.between_rows is not None:
        before, after = first.between_rows
        gaps.add((numbers.index(before), numbers.index(after)))
    for key in first.change or {}:
        row = key.rpartition("_")[2]
        if "_from_r" in key and row.isdigit():
            after = numbers.index(int(row))
            gaps.add((after - 1, after))
    parts, start = [], 0
    for last, following in sorted(gaps):
        parts.append(numbers[start : last + 1])
        start = following
    parts.append(numbers[start:])
    return set(numbers) - set(max(parts, key=len))


def _after_causes(call: Call, record: object, *, is_table: bool) -> str:
    """Return the command that adds named effects to the simulation; after that, the one that uses them."""
    file = call.arguments.get("json")
    if file is None or not (is_table or "export" in call.arguments):
        return call.again(json=file or "diagnosis.json", export="extended")
    if is_table:
        return call.line("calibrate", record, explained_by=file, json="calibration.json")
    return call.line("apply", file, record, out="corrected.csv")


def as_ranges(rows: Sequence[int]) -> str:
    """Return numbers of rows as `--without` takes them: "6,19-30"."""
    parts: list[list[int]] = []
    for row in rows:
        if parts and row == parts[-1][1] + 1:
            parts[-1][1] = row
        else:
            parts.append([row, row])
    return ",".join(f"{first}" if first == last else f"{first}-{last}" for first, last in parts)
