"""Everyday faults of a laboratory, of many kinds: most are named, and none wrongly."""

from collections import Counter

import pytest

from diagnoses import diagnosed
from generator.laboratory_faults import FAULTS, drawn_fault, outcome_of

LEAST_RIGHT = 0.85
DRAWS = 4
"""Draws of each kind."""


@pytest.mark.first(1)
@pytest.mark.parametrize(("kind", "seed"), [("readings", 1), ("σ too small", 2), ("coarse encoder", 3)])
def test_a_drawn_fault_is_named(kind, seed):
    fault = drawn_fault(seed, kind)
    assert outcome_of(fault, diagnosed(fault.record, **fault.options)) == "right"


@pytest.mark.acceptance
def test_most_drawn_faults_are_named_and_none_wrongly():
    outcomes: dict[str, Counter[str]] = {}
    for kind in FAULTS:
        outcomes[kind] = Counter()
        for seed in range(300, 300 + DRAWS):
            fault = drawn_fault(seed, kind)
            outcomes[kind][outcome_of(fault, diagnosed(fault.record, **fault.options))] += 1
    total: Counter[str] = sum(outcomes.values(), Counter())
    assert total["wrong"] == 0, outcomes
    assert total["right"] >= LEAST_RIGHT * total.total(), outcomes
