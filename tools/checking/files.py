"""What a file is, by its content, and everything that is wrong with it: the function behind `trihedron check`."""

import tomllib
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from ..errors import InputError, nearest, nearest_file
from .archives import check_fmu, check_ssp
from .findings import Findings
from .record_file import check_record
from .result import Check, Problem
from .result_file import check_results
from .scenario_file import check_scenario
from .source_lines import toml_lines

SCENARIO = "trihedron.scenario/1"
CAMPAIGN = "trihedron.campaign/1"


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
        return Check(path, "FMU" if ending == ".fmu" else "SSP archive", (what,))
    if ending not in (".toml", ".json"):
        return check_record(path, data)
    try:
        text = data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        row = data[: error.start].count(b"\n") + 1
        return Check(path, "unknown", (Problem(f"byte {error.start + 1} is not UTF-8 text; save it as UTF-8", row),))
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
        return Check(path, "unknown", (Problem(f"is not TOML: {said}", int(line) if line.isdigit() else None),))
    except (ValueError, RecursionError) as error:
        return Check(path, "unknown", (Problem(f"is not TOML: {error}"),))
    schema = data.get("schema")
    if schema == CAMPAIGN:
        return _check_campaign(path, text, data)
    if schema == SCENARIO or "fmus" in data or "run" in data:
        return _scenario(path, text, data)
    if schema is None and data and all(isinstance(v, dict) and "matrix" in v for v in data.values()):
        return _check_mountings(path, text, data)
    known = nearest(str(schema), [SCENARIO, CAMPAIGN])
    what = f"schema: {schema!r} is not known; {known}" if schema is not None else f'schema is missing; as "{SCENARIO}"'
    return Check(path, "unknown", (Problem(what, toml_lines(text).get(("schema",))),))


def _scenario(path: Path, text: str, data: dict[str, Any]) -> Check:
    found = check_scenario(path, text, data)
    if "schema" in data:
        return found
    missing = Problem(f'schema is missing; write schema = "{SCENARIO}"')
    return Check(path, "scenario", (missing, *found.problems))


def _check_campaign(path: Path, text: str, data: dict[str, Any]) -> Check:
    from ..campaign.file import Campaign, campaign_problems

    findings = Findings(toml_lines(text))
    try:
        Campaign.model_validate(data)
    except ValidationError as error:
        for problem in campaign_problems(error):
            findings.add(problem.text, problem.location)
    return Check(path, "campaign", findings.problems())


def _check_mountings(path: Path, text: str, data: dict[str, Any]) -> Check:
    from ..calibration.mountings import checked_mounting

    findings = Findings(toml_lines(text))
    for name, table in data.items():
        for key in table:
            if key != "matrix":
                findings.add(f"{name}.{key}: unknown key; write matrix = [[...], [...], [...]]", (name, key))
        with findings.of((name, "matrix")):
            checked_mounting(table["matrix"], f"[{name}]")
    return Check(path, "file of mountings", findings.problems(), summary=(f"mountings {', '.join(data)}",))
