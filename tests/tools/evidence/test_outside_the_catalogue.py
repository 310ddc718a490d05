"""Records with an effect outside the catalogue: no cause is named, and no bound hides it."""

import re
from dataclasses import replace
from html import unescape
from typing import Any

import numpy as np
import pytest

from generator.carried import camera_attitude, drawn_motion, slow_noise, strapdown_record
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.document import html
from trihedron.tools.evidence import carried_evidence
from trihedron.tools.motion import RestNoise, inspect_record
from trihedron.tools.motion.rest_noise import allan_square
from trihedron.tools.records import StrapdownRecord
from trihedron.tools.records.noise import sums_of
from trihedron.tools.reports import page_of

ARCMIN = np.pi / 180.0 / 60.0
PERIOD, WHITE = 0.02, 7e-4
"""Time between the rows [s], and noise of one reading of a gyro [rad/s]."""
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.acceptance) for seed in (1, 2, 3))]


def drawn_record(seed: int, change, *, filmed: bool) -> tuple[StrapdownRecord, np.random.Generator]:
    """Return a record of drawn moves; `change` makes readings of rates (N, 3) from times, rates and random numbers."""
    rng = np.random.default_rng(seed)
    time, rate, n, attitude = drawn_motion(rng, moves=10 if filmed else 18, rest=3.0, period=PERIOD)
    motion = (time, change(time, rate, rng) + slow_noise(rng, len(time), 2e-5), n)
    record = strapdown_record(motion, seed=seed, gyro_bias=rng.uniform(-0.01, 0.01, 3), rate_noise=WHITE)
    if filmed:
        record = replace(record, attitude=camera_attitude(rng, attitude, rng.uniform(0.3, 0.8) * ARCMIN))
    return record, rng


def unchanged(time, rate, rng):
    return rate


def rate_cubed(time, rate, rng):
    return rate + rng.uniform(1.5e-3, 4e-3) * rng.choice([-1.0, 1.0], 3) * rate**3


def changing_scale(time, rate, rng):
    return rate * (1.0 + rng.uniform(8e-3, 2e-2, 3) * rng.choice([-1.0, 1.0], 3) * (time / time[-1])[:, None])


def swinging_scale(time, rate, rng):
    turn = 2.0 * np.pi * time / rng.uniform(8.0, 12.0)
    return rate * (1.0 + rng.uniform(8e-3, 2e-2, 3) * np.sin(turn[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3)))


def rate_in_waves(time, rate, rng):
    return rate + rng.uniform(8e-3, 2e-2, 3) * np.sin(8.0 * rate)


def late_from_the_middle_on(time, rate, rng):
    late = np.vstack([rate[:1], rate[:-1]])
    return np.where((time > rng.uniform(0.4, 0.6) * time[-1])[:, None], late, rate)


def low_passed(time, rate, rng):
    """Filter each gyro with a time constant of its own, one of them fast."""
    retained = np.exp(-PERIOD / np.array([0.02, 1e-4, 0.012]))
    passed = np.array(rate)
    for k in range(1, len(rate)):
        passed[k] = rate[k] + (passed[k - 1] - rate[k]) * retained
    return passed


def step_of_the_bias(time, rate, rng):
    size = rng.uniform(1e-3, 3e-3, 3) * rng.choice([-1.0, 1.0], 3)
    return rate + np.where(time[:, None] > rng.uniform(0.35, 0.65) * time[-1], size, 0.0)


def settling_bias(time, rate, rng):
    size = rng.uniform(1e-2, 2e-2, 3) * rng.choice([-1.0, 1.0], 3)
    return rate + size * np.exp(-time[:, None] / (rng.uniform(0.1, 0.25) * time[-1]))


def swinging_bias(time, rate, rng):
    size, turn = rng.uniform(1e-3, 3e-3, 3), 2.0 * np.pi * time / rng.uniform(25.0, 50.0)
    return rate + size * np.sin(turn[:, None] + rng.uniform(0.0, 2.0 * np.pi, 3))


