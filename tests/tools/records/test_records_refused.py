"""Files that are not records are refused in a line with file, row, column; hostile files give a record or such a
line."""

import math
import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import trihedron as th
from record_files import POSITION_HEADER, RAW_HEADER, ROWS, STRAPDOWN_HEADER, VALID, reader, refused, with_field
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, read_record

COLUMNS = POSITION_HEADER.split(",")
NO_NUMBERS = ("nan", "NaN", "inf", "-Infinity", "0x10", "1_000", "abc", "1 2", "١٢", "1e", "--1", "9d8")
PIECES = [*(bytes([c]) for c in b',\n"#\r-e\0\xff_ '), b"nan", b"1e400", "é".encode(), b"9" * 400]


def more(column: str, row: int, value: str) -> str:
    """Return the valid record with a further column that has this field."""
    return with_field(row, column, value, f"{POSITION_HEADER},{column}", [f"{line},1" for line in ROWS])


def strapdown(*rows: str, columns: str = "q0,q1,q2,q3") -> str:
    return "\n".join([f"{STRAPDOWN_HEADER},{columns}", *rows])


def without(column: str) -> str:
    return ",".join(name for name in COLUMNS if name != column) + "\n1,2,3,4,5,9.8\n"


REFUSED: list[tuple[str | bytes, tuple[str, ...]]] = [
    *((with_field(1, "f2_mps2", text), ("row 3", "column f2_mps2", text, "infinite")) for text in ("1e400", "-1e999")),
    *(
        (with_field(2, column, text), ("row 4", f"column {column}", "needed"))
        for text in NO_NUMBERS
        for column in ("time_s", "alpha_deg", "f3_mps2", "position")
    ),
    *((with_field(0, column, " "), ("row 2", f"column {column}", "empty")) for column in COLUMNS),
    *(
        (more(column, 1, ""), ("row 3", column, "empty"))
        for column in ("temperature_degC", "approach_alpha", "approach_beta", "mounting")
    ),
    *((without(column), ("row 1", f"'{column}' missing for a position record")) for column in COLUMNS[1:]),
    *(
        (f"{RAW_HEADER},{extra}\n1,2,3,4,5,9.8,1\n", ("'position' missing",))
        for extra in ("mounting", "approach_alpha", "postion")
    ),
    (VALID.replace("f2_mps2", "f2_ms2"), ("'f2_mps2' missing", "is 'f2_ms2' meant?")),
    *(
        (f"{POSITION_HEADER},{column},{column}\n1,1,1,1,1,1,9.8,1,1\n", ("row 1", column, "more than once"))
        for column in ("time_s", "f1_mps2", "mounting", "other")
    ),
    *(
        (with_field(row, column, value), (f"row {row + 2}", f"column {column}", "must grow"))
        for column, value, row in (
            ("position", "2", 2),
            ("position", "1", 2),
            ("time_s", "20.0", 2),
            ("time_s", "-5", 2),
            ("time_s", "20.0000000001", 2),
            ("position", "1", 1),
        )
    ),
    *(
        (with_field(0, "position", value), ("row 2", "column position", "positive integer"))
        for value in ("0", "-1", "1.5", "1e17")
    ),
    *(
        (more("approach_beta", 1, value), ("row 3", "column approach_beta", "+1 nor -1"))
        for value in ("0", "2", "-0.5")
    ),
    *(
        (with_field(1, "f3_mps2", value), ("row 3", "column f3_mps2", "10 times gravity"))
        for value in ("98.1", "-1e308")
    ),
    (
        with_field(1, "f3_mps2", "70").replace("0.01,9.80665", "70,9.80665"),
        ("row 3", "f1_mps2..f3_mps2", "10 times gravity"),
    ),
    (VALID.replace("9.80665", "1.0"), ("f1_mps2..f3_mps2", "readings in g?")),
    (VALID.replace("9.80665", "15.0"), ("0.5 to 1.5",)),
    (strapdown("0,1,2,3,0,0,9.8,1,0,,0"), ("row 2", "column q2", "all of q0..q3 or none")),
    (strapdown("0,1,2,3,0,0,9.8,,,,", "1,1,2,3,0,0,9.8,1,0,0,0.1"), ("row 3", "q0..q3", "norm")),
    (strapdown("0,1,2,3,0,0,9.8,1e200,0,0,0"), ("row 2", "q0..q3", "norm")),
    (strapdown("0,1,2,3,0,0,9.8,inf,0,0,0"), ("row 2", "column q0", "infinite")),
    (strapdown("0,1,2,3,0,0,9.8,1,0,0", columns="q0,q1,q2"), ("'q3' is missing",)),
    (strapdown("0,1,2,3,0,0,9.8,1,0,0", columns="dtheta1_rad,dtheta2_rad,dtheta3_rad"), ("keep one",)),
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
]


def test_what_is_no_record_is_refused_in_one_line(tmp_path):
    read_text = reader(tmp_path / "record.csv")
    for content, parts in REFUSED:
        refused(read_text, content, *parts)


