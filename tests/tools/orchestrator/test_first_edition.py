"""FMUs of FMI 1.0, of both interfaces: a strict one of our own, `first.c`."""

import math
import shutil
import subprocess
import zipfile
from pathlib import Path
from typing import Any

import fmpy
import pytest

from scenario_runs import refusal, run_of_guests, wires
from trihedron.tools import library

SOURCE = Path(__file__).parents[2] / "foreign_fmus" / "first.c"
VARIABLES = (
    ("Real", "u", 0, "causality='input'", "start='0'"),
    ("Real", "x", 1, "causality='output'", "start='0'"),
    ("Real", "der(x)", 2, "", ""),
    ("Real", "k", 3, "variability='parameter'", "start='1'"),
    ("Boolean", "on", 0, "causality='output' variability='discrete'", ""),
    ("Boolean", "switch", 1, "causality='input' variability='discrete'", "start='true'"),
    ("Integer", "steps", 0, "causality='output' variability='discrete'", ""),
)
SLAVE = (
    "<Implementation><CoSimulation_StandAlone>"
    "<Capabilities canHandleVariableCommunicationStepSize='true' canRejectSteps='false' canHandleEvents='true'/>"
    "</CoSimulation_StandAlone></Implementation>"
)
EXCHANGE = ("ME", "CS")
RUN = {"stop_s": 1.0, "step_s": 0.1}
GIVEN = {"k": 2.0, "u": 1.0}


def build(folder: Path, kind: str, *macros: str, added: tuple[tuple[Any, ...], ...] = ()) -> Path:
    """Compile the FMU (skipped without cc) and return it."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    if kind == "ME":
        macros = (*macros, "EXCHANGE")
    library_file = folder / f"first{fmpy.sharedLibraryExtension}"
    command = [compiler, "-shared", "-fPIC", "-w", f"-I{Path(fmpy.__file__).parent / 'c-code'}"]
    command += [*(f"-D{macro}" for macro in macros), str(SOURCE), "-lm", "-o", str(library_file)]
    subprocess.run(command, check=True)
    variables = ""
    for value, name, reference, attributes, start in VARIABLES + added:
        head = f"<ScalarVariable name='{name}' valueReference='{reference}' {attributes}>"
        variables += f"{head}<{value} {start}/></ScalarVariable>"
    fmu = folder / f"First{kind}.fmu"
    with zipfile.ZipFile(fmu, "w") as archive:
        archive.writestr(
            "modelDescription.xml",
            "<fmiModelDescription fmiVersion='1.0' modelName='First' modelIdentifier='first' guid='g'"
            f" numberOfContinuousStates='{int(kind == 'ME')}' numberOfEventIndicators='0'>"
            f"<ModelVariables>{variables}</ModelVariables>{SLAVE if kind == 'CS' else ''}</fmiModelDescription>",
        )
        archive.write(library_file, f"binaries/{fmpy.platform}/{library_file.name}")
    return fmu


def exact(time: float, start: float = 0.0) -> float:
    """Return the solution of x' = 1 - 2 x."""
    return 0.5 + (start - 0.5) * math.exp(-2.0 * time)


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", EXCHANGE)
def test_values_events_and_start_values(kind: str, tmp_path: Path) -> None:
    name = build(tmp_path, kind).name
    for start in (0.0, 1.0):
        fmu = {"fmu": name, "parameters": {**GIVEN, "x": start}}
        table = run_of_guests(tmp_path, {"first": fmu}, run=RUN).table
        times = table["time_s"].to_list()
        assert table["first.x"].to_list() == pytest.approx([exact(t, start) for t in times], abs=2e-5)
        assert table["first.on"].to_list() == [t > 0.35 for t in times]
    if kind == "CS":
        assert table["first.steps"].to_list() == list(range(11))
    fmu = {"fmu": name, "parameters": {**GIVEN, "switch": False}}
    assert set(run_of_guests(tmp_path, {"first": fmu}, run=RUN).table["first.x"]) == {0.0}


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", EXCHANGE)
def test_the_options_of_a_single_fmu(kind: str, tmp_path: Path) -> None:
    """u jumps from 1 to 2 at 0.5 s; 0.3 s does not divide the run."""
    fmu = build(tmp_path, kind)
    (tmp_path / "u.csv").write_text("time,u\n0,1\n0.5,1\n0.5,2\n1,2\n")
    run = library.simulate(fmu, values=["k=2"], inputs=tmp_path / "u.csv", stop=1.0, step=0.1, record=["x"])
    assert run.table[f"{fmu.stem}.x"][-1] == pytest.approx(2.0 * exact(0.5) + exact(0.5) * math.exp(-1.0), abs=2e-5)
    run = library.simulate(fmu, values=["k=2", "u=1"], stop=1.0, step=0.3, in_process=True)
    assert run.table[f"{fmu.stem}.x"][-1] == pytest.approx(exact(1.0), abs=2e-5)


@pytest.mark.acceptance
def test_both_interfaces_in_one_system(tmp_path: Path) -> None:
    fmus = {
        "first": {"fmu": build(tmp_path, "CS").name, "parameters": {**GIVEN}},
        "second": {"fmu": build(tmp_path, "ME").name},
    }
    run = run_of_guests(tmp_path, fmus, run={**RUN, "step_s": 0.001}, connections=wires("first.x -> second.u"))
    # y' = x - y; the input x is held over a step.
    expected = 0.5 - math.exp(-1.0) + 0.5 * math.exp(-2.0)
    assert run.table["second.x"][-1] == pytest.approx(expected, abs=5e-4)


def test_a_failure_names_the_call_and_the_message(tmp_path: Path) -> None:
    message = refusal(tmp_path, {"first": {"fmu": build(tmp_path, "CS", "FAILING").name}}, run=RUN)
    assert "DoStep at 0.5 s ended with Error: fuse blown" in message


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", EXCHANGE)
def test_a_negative_alias_has_the_other_sign(kind: str, tmp_path: Path) -> None:
    """FMI 1.0 gives the value of the other variable."""
    minus = ("Real", "minus", 1, "causality='output' alias='negatedAlias'", "")
    fmu = {"fmu": build(tmp_path, kind, added=(minus,)).name, "parameters": GIVEN}
    table = run_of_guests(tmp_path, {"first": fmu}, run=RUN).table
    assert (table["first.minus"] == -table["first.x"]).all()
    assert table["first.minus"][-1] == pytest.approx(-exact(1.0), abs=2e-5)
    for causality, value in (("input", "Real"), ("output", "Integer")):
        alias = (value, "minus", 0, f"causality='{causality}' alias='negatedAlias'", "")
        fmu = build(tmp_path, kind, added=(alias,))
        says = f"{causality} 'minus' is the negative of another variable"
        assert says in refusal(tmp_path, {"first": {"fmu": fmu.name}})
