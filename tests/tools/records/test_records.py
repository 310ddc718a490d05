"""Reading and writing of records: each kind, in SI and radians, from CSV and Parquet; real ones if present."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trihedron as th
from record_files import POSITION_HEADER, RAW_HEADER, ROWS, STRAPDOWN_HEADER, VALID, measured, reader
from trihedron.tools.errors import InputError
from trihedron.tools.records import (
    BenchRecord,
    PositionRecord,
    RawRecord,
    StrapdownRecord,
    read_record,
    significant_digits,
    write_record,
    written_resolution,
)
from trihedron.tools.records.kinds import degrees_that_read_back


@pytest.fixture
def record_of(tmp_path):
    return reader(tmp_path / "record.csv")


def test_a_position_record_is_read_in_si_and_radians(record_of):
    record = record_of(VALID)
    assert isinstance(record, PositionRecord)
    assert record.position.tolist() == [1, 2, 4]
    assert record.time_s.tolist() == [10.0, 20.0, 30.5]
    np.testing.assert_array_equal(record.alpha, np.deg2rad([0.0, 90.0, 90.0]))
    np.testing.assert_array_equal(record.beta, np.deg2rad([0.0, 0.0, 270.0]))
    assert record.specific_force[2].tolist() == [-9.80665, 0.01, 0.02]
    assert record.row.tolist() == [2, 3, 4]
    assert record.resolution == pytest.approx(0.5e-5, rel=1e-12)
    assert record.temperature is None
    assert record.mounting is None
    assert record.warnings == ()
    # the ideal bench of the contract
    a, b = record.alpha, record.beta
    up = np.stack([np.sin(a) * np.sin(b), np.sin(a) * np.cos(b), np.cos(a)], axis=1)
    assert np.abs(record.specific_force - 9.80665 * up).max() < 0.03


def test_optional_columns_are_read_in_any_order(record_of):
    text = (
        "mounting,f3_mps2,f2_mps2,f1_mps2,beta_deg,alpha_deg,time_s,position,approach_beta,approach_alpha,"
        'temperature_degC\n"first, flat",9.8,0,0,10,20,1,1,-1,+1,21.5\nB,9.8,0,0,10,20,2,2,1,-1,21.6\n'
    )
    record = record_of(text)
    assert record.mounting == ("first, flat", "B")
    assert record.approach_alpha.tolist() == [1.0, -1.0]
    assert record.approach_beta.tolist() == [-1.0, 1.0]
    assert record.temperature.tolist() == [21.5, 21.6]
    assert record.specific_force[0].tolist() == [0.0, 0.0, 9.8]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_line_ends_marks_comments_blanks_and_quotes(record_of, end, mark):
    lines = [
        "# comment",
        "",
        POSITION_HEADER.replace("position", '"position"'),
        "#1,2,3",
        '"1", 10.0 ,5,0,0,0,9.8',
        "  ",
    ]
    record = record_of(mark + end.join([*lines, "2,20,170,0,0,0,-9.8"]))
    assert record.row.tolist() == [5, 7]
    assert record.time_s.tolist() == [10.0, 20.0]


def test_each_kind_is_recognised_by_its_columns(record_of):
    assert isinstance(record_of(f"{RAW_HEADER}\n0.0,20,0,0,0,9.8\n0.1,20,0,0,0,9.8\n"), RawRecord)
    rates = record_of(f"{STRAPDOWN_HEADER},q0,q1,q2,q3\n0.0,1,2,3,0,0,9.8,,,,\n0.1,1,2,3,0,0,9.8,0,-1.0005,0,0\n")
    assert rates.increment is None
    assert rates.rate[0].tolist() == [1.0, 2.0, 3.0]
    assert np.isnan(rates.attitude[0]).all()
    assert rates.attitude[1].tolist() == [0.0, -1.0, 0.0, 0.0]
    increments = record_of(
        STRAPDOWN_HEADER.replace("radps", "rad").replace("w", "dtheta") + "\n1,0.1,0.2,0.3,0,0,9.8\n"
    )
    assert isinstance(increments, StrapdownRecord)
    assert increments.rate is increments.attitude is None
    assert increments.increment is not None
    assert increments.increment[0].tolist() == [0.1, 0.2, 0.3]


@pytest.mark.acceptance
def test_parquet_is_read_like_csv(record_of, tmp_path):
    record_of(VALID)
    pl.read_csv(tmp_path / "record.csv").with_columns(mounting=pl.Series(["a", "a", "b"])).write_parquet(
        tmp_path / "r.pq"
    )
    record = read_record(tmp_path / "r.pq")
    assert isinstance(record, PositionRecord)
    expected = record_of(VALID)
    for name in ("position", "time_s", "alpha", "beta", "specific_force"):
        np.testing.assert_array_equal(getattr(record, name), getattr(expected, name))
    assert record.mounting == ("a", "a", "b")
    assert record.row.tolist() == [1, 2, 3]
    assert record.resolution == 0.0
    record.specific_force[0, 0] = 1.0


def test_unknown_columns_are_left_out_with_a_warning(record_of):
    rows = [f"{row},,x" for row in ROWS]
    record = record_of("\n".join([f"{POSITION_HEADER},temprature_degC,remark", *rows]))
    assert len(record) == 3
    assert len(record.warnings) == 1
    assert "'temprature_degC' (did you mean 'temperature_degC'?)" in record.warnings[0]
    assert "'remark'" in record.warnings[0]


def test_angles_in_radians_are_warned_of(record_of):
    small = VALID.replace("90.0", "1.5708").replace("270.0", "4.7124")
    assert "radians?" in record_of(small).warnings[0]
    assert record_of(VALID.replace("90.0", "0").replace("270.0", "0")).warnings == ()
    assert record_of(VALID.replace("90.0", "0").replace("270.0", "6.29")).warnings == ()


def test_angles_and_gyros_together_are_read_as_asked_for(record_of, tmp_path):
    header = RAW_HEADER + ",w1_radps,w2_radps,w3_radps"
    rows = [f"{0.1 * k:.1f},20,30,0,0,9.8,0,0,0" for k in range(20)]
    record = record_of("\n".join([header, *rows]))
    assert isinstance(record, BenchRecord)
    strapdown = read_record(tmp_path / "record.csv", StrapdownRecord)
    assert "'alpha_deg'" in strapdown.warnings[0]
    assert len(read_record(tmp_path / "record.csv", PositionRecord)) == 1


@pytest.mark.parametrize(
    ("text", "digits"),
    [("9.80665", 6), ("-0.01230", 4), ("1e5", 1), ("980", 3), ("0.00", 0), (".5", 1), (" +1.50E-3 ", 3)],
)
def test_written_digits_are_counted(text, digits):
    assert significant_digits(text) == digits


@pytest.mark.parametrize(
    ("form", "half_digit"), [("%.5f", 0.5e-5), ("%.9f", 0.5e-9), ("%.6g", 0.5e-5), ("%.4e", 0.5e-4), ("%.9g", 0.5e-8)]
)
def test_resolution_is_half_a_last_digit_of_the_largest_reading_and_some_reading_is_off_by_it(form, half_digit):
    values = np.random.default_rng(1).uniform(-9.80665, 9.80665, 500)
    texts = [form % value for value in values]
    error = max(abs(float(text) - value) for text, value in zip(texts, values, strict=True))
    for written in (texts, [text.rstrip("0") if "e" not in text else text for text in texts]):
        resolution = written_resolution(float(np.abs(values).max()), max(map(significant_digits, written)))
        assert resolution == pytest.approx(half_digit, rel=1e-12)
        assert 0.95 * resolution < error <= resolution * (1 + 1e-9)


def test_a_number_that_no_double_holds_has_no_resolution():
    assert written_resolution(float("1e400"), 2) == 0.0


def test_what_rounding_does_to_readings_and_angles_is_nearly_what_is_allowed_for_it(tmp_path):
    """Use angles of nine digits and readings of six, with the worst rounding."""
    rng = np.random.default_rng(2)
    count = 300
    off = np.where(rng.random((count, 5)) < 0.5, -1.0, 1.0) * 0.499
    angles = np.deg2rad((np.round(rng.uniform(0, 359, (count, 2)) * 1e6) + off[:, :2]) * 1e-6)
    force = (np.round(rng.uniform(-5, 5, (count, 3)) * 1e5) + off[:, 2:]) * 1e-5
    force[:, 2] += np.copysign(5.0, force[:, 2])
    true = PositionRecord(np.arange(1, count + 1), 1.0 * np.arange(count), angles[:, 0], angles[:, 1], force)
    columns = {name: np.round(v, 5 if name in force_columns else 6) for name, v in true.columns().items()}
    pl.DataFrame(columns).write_csv(tmp_path / "r.csv")
    back = read_record(tmp_path / "r.csv", PositionRecord)
    rounding = np.abs(back.specific_force - true.specific_force).max()
    assert 0.99 * back.resolution < rounding <= back.resolution
    turned = np.abs(np.stack([back.alpha - true.alpha, back.beta - true.beta])).max()
    assert 0.99 * back.angle_resolution < turned <= back.angle_resolution
    assert back.written_to(9.8) >= rounding / 9.8 + turned


force_columns = RAW_HEADER.split(",")[3:]


@pytest.mark.parametrize(("angle", "expected"), [("359.9999999", 0.5e-7), ("12.34", 0.0), ("90", 0.0)])
def test_digits_of_angles_are_roundings_where_they_are_many(record_of, angle, expected):
    """Angles of few digits are settings, which the encoders reached."""
    text = f"{POSITION_HEADER},temperature_degC\n1,10.0,{angle},0.0,0.01,0.02,9.80665,21.50\n"
    record = record_of(text)
    assert isinstance(record, PositionRecord)
    assert record.angle_resolution == pytest.approx(np.deg2rad(expected), rel=1e-12)
    assert record.temperature_resolution == pytest.approx(0.005, rel=1e-12)
    assert record.written_to(9.80665) == pytest.approx(0.5e-5 / 9.80665 + 2.0 * np.deg2rad(expected), rel=1e-12)


def test_arrays_of_different_lengths_are_no_record():
    with pytest.raises(ValueError, match="beta"):
        RawRecord(np.zeros(3), np.zeros(3), np.zeros(2), np.zeros((3, 3)))


@pytest.mark.acceptance
def test_a_real_record_with_optical_attitude():
    record = measured("broad-03")
    assert len(record) == 58412
    assert record.attitude is not None
    is_known = ~np.isnan(record.attitude[:, 0])
    assert np.count_nonzero(~is_known) == 4086
    assert np.abs(np.linalg.norm(record.attitude[is_known], axis=1) - 1.0).max() < 1e-15
    assert record.warnings == ()


def test_a_real_record_without_truth():
    record = measured("mpu9150-0")
    assert record.attitude is None
    assert np.median(np.linalg.norm(record.specific_force, axis=1)) == pytest.approx(9.81, rel=0.03)


def some_record(rng: np.random.Generator, count: int) -> Any:
    return PositionRecord(
        position=np.arange(1, count + 1),
        time_s=np.cumsum(rng.uniform(1, 2, count)),
        alpha=np.deg2rad(np.round(rng.uniform(-400, 400, count), 4)),
        beta=np.deg2rad(rng.uniform(-400, 400, count)),
        specific_force=rng.uniform(-9, 9, (count, 3)),
        temperature=rng.uniform(15, 25, count),
        approach_alpha=rng.choice([-1.0, 1.0], count),
        approach_beta=rng.choice([-1.0, 1.0], count),
        mounting=tuple(rng.choice(["flat", 'on "edge", up'], count)),
    )


def test_a_position_record_written_reads_back_bit_for_bit(tmp_path):
    record = some_record(np.random.default_rng(2), 50)
    path, again = tmp_path / "folder" / "record.csv", tmp_path / "again.csv"
    write_record(record, path)
    back = read_record(path, PositionRecord)
    for name in ("position", "time_s", "alpha", "specific_force", "temperature", "approach_alpha"):
        np.testing.assert_array_equal(getattr(back, name), getattr(record, name))
    # an angle that no number of degrees gives becomes the nearest one
    np.testing.assert_allclose(back.beta, record.beta, rtol=2.3e-16, atol=0)
    assert back.mounting == record.mounting
    write_record(back, again)
    assert again.read_bytes() == path.read_bytes()


def test_decimals_are_as_asked_for(tmp_path):
    record = some_record(np.random.default_rng(3), 5)
    write_record(record, tmp_path / "record.csv", decimals=6)
    line = (tmp_path / "record.csv").read_text().splitlines()[1].split(",")
    assert all(len(field.split(".")[1]) == 6 for field in line[1:7])
    back = read_record(tmp_path / "record.csv", PositionRecord)
    assert np.abs(back.specific_force - record.specific_force).max() <= back.resolution * (1 + 1e-9)
    assert back.resolution == pytest.approx(0.5e-6, rel=1e-12)


def test_a_raw_record_written_reads_back(tmp_path):
    rng = np.random.default_rng(4)
    angles = np.deg2rad(np.round(rng.uniform(0, 360, (2, 100)), 6))
    raw = RawRecord(0.1 * np.arange(100), angles[0], angles[1], rng.uniform(-9, 9, (100, 3)))
    write_record(raw, tmp_path / "raw.csv")
    back = read_record(tmp_path / "raw.csv")
    assert isinstance(back, RawRecord)
    for name in ("time_s", "alpha", "beta", "specific_force"):
        np.testing.assert_array_equal(getattr(back, name), getattr(raw, name))


def test_what_could_not_be_read_again_is_not_written(tmp_path):
    raw = RawRecord(np.array([0.001, 0.002]), np.zeros(2), np.zeros(2), np.full((2, 3), 5.0))
    with pytest.raises(InputError, match="time_s does not grow"):
        write_record(raw, tmp_path / "raw.csv", decimals=2)
    raw.specific_force[0, 1] = math.nan
    with pytest.raises(InputError, match="f2_mps2"):
        write_record(raw, tmp_path / "raw.csv")
    assert list(tmp_path.iterdir()) == []


@given(st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=20))
def test_degrees_read_back_to_the_same_radians(degrees):
    radians = np.deg2rad(np.array(degrees))
    np.testing.assert_array_equal(np.deg2rad(degrees_that_read_back(radians)), radians)


def test_degrees_are_as_short_as_they_were():
    degrees = np.array([0.1, 20.1, 65.0, 359.999, 12.3456])
    assert degrees_that_read_back(np.deg2rad(degrees)).tolist() == degrees.tolist()


def test_rows_are_selected_in_the_order_asked_for():
    record = some_record(np.random.default_rng(5), 6)
    chosen = record.selected(np.array([4, 1]))
    assert chosen.position.tolist() == [5, 2]
    assert chosen.row.tolist() == [5, 2]
    assert chosen.mounting == (record.mounting[4], record.mounting[1])
    np.testing.assert_array_equal(chosen.specific_force, record.specific_force[[4, 1]])
    assert len(record.selected(record.alpha > 1e9)) == 0


def long_record(rows: int = 20_000) -> list[str]:
    """Return the lines of a strapdown record whose numbers have all their digits."""
    draws = np.random.default_rng(7)
    values = draws.standard_normal((rows, 6)) * 10.0 ** draws.integers(-12, 0, (rows, 6))
    values[:, 5] += 9.8
    lines = ["# a bench", "", STRAPDOWN_HEADER]
    for row, readings in enumerate(values.tolist()):
        lines.append(",".join([str(0.01 * row), *map(repr, readings)]))
    return lines


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("end", "last"),
    [("\n", ""), ("\r\n", "\r\n"), ("\n", "\n# the end\n"), ("\n", "\n\n")],
    ids=["lines", "windows", "comment behind", "blank behind"],
)
def test_a_long_file_has_the_numbers_that_python_reads(record_of, end, last):
    lines = long_record()
    record = record_of(end.join(lines) + last)
    expected = np.array([[float(field) for field in line.split(",")] for line in lines[3:]])
    np.testing.assert_array_equal(record.time_s, expected[:, 0])
    np.testing.assert_array_equal(record.rate, expected[:, 1:4])
    np.testing.assert_array_equal(record.specific_force, expected[:, 4:])
    np.testing.assert_array_equal(record.row, np.arange(4, 20_004))


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("199.0,1,2,3,4,5", ("row 19904", "6 fields")),
        ("199.0,1,2,3,4,5,6,7", ("row 19904", "8 fields")),
        ("199.0,1,2,3,4,5,", ("row 19904", "column f3_mps2", "empty")),
        ("199.0,1,2,3,4,5,1e400", ("row 19904", "column f3_mps2", "infinite")),
        ("199.0,1,2,3,4,1-5,6", ("row 19904", "column f2_mps2", "1-5")),
        ("199.0,1,nan,3,4,5,6", ("row 19904", "column w2_radps", "nan")),
        ("199.0,1,2\r,3,4,5,6", ("row 19904",)),
    ],
)
def test_a_fault_far_behind_the_head_of_a_file_is_named(tmp_path, line, words):
    lines = long_record()
    lines[19_903] = line
    path = tmp_path / "long.csv"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError) as refusal:
        read_record(path)
    for word in words:
        assert word in str(refusal.value)


@pytest.mark.parametrize("decimals", [4, None])
def test_a_text_cut_inside_its_last_number_is_warned_of(tmp_path: Path, decimals: int | None) -> None:
    rng = np.random.default_rng(2)
    readings = rng.normal(0.0, 9.8, (40, 3))
    texts = [
        [repr(value) if decimals is None else f"{value:.{decimals}f}" for value in row] for row in readings.tolist()
    ]
    body = [f"{0.1 * number:.1f},{','.join(row)}" for number, row in enumerate(texts)]
    record, log = tmp_path / "record.csv", tmp_path / "log.csv"
    whole = "\n".join(["time_s,f1_mps2,f2_mps2,f3_mps2", *body])
    foreign = "\n".join(["t [s],ax [m/s2],ay [m/s2],az [m/s2]", *body])
    lost = 2 if decimals else 12
    for cut, is_warned in ((0, False), (lost, True)):
        record.write_text(whole[: len(whole) - cut])
        log.write_text(foreign[: len(foreign) - cut])
        warnings = th.read_record(record).warnings
        notes = th.import_record(log).notes
        for lines in (warnings, notes):
            assert any("cut inside its last number" in line for line in lines) == is_warned
    record.write_text(whole[:-lost] + "\n")
    assert not any("cut inside" in line for line in th.read_record(record).warnings)
