"""What the page of a strapdown record says, and that its figures are those of the result."""

import re
from html import unescape
from xml.etree import ElementTree

import numpy as np
import pytest

from page_text import html_of
from strapdown_records import POSES, strapdown_record, true_motion
from trihedron.models.effects import STRAPDOWN_EFFECTS
from trihedron.tools.bounded.spaces import cosine, spaces_beyond
from trihedron.tools.diagnosis import Cause, diagnose
from trihedron.tools.diagnosis.search import compared_places, likeness
from trihedron.tools.document.numbers import to_bound
from trihedron.tools.evidence.carried import OF_ACCELEROMETERS
from trihedron.tools.reports.diagnosis import page as strapdown_page
from trihedron.tools.reports.diagnosis import sets_of, verdict_sentence
from trihedron.tools.reports.evidence import in_words, parameter_section
from trihedron.tools.reports.model import cause_lines, own_words
from trihedron.tools.trials.draw import Options, draw_case


@pytest.fixture(scope="module")
def explained():
    matrix = np.array([[0.0, 3e-3, 0.0], [0.0, 0.0, 0.0], [-2e-3, 0.0, 0.0]])
    return diagnose(strapdown_record(gyro_bias=np.array([0.01, -0.02, 0.005]), sensitivity=matrix, seed=3))


@pytest.fixture(scope="module")
def page(explained):
    return html_of(strapdown_page, explained)


@pytest.fixture(scope="module")
def ambiguous():
    found = diagnose(draw_case(Options(strapdown=True), 4, 4).measured())
    assert found.verdict == "ambiguous"
    return found


def cells_of(row: str) -> list[str]:
    """The cells of a row, as text."""
    cells = re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL)
    return [unescape(re.sub(r"<[^>]*>", "", cell)) for cell in cells]


def tables(text: str) -> list[tuple[list[str], list[list[str]]]]:
    """Header and rows of every table, as text."""
    found = []
    for table in re.findall(r"<table>(.*?)</table>", text, re.DOTALL):
        rows = [cells_of(row) for row in re.findall(r"<tr>(.*?)</tr>", table, re.DOTALL)]
        found.append((rows[0], rows[1:]))
    return found


def table_with(text: str, *header: str) -> list[dict[str, str]]:
    """The rows of the first table that has such columns."""
    for names, rows in tables(text):
        if set(header) <= set(names):
            return [dict(zip(names, row, strict=True)) for row in rows]
    raise AssertionError(f"no table has {header}")


def test_the_page_goes_from_the_record_to_the_cause_and_to_what_is_excluded(page):
    headings = re.findall(r"<h2>([^<]*)</h2>", page)
    order = [
        "What was measured",
        "What was simulated",
        "Errors before and after",
        "The cause",
        "The block's own parameters",
        "Evidence: which effect mends it",
        "Evidence: what could be taken for what",
        "The gain on what was not used",
        "Excluded: effects of the gyros",
        "What these results rest on",
        "Methods used, and where they are published",
    ]
    at = [[unescape(h) for h in headings].index(name) for name in order]
    assert at == sorted(at)


def test_what_has_no_unit_is_printed_without_one(page, ambiguous, explained):
    for text in (page, html_of(strapdown_page, ambiguous)):
        units = [row["unit"] for row in table_with(text, "parameter", "estimate", "unit")]
        assert units
        assert "1" not in units
        assert "rad/s/g2" not in text
    # Behind a number of a line that is printed there is no unit "1" either.
    lines = [line for found in (explained, ambiguous) for line in str(found).split("\n")]
    assert any(line.endswith("]") for line in str(ambiguous).split("\n"))
    assert not any(re.search(r"(\]|below [0-9.e-]+) 1$", line) for line in lines)


def test_the_cause_has_the_digits_that_its_interval_justifies_in_the_table_and_in_the_equation(page, explained):
    (cause,) = explained.causes
    rows = table_with(page, "effect", "parameter", "estimate", "low")
    assert len(rows) == len(cause.values) == 9
    mathematics = "".join(re.findall(r"<math.*?</math>", page))
    for row, value, (low, high) in zip(rows, cause.values, cause.intervals, strict=True):
        written = to_bound(value, 0.5 * (high - low))
        assert written is not None
        assert row["estimate"] == written.text
        assert float(row["low"].replace("−", "-")) <= low
        assert float(row["high"].replace("−", "-")) >= high
        assert f"<mn>{written.text.lstrip('−')}</mn>" in mathematics


