"""What cannot be run: one line that names the culprit, and nothing left behind."""

import re
import stat
import sys
import tempfile
import zipfile
from pathlib import Path

import pytest

from foreign_fmus import build_foreign, declaring, rewritten
from foreign_fmus.foreign_failing import WAYS
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import simulate
from trihedron.tools.orchestrator.scenario import Scenario


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the FMUs Clock, Gain, Accumulator and Failing, and with spoilt ones."""
    folder = tmp_path_factory.mktemp("foreign")
    for script in ("foreign_clock", "foreign_gain", "foreign_accumulator", "foreign_failing"):
        build_foreign(script, folder)
    return folder


@pytest.fixture(autouse=True)
def nothing_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every refused run must leave its folder of temporary files empty."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))


def refusal(folder: Path, tmp_path: Path, fmus: dict[str, dict], **sections) -> str:
    """The one line with which a scenario is refused."""
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": fmus, **sections}
    scenario = Scenario.model_validate({**data, "base_folder": folder})
    with pytest.raises(InputError) as refused:
        simulate(scenario, tmp_path / "out")
    assert list((tmp_path / "temporary").iterdir()) == []
    assert not (tmp_path / "out").exists()
    assert "\n" not in str(refused.value)
    return str(refused.value)


CLOCK = {"fmu": "Clock.fmu"}
GAIN = {"fmu": "Gain.fmu"}
PAIR = {"clock": CLOCK, "gain": GAIN}


@pytest.mark.parametrize(
    ("source", "target", "says"),
    [
        ("clok.ended", "gain.u[1]", "there is no FMU 'clok'; did you mean 'clock'?"),
        ("clock.endet", "gain.u[1]", "'clock' has no variable 'endet'; did you mean 'ended'?"),
        ("clock.ended", "gain.u[3]", "'gain' has no variable 'u[3]'; u has elements 1 to 2"),
        ("clock.ended", "gain.u", "1 and 2 elements"),
        ("clock.count", "gain.u[1]", "types differ, Integer and Real"),
        ("clock.ended", "gain.y[1]", "'gain.y[1]' is not an input (output); did you mean 'u[1]'?"),
        ("gain.u[1]", "gain.u[2]", "'gain.u[1]' is not an output (input)"),
        ("clock", "gain.u[1]", "'clock' must name an FMU and a variable"),
    ],
)
def test_a_wrong_connection(folder: Path, tmp_path: Path, source: str, target: str, says: str) -> None:
    said = refusal(folder, tmp_path, PAIR, connections=[{"from": source, "to": target}])
    assert said.startswith("connections[1]: ")
    assert says in said


def test_an_input_has_one_source(folder: Path, tmp_path: Path) -> None:
    wires = [{"from": "clock.ended", "to": "gain.u[1]"}, {"from": "clock.began", "to": "gain.u[1]"}]
    said = refusal(folder, tmp_path, PAIR, connections=wires)
    assert said == "'gain.u[1]' has two sources, 'clock.ended' and 'clock.began'; one is possible"
    stimuli = [{"to": "gain.u", "constant": [1.0, 2.0]}]
    said = refusal(folder, tmp_path, PAIR, connections=wires[:1], stimuli=stimuli)
    assert said == "'gain.u[1]' has two sources, 'clock.ended' and stimuli[1]; one is possible"


def test_a_cycle_is_named(folder: Path, tmp_path: Path) -> None:
    fmus = {"a": GAIN, "b": GAIN, "c": GAIN}
    wires = [{"from": f"{s}.y[1]", "to": f"{t}.u[1]"} for s, t in ("ab", "bc", "ca")]
    assert "cycle: a -> b -> c -> a;" in refusal(folder, tmp_path, fmus, connections=wires)
    wires = [{"from": "a.y[1]", "to": "a.u[2]"}]
    assert "cycle: a -> a;" in refusal(folder, tmp_path, fmus, connections=wires)


def test_units_that_differ(folder: Path, tmp_path: Path) -> None:
    declaring(folder / "Clock.fmu", tmp_path / "Clock.fmu", {"ended": 'unit="rad"'})
    declaring(folder / "Gain.fmu", tmp_path / "Gain.fmu", {"u[1]": 'unit="rad/s"'})
    wires = [{"from": "clock.ended", "to": "gain.u[1]"}]
    assert "units differ, rad and rad/s" in refusal(tmp_path, tmp_path, PAIR, connections=wires)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"gian": 1.0}, "'gain' has no variable 'gian'; did you mean 'gain'?"),
        ({"y[1]": 1.0}, "y[1] of 'gain' is output, not a parameter or an input; did you mean 'u[1]'?"),
        ({"gain": "big"}, "gain = 'big' must be a number: it is Real"),
        ({"gain": True}, "gain = true must be a number: it is Real"),
        ({"times": 1.0}, "times = 1.0 must be a whole number: it is Integer"),
        ({"times": 2**31}, "does not fit 32 bits"),
        ({"inverted": 1}, "inverted = 1 must be true or false: it is Boolean"),
        ({"label": 1}, "label = 1 must be a text: it is String"),
        ({"u": 1.0}, "u has 2 elements; one value is given"),
        ({"u": [1.0, 2.0, 3.0]}, "u has 2 elements; 3 are given"),
        ({"gain": [1.0, 2.0]}, "gain is a scalar; 2 values are given"),
        ({"u": [1.0, 2.0], "u[1]": 1.0}, "u[1] is given twice, by 'u' and 'u[1]'"),
    ],
)
def test_a_wrong_parameter(folder: Path, tmp_path: Path, parameters: dict, says: str) -> None:
    said = refusal(folder, tmp_path, {"gain": {**GAIN, "parameters": parameters}})
    assert said.startswith("fmus.gain.parameters: ")
    assert says in said


def test_a_value_outside_its_declared_limits(folder: Path, tmp_path: Path) -> None:
    declaring(folder / "Gain.fmu", tmp_path / "Limited.fmu", {"gain": 'min="0" max="2"'})
    fmus = {"gain": {"fmu": "Limited.fmu", "parameters": {"gain": 2.5}}}
    assert "gain = 2.5 is outside its limits [0.0, 2.0]" in refusal(tmp_path, tmp_path, fmus)


@pytest.mark.parametrize(
    ("stop", "step", "says"),
    [
        (1.0, 0.3, "0.3 does not divide the run of 1.0 s (3.33333333 steps); 0.25 or 0.333333333 would"),
        (1.0, 2.0, "2.0 does not divide"),
        (1.0, 0.1 + 1e-9, "does not divide"),
    ],
)
def test_a_step_that_does_not_divide_the_run(folder: Path, tmp_path: Path, stop: float, step: float, says: str) -> None:
    said = refusal(folder, tmp_path, PAIR, run={"stop_s": stop, "step_s": step})
    assert said.startswith("run.step_s = ")
    assert says in said


def test_a_run_without_an_end(folder: Path, tmp_path: Path) -> None:
    assert refusal(folder, tmp_path, PAIR, run={"step_s": 0.1}).startswith("run.stop_s is missing")


@pytest.mark.parametrize(
    ("way", "says"),
    [
        ("error", "fmi2DoStep at 0.3 s ended with Discard: the pump has stopped, 100% of it"),
        ("silent", "fmi2DoStep at 0.3 s ended with Discard (its log says nothing)"),
        ("raises", "fmi2DoStep at 0.3 s ended with Fatal: .*ZeroDivisionError.*the gear ratio is zero"),
        ("exits", "fmi2DoStep at 0.3 s ended with Fatal: "),
        ("format", "fmi2DoStep at 0.3 s ended with Fatal: .*%s%s%n of %d"),
        ("initialisation", "fmi2ExitInitializationMode before the first step ended with Fatal: .*the seal is broken"),
        ("nan", "y is nan at 0.4 s"),
        ("infinity", "y is -inf at 0.4 s"),
    ],
)
def test_an_fmu_that_fails(folder: Path, tmp_path: Path, way: str, says: str) -> None:
    parameters = {"way": WAYS[way], "after": 0.25}
    said = refusal(folder, tmp_path, {"clock": CLOCK, "pump": {"fmu": "Failing.fmu", "parameters": parameters}})
    assert said.startswith("FMU 'pump' (Failing.fmu): ")
    pattern = says if ".*" in says else re.escape(says)
    assert re.search(pattern, said), said


def test_an_fmu_runs_again_after_it_has_failed(folder: Path, tmp_path: Path) -> None:
    for way in ("raises", "nan"):
        refusal(folder, tmp_path, {"pump": {"fmu": "Failing.fmu", "parameters": {"way": WAYS[way]}}})
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": {"pump": {"fmu": "Failing.fmu"}}}
    table = simulate(Scenario.model_validate({**data, "base_folder": folder})).table
    assert table["pump.y"][-1] == pytest.approx(0.9)


def _archive(folder: Path, *members: tuple[str | zipfile.ZipInfo, bytes]) -> str:
    with zipfile.ZipFile(folder / "Bad.fmu", "w") as archive:
        for name, content in members:
            archive.writestr(name, content)
    return "Bad.fmu"


def _link() -> zipfile.ZipInfo:
    member = zipfile.ZipInfo("resources/link")
    member.create_system = 3
    member.external_attr = (stat.S_IFLNK | 0o777) << 16
    return member


def _description(root: str = 'fmiVersion="2.0"', inside: str = "", before: str = "") -> tuple[str, bytes]:
    head = f'<?xml version="1.0"?>{before}<fmiModelDescription {root} modelName="m" guid="g">'
    text = f"{head}{inside}<ModelVariables/><ModelStructure/></fmiModelDescription>"
    return "modelDescription.xml", text.encode()


COSIMULATION = '<CoSimulation modelIdentifier="m"/>'
BAD_ARCHIVES = {
    "a name with ..": ([("../evil", b"")], "member '../evil' would leave"),
    "a name with .. inside": ([("resources/../../evil", b"")], "would leave"),
    "an absolute name": ([("/etc/evil", b"")], "member '/etc/evil' would leave"),
    "a drive": ([("C:/evil", b"")], "would leave"),
    "a backslash": ([("..\\evil", b"")], "would leave"),
    "a link": ([_description(inside=COSIMULATION), (_link(), b"/etc/passwd")], "'resources/link' is a link"),
    "no description": ([("readme", b"")], "has no modelDescription.xml"),
    "broken XML": ([("modelDescription.xml", b"<fmiModelDescription>")], "not well-formed XML"),
    "other XML": ([("modelDescription.xml", b"<html/>")], "root is <html>"),
    "a DOCTYPE": ([_description(before='<!DOCTYPE a [<!ENTITY b "c">]>')], "declares a DOCTYPE"),
    "a DOCTYPE in UTF-16": (
        [("modelDescription.xml", '<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a><a/>'.encode("utf-16"))],
        "declares a DOCTYPE",
    ),
    "FMI 4": ([_description('fmiVersion="4.0"')], "is FMI 4.0; export as FMI 2.0 or 3.0"),
    "FMI 1": ([_description('fmiVersion="1.0"')], "is FMI 1.0; export as FMI 2.0 or 3.0"),
    "no version": ([_description("")], "of no stated version"),
    "model exchange": ([_description(inside='<ModelExchange modelIdentifier="m"/>')], "model exchange only"),
    "no binary": ([_description(inside=COSIMULATION)], "has no binary for this platform"),
    "another's binary": (
        [_description(inside=COSIMULATION), ("binaries/vax/m.so", b"")],
        "has no binary for this platform",
    ),
}


@pytest.mark.parametrize("case", BAD_ARCHIVES)
def test_a_bad_archive_is_not_unpacked(tmp_path: Path, case: str) -> None:
    members, says = BAD_ARCHIVES[case]
    said = refusal(tmp_path, tmp_path, {"bad": {"fmu": _archive(tmp_path, *members)}})
    assert said.startswith("Bad.fmu: ")
    assert says in said
    assert {p.name for p in tmp_path.iterdir()} == {"Bad.fmu", "temporary"}


def test_a_file_that_is_no_archive(folder: Path, tmp_path: Path) -> None:
    assert "there is no such file" in refusal(tmp_path, tmp_path, {"x": {"fmu": "Missing.fmu"}})
    assert "is a folder" in refusal(tmp_path, tmp_path, {"x": {"fmu": "temporary"}})
    whole = (folder / "Clock.fmu").read_bytes()
    for content in (b"", b"PK", whole[: len(whole) // 2], whole[:5000] + bytes(500) + whole[5500:]):
        (tmp_path / "Half.fmu").write_bytes(content)
        assert "is not a readable FMU archive" in refusal(tmp_path, tmp_path, {"x": {"fmu": "Half.fmu"}})


def test_an_archive_that_unpacks_to_too_much(folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from trihedron.tools.orchestrator import load

    monkeypatch.setattr(load, "MOST_BYTES", 1 << 20)
    with zipfile.ZipFile(tmp_path / "Bomb.fmu", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("resources/zeros", bytes(2 << 20))
    assert "unpacks to more than" in refusal(tmp_path, tmp_path, {"x": {"fmu": "Bomb.fmu"}})


def test_a_step_that_makes_too_many_steps(folder: Path, tmp_path: Path) -> None:
    assert "at most 1000000000" in refusal(folder, tmp_path, PAIR, run={"stop_s": 1.0, "step_s": 2.0**-40})


def test_a_run_leaves_python_as_it_was(folder: Path, tmp_path: Path) -> None:
    path, modules = list(sys.path), set(sys.modules)
    refusal(folder, tmp_path, {"pump": {"fmu": "Failing.fmu", "parameters": {"way": WAYS["raises"]}}})
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": PAIR, "base_folder": folder}
    simulate(Scenario.model_validate(data))
    assert sys.path == path
    assert not [name for name in set(sys.modules) - modules if name.startswith("foreign_")]


def test_a_library_that_is_none(folder: Path, tmp_path: Path) -> None:
    def spoil(name: str, content: bytes) -> tuple[str, bytes]:
        return name, b"no library" if name.startswith("binaries/") else content

    rewritten(folder / "Clock.fmu", tmp_path / "Spoilt.fmu", spoil)
    said = refusal(tmp_path, tmp_path, {"x": {"fmu": "Spoilt.fmu"}})
    assert said.startswith("FMU 'x' (Spoilt.fmu): its library cannot be loaded")


def test_a_script_that_cannot_be_imported(folder: Path, tmp_path: Path) -> None:
    def spoil(name: str, content: bytes) -> tuple[str, bytes]:
        return name, b"raise OSError('no licence')" if name.endswith("foreign_clock.py") else content

    rewritten(folder / "Clock.fmu", tmp_path / "Spoilt.fmu", spoil)
    said = refusal(tmp_path, tmp_path, {"x": {"fmu": "Spoilt.fmu"}})
    assert said.startswith("FMU 'x' (Spoilt.fmu): fmi2Instantiate failed")


def test_an_unknown_component(tmp_path: Path) -> None:
    said = refusal(tmp_path, tmp_path, {"t": {"component": "TurntableMotions"}})
    assert said == "fmus.t.component: there is no component 'TurntableMotions'; did you mean 'TurntableMotion'?"


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"x": "clock.endet"}, "record.columns.x: 'clock' has no variable 'endet'; did you mean 'ended'?"),
        ({"time_s": "clock.ended"}, "time_s is there by itself"),
        ({"x": "gain.u"}, "record.columns.x: 'gain.u' has 2 elements"),
    ],
)
def test_a_wrong_column(folder: Path, tmp_path: Path, columns: dict, says: str) -> None:
    assert says in refusal(folder, tmp_path, PAIR, record={"columns": columns})


def test_an_output_folder_that_cannot_be_made(folder: Path, tmp_path: Path) -> None:
    (tmp_path / "taken").write_text("a file")
    data = {"run": {"stop_s": 1.0, "step_s": 0.1}, "fmus": {"clock": CLOCK}, "base_folder": folder}
    with pytest.raises(InputError, match="taken: is a file"):
        simulate(Scenario.model_validate(data), tmp_path / "taken")
    assert (tmp_path / "taken").read_text() == "a file"
