"""Biases that settle, follow a lagging temperature or wander, in records made by other formulas than the product's."""

from dataclasses import replace

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.result import Diagnosis
from trihedron.tools.records import PositionRecord
from trihedron.tools.trials.bench import NOISE_BOUND
from trihedron.tools.trials.case import Options
from trihedron.tools.trials.draw import draw_case
from trihedron.tools.trials.outcome import diagnosed as judged_diagnosis

PLACE = "accelerometer-2"
STEPS = 4000
"""Of Euler's method for the lag."""


def drawn(seed: int, count: int) -> tuple[np.random.Generator, PositionRecord]:
    """A generator, and a record of so many random positions, a minute apart, with a temperature."""
    rng = np.random.default_rng([seed, 91])
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (count, 3))
    reading = simulated(random_bench(rng), alpha, beta, noise).specific_force / GRAVITY
    record = position_record(reading, alpha, beta)
    hours = np.cumsum(rng.uniform(0.012, 0.02, count))
    warmth = 22.0 + 4.0 * np.sin(12.0 * hours) - 3.0 * hours
    return rng, replace(record, time_s=3600.0 * hours, temperature=warmth)


def hours_of(record: PositionRecord) -> np.ndarray:
    """Hours (N,) since the first row."""
    return (record.time_s - record.time_s[0]) / 3600.0


def diagnosed(record: PositionRecord, added: np.ndarray) -> Diagnosis:
    """The diagnosis of a record to whose second accelerometer values (N,) [g] are added."""
    record.specific_force[:, 1] += GRAVITY * added
    return diagnose(record, noise_bound=NOISE_BOUND, rerun=False)


def assert_named(result: Diagnosis, effect: str, values: tuple[float, ...]) -> None:
    """It is the one cause, with the true values inside their intervals."""
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [EffectPlace(effect, PLACE)]
    assert all(low <= value <= high for value, (low, high) in zip(values, result.causes[0].intervals, strict=True))


@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.acceptance)])
def test_a_warm_up_is_named_with_its_time_constant(seed):
    rng, record = drawn(seed, 26)
    hours, size = hours_of(record), 40.0 * NOISE_BOUND
    constant = float(rng.uniform(0.1, 0.4) * hours[-1])
    assert_named(diagnosed(record, size * (1.0 - np.exp(-hours / constant))), "warm-up", (size, constant))


@pytest.mark.acceptance
@pytest.mark.parametrize(("seed", "sigmas"), [(9, 5000.0)])
def test_a_large_warm_up_is_named_and_its_time_constant_is_inside(seed, sigmas):
    """So large that the nominal fit says little of the time constant: every one has to be judged at a better one."""
    rng, record = drawn(seed, 26)
    hours, size = hours_of(record), sigmas * NOISE_BOUND
    constant = float(np.exp(rng.uniform(np.log(0.15), np.log(3.0))) * hours[-1])
    assert_named(diagnosed(record, size * (1.0 - np.exp(-hours / constant))), "warm-up", (size, constant))


def followed(hours: np.ndarray, temperature: np.ndarray, constant: float) -> np.ndarray:
    """What follows a temperature (N,) at some hours (N,), linear between, with a time constant, by Euler's method."""
    fine = np.linspace(hours[0], hours[-1], STEPS)
    warmth = np.interp(fine, hours, temperature)
    lag = [warmth[0]]
    for warm in warmth[:-1]:
        lag.append(lag[-1] + (warm - lag[-1]) * (fine[1] - fine[0]) / constant)
    return np.interp(hours, fine, lag)


@pytest.mark.parametrize("seed", [2, pytest.param(3, marks=pytest.mark.acceptance)])
@pytest.mark.parametrize("before", [-0.25, *(pytest.param(k, marks=pytest.mark.acceptance) for k in (0.0, 0.15))])
def test_a_lag_of_the_temperature_is_named_with_its_time_constant(seed, before):
    """Steady at the first row, or after another temperature for some hours before it, which no row says."""
    rng, record = drawn(seed, 26)
    hours, constant, coefficient = hours_of(record), float(rng.uniform(0.03, 0.15)), 5e-5
    assert record.temperature is not None
    early = record.temperature[0] + before * np.ptp(record.temperature) * np.array([4.0, 4.0, 0.0])
    times, warmth = np.append([-2.0, -0.05, -1e-6], hours), np.append(early, record.temperature)
    lag = followed(times, warmth, constant)[3:]
    ahead = lag[0] - record.temperature[0]
    assert (abs(ahead) > 0.1 * np.ptp(record.temperature)) == (before != 0.0)
    values = (coefficient, coefficient * ahead, constant)
    assert_named(diagnosed(record, coefficient * (lag - 20.0)), "thermal-lag", values)


@pytest.mark.acceptance
def test_a_drift_is_named_and_a_slow_warm_up_is_said_not_to_be_excluded():
    _, record = drawn(4, 20)
    hours = hours_of(record)
    result = diagnosed(record, 12.0 * NOISE_BOUND * hours / hours[-1])
    assert_named(result, "bias-drift", (12.0 * NOISE_BOUND / hours[-1],))
    assert set(result.containing_sets or ()) == {(EffectPlace(e, PLACE),) for e in ("warm-up", "thermal-lag")}


@pytest.mark.acceptance
def test_a_bias_that_goes_up_and_down_is_a_wander():
    """No single effect is like it, and with no input or angle does it vary so little."""
    _, record = drawn(5, 30)
    hours = hours_of(record)
    result = diagnosed(replace(record, temperature=None), 10.0 * NOISE_BOUND * np.sin(9.0 * hours / hours[-1]))
    sets = [[(cause.place.effect, cause.place.where) for cause in finding.causes] for finding in result.findings]
    assert [("bias-wander", PLACE)] in sets
    assert all(where == PLACE for causes in sets for _, where in causes)


@pytest.mark.acceptance
def test_what_depends_on_an_input_is_no_wander():
    _, record = drawn(6, 30)
    n = record.specific_force[:, 1] / GRAVITY
    result = diagnosed(record, 30.0 * NOISE_BOUND * n**5 - 20.0 * NOISE_BOUND * np.abs(n) ** 3)
    assert "bias-wander" not in {cause.place.effect for finding in result.findings for cause in finding.causes}


@pytest.mark.acceptance
def test_two_effects_in_time_get_no_name_from_three_that_look_like_them():
    """A drift and the temperature stand for a bias that settles, beside a step: pairs in time are not tried."""
    settling, stepped = (
        draw_case(Options(effects=(name,), positions=(20, 60)), 31, 5) for name in ("warm-up", "bias-step")
    )
    both = replace(stepped, hidden=stepped.hidden + settling.hidden)
    assert len(both.hidden) == 2
    assert np.array_equal(stepped.instrument.alpha, settling.instrument.alpha)
    result = judged_diagnosis(both, both.measured())
    assert (result.verdict, result.causes) == ("unexplained", ())
    assert any("two effects that set in, settle or lag" in text for text in result.not_named or ())


@pytest.mark.acceptance
def test_three_linear_effects_are_named_where_no_pair_in_time_does():
    _, record = drawn(8, 40)
    hours, n = hours_of(record), record.specific_force / GRAVITY
    record.specific_force[:, 2] += GRAVITY * 60.0 * NOISE_BOUND * (n[:, 2] ** 3 + n[:, 0] * n[:, 1])
    result = diagnosed(record, 60.0 * NOISE_BOUND * hours / hours[-1])
    assert result.verdict == "explained"
    assert {cause.place.effect for cause in result.causes} == {"bias-drift", "cubic", "cross-product"}
