"""A lot of a thousand simulated instruments: hidden shared causes and odd ones are found; a lot without any gives none.

`TRIHEDRON_LOT` is the number of instruments.
"""

import os
from dataclasses import replace
from pathlib import Path

import pytest

import trihedron as th
from generator.lots import SIGMA, serial_of, write_lot
from generator.stands import Stand
from trihedron.models.effects import EffectPlace

pytestmark = pytest.mark.acceptance
COUNT = int(os.environ.get("TRIHEDRON_LOT", "1000"))
EARLY = EffectPlace("quadratic", "accelerometer-2"), (4e-4,)
LATE = EffectPlace("cubic", "accelerometer-1"), (8e-4,)
DRIFT = EffectPlace("bias-drift", "accelerometer-3"), (2e-3,)
POSITIONS = 24


def test_shared_causes_a_step_and_odd_ones_are_found(tmp_path: Path):
    """One cause is in seven of ten instruments of a fifth of the lot, one in all of the last tenth, one in one."""
    begin, end, late, odd = COUNT * 4 // 10, COUNT * 6 // 10, COUNT * 9 // 10, COUNT // 9
    hidden = {number: [EARLY] for number in range(begin, end) if number % 10 not in (2, 5, 8)}
    hidden |= {number: [LATE] for number in range(late, COUNT)}
    hidden[odd] = [DRIFT]

    def changed(number: int, stand: Stand) -> Stand:
        """Move the bias of accelerometer 2 from half of the lot on, and that of accelerometer 3 of one instrument."""
        bias = stand.bias.copy()
        bias[1] += 0.04 * (number >= COUNT // 2)
        bias[2] += 0.12 * (number == COUNT // 3)
        return replace(stand, bias=bias)

    table = write_lot(tmp_path, COUNT, 49, hidden=hidden, changed=changed, positions=POSITIONS)
    lot = th.batch(table, do="diagnose", noise_bound=SIGMA, out=tmp_path / "out", jobs=2)
    causes = {cause.cause.place: (cause.since, cause.until) for cause in lot.shared}
    assert causes == {
        EARLY[0]: (serial_of(begin), serial_of(end - 1)),
        LATE[0]: (serial_of(late), None),
    }
    assert {one.serial for one in lot.odd} >= {serial_of(odd), serial_of(COUNT // 3)}
    assert len(lot.odd) <= 2 + COUNT // 200
    (step,) = [one for one in lot.dependences if one.against == "serial"]
    assert step.symbol == "X17"
    assert step.low < 0.04 < step.high


def test_a_lot_without_anything_names_nothing(tmp_path: Path):
    table = write_lot(tmp_path, COUNT, 50, positions=POSITIONS)
    lot = th.batch(table, do="diagnose", noise_bound=SIGMA, out=tmp_path / "out", jobs=2)
    assert lot.verdicts == {"consistent": COUNT}
    assert (lot.shared, lot.odd, lot.dependences) == ((), (), ())
