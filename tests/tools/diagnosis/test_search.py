"""The search with the exact model: sets of three, what is not linear beside what is, noise at its very bound."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from bench_cases import bench_case
from generator import G as GRAVITY
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from trihedron.models.effects import EffectPlace
from trihedron.models.effects.last_stage import place_of
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.procedure import diagnosed as diagnosed_evidence
from trihedron.tools.diagnosis.rivals import NOT_COMPARED
from trihedron.tools.diagnosis.search import search
from trihedron.tools.diagnosis.witness import Witness
from trihedron.tools.errors import InputError
from trihedron.tools.evidence.bench import LARGEST_OF_BENCH, bench_evidence
from trihedron.tools.evidence.bench_model import with_possible_sizes
from trihedron.tools.records import PositionRecord
from trihedron.tools.records.channels import Channels
from trihedron.tools.reports.verdict import verdict_sentence
from trihedron.tools.trials.bench import NOISE_BOUND, draw_bench
from trihedron.tools.trials.case import Case
from trihedron.tools.trials.outcome import diagnosed
from trihedron.tools.trials.sizes import Hidden

Effects = dict[EffectPlace, tuple[float, ...]]
CUBIC_1 = EffectPlace("cubic", "accelerometer-1")
WOBBLE = EffectPlace("axis-wobble", "outer-axis", 2)
DRIFT_2 = EffectPlace("bias-drift", "accelerometer-2")
SAG = EffectPlace("sag", "inner-axis")
TWICE = EffectPlace("axis-wobble", "inner-axis", 2)


@pytest.mark.parametrize("swapped", [(0, 1), (1, 2)])
def test_swapped_accelerometers_are_named_nothing(swapped):
    """They are said to be swapped; of a person who says that they are not, nothing is named."""
    rng = np.random.default_rng(5)
    bench = random_bench(rng)
    reading = simulated(bench, noise=rng.uniform(-NOISE_BOUND, NOISE_BOUND, (24, 3))).specific_force / GRAVITY
    reading[:, swapped] = reading[:, swapped[::-1]]
    record = position_record(reading)
    with pytest.raises(InputError, match="--channels 2,1,3" if swapped == (0, 1) else "--channels 1,3,2"):
        diagnose(record, noise_bound=NOISE_BOUND)
    record = record.read_with(Channels.given(["1,2,3"]))
    if swapped == (1, 2):
        with pytest.raises(InputError, match="is its sign, or that of an angle, reversed"):
            diagnose(record, noise_bound=NOISE_BOUND)
        return
    result = diagnose(record, noise_bound=NOISE_BOUND)
    assert result.verdict == "unexplained"
    assert result.findings == ()
    assert any("far from an aligned bench" in warning for warning in result.warnings)


def test_readings_of_other_positions_are_named_nothing():
    rng = np.random.default_rng(6)
    reading = simulated(random_bench(rng)).specific_force / GRAVITY
    assert diagnose(position_record(np.roll(reading, 1, axis=0)), noise_bound=NOISE_BOUND).verdict == "unexplained"


@pytest.mark.acceptance
def test_outliers_of_a_whole_g_are_found_although_they_turn_the_signs_of_other_inputs():
    rng = np.random.default_rng(5)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, 40))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (40, 3))
    noise[3, 1] += 1.0
    for size, places in ((0.0, [place_of(4, 2)]), (-2.0, [place_of(11, 3), place_of(4, 2)])):
        noise[10, 2] += size
        result = diagnose(simulated(bench, alpha, beta, noise), noise_bound=NOISE_BOUND)
        assert result.verdict == "explained"
        assert [cause.place for cause in result.causes] == places
        low, high = result.causes[-1].intervals[0]
        assert low <= 1.0 <= high
        # Misfits of a whole g leave the linear model open, by which other functions are compared: no level is claimed.
        assert result.level is None
        assert result.caution == (NOT_COMPARED,)


def case_with(effects: Effects, seed: int, *, positions: int = 36, noise: str = "edge") -> Case:
    """A drawn bench with these effects."""
    bench = draw_bench(np.random.default_rng(seed), (positions, positions))
    return Case(seed, 0, replace(bench, noise=noise), tuple(Hidden(place, v) for place, v in effects.items()))


THREE: Effects = {CUBIC_1: (6e-4,), WOBBLE: (4e-4, 0.7), DRIFT_2: (2e-3,)}


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("effects", "seed"),
    [
        pytest.param(THREE, 1, marks=pytest.mark.acceptance),
        # The second order of 3e-3 rad is half a σ: with a signature alone the right name would be refused.
        ({SAG: (3e-3, 0.4)}, 5),
        pytest.param({TWICE: (2e-3, 1.0, 3e-3, -2.0)}, 5, marks=pytest.mark.acceptance),
        pytest.param(
            {CUBIC_1: (8e-4,), place_of(4, 2): (4e-4,), place_of(21, 3): (-3e-4,)}, 9, marks=pytest.mark.acceptance
        ),
    ],
    ids=["three", "large sag", "large wobble", "two outliers and an effect"],
)
def test_effects_are_named_together_though_every_error_is_at_its_bound(effects, seed):
    case = case_with(effects, seed)
    result: Any = diagnosed(case, case.measured())
    assert result.verdict == "explained"
    assert {cause.place for cause in result.causes} == set(effects)
    assert result.best is not None
    assert result.best.radius <= 1.0 + 1e-5
    assert isinstance(result.judgement, Witness)
    assert result.judgement.folds is not None


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("bent", "values"),
    [
        (EffectPlace("saturation", "accelerometer-3"), (0.93,)),
        (EffectPlace("quantisation", "accelerometer-2"), (2e-4,)),
        (EffectPlace("dead-zone", "accelerometer-2"), (0.045,)),
    ],
    ids=lambda value: value.effect if isinstance(value, EffectPlace) else None,
)
def test_what_is_not_linear_is_named_beside_a_linear_effect(bent, values):
    drift = EffectPlace("bias-drift", "accelerometer-1")
    hidden = (Hidden(drift, (3e-3,)), Hidden(bent, values))
    case = replace(bench_case(11), index=0, hidden=hidden)
    result: Any = diagnosed(case, case.measured())
    assert result.verdict in ("explained", "ambiguous")
    named = [{cause.place for cause in finding.causes} for finding in result.findings]
    assert {drift, bent} in named
    # An outlier may stand for what changes a single reading; nothing else may.
    assert all(drift in places and len(places) == 2 for places in named)
    assert all(bent in places or any(p.effect == "outlier" for p in places) for places in named)
    cause = next(c for f in result.findings for c in f.causes if c.place == bent)
    low, high = cause.intervals[0]
    assert low <= values[0] <= high


@pytest.mark.acceptance
def test_rounded_temperatures_and_angles_do_not_refuse_the_right_name():
    """Every error is at its bound: what rounding adds is beyond it."""
    place = EffectPlace("temperature-bias", "accelerometer-1")
    case = case_with({place: (6e-5,)}, 0)
    record = case.measured()
    assert record.temperature is not None
    digit = np.deg2rad(1e-6)
    rounded = replace(
        record,
        temperature=np.round(record.temperature, 2),
        temperature_resolution=0.005,
        alpha=digit * np.round(record.alpha / digit),
        beta=digit * np.round(record.beta / digit),
        angle_resolution=0.5 * digit,
    )
    result: Any = diagnosed(case, rounded)
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [place]
    low, high = result.causes[0].intervals[0]
    assert low <= 6e-5 <= high


@pytest.mark.acceptance
def test_an_effect_of_a_large_size_does_not_hide_a_small_one():
    """Five hundred σ of one and ten of the other: the search begins where the large one no longer draws the fit."""
    effects: Effects = {EffectPlace("encoder-harmonic", "outer-axis", 3): (5e-3, 0.3), CUBIC_1: (8e-4,)}
    case = case_with(effects, 7)
    record = case.measured()
    evidence = bench_evidence(
        record, noise_bound=NOISE_BOUND, baseline=case.instrument.baseline, mounting=case.instrument.matrices
    )
    found = evidence.search.anchors(evidence.search.centre, evidence.linear_places)
    assert EffectPlace("encoder-harmonic", "outer-axis", 3) in {centre.places[-1] for centre in found}
    assert evidence.search.slack(found[0]) < 0.1 * evidence.search.slack(evidence.search.centre)
    result: Any = diagnosed(case, record)
    assert result.verdict == "explained"
    assert {cause.place for cause in result.causes} == set(effects)


@pytest.mark.acceptance
def test_three_outliers_are_no_cause():
    """At most two: enough outliers explain anything."""
    effects = {place_of(4, 2): (4e-4,), place_of(21, 3): (-3e-4,), place_of(30, 1): (5e-4,)}
    case = case_with(effects, 13)
    result: Any = diagnosed(case, case.measured())
    assert result.verdict == "unexplained"
    assert result.causes == ()


def test_impossible_sizes_are_no_cause():
    """A cubic term of 0.4 per g² is not one that an accelerometer has; within its limits the fit does not reach."""
    case = case_with({CUBIC_1: (8e-4,)}, 15)
    record = case.measured()
    far = record.specific_force.copy()
    here = calibrate(
        record, noise_bound=NOISE_BOUND, baseline=case.instrument.baseline, mounting=case.instrument.matrices
    )
    far[:, 0] += 9.80665 * 0.4 * here.linearised.input[:, 0] ** 3
    bent = bench_evidence(
        replace(record, specific_force=far),
        noise_bound=NOISE_BOUND,
        baseline=case.instrument.baseline,
        mounting=case.instrument.matrices,
    )
    fit = bent.refit([CUBIC_1])
    assert not fit.is_possible
    assert with_possible_sizes(fit, 1.0, LARGEST_OF_BENCH) is None


def walking(seed: int, positions: int = 24, step: float = 1e-5) -> PositionRecord:
    """The record of a bench whose first accelerometer's bias walks: no effect of the catalogue."""
    rng = np.random.default_rng(seed)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, positions))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (positions, 3))
    noise[:, 0] += np.cumsum(rng.normal(0.0, step, positions))
    return simulated(random_bench(rng), alpha, beta, noise)


