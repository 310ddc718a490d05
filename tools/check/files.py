"""List all problems of a text or a table; its content decides the kind."""

import csv
import json
import tomllib
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from io import BytesIO
from typing import Any

import numpy as np
from numpy.typing import NDArray
from polars import read_parquet_schema
from pydantic import BaseModel, ValidationError

from ...fmus.parameters import (
    CALIBRATIONS,
    FIRST_SCHEMA,
    JOINT_SCHEMA,
    RENAMED,
    SECOND_SCHEMA,
    calibration_of,
    gives_parameters,
    of_one_record,
    target_estimates,
)
from ...fmus.units import STANDARD_GRAVITY
from ..calibrated import Calibration
from ..calibration.calibration import channels_advice
from ..calibration.correction import correction_of
from ..calibration.model import Positions, checked_mounting, parametrise
from ..campaign.file import SCHEMA as CAMPAIGN
from ..campaign.file import Campaign
from ..diagnosis import Diagnosis
from ..diagnosis.result import DIAGNOSES, in_present_schema
from ..errors import InputError, nearest
from ..files import MAGIC
from ..instrument import INSTRUMENT, Entry
from ..motion import trust_of
from ..orchestrator.scenario import SCHEMA as SCENARIO
from ..orchestrator.scenario import Scenario
from ..orchestrator.stimuli import read_number_table
from ..planning import ImuPlan, Plan, Plans, PositionPlan, read_settings
from ..records.columns import ANGLES, FORCE, VELOCITY, FileColumns, extra_warning, warnings
from ..records.even import times_unused
from ..records.kinds import PositionRecord, RawRecord
from ..records.limits import channel_limits
from ..records.read import all_faults, read_record
from ..records.rests import position_record_of
from ..result import Location, dotted, field_problems, not_for_files
from ..rounding import digits, exactly, upwards
from .findings import Findings, json_lines, toml_lines
from .scenario import check_scenario

SCHEMAS = {
    **dict.fromkeys(CALIBRATIONS, "calibration"),
    **dict.fromkeys(DIAGNOSES, "diagnosis"),
    "trihedron.plan/1": "plan",
    "trihedron.imu-plan/1": "plan for the whole IMU",
    INSTRUMENT: "entry of an instrument's folder",
}
MODELS = {
    "calibration": Calibration,
    "diagnosis": Diagnosis,
    SCHEMAS[INSTRUMENT]: Entry,
    SCHEMAS["trihedron.imu-plan/1"]: ImuPlan,
}
ALIGNED = np.eye(3)
"""Default mounting of a block."""
LONGEST_HEAD = 100_000
"""Largest number of bytes of a line with names."""
MOST = 200
"""Largest number of a record's problems that are listed."""


def check_content(
    findings: Findings, content: bytes, channels: Sequence[str], stamps: str | None = None, *, trust: bool
) -> int | None:
    """Note the problems of a file that is not an archive; return the largest number to list, or None for all.

    Kinds: a scenario, campaign or file of mountings (TOML); a calibration, diagnosis or plan (JSON); anything else is a
    table.
    """
    ending = findings.path.suffix.lower()
    if ending not in (".toml", ".json"):
        _check_table(findings, content, channels, stamps, trust=trust)
        return MOST
    try:
        text = content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        findings.add(f"byte {error.start + 1} is not UTF-8 text; save it as UTF-8", line=line)
    else:
        if ending == ".json":
            _check_json(findings, text)
        else:
            _check_toml(findings, text)
    return None


