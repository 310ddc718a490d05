"""What stands on the page of a diagnosis beside the cause, or in place of one."""

import numpy as np
import pytest

from bench_cases import draw_case, measure
from page_text import html_of
from trihedron.tools.calibration import calibrate
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.reports.diagnosis import page as diagnosis_page
from trihedron.tools.reports.evidence import (
    judgement_section,
    ranking_section,
    structure_section,
    target_section,
)
from trihedron.tools.trials.bench import NOISE_BOUND


@pytest.fixture(scope="module")
def explained_record():
    return measure(draw_case(501, effects=["quadratic"]), 501)


@pytest.fixture(scope="module")
def explained(explained_record):
    return diagnose(explained_record, noise_bound=NOISE_BOUND, rerun=False)


@pytest.fixture(scope="module")
def strange_record():
    record = measure(draw_case(5, effects=[]), 5)
    n = calibrate(record, noise_bound=NOISE_BOUND).linearised.input
    record.specific_force[:, 0] += 9.80665 * 5e-3 * n[:, 0] ** 5
    return record


@pytest.fixture(scope="module")
def unexplained(strange_record):
    return diagnose(strange_record, noise_bound=NOISE_BOUND)


def test_the_page_of_a_cause_has_the_second_witness_and_what_it_does_to_the_calibration(explained, explained_record):
    page = html_of(diagnosis_page, explained, explained_record)
    assert "Left out, and shuffled" in page
    assert "Targets, and what the effects do to them" in page
    table = target_section(explained).table
    assert table is not None
    moved = {row[0]: float(getattr(row[3], "text", "").replace("−", "-")) for row in table.rows}
    assert len(moved) == 18
    assert {str(row[-1]) for row in table.rows} == {"", "rad", "g"}
    # A quadratic term passes for scale-factor errors of opposite signs.
    size = explained.causes[0].values[0]
    plus = {1: "X4", 2: "X9", 3: "X14"}[explained.causes[0].place.index + 1]
    assert abs(moved[plus]) == pytest.approx(abs(size), rel=0.3)
    left_out = judgement_section(explained).table
    assert left_out is not None
    assert [row[0] for row in left_out.rows] == ["every fifth position", "every quarter of the time"]
    assert structure_section(explained) is None


def test_the_page_without_a_cause_says_what_the_residual_depends_on(unexplained, strange_record):
    assert unexplained.verdict == "unexplained"
    assert "What the residual depends on" in html_of(diagnosis_page, unexplained, strange_record)
    assert judgement_section(unexplained) is None
    assert target_section(unexplained) is None
    first = unexplained.residual_structure[0]
    assert (first["accelerometer"], first["on"]) == (1, "input")
    assert first["explained"] > 0.8
    assert 0.99 < first["explainable"] <= 1.0
    assert structure_section(unexplained).svg.startswith("<svg")
    assert np.all([0.0 <= entry["explained"] <= 1.0 for entry in unexplained.residual_structure])


def test_an_effect_that_mends_the_record_only_with_an_impossible_size_is_said_not_to_remain(explained):
    (cause,) = explained.causes
    named = (cause.place.title, 0.5)
    for tried, words in (
        ([("cubic accelerometer-3", 1.2)], []),
        ([("sag inner-axis", 0.9)], ["One of them is not among the sets that remain"]),
        ([("sag inner-axis", 0.9), ("sag outer-axis", 1.0)], ["2 of them are not among the sets that remain"]),
    ):
        section = ranking_section(explained.model_copy(update={"tried": (named, *tried)}))
        assert section is not None
        assert [said.partition(":")[0] for said in section.paragraphs[1:]] == words
