"""How pictures are drawn: sheets of panels, marks that mean something, rows with names, legends; SVG by matplotlib."""

from collections.abc import Callable, Iterable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...document.theme import ALERT, BAND, FIRST, INK, MUTED, SECOND, WIDTH, drawing, say_empty, svg_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")
Drawn: TypeAlias = "tuple[Figure, str]"
"""A figure, and what it shows, for those who cannot see it. Matplotlib is loaded when the first one is drawn."""

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
"""Marks of what is left without effects, of what is left with them, and of what proves that no parameters fit."""


def drawn(draw: "Callable[P, Drawn]") -> Callable[P, str]:
    """The picture of a function that draws a figure and says what it shows: SVG."""

    @wraps(draw)
    def made(*arguments: P.args, **options: P.kwargs) -> str:
        with drawing():
            return svg_text(*draw(*arguments, **options))

    return made


def sheet(height: float, rows: int = 1, columns: int = 1, **shared: Any) -> "tuple[Figure, NDArray[Any]]":
    """A figure so high [in], and its panels (rows, columns)."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, height), layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **shared) if rows else np.zeros((0, 0))


def legend(figure: "Figure", columns: int = 4, **how: Any) -> None:
    """What was drawn with a label, each label once, above the panels."""
    named: dict[str, Any] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            named.setdefault(label, handle)
    if named:
        where = {"loc": "outside upper left", "ncols": columns, "handletextpad": 0.5, **how}
        figure.legend(list(named.values()), list(named), **where)


def legend_beside(axes: "Axes", columns: int) -> None:
    """The legend of one panel, in a line with its title."""
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderpad=0.0, borderaxespad=0.35)


def named_rows(axes: "Axes", labels: Sequence[str], *, lines: bool = False, **ticks: Any) -> None:
    """Rows with names, the first above, whatever stands in them; `lines` between them or none."""
    axes.set_yticks(np.arange(len(labels)), labels)
    axes.tick_params(axis="y", length=0, labelcolor=INK.light, **ticks)
    axes.set_ylim(max(len(labels), 2) - 0.4, -0.6)
    if not lines:
        axes.grid(visible=False, axis="y")
    if not len(labels):
        say_empty(axes)


def zero_line(axes: "Axes", band: tuple[float, float] | None = None, label: str = "") -> None:
    """Zero, and the band within which something is as it should be."""
    if band is not None:
        axes.axhspan(*band, color=BAND.light, linewidth=0, zorder=0, label=label)
    axes.axhline(0.0, color=MUTED.light, linewidth=0.6)


def one_turn(axes: "Axes", angle: NDArray, of: str = "x", room: float = 8.0) -> None:
    """An axis of angles [deg] shows a whole turn, unless they lie beyond it."""
    known = angle[np.isfinite(angle)]
    if not known.size or (known.min() >= -1.0 and known.max() <= 361.0):
        axes.set(**{f"{of}lim": (-room, 360.0 + room), f"{of}ticks": range(0, 361, 90)})


def log_ticks(axes: "Axes", ticks: Iterable[float]) -> None:
    """Plain numbers at some places of a logarithmic axis, as far as it reaches."""
    low, high = axes.get_xlim()
    shown = [tick for tick in ticks if low <= tick <= high]
    axes.set_xticks(shown, [f"{tick:g}" for tick in shown])
    axes.minorticks_off()


def farthest(*values: NDArray | None) -> float:
    """The largest size of finite values; zero where there is none."""
    sizes = np.abs(np.concatenate([np.ravel(v) for v in values if v is not None]))
    return float(np.max(sizes[np.isfinite(sizes)], initial=0.0))
