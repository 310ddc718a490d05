"""Pictures of the pages that explain: readings as strips of parameters, and what estimates and intervals are."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Polygon
from numpy.typing import NDArray

from trihedron.tools.reports.pictures import ALERT, BAND, FIRST, INK, MUTED, SECOND, THIRD, WIDTH, drawing, svg_text

ROWS = np.array([[1.0, 0.15], [0.25, 1.0], [0.75, -0.85]])
"""How three readings depend on two parameters."""
TRUTH = np.array([0.2, 0.1])
ERRORS = np.array([-0.6, 0.5, 0.8])
"""In units of σ."""
MOVED = np.array([0.0, 0.0, 2.2])
"""By which what the model lacks moves the readings, in units of σ."""
REACH = 3.1


def strips_picture() -> str:
    """Three readings with their bounds in the plane of two parameters: consistent, and falsified (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.5), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, moved, title in zip(panels, (0.0 * MOVED, MOVED), ("consistent", "falsified"), strict=True):
            _strips(axes, ROWS @ TRUTH + ERRORS + moved)
            axes.set_title(title)
        panels[0].set_ylabel("second parameter [σ]")
        return svg_text(figure, "Three readings allow three strips of parameters; with and without a common point")


def interval_picture() -> str:
    """What a guaranteed error and an exact interval are, on the set of possible parameters (SVG)."""
    reading = ROWS @ TRUTH + ERRORS
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.6), layout="constrained")
        above, below = figure.subplots(2, 1, sharex=True, height_ratios=(4.2, 1.0))
        corners = _strips(above, reading)
        above.set_ylabel("second parameter [σ]")
        above.set_aspect("auto")
        above.set_ylim(-2.2, 1.6)
        low, high = float(corners[:, 0].min()), float(corners[:, 0].max())
        weights = _best_weights(np.array([1.0, 0.0]))
        estimate, error = float(weights @ reading), float(np.abs(weights).sum())
        look: dict[str, Any] = {"solid_capstyle": "butt"}
        below.plot([estimate - error, estimate + error], [0.0, 0.0], color=BAND.light, linewidth=15.0, **look)
        below.plot([low, high], [0.0, 0.0], color=FIRST.light, linewidth=4.0, label="low to high", **look)
        below.plot([estimate], [0.0], "o", color=INK.light, markersize=4.5, label="estimate")
        below.plot([TRUTH[0]] * 2, [-0.45, 0.45], color=SECOND.light, linewidth=2.0, label="truth")
        for end in (low, high):
            above.axvline(end, color=MUTED.light, linestyle=":")
            below.axvline(end, color=MUTED.light, linestyle=":")
        below.set_ylim(-0.7, 0.7)
        below.set_yticks([])
        below.grid(visible=False)
        above.set_xlabel("")
        below.set_xlabel("first parameter [σ]")
        band = Patch(facecolor=BAND.light, label="estimate ± guaranteed error")
        figure.legend(handles=[band, *below.get_legend_handles_labels()[0]], loc="outside upper left", ncols=4)
        return svg_text(figure, "The set of possible parameters, its extent along the first, and the guaranteed error")


def _strips(axes: Axes, reading: NDArray) -> NDArray:
    """Draw the strips |r − f·x| ≤ 1 and their common points; the corners (K, 2) of these."""
    colours = (FIRST, SECOND, THIRD)
    for row, value, colour in zip(ROWS, reading, colours, strict=True):
        along = np.array([-row[1], row[0]]) / np.linalg.norm(row)
        middle = row * value / (row @ row)
        across = row / (row @ row)
        ends = [middle + s * 12.0 * along + t * across for s, t in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
        axes.add_patch(Polygon(ends, facecolor=colour.light, alpha=0.16, linewidth=0))
        for t in (-1.0, 1.0):
            line = np.array([middle - 12.0 * along + t * across, middle + 12.0 * along + t * across])
            axes.plot(line[:, 0], line[:, 1], color=colour.light, linewidth=1.0)
    corners = _corners(reading)
    if len(corners):
        axes.add_patch(Polygon(corners, facecolor=INK.light, alpha=0.55, linewidth=0))
        axes.plot(*TRUTH, marker="+", color=INK.light, markersize=9, markeredgewidth=1.6)
    else:
        axes.text(0.03, 0.04, "no common point", transform=axes.transAxes, color=ALERT.light)
    axes.set_xlim(-REACH, REACH)
    axes.set_ylim(-REACH, REACH)
    axes.set_aspect("equal")
    axes.set_xlabel("first parameter [σ]")
    return corners


def _corners(reading: NDArray) -> NDArray:
    """Corners (K, 2) of the polygon where all strips meet, in order around it; none where they do not."""
    found = []
    for i in range(len(ROWS)):
        for j in range(i):
            for s in (-1.0, 1.0):
                for t in (-1.0, 1.0):
                    x = np.linalg.solve(ROWS[[i, j]], reading[[i, j]] + np.array([s, t]))
                    if np.abs(ROWS @ x - reading).max() <= 1.0 + 1e-9:
                        found.append(x)
    if not found:
        return np.zeros((0, 2))
    corners = np.array(found)
    away = corners - corners.mean(axis=0)
    return corners[np.argsort(np.arctan2(away[:, 1], away[:, 0]), kind="stable")]


def _best_weights(target: NDArray) -> NDArray:
    """Weights (3,) of least sum of absolute values with which the rows add up to a target: two of them."""
    best = np.full(len(ROWS), np.inf)
    for i in range(len(ROWS)):
        for j in range(i):
            weights = np.zeros(len(ROWS))
            weights[[i, j]] = np.linalg.solve(ROWS[[i, j]].T, target)
            if np.abs(weights).sum() < np.abs(best).sum():
                best = weights
    return best
