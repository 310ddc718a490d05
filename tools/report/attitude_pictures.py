"""Pictures of attitude algorithms: published against reproduced errors."""

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, NullFormatter

from ..papers.attitude import TABLES
from ..papers.reproduction import Reproduction
from .svg import drawing, power_of_ten, svg_text
from .theme import ALERT, AXES, BAND, INK, MUTED, WIDTH

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
