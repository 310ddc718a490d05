"""The style of pictures: colours, typography, sheets of panels, markers, rows with names, legends.

A figure of matplotlib becomes SVG text: the same bytes each time.
"""

import hashlib
import io
import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache, wraps
from html import escape
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...document.blocks import Picture
from ...document.notation import plain, raised

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


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
"""Line styles of the three axes: the pictures can be read without colours."""

WIDTH, CARD = 7.2, 3.1
"""Width of a picture, and of one on a card [in]."""

FONTS = "'Helvetica Neue', Helvetica, Arial, 'Liberation Sans', 'DejaVu Sans', sans-serif"
"""Fonts for browsers; the layout uses DejaVu Sans, which is wider than all of them."""

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


@contextmanager
def drawing() -> Iterator[None]:
    """Draw the block's figures in the house style, independent of the user's own settings."""
    import matplotlib

    with matplotlib.rc_context(), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from", category=UserWarning)
        matplotlib.rcdefaults()
        settings: Any = matplotlib.rcParams
        settings.update(STYLE)
        yield


def svg_text(figure: "Figure", label: str) -> str:
    """Return a figure, drawn inside `drawing`, as an `<svg>` element; `label` is its text for screen readers.

    It is well-formed XML without prologue, transparent, with its own rule for dark pages. Its ids are its own, so one
    page can hold several pictures.
    """
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    stream = io.StringIO()
    # `savefig` traverses the whole figure once more before it draws; the single drawing finds the layout too.
    metadata = {"Date": None, "Creator": None, "Format": None, "Type": None}
    FigureCanvasSVG(figure).print_svg(stream, metadata=metadata)
    text = stream.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->\s*", "", text, flags=re.DOTALL)
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    text = text.replace("'DejaVu Sans'", FONTS).replace(">*{", ">.trihedron-picture *{")
    # Copies of a marker carry their own colours; those of the original would hide them from the rules of dark pages.
    text = re.sub(r'(<path id="[^"]*" d="[^"]*" style=")([^"]*)(?=")', _without_colours, text)
    text = re.sub(r'(?<= )(?:d|x|y)="[^"]*"', _shortened, text)
    head, _, body = text.partition(">")
    box = re.search(r'viewBox="[^"]*"', head)
    assert box is not None
    names = f'xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" {box.group()}'
    head = f'<svg {names} class="trihedron-picture" role="img" aria-label="{escape(plain(label), quote=True)}">'
    return f"{head}\n<style>{_dark_rules()}</style>{_own_ids(body)}".rstrip() + "\n"


def _without_colours(match: re.Match[str]) -> str:
    return match[1] + re.sub(r"(?:fill|stroke): #[0-9a-f]{6}(?:; )?", "", match[2])


def _shortened(match: re.Match[str]) -> str:
    """Round coordinates to a hundredth of a point: finer differences are invisible."""
    return re.sub(r"-?\d+\.\d{3,}", lambda number: f"{float(number[0]):.2f}", match[0])


def _dark_rules() -> str:
    rules = [
        f'.trihedron-picture [style*="{name}: {colour.light}"]{{{name}:{colour.dark}!important}}'
        for colour in COLOURS
        for name in ("fill", "stroke")
    ]
    return "@media screen and (prefers-color-scheme: dark){" + "".join(rules) + "}"


def _own_ids(text: str) -> str:
    """Drop unused ids, and make the others unique to this picture."""
    mark = hashlib.sha256(text.encode()).hexdigest()[:10]
    references = dict.fromkeys(re.findall(r'(?:url\(#|href="#)([^)"]+)', text))
    fresh = {name: f"p{mark}-{number}" for number, name in enumerate(references)}

    def renamed(match: re.Match[str]) -> str:
        return f' id="{fresh[match[1]]}"' if match[1] in fresh else ""

    text = re.sub(r' id="([^"]*)"', renamed, text)
    return re.sub(r'(url\(#|href="#)([^)"]+)', lambda m: m[1] + fresh[m[2]], text)


def say_empty(axes: "Axes", text: str = "no data") -> None:
    """Write in the middle of the axes that there is no data."""
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color=MUTED.light)


