"""Calibrations of fresh records by a generator that shares no code with the product: the truth, and the result."""

import pytest

from generator import SIGMA
from generator.fresh import position_record
from trihedron.tools.calibration import calibrate
from trihedron.tools.records import PositionRecord, read_record


@pytest.mark.parametrize("seed", range(12))
def test_every_interval_holds_the_truth_and_what_is_stated(seed, tmp_path):
    """Draw benches and blocks up to the paper's bounds, errors uniform, Gaussian or at their very bound."""
    fresh = position_record(tmp_path / "fresh.csv", "clean", seed)
    result = calibrate(read_record(fresh.path, PositionRecord), noise_bound=SIGMA)
    assert result.verdict == "consistent"
    assert {entry.symbol for entry in result.parameters} == set(fresh.targets)
    # Nine written decimals, and the programmes' tolerance.
    room = 1e-9
    for entry in result.parameters:
        assert entry.low is not None
        assert entry.high is not None
        assert entry.estimate is not None
        assert entry.low - room <= fresh.targets[entry.symbol] <= entry.high + room
        assert entry.low <= entry.estimate <= entry.high
