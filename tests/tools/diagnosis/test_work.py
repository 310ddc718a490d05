"""One budget of work for all stages of a diagnosis: a stage that it cuts off is named, and gives no value."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from diagnoses import flowing
from generator import SIGMA
from generator.carried import outside_gyro
from generator.positions import drawn_record
from generator.wrong_rows import with_wrong_rows
from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.work import Budget
from trihedron.tools.diagnosis.hypothesis import places_of
from trihedron.tools.diagnosis.procedure import diagnosed
from trihedron.tools.evidence import bench_evidence, carried_evidence
from trihedron.tools.records import read_record

LIMITED = "not everything was tried, since the work has a limit: "
BESIDE = 4e5
"""Most work beyond a limit: of what every diagnosis needs, and of the problem that goes beyond the limit."""
STATED = ("causes", "excluded", "power", "gain", "stands_with", "lengths", "band", "laws", "judgement")
"""Results of single stages."""
SIZES = "the sizes of effects that are excluded"
THREE = [
    (EffectPlace("cubic", "accelerometer-1"), (6e-4,)),
    (EffectPlace("bias-drift", "accelerometer-3"), (5e-4,)),
    (EffectPlace("cubic", "accelerometer-2"), (4e-4,)),
]
STEP = EffectPlace("bias-step", "accelerometer-1")


def bench(seed: int, effects: Any, count: int) -> Callable[[], Any]:
    return lambda: bench_evidence(drawn_record(seed, effects, count), noise_bound=SIGMA)


def of_wrong_row() -> Any:
    return bench_evidence(with_wrong_rows(0, "angle").record, noise_bound=SIGMA)


class Noted(Budget):
    """A budget that notes the work that was done before each stage that works."""

    def __init__(self, limit: float) -> None:
        super().__init__(limit)
        self.begun: dict[str, float] = {}

    @contextmanager
    def of(self, stage: str) -> Iterator[None]:
        before = self.done
        with super().of(stage):
            yield
        if self.done > before and stage != "what explains the record":
            self.begun.setdefault(stage, before)


def cut(evidence_of: Callable[[], Any], limit: float) -> tuple[Any, Noted]:
    """Return the diagnosis of a record with a limit of all its work, and what became of that."""
    budget = Noted(limit)
    return diagnosed(evidence_of(), budget=budget), budget


def assert_nothing_wrong(full: Any, limited: Any, budget: Budget) -> None:
    """Assert that a limited diagnosis has the values of the full one or none, and names what it lacks."""
    whole, part = full.to_json(), limited.to_json()
    assert limited.verdict in (full.verdict, "unexplained", "insufficient")
    for key in STATED:
        if key == "stands_with":
            alone = [entry for entry in part.get(key, ()) if not entry["effects"]]
            assert all(entry in whole.get(key, alone) for entry in alone)
        elif limited.verdict == full.verdict:
            assert part.get(key) in (whole.get(key), None, []), key
        elif key in ("causes", "gain", "excluded", "judgement"):
            assert not part.get(key), key
    assert limited.calibration.radius == full.calibration.radius
    sentences = [warning for warning in limited.warnings if warning.startswith(LIMITED)]
    assert sentences == ([LIMITED + "; ".join(budget.cut_off)] if budget.cut_off else [])
    assert limited.cut_off == tuple(budget.cut_off)
    assert bool(budget.cut_off) >= (limited.verdict != full.verdict)
    assert "faults of the record" not in budget.cut_off or "wrong rows, " not in flowing(limited)
    assert budget.done <= 2.0 * budget.limit + BESIDE


def test_sizes_and_detection_limits_that_are_cut_off_are_absent_and_named():
    full, whole = cut(bench(3, (), 12), np.inf)
    assert full.excluded
    assert full.power
    assert not whole.cut_off
    limited, budget = cut(bench(3, (), 12), 0.5 * whole.done)
    assert (limited.verdict, limited.excluded, limited.power) == ("consistent", None, None)
    assert budget.cut_off == [SIZES, "the detection limit"]
    assert_nothing_wrong(full, limited, budget)


OF_ALL = {"faults of the record", "functions of one quantity", "the detection limit", "each effect alone"}
CASES = {
    "explained": (bench(10, [(STEP, (2e-4, 0.05))], 24), {*OF_ALL, SIZES, "the gain on held-out data"}),
    "ambiguous": (bench(5, THREE, 16), {*OF_ALL, "what to measure next"}),
    "wrong row": (of_wrong_row, OF_ALL),
}


@pytest.mark.acceptance
@pytest.mark.parametrize("name", CASES)
def test_every_stage_is_cut_off_by_some_limit_and_nothing_wrong_is_named(name: str):
    evidence_of, stages = CASES[name]
    assert_each_cut_off(evidence_of, stages)


@pytest.mark.acceptance
def test_every_stage_of_a_strapdown_record_is_cut_off_too(tmp_path: Path):
    record: Any = read_record(outside_gyro(tmp_path / "gyro.strapdown.csv", 5, 3).path)
    assert_each_cut_off(lambda: carried_evidence(record), {*OF_ALL, "each length", "the gain on held-out data"})


@pytest.mark.acceptance
def test_a_formula_that_the_work_does_not_reach_cannot_be_told():
    evidence = CASES["explained"][0]()
    (place,) = places_of(["f1 += c*n1**2"], at_table=True, with_gyros=False)
    result: Any = diagnosed(evidence, budget=Budget(1e3), formulas=[place], beside=evidence.including([place]))
    assert [answer.answer for answer in result.hypotheses] == ["cannot be told"]
    assert f"the formula {place.law}" in result.cut_off


def assert_each_cut_off(evidence_of: Callable[[], Any], stages: set[str]) -> None:
    """Assert that all stages that work are cut off, among them these, and that nothing wrong is named then."""
    full, whole = cut(evidence_of, np.inf)
    assert stages <= set(whole.begun), whole.begun
    for stage, done in whole.begun.items():
        limited, budget = cut(evidence_of, done)
        assert_nothing_wrong(full, limited, budget)
        assert stage in limited.cut_off