def two_biases(time, rate, rng):
    """Give each rest one of two biases, like a gyro that jumps."""
    changes = np.cumsum(rng.random(len(time)) < PERIOD / 15.0)[:, None] % 2
    return rate + changes * rng.uniform(1e-3, 3e-3, 3)


def shown_texts(result: Diagnosis) -> tuple[str, str]:
    """Return the page's text, and the terminal's without its line ends."""
    page = page_of(result)
    assert page is not None
    return unescape(html(page)), " ".join(str(result).split())


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("change", [swinging_scale, pytest.param(rate_in_waves, marks=pytest.mark.acceptance)])
def test_beside_the_true_attitude_what_is_not_in_the_catalogue_is_no_cause_and_stretches_no_bound(change, seed):
    clean = carried_evidence(drawn_record(seed, unchanged, filmed=True)[0]).reader.head()["noise_bound_arcmin"]
    result: Any = diagnose(drawn_record(seed, change, filmed=True)[0], rerun=False)
    assert (result.verdict, result.causes) == ("unexplained", ())
    assert result.radius > 2.0
    # The bound is that of the instruments, without the hidden fault.
    assert result.noise_bound_arcmin == pytest.approx(clean, rel=0.5)
    (objection,) = [text for text in result.not_named or () if "all effects of the catalogue together" in text]
    needed, explained = map(float, re.findall(r"have to be ([0-9.]+) arcmin, .* explain ([0-9.]+);", objection)[0])
    assert explained == pytest.approx(result.noise_bound_arcmin, rel=0.01)
    assert needed > explained
    on_page, at_terminal = shown_texts(result)
    assert objection in on_page
    # A sentence of the terminal begins with a capital.
    assert objection[1:80] in at_terminal


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("change", [swinging_bias, pytest.param(two_biases, marks=pytest.mark.acceptance)])
def test_a_bias_that_is_not_constant_at_rest_is_said_in_the_verdict_and_is_no_noise(change, seed):
    record, clean = (drawn_record(seed, which, filmed=False)[0] for which in (change, unchanged))
    result, without = diagnose(record, rerun=False), carried_evidence(clean).reader.head()["noise_bound_arcmin"]
    assert (result.verdict, result.causes) == ("unexplained", ())
    assert result.noise_bound_arcmin < 3.0 * without
    assert all("not constant at rest" in objected for objected in shown_texts(result))
    gyros = inspect_record(record).gyros
    assert gyros is not None
    assert (gyros.verdict, gyros.standing) == ("wandering", ())


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(4))
def test_biases_that_change_once_are_named_with_the_time_and_said_not_to_be_constant(seed):
    """Between rests only noise is beside the change, so the bound is the instruments'."""
    record, clean = (drawn_record(seed, which, filmed=False)[0] for which in (step_of_the_bias, unchanged))
    rng = np.random.default_rng(seed)
    drawn_motion(rng, moves=18, rest=3.0, period=PERIOD)
    size = rng.uniform(1e-3, 3e-3, 3) * rng.choice([-1.0, 1.0], 3)
    start = rng.uniform(0.35, 0.65) * record.time_s[-1] / 3600.0
    result: Any = diagnose(record, rerun=False)
    assert (result.verdict, [cause.effect for cause in result.causes]) == ("explained", ["gyro-bias-step"])
    (cause,) = result.causes
    for true, (low, high) in zip((*size, start), cause.intervals, strict=True):
        assert low <= true <= high
    assert result.noise_bound_arcmin < 2.0 * carried_evidence(clean).reader.head()["noise_bound_arcmin"]
    assert all("not constant at rest" in objected for objected in (shown_texts(result)[1], *result.warnings))
    gyros = inspect_record(record).gyros
    assert gyros is not None
    assert gyros.verdict == "wandering"


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("filmed", [False, True])
def test_gyros_with_flicker_noise_alone_are_constant_and_consistent(filmed, seed):
    record, _ = drawn_record(seed, unchanged, filmed=filmed)
    assert diagnose(record, rerun=False).verdict == "consistent"
    gyros = inspect_record(record).gyros
    assert gyros is not None
    assert gyros.verdict == "constant"


