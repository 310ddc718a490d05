"""Records of one block at a table and by hand, simulated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.models.effects import EffectPlace
from trihedron.tools.evidence import in_record
from trihedron.tools.records import PositionRecord, StrapdownRecord
from trihedron.tools.trials import (
    Hidden,
    draw_bench,
    draw_clean_block,
    draw_days,
    draw_truth,
    measured_on_days,
    plain_bench,
)

Sized = tuple[EffectPlace, tuple[float, ...]]


def days_of_a_suite(seed: int, count: int, own: Sized, shared: Sequence[Sized] = ()) -> list[PositionRecord]:
    """Return records of sixteen positions of one block, drawn like a suite; an effect in the second, others in all."""
    rng = np.random.default_rng(seed)
    draw_bench(rng, (16, 16))
    hidden = [Hidden(place, values) for place, values in shared]
    hidden.append(Hidden(in_record(own[0], "record-2"), own[1]))
    days = draw_days(rng, count, (16, 16))
    return list(measured_on_days(days, seed, None, hidden).values())


def at_a_table_and_by_hand(
    seed: int, hidden: Sequence[Sized] = (), *, changed: float = 0.0
) -> tuple[PositionRecord, StrapdownRecord]:
    """Return one block at a table, then carried by hand: effects in both, and a misalignment changed between them."""
    rng = np.random.default_rng(seed)
    carried = replace(draw_clean_block(77, seed, "gravity").instrument, temperature=None)
    block = dict(carried.instruments.accelerometers)
    truth = draw_truth(rng, symmetric=True)
    truth["AccelerometerBlock"] |= {name: value for name, value in block.items() if name != "bias"}
    truth["TurntableMotion"]["gravity_error"] = 0.0
    drawn = draw_bench(rng, (20, 20))
    acting = [Hidden(place, values) for place, values in hidden]
    table = plain_bench(truth, drawn.alpha, drawn.beta, symmetric=True).measured(seed, 0, acting)
    block["gamma_21"] = float(str(block["gamma_21"])) + changed
    carried = replace(carried, instruments=replace(carried.instruments, accelerometers=block))
    return table, carried.measured(seed, 7, acting)
