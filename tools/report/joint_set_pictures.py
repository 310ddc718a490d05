"""Picture of the joint feasible set: one panel for each pair of targets that hang together."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon

from .svg import drawing, plain, svg_text
from .theme import BAND, FIRST, INK, MUTED, WIDTH


class Named(Protocol):
    """A target's symbol."""

    @property
    def symbol(self) -> str: ...


class Pair(Protocol):
    """Two targets and what is left possible of them; `trihedron.tools.calibration.estimates.PairSet` is one."""

    @property
    def first(self) -> Named: ...
    @property
    def second(self) -> Named: ...
    @property
    def vertices(self) -> np.ndarray: ...


def joint_set(
    pairs: Sequence[Pair], estimates: Mapping[str, float], noise_bound: float, truth: Mapping[str, float] | None = None
) -> str:
    """Pairwise projections of the set of all parameters that the readings leave possible.

    Parameters
    ----------
    pairs : sequence of Pair
        of one group: every pair once
    estimates : mapping
        symbol -> estimate; the panels are about these
    noise_bound : float
        σ, the unit of the axes
    truth : mapping
        symbol -> true value, as far as it is known

    Returns
    -------
    str
        SVG; rows and columns are the targets
    """
    across = list(dict.fromkeys(pair.first.symbol for pair in pairs))
    down = list(dict.fromkeys(pair.second.symbol for pair in pairs))
    with drawing():
        side = min(1.5, (WIDTH - 0.6) / max(len(across), 3))
        figure = Figure(figsize=(max(WIDTH, 0.6 + side * len(across)), 0.9 + side * len(down)), layout="constrained")
        panels = figure.subplots(len(down), len(across), squeeze=False, sharex="col", sharey="row")
        for axes in panels.flat:
            axes.set_visible(False)
        for pair in pairs:
            row, column = down.index(pair.second.symbol), across.index(pair.first.symbol)
            axes = panels[row, column]
            axes.set_visible(True)
            about = np.array([estimates.get(pair.first.symbol, 0.0), estimates.get(pair.second.symbol, 0.0)])
            corners = (pair.vertices - about) / noise_bound
            low, high = corners.min(axis=0), corners.max(axis=0)
            least, most = np.minimum(low, 0.0), np.maximum(high, 0.0)
            axes.add_patch(Polygon([low, [high[0], low[1]], high, [low[0], high[1]]], color=BAND.light, linewidth=0))
            axes.add_patch(Polygon(corners, closed=True, facecolor=FIRST.light, alpha=0.35, linewidth=0))
            axes.add_patch(Polygon(corners, closed=True, fill=False, edgecolor=FIRST.light, linewidth=1.0))
            axes.plot(0.0, 0.0, "o", color=INK.light, markersize=2.6)
            if truth is not None and pair.first.symbol in truth and pair.second.symbol in truth:
                true = (np.array([truth[pair.first.symbol], truth[pair.second.symbol]]) - about) / noise_bound
                axes.plot(*true, "+", color=MUTED.light, markersize=6)
            margin = 0.08 * np.maximum(most - least, 1e-6)
            axes.dataLim.update_from_data_xy(np.array([least - margin, most + margin]))
            axes.autoscale_view()
            axes.tick_params(labelsize=7)
            axes.locator_params(nbins=4)
            if row == len(down) - 1:
                axes.set_xlabel(f"{plain(pair.first.symbol).replace('-', '−')} [σ]")
            if column == 0:
                axes.set_ylabel(f"{plain(pair.second.symbol).replace('-', '−')} [σ]")
        handles: list[Line2D | Patch] = [
            Patch(facecolor=FIRST.light, alpha=0.35, label="possible together"),
            Patch(facecolor=BAND.light, label="each by itself"),
            Line2D([], [], color=INK.light, marker="o", markersize=2.6, linestyle="none", label="estimates"),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handletextpad=0.6)
        return svg_text(figure, "Pairs of targets: what the readings leave possible, in units of the noise bound")
