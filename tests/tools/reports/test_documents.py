"""Documents of results: one walk over every kind; their figures are those of the results."""

import csv
import importlib
import io
import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from html import escape, unescape
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest

from page_text import MAKERS, WATCHED, bent, clean, few, html_of, page_of, shown, text_of
from shown_bounds import shown_too_well
from trihedron.models.effects import EffectPlace
from trihedron.tools.calibration import Calibration, calibrate
from trihedron.tools.diagnosis import compared_places, diagnose, likeness
from trihedron.tools.document import Page, Section, half_width, minus, text, typographic
from trihedron.tools.evidence import bench_evidence
from trihedron.tools.evidence.carried import OF_ACCELEROMETERS
from trihedron.tools.reports import PAGES, bench, calibration, diagnosis, evidence, inspection
from trihedron.tools.rounding import digits, residual, to_bound, upwards
from trihedron.tools.trials import NOISE_BOUND


def test_every_kind_of_result_has_the_function_that_makes_its_page():
    for module, maker in PAGES.values():
        assert callable(getattr(importlib.import_module(f"trihedron.tools.reports.{module}"), maker))


LONG = {"bench, explained, with its gain", "bench, ambiguous", "bench, unexplained", "block, ambiguous"}
"""Documents of diagnoses that take seconds."""
DOCUMENTS = [pytest.param(name, marks=pytest.mark.acceptance if name in LONG else []) for name in MAKERS]
MEASURED = ["Measurements"]
RANKED = ["Evidence: residual with each effect", "Evidence: similar effects"]
SECTIONS = {
    "calibration, consistent": ["Targets", "Levelling", "Residuals before and after", *MEASURED],
    "calibration, falsified": ["Targets", *MEASURED, "Evidence: the readings that prove it"],
    "calibration, insufficient": ["Where to measure next", *MEASURED],
    "bench, consistent": ["Residuals", *MEASURED, "Targets", "Excluded: effects of the accelerometers"],
    "bench, explained": ["The cause", "Residuals before and after", *MEASURED, "Residuals against the inputs",
                         "Targets, and what the effects do to them", *RANKED, "Left-out readings and permutation test"],
    "bench, explained, with its gain": ["The cause", "Gain on held-out data", *MEASURED, *RANKED],
    "bench, ambiguous": ["Causes that remain", *RANKED],
    "bench, unexplained": ["Targets", RANKED[0], "Dependence of the residual"],
    "bench, insufficient": ["Where to measure next", *MEASURED],
    "block, explained": ["The cause", "Gain on held-out data", "Errors before and after", *MEASURED,
                         "The block's own parameters", *RANKED, "Left-out readings and permutation test",
                         "Excluded: effects of the gyros"],
    "block, ambiguous": ["Causes that remain", "Next measurements", *MEASURED, "The block's own parameters"],
    "block, insufficient": MEASURED,
    "plan": ["Guaranteed errors"],
    "plans": ["Guaranteed errors"],
}  # fmt: skip
"""Sections of each page, in order; there may be others between them."""
SOURCES = {
    "calibration, consistent": "Golovan HiGHS",
    "calibration, falsified": "Golovan HiGHS Cheney",
    "bench, consistent": "Golovan HiGHS",
    "bench, explained": "Golovan HiGHS Cheney Lawson Björck Fisher Stone",
    "bench, explained, with its gain": "Golovan HiGHS Cheney Lawson Björck Fisher Stone Mock-up",
    "block, explained": "Groves Chelnokov HiGHS Lawson Fisher Stone Björck Allan Lötters Cheney Mock-up",
    "block, insufficient": "Allan",
    "plan": "Golovan HiGHS Gilmore",
}
"""The complete citations of each page."""
AUTHORS = {name for names in SOURCES.values() for name in names.split()} | {"Land,"}


def section(name: str, title: str) -> Section:
    (matches,) = (section for section in page_of(name).sections if section.title == title)
    return matches


def rows_of(name: str, title: str) -> list[dict[str, object]]:
    """Return the rows of a section's table, by the names of its columns."""
    table = section(name, title).table
    assert table is not None
    return [dict(zip(table.header, row, strict=True)) for row in table.rows]


def number(cell: object) -> float:
    return float(str(cell).replace("−", "-"))


