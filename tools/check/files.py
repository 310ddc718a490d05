"""Everything that is wrong with a file that Trihedron reads: what it is, by its content, then fault by fault."""

import csv
import json
import tempfile
import tomllib
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from fmpy.validation import validate_fmu
from pydantic import BaseModel, ValidationError

from ...fmus.parameters import target_estimates
from ..calibration import Calibration
from ..calibration.correction import correction_of
from ..calibration.mountings import checked_mounting
from ..campaign.file import Campaign, campaign_problems
from ..diagnosis import Diagnosis
from ..errors import InputError, nearest, nearest_file
from ..field_problems import field_problems
from ..orchestrator.interface import interface_of
from ..orchestrator.load import unpack
from ..orchestrator.stimuli import read_table
from ..planning.check import read_angles
from ..records.columns import ANGLES, FORCE, RAW, Columns, RecordError, extra_warning, warnings
from ..records.kinds import RawRecord
from ..records.read import MAGIC, all_faults, read_record
from ..records.rests import position_record_of
from ..ssp.read import scenario_of_ssp
from .findings import Check, Findings, Problem, found_in
from .lines import json_lines, toml_lines
from .published import PositionPlanFile, TargetPlanFile, TargetPlansFile
from .scenario import check_scenario

SCENARIO = "trihedron.scenario/1"
CAMPAIGN = "trihedron.campaign/1"
SCHEMAS = {
    "trihedron.calibration/1": "calibration",
    "trihedron.diagnosis/1": "diagnosis",
    "trihedron.plan/1": "plan",
}
MOST = 200
"""So many problems of a file are listed."""


def check(path: Path | str) -> Check:
    """Say everything that is wrong with a file that Trihedron reads, with lines.

    Parameters
    ----------
    path : Path
        a scenario, campaign or file of mountings (TOML); a record, position programme or angles of a plan (CSV,
        Parquet); a calibration, diagnosis or plan (JSON); an .fmu or .ssp. What it is is told by its content

    Returns
    -------
    Check

    Raises
    ------
    InputError
        no file that can be read
    """
    path = Path(path)
    data = contents(path)
    ending = path.suffix.lower()
    if data.startswith(b"PK"):
        return check_ssp(path) if ending == ".ssp" else check_fmu(path)
    if ending in (".fmu", ".ssp"):
        what = Problem(f"is not a ZIP archive, which an {ending} is")
        return found_in(path, "FMU" if ending == ".fmu" else "SSP archive", (what,))
    if ending not in (".toml", ".json"):
        return check_record(path, data)
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        row = data[: error.start].count(b"\n") + 1
        return found_in(path, "unknown", (Problem(f"byte {error.start + 1} is not UTF-8 text; save it as UTF-8", row),))
    if ending == ".json":
        return check_results(path, text)
    return check_toml(path, text)


