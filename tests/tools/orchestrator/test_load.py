"""FMUs of a scenario: refused archives, refused parameters, components built and cached."""

import hashlib
import json
import shutil
import stat
import sys
import tempfile
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from by_hand import Instrument
from by_hand import calibration as hand_calibration
from foreign_fmus import declaring, rewritten
from foreign_fmus.foreign_failing import WAYS
from generator.stands import random_bench, simulated
from scenario_runs import FAILING, GAIN, refusal, run
from trihedron.fmus import BuildError, host_compiler
from trihedron.fmus.cache import cache_folder, others_can_write
from trihedron.tools.compiled import COMPILES
from trihedron.tools.errors import InputError
from trihedron.tools.orchestrator import archive as archives
from trihedron.tools.orchestrator import load, loops


@pytest.fixture(autouse=True)
def nothing_stays(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch):
    """Assert that every run leaves its folder of temporary files empty."""
    temporary = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr(tempfile, "tempdir", str(temporary))
    yield
    assert list(temporary.iterdir()) == []


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return an empty cache."""
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


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
def test_a_wrong_parameter(foreign: Path, parameters: dict, says: str) -> None:
    message = refusal(foreign, {"gain": {**GAIN, "parameters": parameters}})
    assert message.startswith("fmus.gain.parameters: ")
    assert says in message


def test_a_value_outside_its_declared_limits(foreign: Path, tmp_path: Path) -> None:
    declaring(foreign / "Gain.fmu", tmp_path / "Gain.fmu", {"gain": 'min="0" max="2"'})
    message = refusal(tmp_path, {"gain": {**GAIN, "parameters": {"gain": 2.5}}})
    assert "gain = 2.5 is outside its limits [0.0, 2.0]" in message


def _link() -> zipfile.ZipInfo:
    member = zipfile.ZipInfo("resources/link")
    member.create_system = 3
    member.external_attr = (stat.S_IFLNK | 0o777) << 16
    return member


def _description(root: str = 'fmiVersion="2.0"', inside: str = "", before: str = "") -> tuple[str, bytes]:
    head = f'<?xml version="1.0"?>{before}<fmiModelDescription {root} modelName="m" guid="g">'
    text = f"{head}{inside}<ModelVariables/><ModelStructure/></fmiModelDescription>"
    return "modelDescription.xml", text.encode()


GOOD = _description(inside='<CoSimulation modelIdentifier="m"/>')
UTF16 = '<?xml version="1.0" encoding="UTF-16"?><!DOCTYPE a><a/>'.encode("utf-16")
BAD_ARCHIVES = {
    "a name with ..": ([("../evil", b"")], "member '../evil' would leave"),
    "a name with .. inside": ([("resources/../../evil", b"")], "would leave"),
    "an absolute name": ([("/etc/evil", b"")], "member '/etc/evil' would leave"),
    "a drive": ([("C:/evil", b"")], "would leave"),
    "a backslash": ([("..\\evil", b"")], "would leave"),
    "a link": ([GOOD, (_link(), b"/etc/passwd")], "'resources/link' is a link"),
    "no description": ([("readme", b"")], "has no modelDescription.xml"),
    "broken XML": ([("modelDescription.xml", b"<fmiModelDescription>")], "not well-formed XML"),
    "other XML": ([("modelDescription.xml", b"<html/>")], "root is <html>"),
    "a DOCTYPE": ([_description(before='<!DOCTYPE a [<!ENTITY b "c">]>')], "declares a DOCTYPE"),
    "a DOCTYPE in UTF-16": ([("modelDescription.xml", UTF16)], "declares a DOCTYPE"),
    "FMI 4": ([_description('fmiVersion="4.0"')], "is FMI 4.0; export as FMI 2.0 or 3.0"),
    "no version": ([_description("")], "of no stated version"),
    "nothing to run": ([_description(inside="")], "is for neither co-simulation nor model exchange"),
    "no binary": ([GOOD], "has no binary for this platform"),
    "another's binary": ([GOOD, ("binaries/vax/m.so", b"")], "has no binary for this platform"),
}


@pytest.mark.parametrize("case", BAD_ARCHIVES)
def test_a_bad_archive_is_not_unpacked(tmp_path: Path, case: str) -> None:
    members, says = BAD_ARCHIVES[case]
    with zipfile.ZipFile(tmp_path / "Bad.fmu", "w") as archive:
        for name, content in members:
            archive.writestr(name, content)
    message = refusal(tmp_path, {"bad": {"fmu": "Bad.fmu"}})
    assert message.startswith("Bad.fmu: ")
    assert says in message
    assert [p.name for p in tmp_path.iterdir()] == ["Bad.fmu"]


def test_a_file_that_is_no_archive(foreign: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "folder").mkdir()
    assert "Missing.fmu: no such file" in refusal(tmp_path, {"x": {"fmu": "Missing.fmu"}})
    assert "is a directory" in refusal(tmp_path, {"x": {"fmu": "folder"}})
    intact = (foreign / "Clock.fmu").read_bytes()
    (tmp_path / "Half.fmu").write_bytes(b"")
    assert "is not a ZIP archive, which an .fmu is" in refusal(tmp_path, {"x": {"fmu": "Half.fmu"}})
    for content in (b"PK", intact[: len(intact) // 2], intact[:5000] + bytes(500) + intact[5500:]):
        (tmp_path / "Half.fmu").write_bytes(content)
        assert "is not a readable FMU archive" in refusal(tmp_path, {"x": {"fmu": "Half.fmu"}})
    monkeypatch.setattr(archives, "MOST_BYTES", 1 << 20)
    with zipfile.ZipFile(tmp_path / "Bomb.fmu", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr("resources/zeros", bytes(2 << 20))
    assert "unpacks to more than 0 GiB" in refusal(tmp_path, {"x": {"fmu": "Bomb.fmu"}})


def test_a_large_file_that_is_no_archive_is_not_read(tmp_path: Path) -> None:
    resource = pytest.importorskip("resource")
    with (tmp_path / "Large.fmu").open("wb") as file:
        file.truncate(1 << 30)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "Large.fmu: is not a ZIP archive" in refusal(tmp_path, {"x": {"fmu": "Large.fmu"}})
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 64 << 10


@pytest.mark.acceptance
def test_a_description_of_too_many_variables_is_not_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The variables are counted before they are read: FMPy takes seconds for this number."""
    monkeypatch.setattr(archives.fmpy, "read_model_description", None)
    variable = b'<ScalarVariable name="v%d" valueReference="%d"><Real/></ScalarVariable>'
    with zipfile.ZipFile(tmp_path / "Many.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        variables = b"".join(variable % (k, k) for k in range(archives.MOST_ELEMENTS // 2))
        described = b'<fmiModelDescription fmiVersion="2.0"><ModelVariables>%s</ModelVariables></fmiModelDescription>'
        archive.writestr("modelDescription.xml", described % variables)
    assert len(variables) < archives.MOST_DESCRIPTION_BYTES
    assert "has more than 300,000 elements; not read" in refusal(tmp_path, {"x": {"fmu": "Many.fmu"}})


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("member", "mebibytes", "says"),
    [
        ("resources/zeros", 65, "unpacks to more than 200 times its size; not unpacked"),
        ("modelDescription.xml", 33, "modelDescription.xml is larger than 32 MiB; not read"),
    ],
)
def test_a_small_archive_of_much_is_refused_before_it_is_unpacked(
    member: str, mebibytes: int, says: str, tmp_path: Path
) -> None:
    resource = pytest.importorskip("resource")
    with zipfile.ZipFile(tmp_path / "Bomb.fmu", "w", zipfile.ZIP_DEFLATED) as bomb:
        with bomb.open(member, "w") as file:
            for _ in range(mebibytes):
                file.write(b" " * (1 << 20))
        if member != "modelDescription.xml":
            bomb.writestr("modelDescription.xml", "<fmiModelDescription/>")
    assert (tmp_path / "Bomb.fmu").stat().st_size < 1 << 20
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert says in refusal(tmp_path, {"x": {"fmu": "Bomb.fmu"}})
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000


