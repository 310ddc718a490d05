"""The table of 6 to 30 positions in the documentation says what the stored sets cost and the certificates prove."""

import json
import re
from pathlib import Path

import pytest

from planning_tasks import stored, tables_task
from trihedron.tools.planning.common import plan_positions, proven_everywhere
from trihedron.tools.planning.pool import Bound
from trihedron.tools.planning.positions import costs
from trihedron.tools.planning.request import Request

ROOT = Path(__file__).parents[3]
ROW = re.compile(r"\| (\d+) \| (\d+) \| ([\d.]+) \| ([\d.]+) \| ([\d.]+) (?=\|)")


def test_the_table_is_of_the_stored_sets_and_certificates():
    told = ROW.findall((ROOT / "docs/plan-positions.md").read_text(encoding="utf-8"))
    assert sorted(int(row[0]) for row in told) == list(range(6, 31))
    proofs = {
        int(file.stem.split("-")[1]): json.loads(file.read_text(encoding="utf-8"))["ratio"]
        for file in (ROOT / "tools/planning/proofs").glob("positions-*.json")
    }
    task = tables_task()
    for count, readings, worst, mean, proven in told:
        found = costs(task, stored(int(count)))
        assert len(found.readings.position) == int(readings)
        assert found.worst == pytest.approx(float(worst), abs=1.1e-5)
        assert found.mean == pytest.approx(float(mean), abs=1.1e-5)
        assert float(proven) == proofs.get(int(count), 1.0)


def test_a_plan_says_what_is_proven_of_all_angles():
    plan = plan_positions(7, Request(admissible="tables", criterion="mean", starts=1, cuts=1))
    assert (plan.lower_bound, plan.lower_bound_on) == (1.08, "all angles")
    assert "no 7 positions, whatever their angles, have a worst ratio below 1.08 (proven by a certificate)" in str(plan)


@pytest.mark.parametrize(
    "other",
    [
        *({"admissible": "paper"}, {"bounds": (2e-3, 1e-2)}, {"reserve_deg": 0.1}, {"keep_out": ("alpha:1:2",)}),
        *(
            {"targets": ("X1", "X4")},
            {"goal": "levelling"},
            {"lost": 1},
            {"baseline": "symmetric"},
            {"convention": "A2"},
        ),
    ],
    ids=lambda other: next(iter(other)),
)
def test_certificates_are_of_the_ratios_of_the_table_alone(other):
    assert proven_everywhere(7, Request(**{"admissible": "tables", **other})) == 1.0


def test_a_bound_on_the_pool_that_is_better_stays_beside_that_of_all_angles():
    pool = Bound(1.2, 6, "pool of 9 positions", 3)
    assert pool.with_everywhere(1.1) == Bound(1.2, 6, "pool of 9 positions", 3, 1.1)
    assert pool.with_everywhere(1.3) == Bound(1.3, 6, "all angles", 0, 1.3)
    assert pool.with_everywhere(1.0) == pool
