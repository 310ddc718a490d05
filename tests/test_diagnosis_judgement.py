"""Readings that were left out: true effects improve them, shuffled ones do not, and what cannot be judged is said."""

import numpy as np
import pytest

from bench_cases import draw_case, measure
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis.circumstances import circumstances_of
from trihedron.tools.diagnosis.extended_fit import fit_extended
from trihedron.tools.diagnosis.judgement import judge, predicted_errors
from trihedron.tools.trials.bench import NOISE_BOUND


def judged(seed: int, place: EffectPlace | None = None, rows: int | None = None):
    case = draw_case(seed, effects=["quadratic", "encoder-harmonic", "cross-product"] if place is None else [])
    record = measure(case, seed)
    if rows is not None:
        record = record.selected(np.arange(rows))
    here = calibrate(record, noise_bound=NOISE_BOUND).linearised
    named = case.place if place is None else place
    assert named is not None
    return judge(here, fit_extended(here, circumstances_of(record), [named]))


@pytest.mark.parametrize("seed", [501, 502, 503])
def test_a_true_effect_improves_what_was_left_out_and_shuffles_do_not(seed):
    judgement = judged(seed)
    assert judgement.folds is not None
    assert judgement.folds.improves
    said = judgement.to_json()
    assert said["folds"]["rms_after"] < NOISE_BOUND < said["folds"]["rms_before"]
    assert said["shuffles"]["tried"] == 60
    assert judgement.as_good == 0
    assert judgement.warnings == ()


def test_an_effect_that_is_not_there_earns_a_warning_or_nothing_to_speak_of():
    """On a clean record about half of the shuffles are as good as the effect in its own place."""
    judgement = judged(510, EffectPlace("cubic", "accelerometer-1"))
    assert judgement.folds is not None
    said = judgement.to_json()
    assert said["folds"]["rms_after"] > 0.9 * said["folds"]["rms_before"]
    assert judgement.as_good > 0


def test_too_few_positions_cannot_be_judged_and_that_is_said():
    judgement = judged(520, EffectPlace("quadratic", "accelerometer-1"), rows=8)
    assert judgement.folds is None
    assert any("could not be judged" in warning for warning in judgement.warnings)


def test_leaving_one_out_agrees_with_the_closed_form():
    """The error of one reading that is left out is its residual over 1 − its leverage."""
    rng = np.random.default_rng(0)
    jacobian, residual, bound = rng.normal(size=(30, 4)), rng.normal(size=30), np.ones(30)
    hat = jacobian @ np.linalg.pinv(jacobian)
    whole = residual - hat @ residual
    for row in (0, 13):
        errors = predicted_errors(jacobian, residual, bound, np.delete(np.arange(30), row), np.array([row]))
        assert errors is not None
        assert errors[0][0] == pytest.approx(whole[row] / (1.0 - hat[row, row]), rel=1e-12)