def test_what_packs_well_and_is_small_is_unpacked(tmp_path: Path) -> None:
    """Use a table of zeros among the resources of an FMU."""
    with zipfile.ZipFile(tmp_path / "Zeros.fmu", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("resources/zeros", bytes(10 << 20))
        archive.writestr(*GOOD)
    assert "has no binary for this platform" in refusal(tmp_path, {"x": {"fmu": "Zeros.fmu"}})


@pytest.mark.parametrize(
    ("member", "content", "says"),
    [
        ("binaries/", b"no library", "its library cannot be loaded"),
        ("resources/foreign_clock.py", b"raise OSError('no licence')", "fmi2Instantiate failed"),
    ],
)
def test_an_fmu_that_cannot_be_loaded(foreign: Path, tmp_path: Path, member: str, content: bytes, says: str) -> None:
    rewritten(foreign / "Clock.fmu", tmp_path / "Bad.fmu", lambda n, c: (n, content if n.startswith(member) else c))
    assert refusal(tmp_path, {"x": {"fmu": "Bad.fmu"}}).startswith(f"FMU 'x' (Bad.fmu): {says}")


def test_a_run_leaves_python_as_it_was(foreign: Path) -> None:
    path, modules = list(sys.path), set(sys.modules)
    refusal(foreign, {"pump": {**FAILING, "parameters": {"way": WAYS["raises"]}}})
    assert run(foreign, {"pump": FAILING}).table["pump.y"][-1] == pytest.approx(0.9)
    assert sys.path == path
    assert not [name for name in set(sys.modules) - modules if name.startswith("foreign_")]


def compensated(flavour: str | None = None):
    """Return a component that runs in a flavour."""
    fmus = {"c": {"component": "AccelerometerCompensation", "flavour": flavour}}
    return run(Path(), fmus, stimuli=[{"to": "c.reading", "constant": [0.1, 0.2, 9.7]}])


@pytest.mark.acceptance
def test_both_flavours_give_the_same_bits(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if host_compiler() is None:
        pytest.skip("needs a C compiler")
    python, native, usual = compensated("python"), compensated("native"), compensated()
    assert python.table.equals(native.table)
    hashes = [r.provenance["fmus"]["c"]["sha256"] for r in (python, native, usual)]
    assert hashes[0] != hashes[1] == hashes[2]
    monkeypatch.setattr(load, "usual_flavour", lambda: "python")
    assert compensated().provenance["fmus"]["c"]["sha256"] == hashes[0]


@pytest.mark.acceptance
def test_a_kept_fmu_is_used_again_unless_it_is_damaged(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first = compensated("python")
    (stored,) = cache.glob("fmus/*.fmu")
    content = stored.read_bytes()
    stored.write_bytes(content[:-100] + bytes(100))
    assert compensated("python").table.equals(first.table)
    assert stored.read_bytes() == content

    def fails(*_: object, **__: object) -> None:
        raise BuildError("there is no C compiler here")

    monkeypatch.setattr("trihedron.fmus.build", fails)
    assert compensated("python").table.equals(first.table)
    with pytest.raises(InputError, match=r"^fmus\.c\.flavour: there is no C compiler here$"):
        compensated("native")


def is_whole(stored: bytes) -> bool:
    """Return True if stored content matches the digest before it."""
    return hashlib.sha256(stored[32:]).digest() == stored[:32]


@pytest.mark.acceptance
@pytest.mark.skipif(not COMPILES, reason="needs numba")
def test_damaged_machine_code_is_made_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    loops.compiled_march.cache_clear()
    loops.compiled_march()
    # The content of the other tests, in a cache of its own.
    folder = tmp_path / "cache" / "loops"
    shutil.copytree(cache_folder() / "loops", folder)
    monkeypatch.setenv("TRIHEDRON_CACHE", str(folder.parent))
    content = {stored: stored.read_bytes() for stored in folder.glob("*.o")}
    assert all(map(is_whole, content.values()))
    for stored in content:
        stored.write_bytes(content[stored][:-8] + bytes(8))
    loops.compiled_march.cache_clear()
    loops.compiled_march()
    # A cache in long use also has those of other versions.
    assert [is_whole(stored.read_bytes()) for stored in content].count(True) == 1


@pytest.mark.acceptance
@pytest.mark.parametrize("mode", [0o777, 0o775, 0o722])
def test_what_others_could_have_put_into_the_cache_is_not_run(cache: Path, mode: int) -> None:
    """A digest shows only damage: the writer of a file can also write its digest."""
    first = compensated("python")
    (stored,) = cache.glob("fmus/*.fmu")
    for folder in (stored.parent, cache):
        stored.write_bytes(hashlib.sha256(b"planted").digest() + b"planted")
        folder.chmod(mode)
        assert others_can_write(stored.parent) == folder
        assert compensated("python").table.equals(first.table)
        assert stored.read_bytes().endswith(b"planted")
        folder.chmod(0o700)
    with pytest.raises(InputError):
        compensated("python")


def test_a_cache_that_cannot_be_written_is_done_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "taken").write_text("a file")
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "taken"))
    assert compensated("python").table.height == 11


