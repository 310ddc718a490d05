"""What a result has to say, as blocks: verdict, figures, prose, tables, pictures, equations, files; and as text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..rounding import NONE, exactly

if TYPE_CHECKING:
    from polars import DataFrame

    from .notation import Cell

Tone = Literal["good", "attention", "neutral"]


@dataclass(frozen=True)
class Download:
    """A file that the page carries in itself."""

    name: str
    """under which it is saved"""
    text: str
    """its content"""
    shown: str
    """what the link says"""


@dataclass(frozen=True)
class Table:
    """A table of results."""

    header: Sequence[str]
    """names of the columns, with units"""
    rows: "Sequence[Sequence[Cell]]"
    """text as it stands, numbers that are no counts rounded by `trihedron.tools.rounding`, None as a dash"""
    caption: str = ""
    """what it shows"""

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, start=1):
            if len(row) != len(self.header):
                raise ValueError(f"row {number} has {len(row)} cells, the header {len(self.header)}")
            if any(isinstance(cell, float) for cell in row):
                raise TypeError(f"row {number} has a number that is not rounded: {row}")

    def told(self) -> "Table":
        """The same without the columns that say nothing: nothing in every row."""
        kept = [
            k for k in range(len(self.header)) if any(row[k] is not None and row[k] is not NONE for row in self.rows)
        ]
        return Table([self.header[k] for k in kept], [[row[k] for k in kept] for row in self.rows], self.caption)


@dataclass(frozen=True)
class Section:
    """A part of the page: prose, equations, then its picture, its table and the files that belong to it."""

    title: str
    paragraphs: Sequence[str] = ()
    """plain text; a single one may stand for itself"""
    svg: str | None = None
    """a picture, SVG"""
    caption: str = ""
    """of the picture"""
    table: Table | None = None
    files: Sequence[Path | str] = field(default=())
    """linked relative to the page's folder"""
    equations: Sequence[str] = ()
    """MathML of `trihedron.tools.document.notation`"""
    download: Download | None = None
    """a file that the page carries"""

    def __post_init__(self) -> None:
        if isinstance(self.paragraphs, str):
            object.__setattr__(self, "paragraphs", (self.paragraphs,))
        if self.svg is not None and not self.svg.startswith("<svg "):
            raise ValueError("svg is not a picture: it begins with '<svg '")
        if not all(equation.startswith("<math ") for equation in self.equations):
            raise ValueError("an equation is not MathML: it begins with '<math '")


@dataclass(frozen=True)
class Page:
    """What stands on the page of a result."""

    title: str
    verdict: str
    """the sentence that a person who reads no more should have read"""
    sections: Sequence[Section]
    tone: Tone = "neutral"
    """colour of the rule beside the verdict"""
    key: Mapping[str, object] = field(default_factory=dict)
    """a few figures below the verdict"""
    provenance: Mapping[str, object] = field(default_factory=dict)
    """what the results rest on: versions, content hashes; no time of day, so that the page repeats"""
    sources: Sequence[str] = ()
    """where the methods that were used are published"""
    answer: int = 0
    """so many sections say the answer, and stand above the list of contents"""
    sheet: bool = False
    """one A4 page to sign: what is empty at its head, and in tables, is room to write"""
    zoom: bool = False
    """its pictures are lines over time, of which a stretch can be drawn out"""


@dataclass(frozen=True)
class Document:
    """What a result has to say."""

    lines: Sequence[str]
    """what a terminal shows; the first is the verdict"""
    table: "Callable[[], DataFrame | None]" = lambda: None
    """gives the table of the result, or None: a notebook shows it below the verdict"""
    page: Callable[[], Page] | None = None
    """gives what stands on its page, where it has one; pictures are drawn only then"""


MOST_ROWS = 40
"""Rows of a result's table that a notebook shows."""


def text(document: Document) -> str:
    """What a terminal shows."""
    return "\n".join(document.lines)


def notebook(document: Document) -> str:
    """What a notebook shows: the verdict, and the table where there is one (HTML)."""
    frame = document.table()
    said = f"<p><strong>{escape(document.lines[0])}</strong></p>" if document.lines else ""
    return f"<div>{said}{'' if frame is None else table_html(frame)}</div>"


def table_html(frame: "DataFrame") -> str:
    """A table as HTML; numbers with all their digits, empty where there is none."""
    head = "".join(f"<th>{escape(name)}</th>" for name in frame.columns)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(_cell(value))}</td>" for value in row) + "</tr>"
        for row in frame.head(MOST_ROWS).iter_rows()
    )
    left = frame.height - MOST_ROWS
    more = f"<p>... and {left} rows more</p>" if left > 0 else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


def _cell(value: object) -> str:
    if value is None:
        return ""
    return exactly(value) if isinstance(value, float) else str(value)
