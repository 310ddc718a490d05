"""What is known beforehand bounds what readings leave open, and takes part in the proof."""

import json

import numpy as np
import pytest

from simulated_bench import interval, random_bench, record, simulated
from trihedron.models.bench import TARGETS, elementary, target_values
from trihedron.tools.calibration import calibrate
from trihedron.tools.errors import InputError

SIGMA = 1e-5
FEW = np.array([0, 3, 9, 14, 20])


def few_positions(bench, seed: int):
    noise = np.random.default_rng(seed).uniform(-SIGMA, SIGMA, (24, 3))
    return simulated(bench, noise=noise).selected(FEW)


@pytest.mark.parametrize("seed", range(8))
def test_truth_within_the_priors_is_within_every_interval(seed):
    bench = random_bench(np.random.default_rng(seed))
    truth = dict(zip(TARGETS, target_values(bench, np.eye(3)), strict=True))
    assert calibrate(few_positions(bench, seed), noise_bound=SIGMA).verdict == "insufficient"
    result = calibrate(few_positions(bench, seed), noise_bound=SIGMA, priors=["bounds"], targets=["X4-X5"])
    assert result.verdict == "consistent"
    truth["X4-X5"] = truth["X4"] - truth["X5"]
    for e in result.parameters:
        low, high = interval(e)
        # biases and sums may be a little beyond the bounds in the random bench: they are not here
        assert low <= truth[e.symbol] <= high, e.symbol
        assert e.estimate is not None
        assert e.guaranteed_error is not None
        assert abs(e.estimate - truth[e.symbol]) <= e.guaranteed_error * (1 + 1e-6)


def test_a_prior_bounds_what_the_readings_leave_open_and_nothing_else():
    """Accelerometer 1 up alone: scale factor and bias are one number; a prior on the bias bounds both."""
    here = record(np.array([[1.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.radians([90.0, 90.0]), np.radians([90.0, 90.0]))
    alone = calibrate(here, noise_bound=SIGMA, targets=["X4+X16"])
    known = {e.symbol: e for e in alone.parameters}
    assert known["X4"].estimate is None
    assert known["X4+X16"].guaranteed_error is not None
    result = {e.symbol: e for e in calibrate(here, noise_bound=SIGMA, priors=["X16=1e-3"]).parameters}
    assert interval(result["X16"]) == pytest.approx((-1e-3, 1e-3), rel=1e-3)
    # the tilts of a hundredth that stay open turn the input by as much, and so its size to second order
    low, high = interval(result["X4"])
    assert -2.5e-3 < low < -1e-3 < 1e-3 < high < 2.5e-3
    assert result["X9"].estimate is None


def test_a_prior_narrower_than_the_readings_narrows_and_a_wider_one_does_nothing():
    bench = elementary(bias_1=2e-6)
    noisy = simulated(bench, noise=SIGMA * np.sin(np.arange(72.0)).reshape(24, 3))
    plain = {e.symbol: e for e in calibrate(noisy, noise_bound=SIGMA).parameters}
    wide = {e.symbol: e for e in calibrate(noisy, noise_bound=SIGMA, priors=["bounds"]).parameters}
    narrow = {e.symbol: e for e in calibrate(noisy, noise_bound=SIGMA, priors=["X16=3e-6"]).parameters}
    for symbol, e in plain.items():
        assert interval(wide[symbol]) == pytest.approx(interval(e), abs=1e-5 * SIGMA)
    assert interval(narrow["X16"])[1] <= 3e-6 * (1 + 1e-6)
    narrower = np.ptp(interval(narrow["X4"])), np.ptp(interval(plain["X4"]))
    assert narrower[0] < narrower[1]


def test_a_prior_that_the_readings_contradict_falsifies():
    result = calibrate(simulated(elementary(bias_2=5e-3)), noise_bound=SIGMA, priors=["X17=1e-3"])
    assert result.verdict == "falsified"
    assert result.witness
    assert all(e.low is None for e in result.parameters)


def test_the_result_names_its_priors():
    result = calibrate(simulated(np.zeros(24)), noise_bound=SIGMA, priors=["X4 - X5 = 1e-4"])
    content = json.loads(result.json_text())
    assert content["priors"] == [{"expression": "X4 - X5 ", "limit": 1e-4}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("X4", "write a combination and its greatest size"),
        ("X4=", "is not a positive number"),
        ("X4=0", "is not a positive number"),
        ("X4=nan", "is not a positive number"),
        ("X4=1e-300", "1e-300 is below 1e-12"),
        ("X4=-1e-3", "is not a positive number"),
        ("X19=1", "--prior 'X19': there is no X19"),
        ("=1", "--prior ''"),
    ],
)
def test_what_is_no_prior_is_refused(text, said):
    with pytest.raises(InputError, match=said) as refusal:
        calibrate(simulated(np.zeros(24)), noise_bound=SIGMA, priors=[text])
    assert "\n" not in str(refusal.value)


def test_one_position_alone_is_bounded_by_priors_and_insufficient_without():
    one = simulated(random_bench(np.random.default_rng(4))).selected(np.array([7]))
    alone = calibrate(one, noise_bound=SIGMA)
    assert alone.verdict == "insufficient"
    assert len(alone.missing) == 18
    assert alone.next_positions
    bounded = calibrate(one, noise_bound=SIGMA, priors=["bounds"])
    assert bounded.verdict == "consistent"
