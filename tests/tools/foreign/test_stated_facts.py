"""Facts that a file states beside its numbers: sensitivities, rates and names; columns that are no gyros; JSON."""

import json
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import trihedron as th
from laboratory_imports import imported, questions_of, refused, written
from tool_files import G, table

COUNT = 240
TIME = np.round(0.01 * np.arange(COUNT), 2)
TURN = 1.2 * np.sin(0.8 * TIME) + 0.4
PLAIN = G * np.stack([np.sin(TURN), 0.1 + 0.0 * TURN, np.cos(TURN)], axis=1)
FORCE = np.round(PLAIN + np.random.default_rng(4).normal(0.0, 0.05, (COUNT, 3)), 6)
RATE = np.round(np.stack([0.01 * np.cos(TIME), 0.96 * np.cos(0.8 * TIME), 0.1 * np.sin(TIME)], axis=1), 6)
COUNTS, TURNS = np.round(FORCE / G * 256).astype(int), np.round(np.degrees(RATE) * 14.375).astype(int)
NAMES = ["ax", "ay", "az", "gx", "gy", "gz"]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("above", "force", "rate"),
    [
        ("# 256 LSB/g, 14.375 LSB/(deg/s)\n", "256 LSB/g", "14.375 LSB/(deg/s)"),
        ("accelerometer;3.90625 mg/LSB\ngyro: 14.375 LSB/dps;\n", "3.90625 mg/LSB", "14.375 LSB/dps"),
    ],
    ids=["in a comment", "in two lines"],
)
def test_sensitivities_that_a_file_states_are_the_first_answers(above: str, force: str, rate: str, tmp_path: Path):
    mark = ";" if ";" in above else ","
    path = written(tmp_path, table(["t [s]", *NAMES], [TIME, COUNTS, TURNS], mark, above))
    message = questions_of(path)[1]
    assert f"--set 'units.force={force}' or" in message
    assert f"--set 'units.rate={rate}' or" in message
    record = th.import_record(path, answers={"units.force": force, "units.rate": rate}).record
    assert record.specific_force == pytest.approx(COUNTS / 256 * G, abs=1e-12)
    assert record.rate == pytest.approx(np.radians(TURNS / 14.375), abs=1e-14)


def test_of_two_sensitivities_of_a_quantity_none_is_first(tmp_path: Path):
    above = "# low 256 LSB/g, high 20.5 LSB/g\n"
    _, message = questions_of(written(tmp_path, table(["t [s]", *NAMES[:3]], [TIME, COUNTS], above=above)))
    assert "20.5" not in message


@pytest.mark.acceptance
def test_an_estimate_of_gravity_is_no_gyro_by_its_name(tmp_path: Path):
    gravity = np.round(G * PLAIN / np.linalg.norm(PLAIN, axis=1, keepdims=True), 7)
    path = written(tmp_path, table(["t [s]", *NAMES], [TIME, FORCE, gravity]))
    assert questions_of(path)[0] == {"units.force"}
    result = th.import_record(path, answers={"units.force": "m/s2"})
    assert result.kind == "accelerometer record"
    assert set(result.left_out) == {"column 'gx'", "column 'gy'", "column 'gz'"}
    with_gyros = table(["t [s]", *NAMES, "wx", "wy", "wz"], [TIME, FORCE, gravity, RATE])
    result = imported(tmp_path, with_gyros, {"units.force": "m/s2", "units.rate": "rad/s"})
    assert result.record.rate == pytest.approx(RATE)


def test_gyros_of_one_size_in_most_rows_are_gyros(tmp_path: Path):
    turns = np.where(TIME[:, None] < 2.0, [[3, -4, 12]], TURNS)
    path = written(tmp_path, table(["t [s]", *NAMES], [TIME, COUNTS, turns]))
    assert questions_of(path)[0] == {"units.force", "units.rate"}


def test_names_stand_above_rows_without_readings(tmp_path: Path):
    names = ["t [s]", *(f"acc_{axis} [m/s2]" for axis in "xyz"), *(f"gyro_{axis} [rad/s]" for axis in "xyz")]
    before = f"{','.join(names)}\n-0.02,nan,nan,nan,nan,nan,nan\n-0.01,nan,nan,nan,nan,nan,nan\n"
    content = before + table(names, [TIME, FORCE, RATE]).partition("\n")[2]
    record = imported(tmp_path, content).record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
    assert record.rate == pytest.approx(RATE, abs=1e-12)


