"""List all problems of a file of results: its schema, its fields, and their contradictions."""

import json
from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any

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
from ..calibrated import Calibration
from ..calibration.correction import correction_of
from ..diagnosis import Diagnosis
from ..diagnosis.result import DIAGNOSES, in_present_schema
from ..errors import InputError, nearest
from ..instrument import INSTRUMENT, Entry
from ..planning import ImuPlan, Plan, Plans, PositionPlan
from ..result import Location, dotted, field_problems
from ..rounding import digits, upwards
from .findings import Findings, json_lines

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


def check_results(findings: Findings, text: str) -> None:
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
    raise ValueError(f"{constant} is not a JSON number")


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
