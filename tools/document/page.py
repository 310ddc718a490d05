"""A document as one HTML file with its pictures in it: no script, nothing from the network."""

import os
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from markupsafe import Markup, escape

from .blocks import Page, Table
from .numbers import look, typeset, written
from .pdf import write_html
from .theme import plain

if TYPE_CHECKING:
    from jinja2 import Template

FEW = 4
"""A page of more sections has a table of contents."""


def html(page: Page, folder: Path | None = None) -> str:
    """A page as HTML text.

    Parameters
    ----------
    page : Page
    folder : Path or None
        where the page will stand: files are shown and linked relative to it

    Returns
    -------
    str
        HTML, complete; whatever the texts hold is shown and never run
    """
    return _template().render(page=page, folder=folder, few=FEW, style=_text("page.css"))


def write_page(path: Path, page: Page) -> None:
    """Write a page as HTML, or as PDF where the name ends so; whole or not at all.

    Raises
    ------
    InputError
        where the file cannot be written, or the page not be printed
    """
    write_html(path, html(page))


def _prose(text: str) -> Markup:
    """A paragraph; what stands between backquotes is code."""
    parts = _said(text).split("`")
    if len(parts) % 2 == 0:
        return escape("`".join(parts))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else escape(part) for k, part in enumerate(parts)
    )


def _text(name: str) -> str:
    return resources.files("trihedron.tools.document").joinpath(name).read_text(encoding="utf-8")


@cache
def _template() -> "Template":
    from jinja2 import Environment, StrictUndefined

    environment = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    # Pictures and equations are made by this package, which escapes every label: they alone are put in as they are.
    environment.filters |= {"plain": plain, "said": _said, "prose": _prose, "cells": _cells, "linked": _linked}
    environment.filters["quoted"] = quote
    return environment.from_string(_text("page.html"))


def _said(text: object) -> str:
    return typeset(plain(text))


def _cells(table: Table) -> tuple[list[str], list[tuple[str, ...]]]:
    """How each column looks, and the rows as they are written."""
    columns = [[row[k] for row in table.rows] for k in range(len(table.header))]
    return list(map(look, columns)), list(zip(*map(written, columns), strict=True))


def _linked(file: Path | str, folder: Path | None) -> tuple[str, str]:
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
