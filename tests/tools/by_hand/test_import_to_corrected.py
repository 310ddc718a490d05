"""From a phone's log and from a table of six faces to corrected readings, by the commands that a person types."""

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from by_hand import GRAVITY, Instrument
from hand_sessions import FACES, PERIOD, directions
from trihedron.tools.cli import main


def run(*arguments: str) -> int:
    """Return the exit status of a command."""
    return main(list(arguments))


@pytest.mark.acceptance
def test_a_log_of_accelerometers_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng, instrument = np.random.default_rng(1), Instrument(1)
    up = directions(rng, 14)
    force = np.repeat(GRAVITY * up, 300, axis=0)
    reading = instrument.readings(force) + rng.normal(0.0, 0.02, force.shape)
    columns = {f"a{axis} (m/s2)": reading[:, number] for number, axis in enumerate("xyz")}
    pl.DataFrame({"time_s": PERIOD * np.arange(len(reading)), **columns}).write_csv("phone.csv")
    assert run("import", "phone.csv", "--out", "record.csv") == 0
    assert run("calibrate", "record.csv", "--gravity", "9.81", "--json", "phone.json") == 0
    assert run("apply", "phone.json", "record.csv", "--out", "corrected.csv") == 0
    corrected = pl.read_csv("corrected.csv", comment_prefix="#").select("f1_mps2", "f2_mps2", "f3_mps2").to_numpy()
    rests = corrected.reshape(14, 300, 3).mean(axis=1)
    assert np.linalg.norm(rests, axis=1) == pytest.approx(np.full(14, GRAVITY), abs=5e-3)


@pytest.mark.acceptance
def test_a_log_of_phyphox_with_the_size_beside_the_axes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rng, instrument = np.random.default_rng(3), Instrument(3)
    force = np.repeat(GRAVITY * directions(rng, 14), 300, axis=0)
    reading = instrument.readings(force) + rng.normal(0.0, 0.02, force.shape)
    columns = {f"Acceleration {axis} (m/s^2)": reading[:, number] for number, axis in enumerate("xyz")}
    columns["Absolute acceleration (m/s^2)"] = np.linalg.norm(reading, axis=1)
    pl.DataFrame({"Time (s)": PERIOD * np.arange(len(reading)), **columns}).write_csv("phone.csv")
    assert run("import", "phone.csv", "--out", "record.csv") == 0
    assert run("calibrate", "record.csv", "--gravity", "9.81", "--json", "phone.json") == 0
    assert run("apply", "phone.json", "record.csv", "--out", "corrected.csv") == 0
    corrected = pl.read_csv("corrected.csv", comment_prefix="#").select("f1_mps2", "f2_mps2", "f3_mps2").to_numpy()
    rests = corrected.reshape(14, 300, 3).mean(axis=1)
    assert np.linalg.norm(rests, axis=1) == pytest.approx(np.full(14, GRAVITY), abs=5e-3)


def test_a_table_of_six_faces(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    monkeypatch.chdir(tmp_path)
    instrument = Instrument(2)
    up = np.vstack([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    reading = instrument.readings(GRAVITY * up) / 9.80665
    columns = {f"a{axis} [g]": reading[:, number] for number, axis in enumerate("xyz")}
    pl.DataFrame({"face": FACES, **columns}).write_csv("faces.csv")
    assert run("import", "faces.csv", "--out", "record.csv") == 0
    assert run("calibrate", "record.csv", "--json", "faces.json") == 0
    stated = capsys.readouterr().out
    assert "both at 45°" in stated
    assert "from the prior" in stated
    assert run("apply", "faces.json", "record.csv", "--out", "corrected.csv") == 0
    corrected = pl.read_csv("corrected.csv", comment_prefix="#").select("f1_mps2", "f2_mps2", "f3_mps2").to_numpy()
    assert np.linalg.norm(corrected, axis=1) == pytest.approx(np.full(6, 9.80665), abs=2e-2)


def test_columns_that_may_be_gyros_are_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = ("time_s", "ax (m/s2)", "ay (m/s2)", "az (m/s2)", "p", "q", "r")
    rows = np.random.default_rng(3).normal(0.0, 0.1, (40, 7))
    rows[:, 3] += 9.8
    rows[:, 0] = PERIOD * np.arange(40)
    pl.DataFrame(rows, schema=list(names), orient="row").write_csv("log.csv")
    assert run("import", "log.csv", "--out", "record.csv") == 2
    assert not Path("record.csv").exists()


@pytest.mark.first(1)
@pytest.mark.parametrize("head", ["Lage", "Position", "Orientierung"])
def test_a_workbook_whose_positions_are_faces(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, head: str
) -> None:
    xlsxwriter = pytest.importorskip("xlsxwriter", reason="xlsxwriter is not installed")
    monkeypatch.chdir(tmp_path)
    reading = Instrument(4).readings(GRAVITY * np.vstack([np.eye(3), -np.eye(3)])) / 9.80665
    book = xlsxwriter.Workbook("lagen.xlsx")
    sheet = book.add_worksheet()
    sheet.write_row(0, 0, [head, "ax [g]", "ay [g]", "az [g]"])
    for number, face in enumerate(("+X", "+Y", "+Z", "-X", "-Y", "-Z")):
        sheet.write_row(number + 1, 0, [face, *reading[number].tolist()])
    book.close()
    assert run("import", "lagen.xlsx", "--out", "record.csv") == 0
    assert run("calibrate", "record.csv", "--json", "faces.json") == 0
    assert "The axes of the case, by its faces" in capsys.readouterr().out
    assert run("apply", "faces.json", "record.csv", "--out", "corrected.csv") == 0
