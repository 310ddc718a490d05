"""Known layouts, ranked answers, and the files of the field: the numbers of the record are those of the file."""

import csv
import gzip
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path

import numpy as np
import pytest
from python_calamine import CalamineWorkbook

import trihedron as th
from field_files import field_file
from laboratory_imports import imported, questions_of, refused, written
from trihedron.tools.cli import main
from trihedron.tools.foreign import importing
from trihedron.tools.foreign.presets import presets
from trihedron.tools.foreign.units import scaled_unit
from trihedron.tools.records import kinds

G = 9.80665
COUNT = 60
TURN = np.linspace(0.0, 1.2, COUNT)
FORCE = np.round(9.81 * np.stack([np.sin(TURN), 0.1 + 0.0 * TURN, np.cos(TURN)], axis=1), 5)
RATE = np.round(np.stack([0.01 + 0.0 * TURN, 0.3 + 0.001 * TURN, -0.02 + 0.0 * TURN], axis=1), 6)
STEP = 0.01


def text_of(names: list[str], columns: Sequence[Sequence[object]]) -> str:
    """Return a CSV file of named columns."""
    rows = [",".join(map(str, row)) for row in zip(*columns, strict=True)]
    return "\n".join([",".join(names), *rows])


def channels(values: np.ndarray) -> list[list[float]]:
    """Return the columns of an array (N, 3)."""
    return values.T.tolist()


MICROS = [20326716 + 10000 * k for k in range(COUNT)]
NANOS = [1535630275926451072 + 10_000_000 * k for k in range(COUNT)]
LAYOUTS = {
    "px4": text_of(
        ["timestamp", *(f"gyro_rad[{k}]" for k in range(3)), *(f"accelerometer_m_s2[{k}]" for k in range(3))],
        [MICROS, *channels(RATE), *channels(FORCE)],
    ),
    "ros": text_of(
        ["%time", "field.header.stamp"]
        + [f"field.{name}.{axis}" for name in ("angular_velocity", "linear_acceleration") for axis in "xyz"],
        [[time + 7 for time in NANOS], NANOS, *channels(RATE), *channels(FORCE)],
    ),
    "euroc": text_of(
        ["#timestamp [ns]"]
        + [f"w_RS_S_{axis} [rad s^-1]" for axis in "xyz"]
        + [f"a_RS_S_{axis} [m s^-2]" for axis in "xyz"],
        [NANOS, *channels(RATE), *channels(FORCE)],
    ),
    "ardupilot": text_of(
        ["timestamp", "TimeUS", "I", "GyrX", "GyrY", "GyrZ", "AccX", "AccY", "AccZ", "EG", "EA", "T"],
        [NANOS, MICROS, [0] * COUNT, *channels(RATE), *channels(FORCE), [0] * COUNT, [0] * COUNT, [31.5] * COUNT],
    ),
}
"""Layout -> a file that has it; its truth is FORCE and RATE every 10 ms."""


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_known_layout_is_read_without_a_question(name: str, tmp_path: Path):
    conversion = imported(tmp_path, LAYOUTS[name])
    record = conversion.record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
    assert record.rate == pytest.approx(RATE, abs=1e-15)
    assert np.diff(record.time_s) == pytest.approx(np.full(COUNT - 1, STEP), abs=1e-12)
    assert any(note.startswith(f"columns and units of {name}") for note in conversion.notes)


