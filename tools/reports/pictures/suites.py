"""Pictures of many cases: confusion, detection, sizes; distributions, rates and sensitivities of campaigns."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from ...document.theme import (
    ALERT,
    BAND,
    DASHES,
    FIRST,
    INK,
    MUTED,
    QUIET,
    SECOND,
    THIRD,
    WIDTH,
    column,
    drawing,
    power_of_ten,
    say_empty,
    short,
    svg_text,
)

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


BINS = 40
DECADES = 2.0
"""Positive values that span more decades are drawn against their logarithm."""
MOST_TICKS = 5
MOST_DRAWN = 12
"""Scalars or parameters that one picture shows."""


def distributions_picture(columns: Mapping[str, NDArray], marks: Mapping[str, Sequence[float]]) -> str:
    """A histogram of each scalar, with its quantiles.

    Parameters
    ----------
    columns : mapping of str to array
        values of each scalar; what is not finite is left out
    marks : mapping of str to sequence of float
        values at which a line is drawn
    """
    names = list(columns)[:MOST_DRAWN]
    rows = -(-len(names) // 2)
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.5 + 1.55 * max(rows, 1)), layout="constrained")
        axes = figure.subplots(max(rows, 1), 2 if len(names) > 1 else 1, squeeze=False)
        for ax in axes.flat[len(names) :]:
            ax.set_axis_off()
        for ax, name in zip(axes.flat, names, strict=False):
            values = columns[name][np.isfinite(columns[name])]
            ax.set_title(short(name, 44))
            ax.set_yticks([])
            ax.grid(visible=False)
            if not len(values):
                say_empty(ax)
                continue
            low, high = float(values.min()), float(values.max())
            if low == high:
                ax.set_xticks([])
                say_empty(ax, f"always {low:.4g}")
                continue
            wide = low > 0.0 and math.log10(high / low) > DECADES
            edges = np.geomspace(low, high, BINS + 1) if wide else np.linspace(low, high, BINS + 1)
            ax.hist(values, bins=edges, color=FIRST.light, alpha=0.75, linewidth=0)
            if wide:
                ax.set_xscale("log")
                ax.minorticks_off()
                decades = np.arange(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
                shown = decades[:: -(-len(decades) // MOST_TICKS)]
                ax.set_xticks(10.0**shown, [power_of_ten(10.0**d) for d in shown])
            else:
                ax.locator_params(axis="x", nbins=5)
                if 0.0 < max(abs(low), abs(high)) < 1e-2:
                    ax.ticklabel_format(axis="x", style="sci", scilimits=(0, 0), useMathText=True)
            for mark in marks.get(name, ()):
                ax.axvline(mark, color=SECOND.light, linewidth=0.9, linestyle=(0, (4, 2)))
        return svg_text(figure, f"Distribution of {', '.join(names)}; dashed lines are quantiles")


def rates_picture(curves: Mapping[str, Sequence[Mapping[str, Any]]], against: str) -> str:
    """Rates over ranges of a scalar, each with its interval of 95 %.

    Parameters
    ----------
    curves : mapping of str to sequence of mapping
        label -> ranges with low, high, cases, rate and interval
    against : str
        the scalar
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
        axes = figure.subplots()
        handles = []
        drawn = [entry for ranges in curves.values() for entry in ranges if entry["cases"]]
        positive = bool(drawn) and max(e["high"] for e in drawn) > 0.0 and all(e["low"] >= 0.0 for e in drawn)
        colours = (FIRST, SECOND, THIRD)
        for k, (label, ranges) in enumerate(curves.items()):
            there = [entry for entry in ranges if entry["cases"]]
            x = np.array([_middle(entry["low"], entry["high"], positive=positive) for entry in there])
            # Side by side, so that none hides another where both are the same.
            x = x * 1.02 ** (2 * k - len(curves) + 1) if positive else x
            colour, marker = colours[k % 3], "os^"[k % 3]
            ends = np.array([entry["interval"] for entry in there]).reshape(-1, 2)
            axes.vlines(x, ends[:, 0], ends[:, 1], color=colour.light, linewidth=0.9, alpha=0.6)
            y = [entry["rate"] for entry in there]
            axes.plot(x, y, marker=marker, markersize=4.2, color=colour.light, linestyle=DASHES[k % 3])
            handles.append(Line2D([], [], color=colour.light, marker=marker, markersize=4.2, label=short(label, 60)))
        if positive:
            axes.set_xscale("log")
            axes.minorticks_off()
            low, high = axes.get_xlim()
            ticks = [t for t in 10.0 ** np.arange(-12, 13) if low <= t <= high]
            if len(ticks) < 3:
                ticks = [m * 10.0**d for d in range(-12, 13) for m in (1.0, 2.0, 5.0) if low <= m * 10.0**d <= high]
            axes.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axes.set_ylim(-0.04, 1.06)
        axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "100 %"])
        axes.set_xlabel(short(against))
        axes.set_ylabel("part of the runs")
        if handles:
            figure.legend(handles=handles, loc="outside upper left", ncols=min(len(handles), 3))
        if not drawn:
            say_empty(axes)
        return svg_text(figure, f"Part of the runs against {against}, with intervals of 95 %")


