"""Several records of one instrument, simulated: the block is the same; bias, mounting and table are the day's."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from trihedron.models.effects import EffectPlace
from trihedron.tools.bounded.programmes import chebyshev_radius
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.evidence.joint import Joint, join
from trihedron.tools.evidence.of_record import InRecord, plain
from trihedron.tools.records import PositionRecord, StrapdownRecord
from trihedron.tools.trials.bench import Bench, draw_bench, draw_truth
from trihedron.tools.trials.draw import draw_clean_block, draw_direction, largest_size
from trihedron.tools.trials.sizes import Hidden

SIGMA = 1e-5

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


def at_a_table_and_by_hand(
    seed: int, hidden: Sequence[Sized] = (), *, changed: float = 0.0
) -> tuple[PositionRecord, StrapdownRecord]:
    """One block at a table, then carried by hand: effects in both; a misalignment that has changed since by so much."""
    rng = np.random.default_rng(seed)
    carried = replace(draw_clean_block(77, seed, "gravity").instrument, temperature=None)
    block = dict(carried.instruments.accelerometers)
    truth = draw_truth(rng, symmetric=True)
    truth["AccelerometerBlock"] |= {name: value for name, value in block.items() if name != "bias"}
    truth["TurntableMotion"]["gravity_error"] = 0.0
    bench = replace(draw_bench(rng, (20, 20)), symmetric=True, mountings=("identity",), truth=truth)
    acting = [Hidden(place, values) for place, values in hidden]
    table = _another_day(rng, bench, (20, 20)).measured(seed, 0, acting)
    block["gamma_21"] = float(str(block["gamma_21"])) + changed
    carried = replace(carried, instruments=replace(carried.instruments, accelerometers=block))
    return table, carried.measured(seed, 7, acting)


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


def drawn_triple(seed: int) -> tuple[list[PositionRecord], EffectPlace, InRecord] | None:
    """Three records with an effect in all, and another in one: half as large again as rules each other effect out.

    Drawn among what the three together can show, and can show only in that way; None where twelve draws find none.
    """
    rng = np.random.default_rng([seed, 9])
    count = int(rng.integers(16, 40))
    clean = of_one_instrument(1000 + seed, 3, positions=(count, count))
    joint = join({f"record-{k}": bench_evidence(one, noise_bound=SIGMA) for k, one in enumerate(clean, start=1)})
    k = int(rng.integers(3))
    common = [place for place in joint.classes.places if not isinstance(place, InRecord)]
    alone = [p for p in joint.classes.places if type(p) is InRecord and p.record == f"record-{k + 1}"]
    for _ in range(12):
        first, second = common[rng.integers(len(common))], alone[rng.integers(len(alone))]
        if (first.where, first.effect) == (second.where, second.effect):
            continue
        if (size := _sure_size(joint, first, second, rng)) is None:
            continue
        if (own := _sure_size(joint, second, first, rng)) is None:
            continue
        own_of_day = {k: [(plain(second), own)]}
        records = of_one_instrument(1000 + seed, 3, positions=(count, count), shared=[(first, size)], own=own_of_day)
        return records, first, second
    return None


def _sure_size(
    joint: Joint, place: EffectPlace, beside: EffectPlace, rng: np.random.Generator
) -> tuple[float, ...] | None:
    """Values of an effect beside another one that no third effect could take for; None where it would be too large."""
    direction = draw_direction(rng, plain(place))
    added = joint.columns_of([place]) @ direction
    base, ones = np.hstack([joint.nominal, joint.columns_of([beside])]), np.ones(len(added))
    same = {*joint.classes.whole_class(place), *joint.classes.whole_class(beside)}
    others = (joint.columns_of([other]) for other in joint.classes.places if other not in same)
    least = min(chebyshev_radius(np.hstack([base, columns]), added, ones)[0] for columns in others)
    size = 1.5 * 2.0 / least if least > 0.0 else np.inf
    possible = np.isfinite(size) and size <= largest_size(plain(place), direction)
    return plain(place).definition.from_coefficients(size * direction) if possible else None
