"""Everything that is wrong with a text or a table: what it is, by its content, then fault by fault."""

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

from ...fmus.parameters import CALIBRATIONS, JOINT_SCHEMA, RENAMED, calibration_of, of_one_record, target_estimates
from ...fmus.units import STANDARD_GRAVITY
from ..calibrated import Calibration
from ..calibration.correction import correction_of
from ..calibration.exchanged import channels_advice
from ..calibration.model import Positions, checked_mounting, parametrise
from ..campaign.file import SCHEMA as CAMPAIGN
from ..campaign.file import Campaign
from ..diagnosis import Diagnosis, Several
from ..diagnosis.result import DIAGNOSIS, FIRST_DIAGNOSIS
from ..diagnosis.several import SEVERAL
from ..errors import InputError, nearest
from ..evidence.carried_checks import downward_warning, wrong_channels
from ..instrument import INSTRUMENT, Entry
from ..motion import inspect_record
from ..motion.rests import FEWEST_ROWS
from ..orchestrator.scenario import SCHEMA as SCENARIO
from ..orchestrator.scenario import Scenario
from ..orchestrator.stimuli import read_table
from ..parquet import MAGIC
from ..planning.check import read_angles
from ..planning.common import PositionPlan
from ..planning.imu import ImuPlan
from ..planning.plan import Plan, Plans
from ..records.columns import ANGLES, FORCE, VELOCITY, Columns, extra_warning, warnings
from ..records.kinds import PositionRecord, RawRecord, StrapdownRecord
from ..records.limits import limits_of
from ..records.read import all_faults, read_record
from ..records.rests import position_record_of
from ..result import dotted, field_problems, not_for_files
from ..rounding import digits, exactly, upwards
from .findings import Findings, json_lines, toml_lines
from .scenario import check_scenario

SCHEMAS = {
    **dict.fromkeys(CALIBRATIONS, "calibration"),
    DIAGNOSIS: "diagnosis",
    FIRST_DIAGNOSIS: "diagnosis",
    "trihedron.plan/1": "plan",
    "trihedron.imu-plan/1": "plan for the whole IMU",
    SEVERAL: "diagnosis of several records",
    INSTRUMENT: "entry of an instrument's folder",
}
MODELS = {
    "calibration": Calibration,
    "diagnosis": Diagnosis,
    SCHEMAS[SEVERAL]: Several,
    SCHEMAS[INSTRUMENT]: Entry,
    SCHEMAS["trihedron.imu-plan/1"]: ImuPlan,
}
ALIGNED = np.eye(3)
"""The mounting of a block of which nothing is said."""
MOST = 200
"""So many problems of a record are listed."""


def check_content(found: Findings, data: bytes, channels: Sequence[str]) -> int | None:
    """Note what is wrong with a file that is no archive; so many problems of it are listed, all without a number.

    A scenario, campaign or file of mountings (TOML); a calibration, diagnosis or plan (JSON); anything else is a table.
    """
    ending = found.path.suffix.lower()
    if ending not in (".toml", ".json"):
        _check_table(found, data, channels)
        return MOST
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        found.add(f"byte {error.start + 1} is not UTF-8 text; save it as UTF-8", line=line)
    else:
        (_check_json if ending == ".json" else _check_toml)(found, text)
    return None


