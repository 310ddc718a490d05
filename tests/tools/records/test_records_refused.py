"""What is refused of a record, and that one line names file, row and column."""

import math
import os
from pathlib import Path

import polars as pl
import pytest

from record_files import POSITION_HEADER, RAW_HEADER, ROWS, STRAPDOWN_HEADER, VALID, reader, refused, with_field
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, read_record


@pytest.fixture
def record_of(tmp_path):
    return reader(tmp_path / "record.csv")


@pytest.mark.parametrize(
    ("column", "values", "part"),
    [
        ("f1_mps2", [1.0, None, 1.0], "row 2, column f1_mps2: the field is empty"),
        ("f1_mps2", [1.0, 1.0, math.nan], "row 3, column f1_mps2"),
        ("beta_deg", [math.inf, 1.0, 1.0], "row 1, column beta_deg"),
        ("f2_mps2", ["1", "2", "3"], "column f2_mps2: holds String"),
        ("time_s", [True, False, True], "column time_s: holds Boolean"),
        ("position", [1, 1, 2], "row 2, column position"),
        ("f2_mps2", [[1.0], [2.0], [3.0]], "column f2_mps2: holds List"),
    ],
)
def test_parquet_is_refused_like_csv(record_of, tmp_path, column, values, part):
    record_of(VALID)
    frame = pl.read_csv(tmp_path / "record.csv").with_columns(pl.Series(column, values))
    frame.write_parquet(tmp_path / "r.parquet")
    with pytest.raises(InputError, match=r"r\.parquet") as caught:
        read_record(tmp_path / "r.parquet")
    assert part in str(caught.value)


def test_corrupt_parquet_is_refused_without_noise(tmp_path, capfd):
    whole = tmp_path / "whole.parquet"
    pl.DataFrame({name: [1.0, 2.0, 300.0] for name in RAW_HEADER.split(",")}).write_parquet(whole)
    data = whole.read_bytes()
    middle = len(data) // 2
    cases = [b"PAR1", data[:middle], data[:8] + data[-200:], data[:4] + bytes(len(data) - 8) + data[-4:]]
    cases += [data[:at] + b"\xff\xff\xff\xff" + data[at + 4 :] for at in (6, 20, len(data) - 8)]
    for case in cases:
        path = tmp_path / "corrupt.parquet"
        path.write_bytes(case)
        with pytest.raises(InputError, match=r"corrupt\.parquet"):
            read_record(path)
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("text", ["1e400", "-1e999"])
def test_infinite_numbers_are_refused(record_of, text):
    refused(record_of, with_field(1, "f2_mps2", text), "row 3", "column f2_mps2", text, "infinite")


@pytest.mark.parametrize(
    "text", ["nan", "NaN", "inf", "-Infinity", "0x10", "1_000", "abc", "1 2", "١٢", "1e", "--1", "9d8"]
)
@pytest.mark.parametrize("column", ["time_s", "alpha_deg", "f3_mps2", "position"])
def test_what_is_not_a_number_is_refused(record_of, text, column):
    refused(record_of, with_field(2, column, text), "row 4", f"column {column}", "needed")


@pytest.mark.parametrize("column", POSITION_HEADER.split(","))
def test_an_empty_field_is_refused(record_of, column):
    refused(record_of, with_field(0, column, " "), "row 2", f"column {column}", "empty")


@pytest.mark.parametrize("column", ["temperature_degC", "approach_alpha", "approach_beta", "mounting"])
def test_an_empty_optional_field_is_refused(record_of, column):
    rows = [f"{row},1" for row in ROWS]
    refused(record_of, with_field(1, column, "", f"{POSITION_HEADER},{column}", rows), "row 3", column, "empty")


@pytest.mark.parametrize("column", POSITION_HEADER.split(",")[1:])
def test_a_missing_column_is_named(record_of, column):
    header = ",".join(name for name in POSITION_HEADER.split(",") if name != column)
    refused(record_of, f"{header}\n1,2,3,4,5,9.8\n", "row 1", f"'{column}' missing for a position record")


@pytest.mark.parametrize("extra", ["mounting", "approach_alpha", "postion"])
def test_a_position_record_without_positions_is_no_raw_record(record_of, extra):
    refused(record_of, f"{RAW_HEADER},{extra}\n1,2,3,4,5,9.8,1\n", "'position' missing")


def test_a_misspelt_column_is_guessed(record_of):
    text = VALID.replace("f2_mps2", "f2_ms2")
    refused(record_of, text, "'f2_mps2' missing", "is 'f2_ms2' meant?")


@pytest.mark.parametrize("column", ["time_s", "f1_mps2", "mounting", "other"])
def test_a_repeated_column_is_refused(record_of, column):
    header = f"{POSITION_HEADER},{column},{column}"
    refused(record_of, f"{header}\n1,1,1,1,1,1,9.8,1,1\n", "row 1", column, "more than once")


@pytest.mark.parametrize(
    ("column", "value", "row"),
    [("position", "2", 2), ("position", "1", 2), ("time_s", "20.0", 2), ("time_s", "-5", 2), ("position", "1", 1)],
)
def test_position_and_time_must_grow(record_of, column, value, row):
    refused(record_of, with_field(row, column, value), f"row {row + 2}", f"column {column}", "must grow")


@pytest.mark.parametrize("value", ["0", "-1", "1.5", "1e17"])
def test_positions_count_from_one(record_of, value):
    refused(record_of, with_field(0, "position", value), "row 2", "column position", "positive integer")


