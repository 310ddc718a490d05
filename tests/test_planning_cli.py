"""`trihedron plan` and `trihedron reproduce`: files out, wrong options in one line."""

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest

from trihedron.models.regressors import regressors
from trihedron.tools.calibration.model import parametrise
from trihedron.tools.cli import main


def test_one_target_with_its_files(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = {name: tmp_path / f"x4.{name}" for name in ("json", "svg", "html")}
    options = ["plan", "--target", "X4", "--admissible", "tables", "--json", str(files["json"])]
    options += ["--picture", str(files["svg"]), "--report", str(files["html"])]
    assert main(options) == 0
    assert "2.0549378711 σ" in capsys.readouterr().out
    plan = json.loads(files["json"].read_text(encoding="utf-8"))
    assert (plan["schema"], plan["target"], plan["grid_deg"]) == ("trihedron.plan/1", "X4", 1)
    assert plan["cost"] == pytest.approx(2.0549378711, abs=1e-9)
    assert 0 <= plan["gap"] < 1e-9
    assert sum(abs(row["weight"]) for row in plan["weights"]) == pytest.approx(plan["cost"], rel=1e-12)
    angles = np.radians([[row["alpha_deg"], row["beta_deg"]] for row in plan["weights"]])
    f = regressors(angles[:, 0], angles[:, 1], np.eye(3))
    total = sum(row["weight"] * f[k, row["accelerometer"] - 1] for k, row in enumerate(plan["weights"]))
    np.testing.assert_allclose(total, np.eye(18)[3], atol=1e-12)
    assert ElementTree.fromstring(files["svg"].read_text(encoding="utf-8")).tag.endswith("svg")
    assert "2.0549378711" in files["html"].read_text(encoding="utf-8")
    before = {name: path.read_bytes() for name, path in files.items()}
    assert main(options) == 0
    assert {name: path.read_bytes() for name, path in files.items()} == before


def test_all_targets_of_a_convention(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "all.json"
    assert main(["plan", "--grid", "6", "--convention", "A2", "--mounting", "tripod", "--json", str(out)]) == 0
    plans = json.loads(out.read_text(encoding="utf-8"))["plans"]
    assert len(plans) == 18
    assert plans[9]["target"] == "(X6+X8)/2"
    assert set(plans[0]["dual"]) == set(parametrise({"tripod": np.eye(3)}).symbols)
    assert len(capsys.readouterr().out.splitlines()) == 21


def test_a_target_that_begins_with_a_hyphen(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plan", "--target", "-X12", "--grid", "10"]) == 0
    assert "mounting-error-2" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--grid", "1", "--continuum"], "--grid and --continuum"),
        (["--grid", "-1"], "--grid -1"),
        (["--target", "X19"], "there is no X19"),
        (["--target", "X4+1"], "constant term"),
        (["--grid", "90"], "cannot determine"),
        (["--mounting", "tripot"], "tripod"),
        (["--bounds", "-1", "0.01"], "--bounds -1"),
        (["--bounds", "0.1", "0.6", "--admissible", "tables"], "no position"),
        (["--picture", "plan.svg"], "--picture"),
        (["--admissible", "both"], "admissible"),
        (["--convention", "A3"], "convention"),
        (["--baseline", "symmetric", "--target", "X5"], "symmetric baseline has no X5"),
        (["--json", "same", "--report", "same"], "same"),
    ],
)
def test_wrong_options_are_said_in_one_line(
    options: list[str], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["plan", *options]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert said in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("matrix", "said"),
    [
        ("[a]\nmatrix = [[1,0,0],[0,1,0],[0,0,1]]\n[b]\nmatrix = [[0,1,0],[0,0,1],[1,0,0]]\n", "2 mountings"),
        ("[a]\nmatrix = [[1,0,0],[0,1.1,0],[0,0,1]]\n", "not orthogonal"),
        ("[a]\nmatrix = [[1,0,0],[0,1,0],[0,0,-1]]\n", "reflection"),
    ],
)
def test_mountings_that_cannot_be_used(
    matrix: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mounting.toml"
    path.write_text(matrix, encoding="utf-8")
    assert main(["plan", "--mounting", str(path)]) == 2
    assert said in capsys.readouterr().err


def test_the_published_tables_and_their_errors(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reproduce", "calibration"]) == 0
    out = capsys.readouterr().out
    assert "X3: the accuracy is printed as 1.00; its own weights give 1.0311" in out
    assert "X12: the weights estimate -X12" in out
    assert "18 of the 18 optima are lower" in out
