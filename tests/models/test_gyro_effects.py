"""Effects of the gyros: names and definitions of the contract, signatures against the kernels in the block."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from gyro_readings import PERIOD, gyro_readings, lively_motion
from named import Named
from trihedron.models.effects import (
    POSITION_EFFECTS,
    STRAPDOWN_EFFECTS,
    EffectPlace,
)

CONTRACT = {
    "gyro-bias": (3, "rad/s"),
    "gyro-bias-drift": (3, "rad/s/h"),
    "gyro-scale-misalignment": (9, "1"),
    "gyro-scale-asymmetry": (3, "1"),
    "gyro-g-sensitivity": (9, "rad/s/g"),
    "gyro-rate-squared": (3, "s/rad"),
    "gyro-rate-cubed": (3, "s2/rad2"),
    "gyro-scale-drift": (3, "1/h"),
    "latency": (1, "s"),
    "lag": (3, "s"),
    "gyro-g-squared": (9, "rad/s/g2"),
    "gyro-temperature-bias": (3, "rad/s"),
    "gyro-temperature-bias-quadratic": (6, "rad/s"),
    "gyro-temperature-bias-cubic": (9, "rad/s"),
    "gyro-temperature-scale": (3, "1"),
    "gyro-temperature-scale-quadratic": (6, "1"),
    "gyro-temperature-scale-cubic": (9, "1"),
    "gyro-quantisation": (1, "rad/s"),
    "jitter": (1, "1"),
}
"""Number of parameters and unit."""
SETTING_IN = {"gyro-bias-step": (3, "rad/s"), "gyro-scale-step": (3, "1"), "latency-step": (1, "s")}
"""The same for effects that act from a time on, without the time."""
IN_GYROS = [p for effect in STRAPDOWN_EFFECTS.values() if effect.component == "GyroBlock" for p in effect.places]
FADING = {"gyro-warm-up": (3, "rad/s")}
"""The same for effects that fade with a time constant, without it."""
LINEAR = [p for p in IN_GYROS if p.definition.linear]


def test_the_catalogue_is_the_contracts():
    for name, (count, unit) in CONTRACT.items():
        effect = STRAPDOWN_EFFECTS[name]
        assert [place.where for place in effect.places] == ["gyro-block"]
        assert [p.unit for p in effect.parameters] == [unit] * count
    assert [place.where for place in STRAPDOWN_EFFECTS["undersampling"].places] == ["attitude-computer"]
    for name, (count, unit) in SETTING_IN.items():
        *sizes, start = STRAPDOWN_EFFECTS[name].parameters
        assert ([p.unit for p in sizes], start.name, start.unit) == ([unit] * count, "start", "h")
    for name, (count, unit) in FADING.items():
        *sizes, constant = STRAPDOWN_EFFECTS[name].parameters
        assert ([p.unit for p in sizes], constant.name, constant.unit) == ([unit] * count, "time_constant", "h")
    assert set(STRAPDOWN_EFFECTS) == {*CONTRACT, *SETTING_IN, *FADING, "undersampling"}
    assert not set(STRAPDOWN_EFFECTS) & set(POSITION_EFFECTS)


@pytest.mark.parametrize("place", LINEAR, ids=lambda p: p.title)
def test_signatures_are_the_derivatives_of_what_the_block_reads(place):
    """Use uneven steps."""
    effect, rows = STRAPDOWN_EFFECTS[place.effect], lively_motion()
    columns = effect.signature(place, rows)
    assert columns.shape == (len(rows.rate), 3, len(effect.parameters))
    regular = place.effect == "jitter"
    clean = gyro_readings([], rows, regular=regular)
    assert clean == pytest.approx(rows.rate, abs=1e-14)
    for k in range(columns.shape[2]):
        # A low-pass is linear in its time constant only if that is short compared with a step.
        size = 1e-4 if place.effect == "lag" else 1e-3
        values = effect.from_coefficients(size * np.eye(columns.shape[2])[k])
        change = (gyro_readings([(place, values)], rows, regular=regular) - clean) / size
        if regular:
            # The angle of jitter is the same over the nominal period and over the logged interval.
            change = change * rows.period / rows.step[:, None]
        assert np.abs(change - columns[:, :, k]).max() < 1e-11 * max(1.0, np.abs(columns).max())
        assert np.abs(columns[:, :, k]).max() > 0.0


@pytest.mark.parametrize(("name", "values"), [("latency", [3e-3]), ("lag", [1e-4, 5e-5, 2e-4])])
def test_what_lags_is_the_whole_reading(name, values):
    """Scale factors and misalignments of a tenth are late, too."""
    matrix = np.linspace(-0.1, 0.1, 9)
    place, rows = EffectPlace(name, "gyro-block"), replace(lively_motion(), response=np.eye(3) + matrix.reshape(3, 3))
    late, clean = (
        gyro_readings(hidden, rows, scale_misalignment=matrix.tolist()) for hidden in ([(place, values)], [])
    )
    predicted = STRAPDOWN_EFFECTS[name].signature(place, rows) @ np.array(values)
    assert np.abs(late - clean - predicted).max() < 1e-9 * np.abs(predicted).max()


def test_the_block_reads_what_the_contract_defines():
    rows = lively_motion(even=True)
    w, n, hours = rows.rate, rows.specific_force, rows.hours[:, None]
    products = np.stack([n[:, 0] * n[:, 1], n[:, 0] * n[:, 2], n[:, 1] * n[:, 2]], axis=1)
    three, nine = np.array([1e-3, -2e-3, 3e-3]), np.linspace(-4e-3, 5e-3, 9)
    matrix = nine.reshape(3, 3)
    cases: list[tuple[str, Sequence[float] | np.ndarray, np.ndarray]] = [
        ("gyro-bias", three, w + three),
        ("gyro-bias-drift", three, w + three * hours),
        ("gyro-scale-misalignment", nine, w + w @ matrix.T),
        ("gyro-scale-asymmetry", three, w + three * np.abs(w)),
        ("gyro-rate-squared", three, w + three * w**2),
        ("gyro-rate-cubed", three, w + three * w**3),
        ("gyro-scale-drift", three, w + three * hours * w),
        ("gyro-g-sensitivity", nine, w + n @ matrix.T),
        ("gyro-g-squared", nine, w + products @ matrix.T),
        ("gyro-quantisation", [0.01], 0.01 * np.floor(w / 0.01 + 0.5)),
    ]
    for name, values, expected in cases:
        measured = gyro_readings([(EffectPlace(name, "gyro-block"), values)], rows)
        assert measured == pytest.approx(expected, abs=1e-14), name


@pytest.mark.parametrize("steps", [-0.7, 0.4, 1.0, 2.5, 7.999, 8.0, 11.0])
def test_late_gyros_read_the_rate_of_a_while_ago(steps):
    """Rates hold over the steps and are read between steps k and k + 1 of the past; beyond eight, a straight line."""
    rows = lively_motion(even=True)
    measured = gyro_readings([(EffectPlace("latency", "gyro-block"), [steps * rows.step[0]])], rows)
    w = rows.rate

    def before(k: int) -> np.ndarray:
        return np.vstack([np.repeat(w[:1], k, axis=0), w[: len(w) - k]])

    full_steps = min(max(int(np.floor(steps)), 0), 7)
    expected = before(full_steps) + (steps - full_steps) * (before(full_steps + 1) - before(full_steps))
    if steps > 8.0:
        expected = w + steps / 8.0 * (before(8) - w)
    assert measured == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("steps", [0.3, 0.7, 1.0])
def test_lagging_gyros_follow_the_rate_through_a_low_pass(steps):
    """Compare with the mean, over each step, of the solution of T y' = ω - y at many points of it. Rates older than
    eight steps, where the rate continues in a straight line, hardly count."""
    rows = lively_motion(even=True)
    time = steps * rows.step[0]
    measured = gyro_readings([(EffectPlace("lag", "gyro-block"), [time, 0.0, 2.0 * time])], rows)
    fine = 400
    decays = np.exp(-rows.step[0] / fine / np.array([time, 1e-9, 2.0 * time]))
    state, means = rows.rate[0], []
    for rate in rows.rate:
        passed = []
        for _ in range(fine):
            after = rate + (state - rate) * decays
            passed.append(0.5 * (state + after))
            state = after
        means.append(np.mean(passed, axis=0))
    expected = np.array(means)
    assert measured[:, 1] == pytest.approx(rows.rate[:, 1], abs=1e-14)
    assert (np.abs(measured - expected)[:, [0, 2]].max(axis=0) < [2e-3, 2e-2] * np.ptp(rows.rate, axis=0)[[0, 2]]).all()


def test_a_long_lag_is_as_long_as_it_says():
    """A low-pass follows an evenly growing rate with its time constant as delay, for any time constant."""
    rows = lively_motion(even=True)
    growing = replace(rows, rate=np.outer(np.arange(len(rows.rate)), [0.01, -0.02, 0.03]))
    for time in (0.5 * PERIOD, 3.0 * PERIOD, 20.0 * PERIOD):
        measured = gyro_readings([(EffectPlace("lag", "gyro-block"), [time] * 3)], growing)
        behind = (growing.rate - measured)[12:] / np.array([0.01, -0.02, 0.03]) * PERIOD
        assert behind == pytest.approx(np.full(behind.shape, time), rel=1e-9)


@pytest.mark.parametrize("name", SETTING_IN)
def test_what_sets_in_does_nothing_before_its_time_and_then_what_its_signature_says(name):
    rows = lively_motion(even=True)
    place = EffectPlace(name, "gyro-block")
    count, begun = SETTING_IN[name][0], 23
    start = 0.5 * (rows.hours[begun - 1] + rows.hours[begun])
    sizes = 1e-3 * np.linspace(1.0, -0.8, count)
    change = gyro_readings([(place, [*sizes, start])], rows) - rows.rate
    expected = place.definition.signature(place, rows) @ sizes
    assert np.abs(change[:begun]).max() < 1e-14
    assert np.abs(expected[:begun]).max() > 1e-5
    assert change[begun:] == pytest.approx(expected[begun:], abs=1e-13)


@pytest.mark.parametrize("constant", [1e-6, 3e-4, 0.2])
def test_biases_that_settle_are_an_exponential_of_the_time_since_the_first_row(constant):
    rows, sizes = lively_motion(even=True), np.array([1e-3, -2e-3, 3e-3])
    place = EffectPlace("gyro-warm-up", "gyro-block")
    change = gyro_readings([(place, [*sizes, constant])], rows) - rows.rate
    assert change == pytest.approx(np.outer(np.exp(-rows.hours / constant), sizes), abs=1e-14)
    at_first = place.definition.signature(place, rows) @ sizes
    assert change == pytest.approx(np.exp(-rows.hours / constant)[:, None] * at_first, abs=1e-14)
    # A time constant of zero means none.
    assert gyro_readings([(place, [*sizes, 0.0])], rows) == pytest.approx(rows.rate, abs=1e-15)


def test_effects_of_gyros_add_up_in_any_order():
    rows = lively_motion()
    effects = [
        (place, STRAPDOWN_EFFECTS[place.effect].from_coefficients(np.linspace(1e-3, 3e-3, len(e.parameters))))
        for place in IN_GYROS
        if (e := STRAPDOWN_EFFECTS[place.effect]).stage == "reading_effects"
    ]
    together = gyro_readings(effects, rows)
    assert gyro_readings(effects[::-1], rows) == pytest.approx(together, abs=1e-14)
    clean = gyro_readings([], rows)
    assert together - clean == pytest.approx(
        sum(gyro_readings([effect], rows) - clean for effect in effects), abs=1e-13
    )


def test_jitter_of_the_log_alone_makes_rates_count_over_wrong_intervals():
    """Use increments made from rates and logged intervals; a missed sample is two periods, not jitter."""
    rows = lively_motion()
    lengths = rows.step.copy()
    lengths[20] += rows.period
    rows = replace(rows, step=lengths)
    measured = gyro_readings([(EffectPlace("jitter", "gyro-block"), [1.0])], rows, regular=True)
    counted = np.where(np.arange(len(lengths)) == 20, lengths / rows.period - 1.0, lengths / rows.period)
    assert measured == pytest.approx(rows.rate * counted[:, None], abs=1e-12)
    assert np.abs(measured - rows.rate).max() > 0.1
    none = gyro_readings([(EffectPlace("jitter", "gyro-block"), [1.0])], rows)
    assert none == pytest.approx(rows.rate, abs=1e-14)


def test_steps_of_the_gyros_are_found_in_their_readings():
    effect, rows = STRAPDOWN_EFFECTS["gyro-quantisation"], lively_motion()
    place = effect.places[0]
    assert effect.variants is not None
    measured = gyro_readings([(place, [2.5e-3])], rows)
    (variant,) = effect.variants(place, rows, measured, 1e-3)
    assert variant.values(np.zeros(0)) == pytest.approx((2.5e-3,), rel=1e-9)
    assert np.all(np.abs(measured - rows.rate) <= variant.widening * (1.0 + 1e-9))
    assert effect.variants(place, rows, rows.rate, 1e-3) == []


def test_undersampling_leaves_out_what_the_computer_then_adds():
    """Use a coning motion and the mean-rate algorithm: with c = 1/12 its drift vanishes, as the signature predicts."""
    place = EffectPlace("undersampling", "attitude-computer")
    step, rows = 0.01, 400
    edges = step * np.arange(rows + 1)
    # Increments of a rate (cos Ωt, sin Ωt, 0) with Ω = 20 rad/s; the true attitude by steps of a hundredth.
    cut = 100
    fine = step * (np.arange(cut * rows) + 0.5) / cut
    small = np.stack([np.cos(20.0 * fine), np.sin(20.0 * fine), 0.0 * fine], axis=1) * (step / cut)
    increments = np.stack([np.diff(np.sin(20.0 * edges)), -np.diff(np.cos(20.0 * edges)), 0.0 * edges[1:]], axis=1) / 20
    turns = Rotation.from_rotvec(small).as_quat()
    while len(turns) > 1:
        # Neighbours are joined, so that all turns keep their order.
        odd = turns[len(turns) - len(turns) % 2 :]
        even = len(turns) // 2 * 2
        turns = np.vstack(((Rotation(turns[0:even:2]) * Rotation(turns[1:even:2])).as_quat(), odd))
    truth = Rotation(turns[0])
    misfits = {
        c: (truth.inv() * attitude_after(increments, step, place, c)).magnitude() for c in (None, 0.0, 1.0 / 12.0)
    }
    assert misfits[0.0] == misfits[None] > 6e-4
    assert misfits[1.0 / 12.0] < 0.03 * misfits[0.0]
    rate = increments / step
    motion = replace(lively_motion(), rate=rate, rate_before=np.vstack([rate[:1], rate[:-1]]), step=np.full(rows, step))
    added = -STRAPDOWN_EFFECTS["undersampling"].signature(place, motion)[..., 0] * step / 12.0
    corrected = attitude_after(increments + added, step, place, None)
    with_effect = attitude_after(increments, step, place, 1.0 / 12.0)
    assert (corrected.inv() * with_effect).magnitude() < 1e-12


def attitude_after(increments: np.ndarray, step: float, place: EffectPlace, coefficient: float | None) -> Rotation:
    """Return the attitude of the computer, extended if there is a coefficient, after increments (N, 3) [rad]."""
    model = Named("AttitudeComputer", {} if coefficient is None else {place: [coefficient]}, algorithm=2).begin()
    for k, increment in enumerate(increments):
        model.put(increment=increment).step(k * step, step)
    return Rotation.from_quat(model["attitude"], scalar_first=True)