SECONDS = [f"{STEP * k:.2f}" for k in range(COUNT)]
COUNTER = list(range(COUNT))
DEGREES = np.round(np.degrees(RATE), 8)
SI = {"units.force": "m/s2", "units.rate": "rad/s"}
XYZ = ("x", "y", "z")
XSENS = ["// General information:", "//  MT Manager version:\t2022.0", "//  Update Rate:\t100.0Hz"]
ASKED: dict[str, tuple[str, dict[str, str]]] = {
    "xsens": (
        "\n".join(XSENS)
        + "\n"
        + text_of(
            ["PacketCounter", *(f"Acc_{axis}" for axis in "XYZ"), *(f"Gyr_{axis}" for axis in "XYZ")],
            [COUNTER, *channels(FORCE), *channels(RATE)],
        ).replace(",", "\t"),
        {"units.time": "100 Hz"},
    ),
    "xsens dot": (
        "DeviceTag:,DOT7\nFirmwareVersion:,2.0\n\n"
        + text_of(
            ["PacketCounter", "SampleTimeFine"] + [f"{name}_{axis}" for name in ("Acc", "Gyr") for axis in "XYZ"],
            [COUNTER, MICROS, *channels(FORCE), *channels(DEGREES)],
        ),
        {},
    ),
    "openimu": (
        text_of(
            ["time", *(f"{axis}Accel" for axis in XYZ), *(f"{axis}Rate" for axis in XYZ)],
            [[10 * k for k in COUNTER], *channels(FORCE), *channels(DEGREES)],
        ),
        {"units.time": "ms", "units.force": "m/s2"},
    ),
    "openimu s1": (
        text_of(
            ["timeCntr", "time", *(f"{axis}Accel" for axis in XYZ), *(f"{axis}Rate" for axis in XYZ), "temp"],
            [COUNTER, SECONDS, *channels(np.round(FORCE / G, 12)), *channels(DEGREES), [31.5] * COUNT],
        ),
        {},
    ),
    "imucal": (
        text_of(
            [f"{name}_{axis}" for name in ("acc", "gyr") for axis in XYZ],
            [*channels(FORCE), *channels(DEGREES)],
        ),
        {"units.time": "100 Hz", "units.force": "m/s2", "units.rate": "deg/s"},
    ),
    "blackbox with units": (
        text_of(
            ["loopIteration", "time (us)", *(f"gyroADC[{k}] (deg/s)" for k in range(3))]
            + [f"accSmooth[{k}] (g)" for k in range(3)],
            [COUNTER, MICROS, *channels(DEGREES), *channels(np.round(FORCE / G, 12))],
        ),
        {},
    ),
    "phone with units": (
        text_of(
            [
                "Time (s)",
                *(f"Acceleration {axis} (m/s^2)" for axis in XYZ),
                *(f"Gyroscope {axis} (rad/s)" for axis in XYZ),
            ],
            [SECONDS, *channels(FORCE), *channels(RATE)],
        ),
        {},
    ),
    "PlotJuggler": (
        text_of(
            ["__time"]
            + [f"/imu/{name}/{axis}" for name in ("angular_velocity", "linear_acceleration") for axis in XYZ],
            [SECONDS, *channels(RATE), *channels(FORCE)],
        ),
        SI | {"units.time": "s"},
    ),
    "words behind the axis": (
        text_of(
            ["timestamp_ms", *(f"accel_{axis}_mss" for axis in XYZ), *(f"gyro_{axis}_dps" for axis in XYZ)],
            [[10 * k for k in COUNTER], *channels(FORCE), *channels(DEGREES)],
        ),
        {},
    ),
    "unit words": (
        text_of(
            [
                "t_us",
                *(f"acceleration_{axis}_mps2" for axis in XYZ),
                *(f"angular_rate_{axis}_rad_per_s" for axis in XYZ),
            ],
            [MICROS, *channels(FORCE), *channels(RATE)],
        ),
        {},
    ),
    "brackets and powers": (
        text_of(
            ["Time[s]", *(f"Accel{axis}[m/(s^2)]" for axis in "XYZ"), *(f"Gyro{axis}[°/s]" for axis in "XYZ")],
            [SECONDS, *channels(FORCE), *channels(DEGREES)],
        ),
        {},
    ),
}
"""File of a tool -> its text, and the answers to its only round of questions."""


@pytest.mark.parametrize("name", ASKED)
def test_a_file_of_a_tool_is_read_or_asks_for_what_is_missing(name: str, tmp_path: Path):
    text, answers = ASKED[name]
    if answers:
        keys, message = questions_of(written(tmp_path, text))
        assert keys == set(answers), message
        for key, answer in answers.items():
            assert message.replace("'", "").index(f"{key}={answer}") == message.replace("'", "").index(f"{key}="), key
    record = imported(tmp_path, text, answers).record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-9)
    assert record.rate == pytest.approx(RATE, abs=1e-9)
    assert np.diff(record.time_s) == pytest.approx(np.full(COUNT - 1, STEP), abs=1e-9)


