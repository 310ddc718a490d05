"""The evidence of a bench: what was left out, what another mounting tells."""

import numpy as np
import pytest

from bench_cases import HiddenCase, draw_case, measure
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration.model import parametrise
from trihedron.tools.calibration.mountings import PRESETS
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.result import Witness
from trihedron.tools.evidence.bench import _predicted_errors, bench_evidence
from trihedron.tools.evidence.bench_probe import second_mounting
from trihedron.tools.trials.bench import NOISE_BOUND, bench_positions, draw_truth

ENCODER = EffectPlace("encoder-harmonic", "outer-axis", 2)
CUBIC = EffectPlace("cubic", "accelerometer-3")
ODD = EffectPlace("odd-quadratic", "accelerometer-3")
SAG = EffectPlace("sag", "outer-axis")
ONCE = EffectPlace("encoder-harmonic", "outer-axis", 1)
IDENTITY = parametrise({"identity": np.eye(3)})


def judged(seed: int, place: EffectPlace | None = None, rows: int | None = None) -> Witness:
    """The witness on an effect that is there (by default), or on one that is not."""
    case = draw_case(seed, effects=["quadratic", "encoder-harmonic", "cross-product"] if place is None else [])
    record = measure(case, seed)
    evidence = bench_evidence(record if rows is None else record.selected(np.arange(rows)), noise_bound=NOISE_BOUND)
    named = case.place if place is None else place
    assert named is not None
    return Witness.of(next(evidence.trials(evidence.refit([named]))))


@pytest.mark.parametrize("seed", [501, 502, 503])
def test_a_true_effect_improves_what_was_left_out_and_shuffles_do_not(seed):
    witness = judged(seed)
    assert witness.folds is not None
    assert witness.folds.rms_after < NOISE_BOUND < witness.folds.rms_before
    assert witness.shuffles is not None
    assert (witness.shuffles.tried, witness.shuffles.as_good) == (60, 0)
    assert witness.warnings == ()


def test_an_effect_that_is_not_there_earns_a_warning_or_nothing_to_speak_of():
    """On a clean record about half of the shuffles are as good as the effect in its own place."""
    witness = judged(510, EffectPlace("cubic", "accelerometer-1"))
    assert witness.folds is not None
    assert witness.shuffles is not None
    assert witness.folds.rms_after > 0.9 * witness.folds.rms_before
    assert witness.shuffles.as_good > 0


def test_too_few_positions_cannot_be_judged_and_that_is_said():
    witness = judged(520, EffectPlace("quadratic", "accelerometer-1"), rows=8)
    assert witness.folds is None
    assert any("could not be judged" in warning for warning in witness.warnings)


def test_leaving_one_out_agrees_with_the_closed_form():
    """The error of one reading that is left out is its residual over 1 − its leverage."""
    rng = np.random.default_rng(0)
    jacobian, residual, bound = rng.normal(size=(30, 4)), rng.normal(size=30), np.ones(30)
    hat = jacobian @ np.linalg.pinv(jacobian)
    whole = residual - hat @ residual
    for row in (0, 13):
        errors = _predicted_errors(jacobian, residual, bound, np.delete(np.arange(30), row), np.array([row]))
        assert errors is not None
        assert errors[0][0] == pytest.approx(whole[row] / (1.0 - hat[row, row]), rel=1e-12)


def test_a_second_mounting_tells_an_encoder_harmonic_from_a_cubic_term():
    """At the identity mounting the encoder's second harmonic looks like the third accelerometer's cubic term."""
    found = second_mounting(IDENTITY, [CUBIC], [ENCODER], (CUBIC.title, ENCODER.title))
    assert found is not None
    assert found["correlation_before"] == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert found["correlation_after"] < 0.1


def test_no_mounting_tells_apart_what_belongs_to_one_accelerometer_or_one_axis():
    """Cubic and odd quadratic terms need inputs beyond 1 g; sag and the encoder's first harmonic another instrument."""
    assert second_mounting(IDENTITY, [CUBIC], [ODD], ("", "")) is None
    assert second_mounting(IDENTITY, [ONCE], [SAG], ("", "")) is None
    assert second_mounting(parametrise(PRESETS), [CUBIC], [ENCODER], ("", "")) is None


def test_a_mounting_is_proposed_for_sets_that_remain_or_not_at_all():
    alpha, beta = bench_positions()
    truth = draw_truth(np.random.default_rng(4), symmetric=False)
    record = measure(HiddenCase(truth, ENCODER, (1.2e-4, 0.7), alpha, beta), 4).selected(np.arange(0, 40, 3))
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    if result.second_mounting is not None:
        assert result.verdict == "ambiguous"
        assert set(result.second_mounting.separates) <= {finding.title for finding in result.findings}
