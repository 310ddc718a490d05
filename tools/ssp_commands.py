"""The command that writes a scenario's system for other tools."""

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter

from .answers import Answer, answer
from .options import JsonFile
from .outputs import distinct_files, ordinary_file


def export_ssp(
    scenario: Path,
    /,
    *,
    out: Annotated[Path, Parameter(help="The .ssp to write.", validator=ordinary_file)],
    flavour: Annotated[
        Literal["python", "native"] | None,
        Parameter(help="native: compiled, the default where there is a compiler; python: run by PythonFMU."),
    ] = None,
    fmi: Annotated[int, Parameter(help="Version of FMI: 2, which the tools that open an .ssp run.")] = 2,
    platform: Annotated[
        str | None,
        Parameter(help="Of native FMUs: host (the default), all, or a name such as x86_64-windows."),
    ] = None,
    json: JsonFile = None,
) -> Answer:
    """Write the system of a scenario as an .ssp (SSP 1.0), which OMSimulator, FMPy and `trihedron simulate` open.

    Its position programme becomes a component, constants become parameters.

    Example: trihedron export-ssp scenarios/static-calibration.toml --out static-calibration.ssp

    Parameters
    ----------
    scenario
        The scenario file (TOML).
    """
    from .scenario import read_scenario
    from .ssp.exporting import export_ssp as export

    distinct_files({"the scenario": scenario, "--out": out, "--json": json})
    path = export(read_scenario(scenario), out, flavour=flavour, fmi=fmi, platform=platform)
    return answer(str(path), json, {"schema": "trihedron.export-ssp/1", "file": str(path), "scenario": str(scenario)})
