"""A bias that changes once, at a time between two rows of a record of positions."""

from collections.abc import Iterable

import numpy as np
import pytest

from generator import G as GRAVITY
from generator.stands import random_bench, simulated
from generator.stands import record as position_record
from trihedron.models.bench import ELEMENTARY
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.cause import Cause
from trihedron.tools.trials.bench import NOISE_BOUND


def some(*seeds: int, of: Iterable[int]) -> list:
    """These seeds; the others are for `make acceptance`."""
    return [seed if seed in seeds else pytest.param(seed, marks=pytest.mark.acceptance) for seed in of]


def drawn(seed: int) -> tuple[np.random.Generator, np.ndarray, np.ndarray, np.ndarray]:
    """A generator, readings (N, 3) [g] of a bench at N random positions with noise, and their angles."""
    rng = np.random.default_rng([seed, 17])
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, int(rng.integers(16, 41))))
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (len(alpha), 3))
    return rng, simulated(random_bench(rng), alpha, beta, noise).specific_force / GRAVITY, alpha, beta


def time_of(row: int) -> float:
    """Hours of a row since the first."""
    return 30.0 * row / 3600.0


def candidates(reading: np.ndarray, alpha: np.ndarray, beta: np.ndarray) -> tuple[str, list[tuple[Cause, ...]]]:
    """The verdict on readings, and the sets of causes that it names or leaves."""
    result = diagnose(position_record(reading, alpha, beta), noise_bound=NOISE_BOUND, rerun=False)
    return result.verdict, list(result.sets)


@pytest.mark.parametrize("seed", some(0, 1, of=range(8)))
def test_a_step_is_named_or_among_the_candidates_with_its_time_and_size_inside_their_intervals(seed):
    rng, reading, alpha, beta = drawn(seed)
    count, p = len(reading), int(rng.integers(3))
    row = int(rng.integers(int(0.25 * count), int(0.85 * count)))
    size = NOISE_BOUND * float(rng.choice([-1.0, 1.0]) * rng.uniform(5.0, 25.0))
    reading[row:, p] += size
    before, after = time_of(row - 1), time_of(row)
    place = EffectPlace("bias-step", f"accelerometer-{p + 1}")
    verdict, sets = candidates(reading, alpha, beta)
    own = [causes for causes in sets if [cause.place for cause in causes] == [place]]
    assert verdict == "explained" if len(sets) == 1 else verdict == "ambiguous"
    assert all(cause.acts for causes in own for cause in causes)
    ends = [causes[0].intervals for causes in own]
    assert sum(low <= size <= high and first <= before < after <= last for (low, high), (first, last) in ends) == 1


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", some(100, of=(100, 101, 102, 104, 106, 107)))
def test_a_weak_step_has_every_time_at_which_it_could_be_in_its_interval(seed):
    """At 2 σ it could have come in one of several gaps between rows."""
    _, reading, alpha, beta = drawn(seed)
    row, size = len(reading) // 2, 2.0 * NOISE_BOUND
    reading[row:, 0] += size
    _, sets = candidates(reading, alpha, beta)
    place = EffectPlace("bias-step", "accelerometer-1")
    ((sizes, (first, last)),) = [causes[0].intervals for causes in sets if [c.place for c in causes] == [place]]
    assert sizes[0] <= size <= sizes[1]
    assert first <= time_of(row - 1) < time_of(row) <= last
    assert last - first > 1.5 * time_of(1)


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", some(0, of=range(3)))
def test_a_strong_drift_is_no_step_and_nothing_is_found_where_nothing_is(seed):
    _, reading, alpha, beta = drawn(200 + seed)
    assert candidates(reading, alpha, beta) == ("consistent", [()])
    reading[:, 1] += 20.0 * NOISE_BOUND * np.linspace(0.0, 1.0, len(reading))
    verdict, sets = candidates(reading, alpha, beta)
    assert verdict == "explained"
    assert [cause.place for cause in sets[0]] == [EffectPlace("bias-drift", "accelerometer-2")]


@pytest.mark.parametrize("row", [1, -1])
def test_what_a_single_row_at_an_end_shows_is_no_step(row):
    """The first or the last reading alone is off: an outlier tells it as well, and is what it is called."""
    _, reading, alpha, beta = drawn(300)
    reading[row:, 2] += 20.0 * NOISE_BOUND
    _, sets = candidates(reading, alpha, beta)
    assert sets[0]
    assert all(cause.place.effect != "bias-step" for causes in sets for cause in causes)


@pytest.mark.parametrize(("seed", "sigmas"), [pytest.param(500, 15.0, marks=pytest.mark.acceptance), (501, 300.0)])
def test_a_slip_of_the_mounting_is_named_with_its_angles_and_its_time(seed, sigmas):
    """The mounting error jumps in the exact formulas; of 300 σ its second order is as large as σ."""
    rng = np.random.default_rng([seed, 17])
    bench, count = random_bench(rng), 28
    alpha, beta = rng.uniform(0.0, 2.0 * np.pi, (2, count))
    row, turn = int(rng.integers(8, 20)), rng.normal(size=3)
    turn *= sigmas * NOISE_BOUND / np.linalg.norm(turn)
    slipped = bench.copy()
    slipped[[ELEMENTARY.index(f"mounting_error_{k}") for k in (1, 2, 3)]] += turn
    noise = rng.uniform(-NOISE_BOUND, NOISE_BOUND, (count, 3))
    before, after = (simulated(one, alpha, beta, noise).specific_force / GRAVITY for one in (bench, slipped))
    verdict, sets = candidates(np.where((np.arange(count) < row)[:, None], before, after), alpha, beta)
    assert verdict == "explained"
    assert [cause.place for cause in sets[0]] == [EffectPlace("mounting-slip", "mounting")]
    *ends, (first, last) = sets[0][0].intervals
    # A turn after another one is their sum but for the second order.
    room = 1e-2 * sigmas * NOISE_BOUND
    assert all(low - room <= angle <= high + room for angle, (low, high) in zip(turn, ends, strict=True))
    assert first <= time_of(row - 1) < time_of(row) <= last


def test_a_step_beside_another_effect_is_found_with_it():
    _, reading, alpha, beta = drawn(401)
    row, bent = len(reading) // 2, reading[:, 2] ** 3
    reading[row:, 0] += 20.0 * NOISE_BOUND
    reading[:, 2] += 40.0 * NOISE_BOUND * bent
    wanted = {EffectPlace("bias-step", "accelerometer-1"), EffectPlace("cubic", "accelerometer-3")}
    assert wanted in [{cause.place for cause in causes} for causes in candidates(reading, alpha, beta)[1]]
