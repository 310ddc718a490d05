"""What a result has to say, as blocks: verdict, figures, prose, tables, pictures, equations, files; and as text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    from polars import DataFrame

    from .notation import Cell

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
    rows: "Sequence[Sequence[Cell]]"
    caption: str = ""

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, start=1):
            if len(row) != len(self.header):
                raise ValueError(f"row {number} has {len(row)} cells, the header {len(self.header)}")

    def told(self) -> "Table":
        """The same without the columns that say nothing: None in every row."""
        kept = [k for k in range(len(self.header)) if any(row[k] is not None for row in self.rows)]
        return Table([self.header[k] for k in kept], [[row[k] for k in kept] for row in self.rows], self.caption)


@dataclass(frozen=True)
class Section:
    """A part of the page: prose, equations, then its picture, its table and the files that belong to it.

    Attributes
    ----------
    title : str
    paragraphs : sequence of str
        plain text
    svg : str or None
        a picture, SVG
    caption : str
        of the picture
    table : Table or None
    files : sequence of Path
        linked relative to the page's folder
    equations : sequence of str
        MathML of `trihedron.tools.document.notation`
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
            raise ValueError("svg is not a picture: it begins with '<svg '")
        if not all(equation.startswith("<math ") for equation in self.equations):
            raise ValueError("an equation is not MathML: it begins with '<math '")


@dataclass(frozen=True)
class Page:
    """What stands on the page of a result.

    Attributes
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
    """

    title: str
    verdict: str
    sections: Sequence[Section]
    tone: Tone = "neutral"
    key: Mapping[str, object] = field(default_factory=dict)
    provenance: Mapping[str, object] = field(default_factory=dict)
    sources: Sequence[str] = ()


@dataclass(frozen=True)
class Document:
    """What a result has to say.

    Attributes
    ----------
    lines : sequence of str
        what a terminal shows; the first is the verdict
    table : callable
        gives the table of the result, or None: a notebook shows it below the verdict
    page : callable or None
        gives what stands on its page, where it has one; pictures are drawn only then
    """

    lines: Sequence[str]
    table: "Callable[[], DataFrame | None]" = lambda: None
    page: Callable[[], Page] | None = None


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
    """A table as HTML; numbers with seven digits, empty where there is none."""
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
    return f"{value:.7g}" if isinstance(value, float) else str(value)