@pytest.mark.parametrize("value", ["0", "2", "-0.5"])
def test_a_sense_is_plus_or_minus_one(record_of, value):
    rows = [f"{row},1" for row in ROWS]
    text = with_field(1, "approach_beta", value, f"{POSITION_HEADER},approach_beta", rows)
    refused(record_of, text, "row 3", "column approach_beta", "+1 nor -1")


def test_impossible_forces_are_refused(record_of):
    refused(record_of, with_field(1, "f3_mps2", "98.1"), "row 3", "column f3_mps2", "10 times gravity")
    refused(record_of, with_field(1, "f3_mps2", "-1e308"), "row 3", "column f3_mps2", "10 times gravity")
    text = with_field(1, "f3_mps2", "70").replace("0.01,9.80665", "70,9.80665")
    refused(record_of, text, "row 3", "f1_mps2..f3_mps2", "10 times gravity")


def test_readings_in_g_are_refused(record_of):
    refused(record_of, VALID.replace("9.80665", "1.0"), "f1_mps2..f3_mps2", "readings in g?")
    refused(record_of, VALID.replace("9.80665", "15.0"), "0.5 to 1.5")


@pytest.mark.parametrize(
    ("rows", "parts"),
    [
        (["0,1,2,3,0,0,9.8,1,0,,0"], ("row 2", "column q2", "all of q0..q3 or none")),
        (["0,1,2,3,0,0,9.8,,,,", "1,1,2,3,0,0,9.8,1,0,0,0.1"], ("row 3", "q0..q3", "norm")),
        (["0,1,2,3,0,0,9.8,1e200,0,0,0"], ("row 2", "q0..q3", "norm")),
        (["0,1,2,3,0,0,9.8,nan,nan,nan,nan"], ("row 2", "column q0", "not a number")),
    ],
)
def test_a_true_attitude_is_a_unit_quaternion(record_of, rows, parts):
    refused(record_of, "\n".join([f"{STRAPDOWN_HEADER},q0,q1,q2,q3", *rows]), *parts)


def test_part_of_a_quaternion_or_rates_and_increments_are_refused(record_of):
    refused(record_of, f"{STRAPDOWN_HEADER},q0,q1,q2\n0,1,2,3,0,0,9.8,1,0,0\n", "'q3' is missing")
    both = f"{STRAPDOWN_HEADER},dtheta1_rad,dtheta2_rad,dtheta3_rad\n0,1,2,3,0,0,9.8,1,0,0\n"
    refused(record_of, both, "keep one")


@pytest.mark.parametrize(
    ("content", "parts"),
    [
        ("", ("is empty",)),
        ("\n\n# nothing\n", ("is empty",)),
        (POSITION_HEADER + "\n", ("row 1", "no rows")),
        (f"{POSITION_HEADER}\n{ROWS[0]}\n{ROWS[1]},5\n", ("row 3", "8 fields", "7 columns")),
        (f"{POSITION_HEADER}\n\n{ROWS[0]}\n1,2,3\n", ("row 4", "3 fields")),
        (VALID.replace("10.0", '"10.0'), ("row 2", "quote")),
        (VALID.replace("10.0", '"10"0'), ("row 2", "comma-separated")),
        (VALID.replace("9.80665", '"9,80665"'), ("row 2", "decimal point")),
        (VALID.replace(",", ";"), ("row 1", "semicolons")),
        (VALID.replace(",", "\t"), ("row 1", "tabs")),
        (VALID.replace("position,", ","), ("row 1", "field 1 of the header is empty")),
        (VALID.encode("utf-16"), ("UTF-16",)),
        (VALID.encode() + b"\0\1\2", ("binary", "byte")),
        (VALID.encode() + b"# caf\xe9\n", ("row 5", "0xe9", "UTF-8")),
        (b"\xef\xbb\xbf" + VALID.encode() + b"\xff\n", ("row 5", "0xff", "UTF-8")),
        (VALID.replace("10.0", "\x1b[31m"), ("row 2", "column time_s", "\\x1b")),
        ("x" * 300_000, ("row 1",)),
    ],
)
def test_what_is_not_such_a_table_is_refused(record_of, content, parts):
    refused(record_of, content, *parts)


def test_the_first_of_many_faults_is_named(record_of):
    rows = [f"{k},{k},1,1,0,0,9.8" for k in range(1, 40_000)]
    rows[20_000:] = [row.replace("9.8", "x") for row in rows[20_000:]]
    rows[30_000] = "1"
    refused(record_of, "\n".join([POSITION_HEADER, *rows]), "row 20002", "column f3_mps2")


def test_what_is_not_a_file_is_refused(tmp_path):
    cases = {tmp_path: "directory", tmp_path / "absent.csv": "no such file", Path("/dev/null"): "regular file"}
    for path, part in cases.items():
        with pytest.raises(InputError, match=part):
            read_record(path)
    with pytest.raises(InputError, match="no such file"):
        read_record(Path("a\0b"))
    (tmp_path / "text.parquet").write_text(VALID)
    with pytest.raises(InputError, match="PAR1"):
        read_record(tmp_path / "text.parquet")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may read every file")
def test_an_unreadable_file_is_refused(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(VALID)
    path.chmod(0)
    with pytest.raises(InputError, match="cannot be read"):
        read_record(path)


def test_a_strapdown_record_is_no_position_record(record_of, tmp_path):
    record_of(f"{STRAPDOWN_HEADER}\n0,1,2,3,0,0,9.8\n")
    with pytest.raises(InputError, match="strapdown record"):
        read_record(tmp_path / "record.csv", PositionRecord)
