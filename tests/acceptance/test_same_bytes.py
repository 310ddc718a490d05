"""The same inputs give the same bytes, with one thread or two; numbers that are all but nothing are zeros."""

import os
import subprocess
import sys
from pathlib import Path

import polars as pl
import pytest

from command_table import make_inputs
from trihedron.tools import cli

pytestmark = pytest.mark.acceptance
COMMANDS = (
    "calibrate clean.csv --noise-bound 1e-5",
    "diagnose measured.csv --noise-bound 1e-5",
    "diagnose strapdown.csv",
    "inspect strapdown.csv",
    "attitude strapdown.csv",
    "plan --positions 8 --starts 2 --cuts 5",
    "campaign-report finished --report out.html",
)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    make_inputs(folder)
    return folder


@pytest.mark.parametrize("line", COMMANDS)
def test_one_thread_and_two_give_the_same_bytes(line: str, inputs: Path) -> None:
    said = []
    for threads in ("1", "2", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        command = [sys.executable, "-m", "trihedron.tools.cli", *line.split(), "--quiet", "--json", "-"]
        done = subprocess.run(command, cwd=inputs, env=environment, capture_output=True, check=True)
        said.append(done.stdout)
    assert said[0]
    assert said[0] == said[1] == said[2]


@pytest.mark.parametrize("least", [1e-310, 5e-324, 2.2250738585072014e-308])
def test_denormal_numbers_are_zeros(least: float, inputs: Path, tmp_path: Path) -> None:
    """An angle, a time and a temperature that are all but nothing."""
    table = pl.read_csv(inputs / "clean.csv", comment_prefix="#")
    said = []
    for value in (0.0, least):
        first = pl.int_range(pl.len()) == 0
        names = ["alpha_deg", "beta_deg", "time_s"]
        path = tmp_path / "r.parquet"
        table.with_columns([pl.when(first).then(value).otherwise(pl.col(n)).alias(n) for n in names]).write_parquet(
            path
        )
        out = tmp_path / "out.json"
        assert cli.main(["calibrate", str(path), "--noise-bound", "1e-2", "--json", str(out), "--quiet"]) == 0
        said.append([line for line in out.read_text().splitlines() if "sha256" not in line])
    assert said[0] == said[1]