def in_order(wanted: Sequence[str], matches: Sequence[str]) -> bool:
    rest = iter(matches)
    return all(name in rest for name in wanted)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_every_document_says(name):
    result, record = shown(name)
    page, html = page_of(name), text_of(name)
    assert text(page) == str(result) == repr(result)
    assert not any(re.search(r"(\]|below [0-9.e-]+) 1$|\bnan\b", line) for line in str(result).splitlines())
    assert f"<strong>{escape(page.verdict)}</strong>" in result._repr_html_()
    titles = [section.title for section in page.sections]
    assert shown_too_well(result.to_json(), WATCHED[name]) == []
    assert in_order(SECTIONS[name], titles), titles
    assert len(set(titles)) == len(titles)
    headings = [unescape(heading) for heading in re.findall(r"<h2>([^<]*)</h2>", html)]
    assert headings[-1 if not page.sources else -2] == "Sources"
    assert {"trihedron", "computed with"} <= set(page.provenance)
    assert str(getattr(record, "path", result).name) in page.title if record is not None else page.title
    if name in SOURCES:
        assert {author for author in AUTHORS if author in " ".join(page.sources)} == set(SOURCES[name].split())
    for part in page.sections:
        for equation in part.equations:
            ElementTree.fromstring(equation.replace("&nbsp;", " "))
        if part.picture is not None:
            ElementTree.fromstring(part.picture.svg())
            assert part.caption
        if part.table is not None:
            assert part.table.without_empty_columns() == part.table
            assert "1" not in [row.get("unit") for row in rows_of(name, part.title)]
    # The details follow the answer.
    if "<nav" in html:
        assert html[: html.index("<nav")].count("<h2>") == len(page.answer)
    addresses = re.findall(r'(?:href|src)="([^"]*)"', html)
    assert all(address.startswith(("#", "data:")) for address in addresses)
    ids = re.findall(r' id="([^"]*)"', html)
    assert len(ids) == len(set(ids))
    assert not re.search(r">\s*(nan|None)\s*<", html)


@pytest.mark.acceptance
@pytest.mark.parametrize("name", DOCUMENTS)
def test_numbers_of_tables_are_numbers_for_a_spreadsheet(name):
    with_unit = re.compile(r"[-−]?\d[\d.]*(·10[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)? ?(g|µg|rad|rad/s|m/s²|s|°|deg|arcsec|arcmin|%|σ)?")
    for tag, cell in re.findall(r"<td( class=[^>]*)?>([^<]*)</td>", text_of(name)):
        if "number" in tag:
            assert not cell or not math.isnan(float(cell))
        else:
            assert not with_unit.fullmatch(unescape(cell)), cell


@pytest.mark.acceptance
@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_page_says_nothing_twice(name):
    page = page_of(name)
    texts = [page.verdict, *page.warnings]
    for part in page.sections:
        texts += part.paragraphs
        texts += [part.caption] if part.caption else []
        texts += [part.table.caption] if part.table is not None and part.table.caption else []
    sentences = re.split(r"(?<=[.:;]) +(?=[A-Z])", " ".join(texts))
    twice = [sentence for sentence, count in Counter(sentences).items() if count > 1 and len(sentence) > 25]
    assert twice == []


def test_a_matrix_of_the_gyros_is_a_picture_and_no_list_in_the_headline():
    page = page_of("block, explained")
    assert len(re.findall(r"\d\.\d", page.verdict)) == 1
    assert "gyro 1 by axis 2" in page.verdict
    picture = section("block, explained", "The cause").picture
    assert picture is not None
    (axes,) = picture.figure().axes
    values = np.array([float(text.get_text().replace("−", "-")) for text in axes.texts[::2]])
    np.testing.assert_allclose(values, shown("block, explained")[0].causes[0].values, atol=6e-6)


@pytest.mark.acceptance
def test_a_page_repeats_to_the_byte():
    again = diagnose(few(4), noise_bound=NOISE_BOUND)
    assert html_of(diagnosis.diagnosis_page, again, few(4)) == text_of("bench, insufficient")


