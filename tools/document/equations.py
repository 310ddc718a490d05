"""Equations with their numbers, as MathML: read by every browser without script, fonts or network."""

import re
from collections.abc import Mapping
from html import escape

from ...models.effects import CATALOGUE, EffectPlace
from .numbers import minus
from .theme import plain

_SUPERSCRIPTS = {"²": "2", "³": "3", "⁺": "+", "⁻": "−", "ᵀ": "T"}
_TOKEN = re.compile(
    r"(?P<number>\d+(?:\.\d+)?(?:e[−+-]?\d+)?)"
    r"|(?P<name>[A-Za-zΑ-Ωα-ωϑ][A-Za-zΑ-Ωα-ωϑ]*\*?)(?:_(?P<below>[A-Za-z0-9]+))?(?P<above>[²³⁺⁻ᵀ])?"
    r"|(?P<words>'[^']*')"
    r"|(?P<operator>[-+−·×∘/()=|,<>≤≥±;°?])(?P<raised>[²³])?"
)
FUNCTIONS = ("sin", "cos", "exp", "sign", "up")
THIN = '<mspace width="0.17em"/>'


def math(text: str) -> str:
    """A formula in plain text as MathML.

    Parameters
    ----------
    text : str
        names of one or more letters with ``_`` before an index (n_3, Γ_21), powers as ² and ³, numbers with a power of
        ten as 1.2e−3, words between single quotes; ``{a ; b | c ; d}`` is a choice: a where b, c where d;
        ``[a ; b | c ; d]`` is a matrix with the rows a b and c d

    Returns
    -------
    str
        a `<math>` element, one line
    """
    return f'<math display="block"><mrow>{_row(plain(text))}</mrow></math>'


def _row(text: str) -> str:
    parts = []
    position = 0
    while position < len(text):
        if text[position] in "{[":
            brace = text[position] == "{"
            end = text.index("}" if brace else "]", position)
            parts.append((_choice if brace else _matrix)(text[position + 1 : end]))
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


def _choice(text: str) -> str:
    rows = [part.split(";") for part in text.split("|")]
    cells = "".join(f"<mtr><mtd>{_row(value)}</mtd><mtd>{_row(where)}</mtd></mtr>" for value, where in rows)
    return f'<mrow><mo stretchy="true">{{</mo><mtable columnalign="left left">{cells}</mtable></mrow>'


def _matrix(text: str) -> str:
    rows = ["".join(f"<mtd>{_row(cell)}</mtd>" for cell in part.split(";")) for part in text.split("|")]
    cells = "".join(f"<mtr>{row}</mtr>" for row in rows)
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
        # Brackets keep the size of the text; a sign at the beginning belongs to its number.
        form = ' form="prefix"' if first and match["operator"] in "-−" else ""
        size = ' stretchy="false"' if match["operator"] in "()|" else ""
        size += {"|": ' lspace="0" rspace="0"', "/": ' lspace="0.06em" rspace="0.06em"'}.get(match["operator"], "")
        if match["operator"] == "?":
            return "<mi>?</mi>"
        sign = f"<mo{form}{size}>{escape(match['operator'].replace('-', '−'))}</mo>"
        return f"<msup>{sign}<mn>{_SUPERSCRIPTS[match['raised']]}</mn></msup>" if match["raised"] else sign
    name = _name(match["name"])
    below = f"<mn>{escape(match['below'])}</mn>" if match["below"] else ""
    above = f"<mn>{_SUPERSCRIPTS[match['above']]}</mn>" if match["above"] else ""
    if below and above:
        return f"<msubsup>{name}{below}{above}</msubsup>"
    if below or above:
        return f"<m{'sub' if below else 'sup'}>{name}{below}{above}</m{'sub' if below else 'sup'}>"
    return name


def _name(text: str) -> str:
    """A name; a change is written with an upright Δ before the letter that it is of."""
    if text.startswith("Δ") and len(text) > 1:
        return f'<mrow><mi mathvariant="normal">Δ</mi><mi>{escape(text[1:])}</mi></mrow>'
    upright = ' mathvariant="normal"' if text in FUNCTIONS else ""
    return f"<mi{upright}>{escape(text)}</mi>"


def signed(value: float, text: str, *, first: bool = False) -> str:
    """A term of a sum: the number's text (of |value|) with the value's sign before it."""
    if first:
        return f"−{text}" if value < 0.0 else text
    return f"{'−' if value < 0.0 else '+'} {text}"


def effect_formula(place: EffectPlace, values: Mapping[str, str]) -> str | None:
    """What an effect adds, with its place and its parameters' texts in it; None where it has no formula.

    Parameters
    ----------
    place : EffectPlace
    values : mapping
        parameter -> number as text, or a letter
    """
    effect = CATALOGUE[place.effect].at(place)
    if not effect.formula:
        return None
    axes = dict(zip("ij", place.axes, strict=False))
    angle = {"outer-axis": "α", "inner-axis": "β"}.get(place.where, "")
    number = place.where.removeprefix("accelerometer-").removeprefix("position-")
    order = "" if place.order in (None, 1) else str(place.order)
    return effect.formula.format(p=number, angle=angle, order=order, **axes, **values)
