"""Time of a calibration: estimates, guaranteed errors, all intervals, for 100 positions and for 100,000."""

import time

import numpy as np
import pytest

from calibration_checks import misses
from generator.stands import random_bench, simulated
from trihedron.models.bench import target_values
from trihedron.tools.calibration import calibrate

SIGMA = 1e-5


@pytest.mark.benchmark_ratio
def test_a_hundred_positions_under_a_second(capsys: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng(100)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0, 2 * np.pi, (2, 100))
    record = simulated(bench, alpha, beta, rng.uniform(-SIGMA, SIGMA, (100, 3)))
    seconds, busy = [], []
    for _ in range(3):
        began, busy_before = time.perf_counter(), time.process_time()
        result = calibrate(record, noise_bound=SIGMA)
        seconds.append(time.perf_counter() - began)
        busy.append(time.process_time() - busy_before)
    with capsys.disabled():
        print(
            f"\n100 positions, fit, 18 guaranteed errors, 57 intervals: {min(seconds):.2f} s "
            f"({min(busy):.2f} s of processor)"
        )
    assert misses(result, target_values(bench, np.eye(3))) == []
    assert min(busy) < 1.0


@pytest.mark.benchmark_ratio
def test_a_hundred_thousand_positions_against_a_decomposition(capsys, cost_row) -> None:
    """The unit is one singular value decomposition of the readings' derivatives, 300,000 rows by 18."""
    bench = random_bench(np.random.default_rng(1))
    seconds = {}
    for count in (10_000, 100_000):
        rng = np.random.default_rng(count)
        alpha, beta = rng.uniform(0, 2 * np.pi, (2, count))
        record = simulated(bench, alpha, beta, rng.uniform(-SIGMA, SIGMA, (count, 3)))
        began = time.process_time()
        result = calibrate(record, noise_bound=SIGMA)
        seconds[count] = time.process_time() - began
    fewer, ours = seconds.values()
    units = []
    for _ in range(3):
        began = time.process_time()
        np.linalg.svd(result.linearised.jacobian, full_matrices=False)
        units.append(time.process_time() - began)
    with capsys.disabled():
        print(f"\n100,000 positions: {ours:.1f} s of processor, {ours / min(units):.0f} decompositions")
    cost_row("growth", "`calibrate`, 100,000 positions", f"{ours:.1f}", f"{ours / fewer:.1f}")
    assert misses(result, target_values(bench, np.eye(3))) == []
    assert ours < 45.0 * min(units)