@pytest.mark.acceptance
def test_the_first_of_many_faults_is_named(tmp_path):
    rows = [f"{k},{k},1,1,0,0,9.8" for k in range(1, 40_000)]
    rows[20_000:] = [row.replace("9.8", "x") for row in rows[20_000:]]
    rows[30_000] = "1"
    refused(reader(tmp_path / "record.csv"), "\n".join([POSITION_HEADER, *rows]), "row 20002", "column f3_mps2")


@pytest.mark.acceptance
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
def test_parquet_is_refused_like_csv(tmp_path, column, values, part):
    reader(tmp_path / "record.csv")(VALID)
    frame = pl.read_csv(tmp_path / "record.csv").with_columns(pl.Series(column, values))
    frame.write_parquet(tmp_path / "r.parquet")
    with pytest.raises(InputError, match=r"r\.parquet") as caught:
        read_record(tmp_path / "r.parquet")
    assert part in str(caught.value)


def test_corrupt_parquet_is_refused_without_noise(tmp_path, capfd):
    path = tmp_path / "corrupt.parquet"
    pl.DataFrame({name: [1.0, 2.0, 300.0] for name in RAW_HEADER.split(",")}).write_parquet(path)
    content = path.read_bytes()
    cases = [
        b"PAR1",
        content[: len(content) // 2],
        content[:8] + content[-200:],
        content[:4] + bytes(len(content) - 8) + content[-4:],
    ]
    cases += [content[:at] + b"\xff\xff\xff\xff" + content[at + 4 :] for at in (6, 20, len(content) - 8)]
    for case in cases:
        path.write_bytes(case)
        with pytest.raises(InputError, match=r"corrupt\.parquet"):
            read_record(path)
    assert capfd.readouterr().err == ""


@pytest.mark.acceptance
@pytest.mark.parametrize(("wrong", "lines"), [(3, 3), (20, 20), (21, 4), (500, 4)])
def test_many_values_out_of_range_have_one_line_together(tmp_path, wrong, lines):
    rows = [f"{k / 100},{2e5 if k < wrong else 0.1},0,0,0,0,9.8" for k in range(600)]
    path = tmp_path / "record.csv"
    path.write_text("\n".join([STRAPDOWN_HEADER, *rows]))
    problems = th.check(path).problems
    assert len(problems) == lines
    assert problems[0].line == 2
    if wrong > lines:
        assert f"{wrong - 3} more values, to row {wrong + 1}" in str(problems[-1])


def test_what_is_not_a_file_or_of_another_kind_is_refused(tmp_path):
    cases = {tmp_path: "directory", tmp_path / "absent.csv": "no such file", Path("/dev/null"): "regular file"}
    for path, part in {**cases, Path("a\0b"): "no such file"}.items():
        with pytest.raises(InputError, match=part):
            read_record(path)
    (tmp_path / "text.parquet").write_text(VALID)
    with pytest.raises(InputError, match="PAR1"):
        read_record(tmp_path / "text.parquet")
    (tmp_path / "s.csv").write_text(f"{STRAPDOWN_HEADER}\n0,1,2,3,0,0,9.8\n")
    with pytest.raises(InputError, match="is a strapdown record"):
        read_record(tmp_path / "s.csv", PositionRecord)


hostile = settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])


@hostile
@given(data=st.data())
def test_a_mutated_file_gives_a_record_or_one_line(tmp_path, data):
    texts = (
        f"{POSITION_HEADER},mounting\n1,1,10,20,0,0,9.8,a\n2,2,70,80,0,0,9.8,b\n",
        strapdown("1,1,2,3,0,0,9.8,,,,", "2,1,2,3,0,0,9.8,1,0,0,0\n"),
    )
    content = bytearray(data.draw(st.sampled_from(texts)).encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 6))
        content[at : at + length] = data.draw(st.one_of(st.sampled_from(PIECES), st.binary(max_size=4)))
    check_hostile(tmp_path / "record.csv", bytes(content))


@pytest.mark.acceptance
@hostile
@given(content=st.binary(max_size=300))
def test_random_bytes_give_one_line(tmp_path, content):
    check_hostile(tmp_path / "record.csv", content)


@pytest.mark.acceptance
@hostile
@given(numbers=st.lists(st.lists(st.floats(), min_size=6, max_size=6), min_size=1, max_size=12))
def test_any_numbers_in_a_raw_record_give_a_record_or_one_line(tmp_path, numbers):
    rows = [",".join(map(repr, row)) for row in numbers]
    check_hostile(tmp_path / "record.csv", "\n".join([RAW_HEADER, *rows]).encode())


def check_hostile(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    for kinds in ((), (PositionRecord,)):
        record, message = None, ""
        try:
            record = read_record(path, *kinds)
        except InputError as error:
            message = str(error)
        if record is None:
            assert message.startswith(f"{path}: ")
            assert "\n" not in message
        else:
            assert len(record) > 0
            assert np.isfinite(record.specific_force).all()
            assert np.isfinite(record.time_s).all()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="the superuser may read every file")
def test_an_unreadable_file_is_refused(tmp_path):
    path = tmp_path / "record.csv"
    path.write_text(VALID)
    path.chmod(0)
    with pytest.raises(InputError, match="cannot be read"):
        read_record(path)