def test_an_unknown_component(tmp_path: Path) -> None:
    message = refusal(tmp_path, {"t": {"component": "TurntableMotions"}})
    assert message == "fmus.t.component: there is no component 'TurntableMotions'; did you mean 'TurntableMotion'?"


@pytest.mark.parametrize(
    ("component", "effect", "says"),
    [
        ("AccelerometerBlock", "quadratik", "fmus.c.effects[1]: effect 'quadratik' is not one that extends"),
        ("TurntableMotion", "quadratic", "fmus.c.effects: "),
    ],
)
def test_a_wrong_effect(tmp_path: Path, component: str, effect: str, says: str) -> None:
    effects = [{"effect": effect, "where": "accelerometer-3", "coefficient": 1e-3}]
    assert refusal(tmp_path, {"c": {"component": component, "effects": effects}}).startswith(says)


def test_a_calibration_gives_parameters_and_explicit_ones_win(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    record = simulated(random_bench(rng), noise=rng.uniform(-1e-5, 1e-5, (24, 3)))
    calibration = json.loads(th.calibrate(record, noise_bound=1e-5).json_text())
    estimate = {entry["symbol"]: entry["estimate"] for entry in calibration["parameters"]}

    def of_unit(symbol: str, **unit: str) -> dict[str, Any]:
        """Return the calibration with another unit of a parameter, or with none."""
        entries = [dict(entry) for entry in calibration["parameters"]]
        for entry in entries:
            if entry["symbol"] == symbol:
                del entry["unit"]
                entry |= unit
        return {**calibration, "parameters": entries}

    (tmp_path / "c.json").write_text(json.dumps(calibration), encoding="utf-8")
    table = {"component": "TurntableMotion", "parameters_from": "c.json", "parameters": {"epsilon": 0.25}}
    block = {"component": "AccelerometerBlock", "parameters_from": "c.json"}
    columns = {"kappa_rad": "table.kappa", "epsilon_rad": "table.epsilon", "bias_g": "block.bias[2]"}
    simulation = run(tmp_path, {"table": table, "block": block}, record={"columns": columns})
    row = simulation.table.row(0, named=True)
    assert (row["kappa_rad"], row["epsilon_rad"], row["bias_g"]) == (estimate["X1"], 0.25, estimate["X17"])
    assert list(simulation.provenance["files"]) == ["c.json"]
    computer = {"c": {"component": "AttitudeComputer", "parameters_from": "c.json"}}
    for content, says in (
        (calibration, "says nothing about AttitudeComputer; known: "),
        ({**calibration, "gravity_mps2": -9.8}, "gravity_mps2: Input should be greater than or equal to 4.9, not -9.8"),
        (of_unit("X17", unit="mg"), "the unit of X17 is 'mg', and must be g"),
        (of_unit("X1", unit="deg"), "the unit of X1 is 'deg', and must be 1 or rad"),
        (of_unit("X4"), "unit: is missing"),
        ([], "the schema is None; a calibration has 'trihedron.calibration/3'"),
        ("9" * 5000, "is not JSON"),
    ):
        text = content if isinstance(content, str) else json.dumps(content)
        (tmp_path / "c.json").write_text(text, encoding="utf-8")
        message = refusal(tmp_path, computer)
        assert message.startswith("fmus.c.parameters_from: c.json: ")
        assert says in message


@pytest.mark.parametrize("verdict", ["usable", "insufficient", "falsified"])
def test_a_calibration_without_a_table_gives_parameters_of_instruments(tmp_path: Path, verdict: str) -> None:
    instrument = Instrument(4)
    content = hand_calibration(instrument, sensitivity=False, verdict=verdict)
    (tmp_path / "hand.json").write_text(json.dumps(content), encoding="utf-8")
    block, gyros = ({"component": name, "parameters_from": "hand.json"} for name in ("AccelerometerBlock", "GyroBlock"))
    columns = {"bias_g": "block.bias[2]", "m12": "gyros.scale_misalignment[2]", "b_radps": "gyros.bias[3]"}
    simulation = run(tmp_path, {"block": block, "gyros": gyros}, record={"columns": columns})
    words = f"parameters_from: hand.json: the calibration is {verdict}; its estimates are used"
    assert [words in note for note in simulation.notes] == [True] * (0 if verdict == "usable" else 2)
    row = simulation.table.row(0)
    assert row[-3:] == (instrument.bias[1], instrument.gyro_matrix[0, 1], instrument.gyro_bias[2])
    message = refusal(tmp_path, {"t": {"component": "TurntableMotion", "parameters_from": "hand.json"}})
    assert "says nothing about TurntableMotion; known: " in message
