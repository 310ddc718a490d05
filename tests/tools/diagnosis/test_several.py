"""Several records of one instrument: effects of the instrument, of a run, and undetermined by a single record."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import trihedron as th
from generator.positions import of_one_instrument
from generator.stands import random_bench, simulated
from instrument_records import at_a_table_and_by_hand, days_of_a_suite
from trihedron.models.effects import EffectPlace
from trihedron.tools.check import check
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import Diagnosis, Finding, evidence_options, labels_of, procedure, several
from trihedron.tools.errors import InputError
from trihedron.tools.records import write_record
from trihedron.tools.trials import draw_clean_block

SIGMA = 1e-5
QUADRATIC, CUBIC = EffectPlace("quadratic", "accelerometer-2"), EffectPlace("cubic", "accelerometer-1")


def together(*records, **options) -> Any:
    """Return the diagnosis of several records."""
    return th.diagnose_together(*records, **options)


@pytest.fixture(scope="module")
def three_records() -> Any:
    """Return three records: a quadratic term in all, a cubic one in the second alone."""
    records = of_one_instrument(5, shared=[(QUADRATIC, (4e-4,))], own={1: [(CUBIC, (4e-4,))]})
    return together(*records, noise_bound=SIGMA)


@pytest.mark.acceptance
def test_what_is_shared_is_the_instruments_and_what_one_record_has_is_that_runs(three_records):
    assert three_records.verdict == "explained"
    assert [(c.title, c.is_of_instrument, c.record) for c in three_records.causes] == [
        ("quadratic accelerometer-2", True, None),
        ("cubic accelerometer-1 in record-2", False, "record-2"),
    ]
    assert three_records.instrument == "yes"
    assert three_records.runs == {"record-1": "no", "record-2": "yes", "record-3": "no"}
    for cause in three_records.causes:
        (size,) = cause.parameters
        assert size.low is not None
        assert size.high is not None
        assert 0.0 < size.low < 4e-4 < size.high


@pytest.mark.acceptance
def test_together_they_tell_a_shared_effect_better_than_each_alone(three_records):
    """The joint interval is inside that of every record: all of them hold the truth."""
    (size,) = three_records.causes[0].parameters
    symbol = "quadratic accelerometer-2: coefficient"
    (again,) = [change for change in three_records.repeatability.changes if change.symbol == symbol]
    assert again.of == "instrument"
    assert again.at_least == 0.0
    alone = three_records.repeatability.each(symbol)
    assert len(alone) == 3
    for record in alone.values():
        assert record.low is not None
        assert record.high is not None
        assert size.low is not None
        assert size.high is not None
        assert record.low <= size.low <= size.high <= record.high


@pytest.mark.acceptance
def test_repeatability_of_the_days_parameters_is_surely_a_change(three_records):
    """Biases differ from day to day by design, scale factors do not."""
    repeatability = {change.symbol: change for change in three_records.repeatability.changes}
    assert min(repeatability[symbol].at_least for symbol in ("X16", "X17", "X18")) > 1e-3
    assert {repeatability[symbol].at_least for symbol in ("X4", "X5", "X9", "X10", "X14", "X15")} == {0.0}


@pytest.mark.acceptance
def test_what_was_found_in_one_record_helps_on_the_others_by_the_fmus_and_a_runs_own_does_not(three_records):
    """A record's errors with its own effect are noise; with another day's own effect they are not."""
    rms = {gain.record: {entry.found_in: entry.rms for entry in gain.applied} for gain in three_records.cross_gain}
    assert {gain.unit for gain in three_records.cross_gain} == {"g"}
    for gain in three_records.cross_gain:
        assert rms[gain.record][gain.record] < SIGMA < gain.rms
    # Only the second has a cubic term besides.
    assert rms["record-1"]["record-3"] < SIGMA < rms["record-1"]["record-2"]
    assert rms["record-2"]["record-1"] > SIGMA
    helps = {(entry.found_in, entry.effect): entry.on for entry in three_records.helps}
    assert helps["record-1", QUADRATIC.title] == ("record-2", "record-3")
    assert helps["record-2", CUBIC.title] == ()
    assert "Cubic accelerometer-1, found in record-2: improves no other record: it belongs to this run" in str(
        three_records
    )


def judged(monkeypatch, records) -> Any:
    """Judge records together, without simulation."""
    monkeypatch.setattr(several, "cross_gains", lambda _: ((), ()))
    return several.diagnosed_together(
        {f"record-{k}": procedure.diagnose(r, noise_bound=SIGMA, rerun=False) for k, r in enumerate(records, start=1)}
    )


@pytest.mark.acceptance
def test_what_is_sought_in_one_record_alone_stays_a_rival_of_what_is_sought_in_all(monkeypatch):
    """The true step is not sought in several records: the record that shows it has it among its own sets.

    An effect that only contains one of these, as a lag contains the temperature itself, is not a rival.
    """
    step = EffectPlace("bias-step", "accelerometer-2")
    records = of_one_instrument(33, 2, positions=16, own={1: [(step, (3e-5, 0.009))]})
    result = judged(monkeypatch, records)
    assert "bias-step" in result.not_searched
    sets = [[cause.title for cause in causes] for causes in result.sets]
    assert result.verdict == "ambiguous"
    assert ["bias-step accelerometer-2 in record-2"] in sets
    assert not any("thermal-lag" in title or "warm-up" in title for titles in sets for title in titles)
    assert result.runs["record-1"] == "no"


@pytest.mark.acceptance
def test_what_is_sought_in_one_record_alone_is_a_rival_beside_what_is_sought_in_all(monkeypatch):
    """The second record alone needs the step and the common term; together, the step is one of two, not three."""
    step = EffectPlace("bias-step", "accelerometer-2")
    result = judged(monkeypatch, days_of_a_suite(33, 3, (step, (3e-5, 0.009)), [(QUADRATIC, (4e-4,))]))
    sets = [{cause.title for cause in causes} for causes in result.sets]
    assert {len(titles) for titles in sets} == {2}
    assert {"bias-step accelerometer-2 in record-2", QUADRATIC.title} in sets
    assert result.runs["record-2"] == "open"


@pytest.mark.acceptance
def test_a_step_that_only_the_others_show_is_not_taken_for_what_is_sought_in_all(monkeypatch):
    """The second record alone falsifies nothing, so its step was never sought: no single cause is named."""
    step = EffectPlace("bias-step", "accelerometer-2")
    records = days_of_a_suite(32, 2, (step, (3e-5, 0.009)))
    result = judged(monkeypatch, records)
    assert {entry.diagnosis.verdict for entry in result.records} == {"consistent"}
    assert result.verdict == "ambiguous"
    assert any(text.startswith("record-2: nothing falsifies it by itself") for text in result.caution)


def test_a_name_that_no_parameter_has_is_refused_before_any_diagnosis(monkeypatch):
    def unwanted(*_: object, **__: object) -> None:
        raise AssertionError("a record was diagnosed")

    monkeypatch.setattr(procedure, "diagnosed", unwanted)
    records = of_one_instrument(21, 2, positions=20)
    with pytest.raises(InputError, match=r"^own X99: no parameter of these records"):
        together(*records, noise_bound=SIGMA, own=["X99"])


@pytest.mark.acceptance
def test_records_without_a_secret_need_nothing():
    clean = together(*of_one_instrument(21, positions=20), noise_bound=SIGMA)
    assert clean.verdict == "consistent"
    assert clean.causes == ()
    assert clean.radius is not None
    assert clean.radius < 1.0
    assert len(clean.stated.parameters) == 9
    assert clean.cross_gain == ()


@pytest.mark.acceptance
def test_three_that_are_each_insufficient_end_together_in_a_verdict():
    """Six positions do not determine eighteen parameters; three days of six determine the shared nine and their own."""
    clean = together(*of_one_instrument(18, positions=6), noise_bound=SIGMA)
    wrong = together(*of_one_instrument(18, positions=6, shared=[(QUADRATIC, (3e-3,))]), noise_bound=SIGMA)
    for result in (clean, wrong):
        assert {entry.diagnosis.verdict for entry in result.records} == {"insufficient"}
        assert "each by itself is insufficient, together they are not" in str(result)
    assert clean.verdict == "consistent"
    assert wrong.verdict == "explained"
    assert [cause.title for cause in wrong.causes] == [QUADRATIC.title]


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("seed", "place", "values"),
    [
        (19, EffectPlace("cross-product", "accelerometer-3", None, (1, 2)), (2e-3,)),
        (20, EffectPlace("encoder-harmonic", "outer-axis", 2), (2e-3, 0.4)),
    ],
)
def test_three_that_are_each_insufficient_name_what_all_of_them_have(monkeypatch, seed, place, values):
    result = judged(monkeypatch, of_one_instrument(seed, positions=6, shared=[(place, values)]))
    assert {entry.diagnosis.verdict for entry in result.records} == {"insufficient"}
    assert (result.verdict, [cause.title for cause in result.causes]) == ("explained", [place.title])


@pytest.mark.acceptance
def test_where_a_record_by_itself_needs_less_than_together_what_is_not_sought_was_not_tried_beside_it(monkeypatch):
    """Seven positions determine one effect at a time; the second record's own effect always belongs to that run."""
    of_record = {1: [(CUBIC, (3e-3,))]}
    result = judged(monkeypatch, of_one_instrument(23, positions=7, shared=[(QUADRATIC, (3e-3,))], own=of_record))
    assert result.verdict == "ambiguous"
    assert {cause.title for cause in result.sets[0]} == {QUADRATIC.title, f"{CUBIC.title} in record-2"}
    assert any(text.startswith("record-2: fewer effects mend it by itself") for text in result.caution)
    assert (result.instrument, result.runs["record-2"]) == ("open", "yes")


