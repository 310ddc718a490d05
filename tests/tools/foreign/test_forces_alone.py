"""Accelerometers alone, gyros alone, and counts whose zero is the middle of a converter's range."""

import os
import threading
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from laboratory_imports import imported, questions_of, refused, written
from trihedron.tools.cli import main

G = 9.80665
ROWS = 300
rng = np.random.default_rng(47)
TIMES = 0.01 * np.arange(ROWS)
FORCE = np.array([0.1, 0.2, 9.79]) + rng.normal(0.0, 0.02, (ROWS, 3))
RATE = rng.normal(0.0, 0.01, (ROWS, 3))
FIELD = np.array([20.0, 5.0, -40.0]) + rng.normal(0.0, 0.5, (ROWS, 3))


def table_of(head: str, *columns: np.ndarray, decimals: int = 6) -> str:
    """Return a CSV file of columns, each (N,) or (N, k), below a head."""
    lines = [head]
    for row in np.column_stack(columns).tolist():
        lines.append(",".join(f"{value:.{decimals}f}" for value in row))
    return "\n".join(lines) + "\n"


def channels(record: Any, pattern: str) -> np.ndarray:
    """Return three columns of a record (N, 3)."""
    columns = record.columns()
    return np.column_stack([columns[pattern.format(k)] for k in (1, 2, 3)])


PHONE = table_of("time,seconds_elapsed,z,y,x", 1.7e18 + 1e9 * TIMES, TIMES, FORCE[:, ::-1])


def test_a_log_of_a_phone_with_accelerometers_alone_needs_no_answer(tmp_path: Path):
    result = imported(tmp_path, PHONE, name="TotalAcceleration.csv")
    assert result.kind == "accelerometer record"
    assert [column.source for column in result.columns] == ["seconds_elapsed", "x", "y", "z"]
    np.testing.assert_allclose(channels(result.record, "f{}_mps2"), FORCE, atol=1e-6)
    assert any("x,y,z are taken as accelerometers" in note for note in result.notes)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("name", "readings"), [("Gravity.csv", FORCE), ("Gyroscope.csv", RATE), ("Magnetometer.csv", FIELD)]
)
def test_other_logs_of_a_phone_are_not_taken_for_accelerometers(name: str, readings: np.ndarray, tmp_path: Path):
    log = table_of("time,seconds_elapsed,z,y,x", 1.7e18 + 1e9 * TIMES, TIMES, readings[:, ::-1])
    keys, _ = questions_of(written(tmp_path, log, name))
    assert keys == {"columns.force"}


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("head", "columns", "keys"),
    [
        ("t,x,y,z", (TIMES, FORCE), {"columns.force", "units.time", "units.force"}),
        ("time,ax,ay,az,mx,my,mz", (TIMES, FORCE, FIELD), {"units.time", "units.force"}),
        ("time,acc_x,acc_y,acc_z,magx,magy,magz", (TIMES, FORCE, FIELD), {"units.time", "units.force"}),
        (
            "timestamp,seconds,raw_acc_x,raw_acc_y,raw_acc_z",
            (1.7e9 + TIMES, TIMES, FORCE),
            {"columns.time_s", "units.force"},
        ),
        ("time,AccelX,AccelY,AccelZ,pressure,humidity", (TIMES, FORCE, FIELD[:, :2]), {"units.time", "units.force"}),
    ],
)
def test_nothing_is_asked_of_gyros_or_angles_that_no_column_can_be(
    head: str, columns: tuple[np.ndarray, ...], keys: set[str], tmp_path: Path
):
    open_keys, message = questions_of(written(tmp_path, table_of(head, *columns)))
    assert open_keys == keys, message


@pytest.mark.acceptance
def test_accelerometers_without_a_time_are_one_round_of_questions(tmp_path: Path):
    keys, message = questions_of(written(tmp_path, table_of("x,y,z", FORCE)))
    assert keys == {"kind", "columns.force", "units.time", "units.force"}
    assert "--set 'kind=accelerometer record' or" in message
    answers = {"kind": "accelerometer record", "columns.force": "x,y,z", "units.time": "100 Hz", "units.force": "m/s2"}
    assert imported(tmp_path, table_of("x,y,z", FORCE), answers).rows == ROWS


@pytest.mark.parametrize("head", ["time,gyro_x,gyro_y,gyro_z", "time,Gyr X (rad/s),Gyr Y (rad/s),Gyr Z (rad/s)"])
def test_gyros_alone_are_refused_with_what_is_missing(head: str, tmp_path: Path):
    message = refused(tmp_path, table_of(head, TIMES, RATE))
    assert "holds gyros alone; a record needs three accelerometers" in message


