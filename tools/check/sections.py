"""List all problems of a scenario, a campaign or a file of mountings."""

import tomllib

from pydantic import BaseModel, ValidationError

from ..calibration.model import checked_mounting
from ..campaign.file import SCHEMA as CAMPAIGN
from ..campaign.file import Campaign
from ..errors import nearest
from ..orchestrator.scenario import SCHEMA as SCENARIO
from ..orchestrator.scenario import Scenario
from ..result import field_problems, not_for_files
from .findings import Findings, toml_lines
from .scenario import check_scenario


def check_sections(findings: Findings, text: str) -> None:
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
