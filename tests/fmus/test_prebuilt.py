"""Native FMUs of a wheel: used if nothing compiles, and only for exactly this source."""

import json
import zipfile
from pathlib import Path
from typing import Literal

import pytest

import trihedron as th
from trihedron.fmus import build, host_name
from trihedron.fmus.native import compile as compiler

NAME = "AccelerometerBlock"

if compiler.host_compiler() is None or host_name() not in compiler.PLATFORMS:
    pytest.skip("no C compiler for this machine", allow_module_level=True)


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a wheel's folder with one component for this machine, and disable the compiler."""
    folder = tmp_path / "prebuilt"
    for fmi in (2, 3):
        build(NAME, folder / f"fmi{fmi}", flavour="native", fmi=fmi)
    (folder / compiler.MANIFEST).write_text(json.dumps({"flags": compiler.all_flags()}), encoding="utf-8")
    monkeypatch.setattr(compiler, "prebuilt_folder", lambda: folder)
    monkeypatch.setattr(compiler, "host_compiler", lambda: None)
    monkeypatch.setattr(compiler, "zig_version", lambda: None)
    monkeypatch.setenv("TRIHEDRON_CACHE", str(tmp_path / "cache"))
    return folder


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_export_without_a_compiler_gives_the_fmu_that_came_along(fmi: Literal[2, 3], wheel: Path, tmp_path: Path):
    process = th.export(NAME, out=tmp_path / "out", flavour="native", fmi=fmi)
    assert process.files[0].read_bytes() == (wheel / f"fmi{fmi}" / f"{NAME}.fmu").read_bytes()


def test_a_run_uses_it(wheel: Path):
    run = th.simulate(
        {
            "run": {"stop_s": 1.0, "step_s": 0.1},
            "fmus": {"block": {"component": NAME, "flavour": "native", "parameters": {"bias": [1e-3, 0.0, 0.0]}}},
        }
    )
    assert run["block.reading[1]_mps2"][-1] == pytest.approx(1e-3 * 9.80665, abs=1e-6)


def refused(tmp_path: Path, *names: str, **options) -> str:
    with pytest.raises(th.InputError) as error:
        th.export(*names, out=tmp_path / "out", flavour="native", **options)
    assert not (tmp_path / "out").exists()
    return str(error.value)


def test_another_source_is_not_taken(wheel: Path, tmp_path: Path):
    """An effect changes the kernels; another component was not built; other platforms are not included."""
    assert "need a C compiler" in refused(tmp_path, NAME, effects=["quadratic accelerometer-3"])
    assert "need a C compiler" in refused(tmp_path, "TurntableMotion")
    altered = next(name for name in compiler.PLATFORMS if name != host_name())
    assert f"platform {altered}: needs ziglang" in refused(tmp_path, NAME, platform=altered)


@pytest.mark.parametrize("damage", ["flags", "manifest", "source", "cut"])
def test_what_is_stale_or_damaged_is_not_taken(damage: str, wheel: Path, tmp_path: Path):
    archive = wheel / "fmi2" / f"{NAME}.fmu"
    if damage == "flags":
        (wheel / compiler.MANIFEST).write_text(json.dumps({"flags": ["-O3"]}), encoding="utf-8")
    elif damage == "manifest":
        (wheel / compiler.MANIFEST).write_text("{", encoding="utf-8")
    elif damage == "cut":
        archive.write_bytes(archive.read_bytes()[:5000])
    else:
        with zipfile.ZipFile(archive) as old:
            members = {name: old.read(name) for name in old.namelist()}
        members["sources/model.c"] += b"\n"
        with zipfile.ZipFile(archive, "w") as new:
            for name, content in members.items():
                new.writestr(name, content)
    assert "need a C compiler" in refused(tmp_path, NAME)


def test_a_checkout_has_none():
    """They would not match the sources after the next change of a kernel."""
    assert not compiler.has_prebuilt()
