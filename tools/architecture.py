"""The architecture in one picture, made from the code: packages in layers, and what each imports when it is loaded."""

import ast
from collections.abc import Mapping
from html import escape
from itertools import pairwise
from pathlib import Path

from .report.theme import BAND, COLOURS, FIRST, FONTS, INK, MUTED, SECOND, THIRD

Graph = Mapping[str, frozenset[str]]
"""Part -> the parts that it imports."""

COMMANDS, LIBRARY, GROUND = "command line", "library", "errors, files, scenarios"
ROOTS = ("models", "fmus", "tools")
BOX, ROW, LINE, MARGIN = (112, 32), 74, 18, 14
"""Width and height of a box, distance of the rows, width that a line takes, margin of the picture."""
WIDTH = 1010


def imported(file: Path) -> set[str]:
    """Modules of ours that a file imports when it is loaded."""
    names: set[str] = set()
    for node in ast.parse(file.read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module == "trihedron":
            names |= {f"trihedron.{alias.name}" for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module or "")
    return {name for name in names if name.startswith("trihedron.")}


def modules(root: Path) -> dict[str, set[str]]:
    """Every module of the three folders, by its import name -> what it imports when it is loaded."""
    found = {}
    for folder in ROOTS:
        prefix = () if folder == "tools" else (folder,)
        for file in sorted((root / folder).rglob("*.py")):
            parts = [*prefix, *file.relative_to(root / folder).with_suffix("").parts]
            found[".".join(["trihedron", *(part for part in parts if part != "__init__")])] = imported(file)
    return found


def architecture(root: Path) -> Graph:
    """The parts and what they import.

    A package is a part. Modules beside the packages are the command line; the ground, where they import no package; a
    part of their own, where a package imports them (named by the first word); else the library.

    Parameters
    ----------
    root : Path
        of the checkout
    """
    found = modules(root)
    packages = {file.parent.name for file in (root / "tools").glob("*/__init__.py")} | {"models", "fmus"}
    single = {name for name in found if name.count(".") == 1 and name.split(".")[1] not in packages}

    def reached(name: str, seen: set[str]) -> set[str]:
        for other in found.get(name, ()):
            if other not in seen:
                seen.add(other)
                reached(other, seen)
        return seen

    ground = {name for name in single if reached(name, set()) <= single}
    wanted = {other for name, others in found.items() if name.count(".") > 1 for other in others}

    def part(name: str) -> str | None:
        words = name.split(".")
        if words[1:2] and words[1] in packages:
            return words[1]
        if name not in single:
            return None
        stem = words[1]
        if stem == "cli" or stem.endswith("_commands"):
            return COMMANDS
        if name in ground:
            return GROUND
        return stem.split("_")[0] if name in wanted else LIBRARY

    parts: dict[str, set[str]] = {}
    for name, others in found.items():
        own = part(name)
        if own is not None:
            parts.setdefault(own, set()).update(p for other in others if (p := part(other)) not in (None, own))
    # A command asks the library when it is called, so that `--help` need not load it.
    parts[COMMANDS].add(LIBRARY)
    parts[LIBRARY] |= {name for name in parts if name not in (LIBRARY, COMMANDS)}
    return {name: frozenset(others) for name, others in sorted(parts.items())}


def direct(graph: Graph) -> Graph:
    """The graph without what is reached through others too.

    Raises
    ------
    ValueError
        parts that import one another, by name
    """
    below = {name: frozenset() for name in graph}
    for name in ordered(graph):
        below[name] = frozenset(graph[name]).union(*(below[other] for other in graph[name]))
    return {
        name: frozenset(o for o in others if not any(o in below[between] for between in others))
        for name, others in graph.items()
    }


def ordered(graph: Graph) -> list[str]:
    """The parts so that each stands after those that it imports."""
    from graphlib import CycleError, TopologicalSorter

    try:
        return list(TopologicalSorter({name: sorted(others) for name, others in graph.items()}).static_order())
    except CycleError as error:
        raise ValueError(f"import one another: {' -> '.join(error.args[1])}") from error


def layers(graph: Graph) -> tuple[list[list[str]], list[list[str]]]:
    """The parts in rows, each above all that it imports, with places where lines pass between them.

    Returns
    -------
    rows : list of list of str
        the lowest first; places for lines have names with ``>``
    lines : list of list of str
        the places that each line goes through, from the importing part down to the imported one
    """
    level: dict[str, int] = {}
    for name in ordered(graph):
        level[name] = max((level[other] + 1 for other in graph[name]), default=0)
    rows: list[list[str]] = [[] for _ in range(max(level.values()) + 1)]
    for name in sorted(graph):
        rows[level[name]].append(name)
    lines = []
    for name in sorted(graph):
        for other in sorted(graph[name]):
            passed = [f"{name}>{other}>{k}" for k in range(level[name] - 1, level[other], -1)]
            for k, place in zip(range(level[name] - 1, level[other], -1), passed, strict=True):
                rows[k].append(place)
            lines.append([name, *passed, other])
    _sort_rows(rows, lines)
    return rows, lines


def _sort_rows(rows: list[list[str]], lines: list[list[str]]) -> None:
    """Put what lines connect near to one another: each in the middle of its neighbours, up and down by turns."""
    below: dict[str, list[str]] = {}
    above: dict[str, list[str]] = {}
    for line in lines:
        for upper, lower in pairwise(line):
            below.setdefault(upper, []).append(lower)
            above.setdefault(lower, []).append(upper)
    place = {name: (k + 0.5) / len(row) for row in rows for k, name in enumerate(row)}

    def middle(name: str, neighbours: Mapping[str, list[str]]) -> float:
        found = [place[other] for other in neighbours.get(name, ())]
        return sum(found) / len(found) if found else place[name]

    for turn in range(24):
        neighbours, order = (below, rows) if turn % 2 == 0 else (above, rows[::-1])
        for row in order:
            row.sort(key=lambda name, of=neighbours: (middle(name, of), name))
            place |= {name: (k + 0.5) / len(row) for k, name in enumerate(row)}


def architecture_picture(root: Path) -> str:
    """The picture as SVG."""
    rows, lines = layers(direct(architecture(root)))
    height = 2 * MARGIN + BOX[1] + ROW * (len(rows) - 1)
    centre: dict[str, tuple[float, float]] = {}
    for k, row in enumerate(rows):
        widths = [LINE if ">" in name else _width(name) for name in row]
        room = (WIDTH - 2 * MARGIN - sum(widths)) / len(row)
        x, y = float(MARGIN), height - MARGIN - BOX[1] / 2 - k * ROW
        for name, width in zip(row, widths, strict=True):
            centre[name] = (x + (room + width) / 2, y)
            x += room + width
    boxes = [_box(name, *centre[name]) for row in rows for name in row if ">" not in name]
    said = "Packages of Trihedron, each above those that it imports: models below, the command line on top"
    colours = "".join(f"[fill='{c.light}']{{fill:{c.dark}}}[stroke='{c.light}']{{stroke:{c.dark}}}" for c in COLOURS)
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height}" role="img" aria-label="{said}">',
            f"<style>text{{font:13px {FONTS};text-anchor:middle}}",
            f"@media(prefers-color-scheme:dark){{{colours}}}</style>",
            *(_line([centre[name] for name in line]) for line in lines),
            *boxes,
            "</svg>",
            "",
        ]
    )


