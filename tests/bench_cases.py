"""Cases of the suites' benches with effects of the tests' own choosing."""

import numpy as np

from trihedron.models.effects import EffectPlace
from trihedron.tools.trials import Case, Hidden, draw_truth, plain_bench
from trihedron.tools.trials.bench import bench_positions


def bench_case(
    seed: int, place: EffectPlace | None = None, values: tuple[float, ...] = (), *, symmetric: bool = False
) -> Case:
    """A case with one effect, or none, on the standard positions in random order."""
    rng = np.random.default_rng(seed)
    truth = draw_truth(rng, symmetric=symmetric)
    alpha, beta = bench_positions()
    order = rng.permutation(len(alpha))
    bench = plain_bench(truth, alpha[order], beta[order], symmetric=symmetric)
    return Case(seed, None, bench, () if place is None else (Hidden(place, values),))