def test_too_few_positions_stay_insufficient_whatever_they_would_fit():
    few = together(*of_one_instrument(16, positions=4), noise_bound=SIGMA)
    assert few.verdict == "insufficient"
    assert "X4" in few.missing


@pytest.mark.acceptance
def test_a_scale_factor_that_changed_is_said_to_differ_and_not_to_be_an_effect():
    rng = np.random.default_rng(4)
    benches = [random_bench(rng)] * 3
    benches[2] = benches[2] + 0.0
    # Scale factors of the first accelerometer, both signs.
    benches[2][[9, 12]] += 3e-4
    records = [simulated(bench, noise=rng.uniform(-SIGMA, SIGMA, (24, 3))) for bench in benches]
    result = together(*records, noise_bound=SIGMA)
    assert result.verdict in ("explained", "ambiguous")
    assert result.runs["record-3"] == "yes"
    assert result.instrument == "no"
    repeatability = {change.symbol: change for change in result.repeatability.changes}
    assert repeatability["X4"].at_least == pytest.approx(3e-4, abs=1e-4)


@pytest.mark.acceptance
def test_a_bias_that_is_shared_by_request_and_changed_is_said_to_differ(monkeypatch):
    """Its signature is constant: only other accelerometers show its place."""
    monkeypatch.setattr(several, "cross_gains", lambda _: ((), ()))
    result = together(*of_one_instrument(21, 2, positions=20), noise_bound=SIGMA, shared=["bias-1"])
    sets = result.sets
    assert [[(cause.where, cause.is_of_instrument) for cause in causes] for causes in sets] == [[("X16", False)]]


