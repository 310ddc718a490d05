"""Twenty formulas as hypotheses, ten true and ten false, on records that share no code with the product."""

import numpy as np
import pytest

from hypothesis_records import TRUE, check_answers
from independent_bench import strapdown_record
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.records import StrapdownRecord, read_record

pytestmark = pytest.mark.acceptance


@pytest.mark.parametrize("text", TRUE)
def test_a_true_formula_stands_and_a_false_one_is_refuted(text, tmp_path):
    """Twenty hypotheses on ten records of 36 positions: every answer is right, and the intervals hold the truth."""
    check_answers(text, tmp_path)


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
