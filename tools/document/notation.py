"""Typography of a page: texts, rounded numbers, drawn intervals, equations with their numbers.

Numbers are rounded by `trihedron.tools.rounding`, and only there. Equations are MathML: every browser reads it without
script, fonts or network.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from html import escape

import numpy as np
from markupsafe import Markup

from ...models.effects import EffectPlace
from ..rounding import NONE, Number, digits, outwards, upwards

LONG = 24
"""Number of letters from which a text in a table may be broken into lines."""

_WRITTEN_POWER = re.compile(r"(?<![\w.])(?P<sign>[-+−]?)(?P<head>\d+(?:\.\d+)?)e(?P<power>[-+−]?\d+)(?![\w.]*\w)")
_MINUS = re.compile(r"(?:(?<=[\s(\[])|^)-(?=\d)")


@dataclass(frozen=True)
class Drawn:
    """A small picture in a cell, of `bars`."""

    svg: str


Cell = Number | str | int | bool | Drawn | None
"""Content of a table's cell: numbers that are not counts are rounded before, so that their texts keep their bounds."""


_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def plain(text: object) -> str:
    """Return one line of text without characters that XML cannot hold."""
    return " ".join(_NOT_XML.sub("\ufffd", str(text)).split())


def short(text: object, most: int = 48) -> str:
    """Return `plain`, cut to fit beside an axis."""
    line = plain(text)
    return line if len(line) <= most else line[: most - 1].rstrip() + "…"


def raised(power: int) -> str:
    """Return a power of ten: 10⁻³."""
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))


def typographic(text: str) -> str:
    """Return a text with typographic signs and powers of ten: -1.09e-03 -> 0 as −1.09·10⁻³ → 0."""
    return _MINUS.sub("−", _WRITTEN_POWER.sub(_power, text.replace("->", "→")))


def _power(number: re.Match[str]) -> str:
    sign, head, power = number["sign"].replace("-", "−"), number["head"], int(number["power"].replace("−", "-"))
    return f"{sign}{'' if head == '1' else f'{head}·'}{raised(power)}"


def look(column: Sequence[Cell]) -> str:
    """Return the class of a column's cells: numbers are right-aligned, long texts may be broken."""
    if any(map(_is_number, column)) and all(_is_number(cell) or cell is None for cell in column):
        return "number"
    return "words" if any(isinstance(cell, str) and len(cell) > LONG for cell in column) else ""


LONGEST = 12
"""Largest number of characters of a number without a power of ten of its own, in a column that has one."""


