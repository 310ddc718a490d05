"""Files of records for the tests: headers, a valid position record, ways to spoil it."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest

from trihedron.tools.errors import InputError
from trihedron.tools.records import StrapdownRecord, read_record

POSITION_HEADER = "position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2"
RAW_HEADER = "time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2"
STRAPDOWN_HEADER = "time_s,w1_radps,w2_radps,w3_radps,f1_mps2,f2_mps2,f3_mps2"
ROWS = ["1,10.0,0.0,0.0,0.01,0.02,9.80665", "2,20.0,90.0,0.0,0.01,9.80665,0.02", "4,30.5,90.0,270.0,-9.80665,0.01,0.02"]
VALID = "\n".join([POSITION_HEADER, *ROWS, ""])
VARIABLE = "TRIHEDRON_DATA"
"""Environment variable that names the folder of the measured records."""
WHERE_TO_GET = (
    "{} is not here: put it into a folder and name that in ${}. Records broad-NN are trials of D. Laidig et al., doi "
    "10.3390/data6070072 (github.com/dlaidig/broad, CC BY 4.0), written as strapdown records"
)


def find_record(name: str) -> Path | None:
    """Return a measured record by its file's name, None if it is not there.

    It is looked for in the folder that $TRIHEDRON_DATA names, then in `../shared/data` beside the checkout.
    """
    folders = [Path(__file__).resolve().parents[2] / "shared" / "data"]
    if os.environ.get(VARIABLE):
        folders.insert(0, Path(os.environ[VARIABLE]))
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


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
    file = f"{name}.strapdown.csv"
    path = find_record(file)
    if path is None:
        pytest.skip(WHERE_TO_GET.format(file, VARIABLE))
    return read_record(path, StrapdownRecord)