def test_a_search_is_cut_off_by_the_work_that_it_does_and_says_among_which_sets():
    evidence = bench_evidence(walking(1), noise_bound=NOISE_BOUND)
    work = [search(evidence, most_work=limit) for limit in (8e5, 8e5, 1e3)]
    assert [(found.complete, found.size) for found in work] == [(False, 3), (False, 3), (False, 1)]
    assert [fit.title for fit in work[0].fits] == [fit.title for fit in work[1].fits]
    result = diagnosed_evidence(evidence, most_work=1e3)
    assert (result.verdict, result.complete, result.cut_off_at) == ("unexplained", False, 1)
    assert result.to_json()["cut_off_at"] == 1
    said = str(result).splitlines()
    assert "the search was cut off" in said[0].lower()
    assert "warning: the search was cut off: single effects were not all tried" in said


def test_what_was_found_before_the_search_was_cut_off_stands():
    rng = np.random.default_rng(3)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, 16))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (16, 3))
    noise[:, 1] += 4e-5 * np.arange(16) / 15.0
    evidence = bench_evidence(simulated(random_bench(rng), alpha, beta, noise), noise_bound=NOISE_BOUND)
    every = {fit.title for fit in search(evidence).fits}
    for limit in np.geomspace(3e4, 1e6, 8):
        found = search(evidence, most_work=limit)
        if found.fits and not found.complete:
            break
    assert 0 < len(found.fits) < len(every)
    assert {fit.title for fit in found.fits} < every
    result = diagnosed_evidence(evidence, most_work=limit)
    assert (result.verdict, result.complete, result.cut_off_at) == ("ambiguous", False, 1)
    said = str(result).splitlines()
    assert "others may that were not tried: the search was cut off" in said[0]
    assert "warning: the search was cut off: single effects were not all tried" in said
    assert "others may that were not tried" in verdict_sentence(result)


