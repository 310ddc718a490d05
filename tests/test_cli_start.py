"""The command line before anything is done: it starts without libraries, speaks plainly, completes and hints."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from trihedron.tools import cli

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
HEAVY = ("numpy", "scipy", "polars", "numba", "llvmlite", "matplotlib", "fmpy", "pythonfmu", "pydantic", "highspy",
         "jinja2", "dask", "distributed", "trihedron.tools.records.read", "trihedron.models",
         "trihedron.fmus")  # fmt: skip
"""What takes its time to import; `--help` and a mistake need none of it."""


def imported_by(*arguments: str) -> set[str]:
    """Modules that a command has imported when it ends."""
    code = "import sys; from trihedron.tools import cli; cli.main(sys.argv[1:]); print('\\n', *sorted(sys.modules))"
    said = subprocess.run(
        [sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True, timeout=120
    )
    return set(said.stdout.splitlines()[-1].split())


@pytest.mark.parametrize(
    "arguments",
    [
        ["--help"],
        ["--version"],
        ["diagnose", "--help"],
        ["calibrat"],
        ["plan", "--targt", "X4"],
        ["completion", "bash"],
    ],
    ids=" ".join,
)
def test_starting_imports_nothing_that_takes_its_time(arguments: list[str]):
    assert imported_by(*arguments) & set(HEAVY) == set()


def test_the_list_of_heavy_modules_is_one_of_modules_that_are_used():
    """A name that nothing ever imports would prove nothing: a real command imports them."""
    there = imported_by("check", str(SCENARIOS / "static-calibration.toml"))
    assert {"numpy", "polars", "fmpy", "pydantic", "trihedron.models", "trihedron.fmus"} <= there


def test_plain_text_where_there_is_no_terminal():
    """Nor with a terminal that is asked to be plain."""
    commands = (["--help"], ["plan", "--help"], ["calibrat"], ["check", str(SCENARIOS / "table-attitude.toml")])
    for variables in ({}, {"TERM": "xterm-256color", "NO_COLOR": "1"}):
        environment = {k: v for k, v in os.environ.items() if k not in ("FORCE_COLOR", "CLICOLOR_FORCE")} | variables
        for arguments in commands:
            done = subprocess.run(
                [sys.executable, "-m", "trihedron.tools.cli", *arguments], capture_output=True, text=True, check=False,
                env=environment, timeout=120,
            )  # fmt: skip
            assert "\x1b" not in done.stdout + done.stderr


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_every_command_and_its_options(shell: str, capsys):
    assert cli.main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for name in ("simulate", "calibrate", "diagnose", "export-ssp", "noise-bound", "asymmetric"):
        assert name in script


def test_bash_reads_its_completion(capsys, tmp_path: Path):
    import shutil

    if shutil.which("bash") is None:
        pytest.skip("no bash here")
    assert cli.main(["completion", "bash"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out, encoding="utf-8")
    asked = (
        f"source {script}; COMP_WORDS=(trihedron cal); COMP_CWORD=1; COMP_LINE='trihedron cal'; COMP_POINT=13; "
        "_trihedron; echo ${COMPREPLY[@]}"
    )
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, check=False, timeout=60)
    assert done.stdout.split() == ["calibrate"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["calibrat"], 'Did you mean "calibrate"'),
        (["reproduce", "attitud"], 'Did you mean "attitude"'),
        (["calibrate", "r.csv", "--noise-bond", "1"], "Did you mean --noise-bound"),
        (["plan", "--admissible", "tabels"], 'Did you mean "tables"'),
        (["plan", "--target", "X44"], "the parameters are X1 to X18"),
        (["plan", "--mounting", "tripot"], "did you mean 'tripod'"),
        (["plan", "--positions", "8", "--detect", "quadratik"], "did you mean 'quadratic'"),
        (["hidden", "r.csv", "--effect", "quadratik"], "did you mean 'quadratic'"),
        (["hidden", "--suite", "quick-singel"], "did you mean 'quick-single'"),
        (["export", "AcelerometerBlock"], "did you mean 'AccelerometerBlock'"),
        (["export", "--effect", "quadratik accelerometer-3"], "did you mean 'quadratic accelerometer-3'"),
        (["export", "--flavour", "native", "--platform", "x86-linux"], "did you mean x86_64-linux"),
        (["new", "scenaro"], "did you mean 'scenario'"),
        (["check", "measurd.toml"], "did you mean 'measured.toml'"),
        (["calibrate", "measurd.toml", "--noise-bound", "1e-5"], "did you mean 'measured.toml'"),
        (["simulate", "measurd.toml"], "did you mean 'measured.toml'"),
        (["simulate", "measured.toml"], "run.step_s: is missing (is 'step' meant?)"),
        (["attitude", "strapdown.csv", "--algorithm", "adaptiv-degree"], "did you mean 'adaptive-degree'"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_names_nearest_to_a_misspelt_one(arguments: list[str], said: str, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("measured.toml").write_text('schema = "trihedron.scenario/1"\n[run]\nstep = 1.0\n', encoding="utf-8")
    rows = [f"{0.1 * k:.1f},0,0,0.1,0,0,9.8" for k in range(20)]
    header = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
    Path("strapdown.csv").write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    assert cli.main(arguments) == 2
    assert said in capsys.readouterr().err


def test_quiet_prints_what_was_asked_for_by_name_and_errors_alone(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments in (["--quiet", "new", "scenario"], ["new", "record", "-q"], ["check", "scenario.toml", "--quiet"]):
        assert cli.main(arguments) == 0
        assert capsys.readouterr() == ("", "")
    assert cli.main(["check", "record.csv", "--quiet"]) == 2
    said = capsys.readouterr()
    assert (said.out, said.err.count("\n")) == ("", 1)
    assert cli.main(["check", "scenario.toml", "--quiet", "--json", "-"]) == 0
    said = capsys.readouterr()
    assert json.loads(said.out)["good"] is True
    assert said.err == ""


def test_json_on_standard_output_is_the_whole_output(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cli.main(["new", "scenario", "bench.toml", "--json", "-"])
    assert json.loads(capsys.readouterr().out)["files"] == ["bench.toml", "bench-positions.csv"]
    assert cli.main(["simulate", "bench.toml", "--out", "run", "--json", "-"]) == 0
    done = json.loads(capsys.readouterr().out)
    assert done["files"][-1] == "run/positions.csv"
    assert cli.main(["simulate", "bench.toml", "--out", "run", "--json", "simulated.json"]) == 0
    assert capsys.readouterr().out.split() == done["files"]
    assert json.loads(Path("simulated.json").read_text(encoding="utf-8")) == done
    assert cli.main(["export", "AccelerometerBlock", "--json", "--out", "x"]) == 2
    assert "--json --out: is an option" in capsys.readouterr().err


def test_doctor_tries_a_run(capsys):
    assert cli.main(["doctor", "--json", "-"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["works"] is True
    subjects = {finding["subject"]: finding["state"] for finding in said["findings"]}
    assert "consistent" in subjects["a run"]
    assert {"extra native", "extra docs", "extra cluster", "native FMUs for aarch64-darwin"} <= set(subjects)


def test_doctor_says_what_does_not_work(monkeypatch, capsys):
    monkeypatch.setattr("trihedron.tools.orchestrator.run.simulate", lambda *_, **__: 1 / 0)
    assert cli.main(["doctor"]) == 1
    said = capsys.readouterr()
    assert "NO  a run" in said.out
    assert "ZeroDivisionError" in said.out
    assert said.err == "trihedron: does not work: a run\n"
