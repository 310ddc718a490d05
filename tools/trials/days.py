"""One block at a table on several days: its bias, its mounting, the table and the positions are each day's own."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.effects import EffectPlace
from ..evidence.bench import bench_evidence
from ..evidence.joint import Joint, join
from ..evidence.of_record import InRecord, plain
from ..records import PositionRecord
from .bench import NOISE_BOUND, Bench, draw_bench, draw_truth
from .sizes import Hidden, draw_direction, largest_size, sizes_of_change


@dataclass(frozen=True)
class Days:
    """The benches of the days; the block is the same."""

    benches: tuple[Bench, ...]

    @staticmethod
    def drawn(rng: np.random.Generator, count: int, positions: tuple[int, int], noise: str = "uniform") -> "Days":
        """A block with scale factors that depend on the sign, in one mounting, on so many days."""
        truth, days = draw_truth(rng, symmetric=False), []
        for _ in range(count):
            bench, own = draw_bench(rng, positions), draw_truth(rng, symmetric=False)
            # What the inner axis does on all days has one phase where the zero of its encoder is one.
            kept = {name: truth["TurntableMotion"][name] for name in ("gravity_error", "beta_offset")}
            table = {**own["TurntableMotion"], **kept}
            block = {**truth["AccelerometerBlock"], "bias": own["AccelerometerBlock"]["bias"]}
            of_day = {"truth": {"TurntableMotion": table, "AccelerometerBlock": block}, "mountings": ("identity",)}
            single = {"mounting_errors": bench.mounting_errors[:1], "mounting": np.zeros(len(bench.alpha), dtype=int)}
            days.append(replace(bench, symmetric=False, noise=noise, **of_day, **single))
        return Days(tuple(days))

    def measured(
        self, seed: int, index: int | None = None, hidden: Sequence[Hidden] = (), *, progress: bool = False
    ) -> dict[str, PositionRecord]:
        """The records by their labels; an effect `in_record` acts in that one alone. Arguments as for a bench."""
        seed = seed if index is None else int(np.random.default_rng([seed, index, 0]).integers(2**31))
        found = {}
        for k, bench in enumerate(self.benches):
            label = f"record-{k + 1}"
            acting = [one for one in hidden if getattr(one.place, "record", label) == label]
            own = [replace(one, place=plain(one.place)) for one in acting]
            found[label] = bench.measured(seed, k, own, progress=progress)
        return found

    def as_measured(self, record: PositionRecord) -> PositionRecord:
        """A day's record as a laboratory has it."""
        return record


def joined(records: dict[str, PositionRecord]) -> Joint:
    """The evidence of the records together."""
    return join({label: bench_evidence(record, noise_bound=NOISE_BOUND) for label, record in records.items()})


def draw_shared_and_own(
    rng: np.random.Generator, joint: Joint, above: float, names: Sequence[str] = ()
) -> tuple[Hidden, Hidden] | None:
    """An effect in all records and one of a record alone, of these names if any, so many times as large as excludes
    each other effect beside the two; None where a size would not be possible. The records, of `joint`, are clean.
    """
    places = [place for place in joint.classes.places if not names or place.effect in names]
    label = joint.labels[rng.integers(len(joint.labels))]
    common = [place for place in places if not isinstance(place, InRecord)]
    alone = [place for place in places if type(place) is InRecord and place.record == label]
    if not common or not alone:
        return None
    first, second = common[rng.integers(len(common))], alone[rng.integers(len(alone))]
    if (first.where, first.effect) == (second.where, second.effect):
        return None
    shared, own = _sized(rng, joint, first, second, above), _sized(rng, joint, second, first, above)
    return None if shared is None or own is None else (shared, own)


def _sized(
    rng: np.random.Generator, joint: Joint, place: EffectPlace, beside: EffectPlace, above: float
) -> Hidden | None:
    """An effect that no third one, and no reading that is off, can stand for beside another; None where too large."""
    direction = draw_direction(rng, plain(place))
    same = {*joint.classes.whole_class(place), *joint.classes.whole_class(beside)}
    rivals = {other.title: joint.columns_of([other]) for other in joint.classes.places if other not in same}
    base = np.hstack([joint.nominal, joint.columns_of([beside])])
    sizes = sizes_of_change(base, joint.columns_of([place]) @ direction, rivals)
    size = above * sizes.excluded
    if not np.isfinite(size) or size > largest_size(plain(place), direction):
        return None
    return Hidden(place, place.definition.from_coefficients(size * direction), float(size), sizes)
