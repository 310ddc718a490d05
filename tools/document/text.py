"""What a terminal and a notebook show of a page: its verdict, figures and first sections, as text."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

from ..rounding import Number, exactly
from .blocks import Page, Section, Table
from .notation import Cell, Drawn

if TYPE_CHECKING:
    from polars import DataFrame

MOST_ROWS = 40
"""Rows of a result's table that a notebook shows."""


def text(page: Page) -> str:
    """Return what a terminal shows of a page: its verdict, figures, first sections and warnings."""
    lines = [page.verdict]
    figures = []
    for name, value in page.key.items():
        figures.append(f"{name} {value}")
    if figures:
        lines.append("; ".join(figures))
    for section in page.answer:
        content = section_lines(section)
        if content and (section.table is not None or len(page.answer) > 1):
            lines += ["", section.title]
        lines += content
    for warning in page.warnings:
        lines.append(f"warning: {warning}")
    return "\n".join(lines)


def section_lines(section: Section) -> list[str]:
    """Return the paragraphs, the table and the files of a section as lines."""
    lines = list(section.paragraphs)
    if section.table is not None:
        lines += table_lines(section.table)
    for file in section.files:
        lines.append(str(file))
    return lines


def table_lines(table: Table) -> list[str]:
    """Return a table as lines of columns: numbers stand to the right, small pictures are left out."""
    columns = []
    for k, heading in enumerate(table.header):
        cells = [row[k] for row in table.rows]
        if not any(isinstance(cell, Drawn) for cell in cells):
            columns.append(_column(heading, cells))
    lines = []
    for parts in zip(*columns, strict=True):
        lines.append("  ".join(parts).rstrip())
    return lines


def _column(heading: str, cells: Sequence[Cell]) -> list[str]:
    """The heading and the cells of a column, all of one width; a minus is one that can be typed."""
    texts = [heading]
    for cell in cells:
        texts.append("" if cell is None else str(cell).replace("−", "-"))
    width = max(len(word) for word in texts)
    if any(isinstance(cell, int | Number) for cell in cells):
        return [word.rjust(width) for word in texts]
    return [word.ljust(width) for word in texts]


def notebook(page: Page, frame: "DataFrame | None") -> str:
    """Return what a notebook shows (HTML): the verdict, and the result's table where there is one."""
    table = "" if frame is None else table_html(frame)
    return f"<div><p><strong>{escape(page.verdict)}</strong></p>{table}</div>"


def table_html(frame: "DataFrame") -> str:
    """Return a table as HTML; numbers with all their digits, empty where there is none."""
    head = "".join(f"<th>{escape(name)}</th>" for name in frame.columns)
    rows = []
    for values in frame.head(MOST_ROWS).iter_rows():
        cells = "".join(f"<td>{escape(_exact_text(value))}</td>" for value in values)
        rows.append(f"<tr>{cells}</tr>")
    further = frame.height - MOST_ROWS
    note = f"<p>... and {further} rows more</p>" if further > 0 else ""
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>{note}"


def _exact_text(value: object) -> str:
    if value is None:
        return ""
    return exactly(value) if isinstance(value, float) else str(value)