def _check_toml(findings: Findings, text: str) -> None:
    """Check a scenario, a campaign or a file of mountings."""
    try:
        content = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).partition(" (at line ")
        number = place.partition(",")[0]
        line = None
        if number.isdigit():
            line = int(number)
        findings.add(f"is not TOML: {problem}", line=line)
        return
    except (ValueError, RecursionError) as error:
        findings.add(f"is not TOML: {error}")
        return
    findings.lines = toml_lines(text)
    schema = content.get("schema")
    sections: type[BaseModel] = Scenario
    if schema == CAMPAIGN:
        sections = Campaign
    for name, problem in not_for_files(content, sections).items():
        findings.add(problem, (name,))
        del content[name]
    if schema == CAMPAIGN:
        findings.kind = "campaign"
        try:
            Campaign.model_validate(content)
        except ValidationError as error:
            for where, text in field_problems(error, Campaign):
                findings.add(text, where)
    elif schema == SCENARIO or "fmus" in content or "run" in content:
        findings.kind = "scenario"
        if "schema" not in content:
            findings.add(f'schema is missing; write schema = "{SCENARIO}"')
        check_scenario(content, findings)
    elif schema is None and content and all(isinstance(v, dict) and "matrix" in v for v in content.values()):
        findings.kind, findings.summary = "file of mountings", (f"mountings {', '.join(content)}",)
        for name, table in content.items():
            for key in table:
                if key != "matrix":
                    findings.add(f"{name}.{key}: unknown key; write matrix = [[...], [...], [...]]", (name, key))
            with findings.of((name, "matrix")):
                checked_mounting(table["matrix"], f"[{name}]")
    elif schema is None:
        findings.add(f'schema is missing; as "{SCENARIO}"')
    else:
        findings.add(f"schema: {schema!r} is not known; {nearest(str(schema), [SCENARIO, CAMPAIGN])}", ("schema",))


