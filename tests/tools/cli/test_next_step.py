"""Every verdict ends with one command that can be run as printed; on a terminal the verdict has a colour."""

import io
import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from command_table import QUICK, Command
from trihedron.tools import cli

WITHOUT_VERDICT = (
    "new",
    "simulate",
    "export",
    "export-ssp",
    "export-notebook",
    "completion",
    "open",
    "plot",
    "fmpy-input",
)
"""Commands that print the names of files, or text for another program."""
LEADING_TO_LONG_ONES = {"plan target", "batch clean.csv", "doctor --json", "calibrate clean.csv3"}
"""Commands whose next command takes seconds."""
VERDICTS = [
    pytest.param(c, marks=pytest.mark.acceptance if c.title in LEADING_TO_LONG_ONES else [], id=c.title) for c in QUICK
]
BEGINNINGS = (
    "import foreign.csv --out record.csv",
    "check clean.csv",
    "calibrate clean.csv --noise-bound 1e-5",
    "calibrate measured.csv --noise-bound 1e-5",
    pytest.param("calibrate clean.csv measured.csv --noise-bound 1e-5 --own *", marks=pytest.mark.acceptance),
    pytest.param("diagnose measured.csv --noise-bound 1e-5", marks=pytest.mark.acceptance),
    "diagnose clean.csv --noise-bound 1e-5 --channels 1,2,3 --bounds 3e-3 1e-2",
    "inspect strapdown.csv",
    "plan positions 6 --starts 1 --cuts 0 --keep-out alpha:-10:-5",
    "instrument list unit",
)


def next_of(text: str) -> str:
    """Return the command that an answer ends with."""
    body, _, command = text.rstrip("\n").rpartition("\n\nNext: ")
    assert "Next:" not in body, text
    # A long command goes on in the next line.
    return command.replace("\\\n      ", "")


def run(line: str, capsys: pytest.CaptureFixture[str]) -> str:
    words = shlex.split(line)
    assert words[0] == "trihedron"
    assert cli.main(words[1:]) == 0, f"{line}: {capsys.readouterr().err}"
    return capsys.readouterr().out


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures", "here")
@pytest.mark.parametrize("command", VERDICTS)
def test_every_verdict_ends_with_a_command_that_runs(command: Command, capsys):
    cli.main(list(command.arguments))
    text = capsys.readouterr().out
    name = command.arguments[0]
    if name in WITHOUT_VERDICT or command.title == "hidden out.csv":
        assert "Next:" not in text
    else:
        run(next_of(text), capsys)


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures", "here")
@pytest.mark.parametrize("beginning", BEGINNINGS)
def test_a_reader_who_follows_the_commands_comes_to_an_end(beginning: str, capsys):
    line, done = f"trihedron {beginning}", []
    while line not in done and not line.startswith("trihedron help"):
        done.append(line)
        assert len(done) < 8, done
        line = next_of(run(line, capsys)) if "demo" not in line else line


@pytest.mark.first(1)
@pytest.mark.usefixtures("no_pictures", "here")
@pytest.mark.parametrize("folder", ["x" * 30, "a folder/" + "y" * 40, "/".join(["z" * 40] * 4)])
def test_the_next_command_fits_80_columns_with_a_long_path(folder: str, capsys, tmp_path):
    place = tmp_path / "elsewhere" / folder
    place.mkdir(parents=True)
    record = place / "record-of-unit-17.csv"
    record.write_bytes(Path("measured.csv").read_bytes())
    text = run(shlex.join(["trihedron", "diagnose", str(record), "--noise-bound", "1e-5"]), capsys)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 80
    assert len(lines) <= 25
    command = text[text.index("Next: ") :].removeprefix("Next: ")
    typed = subprocess.run(["sh", "-c", f"printf '%s\\n' {command}"], capture_output=True, text=True, check=True)
    words = typed.stdout.splitlines()
    assert words[:2] == ["trihedron", "diagnose"]
    assert Path(words[2]).resolve() == record.resolve()


@pytest.mark.usefixtures("no_pictures", "here")
def test_a_calibration_leads_to_a_corrected_record_in_two_more_commands(capsys):
    first = next_of(run("trihedron calibrate clean.csv --noise-bound 1e-5", capsys))
    assert first == "trihedron calibrate clean.csv --noise-bound 1e-5 --json calibration.json"
    second = next_of(run(first, capsys))
    assert second == "trihedron apply calibration.json clean.csv --noise-bound 1e-5 --out corrected.csv"
    run(second, capsys)
    assert Path("corrected.csv").is_file()


