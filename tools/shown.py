"""Results that print themselves, show themselves in a notebook, and go to polars."""

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from polars import DataFrame

MOST_ROWS = 40
"""Rows of a result's table that a notebook shows."""


class Shown:
    """A result; a class that inherits from it says what it is in `lines` and gives its table in `to_polars`."""

    def lines(self) -> Sequence[str]:
        """What a person reads, line by line; the first is the verdict."""
        raise AssertionError(f"{type(self).__name__} says nothing")

    def to_polars(self) -> "DataFrame":
        """The result as a table."""
        raise AssertionError(f"{type(self).__name__} has no table")

    def __str__(self) -> str:
        return "\n".join(self.lines())

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return page_html(list(self.lines()), self.to_polars())


def page_html(lines: Sequence[str], frame: "DataFrame | None") -> str:
    """A result in a notebook: its first line, and its table where it has one."""
    said = f"<p><strong>{escape(lines[0])}</strong></p>" if lines else ""
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
