"""Hundreds of hidden-effect records, made with kernels in time; the diagnosis gets each record alone."""

from collections import Counter

import pytest

from trihedron.diagnosis import diagnose
from trihedron.hidden import measure
from trihedron.hidden_cases import NOISE_BOUND, draw_case

pytestmark = pytest.mark.acceptance


def outcome(seed: int, *, clean: bool) -> str:
    """What the diagnosis made of one case: right, candidate, cannot tell, wrong, consistent."""
    symmetric = seed % 3 == 0
    case = draw_case(seed, effects=[] if clean else None, symmetric=symmetric)
    result = diagnose(
        measure(case, seed),
        noise_bound=NOISE_BOUND,
        baseline="symmetric" if symmetric else "asymmetric",
        rerun=False,
    )
    if result.verdict in ("consistent", "unexplained", "insufficient"):
        return result.verdict
    named = [
        {finding.causes[0].place, *finding.causes[0].equivalents} if len(finding.causes) == 1 else set()
        for finding in result.findings
    ]
    if result.verdict == "explained":
        return "right" if case.place in named[0] else "wrong"
    return "candidate" if any(case.place in group for group in named) else "wrong"


def test_no_effect_is_named_on_300_clean_records():
    counts = Counter(outcome(seed, clean=True) for seed in range(10_000, 10_300))
    print(f"\nclean records: {dict(counts)}")
    assert counts == {"consistent": 300}


def test_300_hidden_effects_at_three_to_six_times_the_sure_size():
    counts = Counter(outcome(seed, clean=False) for seed in range(20_000, 20_300))
    print(f"\nhidden effects: {dict(counts)}")
    assert counts["wrong"] == 0
    assert counts["consistent"] == 0
    assert counts["right"] >= 0.9 * 300
    assert counts["right"] + counts["candidate"] >= 0.97 * 300
