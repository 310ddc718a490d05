"""The compiled loop against the plain one and against FMPy, both versions of FMI mixed: the same bits."""

import re
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import polars as pl
import pytest

import foreign_fmus
from foreign_fmus import rewritten
from scenario_runs import ACCUMULATOR, GAIN, here, refusal, run, scenario, wires
from trihedron.fmus import build, host_compiler
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import Scenario, loops, run_scenario

NAMES = ("TurntableMotion", "AccelerometerBlock", "AttitudeComputer")
FLAVOURS = {"python": ("python", 2), "native-2": ("native", 2), "native-3": ("native", 3)}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, foreign: Path) -> Path:
    """Return a folder with three components in each flavour, and with a foreign FMU."""
    if host_compiler() is None:
        pytest.skip("needs a C compiler")
    folder = tmp_path_factory.mktemp("flavours")
    for name, (flavour, fmi) in FLAVOURS.items():
        for component in NAMES:
            build(component, folder / name, flavour=flavour, fmi=fmi)
    shutil.copy(foreign / "Accumulator.fmu", folder)
    return folder


def bench(folder: Path, flavours: tuple[str, ...]) -> Scenario:
    """Return a table, a block and an attitude computer in some flavours, with a foreign sum."""
    table, block, computer = (f"{flavour}/{name}.fmu" for flavour, name in zip(flavours, NAMES, strict=True))
    positions = {"alpha_deg": [20.0, 65.0], "beta_deg": [30.0, -40.0]}
    temperatures = {"time_s": [0.0, 1.0, 3.01], "t_degC": [20.0, 25.0, 18.0]}
    return here(
        folder,
        {
            "sum": ACCUMULATOR,
            "computer": {"fmu": computer},
            "block": {"fmu": block, "parameters": {"noise_bound": 1e-5, "seed": 3}},
            "table": {"fmu": table, "parameters": {"kappa": 1e-3, "encoder_fluctuation_bound": 4.8e-6}},
        },
        run={"stop_s": 4.0, "step_s": 0.02},
        connections=wires(
            "table.specific_force -> block.specific_force",
            "table.dwell -> block.dwell",
            "table.increment -> computer.increment",
            "computer.attitude[2] -> sum.increment",
        ),
        stimuli=[
            {"to": "table.command", "table": positions, "dwell_s": 1.0},
            {"table": temperatures, "columns": {"block.temperature": "t_degC"}},
        ],
        record={"every": 3},
    )


def test_every_mixture_gives_the_same_bits_in_both_loops(folder: Path) -> None:
    reference = run_scenario(bench(folder, ("python",) * 3), compiled=False).table
    assert reference.height == 67
    assert reference["sum.total"].n_unique() > 50
    for flavours in product(("native-2", "native-3"), repeat=3):
        assert run_scenario(bench(folder, flavours)).table.equals(reference), flavours
    for flavours in (("native-2", "native-3", "native-2"), ("native-3", "native-2", "native-3")):
        assert run_scenario(bench(folder, flavours), compiled=False).table.equals(reference), flavours
    for flavours in (("python",) * 3, ("python", "native-3", "native-2"), ("native-3", "python", "native-2")):
        assert run_scenario(bench(folder, flavours)).table.equals(reference), flavours


@pytest.mark.parametrize("compiled", [True, False])
def test_types_that_no_component_has(foreign: Path, compiled: bool) -> None:
    rows = {"time_s": [0.0, 0.5], "n": [2, 5], "b": [1, 0], "u": [1.0, 2.0]}
    table = run(
        foreign,
        {"f": GAIN, "g": {**GAIN, "parameters": {"times": 3}}},
        connections=wires("f.counted -> g.count", "f.marked -> g.mark"),
        stimuli=[{"table": rows, "columns": {"f.count": "n", "f.mark": "b", "g.u[2]": "u"}}],
        record={"columns": {"y": "g.y[2]", "n": "g.counted", "b": "g.marked"}},
        compiled=compiled,
    ).table
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
EVERYTHING = {"fmu": "Everything.fmu"}
KINDS = {
    "Float64": "double", "Float32": "float", "Int8": "int8_t", "UInt8": "uint8_t", "Int16": "int16_t",
    "UInt16": "uint16_t", "Int32": "int32_t", "UInt32": "uint32_t", "Int64": "int64_t", "UInt64": "uint64_t",
    "Boolean": "bool",
}  # fmt: skip