@pytest.mark.parametrize("seed", [0, *(pytest.param(k, marks=pytest.mark.acceptance) for k in (1, 2, 3))])
def test_readings_in_steps_are_named_where_noise_at_its_bound_came_after_the_rounding(seed):
    """Where steps are a multiple of σ, such readings are exact multiples of σ, too."""
    rng = np.random.default_rng([seed, 5])
    count, p = int(rng.integers(14, 45)), seed % 3
    step = round(10.0 ** rng.uniform(-3.6, -2.4) / NOISE_BOUND) * NOISE_BOUND
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    reading = simulated(random_bench(rng), alpha, beta).specific_force / GRAVITY
    reading[:, p] = np.round(reading[:, p] / step) * step
    reading = np.round(reading + NOISE_BOUND * rng.choice([-1.0, 1.0], (count, 3)), 10)
    result = diagnose(position_record(reading, alpha, beta, resolution=5e-11 * GRAVITY), noise_bound=NOISE_BOUND)
    assert result.verdict == "explained"
    assert [cause.place for cause in result.causes] == [EffectPlace("quantisation", f"accelerometer-{p + 1}")]
    low, high = result.causes[0].intervals[0]
    assert low <= step <= high


@pytest.mark.parametrize(
    ("seed", "exchanged"),
    [
        (1, (0, 0)),
        (2, (1, 2)),
        pytest.param(3, (2, 2), marks=pytest.mark.acceptance),
        pytest.param(6, (0, 1), marks=pytest.mark.acceptance),
    ],
)
def test_channels_that_are_exchanged_from_a_time_on_are_named_with_the_gap_between_two_rows(seed, exchanged):
    rng = np.random.default_rng([seed, 9])
    count = int(rng.integers(20, 40))
    row = int(count * rng.uniform(0.6, 0.85))
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (count, 3))
    reading = simulated(random_bench(rng), alpha, beta, noise).specific_force / GRAVITY
    first, second = exchanged
    if first == second:
        reading[row:, first] *= -1.0
    else:
        reading[row:, [first, second]] = reading[row:, [second, first]]
    record = position_record(reading, alpha, beta)
    result = diagnose(record, noise_bound=NOISE_BOUND)
    assert result.verdict == "explained"
    place = EffectPlace("exchanged-readings", f"accelerometer-{first + 1}", axes=(second + 1,))
    assert [cause.place for cause in result.causes] == [place]
    hours = record.time_s / 3600.0
    assert result.causes[0].intervals[0] == pytest.approx((hours[row - 1], hours[row]))


