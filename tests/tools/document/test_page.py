"""The page of results: one file, no script, for any texts; and as PDF."""

import math
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from page_text import html_of
from shown_bounds import read_off_column
from trihedron.tools.cli import main
from trihedron.tools.document import Cell, Page, Picture, Section, Table, repeatable, write_html
from trihedron.tools.errors import InputError
from trihedron.tools.rounding import Number, digits, upwards

HOSTILE = "</p><script>alert(1)</script><img src=x onerror=alert(2)> {{ 7*7 }} & \x00 \ud800"
SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1 1"></svg>'
PICTURE = Picture(Figure, lambda: SVG)
VOID = {"meta", "br", "hr", "img", "link"}


class Reader(HTMLParser):
    """Checks that elements nest, and gathers tags, attributes and text."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str | None]] = []
        self.text: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_startendtag(tag, attrs)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += attrs

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text.append(data)


def read(text: str) -> Reader:
    reader = Reader()
    reader.feed(text)
    reader.close()
    assert reader.open == []
    return reader


def full_page() -> str:
    table = Table(
        ["symbol", "estimate", "position"],
        [
            ["X4", digits(-1.5e-4), 3],
            ["X5", None, 12],
            ["X6+X8", digits(math.nan), 7],
            ["X9", digits(-2.5e-15), 8],
        ],
        caption="Estimates",
    )
    return html_of(
        Page,
        "The bench",
        "All 18 true values lie inside their intervals.",
        [
            Section("Candidates", ["One effect explains the data."], PICTURE, "What is left."),
            Section("Again", [], PICTURE),
            Section("Estimates", table=table, files=[Path("/somewhere/out/run-1/run data.parquet")]),
        ],
        tone="good",
        provenance={"trihedron": "0.1.0", "record.csv": "0" * 64},
        folder=Path("/somewhere/out"),
    )


def test_the_page_is_whole_and_opens_without_script_and_network() -> None:
    page = full_page()
    assert page == full_page()
    reader = read(page)
    assert not {"script", "link"} & set(reader.tags)
    addresses = [value for name, value in reader.attributes if name in ("href", "src", "xlink:href")]
    assert all(address is not None and address.startswith(("./", "#")) for address in addresses)
    assert not any(name.startswith("on") for name, _ in reader.attributes)
    assert reader.tags.count("svg") == 2
    for text in ("default-src 'none'", "prefers-color-scheme: dark", "@media print", "<td>X4</td>"):
        assert text in page
    # Files are linked relative to the page.
    assert ("href", "./run-1/run%20data.parquet") in reader.attributes
    assert "run-1/run data.parquet" in reader.text
    assert "/somewhere" not in page
    # Numbers are right-aligned, over one power of ten, and a missing value is an empty cell.
    assert '<th scope="col" class="number">estimate [10⁻⁶]</th>' in page
    for number in ("-150", "-2.5e-9", "12"):
        assert f'<td class="number">{number}</td>' in page
    assert page.count('<td class="number"></td>') == 2


@pytest.mark.parametrize(
    ("cell", "written"),
    [
        (upwards(1.155361e-5), "12"),
        (digits(-0.00299948), "-0.00300"),
        (digits(float("-inf")), "-inf"),
        (-3, "-3"),
        (True, "yes"),
        (False, "no"),
        ("to-day", "to-day"),
    ],
)
def test_cells_are_written_for_people_and_for_spreadsheets(cell: Cell, written: str) -> None:
    page = html_of(Page, "t", "v", [Section("s", table=Table(["a"], [[cell]]))])
    assert re.findall(r"<td[^>]*>([^<]*)</td>", page) == [written]


COLUMNS = {
    ("a", "1.2e-3", "9.9e-6", "0"): ("a [10⁻³]", "1.2", "0.0099", "0"),
    ("a [g]", "7.4e-6", "1.25e-5", ""): ("a [10⁻⁶ g]", "7.4", "12.5", ""),
    ("a", "720.00", "1.4043e-5"): ("a", "720.00", "0.000014043"),
    ("a", "720.00", "1.4e-15"): ("a", "720.00", "1.4e-15"),
    ("a", "-0.0029992", "12"): ("a", "-0.0029992", "12"),
    ("a [s]", "2.5e9", "inf", "3e7"): ("a [10⁹ s]", "2.5", "inf", "0.03"),
}


@pytest.mark.parametrize("column", COLUMNS)
def test_a_column_has_one_power_of_ten_and_its_unit_in_the_head(column: tuple[str, ...]) -> None:
    heading, *cells = column
    page = html_of(
        Page, "t", "v", [Section("s", table=Table([heading], [[Number(cell)] for cell in cells], fixed=True))]
    )
    shown = re.findall(r'<t[hd][^>]*class="number">([^<]*)<', page)
    assert tuple(shown) == COLUMNS[column]
    assert read_off_column(*shown) == [float(cell) if cell else None for cell in cells]


def test_a_number_that_is_not_rounded_is_no_cell() -> None:
    for value in (3.541e-5, np.float64(0.5), math.nan):
        with pytest.raises(TypeError, match="not rounded"):
            Table(["a"], [[value]])  # type: ignore[list-item]


def test_hostile_texts_are_shown_and_never_run() -> None:
    section = Section(
        HOSTILE,
        [HOSTILE],
        PICTURE,
        HOSTILE,
        Table([HOSTILE], [[HOSTILE]], HOSTILE),
        [HOSTILE, "javascript:alert(1)", '" onclick="alert(1)'],
    )
    page = html_of(Page, HOSTILE, HOSTILE, [section], provenance={HOSTILE: HOSTILE})
    reader = read(page)
    assert "script" not in reader.tags
    assert "img" not in reader.tags
    assert not any(name.startswith("on") for name, _ in reader.attributes)
    assert "".join(reader.text).count("<script>alert(1)</script>") >= 8
    addresses = [value for name, value in reader.attributes if name == "href"]
    assert all(address is not None and address.startswith("./") for address in addresses)
    assert "{{ 7*7 }}" in page
    page.encode("utf-8")


def test_a_page_of_nothing_is_a_page_and_only_pictures_are_put_in_as_they_are() -> None:
    reader = read(html_of(Page, "Nothing", "Nothing was done.", []))
    assert "main" in reader.tags
    assert "footer" not in reader.tags
    with pytest.raises(ValueError, match="begins with '<math '"):
        Section("x", equations=["<b>x</b>"])


def test_a_table_is_whole_and_tells_only_columns_that_say_something() -> None:
    with pytest.raises(ValueError, match="row 2 has 1 cells, the header 2"):
        Table(["a", "b"], [[1, 2], [3]])
    assert Table(["a", "b", "c"], [[1, None, ""], [None, None, ""]], "d").without_empty_columns() == Table(
        ["a"], [[1], [None]], "d"
    )


def test_writing_the_page(tmp_path: Path) -> None:
    write_html(tmp_path / "new" / "page.html", full_page())
    assert (tmp_path / "new" / "page.html").read_text(encoding="utf-8") == full_page()
    with pytest.raises(InputError, match="is a directory"):
        write_html(tmp_path, full_page())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new"]


def test_without_a_converter_a_pdf_is_refused_before_anything_is_done(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("trihedron.tools.document.page.converter", lambda: None)
    assert main(["calibrate", "no-such-record.csv", "--report", str(tmp_path / "out.pdf")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no program here makes PDF" in line
    assert "out.pdf" in line
    assert list(tmp_path.iterdir()) == []


def test_a_converter_that_fails_leaves_nothing(tmp_path, monkeypatch):
    monkeypatch.setattr("trihedron.tools.document.page.converter", lambda: shutil.which("false"))
    with pytest.raises(InputError, match="false did not print it"):
        write_html(tmp_path / "out.pdf", "<!DOCTYPE html><title>t</title>")
    assert list(tmp_path.iterdir()) == []


def test_times_of_a_pdf_are_made_the_same():
    assert repeatable(b"/CreationDate (D:20261121054800+00'00')") == b"/CreationDate (D:20000101000000+00'00')"
    assert (
        repeatable(b"(node00000278) (node00000300) (node00000278)") == b"(node00000001) (node00000002) (node00000001)"
    )
