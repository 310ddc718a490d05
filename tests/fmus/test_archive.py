"""The content of an FMU: the same on every build, and readable by the usual tools."""

import random
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree

import fmpy
import lark
import numpy as np
import pytest
from fmpy.util import read_csv, read_ref_opt_file
from fmpy.validation import validate_fmu

from component_kinds import all_kinds, draw_parameters, elements_of, outputs_of, setter_of, title
from named import Named
from native_model import Model, numbering, open_fmu
from trihedron.fmus import PLATFORMS, BuildError, build, components, host_compiler, zig_version
from trihedron.fmus.component import Component, Variable
from trihedron.fmus.native import compile as compiler
from trihedron.fmus.source import references
from trihedron.tools import cli
from trihedron.tools.errors import InputError
from trihedron.tools.exporting import export_components, write_reference

needs_compiler = pytest.mark.skipif(host_compiler() is None, reason="skipped: no C compiler")


@pytest.fixture(scope="module", autouse=True)
def _names_are_parsed_once() -> Iterator[None]:
    """Cache parsed names: FMPy's grammar is slow, and the flavours of a component share their names."""

    @cache
    def parser(grammar: str, start: str) -> SimpleNamespace:
        return SimpleNamespace(parse=cache(lark_class(grammar, start=start).parse))

    lark_class = lark.Lark
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(lark, "Lark", parser)
        yield


@pytest.mark.first(4)
@pytest.mark.parametrize(
    ("flavour", "fmi"),
    [("python", 2), pytest.param("native", 2, marks=needs_compiler), pytest.param("native", 3, marks=needs_compiler)],
)
@pytest.mark.parametrize(
    "component",
    [pytest.param(k, marks=[pytest.mark.acceptance] if k.effects else []) for k in all_kinds()],
    ids=title,
)
def test_valid_to_fmpy_and_the_same_bytes_on_every_build(component, flavour, fmi, tmp_path, monkeypatch):
    first = build(component.name, tmp_path / "a", component.effects, flavour=flavour, fmi=fmi)
    assert validate_fmu(str(first)) == []
    # Machine code is compiled again for one component; the others' is cached by the bytes of their sources.
    again = component.name == "AccelerometerBlock" and not component.effects
    if again:
        monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "empty"))
    second = build(component.name, tmp_path / "b", component.effects, flavour=flavour, fmi=fmi)
    assert first.read_bytes() == second.read_bytes()
    assert not again or flavour == "python" or list((tmp_path / "empty" / "binaries").iterdir())


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_archive_has_all_that_a_first_class_fmu_ships(fmi, tmp_path):
    path = build("AccelerometerBlock", tmp_path, flavour="native", fmi=fmi)
    with zipfile.ZipFile(path) as archive:
        names = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        licences = archive.read("documentation/licenses/license.txt") + archive.read(
            "documentation/licenses/fmi-headers.txt"
        )
        binary = next(archive.read(name) for name in names if name.startswith("binaries/"))
    component = components()["AccelerometerBlock"]
    expected = {"sources/model.c", f"sources/fmi{fmi}Functions.h", "documentation/index.html"}
    of_3 = {"terminalsAndIcons/terminalsAndIcons.xml", "terminalsAndIcons/icon.png", "sources/buildDescription.xml"}
    expected |= {"model.png"} if fmi == 2 else of_3
    assert expected <= names
    assert all(equation.split(" = ")[0] in page for equation in component.equations)
    assert all(variable.name in page for variable in component.interface)
    assert b"The Trihedron developers" in licences
    assert b"Modelica Association" in licences
    assert str(Path.cwd()).encode() not in binary
    assert str(tmp_path).encode() not in binary


