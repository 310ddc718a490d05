"""Blocks of a result's page: verdict, figures, prose, tables, pictures, equations, files."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..quantity import cells_of, quantities_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pydantic import BaseModel

    from .notation import Cell

Tone = Literal["good", "attention", "neutral"]
Words = Mapping[str, Callable[[str], str | None]]
"""Field -> format of its text for people."""


@dataclass(frozen=True, eq=False)
class Picture:
    """A picture that is drawn at its first use."""

    figure: "Callable[[], Figure]"
    svg: Callable[[], str]
    """the same as an SVG element"""


@dataclass(frozen=True)
class Download:
    """A file inside the page."""

    name: str
    """name of the saved file"""
    text: str
    """its content"""
    shown: str
    """text of the link"""


@dataclass(frozen=True)
class Table:
    """A table of results."""

    header: Sequence[str]
    """names of the columns, with units"""
    rows: "Sequence[Sequence[Cell]]"
    """unchanged texts, numbers that are not counts rounded by `trihedron.tools.rounding`, None as a dash"""
    caption: str = ""
    """description"""
    fixed: bool = False
    """True to keep empty columns, as room to write"""

    def __post_init__(self) -> None:
        for number, row in enumerate(self.rows, start=1):
            if len(row) != len(self.header):
                raise ValueError(f"row {number} has {len(row)} cells, the header {len(self.header)}")
            if any(isinstance(cell, float) for cell in row):
                raise TypeError(f"row {number} has a number that is not rounded: {row}")

    def without_empty_columns(self) -> "Table":
        """Return the table without its empty columns."""
        header = []
        rows = [[] for _ in self.rows]
        for k, heading in enumerate(self.header):
            cells = [row[k] for row in self.rows]
            if all(cell is None or cell == "" for cell in cells):
                continue
            header.append(heading)
            for row, cell in zip(rows, cells, strict=True):
                row.append(cell)
        return Table(header, rows, self.caption)


def table_of(
    results: "Sequence[BaseModel]",
    names: Sequence[str],
    words: "Mapping[str, Callable[[str], str | None]] | None" = None,
) -> Table:
    """Return a table with a row for each result, all of one kind, and a column for each named field.

    The types of the fields give a column's head, its unit and the rounding of its numbers; `words` are the texts of
    some fields for people.
    """
    if not results:
        return Table([], [])
    quantities = quantities_of(type(results[0]))
    header = [quantities[name].heading for name in names]
    rows = []
    for result in results:
        cells = cells_of(result, names)
        for k, name in enumerate(names):
            if words and name in words:
                cells[k] = words[name](cells[k])
        rows.append(cells)
    return Table(header, rows)


@dataclass(frozen=True)
class Section:
    """A part of the page: prose, equations, then its picture, its table and its files.

    Empty columns of the table are left out, and so is a table without rows, unless it is fixed.
    """

    title: str
    paragraphs: Sequence[str] = ()
    """plain text; a single one may be given without a sequence"""
    picture: Picture | None = None
    caption: str = ""
    """caption of the picture"""
    table: Table | None = None
    files: Sequence[Path | str] = field(default=())
    """files, linked relative to the page's folder"""
    equations: Sequence[str] = ()
    """MathML of `trihedron.tools.document.notation`"""
    download: Download | None = None
    """a file inside the page"""

    def __post_init__(self) -> None:
        if isinstance(self.paragraphs, str):
            object.__setattr__(self, "paragraphs", (self.paragraphs,))
        table = self.table
        if table is not None and not table.fixed:
            object.__setattr__(self, "table", table.without_empty_columns() if table.rows else None)
        if not all(equation.startswith("<math ") for equation in self.equations):
            raise ValueError("an equation is not MathML: it begins with '<math '")

    @property
    def holds(self) -> bool:
        """Return True if it is not empty."""
        parts = (self.paragraphs, self.picture, self.table, self.files, self.equations, self.download)
        return any(parts)


def _no_sections() -> "Sequence[Section]":
    return ()


@dataclass(frozen=True)
class Page:
    """The page of a result; a terminal shows its verdict, figures, answer and warnings."""

    title: str
    verdict: str
    """the sentence for a person who reads no more"""
    answer: Sequence[Section]
    """the sections of the answer, above the list of contents"""
    further: Callable[[], Sequence[Section]] = _no_sections
    """makes the further sections, only for a page"""
    tone: Tone = "neutral"
    """colour of the rule beside the verdict"""
    key: Mapping[str, object] = field(default_factory=dict)
    """a few figures below the verdict"""
    provenance: Mapping[str, object] = field(default_factory=dict)
    """basis of the results: versions, content hashes; no time of day, so that the page repeats"""
    sources: Sequence[str] = ()
    """publications of the methods"""
    warnings: Sequence[str] = ()
    sheet: bool = False
    """one A4 page to sign: empty fields at its head, and in tables, are room to write"""
    screen: Sequence[str] = ()
    """lines for a terminal in place of verdict, figures, answer and warnings"""
    zoom: bool = False
    """its pictures are lines over time; a reader can enlarge a stretch of them"""
    cards: Sequence[Section] = ()
    """sections side by side at the head of the page, with a picture each"""

    def __post_init__(self) -> None:
        object.__setattr__(self, "answer", [section for section in self.answer if section.holds])

    @cached_property
    def sections(self) -> "Sequence[Section]":
        """Return all non-empty sections, in order."""
        return [*self.answer, *[section for section in self.further() if section.holds]]
