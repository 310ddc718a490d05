"""Several records of one instrument, simulated: the block is the same; bias, mounting and table are the day's."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from trihedron.models.effects import EffectPlace
from trihedron.tools.records import PositionRecord
from trihedron.tools.trials.bench import Bench, draw_bench, draw_truth
from trihedron.tools.trials.sizes import Hidden

Sized = tuple[EffectPlace, tuple[float, ...]]


def of_one_instrument(
    seed: int,
    count: int = 3,
    *,
    positions: tuple[int, int] = (24, 24),
    shared: Sequence[Sized] = (),
    own: Mapping[int, Sequence[Sized]] | None = None,
) -> list[PositionRecord]:
    """Position records of one instrument; effects in all of them, and in some (by number) alone."""
    rng = np.random.default_rng(seed)
    first = replace(draw_bench(rng, positions), symmetric=False)
    first = replace(first, truth=draw_truth(rng, symmetric=False), mountings=("identity",))
    records = []
    for k in range(count):
        hidden = [Hidden(place, values) for place, values in (*shared, *(own or {}).get(k, ()))]
        records.append(_another_day(rng, first, positions).measured(seed, k, hidden))
    return records


def _another_day(rng: np.random.Generator, bench: Bench, positions: tuple[int, int]) -> Bench:
    """The same block on another day: its bias, its mounting error, the table and the positions are others."""
    other, day = draw_bench(rng, positions), draw_truth(rng, symmetric=False)
    table = {**day["TurntableMotion"], "gravity_error": bench.truth["TurntableMotion"]["gravity_error"]}
    block = {**bench.truth["AccelerometerBlock"], "bias": day["AccelerometerBlock"]["bias"]}
    return replace(
        bench,
        truth={"TurntableMotion": table, "AccelerometerBlock": block},
        mounting_errors=other.mounting_errors[:1],
        alpha=other.alpha,
        beta=other.beta,
        mounting=np.zeros(len(other.alpha), dtype=int),
    )
