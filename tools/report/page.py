"""The page of results: one HTML file with its pictures in it, no script, nothing from the network."""

import math
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup

from trihedron.report.svg import plain
from trihedron.writing import whole_file

Cell = str | int | float | bool | None
DIGITS = 6
"""Significant digits of a number in a table."""

ALIKE = 1e3
"""The numbers of a column are written alike while the largest is at most so many times the smallest."""

Tone = Literal["good", "attention", "neutral"]


@dataclass(frozen=True)
class Table:
    """A table of results.

    Attributes
    ----------
    header : sequence of str
        names of the columns, with units
    rows : sequence of sequences
        text as it stands; numbers are set to six digits of the column's largest, None as a dash
    caption : str
        what it shows
    """

    header: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    caption: str = ""

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, start=1):
            if len(row) != len(self.header):
                raise ValueError(f"row {number} has {len(row)} cells, the header {len(self.header)}")


@dataclass(frozen=True)
class Section:
    """A part of the page: prose, then its picture, its table and the files that belong to it.

    Attributes
    ----------
    title : str
    paragraphs : sequence of str
        plain text
    svg : str or None
        a picture of `trihedron.report`
    caption : str
        of the picture
    table : Table or None
    files : sequence of Path
        linked relative to the page's folder
    """

    title: str
    paragraphs: Sequence[str] = ()
    svg: str | None = None
    caption: str = ""
    table: Table | None = None
    files: Sequence[Path | str] = field(default=())

    def __post_init__(self) -> None:
        if self.svg is not None and not self.svg.startswith("<svg "):
            raise ValueError("svg is not a picture of trihedron.report: it begins with '<svg '")


def render_page(
    title: str,
    verdict: str,
    sections: Sequence[Section],
    *,
    tone: Tone = "neutral",
    provenance: Mapping[str, object] | None = None,
    folder: Path | None = None,
) -> str:
    """The page as HTML text.

    Parameters
    ----------
    title : str
    verdict : str
        the sentence that a person who reads no more should have read
    sections : sequence of Section
    tone : "good", "attention" or "neutral"
        colour of the rule beside the verdict
    provenance : mapping
        what the results rest on: versions, content hashes; no time of day, so that the page repeats
    folder : Path or None
        where the page will stand: files are shown and linked relative to it

    Returns
    -------
    str
        HTML, complete; whatever the texts hold is shown and never run
    """
    shown = [
        {
            "title": plain(section.title),
            "paragraphs": [plain(text) for text in section.paragraphs],
            # Made by this package, which escapes every label.
            "svg": None if section.svg is None else Markup(section.svg),
            "caption": plain(section.caption),
            "table": None if section.table is None else _table(section.table),
            "files": [_link(file, folder) for file in section.files],
        }
        for section in sections
    ]
    return _template().render(
        title=plain(title),
        verdict=plain(verdict),
        tone=tone,
        sections=shown,
        provenance=[(plain(name), plain(value)) for name, value in (provenance or {}).items()],
        style=Markup(_text("page.css")),
    )


def write_page(path: Path, text: str) -> None:
    """Write a page, whole or not at all.

    Raises
    ------
    InputError
        when the file cannot be written
    """
    with whole_file(path) as beside:
        beside.write_text(text, encoding="utf-8", newline="\n")


def _text(name: str) -> str:
    return resources.files("trihedron.report").joinpath(name).read_text(encoding="utf-8")


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_text("page.html"))


def _table(table: Table) -> dict[str, object]:
    columns = [[row[k] for row in table.rows] for k in range(len(table.header))]
    written = [_written(column) for column in columns]
    return {
        "caption": plain(table.caption),
        "header": [plain(name) for name in table.header],
        "number": [
            any(map(_is_number, column)) and all(_is_number(cell) or cell is None for cell in column)
            for column in columns
        ],
        "rows": [list(row) for row in zip(*written, strict=True)],
    }


def _written(column: Sequence[Cell]) -> list[str]:
    """The cells of a column; numbers of one magnitude with the same number of decimals."""
    sizes = [abs(cell) for cell in column if isinstance(cell, float) and math.isfinite(cell) and cell != 0.0]
    form = f".{DIGITS}g"
    if sizes and max(sizes) <= ALIKE * min(sizes):
        most = math.floor(math.log10(max(sizes)))
        form = f".{max(DIGITS - 1 - most, 0)}f" if -3 <= most < DIGITS else f".{DIGITS - 1}e"
    return [_cell(cell, form) for cell in column]


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, int | float) and not isinstance(cell, bool)


def _cell(cell: Cell, form: str) -> str:
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, float):
        return re.sub(r"e([+-])0*(?=\d)", r"e\1", f"{cell:{form}}").replace("e+", "e").replace("-", "−")
    return str(cell).replace("-", "−") if isinstance(cell, int) else plain(cell)


def _link(file: Path | str, folder: Path | None) -> tuple[str, str]:
    """How a file is shown, and the address that leads to it."""
    shown = Path(file)
    if folder is not None:
        try:
            shown = Path(os.path.relpath(shown, folder))
        except ValueError:
            # Another drive: there is no relative path.
            shown = shown.absolute()
    address = shown.as_uri() if shown.is_absolute() else "./" + quote(shown.as_posix(), safe="/", errors="replace")
    return plain(shown.as_posix()), address
