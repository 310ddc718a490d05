"""Tables of cost in docs/figures.md, which `make bench` writes row by row."""

from pathlib import Path

from trihedron.tools.files import write_text

PAGE = "figures.md"


def write_row(docs: Path, table: str, label: str, *cells: str) -> None:
    """Write a row of a table of the page; see `with_row`."""
    page = docs / PAGE
    write_text(page, with_row(page.read_text(encoding="utf-8"), table, label, *cells))


def with_row(text: str, table: str, label: str, *cells: str) -> str:
    """Return a page whose table has a row: in place of the row with this label, or after the last one.

    Raises ValueError if the marks of the table are missing.
    """
    row = f"| {' | '.join((label, *cells))} |"
    begin, end = ends_of(text, table)
    lines = []
    for line in text[begin:end].strip("\n").splitlines():
        lines.append(row if line.startswith(f"| {label} |") else line)
    if row not in lines:
        lines.append(row)
    return between_marks(text, table, "\n".join(lines))


def between_marks(text: str, name: str, table: str) -> str:
    """Replace the text between `<!-- name -->` and `<!-- end of name -->`.

    Raises ValueError if the marks are missing.
    """
    begin, end = ends_of(text, name)
    return f"{text[:begin]}\n{table}\n{text[end:]}"


def ends_of(text: str, name: str) -> tuple[int, int]:
    """Return where the text between two marks begins and ends."""
    first, last = f"<!-- {name} -->", f"<!-- end of {name} -->"
    return text.index(first) + len(first), text.index(last)
