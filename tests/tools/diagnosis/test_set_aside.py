"""Several records of one instrument: a fault of one is found there, said with its name, and set aside."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator import SIGMA
from generator.positions import of_one_instrument
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Diagnosis, diagnose, diagnosed_together
from trihedron.tools.records import PositionRecord

QUADRATIC = EffectPlace("quadratic", "accelerometer-1")


def together(records: list[PositionRecord]) -> Any:
    """Return the diagnosis of all records."""
    days = dict(zip(("monday", "tuesday", "friday"), records, strict=True))
    alone = {day: diagnose(record, noise_bound=SIGMA, rerun=False) for day, record in days.items()}
    return diagnosed_together(alone, rerun=False)


def with_angle_off(record: PositionRecord, row: int, degrees: float) -> PositionRecord:
    """Return a record with an angle α written wrong in a row (from 1)."""
    alpha = record.alpha.copy()
    alpha[row - 1] += np.radians(degrees)
    return replace(record, alpha=alpha)


@pytest.mark.acceptance
@pytest.mark.parametrize("positions", [20, pytest.param(10, marks=pytest.mark.acceptance)])
def test_a_wrong_row_of_one_record_is_named_there_and_the_others_judged_with_the_rest(positions):
    """Ten positions do not tell the wrong row by themselves."""
    records = of_one_instrument(21, 3, positions=positions)
    records[1] = with_angle_off(records[1], 7, 0.4)
    result = together(records)
    (_, tuesday, _) = result.records
    assert (result.verdict, tuesday.left_out) == ("consistent", None)
    assert tuesday.set_aside.startswith("Row 7 is wrong; all others fit.")
    assert [record.set_aside for record in result.records].count(None) == 2
    text = " ".join(str(result).split())
    assert "a fault of tuesday is set aside" in text
    assert f"uesday: {tuesday.set_aside} It is set aside." in text
    read = Diagnosis.model_validate_json(result.json_text())
    assert read.records is not None
    assert read.records[1].set_aside == tuesday.set_aside


@pytest.mark.acceptance
def test_an_effect_of_the_instrument_is_named_beside_a_wrong_row_of_one_day():
    records = of_one_instrument(22, 3, positions=24, shared=[(QUADRATIC, (4e-4,))])
    records[2] = with_angle_off(records[2], 11, -1.0)
    result = together(records)
    assert result.records[2].set_aside is not None
    assert "Row 11 is wrong" in result.records[2].set_aside
    assert [cause.title for cause in result.causes] == [QUADRATIC.title]
    assert result.causes[0].is_of_instrument


@pytest.mark.acceptance
def test_a_break_of_one_day_leaves_that_day_out_with_its_sentence():
    records = of_one_instrument(23, 3, positions=24)
    after = np.arange(24)[:, None] >= 12
    moved = records[0].specific_force + after * np.array([4e-3, -3e-3, 5e-3])
    records[0] = replace(records[0], specific_force=moved)
    result = together(records)
    assert "explained by itself: Between rows 12 and 13 the biases changed" in result.records[0].left_out
    assert (result.verdict, result.judged) == ("consistent", ("tuesday", "friday"))


def test_clean_records_set_nothing_aside():
    result = together(of_one_instrument(24, 3, positions=12))
    assert result.verdict == "consistent"
    assert [record.set_aside for record in result.records] == [None, None, None]
