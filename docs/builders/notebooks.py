"""Make a page of the site from a notebook: execute its cells in order, with their output below them."""

import ast
import base64
import io
import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from html import escape
from pathlib import Path
from typing import Any


@contextmanager
def _elsewhere() -> Iterator[None]:
    """Change to an empty folder for the block."""
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(before)


def page_of(notebook: Path, *, execute: bool = True) -> str:
    """Return the notebook in Markdown with the output of its cells; an exception of a cell is passed on."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    names: dict[str, Any] = {"__name__": "__main__"}
    lines: list[str] = []
    with _elsewhere():
        for cell in cells:
            source = "".join(cell["source"])
            if cell["cell_type"] == "markdown":
                lines += [source, ""]
            else:
                lines += ["```python", source, "```", "", *(_shown(source, names) if execute else ()), ""]
    return "\n".join(lines)


def _shown(source: str, names: dict[str, Any]) -> list[str]:
    """Execute a cell; return its printed output, and its last expression as a notebook shows it."""
    tree = ast.parse(source)
    last = tree.body.pop() if tree.body and isinstance(tree.body[-1], ast.Expr) else None
    printed, value = io.StringIO(), None
    with redirect_stdout(printed):
        exec(compile(tree, "cell", "exec"), names)
        if isinstance(last, ast.Expr):
            value = eval(compile(ast.Expression(last.value), "cell", "eval"), names)
    said = ["```text", printed.getvalue().rstrip(), "```"] if printed.getvalue() else []
    return said + ([] if value is None else _value(value))


def _value(value: Any) -> list[str]:
    if hasattr(value, "savefig"):
        picture = io.BytesIO()
        value.savefig(picture, format="svg")
        coded = base64.b64encode(picture.getvalue()).decode()
        return [f'<img alt="picture of the cell above" src="data:image/svg+xml;base64,{coded}">']
    html = value._repr_html_() if hasattr(value, "_repr_html_") else None
    if html is None:
        return ["```text", str(value), "```"]
    return [f'<div class="shown">{html}</div>' if "<" in html else escape(html)]
