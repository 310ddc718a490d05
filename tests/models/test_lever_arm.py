"""The size effect: readings of off-centre accelerometers while the block turns."""

import math
from dataclasses import replace

import numpy as np
import pytest

from gyro_readings import G
from named import Named
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace, MotionRows

PLACES = CATALOGUE["lever-arm"].places


def accelerometer_readings(rows: MotionRows, arms: dict[EffectPlace, np.ndarray], **settings) -> np.ndarray:
    """Return readings (N, 3) [g] of a block over a motion, with some of its accelerometers off-centre."""
    readings, time = np.zeros_like(rows.rate), 0.0
    model = Named("AccelerometerBlock", arms, **settings)
    model.put(specific_force=G * rows.specific_force[0], rate=rows.rate_before[0]).begin()
    for k, step in enumerate(rows.step):
        model.put(specific_force=G * rows.specific_force[k], rate=rows.rate[k]).step(time, step)
        time += step
        readings[k] = model["reading"] / G
    return readings


def accelerations(rate: np.ndarray, growth: np.ndarray, arm: np.ndarray) -> np.ndarray:
    """Return the acceleration (N, 3) [g] of a point at r (3,) [m] of a body, by rates and their growth (N, 3)."""
    return (np.cross(rate, np.cross(rate, arm)) + np.cross(growth, arm)) / G


def swinging(step: float, count: int, uneven: float = 0.0) -> tuple[MotionRows, np.ndarray]:
    """Return a motion about all axes, some turns a second, with its exact angular accelerations (N, 3) [rad/s²]."""
    lengths = step * (1.0 + uneven * np.sin(0.7 * np.arange(count)))
    time = np.cumsum(lengths)
    frequency, phase, size = np.array([20.0, 13.0, 17.0]), np.array([0.3, 1.1, 2.0]), np.array([8.0, -5.0, 6.0])
    angle = np.outer(np.append(0.0, time), frequency) + phase
    rate, growth = size * np.cos(angle), -size * frequency * np.sin(angle)
    rows = MotionRows(rate[1:], rate[:-1], np.zeros((count, 3)), time / 3600.0, lengths)
    return rows, growth[1:]


@pytest.mark.parametrize("place", PLACES, ids=lambda p: p.title)
def test_the_signature_is_the_acceleration_of_the_place_along_the_accelerometer(place):
    rows, _ = swinging(1e-2, 60)
    columns = CATALOGUE["lever-arm"].signature(place, rows)
    for k in range(3):
        expected = np.zeros_like(rows.rate)
        expected[:, place.index] = accelerations(rows.rate, rows.acceleration, np.eye(3)[k])[:, place.index]
        assert columns[:, :, k] == pytest.approx(expected, abs=1e-12)
        assert np.abs(columns[:, place.index, k]).max() > 0.5


@pytest.mark.parametrize("uneven", [0.0, 0.2])
def test_the_block_follows_the_acceleration_of_its_places_to_second_order(uneven):
    """Half the step leaves a quarter of the error; also with steps of uneven lengths."""
    arm, errors = np.array([0.05, -0.03, 0.02]), []
    for halvings in range(4):
        rows, growth = swinging(8e-3 / 2**halvings, 60 * 2**halvings, uneven)
        measured = accelerometer_readings(rows, dict.fromkeys(PLACES, arm))
        errors.append(np.abs(measured - accelerations(rows.rate, growth, arm))[2:].max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders[-1] == pytest.approx(2.0, abs=0.1), orders
    assert errors[-1] < 1e-3 < 0.5 < np.abs(accelerations(rows.rate, growth, arm)).max()


def test_a_place_acts_through_scale_factor_and_misalignment_like_gravity():
    """The block reads the acceleration of a place like one that its inputs have there."""
    arm, errors = np.array([0.05, -0.03, 0.02]), {"gamma_21": 6e-3, "gamma_31": -7e-3, "gamma_32": 1e-2}
    errors |= {"scale_error_plus": [0.01, -0.008, 0.007], "scale_error_minus": [-0.01, 0.01, 0.004]}
    rows, _ = swinging(1e-2, 60)
    rows = replace(rows, specific_force=np.cos(np.outer(np.arange(60.0), [0.03, 0.04, 0.05])) * [1.0, -1.0, 1.0])
    clean = accelerometer_readings(rows, {}, **errors)
    straight = accelerometer_readings(rows, dict.fromkeys(PLACES, arm)) - rows.specific_force
    plus, minus = np.array(errors["scale_error_plus"]), np.array(errors["scale_error_minus"])
    matrix = np.array([[1.0, 0.0, 0.0], [6e-3, 1.0, 0.0], [-7e-3, 1e-2, 1.0]])
    expected = straight @ matrix.T + np.where(rows.specific_force > 0.0, plus, minus) * straight
    assert np.abs(expected - straight).max() > 1e-3
    assert accelerometer_readings(rows, dict.fromkeys(PLACES, arm), **errors) - clean == pytest.approx(
        expected, abs=1e-12
    )


def test_it_is_of_the_accelerometers_in_motion_alone():
    """No rest shows it, and no gyro senses it."""
    assert "lever-arm" not in POSITION_EFFECTS
    assert "lever-arm" not in STRAPDOWN_EFFECTS
    effect = CATALOGUE["lever-arm"]
    assert effect.sentence(PLACES[1], {"r_1": 0.012, "r_2": -0.003, "r_3": 0.0}) == (
        "accelerometer 2 is off the block's centre: +12, -3, +0 mm along the axes"
    )
    assert not effect.parameters[0].possible(math.inf)
