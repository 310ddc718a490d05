"""Records made here: what is written reads back, whole or not at all; rows are selected."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trihedron.tools.errors import InputError
from trihedron.tools.records import (
    PositionRecord,
    RawRecord,
    read_record,
    write_record,
)
from trihedron.tools.records.kinds import degrees_that_read_back


def some_record(rng: np.random.Generator, count: int) -> PositionRecord:
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
    path = tmp_path / "folder" / "record.csv"
    write_record(record, path)
    back = read_record(path, PositionRecord)
    for name in ("position", "time_s", "alpha", "beta", "specific_force", "temperature", "approach_alpha"):
        first, second = getattr(record, name), getattr(back, name)
        # an angle that no number of degrees gives is the nearest one
        np.testing.assert_allclose(second, first, rtol=2.3e-16 if name in ("alpha", "beta") else 0, atol=0)
    np.testing.assert_array_equal(back.alpha, record.alpha)
    assert back.mounting == record.mounting
    again = tmp_path / "again.csv"
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
    assert record.mounting is not None
    assert chosen.mounting == (record.mounting[4], record.mounting[1])
    np.testing.assert_array_equal(chosen.specific_force, record.specific_force[[4, 1]])
    assert len(record.selected(record.alpha > 1e9)) == 0
