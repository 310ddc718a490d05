"""Files of other tools: each written by its own library, read back to the last digit, or asked the missing fact."""

import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import polars as pl
import pytest
import scipy.io
from rosbags.rosbag2 import StoragePlugin

import trihedron as th
from laboratory_imports import questions_of, written
from log_files import COUNT, FORCE, LOGS, NANOS, RATE, TIME, ros2
from trihedron.tools.cli import main
from trihedron.tools.foreign import containers
from trihedron.tools.foreign.novatel import block_checksum

SINGLE = 3e-7
"""Relative rounding of numbers of 32 bits."""


@pytest.mark.first(1)
@pytest.mark.parametrize("name", LOGS)
def test_a_log_is_read_to_the_last_digit(name: str, tmp_path: Path):
    write, answers = LOGS[name]
    path = write(tmp_path)
    if answers:
        keys, message = questions_of(path)
        assert keys == set(answers), message
        first = {key: f"--set {key}={text}" for key, text in answers.items() if key == "units.force"}
        assert all(option in message for option in first.values())
    record = th.import_record(path, answers=answers).record
    rounding = SINGLE if name == "ULog" else 1e-15
    assert record.specific_force == pytest.approx(FORCE, rel=rounding, abs=1e-15)
    assert record.rate == pytest.approx(RATE, rel=rounding, abs=1e-15)
    assert record.time_s - record.time_s[0] == pytest.approx(TIME, abs=1e-9)