@pytest.mark.usefixtures("here")
def test_json_on_standard_output_has_no_next_command(capsys):
    assert cli.main(["apply", "calibration.json", "clean.csv", "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["rows"] > 0


@pytest.mark.acceptance
def test_accelerometers_alone_lead_to_a_calibration_and_a_record_at_rest_to_its_noise(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(1)
    time = np.arange(3000) / 100.0
    force = np.array([0.02, -0.05, 9.81]) + rng.normal(0.0, 5e-3, (3000, 3))
    names = ["time_s", "f1_mps2", "f2_mps2", "f3_mps2"]
    pl.DataFrame(np.column_stack([time, force]), schema=names).write_csv("phone.csv")
    assert next_of(run("trihedron check phone.csv", capsys)) == "trihedron calibrate phone.csv --json calibration.json"
    directions = rng.normal(size=(18, 3))
    poses = np.repeat(directions / np.linalg.norm(directions, axis=1)[:, None], 400, axis=0)
    rows = np.column_stack([np.arange(7200) / 100.0, 9.81 * poses + rng.normal(0.0, 5e-3, (7200, 3))])
    pl.DataFrame(rows, schema=names).write_csv("turned.csv")
    following = next_of(run("trihedron calibrate turned.csv --json turned.json", capsys))
    assert following == "trihedron apply turned.json turned.csv --out corrected.csv"
    run(following, capsys)
    faces = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 400, axis=0)
    rows = np.column_stack([np.arange(2400) / 100.0, 9.81 * faces + rng.normal(0.0, 5e-3, (2400, 3))])
    pl.DataFrame(rows, schema=names).write_csv("faces.csv")
    assert next_of(run("trihedron calibrate faces.csv", capsys)) == "trihedron plan hand"
    names[1:1] = ["w1_radps", "w2_radps", "w3_radps"]
    rates = rng.normal(0.0, 1e-3, (3000, 3))
    pl.DataFrame(np.column_stack([time, rates, force]), schema=names).write_csv("static.csv")
    first = next_of(run("trihedron check static.csv", capsys))
    assert first == "trihedron inspect static.csv"
    following = next_of(run(first, capsys))
    assert following == "trihedron noise static.csv --json noise.json"
    run(following, capsys)
    following = next_of(run("trihedron plan hand --noise noise.json", capsys))
    assert following == "trihedron plan hand --noise noise.json --report plan.html"
    run(following, capsys)


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(("file", "colour"), [("clean.csv", "1;32"), ("about.toml", "1;33")])
def test_a_verdict_has_its_colour_on_a_terminal_alone(file: str, colour: str, monkeypatch, capsys):
    cli.main(["check", file])
    plain = capsys.readouterr().out
    assert "\x1b" not in plain
    shown = {}
    for name, value in (("without", ""), ("with", "1")):
        terminal = Terminal()
        monkeypatch.setattr(sys, "stdout", terminal)
        monkeypatch.setenv("NO_COLOR", value)
        monkeypatch.setenv("TERM", "xterm")
        cli.main(["check", file])
        shown[name] = terminal.getvalue()
    verdict, _, _ = plain.partition("\n")
    assert shown["with"] == plain
    assert shown["without"].startswith(f"\x1b[{colour}m{verdict}\x1b[0m")
    assert re.sub(r"\x1b\[[\d;]*m", "", shown["without"]) == plain
    assert "\x1b" not in shown["without"].partition("\n")[2]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    "command", ["calibrate clean.csv --noise-bound 1e-5", "plan hand", "plan target X4 --grid 30", "doctor"]
)
def test_an_answer_keeps_to_80_columns_on_a_terminal(command: str, monkeypatch) -> None:
    terminal = Terminal()
    monkeypatch.setattr(sys, "stdout", terminal)
    for name, value in {"NO_COLOR": "", "TERM": "xterm", "COLUMNS": "80"}.items():
        monkeypatch.setenv(name, value)
    cli.main(command.split())
    shown = re.sub(r"\x1b\[[\d;]*m", "", terminal.getvalue())
    assert [line for line in shown.splitlines() if len(line.rstrip()) > 80] == []