def test_a_layout_whose_unit_contradicts_gravity_is_asked(tmp_path: Path):
    """Readings in g under the names of a layout in m/s² are not taken silently."""
    in_g = text_of(
        ["%time", "field.header.stamp"]
        + [f"field.{name}.{axis}" for name in ("angular_velocity", "linear_acceleration") for axis in "xyz"],
        [NANOS, NANOS, *channels(RATE), *channels(np.round(FORCE / G, 7))],
    )
    keys, message = questions_of(written(tmp_path, in_g))
    assert keys == {"units.force"}
    assert "--set units.force=g or" in message


def test_a_given_unit_that_contradicts_gravity_is_stated(tmp_path: Path):
    text, _ = ASKED["openimu"]
    answers = {"units.time": "ms", "units.force": "g"}
    notes = imported(tmp_path, text, answers).notes
    assert any(note.startswith("|f| is about 9.86 g") for note in notes)
    assert not any("|f|" in note for note in imported(tmp_path, text, answers | {"units.force": "m/s2"}).notes)


def test_acceleration_without_gravity_is_refused(tmp_path: Path):
    """Phones write it beside the true one, under a similar name."""
    names = ["Time (s)", *(f"Linear Acceleration {axis} (m/s^2)" for axis in "xyz")]
    content = text_of(names, [[STEP * k for k in range(COUNT)], *channels(np.round(0.01 * FORCE, 6))])
    assert "or no gravity" in refused(tmp_path, content)


def test_the_size_of_gravity_orders_the_units(tmp_path: Path):
    time = [STEP * k for k in range(COUNT)]
    names = ["time", "ax", "ay", "az", "gx", "gy", "gz"]
    for size, force, rate in ((1.0, "m/s2", "deg/s"), (16384 / 9.81, "16384 LSB/g", "131 LSB/(deg/s)")):
        readings, rates = np.round(size * FORCE, 0 if size > 1.0 else 6), np.round(size * RATE, 0 if size > 1.0 else 6)
        counts = readings.astype(int) if size > 1.0 else readings
        _, message = questions_of(
            written(
                tmp_path, text_of(names, [time, *channels(counts), *channels(rates.astype(int if size > 1 else float))])
            )
        )
        assert f"units.force={force}" in message.replace("'", "")
        assert message.replace("'", "").index(f"units.force={force}") < message.index("units.force=g")
        assert f"units.rate={rate}" in message.replace("'", "") or "units.rate=deg/s" in message
        assert "units.time=s or" in message


def test_two_accelerometers_are_one_question_with_both(tmp_path: Path):
    names = ["TIME", *(f"ACCEL_A355_{k}" for k in range(3)), *(f"ACCEL_B160_{k}" for k in range(3))]
    names += [f"GYRO_{k}" for k in range(3)]
    second = np.round(FORCE + 0.01, 5)
    content = text_of(names, [MICROS, *channels(FORCE), *channels(second), *channels(RATE)])
    keys, message = questions_of(written(tmp_path, content))
    assert keys == {"columns.force", "units.time", "units.rate", "units.force"}
    assert "ACCEL_A355_0,ACCEL_A355_1,ACCEL_A355_2 or" in message
    answers = {"columns.force": "ACCEL_B160_0,ACCEL_B160_1,ACCEL_B160_2", "units.time": "us"}
    answers |= {"units.rate": "rad/s", "units.force": "m/s2"}
    assert imported(tmp_path, content, answers).record.specific_force == pytest.approx(second, abs=1e-12)


