"""A page as one HTML file with its pictures in it, without the network; or as PDF, by a browser.

A page of lines over time has one small script, which enlarges a stretch. No other script can run, and the page is
readable without it. The browser is an installed one: Chromium, Chrome or Edge, without a window.
"""

import base64
import hashlib
import os
import re
import shutil
import subprocess
from collections.abc import Sequence
from functools import cache
from html import escape as escaped
from importlib import resources
from itertools import zip_longest
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING
from urllib.parse import quote

from markupsafe import Markup, escape

from ..errors import InputError
from ..files import ordinary_file, whole_file, write_text
from ..locks import own_folder
from ..rounding import Number, digits
from .blocks import Page, Section, Table
from .notation import Drawn, look, plain, typographic, written

if TYPE_CHECKING:
    from jinja2 import Template
    from polars import DataFrame


FEW = 4
"""Number of sections above which a page has a table of contents."""


def html(page: Page, folder: Path | None = None) -> str:
    """Return a page as complete HTML; any content of its texts is shown and never run.

    Files are shown and linked relative to the page's folder.
    """
    return _template().render(page=page, folder=folder, few=FEW, style=_text("page.css"), zoom=_text("zoom.js"))


def write_page(path: Path, page: Page) -> None:
    """Write a page as HTML, or as PDF if the name ends so; whole or not at all.

    Raises
    ------
    InputError
        if the file cannot be written, or the page cannot be printed
    """
    write_html(path, html(page))


def _prose(text: str) -> Markup:
    """Return a paragraph; text between backquotes is code."""
    parts = plain(text).split("`")
    if len(parts) % 2 == 0:
        return escape(_said(text))
    # A number of a command stays as it is typed.
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else escape(typographic(part)) for k, part in enumerate(parts)
    )


def _text(name: str) -> str:
    return resources.files("trihedron.tools.document").joinpath(name).read_text(encoding="utf-8")


@cache
def _template() -> "Template":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    # This package makes pictures and equations and escapes every label: only they are inserted unchanged.
    environment.filters |= {"plain": plain, "said": _said, "prose": _prose, "cells": _cells, "linked": _linked}
    environment.filters |= {"quoted": quote, "hashed": _hashed}
    return environment.from_string(_text("page.html"))


def _hashed(script: str) -> str:
    """Return the hash of the one script that may run in a page."""
    return "sha256-" + base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()


def _said(text: object) -> str:
    return typographic(plain(text))


def _cells(table: Table) -> tuple[list[tuple[str, str]], list[tuple[str, ...]]]:
    """Return the class and the heading of each column, and the rows as texts."""
    heads, columns = [], []
    for k, name in enumerate(table.header):
        column = [row[k] for row in table.rows]
        heading, texts = written(name, column)
        heads.append((look(column), plain(heading)))
        columns.append(texts)
    return heads, list(zip(*columns, strict=True))


def _linked(file: Path | str, folder: Path | None) -> tuple[str, str]:
    """Return the shown name of a file, and its address."""
    shown = Path(file)
    if folder is not None:
        try:
            shown = Path(os.path.relpath(shown, folder))
        except ValueError:
            # Another drive: there is no relative path.
            shown = shown.absolute()
    address = shown.as_uri() if shown.is_absolute() else "./" + quote(shown.as_posix(), safe="/", errors="replace")
    return plain(shown.as_posix()), address


CONVERTERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome", "msedge")
"""Programs that print a page to PDF; the first one found is used."""

SECONDS = 120.0
OPTIONS = (
    "--headless",
    "--disable-gpu",
    "--disable-extensions",
    "--disable-background-networking",
    "--no-first-run",
    "--no-pdf-header-footer",
)


def converter() -> str | None:
    """Return the program that makes PDF on this machine; None if there is none."""
    return next((path for name in CONVERTERS if (path := shutil.which(name))), None)


def report_file(path: Path, option: str = "--report") -> None:
    """Check the name of a page before any computation.

    Raises
    ------
    InputError
        for a device or a pipe, for another ending than .html or .pdf, and for .pdf without a program that makes it
    """
    ordinary_file(None, path)
    if path.suffix.lower() not in (".html", ".htm", ".pdf"):
        raise InputError(f"{option} {path}: a page is .html or .pdf; give a name that ends so")
    if path.suffix.lower() == ".pdf" and converter() is None:
        raise InputError(
            f"{option} {path}: no program here makes PDF (Chromium, Chrome or Edge); give a name in .html and print it"
        )


def write_html(path: Path, page: str) -> None:
    """Write a page as HTML, or as PDF if the name ends so; whole or not at all.

    Raises
    ------
    InputError
        if the file cannot be written, or the page cannot be printed
    """
    if path.suffix.lower() != ".pdf":
        write_text(path, page)
        return
    program = converter()
    if program is None:
        report_file(path)
        return
    with own_folder() as folder, whole_file(path) as unfinished:
        source, printed = folder / "page.html", folder / "page.pdf"
        source.write_text(page, encoding="utf-8", newline="\n")
        _print(program, source, printed, path)
        unfinished.write_bytes(repeatable(printed.read_bytes()))


