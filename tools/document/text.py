"""A document on a terminal, and in a notebook."""

from html import escape
from typing import TYPE_CHECKING

from .blocks import Document

if TYPE_CHECKING:
    from polars import DataFrame

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