@pytest.mark.acceptance
def test_points_between_thousands_are_asked_for_with_the_units_of_such_counts(tmp_path: Path):
    counts = np.hstack([64 * COUNTS, TURNS]).T.tolist()
    grouped = [[f"{count:,}".replace(",", ".") for count in column] for column in counts]
    times = [str(time).replace(".", ",") for time in TIME.tolist()]
    path = written(tmp_path, table(["t [s]", *NAMES], [times, *grouped], ";"))
    keys, message = questions_of(path)
    assert keys == {"thousands", "units.force", "units.rate"}
    assert "--set 'units.force=16384 LSB/g' or" in message
    answers = {"thousands": ".", "units.force": "16384 LSB/g", "units.rate": "14.375 LSB/(deg/s)"}
    record = th.import_record(path, answers=answers).record
    assert record.specific_force == pytest.approx(COUNTS / 256 * G, abs=1e-12)


def test_a_start_and_a_rate_above_three_columns_give_the_times(tmp_path: Path):
    """The E4 of Empatica counts 64 for 1 g."""
    counts = np.round(FORCE / G * 64).astype(int)
    above = "1490875387.000000, 1490875387.000000, 1490875387.000000\n32.000000, 32.000000, 32.000000\n"
    path = written(tmp_path, table(counts[0].astype(str).tolist(), [counts[1:]], above=above), "ACC.csv")
    keys, message = questions_of(path)
    assert keys == {"units.force"}
    assert "--set 'units.force=64 LSB/g'" in message
    record = th.import_record(path, answers={"units.force": "64 LSB/g"}).record
    assert record.specific_force == pytest.approx(counts / 64 * G, abs=1e-12)
    assert np.diff(record.time_s) == pytest.approx(1 / 32, abs=1e-12)


def with_checksum(line: str) -> str:
    """Return a line as NMEA writes it."""
    total = 0
    for character in line.encode():
        total ^= character
    return f"${line}*{total:02X}"


@pytest.mark.acceptance
def test_right_checksums_of_lines_are_no_part_of_their_numbers(tmp_path: Path):
    rows = table(["", *map(str, range(7))], [["PIMU"] * COUNT, (1000 * TIME).astype(int), FORCE, RATE]).splitlines()[1:]
    path = written(tmp_path, "\n".join(map(with_checksum, rows)), "log.txt")
    answers = {"columns.force": "3,4,5", "columns.rate": "6,7,8", "columns.time_s": "2"}
    answers |= {"kind": "strapdown record", "units.time": "ms", "units.force": "m/s2", "units.rate": "rad/s"}
    assert questions_of(path)[0] == set(answers)
    record = th.import_record(path, answers=answers).record
    assert record.rate == pytest.approx(RATE, abs=0)
    path.write_text(path.read_text().replace(f",{RATE[9, 2]}*", f",{RATE[9, 2]}9*"))
    assert "missing" in questions_of(path, answers)[0]


@pytest.mark.acceptance
def test_a_column_with_a_minus_before_its_name_is_asked_for_its_sign(tmp_path: Path):
    names = ["t [s]", "-acc_x [m/s2]", "acc_y [m/s2]", "acc_z [m/s2]"]
    path = written(tmp_path, table(names, [TIME, -FORCE[:, 0], FORCE[:, 1], FORCE[:, 2]]))
    assert questions_of(path)[0] == {"columns.f1_mps2.sign"}
    for sign, first in (("-1", FORCE[:, 0]), ("1", -FORCE[:, 0])):
        record = th.import_record(path, answers={"columns.f1_mps2.sign": sign}).record
        assert record.specific_force[:, 0] == pytest.approx(first, abs=0)


def test_a_unit_with_a_number_in_a_head_is_the_first_answer(tmp_path: Path):
    names = ["t [s]", *(f"acc_{axis} [0.001 g]" for axis in "xyz"), *(f"gyro_{axis} [0.1 deg/s]" for axis in "xyz")]
    tenths = np.round(np.degrees(RATE) * 10).astype(int)
    path = written(tmp_path, table(names, [TIME, np.round(FORCE / G * 1000).astype(int), tenths]))
    message = questions_of(path)[1]
    assert "--set 'units.force=0.001 g' or" in message
    assert "--set 'units.rate=0.1 deg/s' or" in message


@pytest.mark.acceptance
@pytest.mark.parametrize("place", ["", "run 1/imu", "run 1/imu/acc"], ids=["file", "group", "array"])
def test_a_rate_beside_arrays_is_the_first_answer(place: str, tmp_path: Path):
    path = tmp_path / "log.h5"
    with h5py.File(path, "w") as file:
        for name, values, unit in (("acc", FORCE, "m/s2"), ("gyro", RATE, "rad/s")):
            file[f"run 1/imu/{name}"] = values
            file[f"run 1/imu/{name}"].attrs["units"] = unit
        file[place or "/"].attrs["sample_rate"] = 250.0
    keys, message = questions_of(path)
    assert keys == {"units.time"}
    assert "--set 'units.time=250 Hz' (" in message
    record = th.import_record(path, answers={"units.time": "250 Hz"}).record
    assert record.time_s == pytest.approx(0.004 * np.arange(COUNT), abs=1e-12)
    assert record.rate == pytest.approx(RATE, abs=0)


