"""Pictures that rank or compare: how alike effects look, published numbers against reproduced ones."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.ticker import FixedLocator, NullFormatter
from numpy.typing import ArrayLike

from ...document.theme import ALERT, AXES, BAND, FIRST, GRID, INK, MUTED, WIDTH, drawing, power_of_ten, short, svg_text
from ...papers.attitude import TABLES
from ...papers.reproduction import Reproduction

SHOWN_FROM = 0.005
CLOSE = 0.9
"""From here on a field is marked: the two are hard to tell apart."""


def likeness_picture(labels: Sequence[str], alike: ArrayLike) -> str:
    """The lower half of a symmetric matrix.

    Parameters
    ----------
    labels : sequence of str, length K
    alike : array, shape (K, K)
        from 0 to 1

    Returns
    -------
    str
        SVG
    """
    values = np.asarray(alike, dtype=float).reshape(len(labels), len(labels))
    count = len(labels)
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.7 + 0.3 * count), layout="constrained")
        axes = figure.subplots()
        for i, j in np.argwhere(np.tri(count, k=-1)).tolist():
            close = values[i, j] >= CLOSE
            axes.add_patch(Rectangle((j - 0.46, i - 0.44), 0.92, 0.88, facecolor=BAND.light, linewidth=0))
            if close:
                edge = {"facecolor": "none", "edgecolor": FIRST.light, "linewidth": 1.4}
                axes.add_patch(Rectangle((j - 0.46, i - 0.44), 0.92, 0.88, **edge))
            if values[i, j] >= SHOWN_FROM:
                text = f"{np.floor(values[i, j] * 100) / 100:.2f}" if values[i, j] < 1 - 1e-9 else "1"
                axes.text(j, i, text, ha="center", va="center", fontsize=8.0, color=INK.light)
        for k in range(count):
            axes.text(k, k, str(k + 1), ha="center", va="center", fontsize=8.5, color=INK.light, fontweight="bold")
        axes.set_xlim(-0.6, count - 0.4)
        axes.set_ylim(count - 0.4, -0.6)
        axes.set_yticks(range(count), [f"{k} · {short(label, 46)}" for k, label in enumerate(labels, start=1)])
        axes.set_xticks([])
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.grid(visible=False)
        for side in axes.spines.values():
            side.set_color(GRID.light)
            side.set_visible(False)
        return svg_text(figure, "How alike effects look at the positions of the record")


MARKERS = ("o", "s", "^")
SHOWN = (0.25, 4.0)
"""Ratios that the picture shows; what lies outside stands at its edge."""


def published_and_reproduced(result: Reproduction) -> str:
    """Ratio of reproduced to published error for every row, and below it how far the method's own error lies.

    Returns
    -------
    str
        SVG
    """
    numbers = np.array([row.row for row in result.rows])
    ratios = np.array([row.ratio for row in result.rows]).reshape(-1, 3)
    published = np.array([row.published_deg for row in result.rows]).reshape(-1, 3)
    method = np.array([row.method_error_deg for row in result.rows]).reshape(-1, 3)
    tables = [row.table for row in result.rows]
    with drawing():
        figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.2])
        above.axhspan(0.95, 1.05, color=BAND.light, linewidth=0)
        for k, name in enumerate(("ψ", "ϑ", "γ")):
            look = {"marker": MARKERS[k], "linestyle": "none", "markersize": 3.2}
            above.plot(numbers, np.clip(ratios[:, k], *SHOWN), color=AXES[k].light, label=name, **look)
            below.plot(numbers, published[:, k], color=AXES[k].light, label=name, **look)
            below.plot(numbers, method[:, k], color=AXES[k].light, markerfacecolor="none", **look)
        for axes in (above, below):
            axes.set_yscale("log")
            for k in range(1, len(tables)):
                if tables[k] != tables[k - 1]:
                    axes.axvline(0.5 * (numbers[k] + numbers[k - 1]), color=MUTED.light, linewidth=0.7)
        above.set_ylim(0.9 * SHOWN[0], 1.1 * SHOWN[1])
        above.yaxis.set_major_locator(FixedLocator([0.25, 0.5, 1.0, 2.0, 4.0]))
        above.yaxis.set_minor_locator(FixedLocator([]))
        above.yaxis.set_major_formatter(lambda value, _: f"{value:g}")
        above.yaxis.set_minor_formatter(NullFormatter())
        outside = (ratios < SHOWN[0]) | (ratios > SHOWN[1])
        if outside.any():
            shown = np.where(outside, np.clip(ratios, *SHOWN), np.nan)
            above.plot(numbers, shown, marker="x", color=ALERT.light, linestyle="none", markersize=6)
        above.set_ylabel("reproduced / published")
        above.set_title("under the paper's conditions")
        above.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderpad=0.0, borderaxespad=0.35)
        below.set_ylabel("largest error over 600 s [deg]")
        below.set_title("full: published; open: exact increments, exact π, normalised")
        below.yaxis.set_major_formatter(power_of_ten)
        below.set_xlabel("row (" + "; ".join(_spans(numbers, tables)) + ")", color=INK.light)
        return svg_text(
            figure, "Ratios of reproduced to published attitude errors, and the methods' own errors, by row"
        )


def _spans(numbers: np.ndarray, tables: list[str]) -> list[str]:
    """Each table with its first and last row."""
    spans = []
    for table in dict.fromkeys(tables):
        within = [int(n) for n, t in zip(numbers, tables, strict=True) if t == table]
        spans.append(f"{TABLES[table]}: {min(within)} to {max(within)}")
    return spans