@pytest.mark.acceptance
def test_a_table_without_names_is_one_round_of_questions_on_few_lines(tmp_path: Path, capsys):
    """The columns, the kind, the units and two's complement; each line has its answers, the last has the first ones."""
    turn = np.linspace(0.0, 1.2, 600)
    force = np.round(16384 * np.stack([np.sin(turn), 0.1 + 0.0 * turn, np.cos(turn)], axis=1)).astype(int)
    force += np.random.default_rng(5).integers(-40, 40, force.shape)
    rate = np.random.default_rng(6).integers(-300, 300, force.shape)
    columns = [[f"{STEP * k:.2f}" for k in range(600)], *(force % 65536).T.tolist(), *(rate % 65536).T.tolist()]
    path = written(tmp_path, "\n".join("\t".join(map(str, row)) for row in zip(*columns, strict=True)), "log.txt")
    keys, message = questions_of(path)
    assert keys >= {"kind", "columns.force", "columns.rate", "columns.time_s", "integers", "units.force", "units.rate"}
    assert "columns.force=2,3,4 or" in message
    assert "columns.rate=5,6,7" in message
    assert main(["import", str(path), "--out", str(tmp_path / "record.csv")]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert sum(line.startswith("  ") for line in lines) == 5
    ready = next(line for line in lines if line.startswith("the likeliest answers: "))
    words = ready.partition(": ")[2].replace("'", "").split("--set ")[1:]
    answers = dict(word.strip().split("=", 1) for word in words)
    record = th.import_record(path, answers=answers).record
    assert record.specific_force == pytest.approx(force * (G / 16384), rel=1e-12)
    assert record.time_s == pytest.approx(STEP * np.arange(600))


@pytest.mark.acceptance
def test_counts_without_names_are_told_by_the_steadiness_of_their_size(tmp_path: Path):
    """A large bias of gyros is steady, too, but less than gravity."""
    rng = np.random.default_rng(8)
    force = np.array([-132, 196, 24384]) + rng.integers(-40, 40, (400, 3))
    rate = np.array([182, -48, -958]) + rng.integers(-60, 60, (400, 3))
    rows = [
        f"{0.046 * k:.3f}\t" + "\t".join(map(str, [*(force[k] % 65536), *(rate[k] % 65536), 0])) for k in range(400)
    ]
    _, message = questions_of(written(tmp_path, "\n".join(rows), "log.txt"))
    assert "--set columns.force=2,3,4 or" in message
    assert "--set columns.rate=5,6,7 (" in message
    assert "--set columns.time_s=1 (" in message


def test_a_part_of_a_file_without_parts_is_refused(tmp_path: Path):
    with pytest.raises(th.InputError, match="holds no parts"):
        imported(tmp_path, LAYOUTS["px4"], part="imu")


def test_an_unknown_layout_is_refused_with_a_near_one(tmp_path: Path):
    with pytest.raises(th.InputError, match="did you mean 'euroc'"):
        imported(tmp_path, LAYOUTS["euroc"], preset="eurok")


def test_every_layout_has_known_units_and_a_source():
    for name, preset in presets().items():
        for quantity, unit in (preset.units | preset.likely).items():
            scale = scaled_unit(unit)
            assert scale is not None, (name, unit)
            assert scale.quantity == quantity, (name, unit)
        assert preset.title
        assert preset.source


FIELD = {
    "real_header_adis.csv": {"units.time": "2000 Hz", "units.rate": "10 LSB/(deg/s)", "units.force": "800 LSB/g"},
    "real_header_blackbox.csv": {"units.rate": "deg/s", "units.force": "2048 LSB/g"},
    "real_header_px4.csv": {},
    "real_header_rocket.csv": {},
    "real_header_rostopic.csv": {},
    "px4.csv": {},
    "ros.csv": {},
    "euroc.csv": {},
    "mpu.csv": {"units.force": "16384 LSB/g", "units.rate": "131 LSB/(deg/s)"},
    "real_sec_column.csv": {"units.force": "g", "units.rate": "deg/s", "units.temperature": "degC"},
    "real_two_accelerometers.csv": {
        "columns.force": "ACCEL_ADXL355_0,ACCEL_ADXL355_1,ACCEL_ADXL355_2",
        "units.time": "us",
        "units.rate": "rad/s",
        "units.force": "m/s2",
    },
    "pct.txt": {"units.time": "s", "units.force": "m/s2", "units.rate": "rad/s"},
    "import-cw-ccw.csv": {"columns.alpha_deg.positive": "CCW"},
    "six_faces.csv": {},
    "six_positions.csv": {},
    "acc_only.csv": {},
    "real_acc_only.csv": {},
    "hash_space.txt": {
        "columns.force": "wx,wy,wz",
        "columns.rate": "ax,ay,az",
        "units.time": "s",
        "units.force": "m/s2",
        "units.rate": "rad/s",
    },
    "raw_no_sigma.csv": {"readings": "each"},
}
"""File of the field -> the answers to its only round of questions."""


@pytest.mark.first(5)
@pytest.mark.parametrize("name", FIELD)
def test_a_file_of_the_field_takes_one_round_of_questions_at_most(name: str, tmp_path: Path):
    path, answers = field_file(name, tmp_path), FIELD[name]
    if answers:
        keys, message = questions_of(path, {})
        # the advice on readings names a kind
        assert keys - {"kind"} == set(answers), message
    conversion = th.import_record(path, answers=answers)
    record = conversion.record
    origin = {column.column: column for column in conversion.columns}
    delimiter = ";" if name == "real_two_accelerometers.csv" else ("," if path.suffix == ".csv" else " ")
    lines = path.read_text().splitlines()
    if name == "raw_no_sigma.csv":
        lines = [line for line in lines if not line.startswith("#")]
    lines[0] = lines[0].lstrip("%# ")
    rows = list(csv.DictReader(lines, delimiter=delimiter))
    for place, column in enumerate(("f1_mps2", "f2_mps2", "f3_mps2")):
        source = origin[column]
        unit = scaled_unit(answers.get("units.force", source.unit))
        assert unit is not None
        truth = np.array([float(row[source.source]) for row in rows]) * unit.factor
        assert record.specific_force[:, place] == pytest.approx(truth, rel=1e-12, abs=1e-15)


def assert_answered(path: Path, answers: dict[str, str], truth: np.ndarray) -> None:
    """Assert that a file asks for these answers in its only round, and that its readings are then the truth [m/s²]."""
    keys, message = questions_of(path, {})
    assert keys == set(answers), message
    record = th.import_record(path, answers=answers).record
    assert record.specific_force == pytest.approx(truth, rel=1e-12, abs=1e-15)


@pytest.mark.acceptance
def test_counts_of_the_field_are_answered_in_one_round(tmp_path: Path):
    """Zero is in the middle of 16 bits, or the counts are two's complement."""
    path = field_file("counts.csv", tmp_path)
    numbers = np.loadtxt(path, delimiter=";", skiprows=1)
    answers = {"units.force": "16384 LSB/g", "integers": "offset 16"}
    assert_answered(path, answers, (numbers[:, 4:7] - 32768.0) * G / 16384.0)
    path = field_file("real_uint16_counts.txt", tmp_path)
    numbers = np.loadtxt(path)
    signed = np.where(numbers >= 32768.0, numbers - 65536.0, numbers)
    answers = {"kind": "strapdown record", "columns.time_s": "1", "columns.force": "2,3,4", "columns.rate": "5,6,7"}
    answers |= {"units.time": "s", "units.force": "16384 LSB/g", "units.rate": "131 LSB/(deg/s)"}
    answers["integers"] = "signed 16"
    assert_answered(path, answers, signed[:, 1:4] * G / 16384.0)
    assert "--set 'units.rate=131 LSB/(deg/s)' or" in questions_of(path)[1]
    rate = th.import_record(path, answers=answers).record.rate
    assert rate == pytest.approx(np.radians(signed[:, 4:7] / 131.0), rel=1e-12)


@pytest.mark.acceptance
def test_workbooks_of_the_field_are_answered_in_one_round(tmp_path: Path):
    path = field_file("kurz.xlsx", tmp_path)
    rows = CalamineWorkbook.from_path(str(path)).get_sheet_by_index(0).to_python()
    answers = {"columns.alpha_deg": "phi", "columns.beta_deg": "theta", "columns.force": "x,y,z"}
    answers |= {"units.angle": "deg", "units.force": "m/s2"}
    assert_answered(path, answers, np.array([row[3:6] for row in rows[1:]], dtype=float))
    path = field_file("pruefprotokoll_text.xlsx", tmp_path)
    rows = CalamineWorkbook.from_path(str(path)).get_sheet_by_index(0).to_python()
    milli_g = [[float(str(text).replace(",", ".")) for text in row[4:7]] for row in rows[8:48]]
    assert_answered(path, {"missing": "Mittelwert"}, np.array(milli_g) * (1e-3 * G))


def test_names_that_contradict_gravity_are_asked_with_the_columns_crossed(tmp_path: Path):
    """The columns called gyros hold gravity; those called accelerometers are too small in any unit."""
    names = ["t_s", "wx", "wy", "wz", "ax", "ay", "az"]
    content = text_of(names, [SECONDS, *channels(FORCE), *channels(RATE)])
    keys, message = questions_of(written(tmp_path, content))
    assert keys == {"columns.force", "columns.rate", "units.force", "units.rate"}
    assert "--set columns.force=wx,wy,wz or --set columns.force=ax,ay,az" in message
    record = imported(tmp_path, content, SI | {"columns.force": "wx,wy,wz", "columns.rate": "ax,ay,az"}).record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
    assert record.rate == pytest.approx(RATE, abs=1e-15)


@pytest.mark.acceptance
def test_times_of_19_digits_are_exact(tmp_path: Path):
    path = field_file("ros.csv", tmp_path)
    rows = list(csv.DictReader(path.read_text().splitlines()))
    exact = [Decimal(row["field.header.stamp"]) for row in rows]
    truth = [float((time - exact[0]) * Decimal("1e-9")) for time in exact]
    assert th.import_record(path).record.time_s == pytest.approx(truth, abs=1e-12)


def test_packed_files_of_a_known_layout(tmp_path: Path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(LAYOUTS["px4"].encode()))
    assert len(th.import_record(path).record) == COUNT


@pytest.mark.acceptance
def test_rows_of_two_sensors_are_not_mixed(tmp_path: Path):
    """ArduPilot writes its IMUs one after the other, with nearly the same times."""
    lines = LAYOUTS["ardupilot"].splitlines()
    mixed = [lines[0]]
    for line in lines[1:]:
        stamp, micros, _, *rest = line.split(",")
        mixed += [line, ",".join([stamp, str(int(micros) + 40), "1", *rest[:3], "0.0", "0.0", "9.9", *rest[6:]])]
    path = written(tmp_path, "\n".join(mixed))
    keys, message = questions_of(path)
    assert keys == {"part"}
    assert "part=I=0 or" in message
    record = th.import_record(path, part="I=0").record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-12)
    assert th.import_record(path, part="I=1").record.specific_force[:, 2] == pytest.approx(9.9)
    with pytest.raises(th.InputError, match="I=7"):
        th.import_record(path, part="I=7")