@pytest.mark.parametrize("name", LOGS)
@pytest.mark.parametrize("damage", ["empty", "cut short", "other bytes"])
def test_a_damaged_log_is_refused_in_one_line(name: str, damage: str, tmp_path: Path):
    path = LOGS[name][0](tmp_path)
    if path.is_dir():
        path = next(path.glob("*.db3"))
    content = path.read_bytes()
    damaged = {"empty": b"", "cut short": content[: len(content) // 3], "other bytes": b"\0\7" * 500}[damage]
    path.write_bytes(damaged)
    refusal = None
    try:
        conversion = th.import_record(path, answers=LOGS[name][1])
    except th.InputError as error:
        refusal = str(error)
    if refusal is not None:
        assert "\n" not in refusal
        assert path.name in refusal
        return
    # a log in sections keeps the rows before the cut
    assert damage == "cut short"
    assert 0 < len(conversion.record) < COUNT
    assert conversion.record.specific_force == pytest.approx(FORCE[: len(conversion.record)], rel=SINGLE, abs=1e-6)


@pytest.mark.acceptance
def test_a_file_of_several_tables_is_listed_and_asked(tmp_path: Path, capsys):
    path = ros2(tmp_path, StoragePlugin.SQLITE3, ("/imu/data", "/imu/data_raw"))
    assert main(["import", str(path), "--list"]) == 0
    listed = capsys.readouterr().out
    assert f"imu/data_raw: {COUNT} rows, 7 columns, gyros and accelerometers" in listed
    keys, message = questions_of(path)
    assert keys == {"part"}
    assert "--set part=imu/data or --set part=imu/data_raw" in message
    out = str(tmp_path / "record.csv")
    assert main(["import", str(path), "--from", "imu/data_raw", "--out", out]) == 0
    assert th.read_record(out).specific_force == pytest.approx(FORCE, abs=1e-9)
    with pytest.raises(th.InputError, match="imu/data_raw"):
        th.import_record(path, part="imu/data_row")


@pytest.mark.parametrize(
    ("name", "library", "command"),
    [
        ("HDF5", "h5py", "pip install 'trihedron[logs]'"),
        ("ROS 1 bag", "rosbags.highlevel", "pip install 'trihedron[logs]'"),
        ("TDMS", "nptdms", "pip install 'trihedron[tdms]'"),
    ],
)
def test_without_its_library_a_log_is_refused_with_the_command(
    name: str, library: str, command: str, tmp_path: Path, monkeypatch
):
    path = LOGS[name][0](tmp_path)
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(th.InputError) as refusal:
        th.import_record(path)
    assert command in str(refusal.value)


@pytest.mark.parametrize("name", ["HDF5", "mat v7.3", "mat v5"])
def test_a_crash_of_the_library_of_arrays_is_one_line(name: str, tmp_path: Path, monkeypatch):
    """The file is read in another process: this one lives on."""
    path = LOGS[name][0](tmp_path)
    for way in ("os.kill(os.getpid(), 11)", "os.abort()", "bytearray(1 << 40)"):
        monkeypatch.setattr(containers, "ARRAY_READER", f"import os\n{way}")
        with pytest.raises(th.InputError, match=rf"{path.name}: is not a readable (HDF5|MATLAB) file"):
            th.import_record(path)


@pytest.mark.parametrize(
    "names", [("sec", "nanosec"), ("header.stamp.secs", "header.stamp.nsecs"), ("t sec", "t nsec")]
)
def test_seconds_beside_nanoseconds_are_one_time_in_tables(names: tuple[str, str], tmp_path: Path):
    """ROS writes them apart, in any file."""
    columns = dict(zip(names, (NANOS // 10**9, NANOS % 10**9), strict=True))
    columns |= {f"acc_{axis} [m/s2]": FORCE[:, k] for k, axis in enumerate("xyz")}
    columns |= {f"gyro_{axis} [rad/s]": RATE[:, k] for k, axis in enumerate("xyz")}
    pl.DataFrame(columns).write_parquet(tmp_path / "log.parquet")
    for source in (columns, tmp_path / "log.parquet"):
        record = th.import_record(source).record
        assert record.time_s == pytest.approx(TIME, abs=1e-12)
        assert np.array_equal(record.rate, RATE)


def test_warnings_of_a_library_are_notes_and_not_printed(tmp_path: Path, capsys):
    """A ULog with a message of unknown kind, and a TDMS file whose last channel is cut."""
    path = LOGS["ULog"][0](tmp_path)
    content = bytearray(path.read_bytes())
    content[content.find(b"D\x07\0", len(content) // 2) + 1] = 77
    path.write_bytes(content)
    cut = LOGS["TDMS"][0](tmp_path)
    cut.write_bytes(cut.read_bytes()[:-800])
    notes = th.import_record(path).notes
    assert any(note.startswith("rows may be missing: ") for note in notes), notes
    with pytest.raises(th.InputError, match=r"log\.tdms: one "):
        th.import_record(cut)
    assert capsys.readouterr() == ("", "")


@pytest.mark.acceptance
def test_objects_are_not_unpickled(tmp_path: Path):
    """An array of objects would run code; it is refused."""
    np.save(tmp_path / "log.npy", np.array([{"a": 1}] * 5, dtype=object), allow_pickle=True)
    np.savez(tmp_path / "log.npz", a=np.array([None] * 5, dtype=object))
    scipy.io.savemat(tmp_path / "log.mat", {"text": "no numbers"})
    for name in ("log.npy", "log.npz", "log.mat"):
        with pytest.raises(th.InputError, match=name):
            th.import_record(tmp_path / name)


def test_novatel_is_read_with_its_axes_and_checksums(tmp_path: Path):
    """The line is the manual's own example: z, -y, x; its checksum is that of the manual."""
    example = "RAWIMUSA,2209,491612.254;2209,491612.253588,ea5afe00,329303960,-2512321,4410363,309705,607017,-1009773"
    assert block_checksum(example.encode()) == 0x1FB76C28
    lines = []
    for k in range(40):
        content = (
            f"RAWIMUSA,2209,{0.01 * k:.3f};2209,{0.01 * k:.6f},ea5afe00,{43189600 + k},{-700 - k},{500},{10},{20},{-30}"
        )
        lines.append(f"%{content}*{block_checksum(content.encode()):08x}")
    path = written(tmp_path, "\n".join(lines), "imu.asc")
    keys, message = questions_of(path)
    assert keys == {"units.velocity", "units.angle"}
    assert "--set units.velocity=0.3048/134217728" in message.replace("'", "")
    answers = {"units.velocity": "0.3048/134217728 m/s/LSB", "units.angle": "1/8589934592 rad/LSB"}
    record = th.import_record(path, answers=answers).record
    truth = np.array([[500, 700 + k, 43189600 + k] for k in range(40)])
    assert record.velocity_increment == pytest.approx(0.3048 / 2**27 * truth)
    path.write_text("\n".join([*lines[:5], lines[5].replace("-30", "-31")]))
    with pytest.raises(th.InputError, match="row 6: its checksum is wrong"):
        th.import_record(path)


def rows_of(time: np.ndarray, values: np.ndarray, names: str) -> str:
    """Return a CSV file of times and three channels."""
    rows = [f"{t:.9f},{x:.12f},{y:.12f},{z:.12f}" for t, (x, y, z) in zip(time, values, strict=True)]
    return "\n".join([names, *rows])


ACCELEROMETER = "Time (s),Acceleration x (m/s^2),Acceleration y (m/s^2),Acceleration z (m/s^2)"
GYROSCOPE = "Time (s),Gyroscope x (rad/s),Gyroscope y (rad/s),Gyroscope z (rad/s)"


def motion(time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return specific force [m/s²] and rate [rad/s] of a block that turns about its second axis."""
    turn = 0.8 * np.sin(0.5 * time) + 0.5 * np.sin(1.3 * time)
    rate = 0.4 * np.cos(0.5 * time) + 0.65 * np.cos(1.3 * time)
    zero = 0.0 * time
    force = 9.80665 * np.stack([np.sin(turn), zero + 0.01, np.cos(turn)], axis=1)
    return force, np.stack([zero + 0.001, -rate, zero], axis=1)


@pytest.mark.acceptance
def test_two_files_of_one_clock_are_one_record(tmp_path: Path):
    time = np.arange(0.0, 30.0, 0.01)
    force, rate = motion(time)
    first = written(tmp_path, rows_of(time, force, ACCELEROMETER), "Accelerometer.csv")
    second = written(tmp_path, rows_of(time, rate, GYROSCOPE), "Gyroscope.csv")
    for files in ((first, second), (second, first)):
        conversion = th.import_record(*files)
        assert conversion.record.specific_force == pytest.approx(force, abs=1e-11)
        assert conversion.record.rate == pytest.approx(rate, abs=1e-11)
        assert "both files have the same times" in conversion.notes


@pytest.mark.first(1)
@pytest.mark.parametrize("lag", [0.0, 0.08, -0.05])
def test_the_slower_file_is_interpolated_within_its_bound_and_the_lag_is_stated(lag: float, tmp_path: Path):
    fast, slow = np.arange(0.0, 60.0, 0.01), np.arange(0.203, 59.0, 0.02)
    force, _ = motion(fast)
    _, rate = motion(slow - lag)
    first = written(tmp_path, rows_of(fast + 1.7e9, force, ACCELEROMETER), "acc.csv")
    second = written(tmp_path, rows_of(slow + 1.7e9, rate, GYROSCOPE), "gyro.csv")
    conversion = th.import_record(first, second)
    record, notes = conversion.record, " ".join(conversion.notes)
    inside = fast[(fast >= slow[0]) & (fast <= slow[-1])]
    _, truth = motion(inside - lag)
    bound = np.abs(np.diff(rate, 2, axis=0)).max() / 8.0
    assert len(record) == len(inside)
    assert np.abs(record.rate - truth).max() <= 1.01 * bound + 1e-6
    assert "interpolated linearly" in notes
    stated = float(notes.rpartition("the gyros are ")[2].split()[0])
    assert stated == pytest.approx(abs(lag), abs=0.006)
    assert (" ahead of " in notes) == (lag < 0.0) or lag == 0.0


@pytest.mark.acceptance
@pytest.mark.parametrize("late", [3.17, -1.06])
def test_two_files_that_each_begin_at_0_are_asked_for_the_lag_that_the_record_shows(late: float, tmp_path: Path):
    """Each logger counts from its own start: the gyros' stamps of a moment are larger by the lag."""
    time = np.arange(0.0, 60.0, 0.01)
    first = written(tmp_path, rows_of(time, motion(time + 5.0)[0], ACCELEROMETER), "acc.csv")
    second = written(tmp_path, rows_of(time, motion(time + 5.0 - late)[1], GYROSCOPE), "gyro.csv")
    with pytest.raises(th.InputError) as question:
        th.import_record(first, second)
    answer = str(question.value).partition("--set lag=")[2].split()[0]
    assert float(answer) == pytest.approx(late, abs=0.01)
    assert "or --set lag=0 (both files begin at 0 s" in str(question.value)
    record = th.import_record(first, second, answers={"lag": str(late)}).record
    force, rate = motion(record.time_s + 5.0)
    assert record.specific_force == pytest.approx(force, abs=1e-4)
    assert record.rate == pytest.approx(rate, abs=1e-4)
    together = th.import_record(first, second, answers={"lag": "0"})
    assert together.record.rate == pytest.approx(motion(time + 5.0 - late)[1], abs=1e-11)
    assert not any("not certain" in note for note in together.notes)


@pytest.mark.acceptance
def test_two_files_that_begin_at_0_say_that_one_clock_is_not_certain(tmp_path: Path):
    """At rest nothing shows a lag; in motion without one it is near 0."""
    time = np.arange(0.0, 30.0, 0.01)
    resting = np.random.default_rng(1).normal(0.0, 0.01, (len(time), 3))
    for force, rate in (motion(time), (resting + np.array([0.0, 0.0, 9.8]), resting)):
        first = written(tmp_path, rows_of(time, force, ACCELEROMETER), "acc.csv")
        second = written(tmp_path, rows_of(time, rate, GYROSCOPE), "gyro.csv")
        notes = " ".join(th.import_record(first, second).notes)
        assert "both files begin at 0 s: that they have one clock is not certain" in notes


@pytest.mark.acceptance
def test_two_files_without_a_common_time_are_refused(tmp_path: Path):
    time = np.arange(0.0, 5.0, 0.01)
    force, rate = motion(time)
    first = written(tmp_path, rows_of(time, force, ACCELEROMETER), "acc.csv")
    second = written(tmp_path, rows_of(time + 100.0, rate, GYROSCOPE), "gyro.csv")
    with pytest.raises(th.InputError, match="no times in common"):
        th.import_record(first, second)


@pytest.mark.acceptance
def test_two_files_with_plain_names_are_told_by_their_order(tmp_path: Path):
    """Sensor Logger writes z, y, x."""
    time = np.arange(0.0, 5.0, 0.01)
    files = []
    for name, values in zip(("TotalAcceleration.csv", "Gyroscope.csv"), motion(time), strict=True):
        rows = []
        for t, (x, y, z) in zip(time, values, strict=True):
            rows.append(f"{1.7e18 + 1e9 * t:.0f},{t:.6f},{z:.9f},{y:.9f},{x:.9f}")
        files.append(written(tmp_path, "\n".join(["time,seconds_elapsed,z,y,x", *rows]), name))
    record = th.import_record(*files).record
    assert record.specific_force == pytest.approx(motion(time)[0], abs=1e-8)
    assert record.rate == pytest.approx(motion(time)[1], abs=1e-8)


LABELLED: dict[str, Any] = {
    "columns": lambda xarray: xarray.Dataset(
        {f"acc_{axis}": ("time", FORCE[:, k], {"units": "m/s^2"}) for k, axis in enumerate("xyz")}
        | {f"gyro_{axis}": ("time", RATE[:, k], {"units": "rad/s"}) for k, axis in enumerate("xyz")},
        coords={"time": ("time", TIME, {"units": "s"})},
    ),
    "two dimensions": lambda xarray: xarray.Dataset(
        {
            "accel": (("time", "axis"), FORCE, {"units": "m/s2"}),
            "gyro": (("axis", "time"), RATE.T, {"units": "rad/s"}),
        },
        coords={"time": NANOS.astype("datetime64[ns]"), "axis": ["x", "y", "z"]},
    ),
    "an array of channels": lambda xarray: xarray.DataArray(
        np.concatenate([FORCE, RATE], axis=1),
        dims=("time_s", "channel"),
        coords={"time_s": TIME, "channel": ["ax [m/s2]", "ay [m/s2]", "az [m/s2]", "wx_radps", "wy_radps", "wz_radps"]},
    ),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", LABELLED)
def test_tables_of_xarray_are_read_with_their_units_and_labels(name: str):
    xarray = pytest.importorskip("xarray")
    record = th.import_record(LABELLED[name](xarray)).record
    assert np.array_equal(record.specific_force, FORCE)
    assert np.array_equal(record.rate, RATE)
    assert record.time_s - record.time_s[0] == pytest.approx(TIME, abs=1e-12)


def test_a_table_of_xarray_does_not_need_xarray():
    """An object with its attributes is enough."""

    class Array(SimpleNamespace):
        def transpose(self, *_: Any) -> "Array":
            return self

    def column(values: np.ndarray, units: str) -> Array:
        return Array(values=values, dims=("time",), attrs={"units": units})

    variables = {f"acc_{axis}": column(FORCE[:, k], "m/s2") for k, axis in enumerate("xyz")}
    variables |= {f"gyro_{axis}": column(RATE[:, k], "rad/s") for k, axis in enumerate("xyz")}
    coordinates = {"time": column(TIME, "s")}
    source: Any = SimpleNamespace(dims=("time",), sizes={"time": COUNT}, coords=coordinates, data_vars=variables)
    record = th.import_record(source).record
    assert np.array_equal(record.specific_force, FORCE)
