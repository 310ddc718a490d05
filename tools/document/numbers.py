"""Numbers with the digits that their bounds justify, cells of tables, and intervals drawn in cells."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from .theme import plain, raised

DIGITS = 6
"""Significant digits of a number in a table."""

ALIKE = 1e3
"""The numbers of a column are written alike while the largest is at most so many times the smallest."""

LONG = 24
"""A text of more letters in a table may be broken into lines."""

_WRITTEN_POWER = re.compile(r"(?<![\w.])(?P<sign>[-+−]?)(?P<head>\d+(?:\.\d+)?)e(?P<power>[-+−]?\d+)(?![\w.]*\w)")
_MINUS = re.compile(r"(?:(?<=[\s(\[])|^)-(?=\d)")


@dataclass(frozen=True)
class Written:
    """A number as the page is to show it, rounded to what its bound justifies."""

    text: str

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class Drawn:
    """A small picture in a cell, of `bars`."""

    svg: str


Cell = str | int | float | bool | Written | Drawn | None


def typeset(text: str) -> str:
    """Text with the signs of typography, numbers with a power of ten written as such: -1.09e-03 as −1.09·10⁻³."""
    return _MINUS.sub("−", _WRITTEN_POWER.sub(_power, text))


def _power(number: re.Match[str]) -> str:
    sign, head, power = number["sign"].replace("-", "−"), number["head"], int(number["power"].replace("−", "-"))
    return f"{sign}{'' if head == '1' else f'{head}·'}{raised(power)}"


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


_POWER = re.compile(r"(?<=\d)e\+?(−?)0*(?=\d)(\d+)")

MOST_DECIMALS = 12
NOTHING = 1e-14
"""A figure below that is rounding of doubles."""
FAR = 1e6
"""Numbers that differ from their bound by more than that, or are as large, are written with a power of ten."""


def places_of(bound: float | None) -> int:
    """Decimals with which a bound shows two digits; `MOST_DECIMALS` at most and where there is no bound."""
    if bound is None or not math.isfinite(bound) or bound == 0.0:
        return MOST_DECIMALS
    return min(max(1 - math.floor(math.log10(abs(bound))), 0), MOST_DECIMALS)


def minus(text: str) -> str:
    """A number's text with the sign of typography, and no zeros that are only there for a computer."""
    return _POWER.sub(r"e\1\2", text.replace("-", "−"))


def sentence(text: str) -> str:
    """A line for a terminal as a sentence of a page."""
    return f"{text[:1].upper()}{text[1:]}."


def unit_of(unit: str) -> str:
    """A unit behind a number: nothing for what has none."""
    return "" if unit == "1" else unit


def symbol_text(symbol: str) -> str:
    """A target's symbol with signs of typography; the name of its mounting stays as it is."""
    head, at, mounting = symbol.partition("@")
    return head.replace("-", "−") + at + mounting


def unit_text(unit: str) -> str:
    """A unit as people write it: m/s² for m/s2, nothing for 1."""
    return unit_of(unit).replace("2", "²").replace("3", "³")


def half_width(low: float | None, high: float | None) -> float | None:
    """Half of an interval; None where an end is not known."""
    return None if low is None or high is None else 0.5 * (high - low)


def to_bound(value: float | None, bound: float | None) -> Written | None:
    """An estimate to the place of the second digit of its bound; None stays None."""
    if value is None or not math.isfinite(value):
        return None
    if bound is None or not math.isfinite(bound) or bound <= 0.0:
        return significant(value, 3)
    if abs(value) > FAR * bound:
        return significant(value, 7)
    return Written(minus(f"{value:z.{places_of(bound)}f}"))


def upwards(bound: float | None, digits: int = 2) -> Written | None:
    """A bound with two digits, rounded up: what is guaranteed stays so."""
    if bound is None or not math.isfinite(bound):
        return None
    value = abs(bound)
    if value > 0.0:
        scale = 10.0 ** (digits - 1 - math.floor(math.log10(value)))
        value = math.ceil(value * scale - 1e-9) / scale
    return Written(minus(_compact(value, digits)))


