"""Files from the field end as their truth asks; beside each kind, records that the tests make themselves."""

import csv
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest

import trihedron as th
from field_files import field_file
from generator import G
from generator.positions import drawn_record
from trihedron.tools.cli import main
from trihedron.tools.records import write_record

REST = 0.12
"""Seconds of a record count as rest where no accelerometer scatters by more [m/s²]."""


def misses_at_rest(force: np.ndarray, rows: int) -> np.ndarray:
    """Return the error of |f| against gravity [g] in each quiet block of some rows, without the program's rests."""
    blocks = force[: len(force) // rows * rows].reshape(-1, rows, 3)
    quiet = blocks.std(axis=1).max(axis=1) < REST
    return np.linalg.norm(blocks[quiet].mean(axis=1), axis=1) / G - 1.0


def misses_corrected(path: Path, rows: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the misses of gravity at rest [g], as read and as corrected by the record's own calibration."""
    before = th.read_record(path).specific_force
    after = th.apply(th.calibrate(path), path).record.specific_force
    assert before is not None
    assert after is not None
    return misses_at_rest(before, rows), misses_at_rest(after, rows)


@pytest.mark.acceptance
@pytest.mark.parametrize(("name", "rows"), [("acc_only.csv", 100), ("real_acc_only.csv", 25)])
def test_field_accelerometers_alone_read_gravity_once_corrected(name: str, rows: int, tmp_path: Path) -> None:
    th.import_record(field_file(name, tmp_path), out=tmp_path / "record.csv")
    before, after = misses_corrected(tmp_path / "record.csv", rows)
    assert len(after) > 20
    assert np.square(after).mean() < 2e-3**2 < 0.1 * np.square(before).mean()
    assert main(["inspect", str(tmp_path / "record.csv")]) == 2


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "names", ["time_s,ax (m/s2),ay (m/s2),az (m/s2)", "Time [s];Acc x [m/s^2];Acc y [m/s^2];Acc z [m/s^2]"]
)
def test_accelerometers_alone_read_gravity_once_corrected(names: str, tmp_path: Path) -> None:
    rng = np.random.default_rng(len(names))
    poses = rng.standard_normal((24, 3))
    poses *= G / np.linalg.norm(poses, axis=1)[:, None]
    gain, bias = np.array([1.02, 0.985, 1.04]), np.array([0.1, -0.3, 0.25])
    force = np.repeat(poses, 200, axis=0) * gain + bias + 0.005 * rng.standard_normal((4800, 3))
    mark = ";" if ";" in names else ","
    lines = [names]
    for k, row in enumerate(force.tolist()):
        lines.append(mark.join([f"{0.01 * k:.2f}", *(f"{value:.6f}" for value in row)]))
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    th.import_record(tmp_path / "log.csv", out=tmp_path / "record.csv")
    before, after = misses_corrected(tmp_path / "record.csv", 200)
    assert np.abs(after).max() < 2e-4 < 0.01 * np.abs(before).max()


def turned_angles(record: Any, period: float) -> list[float]:
    """Return the angle of each motion of more than 200° about one axis [deg]."""
    rate = np.degrees(record.rate)
    moving = np.convolve(np.abs(rate).max(axis=1) > 40.0, np.ones(60), "same") > 0
    ends = np.flatnonzero(np.diff(np.concatenate([[0], moving, [0]])))
    angles = []
    for first, last in zip(ends[::2], ends[1::2], strict=True):
        largest = float(np.abs(rate[first:last].sum(axis=0)).max()) * period
        if largest > 200.0:
            angles.append(largest)
    return angles


@pytest.mark.acceptance
def test_field_six_poses_and_three_turns_have_numbers(tmp_path: Path) -> None:
    """The turns are whole ones: corrected gyros say so."""
    path = field_file("ferraris_lab.csv", tmp_path)
    record = tmp_path / "record.csv"
    answers = {"units.time": "102.4 Hz", "units.rate": "deg/s", "units.force": "m/s2"}
    th.import_record(path, out=record, answers=answers)
    calibration = th.calibrate(record)
    assert calibration.verdict == "insufficient"
    assert all(parameter.estimate is not None for parameter in calibration.parameters)
    assert len(calibration.open) == 3
    assert calibration.by_hand is not None
    gain = calibration.by_hand.gain
    assert gain is not None
    assert gain.move_after is not None
    assert gain.move_before is not None
    assert gain.move_after < 0.5 * gain.move_before
    angles = turned_angles(th.apply(calibration, record).record, 1.0 / 102.4)
    assert angles == pytest.approx([360.0] * 3, abs=3.0)
    # another rate than the logger's is not a wrong range: the line names both
    th.import_record(path, out=tmp_path / "slow.csv", answers=answers | {"units.time": "51.2 Hz"})
    with pytest.raises(th.InputError, match="wrong range setting") as refusal:
        th.calibrate(tmp_path / "slow.csv")
    assert "sampling rate" in str(refusal.value)


@pytest.mark.acceptance
def test_field_gyros_that_all_err_by_one_function_prove_nothing(tmp_path: Path) -> None:
    """All gyros err by f1² - f2²: no function of the force along each gyro is proven."""
    diagnosis = th.diagnose(field_file("g05gg.csv", tmp_path))
    assert diagnosis.verdict in ("unexplained", "ambiguous")
    assert diagnosis.proven is None or diagnosis.proven.quantity is None


@pytest.mark.acceptance
def test_field_sag_and_product_at_the_edge_are_named_without_a_third_effect(tmp_path: Path) -> None:
    diagnosis = th.diagnose(field_file("p07_sgo_cp3_100.csv", tmp_path), noise_bound=1e-5)
    assert diagnosis.verdict == "explained"
    assert {(cause.effect, cause.where) for cause in diagnosis.causes} == {
        ("cross-product", "accelerometer-3"),
        ("sag", "outer-axis"),
    }


@pytest.mark.parametrize(
    ("calibration", "record", "reasons"),
    [
        ("p_t21.json", "p_t60.csv", ["measured at 60 °C"]),
        ("p_sA.json", "p_sB.csv", ["block 'XY-99'", "measured at 60 °C"]),
    ],
)
def test_field_calibrations_of_another_day_or_block_guarantee_nothing(
    calibration: str, record: str, reasons: list[str], tmp_path: Path
) -> None:
    path = field_file(record, tmp_path)
    applied: Any = th.apply(field_file(calibration, tmp_path), path)
    for reason in reasons:
        assert any(reason in line for line in applied.not_guaranteed)
    assert "not guaranteed" in str(applied)
    assert ", guaranteed" not in str(applied)


@pytest.mark.acceptance
def test_field_scale_factors_lie_in_the_intervals_of_corrected_records(tmp_path: Path) -> None:
    script = field_file("correct-then-calibrate.py", tmp_path)
    process = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=3600)
    assert process.returncode == 0, process.stderr
    assert process.stdout.count("'IN'") == 16, process.stdout
    assert "OUT" not in process.stdout


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("parent", "child"),
    [
        ("attitude", "inspect"),
        *(
            pytest.param(p, c, marks=pytest.mark.acceptance)
            for p, c in (("inspect", "attitude"), ("attitude", "attitude"))
        ),
    ],
)
def test_field_forked_child_works_or_says_why_not(parent: str, child: str, tmp_path: Path) -> None:
    script = field_file("fork_hang.py", tmp_path)
    (tmp_path / "in").mkdir()
    drawn = drawn_record(3, count=24)
    write_record(drawn, tmp_path / "in" / "p_ok.csv")
    rest = {"time_s": 0.01 * np.arange(3000.0)}
    for name in ("w1_radps", "w2_radps", "w3_radps", "f1_mps2", "f2_mps2"):
        rest[name] = np.zeros(3000)
    rest["f3_mps2"] = G + 1e-3 * np.sin(np.arange(3000.0))
    pl.DataFrame(rest).write_csv(tmp_path / "in" / "q_ok.csv")
    command = [sys.executable, str(script), parent, child]
    process = subprocess.run(command, capture_output=True, text=True, timeout=240, cwd=tmp_path)
    assert "HANGS" not in process.stdout
    assert "exit 0" in process.stdout or "polars has lost its threads" in process.stderr