@pytest.mark.acceptance
def test_where_more_than_three_must_differ_that_is_said_of_each_and_nothing_is_named(monkeypatch):
    """A block was dropped before the third day: scale factors of two accelerometers, both signs."""
    rng = np.random.default_rng(4)
    benches = [random_bench(rng)] * 3
    benches[2] = benches[2] + 0.0
    benches[2][[9, 10, 12, 13]] += 3e-4
    result = judged(monkeypatch, [simulated(bench, noise=rng.uniform(-SIGMA, SIGMA, (24, 3))) for bench in benches])
    assert (result.verdict, result.causes) == ("unexplained", ())
    assert "more of these are needed, or what is not sought" in result.not_named[0]
    assert result.not_named[1:] == (
        "with X4, X5, X9, X10 of record-3 its own all stand, and if nothing else acts each of them must differ",
    )


@pytest.mark.acceptance
def test_a_record_that_nothing_mends_is_left_out_and_said():
    records = of_one_instrument(21, positions=20)
    rng = np.random.default_rng(0)
    broken = records[1].specific_force + 0.02 * rng.normal(size=records[1].specific_force.shape)
    records[1] = replace(records[1], specific_force=broken)
    result = together(*records, noise_bound=SIGMA)
    assert result.judged == ("record-1", "record-3")
    assert (result.records[1].left_out or "").startswith("unexplained by itself: ")
    assert str(result).splitlines()[0].endswith("; not judged with the others: record-2.")
    assert result.verdict == "consistent"


@pytest.mark.acceptance
def test_a_record_that_shows_no_size_of_what_would_mend_it_is_judged_with_the_others(monkeypatch):
    records = of_one_instrument(5, shared=[(QUADRATIC, (4e-4,))])[:2]
    with monkeypatch.context() as patch:
        patch.setattr(Finding, "acts", property(lambda _: False))
        first = procedure.diagnose(records[0], noise_bound=SIGMA, rerun=False)
    assert first.verdict == "unexplained"
    monkeypatch.setattr(several, "cross_gains", lambda _: ((), ()))
    second = procedure.diagnose(records[1], noise_bound=SIGMA, rerun=False)
    result = several.diagnosed_together({"a": first, "b": second})
    assert result.judged == ("a", "b")
    assert [(cause.title, cause.is_of_instrument) for cause in result.causes] == [(QUADRATIC.title, True)]


def test_where_fewer_than_two_can_be_judged_the_first_line_says_that_and_not_that_nothing_is_wrong():
    """Each of them may well falsify the simulation alone."""
    alone = procedure.diagnose(of_one_instrument(21, 1, positions=20)[0], noise_bound=SIGMA, rerun=False)
    printed = str(several.diagnosed_together({"a": alone}, rerun=False)).splitlines()[0]
    assert printed == "Insufficient: nothing is said of all together, as fewer than two records can be judged so."


