"""Pictures of a suite of hidden effects: confusion, detection against size, errors of the estimated sizes."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike

from .svg import column, drawing, say_empty, short, svg_text
from .theme import ALERT, BAND, FIRST, INK, MUTED, QUIET, SECOND, WIDTH

LEAST_SHADE, MOST_SHADE = 0.15, 0.5
"""Of a cell with few and with all of its row's cases: numbers can be read on both."""


def confusion_picture(table: Mapping[str, Mapping[str, int]]) -> str:
    """How often each secret (rows) was given each name or verdict (columns).

    Parameters
    ----------
    table : mapping of str to mapping of str to int
        secret -> what was made of it -> how often

    Returns
    -------
    str
        SVG; what was named rightly stands on the diagonal in one colour, all else in another
    """
    rows = list(table)
    made = {name for row in table.values() for name in row}
    columns = [name for name in rows if name in made] + sorted(made - set(rows))
    with drawing():
        height = 1.9 + 0.23 * max(len(rows), 2)
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        axes = figure.subplots()
        for y, row in enumerate(rows):
            total = sum(table[row].values())
            for x, name in enumerate(columns):
                count = table[row].get(name, 0)
                if not count:
                    continue
                right = name == row
                colour = FIRST if right else QUIET if name.startswith("ambiguous, among") else ALERT
                shade = LEAST_SHADE + (MOST_SHADE - LEAST_SHADE) * count / total
                box = {"s": 118, "marker": "s", "linewidth": 0}
                axes.scatter([x], [y], color=colour.light, alpha=shade, **box)
                axes.text(x, y, str(count), ha="center", va="center", fontsize=7.5, color=INK.light)
        axes.set_xticks(np.arange(len(columns)), [short(c, 30) for c in columns], rotation=60, ha="right",
                        rotation_mode="anchor")  # fmt: skip
        axes.set_yticks(np.arange(len(rows)), [short(r, 44) for r in rows])
        axes.tick_params(length=0, labelcolor=INK.light, labelsize=8)
        axes.set_xlim(-0.6, max(len(columns), 2) - 0.4)
        axes.set_ylim(max(len(rows), 2) - 0.4, -0.6)
        axes.set_xlabel("what was made of it")
        axes.set_ylabel("hidden")
        if not rows:
            say_empty(axes)
        return svg_text(figure, "How often each hidden effect was given each name or verdict")


def detection_picture(size: ArrayLike, detected: ArrayLike, named: ArrayLike, cases: Sequence[int]) -> str:
    """Part of the cases in which the model was falsified, and in which the effect was named, against its size.

    Parameters
    ----------
    size : array, shape (B,)
        middle of each range of sizes, relative to that of sure detection
    detected, named : array, shape (B,)
        parts of the cases, 0 to 1
    cases : sequence of int, length B
        how many cases each range holds

    Returns
    -------
    str
        SVG
    """
    x, first, second = (column(values) for values in (size, detected, named))
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
        axes = figure.subplots()
        axes.axvline(1.0, color=MUTED.light, linewidth=0.9, linestyle=(0, (5, 2)))
        # Side by side, so that neither hides the other where both are the same.
        for at, values, colour, marker in ((x / 1.02, first, FIRST, "o"), (x * 1.02, second, SECOND, "s")):
            spread = np.array([np.zeros(2) if n == 0 else wilson(v, n) for v, n in zip(values, cases, strict=True)])
            spread = spread.reshape(-1, 2)
            axes.vlines(at, spread[:, 0], spread[:, 1], color=colour.light, linewidth=0.9, alpha=0.6)
            axes.plot(at, values, marker=marker, markersize=4.2, color=colour.light)
        axes.set_xscale("log")
        axes.set_ylim(-0.04, 1.06)
        axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "100 %"])
        if len(x):
            low, high = float(np.nanmin(x)), float(np.nanmax(x))
            axes.set_xlim(min(0.7, 0.8 * low), max(1.4, 1.25 * high))
        ticks = [t for t in (0.25, 0.5, 1, 2, 4, 8, 16, 32) if axes.get_xlim()[0] <= t <= axes.get_xlim()[1]]
        axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.minorticks_off()
        axes.set_xlabel("size over that of sure detection")
        axes.set_ylabel("part of the cases")
        handles = [
            Line2D([], [], color=FIRST.light, marker="o", markersize=4.2, label="falsified"),
            Line2D([], [], color=SECOND.light, marker="s", markersize=4.2, label="named rightly"),
            Line2D([], [], color=MUTED.light, linewidth=0.9, linestyle=(0, (5, 2)), label="surely detected from here"),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3)
        if not len(x):
            say_empty(axes)
        return svg_text(figure, "Part of the cases falsified and named rightly, against the size of the hidden effect")


def wilson(part: float, count: int) -> np.ndarray:
    """Ends of the 95 % interval of a probability of which `part` of `count` trials came true (Wilson's score)."""
    z = 1.959964
    middle = part + z**2 / (2 * count)
    half = z * np.sqrt(max(part * (1.0 - part), 0.0) / count + (z / (2 * count)) ** 2)
    return np.array([middle - half, middle + half]) / (1.0 + z**2 / count)


def size_errors_picture(size: ArrayLike, error: ArrayLike) -> str:
    """Relative errors of the estimated sizes of effects that were named rightly, against their true size.

    Parameters
    ----------
    size : array, shape (K,)
        relative to that of sure detection
    error : array, shape (K,)
        estimate over truth, less one

    Returns
    -------
    str
        SVG
    """
    x, y = column(size), column(error)
    shown = np.isfinite(x) & np.isfinite(y)
    x, y = x[shown], 100.0 * y[shown]
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
        axes = figure.subplots()
        axes.axhline(0.0, color=MUTED.light, linewidth=0.7)
        axes.plot(x, y, linestyle="none", marker="o", markersize=3.2, color=FIRST.light, alpha=0.6, markeredgewidth=0)
        if len(x):
            axes.set_xscale("log")
            reach = 1.15 * max(float(np.abs(y).max()), 1.0)
            axes.set_ylim(-reach, reach)
            mean, error_of_mean = float(y.mean()), 2.0 * float(y.std()) / np.sqrt(len(y))
            axes.axhspan(mean - error_of_mean, mean + error_of_mean, color=BAND.light, linewidth=0, zorder=0)
            axes.axhline(mean, color=SECOND.light, linewidth=1.1)
            ticks = [t for t in (0.5, 1, 2, 5, 10, 20, 50) if 0.8 * x.min() <= t <= 1.25 * x.max()]
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
            axes.minorticks_off()
            label = f"mean {mean:+.2f} %, with twice its standard error"
            figure.legend(handles=[Line2D([], [], color=SECOND.light, linewidth=1.1, label=label)],
                          loc="outside upper left")  # fmt: skip
        else:
            say_empty(axes)
        axes.set_xlabel("true size over that of sure detection")
        axes.set_ylabel("error of the estimate [%]")
        return svg_text(figure, "Relative errors of the estimated sizes against the true size")
