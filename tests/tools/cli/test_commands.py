"""The command line for a user: exit status, one line for a mistake, no leftovers."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import trihedron
from trihedron.tools import cli
from trihedron.tools.records import PositionRecord, read_record

SCENARIOS = Path(__file__).resolve().parents[3] / "scenarios"


@pytest.fixture(scope="module")
def record(tmp_path_factory) -> Path:
    """Write a measured record with a hidden quadratic term."""
    path = tmp_path_factory.mktemp("record") / "measured.csv"
    answer = path.with_name("answer.json")
    assert cli.main(["hidden", str(path), "--seed", "5", "--answer", str(answer), "--effect", "quadratic"]) == 0
    return path


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    status = cli.main([str(a) for a in arguments])
    output = capsys.readouterr()
    return status, output.out, output.err


@pytest.mark.usefixtures("no_pictures")
def test_from_record_to_named_cause_by_commands(record, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    status, out, err = run(
        capsys, "diagnose", record, "--noise-bound", "1e-5", "--json", "d.json", "--export", "extended",
        "--report", "d.html",
    )  # fmt: skip
    assert (status, err) == (0, "")
    assert out.startswith("One effect explains the record: ")
    assert "Gain:        on " in out
    assert len(out.partition("extended/")[0].splitlines()) <= 25
    assert max(len(line) for line in out.partition("\nNext: ")[0].splitlines()) <= 80
    titles = json.loads(Path("d.json").read_text())["causes"][0]
    hidden = json.loads(record.with_name("answer.json").read_text())["hidden"]
    assert (titles["effect"], titles["where"]) == (hidden["effect"], hidden["where"])
    written = {path.name for path in Path("extended").iterdir()}
    assert written >= {"AccelerometerBlock.fmu", "AccelerometerBlock.ssv", "TurntableMotion.fmu", "scenario.toml"}
    # The written scenario gives the record again.
    assert run(capsys, "simulate", "extended/scenario.toml", "--out", "again")[0] == 0
    measured, again = (read_record(path, PositionRecord) for path in (record, Path("again/positions.csv")))
    assert np.abs(again.specific_force - measured.specific_force).max() <= 1e-5 * 9.80665
    assert "responds to the square" in Path("d.html").read_text(encoding="utf-8")


@pytest.mark.acceptance
def test_dwell_scatter_alone_falsifies_nothing(tmp_path, monkeypatch, capsys):
    """In a clean run without --noise-bound, errors held over a rest do not show in the scatter, so nothing is
    proved."""
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "simulate", SCENARIOS / "static-calibration.toml", "--out", "run")[0] == 0
    for command, verdict in (("calibrate", "noise-unknown"), ("diagnose", "insufficient")):
        status, out, _ = run(capsys, command, "run/run.parquet", "--json", "result.json")
        result = json.loads(Path("result.json").read_text())
        assert status == 0
        assert result["verdict"] == verdict
        sigma = result["sigma"] if command == "calibrate" else result["calibration"]["sigma"]
        assert "scatter" in sigma["from"]
        assert "repeat positions" in out


def test_hidden_keeps_its_secret_and_repeats(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(capsys, "hidden", "a.csv", "--seed", "3", "--answer", "a.json")[0] == 0
    assert run(capsys, "hidden", "b.csv", "--seed", "3")[0] == 0
    assert Path("a.csv").read_bytes() == Path("b.csv").read_bytes()
    text = Path("a.csv").read_text()
    secret = json.loads(Path("a.json").read_text())
    assert secret["hidden"]["effect"] not in text
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.csv", "a.json", "b.csv"]


def test_export_writes_every_component(tmp_path, monkeypatch, capsys):
    from trihedron.fmus import component_names

    monkeypatch.chdir(tmp_path)
    status, out, _ = run(capsys, "export", "--out", "fmus")
    assert status == 0
    assert sorted(Path(line).stem for line in out.split()) == sorted(component_names())


def test_a_fault_of_the_program_is_one_line_and_status_one(capsys, monkeypatch):
    monkeypatch.delenv("TRIHEDRON_TRACEBACK", raising=False)
    monkeypatch.setattr("trihedron.tools.exporting.export_components", lambda *_: 1 / 0)
    status, _, err = run(capsys, "export")
    assert status == 1
    assert err.count("\n") == 1
    assert "a fault of the program: ZeroDivisionError" in err


@pytest.mark.acceptance
def test_the_program_is_found_under_its_name():
    """Run it as installed, from another folder, with nothing of the checkout on the path."""
    program = Path(sys.executable).with_name("trihedron")
    output = subprocess.run(
        [program, "--version"], capture_output=True, text=True, check=True, cwd=os.sep, timeout=300
    ).stdout
    assert output.strip() == trihedron.__version__
