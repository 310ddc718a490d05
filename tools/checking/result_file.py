"""Everything that is wrong with a file of results: a calibration, a diagnosis, a plan."""

import json
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from ...fmus.parameters import target_estimates
from ..errors import InputError, nearest
from ..field_problems import field_problems
from .findings import Findings
from .published import (
    DiagnosisFile,
    PositionPlanFile,
    TargetPlanFile,
    TargetPlansFile,
)
from .result import Check, Problem
from .source_lines import json_lines

SCHEMAS = {
    "trihedron.calibration/1": "calibration",
    "trihedron.diagnosis/1": "diagnosis",
    "trihedron.plan/1": "plan",
}


def check_results(path: Path, text: str) -> Check:
    """Check a JSON file of results; one of a schema that is not known is not of this program."""
    try:
        content = json.loads(text, parse_constant=_refused)
    except json.JSONDecodeError as error:
        return Check(path, "unknown", (Problem(f"is not JSON: {error.msg}, column {error.colno}", error.lineno),))
    except (ValueError, RecursionError) as error:
        return Check(path, "unknown", (Problem(f"is not JSON: {error}"),))
    if not isinstance(content, dict) or "schema" not in content:
        return Check(path, "unknown", (Problem("has no schema; a file of results begins with one"),))
    schema = content["schema"]
    if not isinstance(schema, str) or schema not in SCHEMAS:
        what = f"schema: {schema!r} cannot be checked; {nearest(str(schema), list(SCHEMAS))}"
        return Check(path, "unknown", (Problem(what, _line(text, ("schema",))),))
    return _check(path, text, content, SCHEMAS[schema])


def _refused(constant: str) -> float:
    raise ValueError(f"{constant} is no JSON number")


def _line(text: str, location: tuple[str, ...]) -> int | None:
    return json_lines(text).get(location)


def _model(kind: str, content: Mapping[str, Any]) -> type[BaseModel]:
    if kind == "plan":
        return TargetPlansFile if "plans" in content else TargetPlanFile if "target" in content else PositionPlanFile
    if kind == "diagnosis":
        return DiagnosisFile
    # `import trihedron` does not wait for the calibration
    from ..calibration import Calibration

    return Calibration


def _check(path: Path, text: str, content: dict[str, Any], kind: str) -> Check:
    findings = Findings(json_lines(text))
    model = _model(kind, content)
    known = [field.alias or name for name, field in model.model_fields.items()]
    warnings: list[str] = []
    try:
        model.model_validate(content)
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
    return Check(path, kind, problems, tuple(warnings), () if problems else _summary(kind, content))


def _at(content: Any, location: tuple[int | str, ...]) -> list[str]:
    """The keys of the object at a location."""
    for part in location:
        content = content[part]
    return list(content) if isinstance(content, dict) else []


def _check_calibration(content: dict[str, Any], findings: Findings) -> None:
    """What uses of a calibration ask for beside its fields: symbols, intervals, bounds that fit together."""
    from ..calibration.correction import correction_of

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


def _summary(kind: str, content: Mapping[str, Any]) -> tuple[str, ...]:
    if kind == "calibration":
        return (f"{content['verdict']}, {content['positions']} positions, σ = {content['noise_bound']:g} g",)
    if kind == "diagnosis":
        causes = ", ".join(f"{cause['effect']} {cause['where']}" for cause in content["causes"])
        return (f"{content['verdict']}{f': {causes}' if causes else ''}",)
    if "positions" in content:
        return (f"{len(content['positions'])} positions for all targets, worst ratio {content['worst_ratio']:g}",)
    plans = content.get("plans", [content])
    return (f"optimal plans of {', '.join(str(plan['target']) for plan in plans)}",)
