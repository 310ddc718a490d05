"""Pictures of many runs: confusion, rates, sizes; distributions and sensitivities of campaigns; published tables."""

import math
from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...document.notation import minus, raised, short
from ...papers.attitude import TABLES
from ...papers.reproduction import Reproduction
from ...rounding import digits, exactly
from . import (
    ALERT,
    AXES,
    BAND,
    DASHES,
    FIRST,
    INK,
    MUTED,
    QUIET,
    SECOND,
    Drawn,
    drawn,
    legend,
    legend_beside,
    log_ticks,
    named_rows,
    power_of_ten,
    say_empty,
    sheet,
)

LEAST_SHADE, MOST_SHADE = 0.15, 0.5
"""Shades of a cell with few and with all of its row's cases: numbers are readable on both."""
DASHED = (0, (5, 2))


@drawn
def confusion_picture(table: Mapping[str, Mapping[str, int]]) -> Drawn:
    """Draw the count of each name or verdict (columns) for each secret (rows); SVG, as in all functions here.

    The diagonal of correct names has one colour, everything else another.
    """
    rows = list(table)
    names: set[str] = set()
    for row in table.values():
        names |= row.keys()
    columns = [name for name in rows if name in names] + sorted(names - set(rows))
    figure, ((axes,),) = sheet(1.9 + 0.23 * max(len(rows), 2))
    for y, secret in enumerate(rows):
        total = sum(table[secret].values())
        for x, name in enumerate(columns):
            count = table[secret].get(name, 0)
            if not count:
                continue
            colour = FIRST if name == secret else QUIET if name.startswith("ambiguous, among") else ALERT
            shade = LEAST_SHADE + (MOST_SHADE - LEAST_SHADE) * count / total
            axes.scatter([x], [y], color=colour.light, alpha=shade, s=118, marker="s", linewidth=0)
            axes.text(x, y, str(count), ha="center", va="center", fontsize=7.5, color=INK.light)
    turned: dict[str, Any] = {"rotation": 60, "ha": "right", "rotation_mode": "anchor"}
    axes.set_xticks(np.arange(len(columns)), [short(name, 30) for name in columns], **turned)
    axes.tick_params(axis="x", length=0, labelcolor=INK.light, labelsize=8)
    named_rows(axes, [short(row, 44) for row in rows], lines=True, labelsize=8)
    axes.set(xlim=(-0.6, max(len(columns), 2) - 0.4), xlabel="diagnosis", ylabel="hidden")
    return figure, "How often each hidden effect was given each name or verdict"


@drawn
def size_errors_picture(size: Sequence[float], error: Sequence[float]) -> Drawn:
    """Draw errors (K,) of the estimated sizes of correctly named effects, against their true sizes (K,).

    An error is estimate over truth, less one; sizes are relative to that of sure detection.
    """
    x, y = np.array(size), 100.0 * np.array(error)
    figure, ((axes,),) = sheet(2.6)
    axes.axhline(0.0, color=MUTED.light, linewidth=0.7)
    axes.plot(x, y, linestyle="none", marker="o", markersize=3.2, color=FIRST.light, alpha=0.6, markeredgewidth=0)
    axes.set_xscale("log")
    reach = 1.15 * max(float(np.abs(y).max()), 1.0)
    axes.set_ylim(-reach, reach)
    mean, error_of_mean = float(y.mean()), 2.0 * float(y.std()) / np.sqrt(len(y))
    axes.axhspan(mean - error_of_mean, mean + error_of_mean, color=BAND.light, linewidth=0, zorder=0)
    axes.axhline(mean, color=SECOND.light, linewidth=1.1, label=f"mean {digits(mean)} %, with twice its standard error")
    log_ticks(axes, (0.5, 1, 2, 5, 10, 20, 50))
    axes.set(xlabel="true size over that of sure detection", ylabel="error of the estimate [%]")
    legend(figure)
    return figure, "Relative errors of the estimated sizes against the true size"


BINS = 40
DECADES = 2.0
"""Number of decades from which positive values are drawn against their logarithm."""
MOST_TICKS = 5
MOST_DRAWN = 12
"""Largest number of scalars or parameters in one picture."""


