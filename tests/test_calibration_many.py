"""Many readings: programmes that take in rows as they need them give what all rows at once give."""

import time
import tracemalloc

import numpy as np
import pytest

from simulated_bench import misses, random_bench, simulated
from trihedron.models.bench import target_values
from trihedron.tools.bounded import programmes
from trihedron.tools.bounded.programmes import Polytope, chebyshev_radius
from trihedron.tools.calibration import calibrate
from trihedron.tools.calibration.estimates import joint_sets

SIGMA = 1e-5


def programme(seed: int, rows: int = 3000, columns: int = 6):
    rng = np.random.default_rng(seed)
    jacobian = rng.normal(size=(rows, columns)) * rng.choice([1.0, 0.01], (rows, 1))
    bound = SIGMA * rng.uniform(1.0, 5.0, rows)
    return jacobian, rng.uniform(-1.0, 1.0, rows) * bound, bound, rng


@pytest.mark.parametrize("seed", range(3))
def test_taking_in_rows_gives_the_same_as_all_at_once(seed, monkeypatch):
    jacobian, residual, bound, rng = programme(seed)
    found = []
    for many in (10**9, 100):
        monkeypatch.setattr(programmes, "MANY_ROWS", many)
        polytope = Polytope(jacobian, bound)
        polytope.confine(residual - bound, residual + bound)
        weights = np.random.default_rng(9).normal(size=(5, 6))
        found.append((chebyshev_radius(jacobian, residual, bound), [polytope.maximise(w) for w in weights]))
    (radius, _, duals), tops = found[1]
    assert radius == pytest.approx(found[0][0][0], rel=1e-9)
    np.testing.assert_allclose(jacobian.T @ duals, 0.0, atol=1e-6)
    assert residual @ duals == pytest.approx(radius, rel=1e-8)
    for (value, x, phi), (other, _, _) in zip(tops, found[0][1], strict=True):
        assert value == pytest.approx(other, rel=1e-9)
        assert np.all(np.abs(residual - jacobian @ x) <= bound * (1 + 1e-8))
        assert len(phi) == len(bound)
    assert rng is not None


def many_positions(count: int):
    rng = np.random.default_rng(count)
    bench = random_bench(rng)
    alpha, beta = rng.uniform(0, 2 * np.pi, (2, count))
    return bench, simulated(bench, alpha, beta, rng.uniform(-SIGMA, SIGMA, (count, 3)))


def test_three_thousand_positions():
    bench, many = many_positions(3000)
    result = calibrate(many, noise_bound=SIGMA)
    assert misses(result, target_values(bench, np.eye(3))) == []
    worst = max(e.guaranteed_error or np.inf for e in result.parameters)
    # near the best that any plan can do, 2.03 σ
    assert worst < 2.2 * SIGMA


@pytest.mark.acceptance
def test_a_hundred_thousand_rests_with_bounded_memory(capsys):
    bench, many = many_positions(100_000)
    tracemalloc.start()
    began = time.perf_counter()
    result = calibrate(many, noise_bound=SIGMA)
    seconds, peak = time.perf_counter() - began, tracemalloc.get_traced_memory()[1] / 1e6
    tracemalloc.stop()
    with capsys.disabled():
        print(f"\n100,000 positions: {seconds:.0f} s, {peak:.0f} MB of arrays")
    assert misses(result, target_values(bench, np.eye(3))) == []
    assert peak < 1500


def test_pairs_are_projections_of_the_feasible_set():
    bench, some = many_positions(40)
    result = calibrate(some, noise_bound=SIGMA)
    assert result.feasible is not None
    truth = target_values(bench, np.eye(3))
    alone = {e.symbol: (e.low, e.high) for e in result.parameters}
    pairs = [pair for group in joint_sets(result.feasible).values() for pair in group]
    assert len(pairs) == 3 + 6 + 10 + 15
    for pair in pairs:
        # each polygon spans just the two intervals, is convex, and holds the truth
        for k, target in enumerate((pair.first, pair.second)):
            ends = pair.vertices[:, k].min(), pair.vertices[:, k].max()
            assert ends == pytest.approx(alone[target.symbol], abs=1e-4 * SIGMA)
        edges = np.roll(pair.vertices, -1, axis=0) - pair.vertices
        x, y = np.array([target.weights for target in (pair.first, pair.second)]) @ truth
        inside = edges[:, 0] * (y - pair.vertices[:, 1]) - edges[:, 1] * (x - pair.vertices[:, 0])
        turning = edges[:, 0] * np.roll(edges[:, 1], -1) - edges[:, 1] * np.roll(edges[:, 0], -1)
        assert inside.min() > -1e-4 * SIGMA**2
        assert turning.min() > -1e-4 * SIGMA**2
