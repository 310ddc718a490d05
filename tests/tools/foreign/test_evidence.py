"""Evidence of a moving record: which columns are gyros, their unit, and acceleration without gravity."""

import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import polars as pl
import pytest

import trihedron as th
from laboratory_imports import imported, questions_of, refused, written
from tool_files import named, table

COUNT = 300
RNG = np.random.default_rng(11)
TIME = np.round(0.01 * np.arange(COUNT), 2)
TURN, TILT = 1.4 * np.sin(0.9 * TIME) + 0.4, 0.5 * np.cos(0.5 * TIME)
UP = np.stack([np.sin(TURN), np.cos(TURN) * np.sin(TILT), np.cos(TURN) * np.cos(TILT)], axis=1)
FORCE = np.round(9.80665 * UP + RNG.normal(0.0, 0.03, (COUNT, 3)), 6)
STEPS = np.cross(np.gradient(UP, TIME, axis=0), UP)
RATE = np.round(STEPS + RNG.normal(0.0, 0.003, (COUNT, 3)), 6)
DEGREES = np.round(np.degrees(RATE), 6)
FIELD = np.round(30.0 * RNG.normal(0.0, 1.0, (COUNT, 3)) + 20.0, 4)
SHAKEN = np.round(RNG.normal(0.0, 6.4, (COUNT, 3)), 6)
LOWER = "xyz"


def assert_read(record: Any, rate: np.ndarray = RATE) -> None:
    assert record.specific_force == pytest.approx(FORCE, abs=1e-9)
    assert record.rate == pytest.approx(rate, abs=1e-9)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("unit", "rates"),
    [
        ("rad/s", RATE),
        ("deg/s", DEGREES),
        ("131 LSB/(deg/s)", np.round(131 * DEGREES).astype(int)),
        ("16.4 LSB/(deg/s)", np.round(16.4 * DEGREES).astype(int)),
    ],
)
def test_the_unit_that_turns_gravity_is_the_first_answer(unit: str, rates: np.ndarray, tmp_path: Path):
    text = table(["time [s]", *named("acc_{} [m/s2]", LOWER), *named("gyr_{}", LOWER)], [TIME, FORCE, rates])
    path = written(tmp_path, text)
    keys, message = questions_of(path)
    assert keys == {"units.rate"}
    assert f"'units.rate={unit}' or" in message or f"units.rate={unit} or" in message
    factor = 1.0 if unit == "rad/s" else np.radians(1.0) / float(unit.split()[0].replace("deg/s", "1"))
    assert_read(th.import_record(path, answers={"units.rate": unit}).record, rates * factor)


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("force", "rate"), [("x1000 g", "x100 deg/s"), ("g/1000", "dps*100"), ("10^-3 g", "1e-2 °/s"), ("g x 1000", "cdps")]
)
@pytest.mark.parametrize("is_below", [False, True])
def test_the_first_answer_to_a_unit_beside_a_factor_is_right(force: str, rate: str, is_below: bool, tmp_path: Path):
    counts, turns = np.round(1000.0 * FORCE / 9.80665), np.round(100.0 * DEGREES)
    names, below = ["time", *named("acc_{}", LOWER), *named("gyr_{}", LOWER)], ["s", *[force] * 3, *[rate] * 3]
    head = f"{','.join(names)}\n{','.join(below)}\n"
    if not is_below:
        head = ",".join(f"{name} ({unit})" for name, unit in zip(names, below, strict=True)) + "\n"
    rows = table(names, [TIME, counts, turns]).partition("\n")[2]
    path = written(tmp_path, head + rows)
    keys, message = questions_of(path)
    answers = {key: message.partition(f"{key}=")[2].partition("' or")[0] for key in keys}
    record = th.import_record(path, answers=answers).record
    assert record.specific_force == pytest.approx(counts * 9.80665 / 1000.0, rel=1e-14, abs=1e-14)
    assert record.rate == pytest.approx(np.radians(turns / 100.0), rel=1e-14, abs=1e-14)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("rates", "remark"),
    [
        (RATE, "taken unchecked: order and signs of the gyros"),
        (DEGREES, "gravity turns against the gyros as if they were read with --channels w=deg"),
        (RATE * [1, -1, 1], "gravity turns against the gyros as if they were read with --channels w=1,-2,3"),
        (RATE[:, [1, 0, 2]], "gravity turns against the gyros as if they were read with --channels w=2,1,3"),
        (0.5 * RATE, "gravity turns against the gyros 2 times as far"),
        (0.0 * RATE + [0.01, 0.0, 0.02], "taken unchecked: unit, range setting, order and signs of the gyros"),
    ],
    ids=["right", "unit", "sign", "order", "range", "still"],
)
def test_what_a_record_of_three_seconds_shows_of_its_gyros_is_noted(rates: np.ndarray, remark: str, tmp_path: Path):
    names = ["time [s]", *named("acc_{} [m/s2]", LOWER), *named("gyr_{} [rad/s]", LOWER)]
    forces = FORCE if "unit" not in remark else np.round(FORCE[:1] + RNG.normal(0.0, 0.03, FORCE.shape), 6)
    notes = imported(tmp_path, table(names, [TIME, forces, np.round(rates, 6)])).notes
    assert [note.startswith(remark) for note in notes if "gyros" in note] == [True]


