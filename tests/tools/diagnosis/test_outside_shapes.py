"""Records with faults outside the catalogue have the size that their generator states: two programmes agree."""

from pathlib import Path

import numpy as np
import pytest

from generator import SIGMA
from generator.positions import Session
from generator.unlisted import SHAPES, Known, distance, outside_case
from trihedron.tools.calibration import calibrate
from trihedron.tools.records import PositionRecord, read_record

QUICK = (2, 7, 11)
CASES = [k if k in QUICK else pytest.param(k, marks=pytest.mark.acceptance) for k in range(len(SHAPES))]


@pytest.mark.acceptance
@pytest.mark.parametrize("index", CASES)
def test_a_fault_of_so_many_times_detection_is_as_far_from_the_model(index: int, tmp_path: Path):
    """Without errors the least radius is twice the multiple; errors within σ move it by one at most."""
    case = outside_case(tmp_path, 7, index)
    record = read_record(tmp_path / case.file)
    assert isinstance(record, PositionRecord)
    calibration = calibrate(record, noise_bound=SIGMA)
    assert calibration.verdict == "falsified"
    assert calibration.radius == pytest.approx(2.0 * case.multiple, abs=1.0 + 0.05 * case.multiple)
    assert (case.place, case.quantity, case.factor) in case.same


def test_the_generators_model_imitates_what_is_no_fault():
    truth = Known.of(Session.drawn(np.random.default_rng(1), 30))
    turns = truth.unit_turns()
    for carrier in (turns["outer"], turns["kappa"], turns["epsilon"], turns["inner"]):
        assert distance(carrier.ravel(), truth.model) < 1e-5
    # A wobble of order one is a tilt of the table; the model does not contain one of order two.
    wobbles = [np.cos(order * truth.session.alpha)[:, None] * turns["kappa"] for order in (1, 2)]
    assert distance(wobbles[0].ravel(), truth.model) < 1e-2 < distance(wobbles[1].ravel(), truth.model)
