"""Twenty formulas as hypotheses, ten true and ten false, on records that share no code with the product."""

import numpy as np
import pytest

from hypothesis_records import SIZES, TRUE, record_with
from independent_bench import SIGMA, strapdown_record
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.hypothesis import places_of
from trihedron.tools.diagnosis.procedure import answered
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, StrapdownRecord, read_record

pytestmark = pytest.mark.acceptance


def place_of(text: str):
    (place,) = places_of([text], in_motion=False)
    return place


@pytest.mark.parametrize("text", TRUE)
def test_a_true_formula_stands_and_a_false_one_is_refuted(text, tmp_path):
    """Twenty hypotheses on ten records of 36 positions: every answer is right, and the intervals hold the truth."""
    errors, false = TRUE[text]
    left = text.split()[0]
    path = record_with(tmp_path / "r.positions.csv", len(text), left, errors)
    evidence = bench_evidence(read_record(path, PositionRecord), noise_bound=SIGMA)
    right = answered(evidence, place_of(text), rerun=False)
    assert right.answer == "stands"
    assert right.radius <= 1.0 < right.radius_before
    for parameter, size in zip(right.parameters, SIZES[text], strict=True):
        assert parameter.low is not None
        assert parameter.high is not None
        # The zero of the inner encoder is not told; it is a thousandth of the size here.
        assert parameter.low - 3e-3 * abs(size) <= size <= parameter.high + 3e-3 * abs(size)
    wrong = answered(evidence, place_of(false), rerun=False)
    assert wrong.answer == "refuted"
    assert wrong.radius > 1.0
    assert wrong.parameters == ()


def test_a_formula_of_a_gyro_is_judged_on_a_block_that_is_carried(tmp_path):
    """One gyro reads the cube of its rate: that stands with its size, other laws and another gyro do not."""
    path = strapdown_record(tmp_path / "s.strapdown.csv", "nothing", 3).path
    head, table = path.read_text().split("\n")[0], np.loadtxt(path, delimiter=",", skiprows=1)
    table[:, 1] += 4e-3 * table[:, 1] ** 3
    np.savetxt(path, table, fmt=["%.4f", *["%.8f"] * 3, *["%.7f"] * 3], delimiter=",", header=head, comments="")
    asked = ("w1 += c*w1**3", "w2 += c*w2**3", "w1 += c*w1**2", "w1 += c*w1*hours", "f1 += c*n1**3")
    result = diagnose(read_record(path, StrapdownRecord), hypotheses=asked, rerun=False)
    assert result.hypotheses is not None
    assert [one.answer for one in result.hypotheses] == ["stands", *["refuted"] * 4]
    (parameter,) = result.hypotheses[0].parameters
    assert parameter.unit == "s2/rad2"
    assert parameter.low is not None
    assert parameter.high is not None
    assert parameter.low <= 4e-3 <= parameter.high
