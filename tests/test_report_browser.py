"""The pages in a real browser: nothing overflows, nothing is missing, nothing is complained of; and as PDF."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from bench_cases import draw_case, measure
from browser import browser, browser_program
from page_text import html_of
from strapdown_records import strapdown_record
from trihedron.tools.calibration import calibrate
from trihedron.tools.cli import main
from trihedron.tools.diagnosis import diagnose
from trihedron.tools.document.pdf import without_times, write_html
from trihedron.tools.errors import InputError
from trihedron.tools.planning.plan import plan_targets
from trihedron.tools.reports.calibration import page as calibration_page
from trihedron.tools.reports.diagnosis import page as diagnosis_page
from trihedron.tools.reports.plan import plan_page
from trihedron.tools.trials.bench import NOISE_BOUND

PROGRAM = browser_program()
needs_browser = pytest.mark.skipif(PROGRAM is None, reason="no Chromium or Chrome on the path")


def records():
    """A clean record, and what becomes of it with an effect of each kind of verdict."""
    clean = measure(draw_case(5, effects=[]), 5)
    n = calibrate(clean, noise_bound=NOISE_BOUND).linearised.input
    g = 9.80665

    def changed(axis, added):
        record = clean.selected(np.arange(len(clean)))
        record.specific_force[:, axis] += g * added
        return record

    return {
        "consistent": clean,
        "explained": changed(2, 8e-4 * n[:, 2] ** 2),
        "ambiguous": changed(1, 1.5e-4 * n[:, 1] ** 3),
        "unexplained": changed(0, 5e-3 * n[:, 0] ** 5),
        "insufficient": clean.selected(np.arange(4)),
    }


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """A page for each verdict of the diagnosis, one of a calibration, one of a strapdown record, one of a plan."""
    folder = tmp_path_factory.mktemp("pages")
    texts = {}
    measured = records()
    for verdict, record in measured.items():
        result = diagnose(record, noise_bound=NOISE_BOUND, rerun=verdict == "explained")
        assert result.verdict == verdict
        texts[verdict] = html_of(diagnosis_page, result, record)
    run = measured["consistent"]
    texts["calibration"] = html_of(calibration_page, calibrate(run, noise_bound=NOISE_BOUND), run)
    drift = strapdown_record(drift=np.array([0.5, -0.4, 0.3]), seed=3)
    texts["strapdown"] = html_of(diagnosis_page, diagnose(drift))
    texts["plan"] = html_of(plan_page, plan_targets(("X4", "X6+X8"), grid=15.0))
    for name, text in texts.items():
        (folder / f"{name}.html").write_text(text, encoding="utf-8")
    return {name: folder / f"{name}.html" for name in texts}


@needs_browser
def test_pages_fit_wide_and_narrow_light_and_dark_and_printed(pages):
    assert PROGRAM is not None
    with browser(PROGRAM) as window:
        for name, page in pages.items():
            for width, dark, printed in (
                (1280, False, False),
                (400, True, False),
                (1280, True, False),
                (720, False, True),
            ):
                seen = window.open(page, width, dark=dark, printed=printed)
                where = f"{name} at {width}"
                assert seen["client"] == width, where
                assert seen["scroll"] == width, where
                assert seen["outside"] == [], where
                assert seen["images"] == [], where
                assert seen["pictures"], where
                assert all(w > 5 and h > 5 for w, h in seen["pictures"]), where
                assert seen["height"] > 900, where
        assert window.complaints == []


@needs_browser
def test_the_browser_does_complain_where_there_is_reason(pages, tmp_path):
    assert PROGRAM is not None
    page = pages["plan"].read_text(encoding="utf-8")
    page = page.replace("<main>", '<main><img src="missing.png" alt=""><p style="width: 2000px">wide</p>')
    (tmp_path / "bad.html").write_text(page, encoding="utf-8")
    with browser(PROGRAM) as window:
        seen = window.open(tmp_path / "bad.html", 400)
        assert seen["scroll"] > 400
        assert seen["outside"]
        assert len(seen["images"]) == 1
        assert window.complaints


@needs_browser
def test_a_report_as_pdf_is_the_same_each_time(pages, tmp_path):
    for name in ("a.pdf", "b.PDF"):
        write_html(tmp_path / name, pages["insufficient"].read_text(encoding="utf-8"))
    first, second = ((tmp_path / name).read_bytes() for name in ("a.pdf", "b.PDF"))
    assert first.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", first)) >= 2
    assert first == second
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.pdf", "b.PDF"]


def test_without_a_converter_a_pdf_is_refused_before_anything_is_done(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("trihedron.tools.document.pdf.converter", lambda: None)
    assert main(["calibrate", "no-such-record.csv", "--report", str(tmp_path / "out.pdf")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no program here makes PDF" in line
    assert "out.pdf" in line
    assert list(tmp_path.iterdir()) == []


def test_a_converter_that_fails_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("trihedron.tools.document.pdf.converter", lambda: shutil.which("false"))
    with pytest.raises(InputError, match="false did not print it"):
        write_html(tmp_path / "out.pdf", "<!DOCTYPE html><title>t</title>")
    assert list(tmp_path.iterdir()) == []


def test_times_of_a_pdf_are_made_the_same():
    assert without_times(b"/CreationDate (D:20261121054800+00'00')") == b"/CreationDate (D:20000101000000+00'00')"