def _check_table(
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
        names = list(read_parquet_schema(BytesIO(content)))
    present = [name for name in columns.layout.present if name in names]
    findings.summary = (f"{len(columns.row)} rows, columns {', '.join(present)}",)
    record = read_record(findings.path, channels=channels, stamps=stamps)
    earlier = findings.warnings
    for line in record.warnings:
        if line not in earlier:
            findings.warnings += (line,)
    if not isinstance(record, PositionRecord):
        findings.warnings += tuple(channel_limits(record).lines)
    told = trust_of(record).known(trust)
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
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    advice = channels_advice(record, record.specific_force / STANDARD_GRAVITY, parametrise({"": mounting}), at)
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
            findings.summary = (f"{len(read_settings(findings.path)[0])} positions",)
            return
        table, _ = read_number_table(findings.path, str(findings.path), [name for name in names if name != "mounting"])
    except InputError as error:
        findings.add(str(error).removeprefix(f"{findings.path}").lstrip(":, "))
        return
    for value, line in zip(table.columns.get("dwell_s", ()), table.lines, strict=False):
        if value <= 0.0:
            findings.add(f"column 'dwell_s': {exactly(value)} must be positive", line=int(line))
    findings.summary = (f"{len(table.lines)} rows, columns {', '.join(names)}",)


def _check_json(findings: Findings, text: str) -> None:
    """Check a file of results; its schema must be one of this program."""
    try:
        content = json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        findings.add(f"is not JSON: {error.msg}, column {error.colno}", line=error.lineno)
        return
    except (ValueError, RecursionError) as error:
        findings.add(f"is not JSON: {error}")
        return
    if not isinstance(content, dict) or "schema" not in content:
        findings.add("has no schema; a file of results begins with one")
        return
    findings.lines, schema = json_lines(text), content["schema"]
    if not isinstance(schema, str) or schema not in SCHEMAS:
        findings.add(f"schema: {schema!r} cannot be checked; {nearest(str(schema), list(SCHEMAS))}", ("schema",))
        return
    kind = findings.kind = SCHEMAS[schema]
    if kind == "calibration" and ("of_record" in content or schema == JOINT_SCHEMA):
        findings.kind = "calibration of several records"
    model: type[BaseModel] = MODELS.get(kind, PositionPlan)
    if kind == "plan" and "plans" in content:
        model = Plans
    elif kind == "plan" and "target" in content:
        model = Plan
    former: dict[Location, Location] = {}
    if schema in (SECOND_SCHEMA, FIRST_SCHEMA):
        former = {present: place for place, present in RENAMED.items()}
    if kind == "diagnosis":
        content = in_present_schema(content)
        text = json.dumps(content)
    try:
        model.model_validate_json(text, strict=True)
    except ValidationError as error:
        keys = {field.alias or name for name, field in model.model_fields.items()}
        keys |= {str(where[0]) for where in former.values()}
        for place, problem in field_problems(error, model):
            where = former.get(place, place)
            problem = problem.replace(dotted(place), dotted(where), 1)
            if problem.endswith(": is missing"):
                unknown = []
                for key in _at(content, where[:-1]):
                    if key not in keys:
                        unknown.append(key)
                for close in get_close_matches(str(where[-1]), unknown, n=1):
                    problem += f" (is '{close}' meant?)"
            findings.add(problem, where)
    if kind == "calibration" and not findings.problems:
        content = calibration_of(content)
        _check_calibration(content, findings)
    if kind == "diagnosis" and not findings.problems:
        _summarise_diagnosis(Diagnosis.model_validate_json(text), findings)
    elif not findings.problems:
        findings.summary = (_summary_of(kind, content),)


def _summarise_diagnosis(diagnosis: Diagnosis, findings: Findings) -> None:
    """Note the verdict, and the named effects, or the first remaining ones."""
    records = ""
    if diagnosis.records:
        findings.kind, records = "diagnosis of several records", f"{len(diagnosis.records)} records, "
    summary = f"{records}{diagnosis.verdict}"
    if diagnosis.best is not None:
        causes, separator = [], ", "
        for cause in diagnosis.best.causes:
            text = f"{cause.effect} {cause.where}"
            if diagnosis.records:
                text, separator = cause.place.title, "; "
            causes.append(text)
        summary += f": {separator.join(causes) or diagnosis.best.sentence}"
    findings.summary = (summary,)


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _at(content: Any, location: tuple[int | str, ...]) -> list[str]:
    """Return the keys of the object at a location."""
    for part in location:
        content = content[part]
    if not isinstance(content, dict):
        return []
    return list(content)


def _check_calibration(content: Mapping[str, Any], findings: Findings) -> None:
    """Check a calibration beyond its fields: symbols, intervals, bounds that fit together."""
    try:
        stands = gives_parameters(content["verdict"], content.get("estimator"))
        if stands and ("reading_errors" in content or "of_record" in content):
            correction_of(content, "calibration")
        else:
            target_estimates(of_one_record(content))
    except (InputError, ValueError) as error:
        problem = str(error).removeprefix("calibration: ")
        place: Location = ("parameters",)
        for number, entry in reversed(list(enumerate(content["parameters"]))):
            if problem.startswith(f"{entry.get('symbol')}:"):
                place = ("parameters", number)
        findings.add(problem, place)
    except KeyError as error:
        findings.add(f"parameters: lack {error.args[0]!r}", ("parameters",))


def _summary_of(kind: str, content: Mapping[str, Any]) -> str:
    if kind == "calibration" and content.get("of_record"):
        return f"{len(content['of_record'])} records, {content['verdict']}"
    if kind == "calibration" and content["sigma"]["value"] is None:
        return f"{content['verdict']}, of a record in motion"
    if kind == "calibration":
        positions, sigma = content.get("positions", 0), upwards(content["sigma"]["value"], 3)
        return f"{content['verdict']}, {positions} positions, σ = {sigma} g"
    if kind == SCHEMAS[INSTRUMENT]:
        return f"{content['date']}: {content['kind']}, {content['verdict']}"
    if "pool" in content:
        rests, ratio = len(content["programme"]), upwards(content["worst_ratio"], 4)
        return f"{rests} rests in {digits(content['minutes'])} minutes, worst ratio {ratio} ({content['worst']})"
    if "positions" in content:
        return f"{len(content['positions'])} positions for all targets, worst ratio " + upwards(
            content["worst_ratio"], 6
        )
    plans = content.get("plans", [content])
    return f"optimal plans of {', '.join(str(plan['target']) for plan in plans)}"
