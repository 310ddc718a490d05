"""An FMU that misbehaves by its name, the runs that make each of its calls, and the expected messages."""

import re
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import polars as pl
import pytest

from scenario_runs import scenario, wires
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import run_scenario

SOURCE = Path(__file__).with_name("hostile.c")
HEADERS = Path(fmpy.__file__).parent / "c-code"
_KINDS = {"Real": "0", "Integer": "0", "Boolean": "false", "String": ""}
_DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Hostile" guid="h">
<CoSimulation modelIdentifier="hostile" canGetAndSetFMUstate="true"/>
<ModelVariables>{}</ModelVariables><ModelStructure/>
</fmiModelDescription>"""
BEFORE = ("Instantiate", "SetupExperiment", "EnterInitializationMode", "ExitInitializationMode")
STATES = ("GetFMUstate", "SetFMUstate", "FreeFMUstate")
ACCESSES = tuple(f"{verb}{kind}" for verb in ("Set", "Get") for kind in _KINDS)
CALLS = (*BEFORE, *ACCESSES, "DoStep", *STATES, "Terminate", "FreeInstance")
LIMIT_S = 3.0
WAYS = {
    "error": "ended with Error",
    "exit": r"ended its process \(exit status 0\)",
    "crash": r"crashed \(SIGSEGV\)",
    "hang": rf"did not return within {LIMIT_S:g} s \(run.call_limit_s\)",
}


def build_hostile(folder: Path) -> Path:
    """Build it; the test is skipped without a C compiler named cc."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    library = folder / f"hostile{fmpy.sharedLibraryExtension}"
    command = [compiler, "-shared", "-fPIC", "-w", f"-I{HEADERS}", SOURCE, "-o", library, "-lpthread"]
    subprocess.run(command, check=True)
    variables = ""
    for at, (kind, start) in enumerate(_KINDS.items()):
        variability = "continuous" if kind == "Real" else "discrete"
        for end, process in (("in", f' start="{start}"'), ("out", "")):
            attributes = f'name="{kind}_{end}" valueReference="{at}" causality="{end}put" variability="{variability}"'
            variables += f"<ScalarVariable {attributes}><{kind}{process}/></ScalarVariable>"
    with zipfile.ZipFile(folder / "Hostile.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", _DESCRIPTION.format(variables))
        archive.write(library, f"binaries/{fmpy.platform}/hostile{fmpy.sharedLibraryExtension}")
    return folder / "Hostile.fmu"


def hostile_scenario(folder: Path, name: str, **sections: Any) -> dict[str, Any]:
    """Return ten steps of 0.1 s that make all calls of the FMU of this name for a run of its kind."""
    settings = f"good.Real_out -> {name}.Real_in"
    if name.partition("_")[2] in STATES:
        connections, coupling = wires(settings, f"{name}.Real_out -> good.Real_in"), {"coupling": "iterate"}
    else:
        connections = wires(settings, *(f"good.{kind}_out -> {name}.{kind}_in" for kind in _KINDS if kind != "Real"))
        coupling = {}
    setting = {"stop_s": 1.0, "step_s": 0.1, "call_limit_s": LIMIT_S, **coupling, **sections}
    return {"run": setting, "connections": connections, "fmus": {n: {"fmu": "Hostile.fmu"} for n in ("good", name)}}


def outcome(folder: Path, name: str, out: Path, *, together: bool = False) -> str:
    """Return the refusal of the run; `together`: of one that may have all FMUs in one process."""
    options = hostile_scenario(folder, name)
    if together:
        # A limit of calls and recorded texts each need a process for each FMU.
        del options["run"]["call_limit_s"]
        columns = {}
        for kind in _KINDS.keys() - {"String"}:
            columns[kind] = f"{name}.{kind}_out"
        options["record"] = {"columns": columns, "own_units": True}
    try:
        run_scenario(scenario(folder, options.pop("fmus"), **options), out)
    except InputError as error:
        return str(error)
    return ""


def assert_named_and_kept(folder: Path, call: str, way: str, out: Path, *, together: bool = False) -> None:
    """Assert that the run of such an FMU names it, the call and the time, and keeps its rows until then."""
    name = f"{way}_{call}"
    message = outcome(folder, name, out, together=together)
    begin, last = {
        **dict.fromkeys(BEFORE, (None, None)),
        **dict.fromkeys(("Terminate", "FreeInstance"), ("1", 1.0)),
        "GetFMUstate": ("0.3", 0.3),
    }.get(call, ("0.3" if call in ACCESSES and call.startswith("Get") else "0.2", 0.2))
    assert message.startswith(f"FMU '{name}' (Hostile.fmu): "), message
    assert "\n" not in message
    if call == "Instantiate":
        # There is no instance yet that could return a status.
        expected = "fmi2Instantiate failed" if way == "error" else f"its library cannot be loaded.*{WAYS[way]}"
        assert re.search(expected, message), message
    else:
        when = "before the first step" if begin is None else f"at {begin} s"
        assert re.search(rf": fmi2{call} {when} {WAYS[way]}", message), message
    if last is None:
        assert not out.exists()
        return
    rows = pl.read_parquet(out / "run.parquet")
    assert rows["time_s"].to_list() == pytest.approx([0.1 * k for k in range(round(last / 0.1) + 1)])
    assert f"; {out / 'run.parquet'} has the run up to {last:.9g} s" in message
