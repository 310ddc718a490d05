"""Cost of the identification of noise: an hour at 200 Hz on six channels, read already."""

import time

import pytest

import trihedron as th
from generator.noise import static_record

pytestmark = pytest.mark.benchmark_ratio


def test_an_hour_at_200_hz_takes_less_than_five_seconds():
    th.noise(static_record(4000, 0.005, {"N": 1e-4}, {"N": 1e-3}, seed=1))
    record = static_record(720_000, 0.005, {"N": 1e-4, "K": 2e-6}, {"N": 1e-3, "B": 2e-4}, seed=2)
    before = time.process_time()
    th.noise(record)
    assert time.process_time() - before < 5.0
