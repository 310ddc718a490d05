"""Twenty formulas as hypotheses, ten true and ten false, on records that share no code with the product."""

import pytest

from hypothesis_records import SIZES, TRUE, record_with
from independent_bench import SIGMA
from trihedron.tools.diagnosis.hypothesis import places_of
from trihedron.tools.diagnosis.procedure import answered
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, read_record


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