def _check_toml(found: Findings, text: str) -> None:
    """A scenario, a campaign or a file of mountings."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        said, _, place = str(error).partition(" (at line ")
        line = place.partition(",")[0]
        found.add(f"is not TOML: {said}", line=int(line) if line.isdigit() else None)
        return
    except (ValueError, RecursionError) as error:
        found.add(f"is not TOML: {error}")
        return
    found.lines = toml_lines(text)
    schema = data.get("schema")
    for name, said in not_for_files(data, Campaign if schema == CAMPAIGN else Scenario).items():
        found.add(said, (name,))
        del data[name]
    if schema == CAMPAIGN:
        found.kind = "campaign"
        try:
            Campaign.model_validate(data)
        except ValidationError as error:
            for where, text in field_problems(error, Campaign):
                found.add(text, where)
    elif schema == SCENARIO or "fmus" in data or "run" in data:
        found.kind = "scenario"
        if "schema" not in data:
            found.add(f'schema is missing; write schema = "{SCENARIO}"')
        check_scenario(data, found)
    elif schema is None and data and all(isinstance(v, dict) and "matrix" in v for v in data.values()):
        found.kind, found.summary = "file of mountings", (f"mountings {', '.join(data)}",)
        for name, table in data.items():
            for key in table:
                if key != "matrix":
                    found.add(f"{name}.{key}: unknown key; write matrix = [[...], [...], [...]]", (name, key))
            with found.of((name, "matrix")):
                checked_mounting(table["matrix"], f"[{name}]")
    elif schema is None:
        found.add(f'schema is missing; as "{SCENARIO}"')
    else:
        found.add(f"schema: {schema!r} is not known; {nearest(str(schema), [SCENARIO, CAMPAIGN])}", ("schema",))


def _check_table(found: Findings, data: bytes, channels: Sequence[str]) -> None:
    """A table of measured or commanded numbers, CSV or Parquet.

    Of a record every field that is wrong, by row; of a series without such fields also the limits of its channels, and
    whether a raw record has rests.
    """
    names = [] if data.startswith(MAGIC) else _header(data)
    if names and not set(names) & {*FORCE, *VELOCITY} and set(names) & {*ANGLES, "time_s"}:
        _check_commands(found, names)
        return

    def listed():
        """The faults; what the reader has at its end is the columns."""
        nonlocal columns
        columns = yield from all_faults(found.path, data)

    columns: Columns | None = None
    for fault in listed():
        found.add(f"column {fault.column}: {fault.what}" if fault.column is not None else fault.what, line=fault.row)
    found.kind = "record" if columns is None else columns.layout.kind.name
    if columns is None:
        return
    found.warnings = extra_warning(columns)
    if found.problems:
        return
    found.warnings += warnings(columns)
    there = [name for name in columns.layout.present if name in (names or read_parquet_schema(BytesIO(data)))]
    found.summary = (f"{len(columns.row)} rows, columns {', '.join(there)}",)
    record = read_record(found.path, channels=channels)
    found.warnings += tuple(line for line in record.warnings if line not in found.warnings)
    if isinstance(record, PositionRecord):
        found.warnings += channels_warning(record)
        return
    found.warnings += tuple(limits_of(record).lines)
    if isinstance(record, StrapdownRecord):
        found.warnings += channels_warning(record)
        return
    with found.of():
        averaged = position_record_of(record)
        found.warnings += channels_warning(averaged)
        found.summary += (f"{len(averaged.rests)} rests, {len(averaged)} of them good",)


def channels_warning(
    record: PositionRecord | RawRecord | StrapdownRecord, mounting: NDArray | None = ALIGNED
) -> tuple[str, ...]:
    """What `calibrate` or `diagnose` would say of the channels of a record.

    Block axes from axes of the inner frame are a mounting (3, 3); of a record on the table with several, or with none
    that is known, nothing is said. Gyros are looked at beside gravity and the true attitude. A record that has too few
    rows, or no rests, tells nothing.
    """
    if isinstance(record, StrapdownRecord):
        said = wrong_channels(inspect_record(record)) if len(record) >= FEWEST_ROWS else ()
        return (*said, *downward_warning(record))
    if isinstance(record, RawRecord):
        try:
            record = position_record_of(record)
        except InputError:
            return ()
    if record.mounting is not None or mounting is None:
        return ()
    at = Positions(record.alpha, record.beta, np.zeros(len(record), dtype=int))
    said = channels_advice(record, record.specific_force / STANDARD_GRAVITY, parametrise({"": mounting}), at)
    return (said,) if said else ()


def _header(data: bytes) -> list[str]:
    """The names in the first written line; none where there is no text."""
    lines = data[:100_000].decode("utf-8-sig", "replace").splitlines()
    written = next((line for line in lines if line.strip() and not line.startswith("#")), "")
    try:
        return [name.strip() for name in next(csv.reader([written]))]
    except (csv.Error, StopIteration):
        return []


def _check_commands(found: Findings, names: list[str]) -> None:
    """A table without readings: a position programme, the angles of a plan that were set, or rows for inputs."""
    found.kind = "position programme" if set(names) <= {*ANGLES, "dwell_s"} else "table of numbers"
    try:
        if any(name.startswith("planned_") for name in names):
            found.kind = "angles of a plan"
            found.summary = (f"{len(read_angles(found.path)[0])} positions",)
            return
        table, _ = read_table(found.path, str(found.path), [name for name in names if name != "mounting"])
    except InputError as error:
        found.add(str(error).removeprefix(f"{found.path}").lstrip(":, "))
        return
    for value, line in zip(table.columns.get("dwell_s", ()), table.lines, strict=False):
        if value <= 0.0:
            found.add(f"column 'dwell_s': {exactly(value)} must be positive", line=int(line))
    found.summary = (f"{len(table.lines)} rows, columns {', '.join(names)}",)


def _check_json(found: Findings, text: str) -> None:
    """A file of results; one of a schema that is not known is not of this program."""
    try:
        content = json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        found.add(f"is not JSON: {error.msg}, column {error.colno}", line=error.lineno)
        return
    except (ValueError, RecursionError) as error:
        found.add(f"is not JSON: {error}")
        return
    if not isinstance(content, dict) or "schema" not in content:
        found.add("has no schema; a file of results begins with one")
        return
    found.lines, schema = json_lines(text), content["schema"]
    if not isinstance(schema, str) or schema not in SCHEMAS:
        found.add(f"schema: {schema!r} cannot be checked; {nearest(str(schema), list(SCHEMAS))}", ("schema",))
        return
    kind = found.kind = SCHEMAS[schema]
    model: type[BaseModel] = MODELS.get(kind, PositionPlan)
    if kind == "plan":
        model = Plans if "plans" in content else Plan if "target" in content else PositionPlan
    former = {} if schema in (CALIBRATIONS[0], JOINT_SCHEMA) else {present: place for place, present in RENAMED.items()}
    try:
        model.model_validate_json(text, strict=True)
    except ValidationError as error:
        known = [field.alias or name for name, field in model.model_fields.items()]
        for place, said in field_problems(error, model):
            where = former.get(place, place)
            said = said.replace(dotted(place), dotted(where), 1)
            meant = ""
            if said.endswith(": is missing"):
                beside = _at(content, where[:-1])
                close = get_close_matches(str(where[-1]), [k for k in beside if k not in known], n=1)
                meant = f" (is '{close[0]}' meant?)" if close else ""
            found.add(said + meant, where)
    if kind == "calibration" and not found.problems:
        content = calibration_of(content)
        if content.get("of_record"):
            found.kind = "calibration of several records"
        _check_calibration(content, found)
    if not found.problems:
        found.summary = (_summary_of(kind, content),)


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _at(content: Any, location: tuple[int | str, ...]) -> list[str]:
    """The keys of the object at a location."""
    for part in location:
        content = content[part]
    return list(content) if isinstance(content, dict) else []


def _check_calibration(content: Mapping[str, Any], found: Findings) -> None:
    """What uses of a calibration ask for beside its fields: symbols, intervals, bounds that fit together."""
    try:
        if content["verdict"] == "consistent" and ("reading_errors" in content or "of_record" in content):
            correction_of(content, "calibration")
        else:
            target_estimates(of_one_record(content))
    except (InputError, ValueError) as error:
        said = str(error).removeprefix("calibration: ")
        named = (k for k, entry in enumerate(content["parameters"]) if said.startswith(f"{entry.get('symbol')}:"))
        found.add(said, ("parameters", *list(named)[:1]))
    except KeyError as error:
        found.add(f"parameters: lack {error.args[0]!r}", ("parameters",))


def _summary_of(kind: str, content: Mapping[str, Any]) -> str:
    if kind == "calibration" and content.get("of_record"):
        return f"{len(content['of_record'])} records, {content['verdict']}"
    if kind == "calibration":
        return f"{content['verdict']}, {content['positions']} positions, σ = {upwards(content['sigma']['value'], 3)} g"
    if kind == "diagnosis":
        causes = ", ".join(f"{cause['effect']} {cause['where']}" for cause in content["causes"])
        return f"{content['verdict']}{f': {causes}' if causes else ''}"
    if kind == SCHEMAS[INSTRUMENT]:
        return f"{content['date']}: {content['kind']}, {content['verdict']}"
    if kind == SCHEMAS[SEVERAL]:
        causes = "; ".join(cause["title"] for cause in content["causes"])
        return f"{len(content['records'])} records, {content['verdict']}{f': {causes}' if causes else ''}"
    if "pool" in content:
        rests, ratio = len(content["programme"]), upwards(content["worst_ratio"], 4)
        return f"{rests} rests in {digits(content['minutes'])} minutes, worst ratio {ratio} ({content['worst']})"
    if "positions" in content:
        return f"{len(content['positions'])} positions for all targets, worst ratio " + upwards(
            content["worst_ratio"], 6
        )
    plans = content.get("plans", [content])
    return f"optimal plans of {', '.join(str(plan['target']) for plan in plans)}"
