"""Single rows that no motion makes: their rests are left out and reported, and the rest of the record is used."""

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator.carried import strapdown_record
from generator.runs import PROGRAMME, Bench
from record_files import RAW_HEADER, STRAPDOWN_HEADER, measured, reader, refused
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.motion import inspect_record
from trihedron.tools.records import StrapdownRecord, average_rests, find_rests, read_record, write_record


@pytest.fixture(scope="module")
def clean() -> Any:
    return strapdown_record(seed=1)


def struck(record: Any, row: int, force: float = 120.0) -> Any:
    """Return the record with one reading that no hand makes."""
    values = record.specific_force.copy()
    values[row, 1] = force
    return replace(record, specific_force=values)


def middles(record: StrapdownRecord) -> tuple[int, int]:
    """Return a row in a rest, and one in the move after it."""
    rows = inspect_record(record).rests.rows
    return (rows[3].start + rows[3].stop) // 2, (rows[3].stop + rows[4].start) // 2


def test_a_knock_is_read_and_said_with_its_row(tmp_path):
    read_text = reader(tmp_path / "record.csv")
    rows = [f"{k},0,0,0,0,0,{9.8 if k != 7 else 130.0}" for k in range(20)]
    line = read_text("\n".join([STRAPDOWN_HEADER, *rows]) + "\n").warnings[0]
    assert "row 9 (130 m/s²)" in line
    assert "left out" in line
    # The unit is wrong, not a row: every row is beyond.
    refused(read_text, "\n".join([STRAPDOWN_HEADER, *(f"{k},0,0,0,0,0,981" for k in range(20))]), "median of |f|")
    refused(read_text, "\n".join([RAW_HEADER, "1,0,0,0,0,9.8", "2,0,0,0,0,1e30"]), "row 3, column f3_mps2")


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("where", "force"),
    [
        (1, 9e4),
        (0, 120.0),
        (0, 9e4),
        (1, 120.0),
    ],
)
def test_a_knock_in_a_rest_or_a_move_changes_no_verdict(clean, tmp_path, where, force):
    row = middles(clean)[where]
    path = tmp_path / "knocked.csv"
    write_record(struck(clean, row, force), path)
    record: Any = read_record(path)
    before, after = inspect_record(clean), inspect_record(record)
    assert all(not (rows.start <= row < rows.stop) for rows in after.rests.rows)
    # The bounds hold with the knock as without it: it moves no mean.
    assert np.abs(after.rests.force).max() < 1.1 * np.abs(before.rests.force).max()
    assert after.turning.said == ()
    diagnosis = diagnose(record, rerun=False)
    assert diagnosis.verdict == "consistent"
    assert any(f"row {row + 2}" in line for line in diagnosis.warnings)
    assert f"row {row + 2}" in str(inspect_record(record))
    # Moves over one rest and more with the knock are gone, and no others.
    first, last = diagnosis.evidence.model.reference.scored[0].first, diagnosis.evidence.model.reference.scored[0].last
    assert not ((first < row) & (row <= last)).any()


@pytest.mark.acceptance
def test_a_knock_in_a_channel_whose_steps_hide_its_noise_is_in_no_rest(clean):
    """This channel decides nothing about rests."""
    coarse = replace(clean, specific_force=np.round(clean.specific_force / 0.5) * 0.5)
    row = middles(coarse)[0]
    after = inspect_record(struck(coarse, row)).rests
    assert len(after.rows) > 5
    assert all(not (rows.start <= row < rows.stop) for rows in after.rows)


@pytest.mark.acceptance
def test_a_turn_that_cannot_be_told_leaves_its_move_out(clean):
    row = middles(clean)[1]
    rate = clean.rate.copy()
    rate[row, 2] = 5e3
    diagnosis = diagnose(replace(clean, rate=rate), rerun=False)
    assert diagnosis.verdict == "consistent"
    assert any("more than half a turn since the row before" in line for line in diagnosis.warnings)


def test_where_every_move_is_knocked_the_record_says_what_is_lacking(clean):
    rows, record = inspect_record(clean).rests.rows, clean
    for before, after in itertools.pairwise(rows):
        record = struck(record, (before.stop + after.start) // 2)
    diagnosis = diagnose(record, rerun=False)
    assert diagnosis.verdict == "insufficient"
    assert "without a gap, a knock" in str(diagnosis.missing)


def test_a_rest_of_the_table_with_a_knock_is_left_out_by_its_row():
    raw, truth = Bench().run(PROGRAMME)
    rest = find_rests(raw)[5]
    force = raw.specific_force.copy()
    row = (rest.kept_first + rest.kept_last) // 2
    force[row] *= 12.0
    spoilt = replace(raw, specific_force=force)
    record = average_rests(spoilt, find_rests(spoilt))
    assert len(record) == len(truth) - 1
    assert any(f"a knock in row {raw.row[row]}" in line for line in record.warnings)


def test_an_attitude_that_is_none_is_not_known_there(tmp_path):
    read_text = reader(tmp_path / "record.csv")
    rows = [f"{k},0,0,0,0,0,9.8,1,0,0,0" for k in range(8)]
    rows[3], rows[5] = "3,0,0,0,0,0,9.8,0.7,0,0,0", "5,0,0,0,0,0,9.8,1,,0,0"
    record = read_text("\n".join([f"{STRAPDOWN_HEADER},q0,q1,q2,q3", *rows]))
    assert np.flatnonzero(np.isnan(record.attitude).all(axis=1)).tolist() == [3, 5]
    assert "2 rows, the first row 5" in record.warnings[0]
    rows = [f"{k},0,0,0,0,0,9.8,2,0,0,0" for k in range(8)]
    refused(read_text, "\n".join([f"{STRAPDOWN_HEADER},q0,q1,q2,q3", *rows]), "row 2", "norm of the attitude is 2")


@pytest.mark.acceptance
def test_one_knock_refuses_no_mpu9150():
    record = measured("mpu9150-4")
    assert np.flatnonzero(record.knocks).tolist() == [6524]
    assert diagnose(record, rerun=False).verdict == "consistent"
