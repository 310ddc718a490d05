"""Readings at rest cut off at an end of the range, in steps of every width: shown where they show, never elsewhere."""

import numpy as np
import pytest
from scipy.signal import lfilter

from generator.noise import noise_series
from trihedron.tools.records.cut_off import cut_off, steps_hide_noise

ROWS = 12_000
STEPS = (0.01, 0.1, 0.25, 0.5, 0.7, 1.0, 1.3, 1.7, 2.0, 2.5, 3.0)
"""Steps over the noise."""


def clipped(rng: np.random.Generator, step: float, part: float, sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Return normal readings in steps, whole, and with a part of them cut off at one side or both."""
    values = rng.standard_normal(ROWS) + rng.uniform(-0.5, 0.5) * step
    whole = step * np.round(values / step)
    upper = step * np.round(np.quantile(values, 1.0 - part) / step)
    lower = step * np.round(np.quantile(values, part) / step) if sides == 2 else -np.inf
    return whole, np.clip(whole, lower, upper)


@pytest.mark.first(2)
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("sides", [1, 2])
def test_what_is_cut_off_is_shown_or_the_steps_hide_the_noise(step, sides):
    """Where the scatter is a tenth too small, the cut shows; of two values it cannot, and the steps are named."""
    for seed, part in enumerate((0.05, 0.1, 0.2, 0.3, 0.4, 0.49)):
        whole, readings = clipped(np.random.default_rng([seed, sides]), step, part, sides)
        if 0.0 < readings.std() < 0.9 * whole.std():
            end = cut_off([readings])
            assert end is not None or steps_hide_noise([readings]), (part, readings.std() / whole.std())
            if end is not None and step <= 0.25 and len(np.unique(readings)) > 3:
                assert end.certain
                assert len(end.ends) == sides
                assert end.beyond == pytest.approx(part * sides, abs=0.15)


def sound(kind: str, seed: int) -> np.ndarray:
    """Return readings of about one unit of noise, within the range."""
    rng = np.random.default_rng(seed)
    white, time = rng.standard_normal(ROWS), np.arange(ROWS)
    if kind == "white":
        return white
    if kind == "heavy tails":
        return rng.standard_t(3, ROWS) / 1.7
    if kind == "filtered":
        return np.asarray(lfilter([0.1], [1.0, -0.9], white)) / 0.23
    if kind == "skewed":
        return (rng.gamma(20.0, size=ROWS) - 20.0) / 4.5
    if kind == "walk":
        return white + np.cumsum(rng.choice([0.01, 0.05, 0.3]) * rng.standard_normal(ROWS))
    if kind == "walk alone":
        return np.cumsum(0.1 * rng.standard_normal(ROWS))
    if kind == "ramp":
        return white + rng.uniform(-0.01, 0.01) * time
    if kind == "warm-up":
        return white + rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 50.0) * np.exp(-time / rng.uniform(200.0, 6000.0))
    if kind == "flicker":
        return noise_series(ROWS, 1.0, {"N": 1.0, "B": 1.0}, seed)
    if kind == "slow sine":
        return white + 5.0 * np.sin(2.0 * np.pi * time / ROWS * rng.uniform(1.0, 30.0))
    if kind == "vibration":
        return rng.uniform(0.0, 1.0) * white + rng.uniform(1.0, 10.0) * np.sin(rng.uniform(0.05, 3.0) * time)
    if kind == "uniform":
        return rng.uniform(-1.73, 1.73, ROWS)
    return white * np.repeat(np.where(rng.random(ROWS // 100) < 0.3, 3.0, 1.0), 100)


@pytest.mark.first(1)
@pytest.mark.parametrize(
    "kind",
    [
        *("white", "heavy tails", "filtered", "skewed", "walk", "walk alone", "ramp", "warm-up", "flicker"),
        *("slow sine", "vibration", "uniform", "bursts"),
    ],
)
def test_readings_within_the_range_are_not_cut_off(kind):
    """Bounded noise and a vibration in few steps end as at a limit: that stays open."""
    for seed, step in enumerate((*STEPS, 5.0)):
        values = sound(kind, seed)
        end = cut_off([step * np.round(values / step + np.random.default_rng(seed).uniform(-0.5, 0.5))])
        assert end is None or (kind in ("vibration", "uniform") and not end.certain), step


def test_one_pose_of_several_is_cut_off():
    rng = np.random.default_rng(3)
    poses = [0.25 * np.round((pose + rng.standard_normal(1000)) / 0.25) for pose in (-40.0, 0.0, 40.0)]
    assert cut_off(poses) is None
    end = cut_off([np.minimum(pose, 40.0) for pose in poses])
    assert end is not None
    assert end.ends == ("upper",)


def test_readings_in_two_values_hide_the_noise():
    rng = np.random.default_rng(4)
    for middle in (0.1, 0.3, 0.5):
        readings = np.round(middle + 0.1 * rng.standard_normal(ROWS))
        assert cut_off([readings]) is None
        assert np.ptp(readings) == 0.0 or steps_hide_noise([readings])
    assert not steps_hide_noise([rng.standard_normal(ROWS)])