def power_of_ten(value: float, _: object = None) -> str:
    """Return a label of a logarithmic axis."""
    return raised(round(float(np.log10(value))))


P = ParamSpec("P")
Drawn: TypeAlias = "tuple[Figure, str]"
"""A figure, and its description for screen readers. Matplotlib is loaded with the first one."""

BEFORE: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 4.2, "markerfacecolor": "none", "color": SECOND.light
}  # fmt: skip
AFTER: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 3.2, "markeredgewidth": 0, "color": FIRST.light
}  # fmt: skip
PROOF: dict[str, Any] = {
    "linestyle": "none", "marker": "D", "markersize": 7.6, "markerfacecolor": "none", "markeredgewidth": 1.2,
    "color": ALERT.light,
}  # fmt: skip
"""Markers of residuals without effects, of residuals with them, and of the proof that no parameters fit."""


def drawn(draw: "Callable[P, Drawn]") -> Callable[P, Picture]:
    """Decorate a function that draws and describes a figure: return a picture that is drawn at its first use."""

    @wraps(draw)
    def picture(*arguments: P.args, **options: P.kwargs) -> Picture:
        @cache
        def figure_and_svg() -> "tuple[Figure, str]":
            with drawing():
                figure, label = draw(*arguments, **options)
                return figure, svg_text(figure, label)

        return Picture(lambda: figure_and_svg()[0], lambda: figure_and_svg()[1])

    return picture


def sheet(
    height: float, rows: int = 1, columns: int = 1, *, width: float = WIDTH, **shared: Any
) -> "tuple[Figure, NDArray[Any]]":
    """Return a figure of this size [in], and its panels (rows, columns)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared) if rows else np.zeros((0, 0))


def legend(figure: "Figure", columns: int = 4, **how: Any) -> None:
    """Draw a legend above the panels, each label once; a card has two columns at most."""
    handles: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        columns = min(columns, 2) if figure.get_figwidth() == CARD else columns
        where = {"loc": "outside upper left", "ncols": columns, "handletextpad": 0.5, **how}
        figure.legend(list(handles.values()), list(handles), **where)


def legend_beside(axes: "Axes", columns: int) -> None:
    """Draw the legend of one panel, in a line with its title."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderpad=0.0, borderaxespad=0.35)


def named_rows(axes: "Axes", labels: Sequence[str], *, lines: bool = False, **ticks: Any) -> None:
    """Name the rows of a panel, the first above; `lines` between them or none."""
    axes.set_yticks(np.arange(len(labels)), labels)
    axes.tick_params(axis="y", length=0, labelcolor=INK.light, **ticks)
    axes.set_ylim(max(len(labels), 2) - 0.4, -0.6)
    if not lines:
        axes.grid(visible=False, axis="y")
    if not len(labels):
        say_empty(axes)


def zero_line(axes: "Axes") -> None:
    """Draw zero, and the band of a noise bound about it, one in its units."""
    axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0, label="within ±σ")
    axes.axhline(0.0, color=MUTED.light, linewidth=0.6)


def one_turn(axes: "Axes", angle: NDArray, of: str = "x", room: float = 8.0) -> None:
    """Set an axis of angles [deg] to a whole turn, unless they lie beyond it."""
    finite = angle[np.isfinite(angle)]
    if not finite.size or (finite.min() >= -1.0 and finite.max() <= 361.0):
        axes.set(**{f"{of}lim": (-room, 360.0 + room), f"{of}ticks": range(0, 361, 90)})


def log_ticks(axes: "Axes", ticks: Iterable[float]) -> None:
    """Set plain numbers at some places of a logarithmic axis, as far as it reaches."""
    low, high = axes.get_xlim()
    visible = [tick for tick in ticks if low <= tick <= high]
    axes.set_xticks(visible, [f"{tick:g}" for tick in visible])
    axes.minorticks_off()


def farthest(*values: NDArray | None) -> float:
    """Return the largest size of finite values; zero if there are none."""
    sizes = np.abs(np.concatenate([np.ravel(v) for v in values if v is not None]))
    return float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
