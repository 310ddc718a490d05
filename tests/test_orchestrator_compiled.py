"""The compiled loop against the plain one, and FMUs of both versions of FMI mixed at will: the same bits."""

import re
import shutil
import subprocess
import zipfile
from itertools import product
from pathlib import Path

import fmpy
import polars as pl
import pytest

from foreign_fmus import build_foreign, rewritten
from trihedron.fmus import build
from trihedron.fmus.native.compile import host_compiler
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario

NAMES = ("TurntableMotion", "AccelerometerBlock", "AttitudeComputer")
FLAVOURS = {"python": ("python", 2), "native-2": ("native", 2), "native-3": ("native", 3)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with three components in each flavour, and with foreign FMUs."""
    if host_compiler() is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("flavours")
    for name, (flavour, fmi) in FLAVOURS.items():
        for component in NAMES:
            build(component, folder / name, flavour=flavour, fmi=fmi)
    for script in ("foreign_clock", "foreign_gain", "foreign_accumulator"):
        build_foreign(script, folder)
    return folder


def bench(folder: Path, flavours: tuple[str, ...], **run: object) -> Scenario:
    """A table, a block and an attitude computer in some flavours, with a clock of somebody else's."""
    table, block, computer = (f"{flavour}/{name}.fmu" for flavour, name in zip(flavours, NAMES, strict=True))
    return Scenario.model_validate(
        {
            "base_folder": folder,
            "run": {"stop_s": 8.0, "step_s": 0.02, **run},
            "fmus": {
                "sum": {"fmu": "Accumulator.fmu"},
                "computer": {"fmu": computer},
                "block": {"fmu": block, "parameters": {"noise_bound": 1e-5, "seed": 3}},
                "table": {"fmu": table, "parameters": {"kappa": 1e-3, "encoder_fluctuation_bound": 4.8e-6}},
            },
            "connections": [
                {"from": "table.specific_force", "to": "block.specific_force"},
                {"from": "table.dwell", "to": "block.dwell"},
                {"from": "table.increment", "to": "computer.increment"},
                {"from": "computer.attitude[2]", "to": "sum.increment"},
            ],
            "stimuli": [
                {
                    "to": "table.command",
                    "table": {"alpha_deg": [20.0, 65.0], "beta_deg": [30.0, -40.0]},
                    "dwell_s": 1.0,
                },
                {
                    "table": {"time_s": [0.0, 1.0, 3.01], "t_degC": [20.0, 25.0, 18.0]},
                    "columns": {"block.temperature": "t_degC"},
                },
            ],
            "record": {"every": 3},
        }
    )


def test_every_mixture_gives_the_same_bits_in_both_loops(folder: Path) -> None:
    reference = simulate(bench(folder, ("python",) * 3), compiled=False).table
    assert reference.height == 134
    assert reference["sum.total"].n_unique() > 100
    for flavours in product(("native-2", "native-3"), repeat=3):
        for compiled in (True, False):
            found = simulate(bench(folder, flavours), compiled=compiled).table
            assert found.equals(reference), (flavours, compiled)
    for flavours in (("python",) * 3, ("python", "native-3", "native-2"), ("native-3", "python", "native-2")):
        assert simulate(bench(folder, flavours)).table.equals(reference), flavours


@pytest.mark.parametrize("compiled", [True, False])
def test_types_that_no_component_has(folder: Path, compiled: bool) -> None:
    columns = {"y": "g.y[2]", "n": "g.counted", "b": "g.marked"}
    scenario = Scenario.model_validate(
        {
            "base_folder": folder,
            "run": {"stop_s": 1.0, "step_s": 0.1},
            "fmus": {"f": {"fmu": "Gain.fmu"}, "g": {"fmu": "Gain.fmu", "parameters": {"times": 3}}},
            "connections": [{"from": "f.counted", "to": "g.count"}, {"from": "f.marked", "to": "g.mark"}],
            "stimuli": [
                {
                    "table": {"time_s": [0.0, 0.5], "n": [2, 5], "b": [1, 0], "u": [1.0, 2.0]},
                    "columns": {"f.count": "n", "f.mark": "b", "g.u[2]": "u"},
                }
            ],
            "record": {"columns": columns},
        }
    )
    table = simulate(scenario, compiled=compiled).table
    assert table["n"].to_list() == [6] * 6 + [15] * 5
    assert table["b"].to_list() == [True] * 6 + [False] * 5
    assert table["y"].to_list() == [3.0] * 6 + [6.0] * 5
    assert table.schema["n"] == pl.Int32


HEADERS = Path(fmpy.__file__).parent / "c-code"
FUNCTIONS = HEADERS / "fmi3Functions.h"
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Everything" instantiationToken="token">
<CoSimulation modelIdentifier="everything"/>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
{variables}
<Float64 name="stops" valueReference="50" causality="parameter" variability="fixed" start="0"/>
<Float64 name="sum" valueReference="51" causality="output"/>
</ModelVariables>
<ModelStructure/>
</fmiModelDescription>
"""
KINDS = {
    "Float64": "double", "Float32": "float", "Int8": "int8_t", "UInt8": "uint8_t", "Int16": "int16_t",
    "UInt16": "uint16_t", "Int32": "int32_t", "UInt32": "uint32_t", "Int64": "int64_t", "UInt64": "uint64_t",
    "Boolean": "bool",
}  # fmt: skip


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with an FMU of FMI 3.0 that has an input and an output of two elements of each type."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    folder = tmp_path_factory.mktemp("everything")
    source = Path(__file__).parent / "foreign_fmus" / "everything.c"
    library = folder / f"everything{fmpy.sharedLibraryExtension}"
    # Every function of FMI 3.0 must be there; those that nobody calls do nothing.
    names = re.findall(r"FMI3_Export \w+\s+(\w+);", FUNCTIONS.read_text())
    there = source.read_text()
    missing = [n for n in names if not re.search(rf"\b{n}\(|ACCESS\({n[7:]},|NOTHING\({n}\)", there)]
    (folder / "rest.c").write_text("".join(f"int {name}(void) {{ return 0; }}\n" for name in missing))
    command = [compiler, "-shared", "-fPIC", "-w", f"-I{HEADERS}", source, folder / "rest.c", "-o", library]
    subprocess.run(command, check=True)
    variables = []
    for number, kind in enumerate(KINDS):
        start = "false true" if kind == "Boolean" else "1 2"
        dimension = '<Dimension start="2"/>'
        more, at = 'variability="discrete"', 2 * number + 1
        variables.append(
            f'<{kind} name="{kind}_in" valueReference="{at}" causality="input" {more} start="{start}">'
            f'{dimension}</{kind}><{kind} name="{kind}_out" valueReference="{at + 1}" causality="output" {more}>'
            f"{dimension}</{kind}>"
        )
    with zipfile.ZipFile(folder / "Everything.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(variables="\n".join(variables)))
        archive.write(library, f"binaries/{fmpy.platform_tuple}/everything{fmpy.sharedLibraryExtension}")
    return folder


@pytest.mark.parametrize("compiled", [True, False])
def test_every_numeric_type_of_fmi_3_goes_in_and_out(everything: Path, compiled: bool) -> None:
    """The first elements are wired through a second FMU; the second ones keep the scenario's or the start values."""
    values = {kind: (True if kind == "Boolean" else 100 if "Int" in kind else 0.1) for kind in KINDS}
    scenario = Scenario.model_validate(
        {
            "base_folder": everything,
            "run": {"stop_s": 1.0, "step_s": 0.25},
            "fmus": {
                "a": {"fmu": "Everything.fmu"},
                "b": {"fmu": "Everything.fmu", "parameters": {"Int16_in[2]": -7}},
            },
            "connections": [{"from": f"a.{kind}_out[1]", "to": f"b.{kind}_in[1]"} for kind in KINDS],
            "stimuli": [{"to": f"a.{kind}_in[1]", "constant": value} for kind, value in values.items()],
        }
    )
    table = simulate(scenario, compiled=compiled).table
    row = table.row(-1, named=True)
    for kind, value in values.items():
        exact = pl.Series([value], dtype=pl.Float32)[0] if kind == "Float32" else value
        assert row[f"b.{kind}_out[1]"] == exact, kind
        second = -7 if kind == "Int16" else True if kind == "Boolean" else 2
        assert row[f"b.{kind}_out[2]"] == second, kind
    assert table.schema["b.UInt64_out[1]"] == pl.UInt64
    assert table["a.sum"].to_list() == [0.0, 0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(
    ("stops", "says"),
    [
        (1.0, "fmi3DoStep at 0.5 s ended with Error: fuse blown: 100%s"),
        (2.0, "fmi3DoStep at 0.5 s asks for the end of the simulation"),
        (3.0, "fmi3DoStep at 0.5 s returned before the end of the step"),
        (4.0, "sum is nan at 0.75 s"),
        (5.0, "fmi3GetFloat64 at 0.75 s ended with Discard (its log says nothing)"),
    ],
)
def test_a_failing_fmu_of_fmi_3_is_named_with_its_own_words(everything, compiled, stops, says) -> None:
    scenario = Scenario.model_validate(
        {
            "base_folder": everything,
            "run": {"stop_s": 1.0, "step_s": 0.25},
            "fmus": {"a": {"fmu": "Everything.fmu"}, "b": {"fmu": "Everything.fmu", "parameters": {"stops": stops}}},
        }
    )
    with pytest.raises(InputError) as refused:
        simulate(scenario, compiled=compiled)
    assert str(refused.value) == f"FMU 'b' (Everything.fmu): {says}"


@pytest.mark.parametrize(("inside", "fits"), [("0.125", True), ("0.25", True), ("0.1", False), ("0.5", False)])
def test_a_step_is_a_multiple_of_what_an_fmu_makes_inside(everything, tmp_path, inside: str, fits: bool) -> None:
    def declare(name: str, content: bytes) -> tuple[str, bytes]:
        flag = f'modelIdentifier="everything" fixedInternalStepSize="{inside}"'.encode()
        return name, content.replace(b'modelIdentifier="everything"', flag) if name.endswith(".xml") else content

    rewritten(everything / "Everything.fmu", tmp_path / "Fixed.fmu", declare)
    data = {"run": {"stop_s": 1.0, "step_s": 0.25}, "fmus": {"a": {"fmu": "Fixed.fmu"}}, "base_folder": tmp_path}
    if fits:
        assert simulate(Scenario.model_validate(data)).table.height == 5
        return
    with pytest.raises(InputError, match=rf"0\.25 is no multiple of the {inside} s by which 'a' \(Fixed\.fmu\)"):
        simulate(Scenario.model_validate(data))


def test_where_nothing_compiles_the_plain_loop_does_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from trihedron.tools.orchestrator import loops

    expected = simulate(bench(folder, ("native-2",) * 3)).table

    def fails() -> None:
        raise RuntimeError("no compiler for this processor")

    monkeypatch.setattr(loops, "compiled_march", fails)
    assert simulate(bench(folder, ("native-2",) * 3)).table.equals(expected)


def test_a_record_with_strings_runs_as_plain_python(folder: Path) -> None:
    data = {
        "base_folder": folder,
        "run": {"stop_s": 0.5, "step_s": 0.1},
        "fmus": {"g": {"fmu": "Gain.fmu", "parameters": {"label": "a "}}},
        "stimuli": [{"to": "g.word", "constant": "b"}],
    }
    assert simulate(Scenario.model_validate(data)).table["g.said"].to_list() == ["a b"] * 6
