"""Files of the field as their tools write them, over a motion of our own: read to the last digit, or asked once."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

import trihedron as th
from laboratory_imports import questions_of, written
from tool_files import named, table, units

G = 9.80665
COUNT = 240
STEP = 10 * np.arange(COUNT)
"""Times of the rows [ms]."""
TIME = STEP / 1000
TURN = 0.9 * np.sin(0.7 * TIME) + 0.3
NOISE = np.random.default_rng(4711).normal(0.0, 0.03, (COUNT, 6))
FORCE = np.round(G * np.stack([np.sin(TURN), 0.05 + 0.0 * TURN, np.cos(TURN)], axis=1) + NOISE[:, :3], 6)
RATE = np.round(np.stack([0.02 + 0.0 * TURN, 0.63 * np.cos(0.7 * TIME), -0.2 * TURN], axis=1) + 0.1 * NOISE[:, 3:], 6)
SMALL = np.round(NOISE[:, 3:], 6)
"""Acceleration without gravity."""
SECONDS, PARTS = 1_132_345_678 + (370 + STEP) // 1000, (370 + STEP) % 1000
CLOCK = [f"13:24:{second - SECONDS[0]:02d}" for second in SECONDS.tolist()]
INERTIAL = [*named("acc_{} [m/s2]", "xyz"), *named("gyr_{} [rad/s]", "xyz")]
SI = units("m/s2", "rad/s")
XSENS = "//  MT Manager version: 2022.0.0\n// Device information:\n//  DeviceId: 03880E3B\n"
WITHOUT = "acceleration without gravity"


def beside(time: str, part: str, first: Any, second: Any) -> str:
    """Return a file with a time of whole seconds and the part of a second beside it."""
    return table([time, part, *INERTIAL], [first, second, FORCE, RATE])


FILES: dict[str, tuple[str, dict[str, str]]] = {
    "Garmin: seconds beside milliseconds": (beside("timestamp [s]", "timestamp_ms [ms]", SECONDS, PARTS), {}),
    "seconds beside a fraction": (
        beside("timestamp", "fractional_timestamp", SECONDS, [f"{part / 1000:.3f}" for part in PARTS]),
        {},
    ),
    "tv_sec beside tv_usec": (beside("tv_sec", "tv_usec", SECONDS, 1000 * PARTS), {}),
    "a clock beside milliseconds": (beside("Time", "Milliseconds", CLOCK, PARTS), {}),
    "times with a zone": (
        table(["", *INERTIAL], [pd.to_datetime(1_764_241_200_000 + STEP, unit="ms", utc=True), FORCE, RATE]),
        {},
    ),
    "Xsens with FreeAcc and SampleTimeFine": (
        table(
            [
                *("PacketCounter", "SampleTimeFine", "Second"),
                *named("FreeAcc_{}", "ENU"),
                *named("Acc_{}"),
                *named("Gyr_{}"),
                "Temperature",
            ],
            [range(COUNT), (2**32 - 7000 + 10 * STEP) % 2**32, [0] * COUNT, SMALL, FORCE, RATE, [31.25] * COUNT],
            "\t",
            XSENS,
        ),
        {},
    ),
    "Physics Toolbox: linear beside total": (
        table(
            ["time", *named("gF{}", "xyz"), *named("a{}", "xyz"), *named("w{}", "xyz")],
            [TIME, FORCE / G, SMALL, RATE],
        ),
        units("g", "rad/s", "s") | {"columns.force": "gFx,gFy,gFz"},
    ),
    "channels without a meaning and decimal commas": (
        table(["X_Value", *named("Untitled {}", "123456")], [TIME, FORCE, RATE], ";").replace(".", ","),
        SI
        | {"kind": "strapdown record", "columns.force": "Untitled 1,Untitled 2,Untitled 3", "units.time": "s"}
        | {"columns.rate": "Untitled 4,Untitled 5,Untitled 6"},
    ),
    "Betaflight": (
        table(
            ["loopIteration", "time"]
            + [name for stem in ("axisF", "gyroADC", "accSmooth") for name in named(stem + "[{}]", "012")],
            [range(COUNT), 1000 * STEP, 0 * FORCE, np.degrees(RATE), np.round(FORCE * 1e6)],
        ),
        units("1000000 LSB/(m/s2)", "deg/s"),
    ),
    "a serial monitor's times": (
        "\n".join(
            f"13:24:{time:06.3f} -> {','.join(map(str, row))}"
            for time, row in zip(TIME, np.hstack([FORCE, RATE]).tolist(), strict=True)
        ),
        SI | {"kind": "strapdown record", "columns.force": "2,3,4", "columns.rate": "5,6,7"},
    ),
    "no names, times in the first column": (
        table([], [TIME + 3.0, FORCE, RATE], " ").lstrip(),
        SI
        | {"kind": "strapdown record", "columns.force": "2,3,4", "columns.rate": "5,6,7"}
        | {"columns.time_s": "1", "units.time": "s"},
    ),
}
"""Tool -> its file, and the answers to its only round of questions."""


def assert_read(record: Any, time: np.ndarray = TIME) -> None:
    """Assert that a record has the motion of this module to the last digit of its file."""
    assert record.specific_force == pytest.approx(FORCE, rel=1e-13)
    assert record.rate == pytest.approx(RATE, rel=1e-13)
    assert record.time_s - record.time_s[0] == pytest.approx(time - time[0], abs=1e-10)


@pytest.mark.parametrize("tool", FILES)
def test_a_file_is_read_or_asks_for_what_is_missing(tool: str, tmp_path: Path):
    text, answers = FILES[tool]
    path = written(tmp_path, text, "log.csv")
    if answers:
        keys, message = questions_of(path)
        assert keys == set(answers), message
        assert all(answer in message for key, answer in answers.items() if key.startswith("columns.")), message
    assert_read(th.import_record(path, answers=answers).record)


@pytest.mark.acceptance
def test_two_complete_times_are_not_joined(tmp_path: Path):
    text = table(["time_s", "time_ms", *INERTIAL], [TIME, STEP, FORCE, RATE])
    assert_read(th.import_record(written(tmp_path, text, "log.csv")).record)
    text = table(["time", "time_ms", *INERTIAL], [STEP // 1000, STEP, FORCE, RATE])
    keys, _ = questions_of(written(tmp_path, text, "both.csv"))
    assert keys == {"columns.time_s"}


@pytest.mark.parametrize("names", [named("FreeAcc_{}"), named("user_acc_{}(G)", "xyz"), named("LinAcc{} (g)")])
def test_acceleration_without_gravity_is_no_accelerometer(names: list[str], tmp_path: Path):
    text = table(["Time (s)", *names, *named("Gyr_{} (deg/s)")], [TIME, 300.0 * SMALL, RATE])
    with pytest.raises(th.InputError, match=WITHOUT):
        th.import_record(written(tmp_path, text, "log.csv"))


@pytest.mark.acceptance
def test_linear_acceleration_is_asked_for_where_its_size_is_not_gravity(tmp_path: Path):
    names = [*named("Linear Acceleration {} (m/s^2)", "xyz"), *named("Gyroscope {} (rad/s)", "xyz")]
    path = written(tmp_path, table(["Time (s)", *names], [TIME, 120.0 * SMALL, RATE]), "shaken.csv")
    keys, message = questions_of(path)
    assert keys == {"units.force"}
    assert "gravity may not be in it" in message
    assert_read(th.import_record(written(tmp_path, table(["Time (s)", *names], [TIME, FORCE, RATE]), "ros.csv")).record)


@pytest.mark.acceptance
def test_seconds_beside_milliseconds_in_a_workbook_and_in_parquet(tmp_path: Path):
    frame = pd.DataFrame(
        np.column_stack([SECONDS, PARTS, FORCE, RATE]), columns=["timestamp", "timestamp_ms", *INERTIAL]
    )
    frame.to_excel(tmp_path / "log.xlsx", index=False)
    pl.DataFrame({name: frame[name].to_numpy() for name in frame}).write_parquet(tmp_path / "log.parquet")
    for name in ("log.xlsx", "log.parquet"):
        assert_read(th.import_record(tmp_path / name).record)


def test_messages_of_a_fit_file_are_refused(tmp_path: Path):
    row = 'Data,3,accelerometer_data,timestamp,"1132345678",s,timestamp_ms,"370",ms,accel_x,"1|2|3",counts'
    text = "\n".join(["Type,Local Number,Message,Field 1,Value 1,Units 1", *[row] * 30])
    with pytest.raises(th.InputError, match="messages of a FIT file"):
        th.import_record(written(tmp_path, text, "fit.csv"))


@pytest.mark.acceptance
def test_tables_of_pandas_with_two_levels_of_names(tmp_path: Path):
    columns = pd.MultiIndex.from_product([["acc", "gyr"], ["x", "y", "z"]])
    frame = pd.DataFrame(np.hstack([FORCE, RATE]), columns=columns, index=pd.Index(TIME, name="time"))
    answers = units("m/s2", "rad/s", "s")
    assert_read(th.import_record(frame, answers=answers).record)
    frame.to_csv(tmp_path / "levels.csv")
    keys, message = questions_of(tmp_path / "levels.csv")
    assert keys == set(answers), message
    assert_read(th.import_record(tmp_path / "levels.csv", answers=answers).record)
    # the index holds the time since the start, without a name
    frame.index = pd.to_timedelta(86_400_000 + STEP, unit="ms")
    frame.columns = [" ".join(name) for name in frame.columns]
    frame.to_csv(tmp_path / "since.csv")
    assert_read(th.import_record(tmp_path / "since.csv", answers=SI).record)


def test_names_that_are_numbers_in_pandas():
    frame = pd.DataFrame(np.column_stack([TIME, FORCE, RATE]))
    answers = {"columns.time_s": "0", "columns.force": "1,2,3", "columns.rate": "4,5,6", "kind": "strapdown record"}
    assert_read(th.import_record(frame, answers=answers | units("m/s2", "rad/s", "s")).record)


@pytest.mark.acceptance
def test_hdf5_of_opals_has_its_units_and_its_sensors_apart(tmp_path: Path):
    h5py = pytest.importorskip("h5py")
    path = tmp_path / "opal.h5"
    with h5py.File(path, "w") as file:
        for sensor, shift in (("3142", 0.0), ("3201", 0.03)):
            group = file.create_group(f"Sensors/{sensor}")
            for name, values, unit in (("Accelerometer", FORCE, "m/s^2"), ("Gyroscope", RATE, "rad/s")):
                group.create_dataset(name, data=values + shift).attrs["Units"] = unit
            group["Time"] = (1_764_241_200_123_456 + 1000 * STEP).astype(np.uint64)
    keys, message = questions_of(path)
    assert keys == {"part", "units.time"}
    assert "--set part=Sensors/3142 or --set part=Sensors/3201 (" in message
    record = th.import_record(path, part="Sensors/3201", answers={"units.time": "us"}).record
    assert record.specific_force == pytest.approx(FORCE + 0.03, rel=1e-13)
    assert record.rate == pytest.approx(RATE + 0.03, rel=1e-13)
    assert record.time_s == pytest.approx(TIME, abs=1e-11)


@pytest.mark.acceptance
def test_structures_of_matlab_keep_their_names_and_the_whole_file_can_be_taken(tmp_path: Path):
    scipy = pytest.importorskip("scipy.io")
    parts = {}
    for name, values in (("Acceleration", FORCE), ("AngularVelocity", RATE)):
        parts[name] = {axis: values[:, k] for k, axis in enumerate("XYZ")} | {"Timestamp": TIME}
    scipy.savemat(tmp_path / "phone.mat", parts)
    answers = units("m/s2", "rad/s", "s") | {"columns.time_s": "Timestamp"}
    assert_read(th.import_record(tmp_path / "phone.mat", part="(all)", answers=answers).record)


def test_tdms_without_an_offset_of_its_waveforms(tmp_path: Path):
    nptdms = pytest.importorskip("nptdms")
    channels = []
    for names, values, unit in ((named("Accel_{}"), FORCE, "m/s^2"), (named("Gyro_{}"), RATE, "rad/s")):
        for k, name in enumerate(names):
            properties = {"wf_increment": 0.01, "unit_string": unit}
            channels.append(nptdms.ChannelObject("IMU", name, values[:, k].copy(), properties))
    with nptdms.TdmsWriter(tmp_path / "log.tdms") as writer:
        writer.write_segment(channels)
    assert_read(th.import_record(tmp_path / "log.tdms").record)