@drawn
def distributions_picture(
    columns: Mapping[tuple[str, str], NDArray], marks: Mapping[tuple[str, str], Sequence[float]]
) -> Drawn:
    """Draw a histogram of the finite values of each scalar, in words and with its unit, with lines at its quantiles."""
    names = list(columns)[:MOST_DRAWN]
    rows = max(-(-len(names) // 2), 1)
    figure, panels = sheet(0.5 + 1.75 * rows, rows, 2 if len(names) > 1 else 1)
    for axes in panels.flat[len(names) :]:
        axes.set_axis_off()
    for axes, name in zip(panels.flat, names, strict=False):
        words, unit = name
        values = columns[name][np.isfinite(columns[name])]
        axes.set(title="\n".join(wrap(words, 46)), ylabel="runs")
        axes.grid(visible=False)
        if not len(values):
            say_empty(axes)
            continue
        low, high = float(values.min()), float(values.max())
        if low == high:
            axes.set(xticks=[], yticks=[])
            say_empty(axes, f"always {digits(low, 4)} {unit}".rstrip())
            continue
        wide = low > 0.0 and math.log10(high / low) > DECADES
        edges = np.geomspace(low, high, BINS + 1) if wide else np.linspace(low, high, BINS + 1)
        axes.hist(values, bins=edges, color=FIRST.light, alpha=0.75, linewidth=0)
        axes.locator_params(axis="y", nbins=3, integer=True)
        scale = 0
        if wide:
            axes.set_xscale("log")
            axes.minorticks_off()
            decades = np.arange(math.ceil(math.log10(low)), math.floor(math.log10(high)) + 1)
            ticks = decades[:: -(-len(decades) // MOST_TICKS)]
            axes.set_xticks(10.0**ticks, [power_of_ten(10.0**d) for d in ticks])
        else:
            axes.locator_params(axis="x", nbins=5)
            largest = max(abs(low), abs(high))
            if not 1e-2 <= largest < 1e4:
                scale = math.floor(math.log10(largest))
                axes.xaxis.set_major_formatter(
                    lambda value, _, scale=scale: minus(exactly(round(value / 10.0**scale, 9)))
                )
        axes.set_xlabel(" ".join(part for part in (raised(scale) if scale else "", unit) if part))
        for mark in marks.get(name, ()):
            axes.axvline(mark, color=SECOND.light, linewidth=0.9, linestyle=(0, (4, 2)))
    return figure, f"Distribution of {', '.join(words for words, _ in names)}; dashed lines are quantiles"


@drawn
def rates_picture(
    curves: Mapping[str, Sequence[Mapping[str, Any]]], against: str, of: str = "runs", sure: str = ""
) -> Drawn:
    """Draw rates over ranges of a scalar, each with its interval of 95 %.

    `curves` gives by label ranges with low, high, cases, rate and interval; `of` names the counted things. `sure` is
    the label of a line at one, "" for none.
    """
    figure, ((axes,),) = sheet(3.0)
    drawn_ranges = [entry for ranges in curves.values() for entry in ranges if entry["cases"]]
    positive = bool(drawn_ranges) and all(e["low"] >= 0.0 and e["high"] > 0.0 for e in drawn_ranges)
    for k, (label, ranges) in enumerate(curves.items()):
        filled = [entry for entry in ranges if entry["cases"]]
        x = np.array([_middle(entry["low"], entry["high"], positive=positive) for entry in filled])
        # Side by side, so that no marker hides an equal one.
        x = x * 1.02 ** (2 * k - len(curves) + 1) if positive else x
        look: dict[str, Any] = {"color": AXES[k % 3].light, "marker": "os^"[k % 3], "markersize": 4.2}
        ends = np.array([entry["interval"] for entry in filled]).reshape(-1, 2)
        axes.vlines(x, ends[:, 0], ends[:, 1], color=AXES[k % 3].light, linewidth=0.9, alpha=0.6)
        y = [entry["rate"] for entry in filled]
        axes.plot(x, y, linestyle=DASHES[k % 3], label=short(label, 60), **look)
    if sure:
        axes.axvline(1.0, color=MUTED.light, linewidth=0.9, linestyle=DASHED, label=sure)
    if positive:
        axes.set_xscale("log")
        log_ticks(axes, 10.0 ** np.arange(-12, 13))
        if len(axes.get_xticks()) < 3:
            log_ticks(axes, [m * 10.0**d for d in range(-12, 13) for m in (1.0, 2.0, 5.0)])
    axes.set_yticks([0.0, 0.25, 0.5, 0.75, 1.0], ["0", "25 %", "50 %", "75 %", "100 %"])
    axes.set(ylim=(-0.04, 1.06), xlabel=short(against), ylabel=f"part of the {of}")
    legend(figure, 3)
    if not drawn_ranges:
        say_empty(axes)
    return figure, f"Part of the {of} against {against}, with intervals of 95 %"


def _middle(low: float, high: float, *, positive: bool) -> float:
    if not positive:
        return 0.5 * (low + high)
    return math.sqrt(low * high) if low > 0.0 else high / math.sqrt(2.0)


def chance_of(runs: int) -> float:
    """Return the size below which 95 % of rank correlations lie without a connection; at most one."""
    return min(1.0, 1.96 / math.sqrt(max(runs - 1, 1)))


@drawn
def sensitivity_picture(name: str, sensitivity: Mapping[str, Any], runs: int) -> Drawn:
    """Draw the dependence of a scalar on the parameters: Sobol indices with their intervals, or rank correlations.

    `sensitivity` is the result of `trihedron.tools.campaign.summary.sensitivity` over this number of runs.
    """
    sobol = sensitivity["method"] == "sobol"
    key = "total" if sobol else "correlation"
    rows = sorted(sensitivity["parameters"].items(), key=lambda pair: -abs(pair[1][key] or 0.0))[:MOST_DRAWN]
    figure, ((axes,),) = sheet(0.95 + 0.27 * max(len(rows), 2))
    axes.axvline(0.0, color=MUTED.light, linewidth=0.7)
    series = [("total", "total", -0.14, FIRST, "o"), ("first", "first order", 0.14, SECOND, "s")]
    if not sobol:
        series = [(key, "", 0.0, FIRST, "o")]
        axes.axvspan(-chance_of(runs), chance_of(runs), color=BAND.light, linewidth=0, zorder=0)
        axes.set_xlim(-1.05, 1.05)
    for part, label, shift, colour, marker in series:
        for y, (_, entry) in enumerate(rows):
            if entry[part] is not None:
                ends = entry[f"{part}_interval"] if sobol else (0.0, entry[part])
                look = {"linewidth": 1.0, "alpha": 0.6} if sobol else {"linewidth": 1.6}
                axes.plot(ends, [y + shift] * 2, color=colour.light, **look)
                axes.plot([entry[part]], [y + shift], marker=marker, markersize=4.4, color=colour.light)
        axes.plot([], [], color=colour.light, marker=marker, markersize=4.4, label=label)
    axes.set_xlabel("part of the variance" if sobol else "rank correlation")
    named_rows(axes, [short(parameter, 34) for parameter, _ in rows], lines=True)
    legend(figure, 2)
    return figure, f"How {name} depends on the parameters"


LEAST_RATIO, LARGEST_RATIO = 0.25, 4.0
"""Range of ratios in the picture; ratios outside it are drawn at its edge."""


@drawn
def published_and_reproduced(result: Reproduction) -> Drawn:
    """Draw the ratio of reproduced to published error for every row; below it the published and the method's own
    errors."""
    numbers = np.array([row.row for row in result.rows])

    ratios = np.array([row.ratio for row in result.rows]).reshape(-1, 3)
    published = np.array([row.published_deg for row in result.rows]).reshape(-1, 3)
    method = np.array([row.method_error_deg for row in result.rows]).reshape(-1, 3)
    tables = [row.table for row in result.rows]
    of_table: dict[str, list[int]] = {}
    for row in result.rows:
        of_table.setdefault(row.table, []).append(row.row)
    from matplotlib.ticker import FixedLocator, NullFormatter

    figure, ((above,), (below,)) = sheet(5.4, 2, sharex=True, height_ratios=[1.0, 1.2])
    above.axhspan(0.95, 1.05, color=BAND.light, linewidth=0)
    for k, name in enumerate(("ψ", "ϑ", "γ")):
        look = {"marker": "os^"[k], "linestyle": "none", "markersize": 3.2, "color": AXES[k].light}
        above.plot(numbers, np.clip(ratios[:, k], LEAST_RATIO, LARGEST_RATIO), label=name, **look)
        below.plot(numbers, published[:, k], **look)
        below.plot(numbers, method[:, k], markerfacecolor="none", **look)
    for axes in (above, below):
        axes.set_yscale("log")
        for k in range(1, len(tables)):
            if tables[k] != tables[k - 1]:
                axes.axvline(0.5 * (numbers[k] + numbers[k - 1]), color=MUTED.light, linewidth=0.7)
    above.set_ylim(0.9 * LEAST_RATIO, 1.1 * LARGEST_RATIO)
    above.yaxis.set_major_locator(FixedLocator([0.25, 0.5, 1.0, 2.0, 4.0]))
    above.yaxis.set_minor_locator(FixedLocator([]))
    above.yaxis.set_major_formatter(lambda value, _: exactly(value))
    above.yaxis.set_minor_formatter(NullFormatter())
    outside = (ratios < LEAST_RATIO) | (ratios > LARGEST_RATIO)
    if outside.any():
        clipped = np.where(outside, np.clip(ratios, LEAST_RATIO, LARGEST_RATIO), np.nan)
        above.plot(numbers, clipped, marker="x", color=ALERT.light, linestyle="none", markersize=6)
    above.set(ylabel="reproduced / published", title="under the paper's conditions")
    legend_beside(above, 3)
    below.set_ylabel("largest error over 600 s [deg]")
    below.set_title("full: published; open: exact increments, exact π, normalised")
    below.yaxis.set_major_formatter(power_of_ten)
    spans = [f"{TABLES[table]}: {min(rows)} to {max(rows)}" for table, rows in of_table.items()]
    below.set_xlabel("row (" + "; ".join(spans) + ")", color=INK.light)
    return figure, "Ratios of reproduced to published attitude errors, and the methods' own errors, by row"