def contents(path: Path) -> bytes:
    """The bytes of a file.

    Raises
    ------
    InputError
        a directory, a device, no file, or one that may not be read
    """
    try:
        if path.is_dir():
            raise InputError(f"{path}: is a directory; give the name of a file")
        if not path.exists():
            raise InputError(f"{path}: no such file{nearest_file(path)}")
        if not path.is_file():
            raise InputError(f"{path}: is not a regular file; give the name of a file")
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def check_toml(path: Path, text: str) -> Check:
    """Check a scenario, a campaign or a file of mountings."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        said, _, place = str(error).partition(" (at line ")
        line = place.partition(",")[0]
        return found_in(path, "unknown", (Problem(f"is not TOML: {said}", int(line) if line.isdigit() else None),))
    except (ValueError, RecursionError) as error:
        return found_in(path, "unknown", (Problem(f"is not TOML: {error}"),))
    schema = data.get("schema")
    if schema == CAMPAIGN:
        return _check_campaign(path, text, data)
    if schema == SCENARIO or "fmus" in data or "run" in data:
        return _scenario(path, text, data)
    if schema is None and data and all(isinstance(v, dict) and "matrix" in v for v in data.values()):
        return _check_mountings(path, text, data)
    known = nearest(str(schema), [SCENARIO, CAMPAIGN])
    what = f"schema: {schema!r} is not known; {known}" if schema is not None else f'schema is missing; as "{SCENARIO}"'
    return found_in(path, "unknown", (Problem(what, toml_lines(text).get(("schema",))),))


def _scenario(path: Path, text: str, data: dict[str, Any]) -> Check:
    found = check_scenario(path, text, data)
    if "schema" in data:
        return found
    missing = Problem(f'schema is missing; write schema = "{SCENARIO}"')
    return found_in(path, "scenario", (missing, *found.problems))


def _check_campaign(path: Path, text: str, data: dict[str, Any]) -> Check:
    findings = Findings(toml_lines(text))
    try:
        Campaign.model_validate(data)
    except ValidationError as error:
        for problem in campaign_problems(error):
            findings.add(problem.text, problem.location)
    return found_in(path, "campaign", findings.problems())


def _check_mountings(path: Path, text: str, data: dict[str, Any]) -> Check:
    findings = Findings(toml_lines(text))
    for name, table in data.items():
        for key in table:
            if key != "matrix":
                findings.add(f"{name}.{key}: unknown key; write matrix = [[...], [...], [...]]", (name, key))
        with findings.of((name, "matrix")):
            checked_mounting(table["matrix"], f"[{name}]")
    return found_in(path, "file of mountings", findings.problems(), summary=(f"mountings {', '.join(data)}",))


def check_fmu(path: Path) -> Check:
    """What FMPy's validation and the orchestrator's own say of an FMU; nothing of it is run."""
    with tempfile.TemporaryDirectory(prefix="trihedron-check-") as folder:
        try:
            # Before anything else opens the archive: this refuses what is not safe to unpack.
            unpacked = unpack(path, str(path), lambda _: Path(folder) / "fmu")
            interface = interface_of("fmu", str(path), unpacked.description)
        except InputError as error:
            return found_in(path, "FMU", (Problem(str(error).removeprefix(f"{path}: ")),))
        problems = tuple(Problem(" ".join(text.split())) for text in validate_fmu(str(path)))
        described = unpacked.description
        counts = {c: sum(v.causality == c for v in interface.variables.values()) for c in ("input", "output")}
    summary = (
        f"{described.modelName}, FMI {described.fmiVersion}, by {described.generationTool or 'an unnamed tool'}",
        f"{len(interface.variables)} variables, {counts['input']} inputs, {counts['output']} outputs",
    )
    return found_in(path, "FMU", problems, summary=() if problems else summary)


def check_ssp(path: Path) -> Check:
    """Whether an .ssp can be read as a scenario; nothing of it is run."""
    try:
        with scenario_of_ssp(path) as (scenario, ignored):
            warnings = tuple(f"parameter {name} names nothing in the system" for name in ignored)
            summary = (
                f"FMUs: {', '.join(scenario.fmus)}",
                f"{len(scenario.connections)} connections, step {scenario.run.step_s:g} s",
            )
    except InputError as error:
        return found_in(path, "SSP archive", (Problem(str(error).removeprefix(f"{path}: ")),))
    return found_in(path, "SSP archive", warnings=warnings, summary=summary)


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
        return found_in(path, kind, tuple(problems[:MOST]), said, more=max(0, len(problems) - MOST))
    summary = [f"{len(columns.row)} rows, columns {', '.join(columns.layout.present)}"]
    rest_problems: tuple[Problem, ...] = ()
    if columns.layout.kind is RAW:
        rests, rest_problems = _rests(path)
        summary += rests
    return found_in(path, kind, rest_problems, (*said, *warnings(columns)), tuple(summary))


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
            planned, _ = read_angles(path)
            return found_in(path, kind, summary=(f"{len(planned)} positions",))
        wanted = [name for name in names if name != "mounting"]
        table, _ = read_table(path, str(path), wanted)
    except InputError as error:
        return found_in(path, kind, (Problem(str(error).removeprefix(f"{path}").lstrip(":, ")),))
    problems = [
        Problem(f"column '{name}': {value:g} must be positive", int(line))
        for name in ("dwell_s",)
        if name in table.columns
        for value, line in zip(table.columns[name], table.lines, strict=True)
        if value <= 0.0
    ]
    return found_in(path, kind, tuple(problems), summary=(f"{len(table.lines)} rows, columns {', '.join(names)}",))


def _rests(path: Path) -> tuple[list[str], tuple[Problem, ...]]:
    """What the rests of a raw record are, and why they cannot be averaged."""
    record = read_record(path)
    assert isinstance(record, RawRecord)
    try:
        found = position_record_of(record)
    except InputError as error:
        return [], (Problem(str(error).removeprefix(f"{path}: ")),)
    return [f"{len(found.rests)} rests, {len(found)} of them good"], ()


def check_results(path: Path, text: str) -> Check:
    """Check a JSON file of results; one of a schema that is not known is not of this program."""
    try:
        content = json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        return found_in(path, "unknown", (Problem(f"is not JSON: {error.msg}, column {error.colno}", error.lineno),))
    except (ValueError, RecursionError) as error:
        return found_in(path, "unknown", (Problem(f"is not JSON: {error}"),))
    if not isinstance(content, dict) or "schema" not in content:
        return found_in(path, "unknown", (Problem("has no schema; a file of results begins with one"),))
    schema = content["schema"]
    if not isinstance(schema, str) or schema not in SCHEMAS:
        what = f"schema: {schema!r} cannot be checked; {nearest(str(schema), list(SCHEMAS))}"
        return found_in(path, "unknown", [Problem(what, json_lines(text).get(("schema",)))])
    return _check_content(path, text, content, SCHEMAS[schema])


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _model(kind: str, content: Mapping[str, Any]) -> type[BaseModel]:
    if kind == "plan":
        return TargetPlansFile if "plans" in content else TargetPlanFile if "target" in content else PositionPlanFile
    if kind == "diagnosis":
        return Diagnosis
    return Calibration


def _check_content(path: Path, text: str, content: dict[str, Any], kind: str) -> Check:
    findings = Findings(json_lines(text))
    model = _model(kind, content)
    known = [field.alias or name for name, field in model.model_fields.items()]
    warnings: list[str] = []
    try:
        model.model_validate_json(text, strict=True)
    except ValidationError as error:
        for problem in field_problems(error, model):
            meant = ""
            if problem.text.endswith(": is missing"):
                beside = _at(content, problem.location[:-1])
                close = get_close_matches(str(problem.location[-1]), [k for k in beside if k not in known], n=1)
                meant = f" (is '{close[0]}' meant?)" if close else ""
            findings.add(problem.text + meant, problem.location)
    if kind == "calibration" and not findings.problems():
        _check_calibration(content, findings)
    problems = findings.problems()
    return found_in(path, kind, problems, tuple(warnings), () if problems else _summary_of(kind, content))


def _at(content: Any, location: tuple[int | str, ...]) -> list[str]:
    """The keys of the object at a location."""
    for part in location:
        content = content[part]
    return list(content) if isinstance(content, dict) else []


def _check_calibration(content: dict[str, Any], findings: Findings) -> None:
    """What uses of a calibration ask for beside its fields: symbols, intervals, bounds that fit together."""
    try:
        if content["verdict"] == "consistent" and "reading_errors" in content:
            correction_of(content, "calibration")
        else:
            target_estimates(content)
    except (InputError, ValueError) as error:
        said = str(error).removeprefix("calibration: ")
        place = next(
            (k for k, entry in enumerate(content["parameters"]) if said.startswith(f"{entry['symbol']}:")), None
        )
        findings.add(said, ("parameters",) if place is None else ("parameters", place))
    except KeyError as error:
        findings.add(f"parameters: lack {error.args[0]!r}", ("parameters",))


def _summary_of(kind: str, content: Mapping[str, Any]) -> tuple[str, ...]:
    if kind == "calibration":
        return (f"{content['verdict']}, {content['positions']} positions, σ = {content['noise_bound']:g} g",)
    if kind == "diagnosis":
        causes = ", ".join(f"{cause['effect']} {cause['where']}" for cause in content["causes"])
        return (f"{content['verdict']}{f': {causes}' if causes else ''}",)
    if "positions" in content:
        return (f"{len(content['positions'])} positions for all targets, worst ratio {content['worst_ratio']:g}",)
    plans = content.get("plans", [content])
    return (f"optimal plans of {', '.join(str(plan['target']) for plan in plans)}",)