def written(heading: str, column: Sequence[Cell]) -> tuple[str, list[str]]:
    """Return the heading and the texts of a column, which has one power of ten.

    A number's text is one for spreadsheets, with an ASCII minus sign; that of a missing number is empty.
    """
    if look(column) != "number":
        return heading, [_text(cell) for cell in column]
    if not any("e" in str(cell) for cell in column if _is_number(cell)):
        return heading, ["" if cell is None else str(cell) for cell in column]
    numbers = [Decimal(str(cell)) for cell in column if cell]
    largest = max(number.adjusted() for number in numbers if number.is_finite() and number)
    power = 0 if largest == -1 else 3 * (largest // 3)
    texts = [_over(cell, power) for cell in column]
    if not power:
        return heading, texts
    name, _, unit = heading.removesuffix("]").partition(" [")
    return f"{name} [{f'{raised(power)} {unit}'.rstrip()}]", texts


def _over(cell: Cell, power: int) -> str:
    """Return a number over a power of ten, all its digits kept."""
    if cell is None or cell == "":
        return ""
    number = Decimal(str(cell)).scaleb(-power)
    if not number.is_finite():
        return str(cell)
    fixed = f"{number:f}"
    return fixed if len(fixed) <= LONGEST or not number else f"{number:e}"


def _text(cell: Cell) -> str:
    """Return the text of a cell in a column that holds other things than numbers."""
    if isinstance(cell, Drawn):
        return Markup(cell.svg)
    if cell is None or cell is NONE:
        return "–"
    if isinstance(cell, bool):
        return "yes" if cell else "no"
    return typographic(plain(cell)) if _is_number(cell) else plain(cell)


def _is_number(cell: Cell) -> bool:
    return isinstance(cell, int | Number) and not isinstance(cell, bool)


def minus(text: str) -> str:
    """Return a number's text with the typographic minus."""
    return text.replace("-", "−")


def sentence(text: str) -> str:
    """Return a line for a terminal as a sentence of a page."""
    return f"{text[:1].upper()}{text[1:]}."


def listed(texts: Sequence[str], most: int) -> str:
    """Return the first texts of a list, and the number of further ones."""
    line = ", ".join(texts[:most])
    if len(texts) > most:
        line += f" and {len(texts) - most} more"
    return line


def unit_behind(unit: str) -> str:
    """Return a unit behind a number, empty for a pure number."""
    return "" if unit == "1" else unit


def symbol_text(symbol: str) -> str:
    """Return a target's symbol with typographic signs; the name of its mounting stays."""
    head, at, mounting = symbol.partition("@")
    return head.replace("-", "−") + at + mounting


def unit_text(unit: str) -> str:
    """Return a unit as people write it: m/s² for m/s2, nothing for 1."""
    return re.sub(r"(?<=[a-zA-Z])[0-9]", lambda power: _POWERS[int(power[0])], unit_behind(unit))


def half_width(low: float | None, high: float | None) -> float | None:
    """Return half of an interval; None if an end is unknown."""
    return None if low is None or high is None else 0.5 * (high - low)


@dataclass(frozen=True)
class Bar:
    """An interval about its estimate, in any unit."""

    error: float | None
    """the guaranteed error: extent of the band to either side of its middle"""
    low: float | None
    high: float | None
    """ends of the interval, less the estimate"""
    truth: float | None = None
    """true value less the estimate, if known"""
    about: float = 0.0
    """the middle of the band, less the estimate"""


def bars(rows: Sequence[Bar], unit: str = "σ") -> tuple[list[Drawn | None], float]:
    """Return the cells, and the reach of their common scale to either side, in the unit of the rows.

    Rows without a number are None.
    """
    sizes = [abs(row.about) + row.error for row in rows if row.error is not None]
    sizes += [abs(v) for row in rows for v in (row.low, row.high, row.truth) if v is not None]
    reach = float(np.max(sizes, initial=0.0)) * 1.02
    if not np.isfinite(reach) or reach <= 0.0:
        return [None] * len(rows), 0.0
    return [None if row.error is None and row.low is None else _drawn(row, reach, unit) for row in rows], reach


def bars_by_unit(rows: Sequence[Bar], units: Sequence[str]) -> list[Drawn | None]:
    """Return the cells of rows in several units: rows of one unit have one scale."""
    cells: list[Drawn | None] = [None] * len(rows)
    for unit in dict.fromkeys(units):
        numbers = [number for number, of_row in enumerate(units) if of_row == unit]
        drawn, _ = bars([rows[number] for number in numbers], unit_text(unit))
        for number, cell in zip(numbers, drawn, strict=True):
            cells[number] = cell
    return cells


def _drawn(row: Bar, reach: float, unit: str) -> Drawn:
    def at(value: float) -> str:
        return f"{100.0 * value / reach:.1f}"

    said = []
    parts = ['<path class="axis" d="M0 -7V7"/>']
    if row.error is not None:
        width = 200.0 * row.error / reach
        parts.append(f'<rect class="band" x="{at(row.about - row.error)}" y="-6" width="{width:.1f}" height="12"/>')
        said.append(f"error bound {upwards(row.error)}")
    if row.low is not None and row.high is not None:
        parts.append(f'<path class="possible" d="M{at(row.low)} 0H{at(row.high)}"/>')
        low, high = outwards(row.low, row.high)
        said.append(f"possible from {low} to {high}")
    if row.truth is not None:
        parts.append(f'<path class="truth" d="M{at(row.truth)} -6V6"/>')
        said.append(f"truth {digits(row.truth)}")
    parts.append('<circle class="middle" r="2.6"/>')
    label = f"{', '.join(said)} {unit} about the estimate"
    head = f'<svg class="bar" viewBox="-104 -8 208 16" role="img" aria-label="{label}">'
    return Drawn(head + "".join(parts) + "</svg>")


# Equations

_POWERS = "⁰¹²³⁴⁵⁶⁷⁸⁹"
_SUPERSCRIPTS = {**{sign: str(k) for k, sign in enumerate(_POWERS)}, "⁺": "+", "⁻": "−", "ᵀ": "T"}
_TOKEN = re.compile(
    r"(?P<number>\d+(?:\.\d+)?(?:e[−+-]?\d+)?)"
    r"|(?P<name>[A-Za-zΑ-Ωα-ωϑ][A-Za-zΑ-Ωα-ωϑ]*\*?)(?:_(?P<below>[A-Za-z0-9]+))?(?P<above>⁻[⁰¹²³⁴⁵⁶⁷⁸⁹]|[⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ᵀ])?"
    r"|(?P<words>'[^']*')"
    r"|(?P<operator>[-+−·×∘/()=|,<>≤≥±;°?])(?P<raised>⁻?[⁰¹²³⁴⁵⁶⁷⁸⁹])?"
)
FUNCTIONS = ("sin", "cos", "exp", "sign", "up")
THIN = '<mspace width="0.17em"/>'


def equation(text: str) -> str:
    """Return a formula in plain text as MathML: a `<math>` element, one line.

    Names have one or more letters with ``_`` before an index (n_3, Γ_21). Powers are written as ², ⁵ and ⁻¹, numbers
    with a power of ten as 1.2e−3, words between single quotes. ``{a ; b | c ; d}`` is a choice: a if b, c if d. ``[a ;
    b | c ; d]`` is a matrix with the rows a b and c d.
    """
    return f'<math display="block"><mrow>{_row(plain(text))}</mrow></math>'


def _row(text: str) -> str:
    parts = []
    position = 0
    while position < len(text):
        if text[position] in "{[":
            brace = text[position] == "{"
            end = text.index("}" if brace else "]", position)
            parts.append(_table(text[position + 1 : end], brace=brace))
            position = end + 1
            continue
        match = _TOKEN.match(text, position)
        if match is None:
            parts.append("" if text[position] == " " else f"<mtext>{escape(text[position])}</mtext>")
            position += 1
            continue
        first = text[:position].rstrip()[-1:] in ("", *"=(;|,<>≤≥")
        if match["name"] in FUNCTIONS and not first:
            parts.append(THIN)
        parts.append(_element(match, first=first))
        if match["number"] and text[match.end() :].lstrip()[:1].isalpha():
            parts.append(THIN)
        position = match.end()
    return "".join(parts)


def _table(text: str, *, brace: bool) -> str:
    """Return a choice behind a brace, or a matrix in brackets."""
    rows = ["".join(f"<mtd>{_row(cell)}</mtd>" for cell in part.split(";")) for part in text.split("|")]
    cells = "".join(f"<mtr>{row}</mtr>" for row in rows)
    if brace:
        return f'<mrow><mo stretchy="true">{{</mo><mtable columnalign="left left">{cells}</mtable></mrow>'
    opens, closes = '<mo form="prefix" stretchy="true">(</mo>', '<mo form="postfix" stretchy="true">)</mo>'
    return f'<mrow>{opens}<mtable class="matrix">{cells}</mtable>{closes}</mrow>'


def _element(match: re.Match[str], *, first: bool) -> str:
    if match["number"]:
        head, _, power = match["number"].partition("e")
        if not power:
            return f"<mn>{head}</mn>"
        return f"<mn>{head}</mn><mo>·</mo><msup><mn>10</mn><mn>{minus(power.lstrip('+'))}</mn></msup>"
    if match["words"]:
        return f"<mtext>{'' if first else '&nbsp;'}{escape(match['words'][1:-1])}&nbsp;</mtext>"
    if match["operator"]:
        # Brackets keep the size of the text; a leading sign belongs to its number.
        form = ' form="prefix"' if first and match["operator"] in "-−" else ""
        size = ' stretchy="false"' if match["operator"] in "()|" else ""
        size += {"|": ' lspace="0" rspace="0"', "/": ' lspace="0.06em" rspace="0.06em"'}.get(match["operator"], "")
        if match["operator"] == "?":
            return "<mi>?</mi>"
        sign = f"<mo{form}{size}>{escape(match['operator'].replace('-', '−'))}</mo>"
        return f"<msup>{sign}<mn>{_above(match['raised'])}</mn></msup>" if match["raised"] else sign
    upright = ' mathvariant="normal"' if match["name"] in FUNCTIONS else ""
    name = f"<mi{upright}>{escape(match['name'])}</mi>"
    if match["name"].startswith("Δ") and len(match["name"]) > 1:
        # A change is written with an upright Δ before its letter.
        name = f'<mrow><mi mathvariant="normal">Δ</mi><mi>{escape(match["name"][1:])}</mi></mrow>'
    below = f"<mn>{escape(match['below'])}</mn>" if match["below"] else ""
    above = f"<mn>{_above(match['above'])}</mn>" if match["above"] else ""
    tag = f"m{'sub' if below else ''}{'sup' if above else ''}"
    return f"<{tag}>{name}{below}{above}</{tag}>" if below or above else name


def _above(signs: str) -> str:
    return "".join(_SUPERSCRIPTS[sign] for sign in signs)


def signed(value: float, text: str) -> str:
    """Return a term of a sum: the number's text (of |value|) with the value's sign before it."""
    return f"{'−' if value < 0.0 else '+'} {text}"


def effect_formula(place: EffectPlace, values: Mapping[str, str]) -> str | None:
    """Return an effect's formula, with its place and its parameters' texts in it; None without a formula."""
    effect = place.definition
    if not effect.formula:
        return None
    axes = dict(zip("ij", place.axes, strict=False))
    angle = {"outer-axis": "α", "inner-axis": "β"}.get(place.where, "")
    number = place.where.removeprefix("accelerometer-").removeprefix("position-")
    order = "" if place.order in (None, 1) else str(place.order)
    return effect.formula.format(p=number, angle=angle, order=order, **axes, **values)
