"""The values of a diagnosis are possible: sizes and targets together, within all bounds, each in its interval."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from generator.carried import strapdown_record
from generator.positions import hidden_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.cause import causes_of, centred
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.evidence.bench_model import Cast
from trihedron.tools.trials import NOISE_BOUND

HARMONIC = EffectPlace("encoder-harmonic", "outer-axis", 2)
PRODUCT = EffectPlace("cross-product", "accelerometer-1", axes=(1, 3))


def exact_misfit(result: Any) -> float:
    """Return the largest misfit over its bound of the exact model with the result's values."""
    finding = result.findings[0]
    evidence = result.evidence
    point = np.array([target["after"] for target in result.targets])
    coefficients = []
    for cause in finding.causes:
        values = np.array(cause.values)
        if any(p.name.endswith("phase") for p in cause.parameters):
            size, phase = values[::2], values[1::2]
            values = np.stack((size * np.cos(phase), size * np.sin(phase)), axis=1).ravel()
        coefficients.append(values)
    model = Cast(finding.places).model(evidence.model.readings, point, np.concatenate(coefficients))
    assert model is not None
    return float(np.abs((evidence.model.readings.reading.ravel() - model.reading) / model.bound).max())


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("place", "values", "at_bound"),
    [pytest.param(HARMONIC, (2.5e-4, 3.1), False, marks=pytest.mark.acceptance), (PRODUCT, (2e-3,), True)],
    ids=["errors uniform", "errors at their bound: no interior"],
)
def test_sizes_and_targets_are_one_possible_point(place, values, at_bound):
    """Least squares does not give one: some reading is beyond its bound there."""
    record = hidden_record(4, place, values)
    fit = bench_evidence(record, noise_bound=NOISE_BOUND).model.refit([place])
    rng = np.random.default_rng(0)
    errors = rng.choice([-1.0, 1.0], size=(len(record), 3)) if at_bound else rng.uniform(-1.0, 1.0, (len(record), 3))
    exact = (record.specific_force / 9.80665).ravel() - fit.residual
    record.specific_force[:] = 9.80665 * (exact.reshape(-1, 3) + NOISE_BOUND * errors)
    result: Any = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    assert result.verdict == "explained"
    assert exact_misfit(result) <= 1.0 + 1e-6
    for entry in (p for cause in result.causes for p in cause.parameters):
        assert entry.low <= entry.estimate <= entry.high
    assert all(target["low"] <= target["after"] <= target["high"] for target in result.targets)


def test_a_size_that_rounding_put_beyond_its_end_is_stated_at_the_end():
    place = EffectPlace("quadratic", "accelerometer-2")
    evidence = bench_evidence(hidden_record(3, place, (2e-3,)), noise_bound=NOISE_BOUND)
    fit = centred(evidence, evidence.model.refit([place]))
    ((low, high),) = causes_of(evidence, fit)[0].intervals
    assert low < fit.stated[0] < high
    for value, end in ((high * (1.0 + 1e-12), high), (low * (1.0 - 1e-12), low)):
        (cause,) = causes_of(evidence, replace(fit, stated=np.array([value])))
        assert cause.values == (end,)


@pytest.mark.acceptance
def test_a_strapdown_baseline_is_possible_as_it_is_stated():
    result: Any = diagnose(strapdown_record(seed=3, gyro_bias=np.array([2e-3, -1e-3, 1.5e-3])))
    assert result.verdict == "consistent"
    evidence = result.evidence
    step = np.array([p.estimate for p in result.stated.parameters]) - evidence.rows.point
    assert np.abs(evidence.rows.residual - evidence.rows.nominal @ step).max() <= 1.0 + 1e-6
    assert all(p.low <= p.estimate <= p.high for p in result.stated.parameters if p.low is not None)
