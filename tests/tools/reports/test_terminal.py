"""The answer of a diagnosis and its next command fit a screen of 25 lines of 80 columns, for any verdict."""

import re
from pathlib import Path

import pytest

import trihedron as th
from generator import SIGMA
from generator.positions import drawn_record
from generator.wrong_rows import with_wrong_rows, with_wrong_stretch
from page_text import shown
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Diagnosis, diagnose, evidence_of, read_diagnosis
from trihedron.tools.diagnosis.procedure import diagnosed
from trihedron.tools.records import write_record

SHOWN = ("bench, explained", "bench, explained, with its gain", "bench, unexplained", "block, explained",
         "block, ambiguous", "block, insufficient")  # fmt: skip
GALLERY = Path(__file__).parents[3] / "docs" / "gallery"


def fits(diagnosis: Diagnosis) -> bool:
    """Whether a diagnosis fits the screen."""
    lines = str(diagnosis).splitlines()
    return len(lines) <= 23 and max(len(line) for line in lines) <= 80


@pytest.mark.acceptance
@pytest.mark.parametrize("name", SHOWN)
def test_every_verdict_fits_the_screen(name):
    diagnosis = shown(name)[0]
    assert fits(diagnosis)
    assert re.search(r"[^.]\.\.(?!\.)", str(diagnosis)) is None
    # The only options are those with which the model would stand, each with its number.
    offered = {entry.option for entry in diagnosis.stands_with or ()}
    assert set(re.findall(r"--(?:\S+ [\d.e-]*\d)?", " ".join(str(diagnosis).split()))) <= offered
    if diagnosis.gain is not None:
        assert "\nGain: " in str(diagnosis)


@pytest.mark.acceptance
def test_what_is_proven_is_a_sentence():
    verdict = str(th.diagnose(GALLERY / "unexplained.csv", noise_bound=SIGMA)).partition("\n\n")[0]
    assert "Proven: a function of the" in verdict
    assert verdict.endswith("nothing equally simple does.")


@pytest.mark.acceptance
@pytest.mark.parametrize("what", ["disturbed", "angle"])
def test_wrong_rows_fit_the_screen_and_say_what_to_do(what):
    diagnosis = diagnose(with_wrong_rows(4, what, 24, 3).record, noise_bound=SIGMA, rerun=False)
    assert fits(diagnosis)
    assert "Advice:      Check rows " in str(diagnosis)


def verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict in one line."""
    return " ".join(str(diagnosis).partition("Evidence:")[0].split())


@pytest.mark.acceptance
def test_the_answer_on_exchanged_columns_says_to_swap_them_back():
    wrong = with_wrong_stretch(4, "channels exchanged", 36, 7)
    diagnosis = diagnose(wrong.record, noise_bound=SIGMA, rerun=False)
    assert fits(diagnosis)
    assert "exchanged" in verdict(diagnosis)
    assert diagnosis.explanations is not None
    change = diagnosis.explanations[0].change
    assert change is not None
    first, second = change["exchanged"]
    rows = f"rows {wrong.rows[0]} to {wrong.rows[-1]}"
    assert diagnosis.next == (f"swap {first} and {second} back in {rows} of the file; until then leave them out",)


@pytest.mark.acceptance
def test_a_fault_beside_an_unfinished_search_is_said_to_be_so():
    record = with_wrong_stretch(4, "channels exchanged", 36, 7).record
    diagnosis = diagnosed(evidence_of(record, noise_bound=SIGMA), rerun=False, most_work=1.0)
    assert (diagnosis.verdict, diagnosis.complete) == ("explained", False)
    assert verdict(diagnosis).endswith("But the search was cut off: single effects were not all tried.")
    assert "only some effects" in " ".join(str(diagnosis).split())
    assert "cut off" not in verdict(diagnose(record, noise_bound=SIGMA, rerun=False))


@pytest.mark.acceptance
def test_a_consistent_record_says_which_errors_could_still_be_there():
    diagnosis = diagnose(drawn_record(3, count=24), noise_bound=SIGMA)
    assert diagnosis.verdict == "consistent"
    assert diagnosis.power is not None
    largest = max(entry["size"] for entry in diagnosis.power if entry["unit"] == "g" and entry["size"] is not None)
    text = verdict(diagnosis)
    assert text.endswith("could be there and not show.")
    assert float(text.partition("Errors below ")[2].split()[0]) == pytest.approx(largest, rel=0.1)


@pytest.mark.acceptance
def test_a_gain_that_fails_is_in_the_verdict():
    diagnosis = shown("bench, explained, with its gain")[0]
    assert "held out" not in verdict(diagnosis)
    worse = diagnosis.gain.model_copy(update={"held_out_rms_after": 2.0 * diagnosis.gain.held_out_rms_before})
    failed = diagnosis.model_copy(update={"gain": worse})
    assert "But it does not predict what was held out: the rms error goes from" in verdict(failed)


def test_a_size_that_may_be_zero_is_not_certain():
    diagnosis = shown("bench, explained")[0]
    (cause,) = diagnosis.causes
    size, *others = cause.parameters
    assert f"{size.name} {size.estimate}" not in str(diagnosis)
    ends = {"low": -2.0 * abs(size.estimate), "high": 2.0 * abs(size.estimate)}
    causes = (cause.model_copy(update={"parameters": (size.model_copy(update=ends), *others)}),)
    first, *rest = diagnosis.explanations
    explanations = (first.model_copy(update={"causes": causes}), *rest)
    weak = str(diagnosis.model_copy(update={"causes": causes, "explanations": explanations}))
    assert "may be zero, between -" in weak.partition("Not certain:")[2].partition("Tried:")[0]
    assert "may be zero" not in weak.partition("Not certain:")[0]


@pytest.mark.acceptance
def test_an_export_without_an_effect_says_why_it_writes_nothing(tmp_path, capsys):
    record = tmp_path / "r.csv"
    write_record(with_wrong_rows(4, "angle", 24, 1).record, record)
    options = ["--noise-bound", str(SIGMA), "--export", str(tmp_path / "x"), "--json", str(tmp_path / "d.json")]
    assert main(["diagnose", str(record), *options]) == 0
    assert "nothing to write, the diagnosis names no effect of the instrument" in capsys.readouterr().out
    assert not (tmp_path / "x").exists()
    assert main(["apply", str(tmp_path / "d.json"), str(record)]) == 2
    assert "a fault of its record (Row " in capsys.readouterr().err
    read = read_diagnosis(tmp_path / "d.json")
    assert read is not None
    page = read.report(tmp_path / "p.html").read_text(encoding="utf-8")
    assert read.explanations[0].sentence in " ".join(page.split())