@pytest.fixture(scope="module")
def everything(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with an FMU of FMI 3.0 that has an input and an output of two elements of each type."""
    compiler = shutil.which("cc")
    if compiler is None:
        pytest.skip("needs a C compiler named cc")
    folder = tmp_path_factory.mktemp("everything")
    source = foreign_fmus.HERE / "everything.c"
    library = folder / f"everything{fmpy.sharedLibraryExtension}"
    # Every function of FMI 3.0 must exist; functions that are never called do nothing.
    names = re.findall(r"FMI3_Export \w+\s+(\w+);", FUNCTIONS.read_text())
    settings = source.read_text()
    missing = [n for n in names if not re.search(rf"\b{n}\(|ACCESS\({n[7:]},|NOTHING\({n}\)", settings)]
    (folder / "rest.c").write_text("".join(f"int {name}(void) {{ return 0; }}\n" for name in missing))
    command = [compiler, "-shared", "-fPIC", "-w", f"-I{HEADERS}", source, folder / "rest.c", "-o", library]
    subprocess.run(command, check=True)
    variables = []
    for number, kind in enumerate(KINDS):
        start = "false true" if kind == "Boolean" else "1 2"
        dimension = '<Dimension start="2"/>'
        options, at = 'variability="discrete"', 2 * number + 1
        variables.append(
            f'<{kind} name="{kind}_in" valueReference="{at}" causality="input" {options} start="{start}">'
            f'{dimension}</{kind}><{kind} name="{kind}_out" valueReference="{at + 1}" causality="output" {options}>'
            f"{dimension}</{kind}>"
        )
    with zipfile.ZipFile(folder / "Everything.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION.format(variables="\n".join(variables)))
        archive.write(library, f"binaries/{fmpy.platform_tuple}/everything{fmpy.sharedLibraryExtension}")
    return folder


QUARTERS = {"stop_s": 1.0, "step_s": 0.25}


@pytest.mark.parametrize("compiled", [True, False])
def test_every_numeric_type_of_fmi_3_goes_in_and_out(everything: Path, compiled: bool) -> None:
    """The first elements are wired through a second FMU; the second ones keep the scenario's or the start values."""
    values = {kind: (True if kind == "Boolean" else 100 if "Int" in kind else 0.1) for kind in KINDS}
    table = run(
        everything,
        {"a": EVERYTHING, "b": {**EVERYTHING, "parameters": {"Int16_in[2]": -7}}},
        run=QUARTERS,
        connections=wires(*(f"a.{kind}_out[1] -> b.{kind}_in[1]" for kind in KINDS)),
        stimuli=[{"to": f"a.{kind}_in[1]", "constant": value} for kind, value in values.items()],
        compiled=compiled,
    ).table
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
        (3.0, "fmi3DoStep at 0.5 s returned before the end of the step"),
        (4.0, "sum is nan at 0.75 s; to run all the same: --allow-nan"),
        (5.0, "fmi3GetFloat64 at 0.75 s ended with Discard (its log says nothing)"),
    ],
)
def test_a_failing_fmu_of_fmi_3_is_named_with_its_own_words(everything, compiled, stops, says) -> None:
    fmus = {"a": EVERYTHING, "b": {**EVERYTHING, "parameters": {"stops": stops}}}
    assert refusal(everything, fmus, run=QUARTERS, compiled=compiled) == f"FMU 'b' (Everything.fmu): {says}"


@pytest.mark.parametrize("compiled", [True, False])
def test_an_fmu_may_ask_for_the_end_and_the_others_make_its_last_step(everything, compiled) -> None:
    fmus = {"b": {**EVERYTHING, "parameters": {"stops": 2.0}}, "after": EVERYTHING}
    simulation = run(
        everything, fmus, run=QUARTERS, compiled=compiled, connections=wires("b.sum -> after.Float64_in[1]")
    )
    assert simulation.ended == "FMU 'b' (Everything.fmu) ended the run at 0.75 s (fmi3DoStep asked for it)"
    assert simulation.table["time_s"].to_list() == [0.0, 0.25, 0.5, 0.75]
    assert (simulation.rows, simulation.final_time_s, simulation.provenance["steps"]) == (4, 0.75, 3)
    assert simulation.table["after.Float64_out[1]"].to_list()[1:] == [0.25, 0.5, 0.75]


@pytest.mark.parametrize(("inside", "fits"), [("0.125", True), ("0.25", True), ("0.1", False), ("0.5", False)])
def test_a_step_is_a_multiple_of_what_an_fmu_makes_inside(everything, tmp_path, inside: str, fits: bool) -> None:
    def declare(name: str, content: bytes) -> tuple[str, bytes]:
        flag = f'modelIdentifier="everything" fixedInternalStepSize="{inside}"'.encode()
        return name, content.replace(b'modelIdentifier="everything"', flag) if name.endswith(".xml") else content

    rewritten(everything / "Everything.fmu", tmp_path / "Everything.fmu", declare)
    if fits:
        assert run(tmp_path, {"a": EVERYTHING}, run=QUARTERS).table.height == 5
    else:
        message = refusal(tmp_path, {"a": EVERYTHING}, run=QUARTERS)
        assert f"0.25 is not a multiple of the {inside} s by which 'a' (Everything.fmu)" in message