def outwards(low: float | None, high: float | None, bound: float | None) -> tuple[Written | None, Written | None]:
    """Ends of an interval to the place of the second digit of a bound, the low one down and the high one up."""
    if low is None or high is None or not (math.isfinite(low) and math.isfinite(high)):
        return None, None
    places = places_of(0.5 * (high - low) if bound is None else bound)
    scale = 10.0**places
    # An end that is a whole number of last places but for rounding stays what it is.
    ends = math.floor(low * scale + 1e-6) / scale, math.ceil(high * scale - 1e-6) / scale
    return Written(minus(f"{ends[0]:z.{places}f}")), Written(minus(f"{ends[1]:z.{places}f}"))


def interval(value: float | None, low: float | None, high: float | None) -> tuple[Cell, Cell, Cell]:
    """A value and the ends of what is possible, to the second digit of half of it; an end may be infinite."""
    half = half_width(low, high)
    if low is None or high is None or (half is not None and 0.0 < half < math.inf):
        return to_bound(value, half), *outwards(low, high, half)
    return to_bound(value, None), Written(minus(f"{low:.3g}")), Written(minus(f"{high:.3g}"))


def significant(value: float | None, digits: int = 2) -> Written | None:
    """A figure that no bound belongs to, as a root mean square."""
    if value is None or not math.isfinite(value):
        return None
    return Written(minus(_compact(value if abs(value) > NOTHING else 0.0, digits)))


def _compact(value: float, digits: int) -> str:
    if value == 0.0:
        return "0"
    size = math.floor(math.log10(abs(float(f"{value:.{digits - 1}e}"))))
    if -3 <= size < 6:
        return f"{value:.{max(digits - 1 - size, 0)}f}"
    return f"{value:.{digits - 1}e}"


@dataclass(frozen=True)
class Bar:
    """An interval about its estimate, in units of σ.

    Attributes
    ----------
    error : float or None
        the guaranteed error: the band reaches from −error to +error
    low, high : float or None
        what is possible, less the estimate
    truth : float or None
        less the estimate, where it is known
    """

    error: float | None
    low: float | None
    high: float | None
    truth: float | None = None


def bars(rows: Sequence[Bar]) -> tuple[list[Drawn | None], float]:
    """The cells, and how far [σ] the scale of all of them reaches to either side.

    Rows without a number are None.
    """
    sizes = [abs(v) for row in rows for v in (row.error, row.low, row.high, row.truth) if v is not None]
    reach = float(np.max(sizes, initial=0.0)) * 1.02
    if not np.isfinite(reach) or reach <= 0.0:
        return [None] * len(rows), 0.0
    return [None if row.error is None and row.low is None else _drawn(row, reach) for row in rows], reach


def _drawn(row: Bar, reach: float) -> Drawn:
    def at(value: float) -> str:
        return f"{100.0 * value / reach:.1f}"

    said = []
    parts = ['<path class="axis" d="M0 -7V7"/>']
    if row.error is not None:
        width = 200.0 * row.error / reach
        parts.append(f'<rect class="band" x="{at(-row.error)}" y="-6" width="{width:.1f}" height="12"/>')
        said.append(f"guaranteed error {row.error:.2g}")
    if row.low is not None and row.high is not None:
        parts.append(f'<path class="possible" d="M{at(row.low)} 0H{at(row.high)}"/>')
        said.append(f"possible from {row.low:.2g} to {row.high:.2g}")
    if row.truth is not None:
        parts.append(f'<path class="truth" d="M{at(row.truth)} -6V6"/>')
        said.append(f"truth {row.truth:.2g}")
    parts.append('<circle class="middle" r="2.6"/>')
    label = ", ".join(said) + " in units of σ about the estimate"
    head = f'<svg class="bar" viewBox="-104 -8 208 16" role="img" aria-label="{label}">'
    return Drawn(head + "".join(parts) + "</svg>")
