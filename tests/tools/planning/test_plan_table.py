"""The table of 6 to 30 positions in the documentation says what the stored sets cost."""

import re
from pathlib import Path

import pytest

from planning_tasks import stored, tables_task
from trihedron.tools.planning.positions import costs

ROOT = Path(__file__).parents[3]
ROW = re.compile(r"\| (\d+) \| (\d+) \| ([\d.]+) \| ([\d.]+) (?=\|)")


def test_the_table_is_of_the_stored_sets():
    told = ROW.findall((ROOT / "docs/plan-positions.md").read_text(encoding="utf-8"))
    assert sorted(int(row[0]) for row in told) == list(range(6, 31))
    task = tables_task()
    for count, readings, worst, mean in told:
        found = costs(task, stored(int(count)))
        assert len(found.readings.position) == int(readings)
        assert found.worst == pytest.approx(float(worst), abs=1.1e-5)
        assert found.mean == pytest.approx(float(mean), abs=1.1e-5)
