"""An effect that moves no reading by a hundredth of σ is not shown; a true set at the very edge is named without it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from diagnoses import diagnosed
from generator.positions import drawn_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.evidence.bench import Bench

CASES = [
    (EffectPlace("quadratic", "accelerometer-1"), (4e-4,)),
    pytest.param(EffectPlace("sag", "outer-axis"), (4e-4, 0.7), marks=pytest.mark.acceptance),
    pytest.param(EffectPlace("bias-drift", "accelerometer-3"), (3e-3,), marks=pytest.mark.acceptance),
    pytest.param(EffectPlace("cross-product", "accelerometer-2", None, (1, 3)), (3e-4,), marks=pytest.mark.acceptance),
]


def refusing(monkeypatch: pytest.MonkeyPatch, place: EffectPlace, times: float) -> None:
    """Let the search refuse a single effect this number of times, as rounding at the very edge would."""
    mended, refused = Bench.mended, []

    def at_the_edge(model: Bench, places: Sequence[EffectPlace], work: Any) -> Any:
        if tuple(places) == (place,) and len(refused) < times:
            refused.append(places)
            return ()
        return mended(model, places, work)

    monkeypatch.setattr(Bench, "mended", at_the_edge)


@pytest.mark.acceptance
@pytest.mark.parametrize(("place", "sizes"), CASES)
def test_a_set_that_was_refused_at_the_edge_is_named_without_a_faint_effect(place, sizes, monkeypatch):
    record = drawn_record(3, [(place, sizes)], 48, at_bound=True)
    refusing(monkeypatch, place, 1)
    result = diagnosed(record)
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [place]


@pytest.mark.acceptance
@pytest.mark.parametrize(("place", "sizes"), CASES[:1])
def test_a_faint_effect_is_not_named(place, sizes, monkeypatch):
    record = drawn_record(3, [(place, sizes)], 48, at_bound=True)
    refusing(monkeypatch, place, np.inf)
    result = diagnosed(record)
    assert [causes for causes in result.sets if len(causes) > 1] == []
    assert [finding for finding in result.findings if finding.fit.faint] == []
