"""Effects that are not linear act as one of their variants; the step of rounded readings is found."""

from dataclasses import replace

import numpy as np
import pytest

from effect_readings import HOURS, G, readings, true_bench
from trihedron.models.effects import CATALOGUE, EffectPlace, Variant
from trihedron.models.effects.last_stage import LEAST_STEP, common_step, noisy_step, quantisation_variants


def predicted(variant: Variant, coefficients: np.ndarray) -> np.ndarray:
    """Return readings (7, 3) [g] of the true bench with a variant of an effect."""
    return true_bench()[1].prediction + variant.offset + variant.columns @ coefficients


def one_variant(name: str, accelerometer: int, parameter: float) -> tuple[Variant, np.ndarray]:
    """Return the variant of an effect that acts like the component, and the component's readings (7, 3) [g]."""
    place = EffectPlace(name, f"accelerometer-{accelerometer}")
    measured = readings({place: (parameter,)})
    variants = CATALOGUE[name].variants
    assert variants is not None
    rows = true_bench()[1]
    fitting = [v for v in variants(place, rows, measured, 1e-9) if v.limits[0][0] <= parameter <= v.limits[0][1]]
    standing = [v for v in fitting if v.stands(rows, np.array([parameter])[: v.columns.shape[2]])]
    assert len(standing) == 1
    return standing[0], measured


def test_a_dead_zone_acts_as_one_of_its_variants():
    n = true_bench()[1].n
    accelerometer = int(np.abs(n).min(axis=0).argmin())
    width = float(np.abs(n[:, accelerometer]).min()) + 1e-3
    assert width < 0.05
    variant, measured = one_variant("dead-zone", accelerometer + 1, width)
    assert variant.lost.sum() == (np.abs(n[:, accelerometer]) < width).sum()
    assert predicted(variant, np.zeros(0)) == pytest.approx(measured, abs=1e-14)
    assert variant.limits[0][0] < variant.values(np.zeros(0))[0] <= variant.limits[0][1]


def test_saturation_acts_as_one_of_its_variants():
    prediction = np.abs(true_bench()[1].prediction)
    accelerometer = int(prediction.max(axis=0).argmax())
    order = np.sort(prediction[:, accelerometer])
    level = max(0.9, float(order[-2]) - 1e-4)
    variant, measured = one_variant("saturation", accelerometer + 1, level)
    assert variant.fixed.sum() == (prediction[:, accelerometer] >= level).sum() >= 2
    assert predicted(variant, np.array([level])) == pytest.approx(measured, abs=1e-14)
    assert variant.low[0] <= level <= variant.high[0]
    assert variant.values(np.array([level])) == (level,)


def test_quantisation_widens_the_bounds_of_its_accelerometer():
    variant, measured = one_variant("quantisation", 2, 1.3e-4)
    misfit = np.abs(measured - predicted(variant, np.zeros(0)))
    assert variant.values(np.zeros(0))[0] == pytest.approx(1.3e-4, rel=1e-9)
    assert np.all(misfit <= variant.widening + 1e-12)
    assert misfit[:, 1].max() > 1e-5
    assert variant.widening[:, [0, 2]].max() == 0.0


@pytest.mark.parametrize("seed", range(6))
def test_the_step_of_averaged_readings_is_found_and_none_where_there_is_none(seed):
    """Use means over rests of rounded samples: some rests lie between two steps. Nine decimals, as in a record."""
    rng = np.random.default_rng(seed)
    count, step = int(rng.integers(15, 90)), 10.0 ** rng.uniform(-4.5, -2.5)
    n = rng.uniform(-1.0, 1.0, count)
    samples = n[:, None] + rng.uniform(-2e-6, 2e-6, (count, 20))
    rounded = (step * np.floor(samples / step + 0.5)).mean(axis=1)
    assert common_step(np.round(rounded * G, 9) / G, 1e-10, 2e-6) == pytest.approx(step, rel=1e-6)
    assert common_step(np.round(n * G, 9) / G, 1e-10, 2e-6) is None


@pytest.mark.parametrize("odd", [0, 1])
def test_a_step_of_which_most_readings_are_even_multiples_by_chance_is_tried_too(odd):
    """An odd one is not a proof: a mean over a rest with half of the samples rounded up lies there as well."""
    step, counts = 2e-4, np.array([-2274, -218, 2002, -884, 4108, 986, 894, 412, -1264, 1154, -3756, 4062 + odd])
    reading = np.zeros((len(counts), 3))
    reading[:, 1] = np.round(step * counts * G, 9) / G
    rows = replace(true_bench()[1], n=reading)
    candidates = quantisation_variants(EffectPlace("quantisation", "accelerometer-2"), rows, reading, 1e-5)
    assert [0.5 * sum(variant.limits[0]) for variant in candidates] == pytest.approx(
        [2.0 * step, step][: 1 + odd], rel=1e-6
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_step_that_noise_came_on_top_of_is_found_and_none_where_there_is_none(seed):
    rng = np.random.default_rng(seed)
    count, step, sigma = int(rng.integers(12, 90)), 10.0 ** rng.uniform(-3.5, -2.1), 1e-5
    n = rng.uniform(-1.0, 1.0, count)
    noise = sigma * rng.choice([-1.0, 1.0], count)
    limits = noisy_step(step * np.round(n / step) + noise, sigma + 1e-10)
    assert limits is not None
    assert limits[0] <= step * (1 + 1e-12)
    assert limits[1] >= step * (1 - 1e-12)
    assert limits[1] - limits[0] < 1e-3 * step + 2.0 * sigma / np.abs(n / step).max()
    assert noisy_step(n + noise, sigma + 1e-10) is None


@pytest.mark.parametrize("seed", range(8))
def test_many_readings_of_few_inputs_prove_no_step_under_noise(seed):
    """Nine inputs are read three times each: all may lie near multiples of some step by chance."""
    rng = np.random.default_rng(seed)
    step, sigma = 10.0 ** rng.uniform(-3.5, -2.1), 1e-5
    inputs = np.repeat(rng.integers(50, 100, 9) * step, 3)
    assert noisy_step(inputs + rng.uniform(-sigma, sigma, 27), sigma) is None


def test_no_step_below_the_least_is_sought_however_small_the_noise():
    """Trying all of them would fill the memory, and the catalogue has none of this size."""
    values = 0.2 * LEAST_STEP * np.random.default_rng(3).integers(-(10**7), 10**7, 60).astype(np.float64)
    assert noisy_step(values, 1e-10) is None


@pytest.mark.parametrize("place", CATALOGUE["exchanged-readings"].places, ids=lambda place: place.title)
def test_exchanged_readings_are_one_of_the_variants_from_its_time_on(place):
    start = 0.5 * (HOURS[2] + HOURS[3])
    rows, measured = true_bench()[1], readings({place: (start,)})
    rows = replace(rows, hours=HOURS)
    variants = CATALOGUE["exchanged-readings"].variants
    assert variants is not None
    containing = [v for v in variants(place, rows, measured, 1e-9) if v.limits[0][0] <= start <= v.limits[0][1]]
    assert len(containing) == 1
    assert containing[0].limits == ((HOURS[2], HOURS[3]),)
    assert containing[0].mixed is not None
    changed = np.einsum("nij,nj->ni", containing[0].mixed, rows.prediction)
    assert changed == pytest.approx(measured, abs=1e-14)
    assert np.array_equal(containing[0].touched.any(axis=1), np.arange(7) > 2)
    assert not variants(place, rows, rows.prediction, 1e-9)