def test_files_are_called_by_their_names():
    assert labels_of([Path("a/monday.csv"), Path("tuesday.positions.csv")]) == ["monday", "tuesday"]
    assert labels_of([Path("a/run.csv"), Path("b/run.csv"), Path("c.csv")]) == ["run-1", "run-2", "c"]


@pytest.mark.acceptance
def test_the_command_takes_several_files_and_its_json_comes_back(tmp_path, capsys):
    names = ("monday", "tuesday")
    for name, record in zip(names, of_one_instrument(21, 2, positions=20), strict=True):
        write_record(record, tmp_path / f"{name}.csv")
    files = [str(tmp_path / f"{name}.csv") for name in names]
    out, page = tmp_path / "several.json", tmp_path / "several.html"
    assert main(["diagnose", *files, "--noise-bound", "1e-5", "--json", str(out), "--report", str(page)]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith("Consistent: one value of each instrument parameter fits all records")
    assert re.search(r"^monday +consistent$", printed, re.MULTILINE)
    again = Diagnosis.model_validate_json(out.read_text(encoding="utf-8"))
    assert again.to_json() == json.loads(out.read_text(encoding="utf-8"))
    assert check(out).summary == ("2 records, consistent",)
    shown_page = page.read_text(encoding="utf-8")
    assert "Changes" in shown_page
    assert "Each parameter in each record" in shown_page
    assert "<svg " in shown_page
    for wrong, why in (
        ([files[0], files[0]], "is record 1 too"),
        ([files[0], "--shared", "X16"], "--shared X16: is of several records of one instrument"),
        ([*files, "--export", str(tmp_path / "out")], "is of one record"),
        ([*files, "--hypothesis", "f2 += c*n1"], "--hypothesis: is of one record"),
        ([*files, "--own", "X99"], "--own X99: no parameter of these records"),
    ):
        assert main(["diagnose", *wrong, "--noise-bound", "1e-5"]) == 2
        assert why in capsys.readouterr().err


@pytest.mark.acceptance
def test_what_the_true_attitude_errs_by_is_stated_for_all_records(monkeypatch):
    """Two days of one block without a secret: each is judged by the wider bounds, and so are both together."""
    monkeypatch.setattr(several, "cross_gains", lambda _: ((), ()))
    records = []
    for k in range(2):
        block = draw_clean_block(77, k, "truth").instrument
        records.append(replace(block, temperature=None).measured(7, k))
    result = together(*records, reference_bound=1.0)
    assert [entry.diagnosis.reference_bound_arcmin for entry in result.records] == [1.0, 1.0]
    assert all((entry.diagnosis.noise_bound_arcmin or 0.0) > 2.0 for entry in result.records)
    assert (result.verdict, result.causes) == ("consistent", ())


def test_a_bound_of_the_true_attitude_is_refused_of_records_of_a_table():
    with pytest.raises(InputError, match="reference_bound 1: is of a strapdown record"):
        together(*of_one_instrument(21, 2, positions=20), reference_bound=1.0)


@pytest.mark.acceptance
def test_records_of_a_table_and_by_hand_are_judged_together():
    """By hand alone the term of the second accelerometer is ambiguous; with the table it is the instrument's."""
    result = together(*at_a_table_and_by_hand(3, [(QUADRATIC, (2e-3,))]), noise_bound=SIGMA, baseline="symmetric")
    assert [entry.diagnosis.verdict for entry in result.records] == ["explained", "ambiguous"]
    assert result.verdict == "explained"
    assert [(cause.title, cause.is_of_instrument) for cause in result.causes] == [(QUADRATIC.title, True)]
    assert {gain.unit for gain in result.cross_gain} == {"g", "arcmin"}


@pytest.mark.acceptance
def test_options_of_one_kind_are_for_records_of_that_kind_and_refused_where_there_are_none():
    table, hand = of_one_instrument(21, 1, positions=20)[0], draw_clean_block(77, 0, "gravity").instrument
    by_label = {"table": table, "hand": replace(hand, temperature=None).measured(7, 0)}
    options = {"noise_bound": SIGMA, "baseline": "symmetric", "rates": "averaged"}
    of_each = {label: evidence_options(run, among=by_label, **options) for label, run in by_label.items()}
    assert of_each["table"]["noise_bound"] == SIGMA
    assert of_each["table"]["baseline"] == "symmetric"
    assert "noise_bound" not in of_each["hand"]
    assert (of_each["hand"]["baseline"], of_each["hand"]["rates"]) == (None, "averaged")
    with pytest.raises(InputError, match="rates averaged: is of a strapdown record"):
        evidence_options(table, among={"table": table}, **options)