LOGS = {
    "real_header_adis.csv": (
        {"units.time": "100 Hz", "units.force": "1/800 g", "units.rate": "0.05 deg/s"},
        ("X_ACCL_OUT", "Y_ACCL_OUT", "Z_ACCL_OUT"),
        ("X_GYRO_OUT", "Y_GYRO_OUT", "Z_GYRO_OUT"),
        (G / 800.0, np.radians(0.05)),
    ),
    "real_header_blackbox.csv": (
        {"columns.time_s": "time", "units.time": "us", "units.force": "1/2048 g", "units.rate": "deg/s"},
        ("accSmooth[0]", "accSmooth[1]", "accSmooth[2]"),
        ("gyroADC[0]", "gyroADC[1]", "gyroADC[2]"),
        (G / 2048.0, np.radians(1.0)),
    ),
    "real_header_px4.csv": (
        {"columns.time_s": "timestamp", "units.time": "us", "units.force": "m/s2", "units.rate": "rad/s"},
        ("accelerometer_m_s2[0]", "accelerometer_m_s2[1]", "accelerometer_m_s2[2]"),
        ("gyro_rad[0]", "gyro_rad[1]", "gyro_rad[2]"),
        (1.0, 1.0),
    ),
    "real_header_rocket.csv": (
        {"columns.time_s": "timestamp_seconds", "units.time": "s", "units.force": "g", "units.rate": "deg/s"},
        tuple(f"raw_acceleration_{axis}_gs" for axis in "xyz"),
        tuple(f"raw_angular_rate_{axis}_deg_per_s" for axis in "xyz"),
        (G, np.radians(1.0)),
    ),
    "real_header_rostopic.csv": (
        {"columns.time_s": "%time", "units.time": "ns", "units.force": "m/s2", "units.rate": "rad/s"},
        tuple(f"field.linear_acceleration.{axis}" for axis in "xyz"),
        tuple(f"field.angular_velocity.{axis}" for axis in "xyz"),
        (1.0, 1.0),
    ),
    "real_two_accelerometers.csv": (
        {"columns.time_s": "TIME", "units.time": "us", "units.force": "m/s2", "units.rate": "rad/s"},
        ("ACCEL_BMI160_0", "ACCEL_BMI160_1", "ACCEL_BMI160_2"),
        ("GYRO_0", "GYRO_1", "GYRO_2"),
        (1.0, 1.0),
    ),
}
"""File -> answers, columns of the accelerometers and gyros, their units [m/s²], [rad/s]."""


