"""Formulas as hypotheses: true ones stand with their coefficients, false ones are refuted, wrong ones give one line."""

import json
from typing import Any

import numpy as np
import pytest

from diagnoses import diagnosed
from generator import SIGMA, G
from generator.fresh import strapdown_record
from generator.positions import record_with
from generator.unlisted import FORMULAS
from scenario_runs import run_of_file
from trihedron.tools import cli
from trihedron.tools.diagnosis.hypothesis import answered, places_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.records import PositionRecord, StrapdownRecord, read_record, write_record


def answer_of(record: PositionRecord, text: str, **options):
    """Return the answer of a table's record to a formula."""
    (answer,) = diagnosed(record, hypotheses=[text], **options).hypotheses
    return answer


def record_of(text: str) -> PositionRecord:
    """Return a record with the error of a formula in its target."""
    return record_with(len(text), {text.split()[0]: FORMULAS[text].error})


def within(parameter, size: float, room: float = 0.0) -> bool:
    return parameter.low - room <= size <= parameter.high + room


@pytest.mark.first(2)
@pytest.mark.parametrize("text", FORMULAS)
def test_a_true_formula_stands_and_a_false_one_is_refuted(text):
    """On ten records of 36 positions every answer is correct, and the intervals hold the true coefficients."""
    formula = FORMULAS[text]
    evidence = bench_evidence(record_of(text), noise_bound=SIGMA)
    places = places_of([text, formula.false], at_table=True, with_gyros=False)
    right, wrong = (answered(evidence, place, rerun=False) for place in places)
    assert right.answer == "stands"
    assert right.radius <= evidence.model.limit < right.radius_before
    # The formula counts from the encoder's unknown zero: a thousandth of the size here.
    for parameter, size in zip(right.parameters, formula.sizes, strict=True):
        assert within(parameter, size, 3e-3 * abs(size))
    assert (wrong.answer, wrong.parameters) == ("refuted", ())
    assert wrong.radius > 1.0


@pytest.mark.acceptance
def test_a_formula_of_a_gyro_is_judged_on_a_block_that_is_carried(tmp_path):
    """One gyro reads the cube of its rate: that formula stands with its size, other laws and another gyro do not."""
    record = read_record(strapdown_record(tmp_path / "s.strapdown.csv", "nothing", 3).path, StrapdownRecord)
    assert record.rate is not None
    record.rate[:, 0] += 4e-3 * record.rate[:, 0] ** 3
    formulas = ("w1 += c*w1**3", "w2 += c*w2**3", "w1 += c*w1**2", "w1 += c*w1*hours", "f1 += c*n1**3")
    answers = diagnosed(record, hypotheses=formulas).hypotheses
    assert [answer.answer for answer in answers] == ["stands", *["refuted"] * 4]
    (parameter,) = answers[0].parameters
    assert parameter.unit == "s2/rad2"
    assert within(parameter, 4e-3)


@pytest.mark.acceptance
def test_what_is_in_the_model_or_is_not_needed_is_said_so():
    record = record_with(1, {})
    assert answer_of(record, "f1 += c*n2").answer in ("cannot be told", "not needed")
    assert answer_of(record, "f1 += c").answer == "cannot be told"
    free = answer_of(record, "f1 += c*n1**3")
    assert free.answer == "not needed"
    (parameter,) = free.parameters
    assert parameter.low < 0.0 < parameter.high < 1e-3
    assert [equivalent.effect for equivalent in free.equivalents] == ["cubic"]


def worst_miss(folder, record) -> float:
    """Return the largest difference [g] of a record from the readings of an exported scenario."""
    again = run_of_file(folder / "scenario.toml").position_record()
    return float(np.abs(again.specific_force - record.specific_force).max()) / G


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_it_is_answered_shown_and_exported(tmp_path, monkeypatch):
    """The JSON and the page have the answers; the exported FMUs give the record again."""
    monkeypatch.chdir(tmp_path)
    write_record(record_with(9, {"f1": lambda v: 4e-4 * v.n[:, 0] ** 3}, 20), tmp_path / "r.positions.csv")
    command = ["diagnose", "r.positions.csv", "--noise-bound", "1e-5", "--hypothesis", "f1 += c*n1**3"]
    command += ["--hypothesis", "f1 += c*n1**2", "--json", "d.json", "--report", "d.html", "--export", "out"]
    assert cli.main(command) == 0
    first, second = json.loads((tmp_path / "d.json").read_text())["hypotheses"]
    assert (first["answer"], second["answer"]) == ("stands", "refuted")
    assert [equivalent["effect"] for equivalent in first["equivalents"]] == ["cubic"]
    assert first["gain"]["held_out_rms_after"] < 0.5 * first["gain"]["held_out_rms_before"]
    page = (tmp_path / "d.html").read_text(encoding="utf-8")
    assert all(text in page for text in ("Hypotheses", "f1 += c * n1 ** 3", "f1 += c * n1 ** 2"))
    assert worst_miss(tmp_path / "out", read_record(tmp_path / "r.positions.csv")) <= SIGMA


@pytest.mark.acceptance
def test_an_angle_reaches_the_block_of_what_is_exported(tmp_path):
    text = "f2 += c*sin(3*alpha)"
    record = record_of(text)
    evidence = bench_evidence(record, noise_bound=SIGMA)
    answer = answered(evidence, places_of([text], at_table=True, with_gyros=False)[0])
    assert answer.gain is not None
    assert answer.gain.held_out_rms_after < SIGMA < answer.gain.held_out_rms_before
    sizes = {cause.place: (cause.values, cause.intervals) for cause in answer.finding.causes}
    rerun: Any = evidence.reader.rerun
    rerun.extension(answer.finding.fit, sizes).write(tmp_path / "out", "a formula", "python")
    assert worst_miss(tmp_path / "out", record) <= SIGMA


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("f2 += c*d", "not linear"),
        ("w1 += c*w1**3", "w1 is of a strapdown record"),
        ("f2 += c/(n1 - n1)", "is no finite number at row 1"),
        ("f2", "must be written as"),
    ],
)
def test_a_wrong_one_is_refused_in_one_line_before_anything_is_searched(text, says, tmp_path, capsys):
    write_record(record_with(9, {}, 16), tmp_path / "r.positions.csv")
    path = str(tmp_path / "r.positions.csv")
    assert (
        cli.main(["diagnose", path, "--noise-bound", "1e-5", "--hypothesis", "f1 += c*n1**3", "--hypothesis", text])
        == 2
    )
    printed = capsys.readouterr()
    assert (printed.out, printed.err.count("\n")) == ("", 1)
    assert says in printed.err


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("alpha += c*sin(2*alpha)", "alpha is of a record of a table"),
        ("kappa += c*sin(2*alpha)", "kappa is of a record of a table"),
        ("f1 += c*alpha", "alpha is of a record of a table; a block that is carried has n1"),
        ("f1 += c*sense1", "sense1 is of a record of a table"),
    ],
)
def test_what_a_block_that_is_carried_does_not_have_is_refused(text, says):
    with pytest.raises(InputError, match=says):
        places_of(["f1 += c*n1", text], at_table=False, with_gyros=True)