CATALOGUE = {
    "latency": lambda time, rate, rng: np.vstack([np.repeat(rate[:1], 5, axis=0), rate[:-5]]),
    "gyro-scale-misalignment": lambda time, rate, rng: rate @ (np.eye(3) + rng.uniform(-0.01, 0.01, (3, 3))).T,
    "gyro-scale-asymmetry": lambda time, rate, rng: rate + 0.01 * np.abs(rate),
    "gyro-rate-squared": lambda time, rate, rng: rate + 0.01 * rate**2,
    "gyro-rate-cubed": rate_cubed,
    "gyro-scale-drift": changing_scale,
    "lag": low_passed,
    "latency-step": late_from_the_middle_on,
    "gyro-bias-step": step_of_the_bias,
    "gyro-warm-up": settling_bias,
}


ALSO_ELSEWHERE = (
    *("gyro-scale-misalignment", "gyro-warm-up", "latency"),
    *("gyro-rate-squared", "gyro-scale-drift", "gyro-bias-step", "lag"),
)
"""Effects that other tests name beside true attitudes or between rests, or that act like one of the others."""


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "name",
    [pytest.param(n, marks=pytest.mark.acceptance) if n in ALSO_ELSEWHERE else n for n in CATALOGUE],
)
def test_what_is_in_the_catalogue_is_named_within_the_bound_of_the_instruments(name):
    result = diagnose(drawn_record(7, CATALOGUE[name], filmed=True)[0], rerun=False)
    assert (result.verdict, [cause.effect for cause in result.causes]) == ("explained", [name])


def test_without_a_rest_nothing_tells_the_noise_and_nothing_is_judged():
    rng = np.random.default_rng(3)
    time, rate, n, attitude = drawn_motion(rng, rest=0.3)
    record = strapdown_record((time, rate_cubed(time, rate, rng), n), seed=3, rate_noise=WHITE)
    result = diagnose(replace(record, attitude=camera_attitude(rng, attitude, 0.5 * ARCMIN)), rerun=False)
    assert result.verdict == "insufficient"
    assert "a rest" in str(result.missing)


@pytest.mark.acceptance
def test_fast_turns_are_not_taken_for_a_true_attitude_of_another_kind():
    """Sums of rates are not rotation vectors if the block turns by several radians in a window."""
    rng = np.random.default_rng(2)
    time, rate, n, attitude = drawn_motion(rng)
    fast = 6.0
    record: Any = strapdown_record((time / fast, fast * rate, n), seed=2, rate_noise=WHITE)
    result = diagnose(replace(record, attitude=camera_attitude(rng, attitude, 0.5 * ARCMIN)), rerun=False)
    assert np.abs(record.rate).max() > 15.0
    assert result.verdict in ("consistent", "insufficient")


def test_means_of_flicker_noise_differ_over_a_record_as_the_allan_deviation_within_short_pieces_says():
    rows, size, unknown = 2**14, 2**8, np.full(3, np.nan)
    measured, predicted = [], []
    for seed in range(12):
        noise = slow_noise(np.random.default_rng(seed), rows, 1.0)
        pieces = list(noise.reshape(-1, 2 * size, 3))
        square, count = allan_square([sums_of(piece) for piece in pieces], size)
        model = RestNoise(np.zeros(3), square, square, count, unknown, float(rows))
        means = noise.reshape(-1, size, 3).mean(axis=1)
        measured.append(means.var(axis=0))
        predicted.append(model.rate_square(np.array([size]))[0])
        # Means that differ three times as much count as unsteady, these do not.
        lengths = np.full(len(means), float(size))
        assert not model.judged(means.var(axis=0, ddof=1), len(means) - 1, lengths).unsteady
        assert model.judged(9.0 * means.var(axis=0, ddof=1), len(means) - 1, lengths).unsteady
    assert np.mean(predicted) == pytest.approx(np.mean(measured), rel=0.2)
