"""Wrong rows of a position record are named, with the change that corrects each, before any physics."""

from dataclasses import replace

import numpy as np
import pytest

import trihedron as th
from field_files import field_file
from generator import SIGMA
from generator.positions import drawn_record
from generator.wrong_rows import SPOILED, with_wrong_rows
from trihedron.models.effects import EffectPlace
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.records import write_record

FIELD = {
    "o04_angledigit.csv": ((20,), "α smaller by 0.40"),
    "o05_abswap.csv": ((9,), "α and β exchanged (α larger by 65.048°, β smaller by 65.048°)"),
    "o07_seismic.csv": ((6, 18, 30), "disturbed"),
    "o15_copied.csv": ((23,), "readings are those of row 22"),
    "o24_sign.csv": ((12,), "sign of β turned (β larger by 172.2°)"),
    "o25_three_outliers.csv": ((5, 16, 29), "The readings f1 of row 5, f3 of row 16 and f2 of row 29 do not fit"),
}


@pytest.mark.first(1)
@pytest.mark.parametrize("name", FIELD)
def test_records_of_the_field_end_with_their_rows(name, tmp_path):
    rows, words = FIELD[name]
    diagnosis = th.diagnose(field_file(name, tmp_path), noise_bound=1e-5)
    assert diagnosis.verdict == "explained"
    assert diagnosis.explanations[0].kind == "rows"
    assert diagnosis.explanations[0].rows == rows
    assert words in diagnosis.explanations[0].sentence
    assert diagnosis.best is not None
    assert diagnosis.stated.verdict == "consistent"


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("what", "seed", "count", "rows"),
    [("angle", 7, 24, 1), ("angles exchanged", 22, 24, 2), ("copied", 5, 12, 1), ("disturbed", 27, 24, 3)],
)
def test_wrong_rows_are_named_and_nothing_else(what, seed, count, rows):
    wrong = with_wrong_rows(seed, what, count, rows)
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    assert (diagnosis.verdict, diagnosis.causes) == ("explained", ())
    assert diagnosis.explanations[0].rows == wrong.rows


@pytest.mark.acceptance
@pytest.mark.parametrize("seed", range(500, 560))
def test_drawn_faults_end_with_the_right_rows(seed):
    rng = np.random.default_rng(seed)
    what, count = list(SPOILED)[seed % len(SPOILED)], int(rng.choice([12, 16, 24, 36, 48, 100]))
    wrong = with_wrong_rows(seed, what, count, 1 if count < 24 else int(rng.integers(1, 4)))
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    assert diagnosis.verdict == "explained"
    assert diagnosis.explanations[0].rows == wrong.rows


@pytest.mark.acceptance
def test_the_angle_that_makes_a_row_fit_is_stated(tmp_path):
    record = drawn_record(11, count=30)
    alpha = record.alpha.copy()
    alpha[16] += np.radians(0.4)
    path = tmp_path / "r.csv"
    write_record(replace(record, alpha=alpha), path)
    diagnosis = th.diagnose(path, noise_bound=SIGMA)
    (explanation,) = diagnosis.explanations
    assert explanation.change is not None
    assert explanation.change["alpha_deg"] == pytest.approx(-0.4, abs=2e-3)
    read = Diagnosis.model_validate_json(diagnosis.json_text())
    assert read.explanations[0].rows == (17,)
    assert "Row 17 is wrong; all others fit. It fits with α smaller by 0.3" in str(diagnosis)
    assert diagnosis.report(tmp_path / "page.html").stat().st_size > 1000


@pytest.mark.first(1)
@pytest.mark.parametrize("rows", [(13,), (9, 10, 11, 12, 13)])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("rotated", "fit with f1, f2, f3 read as f3, f1, f2."),
        ("both signs", "fit with the signs of both angles turned"),
        ("exchanged", "fit with f1 and f3 exchanged."),
        ("sign", "fit with the sign of f2 turned."),
    ],
)
def test_the_same_exchanges_are_said_of_one_row_and_of_a_stretch(rows, change, words, tmp_path):
    record = drawn_record(31, count=40)
    force, alpha, beta = record.specific_force.copy(), record.alpha.copy(), record.beta.copy()
    wrong = np.array(rows) - 1
    if change == "both signs":
        alpha[wrong], beta[wrong] = -alpha[wrong], -beta[wrong]
    elif change == "sign":
        force[wrong, 1] *= -1.0
    else:
        force[wrong] = force[wrong][:, [2, 0, 1] if change == "rotated" else [2, 1, 0]]
    changed = replace(record, specific_force=force, alpha=alpha, beta=beta)
    diagnosis = diagnose(changed, noise_bound=SIGMA, rerun=False)
    assert (diagnosis.verdict, diagnosis.explanations[0].rows) == ("explained", rows)
    assert words in diagnosis.explanations[0].sentence.replace("fits with", "fit with")


@pytest.mark.acceptance
def test_a_single_effect_has_no_rival_in_rows():
    place = EffectPlace("quadratic", "accelerometer-2")
    diagnosis = diagnose(drawn_record(3, [(place, (3e-4,))], 30), noise_bound=SIGMA, rerun=False)
    assert diagnosis.verdict == "explained"
    assert {explanation.kind for explanation in diagnosis.explanations} == {"effect"}


@pytest.mark.acceptance
def test_two_readings_of_one_accelerometer_are_not_named_alone():
    record = drawn_record(5, count=30)
    force = record.specific_force.copy()
    force[[4, 19], 1] += 9.81 * np.array([9e-5, -7e-5])
    diagnosis = diagnose(replace(record, specific_force=force), noise_bound=SIGMA, rerun=False)
    assert diagnosis.verdict == "ambiguous"
    assert {explanation.kind for explanation in diagnosis.explanations} == {"rows", "function"}
    assert "Accelerometer 2 errs near its inputs in rows 5 and 20" in diagnosis.explanations[1].sentence


@pytest.mark.first(1)
@pytest.mark.parametrize(("first", "count"), [(0, 24), (5, 3), (10, 8)])
def test_rows_that_were_pasted_twice_are_said(first, count, tmp_path):
    path = tmp_path / "r.csv"
    write_record(drawn_record(21, count=24), path)
    head, *rows = path.read_text(encoding="utf-8").splitlines()
    pasted = [*rows, *rows[first : first + count]]
    numbered = [f"{k},{10.0 * k},{row.split(',', 2)[2]}" for k, row in enumerate(pasted, start=1)]
    path.write_text("\n".join([head, *numbered]) + "\n", encoding="utf-8")
    (warning,) = th.diagnose(path, noise_bound=SIGMA).warnings
    assert f"rows 25 to {24 + count} of r.csv are rows {first + 1} to {first + count} again" in warning
