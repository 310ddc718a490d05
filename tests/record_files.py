"""Files of records for the tests: headers, a valid position record, ways to spoil it."""

from collections.abc import Callable
from pathlib import Path

import pytest

from trihedron.tools.demo import WHERE_TO_GET, find_record
from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord, read_record

POSITION_HEADER = "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2"
RAW_HEADER = "time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2"
STRAPDOWN_HEADER = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
ROWS = ["1,10.0,0.0,0.0,0.01,0.02,9.80665", "2,20.0,90.0,0.0,0.01,9.80665,0.02", "4,30.5,90.0,270.0,-9.80665,0.01,0.02"]
VALID = "\n".join([POSITION_HEADER, *ROWS, ""])


def reader(path: Path) -> Callable:
    """Return a function that writes its argument to the path and reads it as a record."""

    def read(content: str | bytes):
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return read_record(path)

    return read


def refused(read_text, content: str | bytes, *parts: str) -> str:
    """Return the one-line refusal of the content; assert that it has these parts."""
    with pytest.raises(InputError) as caught:
        read_text(content)
    message = str(caught.value)
    assert "\n" not in message
    assert "record.csv" in message
    for part in parts:
        assert part in message
    return message


def with_field(row: int, column: str, value: str, header: str = POSITION_HEADER, rows=ROWS) -> str:
    """Return the valid record with one field replaced; `row` counts data rows from 0."""
    lines = [line.split(",") for line in (header, *rows)]
    lines[row + 1][lines[0].index(column)] = value
    return "\n".join(",".join(line) for line in lines) + "\n"


def measured(name: str) -> StrapdownRecord:
    """Return one of the real records; without it the test is skipped."""
    path = find_record(f"{name}.strapdown.csv")
    if path is None:
        pytest.skip(WHERE_TO_GET)
    return read_record(path, StrapdownRecord)