@pytest.mark.acceptance
def test_a_calibration_shows_each_target_in_its_table():
    result, _ = shown("calibration, consistent")
    page = text_of("calibration, consistent")
    assert f"within {residual(result.radius)} σ" in page
    row = next(e for e in result.parameters if e.symbol == "X4")
    assert minus(to_bound(row.estimate, half_width(row.low, row.high))) in page
    assert page.count('<svg class="bar"') == 18


def test_open_targets_are_said_and_the_positions_to_measure_are_carried():
    result, page = shown("calibration, insufficient")[0], text_of("calibration, insufficient")
    assert "do not determine any of the targets" in page
    assert f"Measure {len(result.next_positions)} more positions" in page_of("calibration, insufficient").verdict
    (carried,) = re.findall(r'href="data:text/csv;charset=utf-8,([^"]*)" download="next-positions.csv"', page)
    wanted = [(float(p["alpha_deg"]), float(p["beta_deg"])) for p in result.next_positions]
    matches = [(float(r["alpha_deg"]), float(r["beta_deg"])) for r in csv.DictReader(io.StringIO(unquote(carried)))]
    assert matches == wanted
    # The map and the list come first; a table of nothing is left out.
    assert page_of("calibration, insufficient").sections[0].picture is not None
    assert calibration.target_section(calibrate(few(3), noise_bound=NOISE_BOUND)).table is None


def test_a_falsified_calibration_shows_the_readings_that_prove_it_and_no_guarantees():
    result = shown("calibration, falsified")[0]
    rows = rows_of("calibration, falsified", "Evidence: the readings that prove it")
    assert len(rows) == len(result.witness)
    # At the Chebyshev centre the readings of the proof are all off by the radius.
    assert {abs(number(row["at best off by [σ]"])) for row in rows} == {round(result.radius, 2)}
    assert "guaranteed error" not in rows_of("calibration, falsified", "Targets")[0]


@pytest.mark.first(1)
@pytest.mark.parametrize(
    ("kind", "parameters"), [("bench, explained", 1), ("bench, explained, with its gain", 1), ("block, explained", 9)]
)
def test_a_cause_has_the_digits_that_its_interval_justifies_in_the_table_and_in_the_equation(kind, parameters):
    (cause,) = shown(kind)[0].causes
    rows = rows_of(kind, "The cause")
    assert len(rows) == len(cause.values) == parameters
    mathematics = "".join(section(kind, "The cause").equations)
    for row, value, (low, high) in zip(rows, cause.values, cause.intervals, strict=True):
        assert row["estimate"] == (written := to_bound(value, 0.5 * (high - low)))
        assert number(row["low"]) <= low
        assert number(row["high"]) >= high
        assert f"<mn>{written.lstrip('-')}</mn>" in mathematics


@pytest.mark.first(1)
@pytest.mark.parametrize("kind", ["bench, ambiguous", "block, ambiguous"])
def test_sets_that_remain_are_numbered_and_all_named(kind):
    result = shown(kind)[0]
    rows = rows_of(kind, "Causes that remain")
    count = [len(finding.causes) and sum(len(c.values) for c in finding.causes) for finding in result.findings]
    assert [row["set"] for row in rows] == [k for k, n in enumerate(count, start=1) for _ in range(n)]
    stated = " ".join(section(kind, "Causes that remain").paragraphs)
    for number_, finding in enumerate(result.findings, start=1):
        assert f"Set {number_}: {'; '.join(cause.sentence for cause in finding.causes)}." in stated
    assert "With the effect" not in text_of(kind)
    assert "with the first of the sets that remain" in page_of(kind).key


def test_figures_with_the_effects_are_said_to_be_of_the_first_set_that_remains():
    result, page = shown("bench, ambiguous")[0], text_of("bench, ambiguous")
    assert f"With the first of the sets that remain, {result.findings[0].title}, it leaves" in page
    assert typographic(result.findings[0].causes[0].sentence) in page