def assert_read(path: Path, name: str, folder: Path) -> None:
    """Assert that a log with its answers is a record of the file's own numbers, and that none is guessed without."""
    answers, forces, rates, (force_unit, rate_unit) = LOGS[name]
    answers = dict(answers)
    for k, column in enumerate(forces, start=1):
        answers[f"columns.f{k}_mps2"] = column
    for k, column in enumerate(rates, start=1):
        answers[f"columns.w{k}_radps"] = column
    text = path.read_text(encoding="utf-8")
    rows = list(csv.DictReader(text.splitlines(), delimiter=";" if ";" in text.splitlines()[0] else ","))
    th.import_record(path, out=folder / "record.csv", answers=answers)
    record: Any = th.read_record(folder / "record.csv")
    written = np.array([[float(row[column]) for column in forces] for row in rows])
    assert record.specific_force == pytest.approx(force_unit * written, rel=1e-8, abs=1e-8)
    written = np.array([[float(row[column]) for column in rates] for row in rows])
    assert record.rate == pytest.approx(rate_unit * written, rel=1e-8, abs=1e-9)
    guessed, refusal = imported_without_answers(path)
    if guessed is None:
        assert "\n" not in refusal
        assert re.search(r"--set |--as |--from ", refusal)
    else:
        assert guessed.specific_force == pytest.approx(record.specific_force)


def imported_without_answers(path: Path) -> tuple[Any, str]:
    """Return the record of a file's import without answers, or None and the refusal."""
    try:
        return th.import_record(path).record, ""
    except th.InputError as error:
        return None, str(error)


@pytest.mark.first(3)
@pytest.mark.parametrize("name", LOGS)
def test_field_logs_keep_their_numbers_and_none_is_guessed(name: str, tmp_path: Path) -> None:
    assert_read(field_file(name, tmp_path), name, tmp_path)


@pytest.mark.first(1)
@pytest.mark.parametrize("name", LOGS)
def test_logs_with_the_names_of_tools_keep_their_numbers(name: str, tmp_path: Path) -> None:
    """The same names over numbers of our own."""
    answers, forces, rates, (force_unit, rate_unit) = LOGS[name]
    rng = np.random.default_rng(11)
    time = answers.get("columns.time_s")
    step = {"us": 10_000, "ns": 10_000_000, "s": 0.01}.get(answers["units.time"], 1)
    mark = ";" if name == "real_two_accelerometers.csv" else ","
    others = ("ACCEL_ADXL355_0", "ACCEL_ADXL355_1", "ACCEL_ADXL355_2") if mark == ";" else ()
    head = [*([time] if time else []), *rates, *others, *forces]
    lines = [mark.join(head)]
    for row in range(60):
        rate = np.round(0.02 / rate_unit * rng.standard_normal(len(rates)), 3)
        force = rng.standard_normal((2, 3))
        force = np.round(G / force_unit * force / np.linalg.norm(force, axis=1)[:, None], 3)
        cells = [*rate, *force[0][: len(others)], *force[1]]
        lines.append(mark.join(map(str, [*([row * step] if time else []), *cells])))
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    assert_read(tmp_path / "log.csv", name, tmp_path)
