"""The size effect: readings of off-centre accelerometers while the block turns."""

import math

import numpy as np
import pytest

from gyro_readings import G, lively_motion
from named import Named
from trihedron.models.effects import CATALOGUE, POSITION_EFFECTS, STRAPDOWN_EFFECTS, EffectPlace

PLACES = CATALOGUE["lever-arm"].places


def accelerometer_readings(arms: dict[EffectPlace, np.ndarray], rows=None) -> np.ndarray:
    """Return readings (N, 3) [g] of a block over a lively motion, with some of its accelerometers off-centre."""
    rows = lively_motion() if rows is None else rows
    model = Named("AccelerometerBlock", arms)
    readings, time = np.zeros_like(rows.rate), 0.0
    model.put(specific_force=G * rows.specific_force[0], rate=rows.rate[0]).begin()
    for k, step in enumerate(rows.step):
        model.put(specific_force=G * rows.specific_force[k], rate=rows.rate[k]).step(time, step)
        time += step
        readings[k] = model["reading"] / G
    return readings


@pytest.mark.parametrize("place", PLACES, ids=lambda p: p.title)
def test_the_signature_is_the_derivative_of_what_the_block_reads(place):
    rows = lively_motion()
    columns = CATALOGUE["lever-arm"].signature(place, rows)
    clean = accelerometer_readings({})
    assert clean == pytest.approx(rows.specific_force, abs=1e-14)
    for k in range(3):
        change = accelerometer_readings({place: 0.1 * np.eye(3)[k]}) - clean
        assert change / 0.1 == pytest.approx(columns[:, :, k], abs=1e-12)
        assert np.abs(columns[:, place.index, k]).max() > 0.05


def test_it_is_the_acceleration_of_a_point_of_a_turning_body():
    """Use a block that swings about its third axis, twenty times a second: the second derivative of the point's
    place."""
    arm, swing, omega, step = np.array([0.05, -0.03, 0.02]), 0.4, 20.0, 1e-4
    time = step * np.arange(400, dtype=np.float64)
    angle, rate = swing * np.sin(omega * time), swing * omega * np.cos(omega * time)
    motion = lively_motion()
    still = np.zeros((len(time), 3))
    rates = np.stack([still[:, 0], still[:, 0], rate], axis=1)
    rows = type(motion)(rates, np.vstack([rates[:1], rates[:-1]]), still, time / 3600.0, np.full(len(time), step))
    measured = G * accelerometer_readings(dict.fromkeys(PLACES, arm), rows)
    turn = np.stack([np.cos(angle), -np.sin(angle), np.sin(angle), np.cos(angle)], axis=1).reshape(-1, 2, 2)
    path = turn @ arm[:2]
    acceleration = (path[2:] - 2.0 * path[1:-1] + path[:-2]) / step**2
    expected = np.einsum("nji,nj->ni", turn[1:-1], acceleration)
    # The block uses its acceleration over the last step: half a step late.
    late = 0.5 * step * swing * omega**3 * 0.06
    assert np.abs(measured[1:-1, :2] - expected)[2:].max() < late + 1e-4
    assert np.abs(measured[:, 2]).max() < 1e-12
    assert np.abs(expected).max() > 4.0


def test_it_is_of_the_accelerometers_in_motion_alone():
    """No rest shows it, and no gyro senses it."""
    assert "lever-arm" not in POSITION_EFFECTS
    assert "lever-arm" not in STRAPDOWN_EFFECTS
    effect = CATALOGUE["lever-arm"]
    assert effect.sentence(PLACES[1], {"r_1": 0.012, "r_2": -0.003, "r_3": 0.0}) == (
        "accelerometer 2 is off the block's centre: +12, -3, +0 mm along the axes"
    )
    assert not effect.parameters[0].possible(math.inf)
