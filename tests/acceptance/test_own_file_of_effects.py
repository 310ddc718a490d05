"""A file of the user's own effects: from a hidden effect to its FMUs, and in the processes of a suite."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from trihedron.models.effects import CATALOGUE
from trihedron.tools import cli
from trihedron.tools.orchestrator import read_scenario, simulate_table

pytestmark = pytest.mark.acceptance

GUIDE = Path(__file__).resolve().parents[2] / "docs" / "add-an-effect.md"
(EXAMPLE,) = re.findall(r"```python\n(.*?)```", GUIDE.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.fixture(autouse=True)
def catalogue():
    """Restore the catalogue after each test."""
    before = dict(CATALOGUE)
    yield
    CATALOGUE.clear()
    CATALOGUE.update(before)


def written(folder: Path) -> Path:
    path = folder / "half_scale.py"
    path.write_text(EXAMPLE, encoding="utf-8")
    return path


def test_it_is_hidden_found_shown_and_exported(tmp_path, monkeypatch, capsys):
    """Test from a "measured" record to FMUs that give it again, under its name throughout."""
    monkeypatch.chdir(tmp_path)
    options = ["--effects-from", str(written(tmp_path))]
    assert cli.main(["hidden", "r.csv", "--effect", "half-scale", "--seed", "3", "--answer", "a.json", *options]) == 0
    hidden = json.loads(Path("a.json").read_text())["hidden"]
    assert hidden["effect"] == "half-scale"
    result = ["diagnose", "r.csv", "--noise-bound", "1e-5", "--json", "d.json", "--export", "x", "--report", "d.html"]
    capsys.readouterr()
    assert cli.main([*result, *options]) == 0
    output = json.loads(Path("d.json").read_text())
    assert output["verdict"] == "explained"
    (cause,) = output["causes"]
    assert (cause["effect"], cause["where"]) == ("half-scale", hidden["where"])
    (parameter,) = cause["parameters"]
    assert parameter["low"] <= hidden["parameters"]["coefficient"] <= parameter["high"]
    assert "bends at half of gravity" in " ".join(capsys.readouterr().out.split())
    assert "half-scale" in Path("d.html").read_text(encoding="utf-8")
    run = simulate_table(read_scenario(Path("x") / "scenario.toml")).position_record()
    measured = th.read_record("r.csv")
    assert np.abs(run.specific_force - measured.specific_force).max() / 9.80665 <= 1e-5


def test_the_processes_of_a_suite_know_it(tmp_path, monkeypatch):
    """Two processes give the result of one, and name it in every record."""
    monkeypatch.chdir(tmp_path)
    command = [
        "hidden",
        "--cases",
        "2",
        "--seed",
        "1",
        "--noise",
        "uniform",
        "--effect",
        "half-scale",
        "--positions",
        "30",
        "40",
    ]
    command += ["--effects-from", str(written(tmp_path))]
    for jobs in ("1", "2"):
        assert cli.main([*command, "--jobs", jobs, "--json", f"suite-{jobs}.json"]) == 0
    entry, two = (json.loads(Path(f"suite-{jobs}.json").read_text()) for jobs in ("1", "2"))
    assert entry == two
    assert entry["outcomes"] == {"right": 2}
