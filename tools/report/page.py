"""The page of results: one HTML file with its pictures in it, no script, nothing from the network."""

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Literal
from urllib.parse import quote

from jinja2 import Environment, StrictUndefined, Template
from markupsafe import Markup, escape

from ..files import whole_file
from .cells import Cell, look, typeset, written
from .svg import plain

FEW = 4
"""A page of more sections has a table of contents."""

Tone = Literal["good", "attention", "neutral"]


@dataclass(frozen=True)
class Download:
    """A file that the page carries in itself.

    Attributes
    ----------
    name : str
        under which it is saved
    text : str
        its content
    shown : str
        what the link says
    """

    name: str
    text: str
    shown: str


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
    """A part of the page: prose, equations, then its picture, its table and the files that belong to it.

    Attributes
    ----------
    title : str
    paragraphs : sequence of str
        plain text
    svg : str or None
        a picture of `trihedron.tools.report`
    caption : str
        of the picture
    table : Table or None
    files : sequence of Path
        linked relative to the page's folder
    equations : sequence of str
        MathML of `trihedron.tools.report.equations`
    download : Download or None
        a file that the page carries
    """

    title: str
    paragraphs: Sequence[str] = ()
    svg: str | None = None
    caption: str = ""
    table: Table | None = None
    files: Sequence[Path | str] = field(default=())
    equations: Sequence[str] = ()
    download: Download | None = None

    def __post_init__(self) -> None:
        if self.svg is not None and not self.svg.startswith("<svg "):
            raise ValueError("svg is not a picture of trihedron.tools.report: it begins with '<svg '")
        if not all(equation.startswith("<math ") for equation in self.equations):
            raise ValueError("an equation is not of trihedron.tools.report.equations: it begins with '<math '")


def render_page(
    title: str,
    verdict: str,
    sections: Sequence[Section],
    *,
    tone: Tone = "neutral",
    key: Mapping[str, object] | None = None,
    provenance: Mapping[str, object] | None = None,
    sources: Sequence[str] = (),
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
    key : mapping
        a few figures below the verdict
    provenance : mapping
        what the results rest on: versions, content hashes; no time of day, so that the page repeats
    sources : sequence of str
        where the methods that were used are published
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
            "mark": f"part-{number}",
            "equations": [Markup(equation) for equation in section.equations],
            "download": None if section.download is None else _carried(section.download),
            "paragraphs": [_prose(text) for text in section.paragraphs],
            # Made by this package, which escapes every label.
            "svg": None if section.svg is None else Markup(section.svg),
            "caption": typeset(plain(section.caption)),
            "table": None if section.table is None else _table(section.table),
            "files": [_link(file, folder) for file in section.files],
        }
        for number, section in enumerate(sections, start=1)
    ]
    return _template().render(
        title=plain(title),
        verdict=typeset(plain(verdict)),
        tone=tone,
        sections=shown,
        contents=len(shown) > FEW,
        key=[(plain(name), typeset(plain(value))) for name, value in (key or {}).items()],
        sources=[plain(source) for source in sources],
        provenance=[(plain(name), plain(value)) for name, value in (provenance or {}).items()],
        style=Markup(_text("page.css")),
    )


def _prose(text: str) -> Markup:
    """A paragraph; what stands between backquotes is code."""
    parts = typeset(plain(text)).split("`")
    if len(parts) % 2 == 0:
        return escape("`".join(parts))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part) for k, part in enumerate(parts)
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
    return resources.files("trihedron.tools.report").joinpath(name).read_text(encoding="utf-8")


@cache
def _template() -> Template:
    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    return environment.from_string(_text("page.html"))


def _table(table: Table) -> dict[str, object]:
    columns = [[row[k] for row in table.rows] for k in range(len(table.header))]
    texts = [written(column) for column in columns]
    return {
        "caption": typeset(plain(table.caption)),
        "header": [plain(name) for name in table.header],
        "look": [look(column) for column in columns],
        "rows": [list(row) for row in zip(*texts, strict=True)],
    }


def _carried(file: Download) -> dict[str, str]:
    address = "data:text/csv;charset=utf-8," + quote(file.text)
    return {"name": plain(file.name), "shown": plain(file.shown), "address": address}


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
