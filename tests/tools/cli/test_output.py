"""The outputs of a command: no file of the user's is replaced by mistake; a full or foreign output gives one line."""

import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from generator.stands import simulated
from trihedron.tools import cli
from trihedron.tools.records import write_record

PROGRAM = [sys.executable, "-m", "trihedron.tools.cli"]


@pytest.fixture
def record(tmp_path, monkeypatch) -> Path:
    """Write a record of a faultless bench into the current folder."""
    monkeypatch.chdir(tmp_path)
    write_record(simulated(np.zeros(24)), tmp_path / "record.csv")
    return Path("record.csv")


@pytest.mark.parametrize(
    "arguments",
    [
        ["calibrate", "record.csv", "--noise-bound", "1e-5", "--json", "pipe"],
        ["calibrate", "record.csv", "--noise-bound", "1e-5", "--report", "pipe"],
        ["diagnose", "record.csv", "--noise-bound", "1e-5", "--json", "pipe"],
        ["hidden", "pipe"],
        ["hidden", "new.csv", "--answer", "pipe"],
    ],
    ids=" ".join,
)
@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no named pipes")
def test_a_device_is_not_replaced_by_a_file(arguments, record, capsys):
    """A pipe replaces /dev/null: for root, a rename would put a file in its place for the whole machine."""
    os.mkfifo("pipe")
    assert cli.main(arguments) == 2
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err == "trihedron: pipe: is not a regular file; give the name of a file\n"
    assert stat.S_ISFIFO(Path("pipe").stat().st_mode)
    assert sorted(p.name for p in Path().iterdir()) == ["pipe", "record.csv"]


def test_a_target_may_begin_with_a_minus(record, capsys):
    assert cli.main(["calibrate", "record.csv", "--noise-bound", "1e-5", "--target", "-X4"]) == 0
    assert any(line.startswith("-X4 ") for line in capsys.readouterr().out.splitlines())


@pytest.mark.first(1)
@pytest.mark.skipif(not Path("/dev/full").is_char_device(), reason="this system has no /dev/full")
@pytest.mark.parametrize("arguments", [["calibrate", "record.csv", "--noise-bound", "1e-5"], ["--help"]], ids=" ".join)
def test_a_full_disk_behind_standard_output_is_one_line(arguments, record):
    with Path("/dev/full").open("w") as full:
        process = subprocess.run([*PROGRAM, *arguments], stdout=full, stderr=subprocess.PIPE, text=True, timeout=300)
    assert process.returncode == 2
    assert process.stderr == "trihedron: standard output: cannot be written (No space left on device)\n"


@pytest.mark.acceptance
def test_an_output_without_greek_letters_gets_the_result_all_the_same(record):
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    process = subprocess.run(
        [*PROGRAM, "calibrate", "record.csv", "--noise-bound", "1e-5"],
        env=environment, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert (process.returncode, process.stderr) == (0, "")
    assert "\\u03c3 1e-5 g" in process.stdout


def test_quiet_prints_what_was_asked_for_by_name_and_errors_alone(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for arguments in (["--quiet", "new", "scenario"], ["new", "record", "-q"], ["check", "scenario.toml", "--quiet"]):
        assert cli.main(arguments) == 0
        assert capsys.readouterr() == ("", "")
    assert cli.main(["check", "record.csv", "--quiet"]) == 2
    output = capsys.readouterr()
    assert (output.out, output.err.count("\n")) == ("", 1)
    assert cli.main(["check", "scenario.toml", "--quiet", "--json", "-"]) == 0
    output = capsys.readouterr()
    assert json.loads(output.out)["good"] is True
    assert output.err == ""


def test_json_on_standard_output_is_the_whole_output(tmp_path: Path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    cli.main(["new", "scenario", "bench.toml", "--json", "-"])
    assert json.loads(capsys.readouterr().out)["files"] == ["bench.toml", "bench-positions.csv"]
    assert cli.main(["simulate", "bench.toml", "--out", "run", "--json", "-"]) == 0
    process = json.loads(capsys.readouterr().out)
    assert process["files"][-1] == "run/positions.csv"
    assert cli.main(["simulate", "bench.toml", "--out", "run", "--json", "simulated.json"]) == 0
    assert capsys.readouterr().out.split() == process["files"]
    assert json.loads(Path("simulated.json").read_text(encoding="utf-8")) == process
    assert cli.main(["export", "AccelerometerBlock", "--json", "--out", "x"]) == 2
    assert "--json --out: is an option" in capsys.readouterr().err