@pytest.mark.acceptance
@pytest.mark.parametrize("mark", [",", ";"])
def test_a_large_text_is_read_as_a_small_one(mark: str, tmp_path: Path, monkeypatch):
    """Its columns are read at once; the numbers, the rows that are left out and the record's file are the same."""
    rng = np.random.default_rng(3)
    rows = []
    for k in range(5000):
        numbers = [f"{v:.7f}" for v in (*(9.8 * rng.standard_normal(2)), 9.8, *(0.1 * rng.standard_normal(3)))]
        if k == 4321:
            numbers[1] = "nan"
        rows.append([str(1700000000123456789 + 10_000_000 * k), *numbers])
    names = ["t [ns]", *(f"acc {axis} [m/s2]" for axis in "xyz"), *(f"gyro {axis} [rad/s]" for axis in "xyz")]
    text = "\n".join(mark.join(row) for row in [names, *rows])
    path = written(tmp_path, text if mark == "," else text.replace(".", ","))
    small = th.import_record(path, out=tmp_path / "small.csv")
    monkeypatch.setattr(importing, "LARGE", 1000)
    monkeypatch.setattr(importing, "HEAD", 300_000)
    monkeypatch.setattr(kinds, "LONG", 100)
    large = th.import_record(path, out=tmp_path / "large.csv")
    assert small.left_out == large.left_out
    assert small.first_rows == large.first_rows
    written_records = [th.read_record(tmp_path / name) for name in ("small.csv", "large.csv")]
    for one, other in ((small.record, large.record), written_records):
        for name, values in one.columns().items():
            assert np.array_equal(values, other.columns()[name]), name
    # a word in a late row: the text is read row by row, and the row is named
    path.write_text(path.read_text() + "\n" + mark.join(["Ende", *["x"] * 6]) + "\n")
    assert len(th.import_record(path).record) == len(small.record)


def test_the_page_lists_every_layout():
    """Its table is that of the data."""
    page = (Path(th.__file__).parent / "docs" / "your-file.md").read_text(encoding="utf-8")
    rows = [f"| `{preset.name}` | {preset.title} |" for preset in presets().values()]
    assert "\n".join(["| `--as` | tool |", "|---|---|", *rows]) in page
