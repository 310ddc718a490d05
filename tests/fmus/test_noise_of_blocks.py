"""Noise processes of the blocks: the same bits from every flavour, and the coefficients that were asked for."""

from pathlib import Path

import allantools
import numpy as np
import pytest

import trihedron as th
from generator.noise import known
from trihedron.tools.noise import Letter
from trihedron.tools.records import StrapdownRecord

SCENARIO = """
schema = "trihedron.scenario/1"
title = "Noise of two blocks"
[run]
step_s = {step}
stop_s = {stop}
[fmus.block]
component = "AccelerometerBlock"
{flavour}
[fmus.block.parameters]
velocity_random_walk = [1e-3, 1e-3, 2e-3]
bias_instability = [4e-4, 4e-4, 0.0]
velocity_quantisation = [0.0, 0.0, 3e-4]
seed = {seed}
[fmus.gyro]
component = "GyroBlock"
{flavour}
[fmus.gyro.parameters]
angle_random_walk = [1e-4, 1e-4, 1e-4]
rate_random_walk = [1e-5, 1e-5, 0.0]
rate_ramp = [0.0, 0.0, 1e-6]
angle_quantisation = [0.0, 2e-5, 0.0]
seed = {seed}
[record]
every = 1
format = "csv"
[record.columns]
w1_radps = "gyro.rate_reading[1]"
w2_radps = "gyro.rate_reading[2]"
w3_radps = "gyro.rate_reading[3]"
f1_mps2 = "block.reading[1]"
f2_mps2 = "block.reading[2]"
f3_mps2 = "block.reading[3]"
"""
CHANNELS = ("w1_radps", "w2_radps", "w3_radps", "f1_mps2", "f2_mps2", "f3_mps2")


def run(folder: Path, *, step: float, stop: float, flavour: str = "", seed: int = 3) -> np.ndarray:
    """Return time and readings (rows, 7) of a run of the two blocks at rest."""
    folder.mkdir()
    path = folder / "noise.toml"
    chosen = f'flavour = "{flavour}"' if flavour else ""
    path.write_text(SCENARIO.format(step=step, stop=stop, flavour=chosen, seed=seed))
    return np.genfromtxt(th.simulate(path, out=folder / "run").files[0], delimiter=",", skip_header=1)


def test_every_flavour_gives_the_same_bits(tmp_path):
    own = run(tmp_path / "own", step=0.01, stop=1.0)
    for flavour in ("python", "native"):
        assert np.array_equal(run(tmp_path / flavour, step=0.01, stop=1.0, flavour=flavour), own)


def test_another_seed_gives_other_noise_and_the_same_seed_the_same(tmp_path):
    first, again = run(tmp_path / "1", step=0.01, stop=1.0), run(tmp_path / "2", step=0.01, stop=1.0)
    other = run(tmp_path / "3", step=0.01, stop=1.0, seed=4)
    assert np.array_equal(first, again)
    assert not np.any(first[1:, 1:] == other[1:, 1:])


@pytest.mark.acceptance
def test_the_coefficients_of_the_blocks_are_identified(tmp_path):
    """Simulated noise, identified: each coefficient near its interval, each process named."""
    readings = run(tmp_path / "long", step=0.02, stop=2400.0)[1:]
    record = StrapdownRecord(
        time_s=readings[:, 0],
        rate=readings[:, 1:4],
        increment=None,
        specific_force=readings[:, 4:] + np.array([0.0, 0.0, 9.80665]),
    )
    result = th.noise(record)
    truth: list[dict[Letter, float]] = [
        {"N": 1e-4, "K": 1e-5},
        {"N": 1e-4, "K": 1e-5, "Q": 2e-5},
        {"N": 1e-4, "R": 1e-6},
        {"N": 1e-3, "B": 4e-4},
        {"N": 1e-3, "B": 4e-4},
        {"N": 2e-3, "Q": 3e-4},
    ]
    missed = 0
    for channel, sizes in zip(result.channels, truth, strict=True):
        assert any(set(named.split(" + ")) == set(sizes) for named in channel.admissible), channel.channel
        for letter, size in sizes.items():
            one = channel.coefficient(letter)
            if one is None or one.estimate is None:
                continue
            assert one.estimate == pytest.approx(size, rel=0.5), (channel.channel, letter)
            missed += not known(one.low) <= size <= known(one.high)
    assert missed <= 2


def test_steps_of_any_length_keep_the_density(tmp_path):
    """Twice the step halves the variance of white noise: its density is a property of the sensor."""
    spreads = []
    for step in (0.01, 0.02, 0.05):
        readings = run(tmp_path / str(step), step=step, stop=100.0)[1:]
        spreads.append(np.std(readings[:, 3]) * np.sqrt(step))
    np.testing.assert_allclose(spreads, 1e-4, rtol=0.06)


FLICKER_ALONE = """
schema = "trihedron.scenario/1"
title = "Flicker alone"
[run]
step_s = 0.005
stop_s = 2000.0
[fmus.gyro]
component = "GyroBlock"
[fmus.gyro.parameters]
bias_instability = [1e-4, 2e-4, 5e-5]
seed = 5
[record]
every = 1
format = "csv"
[record.columns]
w1_radps = "gyro.rate_reading[1]"
w2_radps = "gyro.rate_reading[2]"
w3_radps = "gyro.rate_reading[3]"
"""


@pytest.mark.acceptance
def test_flicker_is_flat_from_two_steps_on_and_its_axes_are_independent(tmp_path):
    """The Allan deviation of flicker is 0.664 B: at each length the axes together keep it, within 3 % and chance."""
    path = tmp_path / "flicker.toml"
    path.write_text(FLICKER_ALONE)
    table = np.genfromtxt(th.simulate(path, out=tmp_path / "run").files[0], delimiter=",", skip_header=1)
    readings = table[1:, 1:] / np.array([1e-4, 2e-4, 5e-5])
    steps = np.array([2.0, 3.0, 5.0, 10.0, 30.0, 100.0])
    deviations = [allantools.oadev(axis, rate=1.0, data_type="freq", taus=steps)[1] for axis in readings.T]
    together = np.sqrt(np.mean(np.square(deviations), axis=0))
    np.testing.assert_allclose(together, np.sqrt(2.0 * np.log(2.0) / np.pi), rtol=0.035)
    between = np.corrcoef(np.diff(readings, axis=0).T) - np.eye(3)
    assert np.abs(between).max() < 5.0 / np.sqrt(len(readings))
