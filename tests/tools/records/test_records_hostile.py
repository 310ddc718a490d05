"""Hostile files give a record or one line, nothing else."""

from pathlib import Path

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from record_files import POSITION_HEADER, RAW_HEADER, STRAPDOWN_HEADER
from trihedron.tools.errors import InputError
from trihedron.tools.records import PositionRecord, read_record

PIECES = [
    b",",
    b"\n",
    b'"',
    b"#",
    b"\r",
    b"-",
    b"e",
    b"nan",
    b"1e400",
    b"\0",
    b"\xff",
    "é".encode(),
    b"_",
    b" ",
    b"9" * 400,
]


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_a_mutated_file_gives_a_record_or_one_line(tmp_path, data):
    header = data.draw(st.sampled_from([POSITION_HEADER + ",mounting", STRAPDOWN_HEADER + ",q0,q1,q2,q3"]))
    body = "1,1,10,20,0,0,9.8,a\n2,2,70,80,0,0,9.8,b\n"
    if header.startswith("time_s"):
        body = "1,1,2,3,0,0,9.8,,,,\n2,1,2,3,0,0,9.8,1,0,0,0\n"
    content = bytearray(f"{header}\n{body}".encode())
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(content)))
        length = data.draw(st.integers(0, 6))
        content[at : at + length] = data.draw(st.one_of(st.sampled_from(PIECES), st.binary(max_size=4)))
    check_hostile(tmp_path / "record.csv", bytes(content))


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=300))
def test_random_bytes_give_one_line(tmp_path, content):
    check_hostile(tmp_path / "record.csv", content)


@settings(max_examples=200, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(numbers=st.lists(st.lists(st.floats(), min_size=6, max_size=6), min_size=1, max_size=12))
def test_any_numbers_in_a_raw_record_give_a_record_or_one_line(tmp_path, numbers):
    rows = [",".join(repr(number) for number in row) for row in numbers]
    check_hostile(tmp_path / "record.csv", "\n".join([RAW_HEADER, *rows]).encode())


def check_hostile(path: Path, content: bytes) -> None:
    path.write_bytes(content)
    for wanted in ((), (PositionRecord,)):
        record, message = None, ""
        try:
            record = read_record(path, *wanted)
        except InputError as error:
            message = str(error)
        if record is None:
            assert message.startswith(f"{path}: ")
            assert "\n" not in message
        else:
            assert len(record) > 0
            assert np.isfinite(record.specific_force).all()
            assert np.isfinite(record.time_s).all()
