"""What settles: lags by the component's own memory, and cells that miss no time constant."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from effect_readings import G, extended_instance
from trihedron.models.effects import CATALOGUE, EffectPlace, Rows
from trihedron.models.effects.last_stage import LAST_HOUR
from trihedron.models.effects.settling import (
    BEFORE,
    LONGEST,
    beginnings,
    begun,
    lagged,
    settled,
    time_constants,
)
from trihedron.models.effects.wander import wander_at

SLOW, FAST = 3.0, 0.02


def drawn(seed: int) -> tuple[np.random.Generator, np.ndarray, np.ndarray]:
    """A generator, hours (N,) of rows, and a temperature (N,) that wanders."""
    rng = np.random.default_rng([seed, 41])
    hours = np.cumsum(rng.uniform(0.005, 0.05, int(rng.integers(8, 60))))
    return rng, hours - hours[0], 20.0 + np.cumsum(rng.normal(0.0, 1.0, len(hours)))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["settled", "lagged"])
def test_every_response_lies_between_those_at_the_ends_of_its_cell_but_for_what_is_paid(seed, kind):
    rng, hours, temperature = drawn(seed)
    ends = time_constants(hours)
    assert ends[0] <= hours[2] * (1.0 + 1e-12)
    assert ends[-1] >= LONGEST * hours[-1] * (1.0 - 1e-12)
    values, error = settled(hours, ends) if kind == "settled" else lagged(hours, temperature, ends)
    for _ in range(20):
        k, share = int(rng.integers(len(ends) - 1)), float(rng.random())
        own = np.array([ends[k] * (ends[k + 1] / ends[k]) ** share])
        exact = (settled(hours, own) if kind == "settled" else lagged(hours, temperature, own))[0][:, 0]
        between = (1.0 - share) * values[:, k] + share * values[:, k + 1]
        assert np.all(np.abs(exact - between) <= error[:, k] + 1e-12)
    # It costs little: a hundredth of what it adds.
    assert error.max() < 0.01 * np.ptp(values, axis=0).max()


@pytest.mark.parametrize("seed", range(4))
def test_a_lag_that_begins_anywhere_lies_between_those_from_both_ends_but_for_what_is_paid(seed):
    rng, hours, temperature = drawn(seed)
    ends, ahead = time_constants(hours), beginnings(temperature)
    # Half the range beyond it, on both sides.
    assert np.ptp(ahead) == pytest.approx(2.0 * np.ptp(temperature))
    assert temperature[0] + ahead.mean() == pytest.approx(0.5 * (temperature.min() + temperature.max()))
    values, error = begun(lagged(hours, temperature, ends), settled(hours, ends), ahead)
    needed = 0.0
    for _ in range(40):
        k, share, part = int(rng.integers(len(ends) - 1)), float(rng.random()), float(rng.integers(2))
        own = ends[k] * (ends[k + 1] / ends[k]) ** share
        steady = lagged(hours, temperature, np.array([own]))[0][:, 0]
        exact = steady + ahead @ [1.0 - part, part] * np.exp(-hours / own)
        at_ends = values[:, k : k + 2] @ [1.0 - part, part]
        off = np.abs(exact - at_ends @ [1.0 - share, share])
        assert np.all(off <= error[:, k] @ [1.0 - part, part] + 1e-12)
        needed = max(needed, float((off - lagged(hours, temperature, ends[k : k + 2])[1][:, 0]).max()))
    # What the lag alone needs would not be enough.
    assert needed > 0.0


@pytest.mark.parametrize("constant", [SLOW, 0.2, FAST])
def test_the_lag_of_a_record_is_that_of_the_differential_equation(constant):
    _, hours, temperature = drawn(11)

    def slope(time, lag):
        return (np.interp(time, hours, temperature) - lag) / constant

    solution = solve_ivp(slope, (0.0, hours[-1]), temperature[:1], t_eval=hours, max_step=2e-3, rtol=1e-9)
    assert lagged(hours, temperature, np.array([constant]))[0][:, 0] == pytest.approx(solution.y[0], abs=2e-3)


@pytest.mark.parametrize("constant", [SLOW, 0.2, FAST])
def test_the_component_remembers_the_temperature_as_the_variants_say(constant):
    """Steps of different lengths, a temperature that goes up and down; the lag is kept over them."""
    _, hours, temperature = drawn(12)
    place = EffectPlace("thermal-lag", "accelerometer-2")
    block = extended_instance("AccelerometerBlock", {place: (1e-3, 2e-4, constant)})
    plain = extended_instance("AccelerometerBlock", {})
    force = np.array([1.0, -4.0, 8.0])
    lag = []
    for instance in (block, plain):
        instance.put(temperature=temperature[0], specific_force=force).begin()
    for row in range(1, len(hours)):
        seen = [
            instance.put(temperature=temperature[row], specific_force=force).step(
                3600.0 * hours[row - 1], 3600.0 * (hours[row] - hours[row - 1])
            )["reading"]
            / G
            for instance in (block, plain)
        ]
        lag.append(seen[0] - seen[1])
    added = np.array(lag)
    assert not added[:, [0, 2]].any()
    expected = lagged(hours, temperature, np.array([constant]))[0][1:, 0]
    settling = 2e-4 * np.exp(-hours[1:] / constant)
    assert added[:, 1] == pytest.approx(1e-3 * (expected - 20.0) + settling, abs=1e-13)


@pytest.mark.parametrize("name", ["warm-up", "thermal-lag"])
def test_a_variant_adds_what_the_effect_does_at_the_ends_of_its_cell(name):
    _, hours, temperature = drawn(13)
    nothing = np.zeros((len(hours), 3))
    rows = Rows(hours, hours, hours, nothing, nothing, nothing, temperature=temperature)
    place, effect = EffectPlace(name, "accelerometer-3"), CATALOGUE[name]
    assert effect.variants is not None
    found = effect.variants(place, rows, nothing, 1e-5)
    assert (found[0].limits[-1][0], found[-1].limits[-1][1]) == (0.0, LAST_HOUR)
    for variant in (found[0], found[len(found) // 2], found[-2]):
        constant = variant.limits[-1][1]
        own = np.array([0.0, 2e-3]) if name == "warm-up" else np.array([0.0, 0.0, 5e-4, 1.5e-3])
        size, *others, last = variant.values(own)
        added = variant.columns @ own
        assert (size, last) == pytest.approx((2e-3, constant))
        by_hand = 2e-3 * (1.0 - np.exp(-hours / constant))
        if name == "thermal-lag":
            # The lag may begin half the range of the temperatures below all of them, or above.
            far = temperature.max() - temperature.min()
            low, high = temperature.min() - BEFORE * far, temperature.max() + BEFORE * far
            begun = 0.25 * low + 0.75 * high - temperature[0]
            assert others == pytest.approx([2e-3 * begun])
            steady = lagged(hours, temperature - 20.0, np.array([constant]))[0][:, 0]
            by_hand = 2e-3 * (steady + begun * np.exp(-hours / constant))
        assert added[:, 2] == pytest.approx(by_hand, abs=1e-15)
        assert not added[:, :2].any()
    lengths = [variant.limits[-1] for variant in found]
    assert all(a[1] == b[0] for a, b in pairwise(lengths))


def test_a_wander_is_straight_between_its_times_and_zero_at_the_first():
    place = EffectPlace("bias-wander", "accelerometer-1", law="hours at 0.0 0.5 2.0")
    effect = wander_at(place)
    hours = np.array([0.0, 0.25, 0.5, 1.25, 2.0, 3.0])
    nothing = np.zeros((len(hours), 3))
    columns = effect.signature(place, Rows(hours, hours, hours, nothing, nothing, nothing))
    added = (columns @ np.array([1e-3, -2e-3]))[:, 0]
    assert added == pytest.approx([0.0, 5e-4, 1e-3, -5e-4, -2e-3, -2e-3])
    block = extended_instance("AccelerometerBlock", {place: (1e-3, -2e-3)})
    plain = extended_instance("AccelerometerBlock", {})
    for instance in (block, plain):
        instance.put(temperature=20.0, specific_force=np.ones(3)).begin()
    seen = [instance.step(0.0, 3600.0 * 1.25)["reading"] for instance in (block, plain)]
    assert (seen[0] - seen[1]) / G == pytest.approx([-5e-4, 0.0, 0.0], abs=1e-14)
    assert "wanders over 3.00e-03 g, by up to 2.00e-03 g an hour" in effect.sentence(
        place, {"value_2": 1e-3, "value_3": -2e-3}
    )
    for law in ("n1 at 0 1", "hours jumps at 0.3", "n1 times hours at 0 1"):
        with pytest.raises(ValueError, match="wanders by 'hours at knots'"):
            wander_at(EffectPlace("bias-wander", "accelerometer-1", law=law))