def _width(name: str) -> float:
    return max(BOX[0], 8 * len(name) + 16)


def _box(name: str, x: float, y: float) -> str:
    width = _width(name)
    edge = {"models": THIRD, "fmus": SECOND}.get(name, FIRST)
    return (
        f'<rect x="{x - width / 2:.1f}" y="{y - BOX[1] / 2:.1f}" width="{width}" height="{BOX[1]}" rx="5" '
        f'fill="{BAND.light}" stroke="{edge.light}"/><text x="{x:.1f}" y="{y + 4.5:.1f}" fill="{INK.light}">'
        f"{escape(name)}</text>"
    )


def _line(points: list[tuple[float, float]]) -> str:
    """A smooth line through the places of a line, from box to box; straight down beside the boxes that it passes."""
    half = BOX[1] / 2
    path = f"M{points[0][0]:.1f} {points[0][1] + half:.1f}"
    for (x, y), (to, below) in pairwise(points):
        top, bottom = y + half, below - half
        bend = (bottom - top) / 2
        path += f"C{x:.1f} {top + bend:.1f} {to:.1f} {bottom - bend:.1f} {to:.1f} {bottom:.1f}"
        if (to, below) != points[-1]:
            path += f"V{below + half:.1f}"
    return f'<path d="{path}" fill="none" stroke="{MUTED.light}" stroke-width="1"/>'
