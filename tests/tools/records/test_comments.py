"""Comment lines of a record are kept with it, and its own keys have an effect."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from trihedron.tools.records import PositionRecord, read_record, write_record

TABLE = """position,time_s,alpha_deg,beta_deg,f1_mps2,f2_mps2,f3_mps2
1,1.0,0,0,0.1234,0.1234,9.8066
2,2.0,90,0,0.1234,9.8066,0.1234
"""


def read(folder: Path, *comments: str) -> PositionRecord:
    path = folder / "record.csv"
    path.write_text("".join(f"# {line}\n" for line in comments) + TABLE, encoding="utf-8")
    return read_record(path, PositionRecord)


def test_keys_and_values_are_kept_and_written_again(tmp_path: Path):
    record = read(tmp_path, "Serial number: A-0017", "a title", "Operator: J. Groß: second shift")
    assert record.about == {"Serial number": "A-0017", "Operator": "J. Groß: second shift"}
    write_record(record, tmp_path / "again.csv")
    again = read_record(tmp_path / "again.csv", PositionRecord)
    assert again.about == record.about
    assert np.array_equal(again.specific_force, record.specific_force)


def test_the_coarser_resolution_counts(tmp_path: Path):
    """The digits of a record show its resolution; the comment gives that of its source."""
    digits = read(tmp_path).resolution
    assert digits == pytest.approx(5e-5)
    assert read(tmp_path, "resolution_mps2: 4e-3").resolution == pytest.approx(4e-3)
    assert read(tmp_path, "resolution_mps2: 1e-9").resolution == digits


def test_scatter_is_the_noise_bounds_evidence(tmp_path: Path):
    record = read(tmp_path, "scatter_mps2: 1e-4 2e-4 3e-4")
    assert record.scatter is not None
    assert record.scatter.tolist() == [[1e-4, 2e-4, 3e-4]] * 2
    assert read(tmp_path).scatter is None


@pytest.mark.parametrize(
    "line", ["resolution_mps2: fine", "resolution_deg: -1", "scatter_mps2: 1 2", "scatter_mps2: 1 2 nan"]
)
def test_an_own_key_that_says_nothing_is_refused_with_its_row(line: str, tmp_path: Path):
    with pytest.raises(th.InputError, match=rf"row 2: comment {line.split(':')[0]}: "):
        read(tmp_path, "Serial number: 1", line)


def test_what_could_not_be_read_again_is_written_in_one_line(tmp_path: Path):
    record = replace(read(tmp_path), about={"a:b": "first\nsecond", "": ""})
    write_record(record, tmp_path / "again.csv")
    assert read_record(tmp_path / "again.csv", PositionRecord).about == {"a b": "first second", "remark": "-"}
