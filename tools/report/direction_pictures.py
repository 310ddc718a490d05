"""Pictures of a diagnosis over inputs and over directions: residuals, and where to measure next."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from .svg import column, drawing, say_empty, svg_text, three_columns
from .theme import ALERT, BAND, FIRST, MUTED, QUIET, SECOND, WIDTH


def residuals_over_inputs(
    inputs: ArrayLike, before: ArrayLike, after: ArrayLike | None = None, witness: ArrayLike | None = None
) -> str:
    """Residuals of each accelerometer against its own input.

    Parameters
    ----------
    inputs : array, shape (N, 3)
        [g]
    before, after, witness
        as for `trihedron.tools.report.calibration_pictures.residuals`

    Returns
    -------
    str
        SVG
    """
    n, first = three_columns(inputs), three_columns(before)
    second = None if after is None else three_columns(after)
    proof = np.zeros(first.shape, dtype=bool)
    if witness is not None:
        proof |= np.asarray(witness, dtype=bool).reshape(-1, 3)
    looks: dict[str, dict[str, Any]] = {
        "before" if second is not None else "residual": {
            "marker": "o",
            "markerfacecolor": "none",
            "color": SECOND.light,
            "markersize": 4.0,
        },
        "with the effect": {"marker": "o", "color": FIRST.light, "markersize": 3.2, "markeredgewidth": 0},
        "proves that no fit exists": {
            "marker": "D",
            "markerfacecolor": "none",
            "color": ALERT.light,
            "markersize": 7.6,
            "markeredgewidth": 1.2,
        },
    }
    series = [first, second, np.where(proof, first, np.nan) if proof.any() else None]
    shown = [(label, look, values) for (label, look), values in zip(looks.items(), series, strict=True)
             if values is not None]  # fmt: skip
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
        panels = figure.subplots(1, 3, sharey=True)
        for p, axes in enumerate(panels):
            axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0)
            axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
            for _, look, values in shown:
                axes.plot(n[:, p], values[:, p], linestyle="none", **look)
            axes.set_title(f"accelerometer {p + 1}")
            axes.set_xlabel("its input [g]")
            axes.set_xlim(-1.12, 1.12)
            if not np.isfinite(first[:, p] + n[:, p]).any():
                say_empty(axes)
        panels[0].set_ylabel("residual [σ]")
        handles = [
            Patch(facecolor=BAND.light, label="within ±σ"),
            *(Line2D([], [], linestyle="none", label=label, **look) for label, look, _ in shown),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=4, handletextpad=0.5)
        return svg_text(figure, "Residuals of each accelerometer against its own input")


def next_directions(
    alpha: ArrayLike, beta: ArrayLike, next_alpha: ArrayLike, next_beta: ArrayLike, labels: Sequence[str] = ()
) -> str:
    """Directions of the vertical in the inner frame: measured, and proposed; areas on the sphere are as on paper.

    Parameters
    ----------
    alpha, beta : array, shape (N,)
        measured angles [rad]
    next_alpha, next_beta : array, shape (K,)
        proposed ones [rad]
    labels : sequence of str
        beside the proposed ones

    Returns
    -------
    str
        SVG
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
        axes = figure.subplots()
        looks: list[dict[str, Any]] = [
            {"marker": "o", "color": QUIET.light, "markersize": 4.4, "markeredgewidth": 0, "label": "measured"},
            {"marker": "D", "color": ALERT.light, "markersize": 5.5, "markeredgewidth": 0, "label": "measure next"},
        ]
        if not len(labels):
            looks[0]["color"] = FIRST.light
        shown = []
        for look, a, b in ((looks[0], alpha, beta), (looks[1], next_alpha, next_beta)):
            a, b = column(a), column(b)
            if not a.size:
                continue
            shown.append(look)
            around = np.degrees(np.arctan2(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b)))
            axes.plot(around, np.cos(a), linestyle="none", **look)
            if look is looks[1]:
                for x, y, text in zip(around, np.cos(a), labels, strict=False):
                    axes.annotate(text, (x, y), (5, 4), textcoords="offset points", fontsize=7.5)
        axes.set_xlim(-185.0, 185.0)
        axes.set_ylim(-1.12, 1.12)
        axes.set_xticks(range(-180, 181, 90))
        axes.set_xlabel("direction about the third axis of the inner frame, from the first [deg]")
        axes.set_ylabel("along the third axis")
        handles = [Line2D([], [], linestyle="none", **look) for look in shown]
        figure.legend(handles=handles, loc="outside upper left", ncols=2, handletextpad=0.4)
        return svg_text(figure, "Directions of the vertical in the inner frame: measured positions and proposed ones")