def test_the_second_witness_and_what_the_cause_does_to_the_calibration():
    result = shown("bench, explained")[0]
    rows = rows_of("bench, explained", "Targets, and what the effects do to them")
    assert len(rows) == 18
    assert {row["unit"] for row in rows} == {"", "rad", "g"}
    # A quadratic term imitates scale-factor errors of opposite signs.
    plus = {1: "X4", 2: "X9", 3: "X14"}[result.causes[0].place.index + 1]
    (moved,) = (number(row["moved by"]) for row in rows if row["target"] == plus)
    assert abs(moved) == pytest.approx(abs(result.causes[0].values[0]), rel=0.3)
    left_out = rows_of("bench, explained", "Left-out readings and permutation test")
    assert [row["left out"] for row in left_out] == ["every fifth position", "every quarter of the time"]
    assert "seed of the shuffles" in page_of("bench, explained").provenance


@pytest.mark.acceptance
def test_the_gain_is_that_of_the_result():
    for kind in ("bench, explained, with its gain", "block, explained"):
        gain, (row, *_) = shown(kind)[0].gain, rows_of(kind, "Gain on held-out data")
        after = next(value for name, value in row.items() if name.startswith("rms after"))
        assert number(after) == pytest.approx(gain.held_out_rms_after, rel=5e-3)


@pytest.mark.acceptance
def test_without_a_cause_it_is_said_what_the_residual_depends_on():
    result = shown("bench, unexplained")[0]
    first = result.residual_structure[0]
    assert (first["accelerometer"], first["on"]) == (1, "input")
    assert first["explained"] > 0.8
    assert 0.99 < first["explainable"] <= 1.0
    assert np.all([0.0 <= entry["explained"] <= 1.0 for entry in result.residual_structure])


@pytest.mark.parametrize(
    ("tried", "words"),
    [
        ([("cubic accelerometer-3", 1.2)], []),
        ([("sag inner-axis", 0.9)], ["One of them is not among the sets that remain"]),
        ([("sag inner-axis", 0.9), ("sag outer-axis", 1.0)], ["2 of them are not among the sets that remain"]),
    ],
)
def test_an_effect_that_mends_the_record_only_with_an_impossible_size_is_said_not_to_remain(tried, words):
    result = shown("bench, explained")[0]
    named = (result.causes[0].place.title, 0.5)
    ranked = evidence.ranking_section(result.model_copy(update={"tried": (named, *tried)}))
    assert ranked is not None
    assert [message.partition(":")[0] for message in ranked.paragraphs[1:]] == words


@pytest.mark.acceptance
def test_a_block_says_on_what_it_rests_and_what_is_missing():
    record = shown("block, explained")[0].evidence.reader.found.record
    below = text_of("block, explained").partition("Sources")[2]
    for fact in (record.sha256, "instantaneous", "9.80665 m/s²", "seed of the shuffles", "highspy"):
        assert fact in below
    message = unescape(text_of("block, insufficient"))
    assert "1 rest of" in message
    assert all(str(thing) in message for thing in shown("block, insufficient")[0].missing)
    ambiguous = shown("block, ambiguous")[0]
    assert "no interval is given" in section("block, ambiguous", "The block's own parameters").paragraphs[0]
    # One measurement that shows two effects is named once.
    assert ambiguous.next == (f"{OF_ACCELEROMETERS} (shows quadratic, scale-asymmetry)",)
    explained = shown("block, explained")[0]
    assert evidence.confusion_section(explained.model_copy(update={"tried": ()})) is None


@pytest.mark.parametrize(
    "options",
    [
        {"baseline": "symmetric"},
        {"convention": "A2", "targets": ("X4-X5", "X16-X17"), "priors": ("X16=1e-2", "bounds")},
    ],
    ids=["symmetric", "asked"],
)
def test_pages_of_other_options(options):
    page = without_pictures(calibrate(clean(), noise_bound=NOISE_BOUND, **options))
    assert all(expression.replace("-", "−") in page for expression in options.get("targets", ()))


@pytest.mark.acceptance
@pytest.mark.usefixtures("no_pictures")
def test_pages_of_several_mountings_whatever_they_are_called():
    half = len(clean()) // 2
    record = replace(clean(), mounting=("upright-1e5",) * half + ("elsewhere",) * (len(clean()) - half))
    mounting = {"upright-1e5": np.eye(3), "elsewhere": np.eye(3)}
    result = diagnose(record, noise_bound=NOISE_BOUND, mounting=mounting)
    for page in (
        without_pictures(result.evidence.model.calibration),
        html_of(diagnosis.diagnosis_page, result, record),
    ):
        assert "X8@upright-1e5" in page
        assert "X13@elsewhere" in page


