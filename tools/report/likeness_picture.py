"""How alike effects are, as a square of shaded fields with their numbers."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import ArrayLike

from .svg import drawing, short, svg_text
from .theme import BAND, FIRST, GRID, INK, WIDTH

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
