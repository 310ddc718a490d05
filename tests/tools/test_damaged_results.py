"""Files of results with one damaged field: matrix, interval, count, unit. Whatever reads them refuses, in one line."""

import json
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import trihedron as th
from by_hand import Instrument
from by_hand import calibration as by_hand
from generator import G
from generator.stands import simulated
from hand_sessions import poses
from trihedron.tools.cli import main

SIGMA = 1e-5


@cache
def of_hand() -> str:
    """Return the calibration of a block in 40 poses, as text."""
    rng = np.random.default_rng(5)
    up = rng.normal(size=(40, 3))
    up /= np.linalg.norm(up, axis=1)[:, None]
    return th.calibrate(poses(Instrument(3), up, rng.normal(0.0, 1e-4, (40, 3)))).json_text()


@cache
def of_table() -> str:
    return th.calibrate(simulated(np.zeros(24)), noise_bound=SIGMA).json_text()


@cache
def of_gyros() -> str:
    """Return a whole unit's calibration by hand, made from the truth."""
    return json.dumps(by_hand(Instrument(3), verdict="usable"))


def damaged(text: str, where: tuple[str | int, ...], value: Any) -> dict[str, Any]:
    """Return a result with another value at a place; a function of the value there may give it."""
    content = json.loads(text)
    at = content
    for key in where[:-1]:
        at = at[key]
    at[where[-1]] = value(at[where[-1]]) if callable(value) else value
    return content


def indefinite(rows: list[list[float]]) -> list[list[float]]:
    """Return a symmetric matrix with the diagonal of a covariance, but with a negative eigenvalue."""
    sd = np.sqrt(np.diag(rows))
    signs = np.eye(9)
    signs[:3, :3] = [[1.0, 0.9, 0.9], [0.9, 1.0, -0.9], [0.9, -0.9, 1.0]]
    return (signs * sd * sd[:, None]).tolist()


def lopsided(rows: list[list[float]]) -> list[list[float]]:
    matrix = np.array(rows)
    matrix[0, 3] += 0.1 * np.sqrt(matrix[0, 0] * matrix[3, 3])
    return matrix.tolist()


COVARIANCE = ("by_hand", "covariance")
FIRST = ("parameters", 0)
DAMAGES = [
    (of_hand, COVARIANCE, indefinite, "negative variance"),
    (of_hand, COVARIANCE, lopsided, "not symmetric"),
    (of_hand, COVARIANCE, lambda rows: rows[:8], "9 rows of 9"),
    (of_hand, COVARIANCE, lambda rows: (-np.array(rows)).tolist(), "negative"),
    (of_hand, (*FIRST, "unit"), "deg", "the unit of gamma_11 is 'deg'"),
    (of_hand, (*FIRST, "standard_error"), -1e-4, "standard_error"),
    (of_hand, ("by_hand", "rests"), -3, "rests"),
    (of_hand, ("by_hand", "pose_error", "direction"), [1.0, 0.0], "direction"),
    (of_table, (*FIRST, "low"), 1.0, "low"),
    (of_table, (*FIRST, "unit"), "deg", "the unit of X1 is 'deg'"),
    (of_table, ("mountings", "identity", 0), [2.0, 0.0, 0.0], "mountings"),
    (of_table, ("positions",), -24, "positions"),
    (of_table, ("positions",), 2.5, "positions"),
    (of_table, ("radius",), -0.5, "radius"),
    (of_table, ("sigma", "value"), 0.0, "sigma"),
    (of_table, ("reading_errors", 0, "low"), 0.9, "low"),
    (of_table, ("reading_errors", 0, "input"), [3, 0, 0], "input|reading_errors"),
    (of_table, ("provenance", "bounds"), [-1.0, 0.01], "bounds"),
    (of_table, ("provenance", "temperature_degC"), [30.0, 20.0], "temperature"),
]


def run(*words: str) -> int:
    return main(list(words))


@pytest.mark.parametrize(("made", "where", "value", "says"), DAMAGES, ids=lambda x: getattr(x, "__name__", None))
def test_each_reader_of_a_calibration_refuses_it_in_one_line(made, where, value, says, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "damaged.json").write_text(json.dumps(damaged(made(), where, value)), encoding="utf-8")
    (tmp_path / "table.csv").write_text("position,f1_mps2,f2_mps2,f3_mps2\n1,0,0,9.8\n2,0,9.8,0\n", encoding="utf-8")
    commands = [
        ("apply", "damaged.json", "table.csv", "--out", "out.csv"),
        ("export-calibration", "damaged.json", "--to", "csv", "--out", "out.csv"),
    ]
    for words in commands:
        assert run(*words) == 2, words
        message = capsys.readouterr().err
        assert message.count("\n") == 1
        assert len(message) < 400
        assert re_found(says, message), message
        assert not (tmp_path / "out.csv").exists()
    assert run("check", "damaged.json") != 0
    assert re_found(says, capsys.readouterr().out)


def re_found(pattern: str, text: str) -> bool:
    return any(part in text for part in pattern.split("|"))


@pytest.mark.parametrize("made", [of_hand, of_table, of_gyros])
def test_what_is_not_damaged_is_read(made, tmp_path):
    path = tmp_path / "right.json"
    path.write_text(made(), encoding="utf-8")
    assert np.isfinite(th.correction(path)([0.1, 0.2, 9.8])).all()


@cache
def explained() -> str:
    """Return the diagnosis of a record whose second accelerometer responds to the square of its input."""
    record = simulated(np.zeros(24))
    force = record.specific_force.copy()
    force[:, 1] += 4e-4 * G * (force[:, 1] / G) ** 2
    return th.diagnose(replace(record, specific_force=force), noise_bound=SIGMA).json_text()


OF_DIAGNOSIS = [
    (("causes", 0, "parameters", 0, "low"), 1.0, "low"),
    (("causes", 0, "parameters", 0, "unit"), "deg", "unit"),
    (("explanations", 0, "numbers"), -1, "numbers"),
    (("calibration", "parameters", 0, "standard_error"), -1.0, "standard_error"),
]


@pytest.mark.acceptance
@pytest.mark.parametrize(("where", "value", "says"), OF_DIAGNOSIS)
def test_each_reader_of_a_diagnosis_refuses_it(where, value, says, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "damaged.json").write_text(json.dumps(damaged(explained(), where, value)), encoding="utf-8")
    (tmp_path / "table.csv").write_text("position,f1_mps2,f2_mps2,f3_mps2\n1,0,0,9.8\n2,0,9.8,0\n", encoding="utf-8")
    assert run("apply", "damaged.json", "table.csv", "--out", "out.csv") == 2
    assert says in capsys.readouterr().err
    assert run("check", "damaged.json") != 0
    assert says in capsys.readouterr().out
