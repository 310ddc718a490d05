"""Accelerometers at their limit in rests: named only if the model needs the limit."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator import G
from generator.carried import POSES, strapdown_record, true_motion
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.evidence import carried_evidence
from trihedron.tools.records import StrapdownRecord

BIAS = np.array([0.01, -0.02, 0.015])
GAMMA = np.array([[0.004, 0.0, 0.0], [-0.003, 0.006, 0.0], [0.002, -0.005, -0.004]])


def drawn(seed: int, **options) -> StrapdownRecord:
    return strapdown_record(seed=seed, gamma=GAMMA, bias_g=BIAS, force_noise=0.01, **options)


def clipped(record: StrapdownRecord, axis: int, least: float, most: float, digits: int = 7) -> StrapdownRecord:
    """Return a record whose accelerometer reads from `least` to `most` [g], as it is written."""
    force = np.array(record.specific_force)
    force[:, axis] = np.clip(force[:, axis], least * G, most * G)
    return replace(record, specific_force=np.round(force, digits))


def places_named(result: Diagnosis) -> list[EffectPlace]:
    return [cause.place for cause in result.causes]


@pytest.mark.first(2)
@pytest.mark.parametrize(("axis", "level"), [(0, 0.95), (1, 0.8), (2, 0.75), (1, 0.9)])
def test_an_accelerometer_that_saturates_in_rests_is_named_with_its_level(axis, level):
    """Clip the two rests in which it points up or down, for any noise; the level is in its interval."""
    result: Any = diagnose(clipped(drawn(axis), axis, -level, level), rerun=False)
    assert result.verdict == "explained"
    assert places_named(result) == [EffectPlace("saturation", f"accelerometer-{axis + 1}")]
    (parameter,) = result.causes[0].parameters
    assert parameter.low <= level <= parameter.high
    assert parameter.high - parameter.low < 1e-7
    assert result.calibration.verdict == "falsified"
    assert result.radius > 1.0 > result.best.radius
    assert f"accelerometer {axis + 1} saturates at" in str(result)
    assert "rests with an accelerometer at its limit: 2, left out" in result.warnings
    assert EffectPlace("saturation", f"accelerometer-{axis + 1}") not in [e.place for e in result.cannot_be_seen]


@pytest.mark.acceptance
@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_a_limit_that_is_reached_on_one_side_alone_is_saturation_where_the_other_side_is_nearer(turned):
    """One rest is clipped; no reading is beyond the limit on the other side."""
    poses = np.delete(POSES, 3 if turned > 0.0 else 2, axis=0)
    record = drawn(5, motion=true_motion(poses))
    result: Any = diagnose(clipped(record, 1, -0.85, 0.85), rerun=False)
    assert places_named(result) == [EffectPlace("saturation", "accelerometer-2")]


@pytest.mark.acceptance
def test_a_limit_on_one_side_of_two_is_not_named_and_said():
    """The catalogue's saturation has two sides; the reading is beyond the limit on the other."""
    result: Any = diagnose(clipped(drawn(6), 1, -0.8, 9.0), rerun=False)
    assert result.verdict == "unexplained"
    assert result.causes == ()
    assert result.calibration.verdict == "falsified"
    assert any("a limit of 0.8 g on one side alone" in text for text in result.not_named)


def test_two_accelerometers_at_their_limits_are_both_named():
    result: Any = diagnose(clipped(clipped(drawn(7), 0, -0.9, 0.9), 2, -0.8, 0.8), rerun=False)
    assert result.verdict == "explained"
    assert places_named(result) == [EffectPlace("saturation", f"accelerometer-{p}") for p in (1, 3)]


@pytest.mark.acceptance
def test_a_limit_that_the_model_can_do_without_is_a_warning():
    """In moves alone, or within the noise of a rest, nothing is falsified, so nothing is named."""
    record = drawn(9)
    pushed = np.array(record.specific_force)
    pushed[320:440, 0] += 30.0 * np.sin(np.linspace(0.0, np.pi, 120))
    for hurt in (
        replace(record, specific_force=np.clip(pushed, -2.0 * G, 2.0 * G)),
        clipped(record, 1, -5.0, float(np.sort(record.specific_force[:, 1])[-10]) / G, digits=9),
    ):
        result = diagnose(hurt, rerun=False)
        assert result.verdict == "consistent"
        assert any("rows are saturated" in text for text in result.warnings)


@pytest.mark.acceptance
def test_no_sound_record_shows_a_limit():
    for seed in range(4):
        assert carried_evidence(drawn(20 + seed)).reader.read_off == ()


@pytest.mark.acceptance
def test_a_limit_stands_beside_what_the_other_rests_show():
    """Gyros that depend on gravity are named without the limit, and with it, too."""
    sensitivity = 3e-3 * np.array([[1.0, 0.0, 0.5], [0.0, -1.0, 0.0], [0.0, 0.5, 1.0]])
    record = strapdown_record(seed=8, bias_g=np.array([0.01, -0.02, 0.015]), force_noise=0.01, sensitivity=sensitivity)
    of_gyros = EffectPlace("gyro-g-sensitivity", "gyro-block")
    for limited, expected in (
        (record, [of_gyros]),
        (clipped(record, 1, -0.8, 0.8, digits=16), [EffectPlace("saturation", "accelerometer-2"), of_gyros]),
    ):
        result: Any = diagnose(limited)
        assert (result.verdict, places_named(result)) == ("explained", expected)
        assert result.gain.held_out_rms_after < result.gain.held_out_rms_before
