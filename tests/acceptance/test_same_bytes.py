"""The same inputs give the same bytes with one thread or two, by another Python, from another place."""

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import polars as pl
import pytest

from command_table import make_inputs
from relations import differences
from trihedron.tools import cli

pytestmark = pytest.mark.acceptance
ROOT = Path(cli.__file__).resolve().parents[2]
PRODUCT = ("__init__.py", "__init__.pyi", "models", "fmus", "tools", "scenarios")
COMMANDS = (
    "calibrate clean.csv --noise-bound 1e-5",
    "diagnose measured.csv --noise-bound 1e-5",
    "diagnose strapdown.csv",
    "inspect strapdown.csv",
    "attitude strapdown.csv",
    "plan positions 8 --starts 2 --cuts 5",
    "campaign-report finished --report out.html",
)
HANDFUL = [line for line in COMMANDS if line.split()[0] in ("calibrate", "inspect", "attitude")]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    return folder


@pytest.mark.parametrize("line", COMMANDS)
def test_one_thread_and_two_give_the_same_bytes(line: str, inputs: Path) -> None:
    output = []
    for threads in ("1", "2", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        command = [sys.executable, "-m", "trihedron.tools.cli", *line.split(), "--quiet", "--json", "-"]
        process = subprocess.run(command, cwd=inputs, env=environment, capture_output=True, check=True)
        output.append(process.stdout)
    assert output[0]
    assert output[0] == output[1] == output[2]


@pytest.mark.parametrize("least", [1e-310, 5e-324, 2.2250738585072014e-308])
def test_denormal_numbers_are_zeros(least: float, inputs: Path, tmp_path: Path) -> None:
    """Test a nearly zero angle, time and temperature."""
    table = pl.read_csv(inputs / "clean.csv", comment_prefix="#")
    output = []
    for value in (0.0, least):
        first = pl.int_range(pl.len()) == 0
        names = ["alpha_deg", "beta_deg", "time_s"]
        path = tmp_path / "r.parquet"
        table.with_columns([pl.when(first).then(value).otherwise(pl.col(n)).alias(n) for n in names]).write_parquet(
            path
        )
        out = tmp_path / "out.json"
        assert cli.main(["calibrate", str(path), "--noise-bound", "1e-2", "--json", str(out), "--quiet"]) == 0
        output.append([line for line in out.read_text().splitlines() if "sha256" not in line])
    assert output[0] == output[1]


def said_by(program: Sequence[str | Path], line: str, inputs: Path, **variables: str) -> bytes:
    """Return the standard output of a command, as JSON."""
    command = [*program, "-m", "trihedron.tools.cli", *line.split(), "--quiet", "--json", "-"]
    return subprocess.run(command, cwd=inputs, env={**os.environ, **variables}, capture_output=True, check=True).stdout


RELEASES = "from importlib.metadata import version; print(*map(version, ('numpy', 'scipy', 'highspy', 'polars')))"


@pytest.mark.parametrize(("first_python", "second_python"), [("", "python3.12"), ("python3.12", "python3.13")])
def test_another_python_gives_the_same_bytes(first_python: str, second_python: str, inputs: Path) -> None:
    """Compare bytes with the same releases of the libraries, and numbers with others, which may add in another
    order."""
    programs = [
        ROOT / "build" / name / "bin" / "python" if name else Path(sys.executable)
        for name in (first_python, second_python)
    ]
    for program in programs:
        if not program.exists():
            pytest.skip(f"{program} is not there; `make pythons` installs the product for other Pythons where they are")
    releases = {subprocess.run([p, "-c", RELEASES], capture_output=True, check=True).stdout for p in programs}
    for line in HANDFUL:
        first, second = (said_by([program], line, inputs) for program in programs)
        assert len(first) > 100
        assert differences(json.loads(first), json.loads(second), 1e-6) == [], line
        assert first == second or len(releases) > 1, line


def test_another_installation_gives_the_same_bytes(inputs: Path, tmp_path: Path) -> None:
    """Test a copy of the product elsewhere, with nothing compiled yet."""
    for part in PRODUCT:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, tmp_path / "trihedron" / part, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            (tmp_path / "trihedron").mkdir(exist_ok=True)
            shutil.copy(ROOT / part, tmp_path / "trihedron" / part)
    further = {"PYTHONPATH": str(tmp_path), "TRIHEDRON_CACHE": str(tmp_path / "cache")}
    where = [sys.executable, "-c", "import trihedron; print(trihedron.__file__)"]
    result = subprocess.run(
        where, cwd=inputs, env={**os.environ, **further}, capture_output=True, check=True, text=True
    )
    assert result.stdout.startswith(str(tmp_path))
    for line in HANDFUL:
        assert said_by([sys.executable], line, inputs, **further) == said_by([sys.executable], line, inputs), line