def without_pictures(result: Calibration) -> str:
    """Return the targets of a calibration."""
    return html_of(Page, "t", "v", [calibration.target_section(result)])


@pytest.mark.acceptance
def test_warnings_of_the_record_are_on_the_page():
    warned = shown("calibration, falsified")[0].model_copy(update={"warnings": ["row 7 <b>looks</b> odd"]})
    page = html_of(calibration.calibration_page, warned, bent())
    assert "Warning: row 7 &lt;b&gt;looks&lt;/b&gt; odd." in page


def test_a_plan_shows_its_estimator_and_carries_its_positions():
    best, page = shown("plan")[0][0].optimum, text_of("plan")
    assert f"{upwards(best.cost, 7)} σ" in page
    assert all(f"<mn>{digits(abs(weight), 6)}</mn>" in page for weight in best.weights)
    assert 'download="X4.csv"' in page


def test_mountings_and_senses_go_into_the_list_of_positions():
    positions = [
        {"alpha_deg": 90.0, "beta_deg": 355.0, "mounting": "b"},
        {"alpha_deg": 1.5, "beta_deg": 0.0, "approach_alpha": -1},
    ]
    wanted = "position,alpha_deg,beta_deg,mounting,approach_alpha\n1,90.0,355.0,b,\n2,1.5,0.0,,-1\n"
    assert bench.next_positions_csv(positions) == wanted


@pytest.mark.parametrize(
    ("words", "given", "message"),
    [
        (inspection.own_words, "gyro gamma_11", "scale factor of gyro 1"),
        (inspection.own_words, "gyro gamma_12", "misalignment of gyro 1 towards axis 2"),
        (inspection.own_words, "accelerometer bias_3", "bias of accelerometer 3"),
        (inspection.own_words, "something else", "something else"),
        (evidence.gyro_parameter_words, "rate_2", ("rate", "2")),
        (evidence.gyro_parameter_words, "gamma_12", ("gamma, axis 2", "1")),
        (evidence.gyro_parameter_words, "coefficient_1_23", ("coefficient, axes 2 3", "1")),
        (evidence.gyro_parameter_words, "delay", ("delay", "")),
    ],
)
def test_parameters_are_in_words(words, given, message):
    assert words(given) == message


def test_likeness_is_one_for_members_of_a_class_and_small_for_strangers():
    places = [
        EffectPlace("sag", "outer-axis"),
        EffectPlace("encoder-harmonic", "outer-axis", 1),
        EffectPlace("bias-drift", "accelerometer-1"),
        EffectPlace("quadratic", "accelerometer-3"),
    ]
    alike = likeness(bench_evidence(clean(), noise_bound=NOISE_BOUND).rows, places)
    assert np.allclose(alike, alike.T)
    assert np.allclose(np.diag(alike), 1.0)
    assert alike[0, 1] > 1.0 - 1e-4
    assert alike[2, 3] < 0.5


def test_effects_that_are_compared_begin_with_those_that_were_found():
    explained = shown("block, explained")[0]
    ranked = [title for title, _ in explained.tried]
    compared = compared_places(explained.evidence.model.classes.places, [explained.findings[0].places], ranked)
    assert compared[0] == explained.causes[0].place
    assert np.diag(likeness(explained.evidence.rows, compared)) == pytest.approx(1.0)


@pytest.mark.parametrize("name", ["bench, explained", "bench, ambiguous", "bench, insufficient", "block, explained"])
def test_a_diagnosis_from_its_file_is_shown_without_its_record(name):
    result, _ = shown(name)
    again = type(result).model_validate_json(result.json_text())
    assert str(again).splitlines()[0] == f"{result.verdict.capitalize()}."
    assert again._repr_html_()
    for cause in result.best.causes if result.best is not None else ():
        assert cause.place.title in str(again)


def test_a_number_of_a_command_stays_as_it_is_typed():
    page = html_of(lambda: Page("t", "v", [Section("s", ["Give `--noise-bound 6.28e-05`: 6.28e-05 g."])]))
    assert "<code>--noise-bound 6.28e-05</code>: 6.28·10⁻⁵ g" in page
