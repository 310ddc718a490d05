"""Single records of a table's positions for the tests: cases of their own choosing, and files."""

from pathlib import Path
from typing import Any

import numpy as np

from trihedron.models.effects import EffectPlace
from trihedron.tools.trials import suite
from trihedron.tools.trials.bench import bench_positions, draw_truth, plain_bench
from trihedron.tools.trials.case import Case
from trihedron.tools.trials.draw import draw_alone
from trihedron.tools.trials.sizes import Hidden


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


def write_hidden_record(path: Path, seed: int, answer: Path | None = None, **options: Any) -> None:
    """A record in a file; options of `trihedron.tools.trials.draw.draw_alone`."""
    suite.write_hidden_record(draw_alone(seed, **options), path, answer)
