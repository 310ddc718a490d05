"""Hundreds of hidden-effect records, made with kernels in time; the diagnosis gets each record alone."""

import sys
from collections import Counter
from collections.abc import Sequence

import pytest

from trihedron.diagnosis import diagnose
from trihedron.hidden import measure
from trihedron.hidden_cases import NOISE_BOUND, draw_case
from trihedron.models.effects import CATALOGUE

pytestmark = pytest.mark.acceptance


def hideable(baseline: str) -> list[str]:
    """Effects that can be hidden, but for hysteresis, which has a test of its own."""
    effects = [e for e in CATALOGUE.values() if e.within != baseline and e.variants is None]
    return [effect.name for effect in effects if effect.name != "hysteresis"]


def outcome(seed: int, effects: Sequence[str] | None = None) -> str:
    """What the diagnosis made of one case: right, candidate, right with an outlier, wrong, or its verdict."""
    symmetric = seed % 3 == 0
    baseline = "symmetric" if symmetric else "asymmetric"
    chosen = hideable(baseline) if effects is None else effects
    case = draw_case(seed, effects=chosen, symmetric=symmetric)
    result = diagnose(measure(case, seed), noise_bound=NOISE_BOUND, baseline=baseline, rerun=False)
    if result.verdict in ("consistent", "unexplained", "insufficient"):
        return result.verdict
    named = [[{cause.place, *cause.equivalents} for cause in finding.causes] for finding in result.findings]
    alone = [causes[0] for causes in named if len(causes) == 1]
    if result.verdict == "explained":
        if alone and case.place in alone[0]:
            return "right"
        others = [p.effect for causes in named[0] for p in causes if case.place not in causes]
        return "right with an outlier" if set(others) == {"outlier"} and len(named[0]) == 2 else "wrong"
    return "candidate" if any(case.place in group for group in alone) else "wrong"


def show(capsys: pytest.CaptureFixture[str], title: str, counts: Counter[str]) -> None:
    with capsys.disabled():
        print(f"\n{title}: {dict(sorted(counts.items()))}", file=sys.stderr, flush=True)


def test_no_effect_is_named_on_300_clean_records(capsys):
    counts = Counter(outcome(seed, ()) for seed in range(10_000, 10_300))
    show(capsys, "clean records", counts)
    assert counts == {"consistent": 300}


def test_300_hidden_effects_at_three_to_six_times_the_sure_size(capsys):
    counts = Counter(outcome(seed) for seed in range(20_000, 20_300))
    show(capsys, "hidden effects", counts)
    assert counts["wrong"] == counts["right with an outlier"] == 0
    assert counts["consistent"] == 0
    assert counts["right"] >= 0.97 * 300


def test_hysteresis_is_named_but_for_rows_whose_sense_the_record_cannot_tell(capsys):
    """Both axes move at once, and which of them changed an input last is concluded, not known: a row may be off."""
    counts = Counter(outcome(seed, ("hysteresis",)) for seed in range(30_000, 30_040))
    show(capsys, "hysteresis", counts)
    assert counts["wrong"] == 0
    assert counts["right"] >= 0.6 * 40
