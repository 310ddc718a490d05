"""A stretch of a record that does not belong to the rest is named, with its correction."""

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from generator import SIGMA
from generator.wrong_rows import with_wrong_stretch
from trihedron.tools.diagnosis import diagnose


@pytest.mark.acceptance
def test_two_instruments_exchanged_for_an_hour(tmp_path):
    diagnosis = th.diagnose(field_file("o06_hourswap.csv", tmp_path), noise_bound=1e-5)
    assert diagnosis.verdict == "explained"
    stretch = diagnosis.explanations[0]
    assert (stretch.kind, stretch.rows) == ("stretch", tuple(range(19, 31)))
    assert stretch.sentence.endswith("which fits. They fit with f1 and f2 exchanged.")
    assert diagnosis.stated.verdict == "consistent"


@pytest.mark.parametrize(
    ("what", "seed"),
    [
        ("angles exchanged", 5),
        *(pytest.param(what, 4, marks=pytest.mark.acceptance) for what in ("channels exchanged", "disturbed")),
    ],
)
def test_a_stretch_is_named_with_its_ends(what, seed):
    wrong = with_wrong_stretch(seed, what, 36, 6)
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    assert diagnosis.verdict == "explained"
    assert (diagnosis.explanations[0].kind, diagnosis.explanations[0].rows) == ("stretch", wrong.rows)
    assert ("They fit" in diagnosis.explanations[0].sentence) == (what != "disturbed")


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(700, 730))
def test_drawn_stretches_end_with_the_right_rows(seed):
    rng = np.random.default_rng(seed)
    what, count = (
        str(rng.choice(["channels exchanged", "disturbed", "angles exchanged"])),
        int(rng.choice([36, 48, 100])),
    )
    wrong = with_wrong_stretch(seed, what, count, int(rng.integers(4, count // 5 + 1)))
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    assert diagnosis.verdict == "explained"
    assert diagnosis.explanations[0].rows == wrong.rows