@needs_compiler
def test_arrays_are_real_ones_and_the_types_are_declared(tmp_path):
    path = build("TurntableMotion", tmp_path, flavour="native", fmi=3)
    description = fmpy.read_model_description(path, validate_variable_names=True, validate_model_structure=True)
    variables = {v.name: v for v in description.modelVariables}
    mounting = variables["mounting"]
    assert mounting.shape == (9,)
    assert variables["angle"].shape == (2,)
    assert mounting.start == " ".join(["1.0", "0.0", "0.0", "0.0", "1.0", "0.0", "0.0", "0.0", "1.0"])
    declared = variables["angle"].declaredType
    assert declared is not None
    assert declared.name == "Angle_deg"
    assert {v.type for v in variables.values()} == {"Float64", "Int32", "Boolean"}
    assert variables["gravity"].variability == "fixed"
    block = build("AccelerometerBlock", tmp_path, flavour="native", fmi=3)
    reading = fmpy.read_model_description(block).outputs[0]
    assert reading.variable is not None
    assert reading.variable.name == "reading"
    assert {d.name for d in reading.dependencies or ()} == {"specific_force", "temperature", "angle"}


@pytest.mark.acceptance
@pytest.mark.parametrize("fmi", [2, 3])
def test_names_of_types_are_unique_and_no_variable_has_one(fmi, tmp_path, monkeypatch):
    # No code is run.
    monkeypatch.setattr("trihedron.fmus.native.c_source.binary", lambda *_, **__: b"")
    for component in all_kinds():
        path = build(component.name, tmp_path, component.effects, flavour="native", fmi=fmi)
        description = fmpy.read_model_description(path)
        types = [t.name for t in description.typeDefinitions]
        assert len(set(types)) == len(types)
        assert not set(types) & {v.name for v in description.modelVariables}


def fmpy_reads(component: Component, fmi: int) -> bool:
    """Return True if FMPy can apply all inputs: in FMI 3.0 no discrete arrays, and one shape of continuous inputs."""
    inputs = [v for v in component.interface if v.causality == "input"]
    continuous = {v.size for v in inputs if v.variability == "continuous"}
    return fmi == 2 or (len(continuous) <= 1 and not any(v.size for v in inputs if v.variability == "discrete"))