def _middle(low: float, high: float, *, positive: bool) -> float:
    if not positive:
        return 0.5 * (low + high)
    return math.sqrt(low * high) if low > 0.0 else high / math.sqrt(2.0)


def chance_of(runs: int) -> float:
    """Within so much of zero 95 % of the rank correlations stay where there is no connection; one at most."""
    return min(1.0, 1.96 / math.sqrt(max(runs - 1, 1)))


def sensitivity_picture(name: str, found: Mapping[str, Any], runs: int) -> str:
    """How a scalar depends on the parameters: Sobol indices with their intervals, or rank correlations.

    Parameters
    ----------
    name : str
        of the scalar
    found : mapping
        what `trihedron.tools.campaign.summary.sensitivity` says of it
    runs : int
        of which it is said
    """
    sobol = found["method"] == "sobol"
    key = "total" if sobol else "correlation"
    rows = sorted(found["parameters"].items(), key=lambda pair: abs(pair[1][key] or 0.0))[-MOST_DRAWN:]
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.95 + 0.27 * max(len(rows), 2)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(0.0, color=MUTED.light, linewidth=0.7)
        handles = []
        if sobol:
            series = (("total", 0.14, FIRST, "o"), ("first", -0.14, SECOND, "s"))
            for part, shift, colour, marker in series:
                for y, (_, entry) in enumerate(rows):
                    if entry[part] is not None:
                        low, high = entry[f"{part}_interval"]
                        axes.plot([low, high], [y + shift] * 2, color=colour.light, linewidth=1.0, alpha=0.6)
                        axes.plot([entry[part]], [y + shift], marker=marker, markersize=4.4, color=colour.light)
                label = {"total": "total", "first": "first order"}[part]
                handles.append(Line2D([], [], color=colour.light, marker=marker, markersize=4.4, label=label))
            axes.set_xlabel("part of the variance")
        else:
            axes.axvspan(-chance_of(runs), chance_of(runs), color=BAND.light, linewidth=0, zorder=0)
            for y, (_, entry) in enumerate(rows):
                if entry[key] is not None:
                    axes.plot([0.0, entry[key]], [y, y], color=FIRST.light, linewidth=1.6)
                    axes.plot([entry[key]], [y], marker="o", markersize=4.4, color=FIRST.light)
            axes.set_xlim(-1.05, 1.05)
            axes.set_xlabel("rank correlation")
        axes.set_yticks(range(len(rows)), [short(parameter, 34) for parameter, _ in rows])
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.set_ylim(-0.6, max(len(rows), 2) - 0.4)
        if handles:
            figure.legend(handles=handles, loc="outside upper left", ncols=2)
        if not rows:
            say_empty(axes)
        return svg_text(figure, f"How {name} depends on the parameters")
