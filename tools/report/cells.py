"""Cells of a page's tables: numbers alike in a column, rounded to their bounds, or drawn."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from markupsafe import Markup

from .svg import plain

DIGITS = 6
"""Significant digits of a number in a table."""

ALIKE = 1e3
"""The numbers of a column are written alike while the largest is at most so many times the smallest."""

LONG = 24
"""A text of more letters in a table may be broken into lines."""

_POWER = re.compile(r"(?<![\w.])(?P<sign>[-+−]?)(?P<head>\d+(?:\.\d+)?)e(?P<power>[-+−]?\d+)(?![\w.]*\w)")
_MINUS = re.compile(r"(?:(?<=[\s(\[])|^)-(?=\d)")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True)
class Written:
    """A number as the page is to show it, rounded to what its bound justifies (`trihedron.tools.report.rounding`)."""

    text: str


@dataclass(frozen=True)
class Drawn:
    """A small picture in a cell, of `trihedron.tools.report.bars`."""

    svg: str


Cell = str | int | float | bool | Written | Drawn | None


def typeset(text: str) -> str:
    """Text with the signs of typography, numbers with a power of ten written as such: -1.09e-03 as −1.09·10⁻³."""
    return _MINUS.sub("−", _POWER.sub(_power, text))


def _power(number: re.Match[str]) -> str:
    sign, head, power = number["sign"].replace("-", "−"), number["head"], int(number["power"].replace("−", "-"))
    return f"{sign}{'' if head == '1' else f'{head}·'}10{str(power).translate(_RAISED)}"


def look(column: Sequence[Cell]) -> str:
    """The class of a column's cells: numbers stand to the right, long texts may be broken."""
    if any(map(_is_number, column)) and all(_is_number(cell) or cell is None for cell in column):
        return "number"
    return "words" if any(isinstance(cell, str) and len(cell) > LONG for cell in column) else ""


def written(column: Sequence[Cell]) -> list[str]:
    """The cells of a column; numbers of one magnitude with the same number of decimals."""
    sizes = [abs(cell) for cell in column if isinstance(cell, float) and math.isfinite(cell) and cell != 0.0]
    form = f".{DIGITS}g"
    if sizes and max(sizes) <= ALIKE * min(sizes):
        most = math.floor(math.log10(max(sizes)))
        form = f".{max(DIGITS - 1 - most, 0)}f" if -3 <= most < DIGITS else f".{DIGITS - 1}e"
    return [_cell(cell, form) for cell in column]


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, int | float | Written) and not isinstance(cell, bool)


def _cell(cell: Cell, form: str) -> str:
    if isinstance(cell, Drawn):
        return Markup(cell.svg)
    if isinstance(cell, Written):
        return typeset(plain(cell.text))
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    if isinstance(cell, float):
        return typeset(f"{cell:{form}}").replace("-", "−")
    return str(cell).replace("-", "−") if isinstance(cell, int) else plain(cell)
