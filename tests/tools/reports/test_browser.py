"""The pages in a real browser: nothing overflows, nothing is missing, no complaints; and as PDF."""

import re
from pathlib import Path
from typing import Any

import pytest

from browser import Window
from command_table import make_inputs
from generator.positions import write_hidden_record
from page_text import text_of
from trihedron.tools import cli
from trihedron.tools.document import write_html

PAGES = (
    "calibration, consistent",
    "bench, explained, with its gain",
    "bench, ambiguous",
    "bench, unexplained",
    "bench, insufficient",
    "block, explained",
    "plans",
)


COMMANDS_WITH_PAGES = (
    "plan positions 6 --starts 1 --cuts 0 --out out-planned --report out-plan.html",
    "campaign kept.toml --jobs 1 --out out-campaign",
    "hidden --cases 3 --positions 14 16 --out out-suite",
    "diagnose clean.csv measured.csv again.csv --noise-bound 1e-5 --report out-several.html",
    "calibrate clean.csv again.csv --noise-bound 1e-5 --report out-calibrated.html",
    "instrument trend unit --report out-trend.html",
    "compare clean.csv measured.csv --report out-compared.html",
    "plot strapdown.csv out-lines.html",
    "inspect strapdown.csv --plot out-inspected.html",
    "simulate run.toml --out out-run --plot out-run.html",
    "attitude strapdown.csv --out out-attitude --plot out-attitude.html",
)
NARROW = 390
"""Width of a phone [px]; there each page is longer than a screen."""
PLAIN = ("out-calibrated.html",)
"""Pages that have only tables."""
KEPT = """schema = "trihedron.campaign/1"
[attitude]
duration_s = 2.0
[parameters]
bias_1_radps = { values = [1e-4, 2e-4] }
[keep]
record = true
"""
MARGIN: Any = dict.fromkeys(("top", "bottom", "left", "right"), "12mm")


@pytest.fixture(scope="module")
def pages(tmp_path_factory) -> dict[str, Path]:
    """Write pages with every possible element."""
    folder = tmp_path_factory.mktemp("pages")
    result = {name: folder / f"{name}.html" for name in PAGES}
    for name, file in result.items():
        file.write_text(text_of(name), encoding="utf-8")
    return result


def assert_fits(window: Window, name: str, page: Path) -> None:
    for width, dark, printed in ((1280, False, False), (NARROW, True, False), (1280, True, False), (720, False, True)):
        seen = window.open(page, width, dark=dark, printed=printed)
        where = f"{name} at {width}"
        assert seen["client"] == width, where
        assert seen["scroll"] == width, where
        assert seen["outside"] == [], where
        assert seen["images"] == [], where
        assert seen["pictures"] or name in PLAIN, where
        assert all(w > 5 and h > 5 for w, h in seen["pictures"]), where
        assert width > NARROW or seen["height"] > 900 or name in PLAIN, where


@pytest.mark.acceptance
def test_pages_fit_wide_and_narrow_light_and_dark_and_printed(pages, window: Window):
    for name, page in pages.items():
        assert_fits(window, name, page)
    assert window.complaints == []


@pytest.mark.acceptance
def test_pages_of_every_command_fit(window: Window, tmp_path, monkeypatch):
    make_inputs(tmp_path)
    (tmp_path / "kept.toml").write_text(KEPT, encoding="utf-8")
    write_hidden_record(tmp_path / "again.csv", 6)
    monkeypatch.chdir(tmp_path)
    for line in COMMANDS_WITH_PAGES:
        assert cli.main([*line.split(), "--quiet"]) == 0, line
    made = sorted(tmp_path.glob("out*.html")) + [
        tmp_path / f"out-{kind}" / "index.html" for kind in ("campaign", "suite")
    ]
    made.append(tmp_path / "out-planned" / "operator.html")
    for page in made:
        assert_fits(window, page.relative_to(tmp_path).as_posix(), page)
    assert len(made) >= len(COMMANDS_WITH_PAGES)
    assert window.complaints == []


@pytest.mark.acceptance
def test_printed_pages_are_not_half_empty(pages, window: Window):
    for size, most in (("A4", 54), ("Letter", 60)):
        sheets = 0
        for page in pages.values():
            window.open(page, 720, printed=True)
            sheets += len(re.findall(rb"/Type\s*/Page\b", window.page.pdf(format=size, margin=MARGIN)))
        # Without the rules of style for print they are 62 of A4 and more of Letter.
        assert sheets <= most, size


@pytest.mark.acceptance
def test_the_browser_does_complain_where_there_is_reason(pages, tmp_path, window: Window):
    page = pages["plans"].read_text(encoding="utf-8")
    page = page.replace("<main>", '<main><img src="missing.png" alt=""><p style="width: 2000px">wide</p>')
    page += "<img src='http://192.0.2.1/far.png' alt=''>"
    (tmp_path / "bad.html").write_text(page, encoding="utf-8")
    window.page.route("http://**", lambda route: route.abort())
    seen = window.open(tmp_path / "bad.html", 400)
    assert seen["scroll"] > 400
    assert seen["outside"]
    assert len(seen["images"]) == 2
    window.page.evaluate("setTimeout(() => { throw Error('thrown') })")
    window.page.wait_for_timeout(50)
    message = "\n".join(window.complaints)
    expected = ("missing.png", "thrown", "asks the network for http://192.0.2.1")
    assert [part for part in expected if part not in message] == []


@pytest.mark.acceptance
@pytest.mark.usefixtures("chromium")
def test_a_report_as_pdf_is_the_same_each_time(pages, tmp_path):
    for name in ("a.pdf", "b.PDF"):
        write_html(tmp_path / name, pages["bench, insufficient"].read_text(encoding="utf-8"))
    first, second = ((tmp_path / name).read_bytes() for name in ("a.pdf", "b.PDF"))
    assert first.startswith(b"%PDF")
    assert len(re.findall(rb"/Type\s*/Page\b", first)) >= 2
    assert first == second
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.pdf", "b.PDF"]
