"""The command to run after another one: an answer ends with it, and it can be run as printed."""

import os
import re
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
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


COLUMNS, INDENT = 80, " " * 6
"""Columns of a terminal; the beginning of a line that continues the one before."""
UNSAFE = re.compile(r"[^\w@%+=:,./-]", re.ASCII)
"""Characters that a shell takes literally only behind a backslash."""
STRAPDOWN = "strapdown record"
RUNS = {"scenario": "simulate", "FMU": "simulate", "SSP archive": "simulate", "campaign": "campaign"}
"""Kinds of files that run, and the command that runs them."""


def next_command(call: Call, result: Any) -> str:
    """Return the command that follows a result."""
    after = AFTER.get(call.name)
    line = "" if after is None else after(call, result)
    name = call.name.split()[0]
    return line or call.with_one_more(report=f"{name}.html", out=name, json=f"{name}.json")


def continued(command: str) -> str:
    """Return a command in lines of at most 80 columns, which a shell reads as one, with paths as short as can be."""
    lines, line = [], ""
    for word in shlex.split(command):
        short = min(word, os.path.relpath(word), key=len) if Path(word).is_absolute() else word
        quoted = shlex.quote(short)
        if len(quoted) > COLUMNS - len(INDENT) - 2:
            quoted = UNSAFE.sub(r"\\\g<0>", short)
        if line and len(line) + len(quoted) > COLUMNS - 3:
            lines.append(f"{line} \\")
            line = INDENT
        line += f" {quoted}" if line.strip() else quoted
        while len(line) > COLUMNS - 2:
            # Within a word the next line begins at once; a backslash stays with its character.
            piece = line[: COLUMNS - 1].rstrip("\\")
            lines.append(f"{piece}\\")
            line = line[len(piece) :]
    return "\n".join([*lines, line])


def _after_import(call: Call, result: Any) -> str:
    record = call.arguments["out"]
    command = "inspect" if result.kind == STRAPDOWN else "calibrate"
    return call.line(command, record, **_results(command))


def _after_check(call: Call, result: Any) -> str:
    file = call.arguments["file"]
    if result.good and result.kind.endswith(" record"):
        command = "inspect" if result.kind == STRAPDOWN else "calibrate"
        return call.line(command, file, **_results(command))
    if result.good and result.kind in RUNS:
        return call.line(RUNS[result.kind], file)
    return call.again()


def _after_inspect(call: Call, result: Any) -> str:
    record = call.arguments["record"]
    if result.trust.faults:
        return call.line("check", record)
    command = "calibrate" if result.moves or result.at_table is not None else "noise"
    return call.line(command, record, **_results(command))


RESULTS = {"calibrate": "calibration.json", "diagnose": "diagnosis.json", "noise": "noise.json"}
"""Command -> file of its result."""


def _results(command: str) -> dict[str, str]:
    return {"json": RESULTS[command]} if command in RESULTS else {}


def _after_calibrate(call: Call, result: Any) -> str:
    records = (call.arguments["record"], *call.arguments.get("others", ()))
    if result.verdict == "falsified" and result.by_hand is None:
        return call.line("diagnose", *records, json="diagnosis.json")
    if result.verdict == "insufficient":
        if result.by_hand is None:
            return ""
        return call.line("plan hand", measured=None if result.by_hand.turn_error is None else records[-1])
    if not result.parameters and not result.of_record:
        return "" if call.arguments.get("export") else call.again(export="fmus")
    file = call.arguments.get("json")
    if file is None:
        return call.again(json="calibration.json")
    return call.line("apply", file, records[-1], out="corrected.csv")


def _after_batch(call: Call, result: Any) -> str:
    files = (call.arguments["files"], *call.arguments.get("others", ()))
    out = call.arguments["out"]
    if result.do == "calibrate" and set(result.verdicts) <= {"consistent"} and (Path(out) / "instruments").is_dir():
        words = ["trihedron", "batch", *map(str, files), "--do", "apply", "--with", str(out)]
        return shlex.join([*words, "--out", f"{out}-corrected"])
    if result.do == "calibrate":
        return call.line("batch", *files, do="diagnose", out=f"{out}-diagnosed")
    record = Path(next(member.record for member in result.members if member.failed is None))
    if record not in map(Path, files):
        # A row of a table.
        record = Path(files[0]).parent / record
    return f"trihedron open {shlex.quote(str(record))}"


def _after_apply(call: Call, result: Any) -> str:
    if result.record is None:
        return ""
    if "out" not in call.arguments:
        return call.again(out="corrected.csv")
    return call.line("compare", call.arguments["record"], call.arguments["out"], report="corrected.html")


def _after_measure(call: Call, result: Any) -> str:
    command = "calibrate" if result.promise_reached else "diagnose"
    return call.line(command, result.positions_file or result.record, **_results(command))


def _after_plan(call: Call, _: Any) -> str:
    out = call.arguments.get("out")
    if out is None:
        return call.again(out="plan")
    if call.name == "plan imu":
        return call.line("check", Path(out) / "plan.json")
    return call.line("plan check", Path(out) / "angles.csv")


AFTER: dict[str, Callable[[Call, Any], str]] = {
    "import": _after_import,
    "check": _after_check,
    "inspect": _after_inspect,
    "calibrate": _after_calibrate,
    "diagnose": after_diagnosis,
    "apply": _after_apply,
    "batch": _after_batch,
    "measure": _after_measure,
    "plan target": lambda *_: "trihedron plan positions 12 --starts 1 --cuts 0 --out plan12",
    "plan positions": _after_plan,
    "plan imu": _after_plan,
    "doctor": lambda _, result: "trihedron demo" if result.works else "trihedron doctor",
    "instrument add": lambda call, _: call.line("instrument list", call.arguments["folder"]),
    "instrument list": lambda call, _: call.line("instrument show", call.arguments["folder"]),
}
"""Command -> function that returns what follows, empty where a page or file of the same result does."""