@pytest.mark.acceptance
def test_some_of_many_sets_are_no_answer_beside_one_function_as_simple():
    """A walk at one accelerometer: pairs of unrelated effects fit it, too, and the search finds some of them."""
    result = diagnosed_evidence(bench_evidence(walking(8, 24, 1.1e-5), noise_bound=NOISE_BOUND), most_work=2e6)
    assert (result.verdict, result.complete, result.cut_off_at) == ("unexplained", False, 2)
    assert not result.causes
    assert result.not_named
    assert all("would do; others may that were not tried, and, as simple, a function" in s for s in result.not_named)
    said = str(result).splitlines()
    assert said[0].startswith("The simulation lacks something")
    assert any(line.startswith("Not named: ") for line in said)


@pytest.mark.parametrize(
    ("seed", "row", "exchanged"),
    [(2, 5, (0, 1)), pytest.param(4, 5, (1, 2), marks=pytest.mark.acceptance), (4, 5, (2, 2))],
)
def test_channels_that_are_exchanged_in_most_of_a_record_are_named(seed, row, exchanged):
    """What is left of them before that tells no bench by itself: it is told with the others exchanged back."""
    rng = np.random.default_rng([seed, 33])
    count = int(rng.integers(16, 37))
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    reading = simulated(bench, alpha, beta).specific_force / GRAVITY
    reading += rng.uniform(-NOISE_BOUND, NOISE_BOUND, (count, 3))
    first, second = exchanged
    if first == second:
        reading[row:, first] *= -1.0
    else:
        reading[row:, [first, second]] = reading[row:, [second, first]]
    record = position_record(reading, alpha, beta)
    result = diagnose(record, noise_bound=NOISE_BOUND, rerun=False)
    assert result.verdict == "explained"
    place = EffectPlace("exchanged-readings", f"accelerometer-{first + 1}", axes=(second + 1,))
    assert [cause.place for cause in result.causes] == [place]
    low, high = result.causes[0].intervals[0]
    hours = record.time_s / 3600.0
    assert low <= hours[row - 1] < hours[row] <= high