def _print(program: str, source: Path, printed: Path, path: Path) -> None:
    command = [program, *OPTIONS, f"--user-data-dir={source.parent / 'profile'}", f"--print-to-pdf={printed}"]
    if hasattr(os, "geteuid") and os.geteuid() == 0:
        # A browser refuses its sandbox for the superuser; the page is our own.
        command.append("--no-sandbox")
    try:
        process = subprocess.run(
            [*command, source.as_uri()], capture_output=True, timeout=SECONDS, stdin=subprocess.DEVNULL, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(f"{path}: {Path(program).name} did not print it; give a name in .html") from error
    if process.returncode != 0 or not printed.is_file() or not printed.read_bytes().startswith(b"%PDF"):
        raise InputError(f"{path}: {Path(program).name} did not print it; give a name in .html")


def repeatable(content: bytes) -> bytes:
    """Return a PDF with a fixed creation time and nodes counted from 1: the same page gives the same bytes."""
    names: dict[bytes, bytes] = {}

    def counted(match: re.Match[bytes]) -> bytes:
        return names.setdefault(match[0], b"node%08d" % (len(names) + 1))

    return re.sub(rb"\bnode\d{8}\b", counted, re.sub(rb"(?<=Date \(D:)\d{14}", b"20000101000000", content))


# A page at a terminal and in a notebook: its verdict, figures and first sections

MOST_ROWS = 40
"""Largest number of rows of a result's table in a notebook."""


def text(page: Page, width: int | None = None) -> str:
    """Return a page's text for a terminal: its verdict, figures, first sections and warnings.

    Tables are no wider than `width` characters, where one is given and their words allow it.
    """
    if page.screen:
        return "\n".join(page.screen)
    lines = [page.verdict]
    figures = []
    for name, value in page.key.items():
        figures.append(f"{name} {value}")
    if figures:
        lines.append("; ".join(figures))
    for section in page.answer:
        content = section_lines(section, width)
        if content and (section.table is not None or len(page.answer) > 1):
            lines += ["", section.title]
        lines += content
    for warning in page.warnings:
        lines.append(f"warning: {warning}")
    return "\n".join(lines)


def section_lines(section: Section, width: int | None = None) -> list[str]:
    """Return the paragraphs, the table and the files of a section as lines."""
    lines = list(section.paragraphs)
    if section.table is not None:
        lines += table_lines(section.table, width)
    for file in section.files:
        lines.append(str(file))
    return lines


def table_lines(table: Table, width: int | None = None) -> list[str]:
    """Return a table as lines of columns: numbers are right-aligned, small pictures are left out.

    In a table wider than `width` characters headings and texts take several lines.
    """
    columns, numeric = [], []
    for k, heading in enumerate(table.header):
        cells = [row[k] for row in table.rows]
        if not any(isinstance(cell, Drawn) for cell in cells):
            columns.append([heading, *("" if cell is None else str(cell).replace("−", "-") for cell in cells)])
            numeric.append(any(isinstance(cell, int | Number) for cell in cells))
    widths = _widths(columns, width)
    lines = []
    for row in zip(*columns, strict=True):
        parts = [_in_lines(cell, wide) for cell, wide in zip(row, widths, strict=True)]
        for line in zip_longest(*parts, fillvalue=""):
            aligned = []
            for part, wide, is_number in zip(line, widths, numeric, strict=True):
                aligned.append(part.rjust(wide) if is_number else part.ljust(wide))
            lines.append("  ".join(aligned).rstrip())
    return lines


def _in_lines(cell: str, width: int) -> list[str]:
    if len(cell) <= width:
        return [cell]
    return wrap(cell, width, break_long_words=False, break_on_hyphens=False)


def _widths(columns: Sequence[Sequence[str]], most: int | None) -> list[int]:
    """Return the widths of columns: those of their cells, the widest first made less until all fit, but no word cut."""
    widths = [max(map(len, cells)) for cells in columns]
    least = [max(len(word) for cell in cells for word in cell.split() or [""]) for cells in columns]
    while most is not None and sum(widths) + 2 * (len(widths) - 1) > most:
        spare = [wide - few for wide, few in zip(widths, least, strict=True)]
        if max(spare, default=0) == 0:
            break
        widths[spare.index(max(spare))] -= 1
    return widths


def notebook(page: Page, frame: "DataFrame | None") -> str:
    """Return a page for a notebook (HTML): the verdict and the tables of the answer, else the table of the result."""
    parts = [f"<p><strong>{escaped(page.verdict)}</strong></p>"]
    for section in page.answer:
        if section.table is not None:
            parts.append(f"<p>{escaped(section.title)}</p>{_rounded_html(section.table)}")
    if len(parts) == 1 and frame is not None:
        parts.append(table_html(frame))
    return f"<div>{''.join(parts)}</div>"


def _rounded_html(table: Table) -> str:
    """Return a table of a page as HTML, its numbers rounded, without small pictures."""
    shown = [k for k in range(len(table.header)) if not any(isinstance(row[k], Drawn) for row in table.rows)]
    rows = []
    for row in [table.header, *table.rows[:MOST_ROWS]]:
        texts = ["" if row[k] is None else escaped(str(row[k])) for k in shown]
        rows.append(texts)
    head = "".join(f"<th>{text}</th>" for text in rows[0])
    body = "".join(f"<tr><td>{'</td><td>'.join(texts)}</td></tr>" for texts in rows[1:])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def table_html(frame: "DataFrame") -> str:
    """Return a table as HTML; numbers rounded to six digits, empty for missing ones."""
    head = "".join(f"<th>{escaped(name)}</th>" for name in frame.columns)
    rows = []
    for values in frame.head(MOST_ROWS).iter_rows():
        cells = "".join(f"<td>{escaped(_short_text(value))}</td>" for value in values)
        rows.append(f"<tr>{cells}</tr>")
    further = frame.height - MOST_ROWS
    note = f"<p>... and {further} rows more</p>" if further > 0 else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>{note}"


def _short_text(value: object) -> str:
    if value is None:
        return ""
    return str(digits(value, 6)) if isinstance(value, float) else str(value)