@pytest.mark.acceptance
def test_columns_that_turn_gravity_are_the_first_answer_for_the_gyros(tmp_path: Path):
    text = "\n".join(" ".join(map(str, row)) for row in np.hstack([FIELD, FORCE, FIELD, RATE]).tolist())
    path = written(tmp_path, text, "log.txt")
    keys, message = questions_of(path)
    assert keys == {"kind", "columns.force", "columns.rate", "units.force", "units.rate", "units.time"}
    for answer in ("columns.force=4,5,6", "columns.rate=10,11,12", "units.rate=rad/s"):
        assert f"--set {answer} " in message


@pytest.mark.acceptance
def test_a_mapping_that_is_filled_in_with_three_columns_is_read(tmp_path: Path):
    text = "\n".join(" ".join(map(str, row)) for row in np.hstack([FIELD, FORCE, FIELD, RATE]).tolist())
    path, out = written(tmp_path, text, "log.txt"), tmp_path / "record.csv"
    mapping = tmp_path / "record.import.toml"
    with pytest.raises(th.InputError, match="or fill in"):
        th.import_record(path, out=out)
    lines = re.sub(r'^(.+) = "\?"  # (.+?)(?: or .*|: .*)$', r'\1 = "\2"', mapping.read_text(), flags=re.MULTILINE)
    assert 'force = "4,5,6"' in lines
    mapping.write_text(lines)
    assert_read(th.import_record(path, out=out, mapping=mapping).record)


@pytest.mark.first(1)
@pytest.mark.parametrize("names", [("Accelerometer.csv",), ("Accelerometer.csv", "Gyroscope.csv")])
@pytest.mark.parametrize("readings", [SHAKEN, FORCE], ids=["without gravity", "with gravity"])
def test_a_file_without_gravity_by_its_name_is_refused(names: tuple[str, ...], readings: np.ndarray, tmp_path: Path):
    """The median of |f| of the shaken phone is 9.8 m/s²."""
    head = ["time", "seconds_elapsed", "z", "y", "x"]
    stamps = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(COUNT)
    files = [
        written(tmp_path, table(head, [stamps, TIME, values[:, ::-1]]), name)
        for name, values in zip(names, (readings, RATE), strict=False)
    ]
    with pytest.raises(th.InputError, match=r"without gravity by its name.*TotalAcceleration\.csv.*export that too"):
        th.import_record(*files)
    answers = {"columns.force": "x,y,z", "units.force": "m/s2"}
    if len(files) == 1:
        record = th.import_record(files[0], answers=answers).record
        assert record.columns()["f1_mps2"] == pytest.approx(readings[:, 0], abs=1e-9)


def test_shaking_of_the_size_of_gravity_is_asked_about(tmp_path: Path):
    text = table(["time", "seconds_elapsed", "z", "y", "x"], [TIME, TIME, SHAKEN[:, ::-1]])
    assert questions_of(written(tmp_path, text, "phone.csv"))[0] == {"columns.force"}


@pytest.mark.acceptance
@pytest.mark.parametrize(("readings", "is_refused"), [(FORCE, False), (SHAKEN, True)])
def test_a_name_without_gravity_is_asked_about_where_gravity_is_in_it(
    readings: np.ndarray, is_refused: bool, tmp_path: Path
):
    text = table(
        ["time [s]", *named("lin_acc_{} [m/s2]", LOWER), *named("gyr_{} [rad/s]", LOWER)], [TIME, readings, RATE]
    )
    if is_refused:
        assert "acceleration without gravity" in refused(tmp_path, text)
    else:
        keys, _ = questions_of(written(tmp_path, text))
        assert keys == {"columns.force"}
        assert_read(imported(tmp_path, text, {"columns.force": ",".join(named("lin_acc_{}", LOWER))}).record)


def test_an_estimate_of_gravity_is_no_reading(tmp_path: Path):
    text = table([], [TIME, np.round(UP, 9), RATE]).lstrip()
    assert "columns 2,3,4: an estimate of gravity" in refused(tmp_path, text)


PHONE = np.round(FORCE / 9.80665 - UP, 9)
ESTIMATE = np.round(UP, 9)


