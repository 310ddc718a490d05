"""The wheel of `make wheel` in an environment of its own, in an empty folder: no checkout near, no compiler."""

import json
import os
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
WHEELS = sorted((ROOT / "dist").glob("trihedron-*.whl"))
PLATFORMS = {"linux64", "aarch64-linux", "win64", "darwin64", "aarch64-darwin"}

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.skipif(not WHEELS, reason="there is no wheel in dist/; `make wheel` builds it"),
    pytest.mark.skipif(sys.platform == "win32", reason="the environment is laid out as on Linux and macOS"),
]


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the program of the installed wheel; the libraries are those of the tests' environment."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=True, symlinks=True)
    python = folder / "bin" / "python"
    process = subprocess.run(
        [python, "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(WHEELS[-1])],
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    libraries = next(path for path in sys.path if path.endswith("site-packages"))
    packages = next(folder.glob("lib/python*/site-packages"))
    # Python reads no .pth in a folder that a .pth names, so an editable install is not found there.
    (packages / "libraries.pth").write_text(libraries + "\n", encoding="utf-8")
    return folder / "bin" / "trihedron"


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An empty folder."""
    return tmp_path_factory.mktemp("empty")


def run(program: Path, here: Path, *arguments: str) -> str:
    environment = {"PATH": str(program.parent), "HOME": str(here.parent / "home")}
    environment |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    environment["TRIHEDRON_CACHE"] = str(here.parent / "cache")
    process = subprocess.run(
        [program, *arguments], cwd=here, env=environment, capture_output=True, text=True, check=False, timeout=600
    )
    assert process.returncode == 0, process.stderr
    assert os.fspath(ROOT) not in process.stdout + process.stderr
    return process.stdout


def test_the_whole_way_with_no_checkout_near(program: Path, here: Path):
    installation = " ".join(run(program, here, "doctor").split())
    assert "native FMUs for aarch64-darwin components as they came" in installation
    run(program, here, "new", "scenario", "bench.toml")
    assert "nothing is wrong" in run(program, here, "check", "bench.toml")
    run(program, here, "simulate", "bench.toml", "--out", "run")
    output = run(program, here, "calibrate", "run/positions.csv", "--noise-bound", "1e-5", "--report", "c.html")
    assert output.startswith("consistent")
    run(program, here, "hidden", "m.csv", "--seed", "7", "--effect", "quadratic")
    output = run(program, here, "diagnose", "m.csv", "--noise-bound", "1e-5", "--export", "extended")
    assert output.startswith("explained")
    assert (here / "extended" / "AccelerometerBlock.fmu").is_file()


@pytest.mark.parametrize("fmi", ["2", "3"])
def test_every_component_comes_for_every_platform(fmi: str, program: Path, here: Path):
    from trihedron.fmus import component_names

    out = ("--flavour", "native", "--platform", "all", "--fmi", fmi, "--out", f"fmus{fmi}", "--json", "-")
    output = json.loads(run(program, here, "export", *out))
    assert [fmu["component"] for fmu in output["fmus"]] == list(component_names())
    for fmu in output["fmus"]:
        assert len(fmu["platforms"]) == 5
        with zipfile.ZipFile(here / fmu["file"]) as archive:
            binaries = [name for name in archive.namelist() if name.startswith("binaries/")]
            assert len(binaries) == 5
            if fmi == "2":
                assert {name.split("/")[1] for name in binaries} == PLATFORMS


def test_the_scenarios_are_in_it(program: Path, here: Path):
    with zipfile.ZipFile(WHEELS[-1]) as wheel:
        names = set(wheel.namelist())
    ours = {f"trihedron/scenarios/{p.relative_to(ROOT / 'scenarios')}" for p in (ROOT / "scenarios").rglob("*.toml")}
    assert ours <= names
    assert "trihedron/planning/common_positions.csv" in names
