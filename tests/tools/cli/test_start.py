"""The command line before any work: it starts without libraries, speaks plainly, completes and hints."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from generator.stands import random_bench, simulated
from trihedron.tools import cli
from trihedron.tools.records import write_record

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"
HEAVY = ("numpy", "scipy", "polars", "numba", "llvmlite", "matplotlib", "fmpy", "pythonfmu", "pydantic", "highspy",
         "jinja2", "dask", "distributed", "trihedron.tools.records.read", "trihedron.models",
         "trihedron.fmus")  # fmt: skip
"""Modules that are slow to import; `--help` and a mistake need none of them."""


def imported_by(*arguments: str) -> set[str]:
    """Return the modules that a command has imported at its end."""
    code = "import sys; from trihedron.tools import cli; cli.main(sys.argv[1:]); print('\\n', *sorted(sys.modules))"
    output = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True, timeout=300
    )
    return set(output.stdout.splitlines()[-1].split())


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["--version"],
        ["diagnose", "--help"],
        ["calibrat"],
        ["plan", "targt", "X4"],
        ["completion", "bash"],
    ],
    ids=" ".join,
)
def test_starting_imports_nothing_that_takes_its_time(arguments: list[str]):
    assert imported_by(*arguments) & set(HEAVY) == set()


@pytest.mark.acceptance
def test_the_list_of_heavy_modules_is_one_of_modules_that_are_used():
    """A module that nothing ever imports would prove nothing: a real command imports them."""
    present = imported_by("check", str(SCENARIOS / "static-calibration.toml"))
    assert {"numpy", "polars", "fmpy", "pydantic", "trihedron.models", "trihedron.fmus"} <= present


@pytest.mark.acceptance
@pytest.mark.parametrize("name", ["x.fmu", "x.ssp"])
def test_an_archive_is_refused_before_what_reads_records_is_imported(name: str, tmp_path: Path):
    (tmp_path / name).write_bytes(b"PK")
    present = imported_by("check", str(tmp_path / name))
    assert "fmpy" in present
    assert present & {"scipy", "numba", "highspy", "matplotlib", "trihedron.tools.records.read"} == set()


@pytest.mark.acceptance
@pytest.mark.parametrize("command", [["check"], ["calibrate", "--noise-bound", "1e-5"]], ids=" ".join)
def test_a_short_calibration_starts_without_compiler_and_simulation(command: list[str], tmp_path: Path):
    rng = np.random.default_rng(24)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, 24))
    record = simulated(random_bench(rng), alpha, beta, rng.uniform(-1e-5, 1e-5, (24, 3)))
    write_record(record, tmp_path / "record.csv")
    present = imported_by(command[0], str(tmp_path / "record.csv"), *command[1:])
    assert "trihedron.tools.records.read" in present
    slow = {"numba", "llvmlite", "scipy.optimize", "scipy.spatial", "scipy.interpolate", "fmpy", "matplotlib",
            "scipy.linalg", "polars.dataframe"}  # fmt: skip
    simulation = {"trihedron.tools.orchestrator.run", "trihedron.tools.evidence.evidence", "trihedron.tools.sieve"}
    assert present & (slow | simulation) == set()


@pytest.mark.acceptance
def test_a_plan_imports_nothing_that_reads_records_or_makes_components():
    present = imported_by("plan", "target", "X4", "--quiet")
    assert "highspy" in present
    assert (
        present & {"polars", "fmpy", "matplotlib", "trihedron.tools.records.read", "trihedron.fmus.instruments"}
        == set()
    )


def test_a_diagnosis_needs_no_library_of_distributions():
    """Its import takes as long as a diagnosis of a small record; the few functions needed are special ones."""
    code = "import sys, trihedron.tools.diagnosis.procedure; print('scipy.stats' in sys.modules)"
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=300)
    assert output.stdout.strip() == "False"


@pytest.mark.acceptance
def test_plain_text_where_there_is_no_terminal():
    """Test without a terminal, and with a terminal that is set to plain."""
    commands = (["plan", "--help"], ["check", str(SCENARIOS / "table-attitude.toml")])
    for variables in ({}, {"TERM": "xterm-256color", "NO_COLOR": "1"}):
        environment = {k: v for k, v in os.environ.items() if k not in ("FORCE_COLOR", "CLICOLOR_FORCE")} | variables
        for arguments in commands:
            process = subprocess.run(
                [sys.executable, "-m", "trihedron.tools.cli", *arguments], capture_output=True, text=True, check=False,
                env=environment, timeout=300,
            )  # fmt: skip
            assert "\x1b" not in process.stdout + process.stderr


@pytest.mark.acceptance
@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_every_command_and_its_options(shell: str, capsys):
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for name in ("simulate", "calibrate", "diagnose", "export-ssp", "noise-bound", "asymmetric"):
        assert name in script


def test_powershell_completes_what_every_command_takes(capsys):
    assert cli.main(["completion", "powershell"]) == 0
    script = capsys.readouterr().out
    catalogue = json.loads(script.partition("@'")[2].partition("'@")[0])["commands"]
    assert set(catalogue) == {name for name in cli.app if not name.startswith("-")}
    assert {"--noise-bound", "--sheet", "--about"} <= set(catalogue["calibrate"]["options"])
    assert "--date" in catalogue["instrument"]["commands"]["add"]["options"]
    assert script.count("{") == script.count("}")


def test_bash_reads_its_completion(capsys, tmp_path: Path):
    import shutil

    if shutil.which("bash") is None:
        pytest.skip("no bash here")
    assert cli.main(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    options = (
        f"source {script}; COMP_WORDS=(trihedron cal); COMP_CWORD=1; COMP_LINE='trihedron cal'; COMP_POINT=13; "
        "_trihedron; echo ${COMPREPLY[@]}"
    )
    process = subprocess.run(["bash", "-c", options], capture_output=True, text=True, check=False, timeout=300)
    assert process.stdout.split() == ["calibrate"]