@pytest.mark.acceptance
@pytest.mark.parametrize("form", ["no names", "names in g", "names in m/s2", "numbers"])
@pytest.mark.parametrize("sign", [-1, 1])
def test_acceleration_without_gravity_and_gravity_are_added(form: str, sign: int, tmp_path: Path):
    """OxIOD: time, attitude, rates, gravity, acceleration of the user, magnetic field; no names."""
    factor = 1.0 if form == "names in g" or form == "no names" else 9.80665
    gravity, user = np.round(sign * factor * ESTIMATE, 9), np.round(sign * factor * PHONE, 9)
    names, answers = ["time [s]"], {"columns.force.sign": str(sign)}
    rows = [TIME, user, gravity, RATE]
    unit = {"names in m/s2": " [m/s2]", "numbers": " [m/s2]"}.get(form, "")
    names += [*named(f"linear_acceleration_{{}}{unit}", LOWER), *named(f"gravity_{{}}{unit}", LOWER)]
    names += named("rate_{} [rad/s]", LOWER)
    if form == "no names":
        rows = [TIME, 0.1 * FIELD, RATE, gravity, user, FIELD]
        answers |= {"kind": "strapdown record", "units.time": "s", "units.rate": "rad/s", "columns.time_s": "1"}
        answers |= {"columns.rate": "5,6,7"}
    answers["columns.force"] = "11+8,12+9,13+10" if form == "no names" else "+"
    if form != "no names":
        answers["columns.force"] = ",".join(f"{one}+{other}" for one, other in zip(names[1:4], names[4:7], strict=True))
    if not unit:
        answers["units.force"] = "g"
    text = table(names, rows) if form != "no names" else table(names, rows).partition("\n")[2]
    path = written(tmp_path, text)
    if form == "numbers":
        path = tmp_path / "phone.parquet"
        pl.read_csv(tmp_path / "lab.csv").write_parquet(path)
    keys, message = questions_of(path)
    assert keys == set(answers), message
    assert f"columns.force={answers['columns.force']}" in message.replace("'", "")
    unit_size = 9.80665 / factor
    record = th.import_record(path, answers=answers).record
    assert record.specific_force == pytest.approx(sign * unit_size * (user + gravity), rel=1e-14, abs=1e-14)
    assert record.rate == pytest.approx(RATE, abs=1e-9)


def test_the_rate_above_a_table_is_the_first_answer(tmp_path: Path):
    text = table(
        named("Accelerometer {}"),
        [FORCE],
        above="--- Data File Created By ActiGraph date format M/d/yyyy at 30 Hz Filter Normal ---\nSerial Number: 1\n",
    )
    assert "--set 'units.time=30 Hz'" in questions_of(written(tmp_path, text))[1]


@pytest.mark.acceptance
def test_equal_columns_of_times_are_one(tmp_path: Path):
    names = [name for axis in "XYZ" for name in ("X [s]", f"IM sensor 1: ACC 1.{axis} [m/s2]")]
    names += [name for axis in "XYZ" for name in ("X [s]", f"IM sensor 1: GYRO 1.{axis} [rad/s]")]
    columns = [column for values in (*FORCE.T, *RATE.T) for column in (TIME, values)]
    assert_read(imported(tmp_path, table(names, columns)).record)


@pytest.mark.acceptance
def test_calibrated_columns_are_asked_about_before_raw_ones(tmp_path: Path):
    counts = np.round(2000.0 + 80.0 * FORCE).astype(int)
    names = [
        "time [s]",
        *named("S_Accel_LN_{}_RAW"),
        *named("S_Accel_LN_{}_CAL [m/s2]"),
        *named("S_Gyro_{}_CAL [rad/s]"),
    ]
    path = written(tmp_path, table(names, [TIME, counts, FORCE, RATE]))
    keys, message = questions_of(path)
    assert keys == {"columns.force"}
    first = message.split("--set ")[1]
    assert "RAW" not in first
    answer = ",".join(named("S_Accel_LN_{}_CAL [m/s2]"))
    assert_read(th.import_record(path, answers={"columns.force": answer}).record)


def ronin(folder: Path, *, synced: bool) -> Path:
    """Return a file as RoNIN's: arrays with their own times, and arrays that share one."""
    path = folder / "data.hdf5"
    stamps = 310_000_000_000_000 + 10_000_000 * np.arange(COUNT)
    with h5py.File(path, "w") as file:
        for name, values in (("acce", FORCE), ("gyro", RATE), ("gyro_uncalib", RATE + 0.1), ("linacce", SHAKEN)):
            file[f"raw/imu/{name}"] = np.column_stack([stamps, values])
            if synced:
                file[f"synced/{name}"] = values
        if synced:
            file["synced/time"] = 1200.0 + TIME
    return path


@pytest.mark.acceptance
def test_a_file_of_ronin_needs_no_answer(tmp_path: Path):
    assert_read(th.import_record(ronin(tmp_path, synced=True)).record)


@pytest.mark.acceptance
def test_two_tables_of_a_file_are_joined(tmp_path: Path):
    path = ronin(tmp_path, synced=False)
    keys, message = questions_of(path)
    assert keys == {"part", "units.time", "units.force", "units.rate"}
    assert "--set part=raw/imu/acce,raw/imu/gyro or" in message
    answers = {"units.time": "ns", "units.force": "m/s2", "units.rate": "rad/s"}
    assert_read(th.import_record(path, part="raw/imu/acce,raw/imu/gyro", answers=answers).record)
