"""A page as its HTML, for tests."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from trihedron.tools.document.blocks import Page
from trihedron.tools.document.page import html


def html_of(make: Callable[..., Page], *arguments: Any, folder: Path | None = None, **options: Any) -> str:
    """The HTML of the page that `make` gives."""
    return html(make(*arguments, **options), folder)
