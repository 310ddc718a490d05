"""Positions chosen against what is in no catalogue: their sizes are those of a record, and smaller than by chance."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from generator import SIGMA
from generator.positions import Session
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.planning import Request, plan_positions, task_of
from trihedron.tools.planning.positions import Places, Task
from trihedron.tools.planning.unlisted import Lattice, counts, sizes_of
from trihedron.tools.records import PositionRecord, read_record


@pytest.fixture(scope="module")
def task() -> Task:
    # What each target costs at best plays no part here.
    return task_of(Request(), best=np.ones(18))


def drawn(rng: np.random.Generator, count: int) -> Places:
    return Places(rng.uniform(0.0, 2.0 * np.pi, (count, 2)), np.zeros(count, dtype=int))


def test_the_sizes_of_a_plan_are_those_of_a_record_at_its_positions(task: Task, tmp_path: Path):
    rng = np.random.default_rng(3)
    places = drawn(rng, 40)
    places = places.chosen(np.flatnonzero(counts(task, places).all(axis=1)))
    session = Session.drawn(rng, len(places))
    session = replace(session, alpha=places.angle[:, 0], beta=places.angle[:, 1])
    reading = session.stand.readings(session.stand.inputs(session.alpha, session.beta))
    session.write(tmp_path / "r.csv", (session.alpha, session.beta), reading, rng)
    record = read_record(tmp_path / "r.csv")
    assert isinstance(record, PositionRecord)
    told = diagnose(record, noise_bound=SIGMA).power or ()
    power = {(e["place"], e["quantity"], e.get("factor", "")): e["size"] for e in told}
    for one in sizes_of(task, places):
        size = power[one.place, one.quantity, one.factor]
        assert one.size is not None
        assert size is not None
        assert one.size * SIGMA == pytest.approx(size, rel=0.1), one


def test_what_a_position_more_is_said_to_gain_is_what_it_gains(task: Task):
    lattice, rng = Lattice.of(task), np.random.default_rng(5)
    rows = rng.choice(len(lattice.places), 17, replace=False)
    beside = lattice._merits_beside(rows[:-1])
    for row in (rows[-1], 100, 300):
        assert beside[row] == pytest.approx(lattice.merit(np.append(rows[:-1], row)) ** 6, rel=1e-5)


@pytest.mark.acceptance
def test_sixteen_that_are_chosen_carry_as_far_as_forty_eight_at_random(task: Task):
    plan = plan_positions(16, Request(against_unlisted=True, starts=10))
    sizes = [one.size for one in plan.unlisted]
    assert all(size is not None for size in sizes)
    worst = max(size for size in sizes if size is not None)
    rng, by_chance = np.random.default_rng(1), {16: [], 48: []}
    for count, found in by_chance.items():
        for _ in range(7):
            found.append(max(np.inf if one.size is None else one.size for one in sizes_of(task, drawn(rng, count))))
    assert worst < np.median(by_chance[48])
    assert min(by_chance[16]) > 2.0 * worst
    # What it costs the targets.
    assert plan.mean_ratio < 1.5