@pytest.mark.first(1)
@pytest.mark.parametrize(("bits", "counts_per_g"), [(10, 67), (10, 128), (12, 1024), (16, 16384), (24, 1677721)])
def test_a_zero_in_the_middle_of_the_range_is_asked_first(bits: int, counts_per_g: int, tmp_path: Path):
    faces = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 50, axis=0)
    counts = np.round(2.0 ** (bits - 1) + counts_per_g * faces + rng.normal(0.0, 0.5, faces.shape))
    text = table_of("time [s],ax,ay,az", TIMES, counts, decimals=2)
    keys, message = questions_of(written(tmp_path, text))
    assert keys == {"units.force", "integers"}
    assert f"--set 'integers=offset {bits}' or --set integers=unsigned" in message
    assert "--set 'units.force=" in message
    assert f"{counts_per_g} LSB/g' or" in message
    result = imported(tmp_path, text, {"integers": f"offset {bits}", "units.force": f"{counts_per_g} LSB/g"})
    np.testing.assert_allclose(
        channels(result.record, "f{}_mps2"),
        (counts - 2.0 ** (bits - 1)) * G / counts_per_g,
        rtol=1e-9,
        atol=1e-9,
    )


@pytest.mark.acceptance
def test_the_zero_of_counts_is_theirs_alone(tmp_path: Path):
    counts = np.round(32768.0 + 16384.0 * np.tile([0.0, 0.0, 1.0], (ROWS, 1)) + rng.normal(0.0, 3.0, (ROWS, 3)))
    head = "time [s],ax,ay,az,wx [rad/s],wy [rad/s],wz [rad/s]"
    answers = {"integers": "offset 16", "units.force": "16384 LSB/g"}
    record = imported(tmp_path, table_of(head, TIMES, counts, RATE), answers).record
    np.testing.assert_allclose(channels(record, "w{}_radps"), RATE, atol=1e-6)
    assert abs(float(np.median(record.columns()["f3_mps2"])) - G) < 0.01
    unsigned = imported(tmp_path, table_of(head, TIMES, counts, RATE), answers | {"integers": "unsigned"})
    assert any("|f| is about 4.1" in note for note in unsigned.notes)


@pytest.mark.acceptance
def test_counts_outside_the_bits_of_their_zero_are_refused(tmp_path: Path):
    counts = np.round(32768.0 + 16384.0 * np.tile([0.0, 0.0, 1.0], (ROWS, 1)))
    message = refused(
        tmp_path,
        table_of("time [s],ax,ay,az", TIMES, counts),
        {"integers": "offset 10", "units.force": "128 LSB/g"},
    )
    assert "integers = 'offset 10'" in message
    assert "not from 0 to 1023" in message


def test_the_counts_of_the_field_are_proposed_with_their_zero(tmp_path: Path):
    keys, message = questions_of(field_file("counts.csv", tmp_path))
    assert keys == {"units.force", "integers"}
    assert "--set 'units.force=16384 LSB/g' or" in message
    assert "--set 'integers=offset 16' or" in message


def test_a_pipe_in_place_of_the_mapping_is_refused(tmp_path: Path, capsys):
    log, out = written(tmp_path, PHONE, "phone.csv"), tmp_path / "out.csv"
    os.mkfifo(tmp_path / "out.import.toml")
    assert main(["import", str(log), "--out", str(out)]) == 2
    printed = capsys.readouterr().err.splitlines()
    assert len(printed) == 1
    assert "out.import.toml: is not a regular file" in printed[0]
    assert not out.exists()
    with pytest.raises(th.InputError, match="not a regular file"):
        th.import_record(log, out=out)


@pytest.mark.first(1)
@pytest.mark.parametrize("name", ["log.csv", "log.xlsb", "log.csv.gz", "log.mat", "log.bag", "log.mcap"])
@pytest.mark.parametrize("read", [th.import_record, partial(th.batch, do="noise", out="out")])
def test_a_pipe_in_place_of_a_log_is_refused_and_not_waited_for(read, name: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    os.mkfifo(tmp_path / name)
    refusals = []

    def wait():
        try:
            read(tmp_path / name)
        except th.InputError as error:
            refusals.append(str(error))

    reading = threading.Thread(target=wait, daemon=True)
    reading.start()
    reading.join(60.0)
    assert len(refusals) == 1
    assert "is not a regular file" in refusals[0]


@pytest.mark.first(1)
@pytest.mark.parametrize("filler", ["-9999", "999", "-9999.0"])
@pytest.mark.parametrize(("unit", "size"), [("rad/s", 1.0), ("deg/h", 206264.8)])
def test_numbers_for_missing_readings_are_asked(filler: str, unit: str, size: float, tmp_path: Path):
    head = f"time [s],ax [g],ay [g],az [g],wx [{unit}],wy [{unit}],wz [{unit}]"
    lines = table_of(head, TIMES, FORCE / G, (0.3 + RATE) * size).splitlines()
    cells = lines[101].split(",")
    lines[101] = ",".join([*cells[:5], filler, cells[6]])
    text = "\n".join(lines)
    keys, message = questions_of(written(tmp_path, text))
    assert keys == {"missing"}
    assert f"--set missing={filler} or --set missing=none" in message
    assert imported(tmp_path, text, {"missing": filler}).rows == ROWS - 1
    assert imported(tmp_path, text, {"missing": "none"}).rows == ROWS


def test_whole_counts_of_999_are_counts(tmp_path: Path):
    counts = np.round(700.0 + 300.0 * np.sin(TIMES[:, None] * [3.0, 5.0, 7.0]))
    counts[10] = 999.0
    answers = {"units.force": "1024 LSB/g"}
    assert imported(tmp_path, table_of("time [s],ax,ay,az", TIMES, counts, decimals=2), answers).rows == ROWS