def test_it_says_on_what_it_rests_and_cites_what_was_used(page, explained):
    record = explained.evidence.found.record
    below = page[page.index("What these results rest on") :]
    for fact in (record.sha256, "instantaneous", "9.80665 m/s²", "seed of the shuffles", "highspy", "trihedron"):
        assert fact in below
    for author in ("Groves", "Chelnokov", "Lawson", "Fisher", "Stone", "Björck", "Allan", "Lötters"):
        assert author in below
    assert "Golovan" not in below


def test_a_short_record_is_told_what_to_add_and_cites_nothing_that_was_not_used():
    found = diagnose(strapdown_record(true_motion(POSES[:1])))
    assert found.verdict == "insufficient"
    text = unescape(html_of(strapdown_page, found))
    assert "1 rests of" in text
    assert all(str(thing) in text for thing in found.missing or ())
    assert "Lawson" not in text
    assert "Groves" not in text


def test_sets_that_remain_are_numbered_and_all_named(ambiguous):
    text = html_of(strapdown_page, ambiguous)
    rows = table_with(text, "set", "effect")
    assert [row["set"] for row in rows] == [
        str(k + 1) for k, found in enumerate(sets_of(ambiguous)) for _ in found.causes
    ]
    for found in sets_of(ambiguous):
        assert found.title in verdict_sentence(ambiguous)
    assert "Causes that remain" in text
    assert "no interval is given" in parameter_section(ambiguous).paragraphs[0]


def test_one_measurement_that_shows_two_effects_is_named_once(ambiguous):
    (said,) = ambiguous.next
    assert said == f"{OF_ACCELEROMETERS} (shows quadratic, scale-asymmetry)"


def test_every_effect_on_gyros_and_attitude_computer_that_is_searched_has_a_formula():
    searched = [e for e in STRAPDOWN_EFFECTS.values() if e.variants is None]
    for effect in searched:
        place = effect.places[0]
        own = effect.at(place).parameters
        values = tuple(k + 0.25 for k, _ in enumerate(own, start=1))
        (line,) = cause_lines([Cause.found(place, (), values, [(v - 0.01, v + 0.01) for v in values])])
        said = "".join(ElementTree.fromstring(line.replace("&nbsp;", " ")).itertext())
        for value in values:
            assert f"{value:.3f}" in said, effect.name


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("gyro gamma_11", "scale factor of gyro 1"),
        ("gyro gamma_12", "misalignment of gyro 1 towards axis 2"),
        ("accelerometer bias_3", "bias of accelerometer 3"),
        ("something else", "something else"),
    ],
)
def test_parameters_are_in_words(name, words):
    assert own_words(name) == words


@pytest.mark.parametrize(
    ("parameter", "words"),
    [
        ("rate_2", ("rate", "2")),
        ("gamma_12", ("gamma, axis 2", "1")),
        ("coefficient_1_23", ("coefficient, axes 2 3", "1")),
        ("delay", ("delay", "")),
    ],
)
def test_excluded_parameters_have_a_column_for_each_gyro(parameter, words):
    assert in_words(parameter) == words


def test_likeness_is_the_cosine_between_spaces_less_what_is_imitated():
    e = np.eye(4)
    first, second = e[:, [0]] + e[:, [3]], e[:, [0]] + e[:, [1]] + 7.0 * e[:, [3]]
    spaces = spaces_beyond(e[:, [3]], [first, second, e[:, [3]]])
    alike = np.array([[cosine(a, b) for b in spaces] for a in spaces])
    assert alike == pytest.approx(np.array([[1.0, np.sqrt(0.5), 0.0], [np.sqrt(0.5), 1.0, 0.0], [0.0, 0.0, 0.0]]))


def test_effects_that_are_compared_begin_with_those_that_were_found(explained):
    ranked = [title for title, _ in explained.tried]
    compared = compared_places(explained.evidence.classes.places, [explained.findings[0].places], ranked)
    assert compared[0] == explained.causes[0].place
    assert np.diag(likeness(explained.evidence, compared)) == pytest.approx(1.0)
    untried = html_of(strapdown_page, explained.model_copy(update={"tried": ()}))
    assert "could be taken for what" not in untried
    assert "Björck" not in untried
