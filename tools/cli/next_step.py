"""The command to run after another one: an answer ends with it, and it can be run as printed."""

import os
import re
import shlex
from collections.abc import Callable
from pathlib import Path
from typing import Any

from .after_diagnosis import after_diagnosis
from .call import Call

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
