"""A second mounting is proposed where it is what it takes, and only there."""

import numpy as np
import pytest

from bench_cases import HiddenCase, measure
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration import calibrate
from trihedron.tools.calibration.mountings import PRESETS
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.second_mounting import correlation, second_mounting, with_mountings
from trihedron.tools.trials.bench import NOISE_BOUND, bench_positions, draw_truth

ENCODER = EffectPlace("encoder-harmonic", "outer-axis", 2)
CUBIC = EffectPlace("cubic", "accelerometer-3")
ODD = EffectPlace("odd-quadratic", "accelerometer-3")
SAG = EffectPlace("sag", "outer-axis")
ONCE = EffectPlace("encoder-harmonic", "outer-axis", 1)


def record(place: EffectPlace, values: tuple[float, ...], seed: int = 4):
    alpha, beta = bench_positions()
    case = HiddenCase(draw_truth(np.random.default_rng(seed), symmetric=False), place, values, alpha, beta)
    return measure(case, seed)


@pytest.fixture(scope="module")
def here():
    return calibrate(record(ENCODER, (0.0, 0.0)), noise_bound=NOISE_BOUND).linearised


def test_a_second_mounting_tells_an_encoder_harmonic_from_a_cubic_term(here):
    """At the identity mounting the encoder's second harmonic looks like the third accelerometer's cubic term."""
    found = second_mounting(here, [CUBIC], [ENCODER], (CUBIC.title, ENCODER.title))
    assert found is not None
    assert found.correlation_before == pytest.approx(np.sqrt(0.5), abs=0.02)
    assert found.correlation_after < 0.1
    assert correlation(with_mountings(here, ()), [CUBIC], [ENCODER]) == pytest.approx(found.correlation_before)


def test_no_mounting_tells_apart_what_belongs_to_one_accelerometer_or_one_axis(here):
    """Cubic and odd quadratic terms need inputs beyond 1 g; sag and the encoder's first harmonic another instrument."""
    assert second_mounting(here, [CUBIC], [ODD], ("", "")) is None
    assert second_mounting(here, [ONCE], [SAG], ("", "")) is None


def test_the_diagnosis_says_so_where_it_helps():
    """On eight positions several effects remain; the proposal names two that remain, or there is none."""
    few = record(ENCODER, (1.2e-4, 0.7)).selected(np.arange(0, 40, 3))
    result = diagnose(few, noise_bound=NOISE_BOUND, rerun=False)
    said = result.to_json()
    if "second_mounting" in said:
        assert result.verdict == "ambiguous"
        assert set(said["second_mounting"]["separates"]) <= {finding.title for finding in result.findings}
    else:
        assert result.mounting is None


def test_a_record_with_every_mounting_gets_no_proposal(here):
    every = with_mountings(here, [name for name in PRESETS if name != "identity"])
    assert second_mounting(every, [CUBIC], [ENCODER], ("", "")) is None
