"""A document as one HTML file with its pictures in it: no script, nothing from the network."""

import os
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import quote

from markupsafe import Markup, escape

from .blocks import Download, Page, Table
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
        for number, section in enumerate(page.sections, start=1)
    ]
    return _template().render(
        title=plain(page.title),
        verdict=typeset(plain(page.verdict)),
        tone=page.tone,
        sections=shown,
        contents=len(shown) > FEW,
        key=[(plain(name), typeset(plain(value))) for name, value in page.key.items()],
        sources=[plain(source) for source in page.sources],
        provenance=[(plain(name), plain(value)) for name, value in page.provenance.items()],
        style=Markup(_text("page.css")),
    )


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
    parts = typeset(plain(text)).split("`")
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
