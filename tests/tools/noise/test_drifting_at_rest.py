"""Static records whose biases drift much are taken whole; moves, however slow, are no rests."""

import numpy as np
import pytest

import trihedron as th
from generator.noise import known, noise_series, static_record
from trihedron.tools.noise.selection import select
from trihedron.tools.noise.spectrum import bins_of
from trihedron.tools.records import StrapdownRecord

WHITE = {"N": 1e-4}, {"N": 1e-3}
WALKING = {"N": 1e-4, "K": 2e-4}, {"N": 1e-3, "K": 1e-3}


def with_motion(record: StrapdownRecord, rate, force=None) -> StrapdownRecord:
    """Return a record with further rates and forces (N, 3)."""
    force = np.zeros(3) if force is None else force
    return StrapdownRecord(
        time_s=record.time_s,
        rate=known(record.rate) + rate,
        increment=None,
        specific_force=record.specific_force + force,
    )


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("step", "rows", "gyro", "accelerometer", "letter"),
    [
        (0.01, 60_000, *WALKING, "K"),
        (1.0, 7200, {"N": 5e-4, "K": 1e-4}, {"N": 5e-3, "K": 1e-3}, "K"),
        (0.01, 60_000, {"N": 1e-5, "K": 1e-3}, {"N": 1e-4, "K": 3e-3}, "K"),
        (0.1, 36_000, {"N": 1e-4, "R": 1e-6}, {"N": 1e-3, "R": 2e-5}, "R"),
        (0.01, 60_000, {"N": 1e-5, "B": 1e-3}, {"N": 1e-4, "B": 1e-2}, "B"),
        (0.1, 36_000, {"N": 1e-4, "M": 3e-3}, {"N": 1e-3, "M": 2e-2}, "M"),
    ],
    ids=["walk", "walk at 1 Hz", "walk alone", "ramp", "flicker", "correlated"],
)
def test_a_static_record_is_taken_whole_however_much_its_biases_drift(step, rows, gyro, accelerometer, letter):
    result = th.noise(static_record(rows, step, gyro, accelerometer, seed=1))
    assert result.static
    assert result.duration_s == pytest.approx(rows * step)
    for channel in result.channels:
        size = (gyro if channel.sensor == "gyro" else accelerometer)[letter]
        assert any(letter in name.split(" + ") for name in channel.admissible)
        assert 0.6 < known(known(channel.coefficient(letter)).estimate) / size < 1.5


@pytest.mark.acceptance
@pytest.mark.parametrize(("size", "time"), [(1e-2, 300.0), (3e-3, 600.0)])
def test_a_warm_up_ends_no_rest(size, time):
    record = static_record(36_000, 0.1, *WHITE, seed=3)
    warming = np.exp(-record.time_s / time)[:, None]
    result = th.noise(with_motion(record, size * warming, 0.05 * warming))
    assert result.static
    assert result.duration_s == pytest.approx(3600.0)
    assert all("W" in channel.admissible[0] for channel in result.of("gyro"))


def turned(time, axis: int, start: float, length: float, degrees: float):
    """Return rates (N, 3) of a turn that begins and ends smoothly."""
    rates = np.zeros((len(time), 3))
    part = (time - start) / length
    moving = (part > 0.0) & (part < 1.0)
    rates[moving, axis] = np.radians(degrees) / length * (1.0 - np.cos(2.0 * np.pi * part[moving]))
    return rates


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("sizes", "length", "degrees"),
    [(WHITE, 3.0, 90.0), (WHITE, 60.0, 10.0), (WHITE, 100.0, 45.0), (WALKING, 3.0, 90.0), (WALKING, 60.0, 30.0)],
)
def test_a_slow_turn_about_the_vertical_is_no_rest(sizes, length, degrees):
    """The readings without the turn have the noise of the sensor."""
    record = static_record(60_000, 0.01, *sizes, seed=1)
    result = th.noise(with_motion(record, turned(record.time_s, 2, 300.0, length, degrees)))
    assert not result.static
    assert 400.0 < result.duration_s < 600.0
    name = " + ".join(sizes[0])
    assert [channel.admissible[0] for channel in result.channels] == [name] * 6


@pytest.mark.acceptance
def test_a_slow_tilt_is_no_rest():
    """Of ten minutes the block tilts for three: one rest before it, one behind it."""
    record = static_record(60_000, 0.01, *WHITE, seed=2)
    angle = np.radians(20.0) * np.clip((record.time_s - 200.0) / 200.0, 0.0, 1.0)
    force = 9.80665 * np.stack([0.0 * angle, np.sin(angle), np.cos(angle) - 1.0], axis=1)
    rate = np.zeros((60_000, 3))
    rate[20_000:40_000, 0] = np.radians(20.0) / 200.0
    result = th.noise(with_motion(record, rate, force))
    assert not result.static
    assert [channel.admissible[0] for channel in result.channels] == ["N"] * 6


@pytest.mark.acceptance
def test_a_block_that_spins_and_stops_is_not_static():
    record = static_record(60_000, 0.01, *WALKING, seed=1)
    for length, rate in ((10.0, 5.0), (30.0, 2.0)):
        spinning = np.zeros((60_000, 3))
        spinning[:, 2] = np.radians(rate) * (record.time_s // length % 2.0)
        assert not th.noise(with_motion(record, spinning)).static


@pytest.mark.first(1)
@pytest.mark.parametrize(("size", "time"), [(0.1, 300.0), (0.05, 60.0), (1.0, 700.0)])
@pytest.mark.parametrize("letter", ["", "K"])
def test_a_strong_warm_up_hides_no_walk_and_feigns_none(size, time, letter):
    """Its time constant is fitted, and its tail at high frequencies taken out. K of an hour errs by 18 %."""
    gyro = {"N": 1e-4} | ({"K": 5e-6} if letter else {})
    for seed in range(3):
        values = noise_series(36_000, 0.1, gyro, seed)
        warming = size * np.exp(-0.1 * np.arange(36_000) / time)
        alone = select(bins_of([values], 0.1)[0]).fit
        fit = select(bins_of([values + warming], 0.1)[0]).fit
        assert fit.all_letters == (*alone.all_letters, "W")
        assert fit.coefficient("K") == pytest.approx(alone.coefficient("K"), rel=0.25)
        assert known(fit.trend).constant == pytest.approx(time, rel=0.1)