@pytest.mark.acceptance
def test_where_nothing_compiles_the_plain_loop_does_it(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = run_scenario(bench(folder, ("native-2",) * 3)).table

    def fails() -> None:
        raise RuntimeError("no compiler for this processor")

    monkeypatch.setattr(loops, "compiled_march", fails)
    assert run_scenario(bench(folder, ("native-2",) * 3)).table.equals(expected)


def test_a_record_with_strings_runs_as_plain_python(foreign: Path) -> None:
    """Every type but Real is set, passed on and recorded in its own type."""
    fmus = {"g": {**GAIN, "parameters": {"label": "größe ", "times": 3, "inverted": True}}, "h": GAIN}
    along = wires("g.said -> h.word", "g.counted -> h.count", "g.marked -> h.mark")
    texts = {"word": "µ", "count": 7, "mark": False}
    stimuli = [{"to": f"g.{name}", "constant": value} for name, value in texts.items()]
    table = run(foreign, fmus, connections=along, stimuli=stimuli).table
    assert table["h.said"].to_list() == ["nonegröße µ"] * 11
    assert table["h.counted"].to_list() == [21] * 11
    assert table["h.marked"].to_list() == [True] * 11
    assert [table.schema[f"h.{name}"] for name in ("said", "counted", "marked")] == [pl.String, pl.Int32, pl.Boolean]


NATIVE = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Native" guid="native">
<CoSimulation modelIdentifier="native"/>
<ModelVariables>
<ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/></ScalarVariable>
<ScalarVariable name="y" valueReference="1" causality="output"><Real/></ScalarVariable>
<ScalarVariable name="stops" valueReference="2" causality="parameter" variability="fixed">
<Integer start="0" max="3"/></ScalarVariable>
</ModelVariables>
<ModelStructure><Outputs><Unknown index="2"/></Outputs></ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture(scope="module")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with Native.fmu."""
    compiler = shutil.which("cc")
    if compiler is None or fmpy.system == "windows":
        pytest.skip("needs a C compiler named cc")
    folder = tmp_path_factory.mktemp("native")
    source = foreign_fmus.HERE / "native.c"
    headers = Path(fmpy.__file__).parent / "c-code"
    library = folder / f"native{fmpy.sharedLibraryExtension}"
    subprocess.run([compiler, "-shared", "-fPIC", "-w", f"-I{headers}", source, "-o", library], check=True)
    arm_linux = fmpy.architecture == "aarch64" and fmpy.system == "linux"
    place = fmpy.platform_tuple if arm_linux else fmpy.platform
    with zipfile.ZipFile(folder / "Native.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", NATIVE)
        archive.write(library, f"binaries/{place}/native{fmpy.sharedLibraryExtension}")
    return folder


def chain(folder: Path, **stops: int) -> Scenario:
    """Return five FMUs, each fed by the previous one."""
    fmus = {f"n{i}": {"fmu": "Native.fmu", "parameters": {}} for i in range(5)}
    for name, value in stops.items():
        fmus[name]["parameters"] = {"stops": value}
    along = wires(*(f"n{i}.y -> n{i + 1}.u" for i in range(4)))
    stimuli = [{"to": "n0.u", "constant": 1.5}]
    return scenario(folder, fmus, run={"stop_s": 1.0, "step_s": 0.125}, connections=along, stimuli=stimuli)


@pytest.mark.acceptance
def test_native_fmus_are_coupled(native: Path) -> None:
    table = run_scenario(chain(native)).table
    assert [table[f"n{i}.y"].to_list() for i in range(5)] == [[0.0] + [1.5 * 2 ** (i + 1)] * 8 for i in range(5)]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("stops", "says"),
    [
        ({"n3": 1}, r"^FMU 'n3' \(Native\.fmu\): fmi2DoStep at 0\.625 s ended with Error: fuse of 3 0\.25$"),
        ({"n3": 4}, r"stops = 4 is outside its limits \[-inf, 3\.0\]"),
        # No FMU is blamed with another's message.
        ({"n0": 3, "n3": 2}, r"^FMU 'n3' .* ended with Error \(its log says nothing\)$"),
    ],
)
def test_what_a_native_fmu_logs_is_formatted(native: Path, stops: dict[str, int], says: str) -> None:
    with pytest.raises(InputError, match=says):
        run_scenario(chain(native, **stops))


STEP, STEPS = 0.1, 1500
PARAMETERS = {
    "TurntableMotion": {"kappa": 1e-3, "seed": 7, "encoder_fluctuation_bound": 4.8e-6},
    "AccelerometerBlock": {},
    "AttitudeComputer": {},
}
COMMANDS = [(0, [0.35, 0.44]), (400, [1.13, 2.53]), (900, [-0.6, 4.6])]
COUPLED = [  # producer, output, consumer, input; type; elements
    ("TurntableMotion", "specific_force", "AccelerometerBlock", "specific_force", "Real", 3),
    ("TurntableMotion", "dwell", "AccelerometerBlock", "dwell", "Integer", 0),
    ("TurntableMotion", "increment", "AttitudeComputer", "increment", "Real", 3),
]
WATCHED = {
    "TurntableMotion": ["angle_reading[1]", "angle_reading[2]"],
    "AccelerometerBlock": ["reading[1]", "reading[2]", "reading[3]"],
    "AttitudeComputer": ["attitude[1]", "attitude[2]", "attitude[3]", "attitude[4]"],
}


def names(base: str, count: int) -> list[str]:
    return [f"{base}[{i + 1}]" for i in range(count)] if count else [base]


def plain_loop(folder: Path, opened: Callable[..., Any]) -> list[list[float]]:
    """Couple the three FMUs by hand."""
    slaves, references = {}, {}
    for name, parameters in PARAMETERS.items():
        slaves[name] = slave = opened(folder / f"{name}.fmu", name)
        references[name] = {v.name: v.valueReference for v in slave.description.modelVariables}
        for key, value in parameters.items():
            (slave.setInteger if key == "seed" else slave.setReal)([references[name][key]], [value])
        slave.setupExperiment(startTime=0.0, stopTime=STEPS * STEP)

    def refs(name: str, variables: list[str]) -> list[int]:
        return [references[name][v] for v in variables]

    def pass_on(consumer: str) -> None:
        for a, output, b, target, kind, count in COUPLED:
            if b == consumer:
                values = getattr(slaves[a], f"get{kind}")(refs(a, names(output, count)))
                getattr(slaves[b], f"set{kind}")(refs(b, names(target, count)), values)

    def command(k: int) -> None:
        current = [angles for begin, angles in COMMANDS if begin <= k][-1]
        slaves["TurntableMotion"].setReal(refs("TurntableMotion", names("command", 2)), current)

    def watched() -> list[float]:
        return [v for name, simulation in WATCHED.items() for v in slaves[name].getReal(refs(name, simulation))]

    for name, slave in slaves.items():
        slave.enterInitializationMode()
        command(0)
        pass_on(name)
    for slave in slaves.values():
        slave.exitInitializationMode()
    for name in slaves:
        pass_on(name)
    rows = [watched()]
    for k in range(STEPS):
        command(k)
        for name, slave in slaves.items():
            pass_on(name)
            slave.doStep(k * STEP, STEP)
        rows.append(watched())
    for slave in slaves.values():
        slave.terminate()
    return rows


def test_the_orchestrator_gives_the_numbers_of_a_plain_loop(fmu_folder: Path, slaves) -> None:
    rows = {
        "time_s": [k * STEP for k, _ in COMMANDS],
        "a": [c[0] for _, c in COMMANDS],
        "b": [c[1] for _, c in COMMANDS],
    }
    scenario = Scenario.model_validate(
        {
            "run": {"stop_s": STEPS * STEP, "step_s": STEP},
            # Not in the necessary stepping order.
            "fmus": {n: {"component": n, "parameters": PARAMETERS[n]} for n in reversed(PARAMETERS)},
            "connections": wires(*(f"{a}.{o} -> {b}.{t}" for a, o, b, t, _, _ in COUPLED)),
            "stimuli": [
                {
                    "table": {"time_s": rows["time_s"], "a_rad": rows["a"], "b_rad": rows["b"]},
                    "columns": {"TurntableMotion.command[1]": "a_rad", "TurntableMotion.command[2]": "b_rad"},
                }
            ],
        }
    )
    table = run_scenario(scenario).table
    suffixes = {"TurntableMotion": "_rad", "AccelerometerBlock": "_mps2", "AttitudeComputer": ""}
    columns = [f"{fmu}.{v}{suffixes[fmu]}" for fmu, simulation in WATCHED.items() for v in simulation]
    expected = np.array(plain_loop(fmu_folder, slaves))
    simulation = table.select(columns).to_numpy()
    assert np.ptp(expected, axis=0).min() > 1e-3
    assert (simulation == expected).all()
