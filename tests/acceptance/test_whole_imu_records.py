"""Two hundred bench records: every true parameter is inside its interval, and a joint interval is never wider."""

from dataclasses import replace

import numpy as np
import pytest

from generator.tables import AZIMUTH, LATITUDE, PROGRAMME, Errors, Truth, bench_record
from trihedron.tools.calibration import BenchOnEarth, calibrate, calibrate_whole
from trihedron.tools.records import position_record_of

pytestmark = pytest.mark.acceptance
RECORDS = 200
SIGMA = 1.2e-5


def test_every_parameter_of_two_hundred_benches_is_inside_its_interval():
    place = BenchOnEarth(np.degrees(LATITUDE), np.degrees(AZIMUTH), encoder_bound=2e-6)
    outside, wider, not_better = [], [], []
    for seed in range(RECORDS):
        truth = Truth.drawn(np.random.default_rng([22, seed]))
        errors = Errors(rate=5e-5, encoder=2e-6, seed=seed)
        # The rate is higher for shorter moves, which are never steady.
        programme = replace(PROGRAMME, step=0.01, rate=(1.2, 2.0)[seed % 2])
        rests = position_record_of(bench_record(truth, programme, errors))
        alone = calibrate(rests, noise_bound=SIGMA)
        calibration = calibrate_whole(rests, place, noise_bound=SIGMA)
        assert calibration.verdict == "consistent", seed
        assert calibration.gyros is not None
        estimates = calibration.parameters
        for e, x in zip(estimates, [*truth.targets, *truth.gyros, *truth.lags], strict=True):
            assert e.low is not None
            assert e.high is not None
            if not e.low <= x <= e.high:
                outside.append((seed, e.symbol))
        for e, before in zip(estimates[: len(alone.parameters)], alone.parameters, strict=True):
            assert e.low is not None
            assert e.high is not None
            assert before.low is not None
            assert before.high is not None
            if e.low < before.low or e.high > before.high:
                wider.append((seed, e.symbol))
        if "X3" not in {gain.symbol for gain in calibration.gyros.gains}:
            not_better.append(seed)
    assert outside == []
    assert wider == []
    assert not_better == []
