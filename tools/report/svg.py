"""A matplotlib figure as SVG text: the same bytes each time, for light and dark pages."""

import hashlib
import io
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from .theme import COLOURS, FONTS, MUTED, STYLE

_NOT_XML = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_NOT_DATA = ("metadata",)


def plain(text: object) -> str:
    """One line of text with nothing in it that XML cannot hold."""
    return " ".join(_NOT_XML.sub("\ufffd", str(text)).split())


def short(text: object, most: int = 48) -> str:
    """`plain`, cut so that it can stand beside an axis."""
    line = plain(text)
    return line if len(line) <= most else line[: most - 1].rstrip() + "…"


@contextmanager
def drawing() -> Iterator[None]:
    """Within it, figures take the house style whatever the user's own settings are."""
    with matplotlib.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(STYLE)
        yield


def svg_text(figure: Figure, label: str) -> str:
    """The figure as an `<svg>` element.

    Parameters
    ----------
    figure : Figure
        drawn with the colours of the theme, inside `drawing`
    label : str
        what the picture shows, for those who cannot see it

    Returns
    -------
    str
        well-formed XML without prologue, transparent, with its own rule for dark pages; its ids are its own, so that
        several pictures can stand in one page
    """
    stream = io.StringIO()
    figure.savefig(stream, format="svg", metadata={"Date": None, "Creator": None, "Format": None, "Type": None})
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    for name in _NOT_DATA:
        text = re.sub(rf"\s*<{name}>.*?</{name}>", "", text, flags=re.DOTALL)
    text = text.replace("'DejaVu Sans'", FONTS).replace(">*{", ">.trihedron-picture *{")
    # Copies of a marker carry their own colours; those of the original would hide them from the rules of dark pages.
    text = re.sub(r'(<path id="[^"]*" d="[^"]*" style=")([^"]*)(?=")', _without_colours, text)
    text = re.sub(r'(?<= )(?:d|x|y)="[^"]*"', _shortened, text)
    head, _, body = text.partition(">")
    box = re.search(r'viewBox="[^"]*"', head)
    assert box is not None
    names = f'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" {box.group()}'
    head = f'<svg {names} class="trihedron-picture" role="img" aria-label="{_attribute(label)}">'
    return f"{head}\n<style>{_dark_rules()}</style>{_own_ids(body)}".rstrip() + "\n"


def _without_colours(match: re.Match[str]) -> str:
    return match[1] + re.sub(r"(?:fill|stroke): #[0-9a-f]{6}(?:; )?", "", match[2])


def _shortened(match: re.Match[str]) -> str:
    """Coordinates to a hundredth of a point: finer cannot be seen."""
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", match[0])


def _attribute(text: str) -> str:
    for character, name in (("&", "&amp;"), ("<", "&lt;"), (">", "&gt;"), ('"', "&quot;")):
        text = text.replace(character, name)
    return plain(text)


def _dark_rules() -> str:
    rules = [
        f'.trihedron-picture [style*="{name}: {colour.light}"]{{{name}:{colour.dark}!important}}'
        for colour in COLOURS
        for name in ("fill", "stroke")
    ]
    return "@media screen and (prefers-color-scheme: dark){" + "".join(rules) + "}"


def _own_ids(text: str) -> str:
    """Drop the ids that nothing refers to, and make the others this picture's own."""
    mark = hashlib.sha256(text.encode()).hexdigest()[:10]
    used = dict.fromkeys(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    fresh = {name: f"p{mark}-{number}" for number, name in enumerate(used)}

    def renamed(match: re.Match[str]) -> str:
        return f' id="{fresh[match[1]]}"' if match[1] in fresh else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    return re.sub(r'(url\(#|href="#)([^)"]+)', lambda m: m[1] + fresh[m[2]], text)


def say_empty(axes: Axes, text: str = "no data") -> None:
    """Say in the middle of the axes that there is nothing to show."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=MUTED.light)


def column(values: object) -> np.ndarray:
    """Values as a flat array of doubles; what is not finite as NaN."""
    array = np.array(values, dtype=np.float64).reshape(-1)
    array[~np.isfinite(array)] = np.nan
    return array


def three_columns(values: object) -> np.ndarray:
    """Values as an (N, 3) array of doubles; what is not finite as NaN."""
    array = np.array(values, dtype=np.float64)
    array = array.reshape(-1, 3).copy()
    array[~np.isfinite(array)] = np.nan
    return array


def power_of_ten(value: float, _: object = None) -> str:
    """A label of a logarithmic axis: 10⁻³."""
    power = round(math.log10(value))
    return "10" + str(power).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
