"""The calibration sheet: operator and instrument, the guaranteed numbers, on one A4 page."""

import re
from dataclasses import replace

import pytest

import trihedron as th
from browser import Window
from page_text import clean, few, with_power
from trihedron.tools.document import html
from trihedron.tools.reports import read_about, sheet_page
from trihedron.tools.trials import NOISE_BOUND

SAID = {"Serial number": "AB-17", "operator": "of the record", "resolution_deg": "1e-6"}


@pytest.fixture(scope="module")
def calibration():
    return th.calibrate(replace(clean(), about=SAID), noise_bound=NOISE_BOUND)


def test_the_sheet_says_who_what_and_on_what_it_rests(calibration):
    page = sheet_page(calibration, calibration.made_of, {"operator": "A. Person", "temperature": "21.5"})
    assert page.key["serial number"] == "AB-17"
    assert page.key["operator"] == "A. Person"
    assert page.key["temperature"] == "21.5 °C"
    assert page.key["date"] == ""
    text = html(page)
    assert text.count("<td></td>") == 3, "room to sign"
    assert all(part in text for part in (calibration.provenance.sha256, "g, as given", "@page { size: A4"))
    assert text.count("<math") == 3


def test_errors_on_the_sheet_are_rounded_up_and_intervals_outwards(calibration):
    page = sheet_page(calibration, None, {})
    table = page.sections[0].table
    assert table is not None
    assert len(table.rows) == 18
    for row, e in zip(table.rows, calibration.parameters, strict=True):
        error, low, high = (float(str(row[k])) for k in (3, 4, 5))
        assert e.error_bound <= error <= 1.2 * e.error_bound
        assert low <= e.low <= e.estimate <= e.high <= high
        assert row[6] == {"1": "1"}.get(e.unit, e.unit)


def test_a_sheet_of_a_falsified_model_guarantees_no_number():
    falsified = th.calibrate(with_power(0, 1e-3, 2), noise_bound=NOISE_BOUND)
    text = html(sheet_page(falsified, None, {}))
    assert "No value is guaranteed" in text
    assert "<math" not in text
    assert "Falsified" in text


def test_a_sheet_of_too_few_positions_leaves_open_what_is_open():
    page = sheet_page(th.calibrate(few(4), noise_bound=NOISE_BOUND), None, {})
    assert page.sections[0].table is not None
    assert any(row[2] is None for row in page.sections[0].table.rows)
    assert "<math" not in html(page)


@pytest.mark.acceptance
def test_a_sheet_is_one_page_of_a4(calibration, window: Window, tmp_path):
    file = calibration.sheet(tmp_path / "sheet.html", about={"bench": "table 3"})
    seen = window.open(file, 400, dark=True)
    assert (seen["scroll"], seen["outside"]) == (400, [])
    window.open(file, 720, printed=True)
    printed = window.page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 1
    width, height = map(float, re.findall(rb"/MediaBox\s*\[0 0 ([\d.]+) ([\d.]+)\]", printed)[0])
    assert (round(width / 72 * 25.4), round(height / 72 * 25.4)) == (210, 297)
    assert window.complaints == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("operatr = 'A'", "operatr: unknown key; did you mean 'operator'"),
        ("operator = ['A', 'B']", "operator: a text, a number or a date"),
        ("operator = A", "is not TOML"),
    ],
)
def test_what_is_wrong_with_a_file_about_a_calibration(text, message, tmp_path):
    (tmp_path / "about.toml").write_text(text, encoding="utf-8")
    with pytest.raises(th.InputError, match=r"^--about .*about\.toml: ") as wrong:
        read_about(tmp_path / "about.toml")
    assert message in str(wrong.value)


def test_a_file_about_a_calibration_may_hold_dates_and_numbers(tmp_path):
    (tmp_path / "about.toml").write_text("date = 2026-11-23\ntemperature = 21.5\n", encoding="utf-8")
    assert read_about(tmp_path / "about.toml") == {"date": "2026-11-23", "temperature": "21.5"}
