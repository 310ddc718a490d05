"""No document shows a bound better than it is: numbers are written by one module, each bound by the way of its side."""

import ast
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from page_text import clean
from shown_bounds import BOTH, DOWN, UP, Watched, shown_too_well
from strapdown_records import strapdown_record
from trihedron.tools import library
from trihedron.tools.calibration import calibrate
from trihedron.tools.reports import document_of
from trihedron.tools.result import Result
from trihedron.tools.rounding import digits, exactly, interval, upwards
from trihedron.tools.trials.bench import NOISE_BOUND

TOOLS = Path(library.__file__).parent
SHOWN = ("reports", "document", "cli")
"""Packages that show numbers to people: there no number has a format of its own."""
NUMERIC = re.compile(r"[^{}]*[eEfFgGn%]")
DATA = {
    "rounding.py",
    "records/kinds.py",
    "papers/reproduction.py",
    "document/notation.py",
    "reports/pictures/__init__.py",
}
"""What rounds, and what writes figures for programs: records, JSON, coordinates of a picture."""
OWN = {"bias", "compensated", "cost", "gap", "high", "limit", "low", "ratio", "worst"}
"""Names that are also those of other figures; what is shown of results is watched."""


def trees() -> Iterator[tuple[str, ast.Module]]:
    for path in sorted(TOOLS.rglob("*.py")):
        name = path.relative_to(TOOLS).as_posix()
        if name not in DATA:
            yield name, ast.parse(path.read_text(encoding="utf-8"))


def formats(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Formats of numbers: in f-strings, by `format`, by %, and templates that hold them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FormattedValue) and isinstance(node.format_spec, ast.JoinedStr):
            form = "".join(part.value for part in node.format_spec.values if isinstance(part, ast.Constant))
            if NUMERIC.fullmatch(form):
                yield node.lineno, form
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            for form in re.findall(r"\{[^{}:]*:([-+<>z]*\d*\.?\d*[eEfFgG%])\}|(%\.?\d*[efgEFG])\b", node.value):
                yield node.lineno, "".join(form)
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in ("format", "round"):
            yield node.lineno, node.func.id


@pytest.mark.parametrize("package", SHOWN)
def test_what_is_shown_has_no_format_of_its_own(package):
    found = [
        f"{name}:{line}: {form}"
        for name, tree in trees()
        if name.startswith(f"{package}/")
        for line, form in formats(tree)
        # To whole places before it is written exactly.
        if form != "round"
    ]
    assert found == []


def test_no_fixed_decimals_that_make_a_small_number_nothing():
    of_all = ((name, line, form) for name, tree in trees() for line, form in formats(tree))
    found = [f"{name}:{line}: {form}" for name, line, form in of_all if form[-1] in "eEfF%"]
    assert found == []


def test_a_bound_is_not_rounded_to_nearest():
    bounds = (UP | DOWN | BOTH) - OWN
    found = [
        f"{name}:{node.lineno}: {ast.unparse(node)}"
        for name, tree in trees()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "digits"
        for part in ast.walk(node)
        if (isinstance(part, ast.Attribute) and part.attr in bounds)
        or (isinstance(part, ast.Name) and part.id in bounds)
        or (isinstance(part, ast.Constant) and part.value in bounds)
    ]
    assert found == []


@pytest.mark.parametrize(
    "source",
    [
        'f"{x:.3f}"',
        'f"{x:>+z13.7f}"',
        'f"{x:.{n}e}"',
        '"{width:.2e} g".format(width=x)',
        '"%.3g" % x',
        'format(x, "g")',
    ],
)
def test_a_format_by_hand_is_found(source):
    assert list(formats(ast.parse(source)))


KINDS: dict[str, Callable[[], Result]] = {
    "inspection": lambda: library.inspect(strapdown_record()),
    "attitude": lambda: library.attitude_of_record(strapdown_record()),
    "positions": lambda: library.plan_positions(12, starts=1),
    "one-sided": lambda: calibrate(clean(), noise_bound=NOISE_BOUND * 0.9, baseline="symmetric"),
}


@pytest.mark.parametrize("kind", KINDS)
def test_lines_show_no_bound_better_than_it_is(kind):
    result, watched = KINDS[kind](), Watched()
    with watched():
        lines = document_of(result).lines
    assert lines
    assert watched.seen
    assert shown_too_well(result.to_json(), watched) == []


@pytest.mark.parametrize(
    ("show", "wrong"),
    [
        (lambda: upwards(3.541e-5), 0),
        (lambda: digits(3.541e-5, 2), 1),
        (lambda: exactly(3.541e-5), 0),
        (lambda: interval(2e-3, 1.23456e-3, 3.45671e-3), 0),
        (lambda: interval(5e-3, 3.45671e-3, 9e-3), 1),
        (lambda: upwards(3.541e-5 * 648000.0 / np.pi), 0),
        (lambda: digits(3.541e-5 * 648000.0 / np.pi), 1),
    ],
)
def test_a_bound_on_its_wrong_side_is_found(show: Callable[[], Any], wrong: int):
    watched = Watched()
    with watched():
        show()
    content = {"parameters": [{"guaranteed_error": 3.541e-5, "low": 1.23456e-3, "high": 3.45671e-3}]}
    assert len(shown_too_well(content, watched)) == wrong


def test_headline_terminal_and_table_agree_on_the_bound():
    """With 3.541e-5 in JSON the headline said 3.5e-5, the terminal 3.5e-05 and the table 3.6e-5."""
    result = calibrate(clean(), noise_bound=1.7432e-5)
    largest = max(row.error_bound for row in result.parameters if row.error_bound is not None)
    page = document_of(result, clean()).page
    assert page is not None
    (shown,) = re.findall(r"to within ([-+0-9.e]+) or better", made.verdict if (made := page()) else "")
    assert float(shown) >= largest
    assert any(re.search(rf"(?<![0-9.]){re.escape(shown)}(?![0-9])", line) for line in document_of(result).lines)
    (table,) = (section.table for section in made.sections if section.title == "Targets")
    assert table is not None
    assert shown in {str(cell) for row in table.rows for cell in row}
