"""The command to run after another one: an answer ends with it, and it can be run as printed."""

import os
import re
import shlex
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from cyclopts import App

from ..rounding import exactly

SAME_RECORD = (
    *("channels", "stamps", "trust", "noise_bound", "noise_sd", "gravity", "mounting", "baseline", "bounds", "rates"),
    *(
        "noise",
        "rest_scatter",
        "rests",
        "faces",
        "turns",
        "latitude_deg",
        "azimuth_deg",
        "gyro_noise",
        "encoder_bound",
        "shared",
        "own",
    ),
)
"""Options that stay when another command takes the same record."""
COLUMNS, INDENT = 80, " " * 6
"""Columns of a terminal; the beginning of a line that continues the one before."""
UNSAFE = re.compile(r"[^\w@%+=:,./-]", re.ASCII)
"""Characters that a shell takes literally only behind a backslash."""
STRAPDOWN = "strapdown record"
RUNS = {"scenario": "simulate", "FMU": "simulate", "SSP archive": "simulate", "campaign": "campaign"}
"""Kinds of files that run, and the command that runs them."""


@dataclass(frozen=True)
class Call:
    """A command that was carried out.

    Attributes
    ----------
    app : App
        the command line
    name : str
        the command, as "plan positions"
    arguments : mapping
        parameter -> value, of the typed command
    """

    app: App
    name: str
    arguments: Mapping[str, Any]

    def line(self, command: str, *places: object, **options: object) -> str:
        """Return a command with these arguments and options, and the options of the same record that it takes."""
        kept = {name: value for name, value in self.arguments.items() if name in SAME_RECORD}
        return self._line(command, places, {**kept, **options})

    def again(self, **options: object) -> str:
        """Return the same command with further options."""
        known = _options(self.app, self.name)
        places: list[object] = []
        for name, value in self.arguments.items():
            if name not in known:
                places += value if isinstance(value, tuple) else [value]
        return self._line(self.name, places, {**self.arguments, **options})

    def with_one_more(self, **files: str) -> str:
        """Return the same command with the first of these options that it takes and has not; else its help."""
        known = _options(self.app, self.name)
        for name, file in files.items():
            if name in known and name not in self.arguments:
                return self.again(**{name: file})
        return f"trihedron help {self.name}"

    def _line(self, command: str, places: Any, options: Mapping[str, object]) -> str:
        words = ["trihedron", *command.split(), *map(str, places)]
        known = _options(self.app, command)
        for name, value in options.items():
            if name in known:
                words += _words(known[name], value)
        return shlex.join(words)


def _options(app: App, command: str) -> dict[str, str]:
    """Return the options of a command, by parameter."""
    for name in command.split():
        app = app[name]
    options = {}
    for argument in app.assemble_argument_collection():
        if argument.names[0].startswith("--"):
            options[argument.field_info.name] = argument.names[0]
    return options


def _words(option: str, value: object) -> list[str]:
    """Return an option with its value as typed; one of several words is repeated."""
    if value is True:
        return [option]
    if isinstance(value, tuple):
        if all(isinstance(part, float | int) for part in value):
            return [option, *map(_word, value)]
        return [word for part in value for word in _words(option, part)]
    word = _word(value)
    return [f"{option}={word}"] if word.startswith("-") else [option, word]


def _word(value: object) -> str:
    return exactly(value) if isinstance(value, float) else str(value)


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
        has_turns = result.by_hand is not None and result.by_hand.turn_error is not None
        return call.line("plan hand", measured=records[-1]) if has_turns else ""
    file = call.arguments.get("json")
    if file is None:
        return call.again(json="calibration.json")
    return call.line("apply", file, records[-1], out="corrected.csv")


def _after_diagnose(call: Call, result: Any) -> str:
    records = (call.arguments["record"], *call.arguments.get("others", ()))
    file = call.arguments.get("json")
    table = result.calibration.linearised is not None
    if result.verdict == "consistent" and table:
        return call.line("calibrate", *records, json="calibration.json")
    if result.verdict != "explained" or not result.causes or len(records) > 1:
        return ""
    if file is None:
        return call.again(json="diagnosis.json")
    if table:
        return call.line("calibrate", *records, explained_by=file, json="calibration.json")
    return "" if "export" in call.arguments else call.again(export="extended")


def _after_batch(call: Call, result: Any) -> str:
    files = (call.arguments["files"], *call.arguments.get("others", ()))
    out = call.arguments["out"]
    if result.do == "calibrate" and set(result.verdicts) <= {"consistent"} and (Path(out) / "instruments").is_dir():
        words = ["trihedron", "batch", *map(str, files), "--do", "apply", "--with", str(out)]
        return shlex.join([*words, "--out", f"{out}-corrected"])
    if result.do == "calibrate":
        return call.line("batch", *files, do="diagnose", out=f"{out}-diagnosed")
    return f"trihedron open {shlex.join(map(str, files[:1]))}"


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
    "diagnose": _after_diagnose,
    "apply": _after_apply,
    "batch": _after_batch,
    "measure": _after_measure,
    "plan target": lambda *_: "trihedron plan positions 12 --out plan12",
    "plan positions": _after_plan,
    "plan imu": _after_plan,
    "doctor": lambda _, result: "trihedron demo" if result.works else "trihedron doctor",
    "instrument add": lambda call, _: call.line("instrument list", call.arguments["folder"]),
    "instrument list": lambda call, _: call.line("instrument show", call.arguments["folder"]),
}
"""Command -> function that returns what follows, empty where a page or file of the same result does."""