def assert_equal_to_file(record: Any) -> None:
    """Assert that a record has the numbers of the file to the last digit."""
    assert record.specific_force == pytest.approx(FORCE, abs=0)
    assert record.rate == pytest.approx(RATE, abs=0)
    assert record.time_s == pytest.approx(TIME, abs=0)


def objects(*, nested: bool) -> list[dict[str, object]]:
    """Return the readings as objects of JSON."""
    rows = []
    for time, force, rate in zip(TIME.tolist(), FORCE.tolist(), RATE.tolist(), strict=True):
        inside = {"acc": dict(zip("xyz", force, strict=True)), "gyro": dict(zip("xyz", rate, strict=True))}
        rows.append({"t": time, "imu": inside} if nested else {"t": time, "acc": force, "gyro": rate})
    return rows


@pytest.mark.first(1)
@pytest.mark.parametrize("nested", [True, False], ids=["nested", "lists"])
@pytest.mark.parametrize("in_lines", [True, False], ids=["lines", "one list"])
def test_objects_of_json_are_a_table(nested: bool, in_lines: bool, tmp_path: Path):
    rows = objects(nested=nested)
    text = "\n".join(map(json.dumps, rows)) if in_lines else json.dumps(rows, indent=1)
    path = written(tmp_path, text, "log.json")
    answers = {"units.time": "s", "units.force": "m/s2", "units.rate": "rad/s"}
    assert questions_of(path)[0] == set(answers)
    assert_equal_to_file(th.import_record(path, answers=answers).record)


COLUMNS = {"t [s]": TIME.tolist()}
for _name, _columns in (("acc_{} [m/s2]", FORCE), ("gyro_{} [rad/s]", RATE)):
    COLUMNS |= {_name.format(axis): column for axis, column in zip("xyz", _columns.T.tolist(), strict=True)}
ROWS = [dict(zip(COLUMNS, row, strict=True)) for row in zip(*COLUMNS.values(), strict=True)]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    "content",
    [
        COLUMNS,
        {"device": "A-3", "rate": 100, **COLUMNS},
        {"device": "A-3", "samples": ROWS},
        {name: {str(k): value for k, value in enumerate(column)} for name, column in COLUMNS.items()},
        {str(k): row for k, row in enumerate(ROWS)},
        [row | {"remark": 150_000 * "-"} for row in ROWS],
        "\n".join(json.dumps(row | {"remark": 150_000 * "-"}) for row in ROWS),
    ],
    ids=["columns", "with facts", "inside", "pandas", "rows of pandas", "large list", "large lines"],
)
def test_json_of_any_shape_is_a_table(content: object, tmp_path: Path):
    text = content if isinstance(content, str) else json.dumps(content)
    assert_equal_to_file(imported(tmp_path, text, name="log.json").record)


@pytest.mark.acceptance
def test_the_likeliest_two_of_mixed_sensors_are_the_first_answer(tmp_path: Path):
    rows = []
    for time, force, rate in zip(TIME.tolist(), FORCE.tolist(), RATE.tolist(), strict=True):
        for sensor, values in (("Accelerometer", (0, 0, 0)), ("TotalAcceleration", force), ("Gyroscope", rate)):
            texts = dict(zip("zyx", map(str, values[::-1]), strict=True))
            rows.append({"sensor": sensor, "time": "17", "seconds_elapsed": str(time), **texts})
    path = written(tmp_path, json.dumps(rows), "log.json")
    keys, message = questions_of(path)
    pair = "sensor=TotalAcceleration,sensor=Gyroscope"
    assert keys == {"part"}
    assert f"--set part={pair} or" in message
    assert_equal_to_file(th.import_record(path, part=pair).record)


def test_an_object_without_a_number_is_left_out_with_its_time(tmp_path: Path):
    rows = objects(nested=True)
    rows[7] = {"t": rows[7]["t"]}
    answers = {"units.time": "s", "units.force": "m/s2", "units.rate": "rad/s"}
    result = imported(tmp_path, "\n".join(map(json.dumps, rows)), answers, name="log.jsonl")
    assert result.record.time_s == pytest.approx(np.delete(TIME, 7), abs=0)
    assert any("a number is missing" in line for line in result.left_out)


@pytest.mark.parametrize("text", ['{"a": 1}', '[{"a": 1}, {"a": 2}]', '{"a": 1}\n{"a": 2}\n{"a"'])
def test_json_that_is_no_table_is_refused_in_a_line(text: str, tmp_path: Path):
    assert "JSON" in refused(tmp_path, text)
