"""A wrong row and an effect at once are sought together and named together."""

import numpy as np
import pytest

from generator import SIGMA
from generator.wrong_rows import with_wrong_rows
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose

EFFECTS = (
    (EffectPlace("quadratic", "accelerometer-2"), (1.5e-4,)),
    (EffectPlace("cross-product", "accelerometer-1", axes=(2, 3)), (1.5e-4,)),
    (EffectPlace("encoder-harmonic", "outer-axis", order=2), (8e-5, 0.7)),
    (EffectPlace("temperature-bias", "accelerometer-3"), (1.5e-5,)),
)
SURE = [("angle", 0, 48), ("copied", 3, 48), ("disturbed", 3, 36)]
DRAWN = []
for number in range(900, 920):
    drawn = np.random.default_rng(number)
    kind, size = str(drawn.choice(["angle", "copied", "disturbed", "sign"])), int(drawn.choice([36, 48]))
    DRAWN.append(pytest.param(kind, int(drawn.integers(len(EFFECTS))), size, marks=pytest.mark.acceptance))


@pytest.mark.acceptance
@pytest.mark.parametrize(("what", "number", "count"), [*SURE, *DRAWN])
def test_a_wrong_row_and_an_effect_are_named_together(what, number, count):
    place, sizes = EFFECTS[number]
    wrong = with_wrong_rows(count + number, what, count, 1, [(place, sizes)])
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    first = diagnosis.explanations[0]
    assert (first.kind, first.rows) == ("rows", wrong.rows)
    assert diagnosis.verdict == "explained"
    assert [cause.place for cause in diagnosis.causes] == [place]
    assert "Beside that" in first.sentence
    assert str(diagnosis).startswith(f"Row {wrong.rows[0]} is wrong.")


LONG = pytest.mark.acceptance
BENT = [
    ("angle", EffectPlace("quantisation", "accelerometer-3"), (3e-4,)),
    pytest.param("copied", EffectPlace("saturation", "accelerometer-1"), (0.9,), marks=LONG),
    pytest.param("sign", EffectPlace("dead-zone", "accelerometer-2"), (0.03,), marks=LONG),
]


@pytest.mark.acceptance
@pytest.mark.parametrize(("what", "place", "sizes"), BENT)
def test_a_wrong_row_is_named_beside_an_effect_that_is_not_linear(what, place, sizes):
    wrong = with_wrong_rows(31, what, 48, 1, [(place, sizes)])
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    first = diagnosis.explanations[0]
    assert (diagnosis.verdict, first.kind, first.rows) == ("explained", "rows", wrong.rows), str(diagnosis)
    assert [cause.place for cause in diagnosis.causes] == [place]
    assert "No angle mends it" not in first.sentence
