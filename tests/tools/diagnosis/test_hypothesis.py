"""Formulas as hypotheses: true ones stand with their coefficients, false ones are refuted, wrong ones are one line."""

import json

import numpy as np
import pytest

from generator import SIGMA
from generator.fresh import strapdown_record
from generator.unlisted import FORMULAS, record_with
from scenario_runs import run_of_file
from trihedron.models.effects import EffectPlace
from trihedron.tools import cli
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.diagnosis.hypothesis import answered, places_of
from trihedron.tools.errors import InputError
from trihedron.tools.evidence.bench import bench_evidence
from trihedron.tools.records import PositionRecord, StrapdownRecord, read_record


def place_of(text: str) -> EffectPlace:
    """The effect of a formula of a record of a table."""
    (place,) = places_of([text], at_table=True, with_gyros=False)
    return place


@pytest.mark.first(2)
@pytest.mark.parametrize("text", FORMULAS)
def test_a_true_formula_stands_and_a_false_one_is_refuted(text, tmp_path):
    """On ten records of 36 positions every answer is right, and the intervals hold the true coefficients."""
    formula = FORMULAS[text]
    path = record_with(tmp_path / "r.positions.csv", len(text), text.split()[0], formula.error)
    evidence = bench_evidence(read_record(path, PositionRecord), noise_bound=SIGMA)
    right = answered(evidence, place_of(text), rerun=False)
    assert right.answer == "stands"
    assert right.radius <= 1.0 < right.radius_before
    for parameter, size in zip(right.parameters, formula.sizes, strict=True):
        assert parameter.low is not None
        assert parameter.high is not None
        # The formula counts from the encoder's zero, which nobody knows: a thousandth of the size here.
        assert parameter.low - 3e-3 * abs(size) <= size <= parameter.high + 3e-3 * abs(size)
    wrong = answered(evidence, place_of(formula.false), rerun=False)
    assert wrong.answer == "refuted"
    assert wrong.radius > 1.0
    assert wrong.parameters == ()


@pytest.mark.acceptance
def test_a_formula_of_a_gyro_is_judged_on_a_block_that_is_carried(tmp_path):
    """One gyro reads the cube of its rate: that stands with its size, other laws and another gyro do not."""
    path = strapdown_record(tmp_path / "s.strapdown.csv", "nothing", 3).path
    record = read_record(path, StrapdownRecord)
    assert record.rate is not None
    record.rate[:, 0] += 4e-3 * record.rate[:, 0] ** 3
    formulas = ("w1 += c*w1**3", "w2 += c*w2**3", "w1 += c*w1**2", "w1 += c*w1*hours", "f1 += c*n1**3")
    result = diagnose(record, hypotheses=formulas, rerun=False)
    assert result.hypotheses is not None
    assert [answer.answer for answer in result.hypotheses] == ["stands", *["refuted"] * 4]
    (parameter,) = result.hypotheses[0].parameters
    assert parameter.unit == "s2/rad2"
    assert parameter.low is not None
    assert parameter.high is not None
    assert parameter.low <= 4e-3 <= parameter.high


def test_what_is_in_the_model_or_is_not_needed_is_said_so(tmp_path):
    record = read_record(
        record_with(tmp_path / "r.positions.csv", 1, "f1", lambda seen: 0.0 * seen.hours), PositionRecord
    )
    evidence = bench_evidence(record, noise_bound=SIGMA)
    assert answered(evidence, place_of("f1 += c*n2")).answer in ("cannot be told", "not needed")
    assert answered(evidence, place_of("f1 += c")).answer == "cannot be told"
    free = answered(evidence, place_of("f1 += c*n1**3"))
    assert free.answer == "not needed"
    (parameter,) = free.parameters
    assert parameter.low is not None
    assert parameter.high is not None
    assert parameter.low < 0.0 < parameter.high < 1e-3
    assert [named.effect for named in free.equivalents] == ["cubic"]


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_it_is_told_printed_shown_and_exported(tmp_path, monkeypatch, capsys):
    """The JSON has the answers, the terminal and the page too; the exported FMUs give the record again."""
    monkeypatch.chdir(tmp_path)
    record_with(tmp_path / "r.positions.csv", 9, "f1", lambda seen: 4e-4 * seen.n[:, 0] ** 3, count=20)
    command = ["diagnose", "r.positions.csv", "--noise-bound", "1e-5", "--hypothesis", "f1 += c*n1**3"]
    more = ["--hypothesis", "f1 += c*n1**2", "--json", "d.json", "--report", "d.html", "--export", "out"]
    assert cli.main([*command, *more]) == 0
    said = capsys.readouterr().out
    assert "hypothesis f1 += c * n1 ** 3: stands" in said
    assert "by another name: cubic accelerometer-1" in said
    assert "hypothesis f1 += c * n1 ** 2: refuted" in said
    first, second = json.loads((tmp_path / "d.json").read_text())["hypotheses"]
    assert (first["answer"], second["answer"]) == ("stands", "refuted")
    assert first["gain"]["held_out_rms_after"] < 0.5 * first["gain"]["held_out_rms_before"]
    assert "Hypotheses" in (tmp_path / "d.html").read_text(encoding="utf-8")
    run = run_of_file(tmp_path / "out" / "scenario.toml").position_record()
    measured = read_record(tmp_path / "r.positions.csv")
    assert np.abs(run.specific_force - measured.specific_force).max() / 9.80665 <= SIGMA


def test_an_angle_reaches_the_block_of_what_is_exported(tmp_path):
    text = "f2 += c*sin(3*alpha)"
    record = read_record(record_with(tmp_path / "r.positions.csv", 5, "f2", FORMULAS[text].error), PositionRecord)
    evidence = bench_evidence(record, noise_bound=SIGMA)
    one = answered(evidence, place_of(text))
    assert one.gain is not None
    assert one.gain.held_out_rms_after < SIGMA < one.gain.held_out_rms_before
    folder = evidence.extension(one.finding.fit, {c.place: (c.values, c.intervals) for c in one.finding.causes})
    folder.write(tmp_path / "out", "a formula", "python")
    run = run_of_file(tmp_path / "out" / "scenario.toml").position_record()
    assert np.abs(run.specific_force - record.specific_force).max() / 9.80665 <= SIGMA


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
    path = record_with(tmp_path / "r.positions.csv", 9, "f1", lambda seen: 0.0 * seen.hours, count=16)
    assert cli.main(["diagnose", str(path), "--noise-bound", "1e-5", "--hypothesis", text]) == 2
    said = capsys.readouterr()
    assert says in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""


@pytest.mark.parametrize(
    ("text", "in_motion", "says"),
    [
        ("w1 += c*w1**3", False, "w1 is of a strapdown record"),
        ("alpha += c*sin(2*alpha)", True, "alpha is of a record of a table"),
        ("kappa += c*sin(2*alpha)", True, "kappa is of a record of a table"),
        ("f1 += c*alpha", True, "alpha is of a record of a table; a block that is carried has n1"),
        ("f1 += c*sense1", True, "sense1 is of a record of a table"),
    ],
)
def test_what_a_kind_of_record_does_not_have_is_refused(text, in_motion, says):
    with pytest.raises(InputError, match=says):
        places_of([text], at_table=not in_motion, with_gyros=in_motion)
    with pytest.raises(InputError, match="hypothesis"):
        places_of(["f1 += c*n1", text], at_table=not in_motion, with_gyros=in_motion)
