"""Texts with a label before each number, as serial monitors show them, and the text log of ArduPilot."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from laboratory_imports import imported, questions_of, refused, written
from tool_files import COUNT, DEGREES, FORCE, MICROS, MILLIS, RATE, TIME, clock

RATE_100 = {"units.time": "100 Hz"}
UNITS = {"units.force": "m/s2", "units.rate": "rad/s"}
COUNTS, TURNS = np.round(FORCE / 9.80665 * 16384), np.round(DEGREES * 131)
ONE_LINE = "ax:{} ay:{} az:{} gx:{} gy:{} gz:{}\n"
ADAFRUIT = "Acceleration X: {}, Y: {}, Z: {} m/s^2\nRotation X: {}, Y: {}, Z: {} rad/s\nTemperature: 24.5 degC\n\n"
ROSTOPIC = (
    'header: \n  seq: {k}\n  stamp: \n    secs: 1583000000\n    nsecs: {k}0000000\n  frame_id: "imu"\n'
    "orientation: \n  x: 0.0\n  y: 0.0\n  z: 0.0\n  w: 1.0\norientation_covariance: [-1.0, 0.0, 0.0, 0.0]\n"
    "angular_velocity: \n  x: {w[0]}\n  y: {w[1]}\n  z: {w[2]}\nangular_velocity_covariance: [0.0, 0.0, 0.0]\n"
    "linear_acceleration: \n  x: {a[0]}\n  y: {a[1]}\n  z: {a[2]}\n---\n"
)
ROS2 = (
    "header:\n  stamp:\n    sec: 1700000000\n    nanosec: {k}0000000\n  frame_id: imu_link\n"
    "angular_velocity:\n  x: {w[0]}\n  y: {w[1]}\n  z: {w[2]}\nangular_velocity_covariance:\n- 0.0\n- 0.0\n- 0.0\n"
    "linear_acceleration:\n  x: {a[0]}\n  y: {a[1]}\n  z: {a[2]}\n---\n"
)


def samples(form: str, columns: np.ndarray | None = None) -> str:
    """Return a text with these labels around each row of numbers."""
    rows = np.hstack([FORCE, RATE]) if columns is None else columns
    return "".join(form.format(*row) for row in rows.tolist())


TEXTS: dict[str, tuple[str, dict[str, str]]] = {
    "one line": (samples(ONE_LINE), RATE_100 | UNITS),
    "with the time of its board": (
        samples("t=0s, " + ONE_LINE).replace("t=0s", "{}").format(*(f"t={t}" for t in MILLIS)),
        {"units.time": "ms"} | UNITS,
    ),
    "decimal commas": (samples(ONE_LINE).replace(".", ","), RATE_100 | UNITS),
    "a dictionary": (samples("{{'ax': {}, 'ay': {}, 'az': {}, 'gx': {}, 'gy': {}, 'gz': {}}}\n"), RATE_100 | UNITS),
    "lists": (samples("A: {}, {}, {} m/s^2\nG: {}, {}, {} rad/s\nM: 0.1, 0.2, 0.3 gauss\n\n"), RATE_100),
    "parentheses": (samples("a=({}, {}, {}) w=({}, {}, {})\n"), RATE_100 | UNITS),
    "Adafruit MPU6050": ("Adafruit MPU6050 test!\nFilter bandwidth set to: 21 Hz\n\n" + samples(ADAFRUIT), RATE_100),
    "Adafruit LSM6DS": (
        samples(
            "\t\tTemperature 25.31 deg C\n\t\tAccel X: {} \tY: {} \tZ: {} m/s^2 \n"
            "\t\tGyro X: {} \tY: {} \tZ: {} radians/s \n\n"
        ),
        RATE_100,
    ),
    "Adafruit BNO055": (
        samples(
            "Accl:\tx= {} |\ty= {} |\tz= {}\nGyro:\tx= {} |\ty= {} |\tz= {}\n"
            "Calibration: Sys=0 Gyro=3 Accel=0 Mag=0\n--\n"
        ),
        RATE_100 | UNITS,
    ),
    "SparkFun LSM6DS3": (
        samples("\nAccelerometer:\n X = {}\n Y = {}\n Z = {}\n\nGyroscope:\n X = {}\n Y = {}\n Z = {}\n"),
        RATE_100 | UNITS,
    ),
    "Teleplot": (samples(">ax:{}\n>ay:{}\n>az:{}\n>gx:{}\n>gy:{}\n>gz:{}\n"), RATE_100 | UNITS),
    "a tutorial of the GY-521": (
        samples(
            "AcX = {:.0f} | AcY = {:.0f} | AcZ = {:.0f} | Tmp = 24.5 | GyX = {:.0f} | GyY = {:.0f} | GyZ = {:.0f}\n",
            np.hstack([COUNTS, TURNS]),
        ),
        RATE_100 | {"units.force": "16384 LSB/g", "units.rate": "131 LSB/(deg/s)"},
    ),
    "rostopic echo": (
        "".join(ROSTOPIC.format(k=k, w=RATE[k].tolist(), a=FORCE[k].tolist()) for k in range(COUNT)),
        UNITS,
    ),
    "ros2 topic echo": (
        "".join(ROS2.format(k=k, w=RATE[k].tolist(), a=FORCE[k].tolist()) for k in range(COUNT)),
        UNITS,
    ),
    "mavlogdump": (
        "".join(
            f"2026-03-17 {at[:-4]}: IMU {{TimeUS : {time}, I : 0, GyrX : {w[0]}, GyrY : {w[1]}, GyrZ : {w[2]}, "
            f"AccX : {a[0]}, AccY : {a[1]}, AccZ : {a[2]}, T : 31.5}}\n"
            for at, time, w, a in zip(clock("%H:%M:%S.%f"), MICROS, RATE.tolist(), FORCE.tolist(), strict=True)
        ),
        {},
    ),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", TEXTS)
def test_labels_become_columns_with_one_round_of_questions(name: str, tmp_path: Path):
    text, answers = TEXTS[name]
    path = written(tmp_path, text, "log.txt")
    if answers:
        keys, message = questions_of(path)
        assert keys == set(answers), message
        for key, answer in answers.items():
            assert re.search(rf"--set '?{key}={re.escape(answer)}'?( or | \()", message), message
    record = th.import_record(path, answers=answers).record
    is_counted = "LSB" in answers.get("units.force", "")
    assert record.specific_force == pytest.approx(COUNTS / 16384 * 9.80665 if is_counted else FORCE, abs=1e-12)
    assert record.rate == pytest.approx(np.radians(TURNS / 131) if is_counted else RATE, abs=1e-12)
    assert record.time_s - record.time_s[0] == pytest.approx(TIME, abs=1e-9)


def stamped(text: str) -> str:
    """Return a text as the monitor of the Arduino IDE stamps its lines."""
    blocks, mark = text.split("\n\n"), " -> "
    times = [time[:-3] for time in clock("%H:%M:%S.%f")]
    return "".join(
        f"{t}{mark}{line}\n" for t, block in zip(times, blocks, strict=False) for line in [*block.split("\n"), ""]
    )


def without_line(text: str) -> str:
    lines = text.split("\n")
    return "\n".join([*lines[:40], *lines[41:]])


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        (stamped, None),
        (lambda text: text[text.index("Y") :], 0),
        (without_line, 10),
        (lambda text: text[: text.rindex("Rotation") + 20], COUNT - 1),
        (lambda text: text.replace("Y", "?", 1), 0),
    ],
    ids=["stamped", "begun within a sample", "a line is lost", "cut short", "a damaged line"],
)
def test_a_sample_never_takes_a_line_of_its_neighbour(change: Callable[[str], str], lost: int | None, tmp_path: Path):
    answers = {} if lost is None else RATE_100
    record = imported(tmp_path, change(samples(ADAFRUIT)), answers).record
    kept = np.arange(COUNT) if lost is None else np.delete(np.arange(COUNT), lost)
    assert record.specific_force == pytest.approx(FORCE[kept], abs=1e-12)
    assert record.rate == pytest.approx(RATE[kept], abs=1e-12)
    assert np.diff(record.time_s) == pytest.approx(np.diff(TIME[kept]), abs=1e-9)


def test_a_label_with_two_units_is_refused_by_its_row(tmp_path: Path):
    text = samples(
        "ax: {} m/s2 ay: {} m/s2 az: {} m/s2 t: {}\nax: 1 g ay: 1 g az: 1 g t: 1\n", np.hstack([FORCE, RATE])
    )
    assert "row 2: 'ax' is in 'm/s2' before; one unit for a label is needed" in refused(tmp_path, text)


FORMATS = """FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns
FMT, 12, 40, PARM, QNff, TimeUS,Name,Value,Default
FMT, 30, 60, IMU, QBfffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T
FMT, 32, 60, VIBE, QBfff, TimeUS,IMU,VibeX,VibeY,VibeZ
PARM, 1000, INS_ACC_ID, 1, 0
"""


def flight(count: int) -> str:
    """Return a text log with some sensors; each further one reads 1 rad/s more."""
    lines = [FORMATS.rstrip()]
    for time, w, a in zip(MICROS, RATE.tolist(), FORCE.tolist(), strict=True):
        for k in range(count):
            lines.append(f"IMU, {time}, {k}, {w[0] + k:.6f}, {w[1]}, {w[2]}, {a[0]}, {a[1]}, {a[2]}, 31.5")
        lines.append(f"VIBE, {time}, 0, 0.1, 0.2, 0.3")
    return "\r\n".join(lines) + "\r\n"


def test_a_text_log_of_ardupilot_needs_no_answer(tmp_path: Path):
    record = imported(tmp_path, flight(1), name="flight.log").record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
    assert record.rate == pytest.approx(RATE, abs=1e-12)
    assert record.time_s == pytest.approx(5.0 + TIME, abs=1e-9)


def test_one_of_several_sensors_of_ardupilot_is_asked_for(tmp_path: Path):
    path = written(tmp_path, flight(2), "flight.log")
    assert questions_of(path)[0] == {"part"}
    record = th.import_record(path, answers={"part": "I=1"}).record
    assert record.rate == pytest.approx(RATE + np.array([1.0, 0.0, 0.0]), abs=1e-6)
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
