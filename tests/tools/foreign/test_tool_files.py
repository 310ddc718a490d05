"""Files of thirty other tools: imported to the last digit, or with one question for all missing facts."""

from pathlib import Path

import numpy as np
import pytest

import trihedron as th
from laboratory_imports import imported, questions_of, written
from tool_files import FILES, FORCE, MICROS, RATE, TIME, named, table


@pytest.mark.first(2)
@pytest.mark.parametrize("tool", FILES)
def test_a_file_of_a_tool_is_imported_or_asks_for_what_is_missing(tool: str, tmp_path: Path):
    file = FILES[tool]
    path = written(tmp_path, file.text, "log.csv")
    if file.answers:
        keys, message = questions_of(path)
        assert keys == set(file.answers), message
    record = th.import_record(path, answers=file.answers).record
    assert record.specific_force == pytest.approx(FORCE, abs=1e-6)
    assert record.time_s - record.time_s[0] == pytest.approx(TIME, abs=2e-6)
    if file.alone:
        assert not hasattr(record, "rate")
    else:
        assert record.rate == pytest.approx(RATE, abs=1e-6)


def test_increments_of_px4_are_increments(tmp_path: Path):
    names = ["timestamp", *named("delta_angle[{}]", "012"), *named("delta_velocity[{}]", "012"), "delta_angle_dt"]
    angle, velocity = np.round(0.01 * RATE, 9), np.round(0.01 * FORCE, 9)
    record = imported(tmp_path, table(names, [MICROS, angle, velocity, [10000] * len(MICROS)])).record
    columns = record.columns()
    for k in range(3):
        assert columns[f"dtheta{k + 1}_rad"] == pytest.approx(angle[:, k], abs=1e-15)
        assert columns[f"dv{k + 1}_mps"] == pytest.approx(velocity[:, k], abs=1e-15)