def rows_of(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return heads and cells of a table of reference results."""
    heads, *rows = (line.split(",") for line in path.read_text(encoding="utf-8").splitlines())
    return [head.strip('"') for head in heads], rows


def numbers_in(cell: str, variable: Variable) -> list[float]:
    """Return the numbers of a cell, each written in its type."""
    return [float(text) if variable.type == "real" else float(int(text)) for text in cell.split(" ")]


@needs_compiler
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", sorted(components()))
def test_the_reference_inputs_give_the_reference_outputs(name, fmi, tmp_path):
    """Every input is driven, every variable that moves the component does so, and the numbers return to the bit."""
    component = components()[name]
    path = build(name, tmp_path, flavour="native", fmi=fmi)
    files = write_reference(component, tmp_path, fmi)
    assert sum(file.stat().st_size for file in files) < 1_000_000
    options = read_ref_opt_file(tmp_path / f"{name}_ref.opt")
    heads, rows = rows_of(tmp_path / f"{name}_ref.csv")
    assert 2 <= len(heads) <= 10
    variables = {v.name: v for v in component.interface} | elements_of(component)
    numbers = numbering(component, fmi) | references(component) if fmi == 2 else numbering(component, fmi)
    driven, driven_rows = (
        rows_of(tmp_path / f"{name}_in.csv") if (tmp_path / f"{name}_in.csv").exists() else (["time"], [])
    )
    inputs = [v for v in component.interface if v.causality == "input"]
    assert driven[1:] == ([v.name for v in inputs] if fmi == 3 else list(elements_of(component, "input")))
    library = open_fmu(path, tmp_path / "unpacked")
    instance = library.instantiate()
    assert library.enter(instance) == 0
    step = options["StepSize"]

    def apply(k: int) -> None:
        for head, cell in zip(driven[1:], driven_rows[k][1:] if driven_rows else [], strict=True):
            variable, at = variables[head], numbers[head]
            assert library.set(instance, variable.type, np.atleast_1d(at).tolist(), numbers_in(cell, variable)) == 0

    def shown() -> list[list[float]]:
        values = []
        for head in heads[1:]:
            variable, at = variables[head], np.atleast_1d(numbers[head]).tolist()
            values.append(library.get(instance, variable.type, at, variable.size or 1 if fmi == 3 else 1)[1])
        return values

    apply(0)
    assert library.leave(instance) == 0
    outputs = [shown()]
    for k in range(len(rows) - 1):
        apply(k)
        assert library.step(instance, k * step, step) == 0
        outputs.append(shown())
    library.free(instance)
    expected = [[numbers_in(c, variables[h]) for h, c in zip(heads[1:], row[1:], strict=True)] for row in rows]
    assert outputs == expected
    assert outputs[0] != outputs[-1]
    with zipfile.ZipFile(path) as archive:
        folder = "extra/org.fmi-standard.fmi-ls-ref"
        manifest = ElementTree.fromstring(archive.read(f"{folder}/fmi-ls-manifest.xml"))
        inside = {file.get("role"): archive.read(f"{folder}/{file.get('source')}") for file in manifest}
    endings = {"result": "_ref.csv"} | ({"stimulus": "_in.csv"} if inputs else {})
    assert inside == {role: (tmp_path / f"{name}{ending}").read_bytes() for role, ending in endings.items()}


@needs_compiler
@pytest.mark.parametrize(
    ("name", "fmi"),
    [
        pytest.param(name, fmi, marks=[pytest.mark.acceptance] if fmi == 3 else [])
        for name, c in components().items()
        for fmi in (2, 3)
        if fmpy_reads(c, fmi)
    ],
)
def test_fmpy_reproduces_the_reference_results(name, fmi, tmp_path):
    path = build(name, tmp_path, flavour="native", fmi=fmi)
    write_reference(components()[name], tmp_path, fmi)
    options = read_ref_opt_file(tmp_path / f"{name}_ref.opt")
    reference = read_csv(tmp_path / f"{name}_ref.csv")
    columns = reference.dtype.names or ()
    inputs = tmp_path / f"{name}_in.csv"
    driven: dict[str, Any] = {"input": read_csv(inputs)} if inputs.exists() else {}
    result = fmpy.simulate_fmu(
        str(path),
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        output=list(columns[1:]),
        **driven,
    )
    for column in columns:
        # FMPy's times differ from k h in the last bit.
        outputs = np.reshape(result[column], np.shape(reference[column]))
        np.testing.assert_allclose(outputs, reference[column], rtol=1e-12, atol=1e-15)


@pytest.mark.first(1)
@needs_compiler
@pytest.mark.parametrize("name", sorted(components()))
def test_outputs_during_the_initialisation_are_those_after_it(name, tmp_path, slaves):
    """In every flavour, a master may read outputs before it ends the initialisation."""
    component = components()[name]
    parameters = draw_parameters(component, random.Random(3))
    plain = Named(component, **parameters)
    before = plain.outputs()
    assert plain.begin().outputs() == before
    slave = slaves(build(name, tmp_path / "python"))
    slave.setupExperiment(startTime=0.0)
    slave.enterInitializationMode()
    setter_of(slave, component)(parameters)
    assert outputs_of(slave, component) == before
    library = open_fmu(build(name, tmp_path, flavour="native"), tmp_path / "unpacked")
    model = Model.of(library, component)
    assert library.enter(model.instance) == 0
    for variable in component.interface:
        if all(element in parameters for element in variable.elements):
            assert model.set(variable.name, [parameters[element] for element in variable.elements]) == 0
    assert model.outputs() == before
    library.free(model.instance)


@needs_compiler
def test_export_of_native_fmus_from_the_command_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    command = ["export", "--flavour", "native", "--fmi", "3", "--effect", "quadratic accelerometer-3", "--out", "fmus"]
    assert cli.main(command) == 0
    assert capsys.readouterr().out.split() == [str(Path("fmus") / "AccelerometerBlock.fmu")]
    description = fmpy.read_model_description("fmus/AccelerometerBlock.fmu")
    assert "quadratic.accelerometer_3.coefficient" in {v.name for v in description.modelVariables}
    assert sorted(p.name for p in Path("fmus").iterdir()) == [
        "AccelerometerBlock.fmu",
        "AccelerometerBlock_in.csv",
        "AccelerometerBlock_ref.csv",
        "AccelerometerBlock_ref.opt",
    ]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"fmi": 3}, "the Python flavour is FMI 2.0 only"),
        ({"platform": "host"}, "belongs to --flavour native"),
        ({"flavour": "native", "platform": "vax-vms"}, "there is no native FMU for it; there is for x86_64-linux"),
        ({"flavour": "native", "effects": ["quadratic accelerometer-4"]}, "did you mean 'quadratic accelerometer-"),
        ({"names": ["AttitudeComputer"], "effects": ["quadratic accelerometer-3"]}, "extends AccelerometerBlock"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_line(options, message, tmp_path):
    names = options.pop("names", [])
    with pytest.raises(InputError, match=message) as refusal:
        export_components(names, tmp_path / "out", **options)
    assert "\n" not in str(refusal.value)
    assert not (tmp_path / "out").exists()


def test_without_a_compiler_the_native_flavour_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "host_compiler", lambda: None)
    monkeypatch.setattr(compiler, "zig_version", lambda: None)
    with pytest.raises(InputError, match="need a C compiler: there is no cc here"):
        export_components([], tmp_path / "out", "native")
    with pytest.raises(InputError, match="needs ziglang"):
        export_components([], tmp_path / "out", "native", 2, "all")
    assert not (tmp_path / "out").exists()


@needs_compiler
def test_a_failing_compiler_and_a_cache_that_cannot_be_written(tmp_path, monkeypatch):
    monkeypatch.setenv("TRIHEDRON_CACHE", "/dev/null")
    assert build("HarmonicMotion", tmp_path, flavour="native").is_file()
    monkeypatch.setattr(compiler, "FLAGS", (*compiler.FLAGS, "-fno-such-thing"))
    with pytest.raises(BuildError, match="no-such-thing"):
        build("HarmonicMotion", tmp_path / "b", flavour="native")


@needs_compiler
@pytest.mark.acceptance
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_fmpy_compiles_the_sources_again(component, fmi, tmp_path):
    if shutil.which("cmake") is None:
        pytest.skip("skipped: no cmake")
    path = build(component.name, tmp_path, component.effects, flavour="native", fmi=fmi)
    program = Path(sys.executable).with_name("fmpy")
    process = subprocess.run([program, "compile", path], capture_output=True, text=True, cwd=tmp_path)
    assert process.returncode == 0, process.stdout + process.stderr
    assert validate_fmu(str(path)) == []
    library = open_fmu(path, tmp_path / "again")
    instance = library.instantiate()
    library.start(instance)
    assert library.step(instance, 0.0, 0.01) == 0
    library.free(instance)


@needs_compiler
@pytest.mark.acceptance
@pytest.mark.parametrize(("flavour", "fmi"), [("python", 2), ("native", 2), ("native", 3)])
@pytest.mark.parametrize("component", all_kinds(), ids=title)
def test_fmutool_finds_nothing(component, flavour, fmi, tmp_path):
    path = build(component.name, tmp_path, component.effects, flavour=flavour, fmi=fmi)
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    process = subprocess.run([sys.executable, "-c", code, "-input", path, "-check"], capture_output=True, text=True)
    message = process.stdout + process.stderr
    assert f"No semantic error against the FMI-{fmi} standard" in message
    assert f"seems to be compliant with FMI-{fmi}.0" in message


@pytest.mark.acceptance
@pytest.mark.parametrize("fmi", [2, 3])
def test_five_platforms_in_one_fmu_of_under_120_kilobytes(fmi, tmp_path):
    if zig_version() is None:
        pytest.skip("skipped: no ziglang")
    for component in all_kinds():
        path = build(component.name, tmp_path, component.effects, flavour="native", fmi=fmi, platform="all")
        with zipfile.ZipFile(path) as archive:
            folders = {name.split("/")[1] for name in archive.namelist() if name.startswith("binaries/")}
        assert folders == {p.folder(fmi) for p in PLATFORMS.values()}
        assert path.stat().st_size < 120_000
        library = open_fmu(path, tmp_path / f"{component.name}-{len(component.effects)}")
        instance = library.instantiate()
        library.start(instance)
        assert library.step(instance, 0.0, 0.01) == 0
        library.free(instance)
