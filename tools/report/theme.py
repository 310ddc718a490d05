"""Colours and typography of the pictures."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Colour:
    """A colour by its part in a picture: on a light and on a dark page."""

    light: str
    dark: str


INK = Colour("#22272e", "#dde3ea")
MUTED = Colour("#5b6672", "#9ca8b4")
GRID = Colour("#dce1e6", "#343c46")
QUIET = Colour("#b9c2cb", "#505c69")
BAND = Colour("#dfeaf4", "#22344a")
FIRST = Colour("#0b63b0", "#66b5f6")
SECOND = Colour("#b35a00", "#f0a24d")
THIRD = Colour("#0b7a5b", "#4ccba2")
ALERT = Colour("#bd2560", "#ff80ab")

COLOURS = (INK, MUTED, GRID, QUIET, BAND, FIRST, SECOND, THIRD, ALERT)
AXES = (FIRST, SECOND, THIRD)
"""Colours of the three axes or accelerometers."""

DASHES = ("solid", (0, (5, 1.6)), (0, (1.4, 1.2)))
"""Lines of the three axes: the pictures can be read without colours."""

WIDTH = 7.2
"""Width of every picture [in]."""

FONTS = "'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
"""What a browser sets the text in; laid out with DejaVu Sans, which is wider than all of them."""

STYLE: dict[str, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "trihedron",
    "text.parse_math": False,
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlesize": 9.0,
    "axes.titlelocation": "left",
    "axes.titlepad": 5.0,
    "axes.linewidth": 0.7,
    "axes.edgecolor": MUTED.light,
    "axes.labelcolor": INK.light,
    "axes.titlecolor": INK.light,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.grid": True,
    "axes.facecolor": "none",
    "axes.unicode_minus": True,
    "axes.formatter.use_mathtext": False,
    "axes.formatter.useoffset": False,
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "grid.color": GRID.light,
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "legend.labelcolor": INK.light,
    "legend.handlelength": 2.4,
    "legend.columnspacing": 1.6,
    "lines.linewidth": 1.3,
    "path.simplify": True,
    "path.simplify_threshold": 0.25,
    "text.color": INK.light,
    "xtick.color": MUTED.light,
    "xtick.labelcolor": MUTED.light,
    "xtick.labelsize": 8.5,
    "ytick.color": MUTED.light,
    "ytick.labelcolor": MUTED.light,
    "ytick.labelsize": 8.5,
}
"""Settings of matplotlib, over its defaults."""
