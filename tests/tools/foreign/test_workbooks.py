"""Workbooks as laboratories write them, and dangerous ones."""

import io
import zipfile
from pathlib import Path

import pytest

from laboratory_imports import assert_clean, ideal_bench, import_proposed, imported_as_asked, refused, written
from trihedron.tools import cli
from trihedron.tools.foreign import workbook

pytest.importorskip("python_calamine", reason="python-calamine is not installed")
pytest.importorskip("xlsxwriter", reason="xlsxwriter is not installed")
pytest.importorskip("xlwt", reason="xlwt is not installed")

from laboratory_workbooks import ods, rows_of, workbook_files, xls, xlsb, xlsx

BENCH = ideal_bench(16, 10.0)
FILES = {file.name: file for file in workbook_files(BENCH)}
NAMES = ["No", "t [s]", "alpha [deg]", "beta [deg]", "ax [m/s2]", "ay [m/s2]", "az [m/s2]"]


@pytest.mark.parametrize("name", FILES)
def test_a_workbook_is_imported_or_asks_for_what_is_missing(name: str, tmp_path: Path):
    file = FILES[name]
    _, record = imported_as_asked(tmp_path, file)
    assert_clean(record, BENCH, file.rows, file.grain)


def test_check_and_diagnose_propose_the_import_of_a_workbook(tmp_path: Path, capsys):
    for suffix, make in ((".xlsx", xlsx), (".xls", xls), (".xlsb", xlsb), (".ods", ods)):
        path = written(tmp_path, make({"Data": [NAMES, *rows_of(BENCH)]}), f"lab{suffix}")
        assert "is a workbook" in import_proposed(path, capsys)


def changed(book: bytes, **parts: bytes | None) -> bytes:
    """Return a workbook with parts replaced, added or (None) left out: "xl__worksheets__sheet1.xml"."""
    members = {name.replace("__", "/"): content for name, content in parts.items()}
    packed = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(book)) as archive,
        zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as changed_book,
    ):
        for name in archive.namelist():
            if name not in members:
                changed_book.writestr(name, archive.read(name))
        for name, content in members.items():
            if content is not None:
                changed_book.writestr(name, content)
    return packed.getvalue()


GOOD = xlsx({"Data": [NAMES, *rows_of(BENCH)]})
SHEET = "xl__worksheets__sheet1.xml"
XML = zipfile.ZipFile(io.BytesIO(GOOD)).read(SHEET.replace("__", "/"))
FAR = XML.replace(b"</sheetData>", b'<row r="1048576"><c r="XFD1048576"><v>1</v></c></row></sheetData>')
LAUGHS = b'<!DOCTYPE l [<!ENTITY a "ha"><!ENTITY b "&a;&a;">]>' + XML.partition(b"?>")[2]
OPEN = ods({"Data": [NAMES, *rows_of(BENCH)]})
CONTENT = zipfile.ZipFile(io.BytesIO(OPEN)).read("content.xml")
BINARY = xlsb({"Data": [NAMES, *rows_of(BENCH)]})
FIRST = b"<table:table-row><table:table-cell"
MANY = b'<table:table-row table:number-rows-repeated="1000000"><table:table-cell table:number-columns-repeated="16384"'
OLD = xls({"Data": [NAMES, *rows_of(BENCH)]})
HOSTILE = {
    "a bomb": (changed(GOOD, **{SHEET: XML + b" " * 3_000_000}), "unpacks to more than"),
    "a cell far away": (changed(GOOD, **{SHEET: FAR}), "cells up to row 1048576 and column 16384"),
    "entities": (changed(GOOD, **{SHEET: LAUGHS}), "declares a DOCTYPE"),
    "a name that leaves": (changed(GOOD, **{"xl__worksheets__..__..__x.xml": b"x"}), "would leave the archive"),
    "no sheet": (changed(GOOD, **{SHEET: None}), "no sheet has rows"),
    "no list of sheets": (changed(GOOD, **{"xl__workbook.xml": b"<workbook"}), "not a readable"),
    "cut": (GOOD[: len(GOOD) // 2] + b"xl/workbook", "not a readable workbook"),
    "rows that repeat": (changed(OPEN, **{"content.xml": CONTENT.replace(FIRST, MANY, 1)}), "not a readable workbook"),
    "entities in an open one": (changed(OPEN, **{"content.xml": LAUGHS}), "declares a DOCTYPE"),
    "a binary one that is cut": (changed(BINARY, **{"xl__worksheets__sheet1.bin": b"\x81\x01"}), "no sheet has rows"),
    "an old one that is none": (OLD[:8] + bytes(2000), "not a readable workbook"),
    "an old one that is cut": (OLD[:3000], "not a readable"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_a_workbook_that_nobody_should_open_is_refused_in_one_line(name: str, tmp_path: Path, monkeypatch, capsys):
    monkeypatch.setattr(workbook, "MOST_BYTES", 2_000_000)
    content, message = HOSTILE[name]
    path = tmp_path / "lab.xlsx"
    path.write_bytes(content)
    assert cli.main(["import", str(path), "--out", str(tmp_path / "record.csv")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert message in err
    assert [file.name for file in tmp_path.iterdir()] == ["lab.xlsx"]


def test_a_part_that_unpacks_to_more_than_it_says_is_refused(tmp_path: Path):
    """An archive states its sizes itself; the actual size is checked."""
    size = len(XML).to_bytes(4, "little")
    short = (len(XML) // 2).to_bytes(4, "little")
    stored = changed(GOOD, **{SHEET: XML})
    assert stored.count(size) >= 2
    assert "is not a readable workbook" in refused(tmp_path, stored.replace(size, short))
