"""Pictures of a diagnosis: what each candidate effect leaves, and errors on positions that were held out."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from .svg import column, drawing, say_empty, short, svg_text
from .theme import ALERT, BAND, FIRST, INK, MUTED, QUIET, SECOND, WIDTH

MOST_LABELS = 32
"""So many labels stand beside each other; of more, every second, third, ... is shown."""

ROUNDING = 1e-6
"""How far beyond 1 a radius still counts as 1: the digits of a linear programme."""


def held_out(before: ArrayLike, after: ArrayLike, labels: Sequence[object]) -> str:
    """Errors of prediction at positions that were not used, before and after the model was extended.

    Parameters
    ----------
    before, after : array, shape (N,) or (N, 3)
        errors in units of σ, for one or for each of the three accelerometers
    labels : sequence, length N
        names of the positions

    Returns
    -------
    str
        SVG
    """
    names = [short(label, 24) for label in labels]
    first, second = (_by_position(values, len(names)) for values in (before, after))
    spread = np.linspace(-0.24, 0.24, first.shape[1]) if first.shape[1] > 1 else np.zeros(1)
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
        axes = figure.subplots()
        axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0)
        axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
        place = np.arange(len(names))[:, None] + spread
        axes.vlines(place.ravel(), first.ravel(), second.ravel(), color=MUTED.light, linewidth=0.7)
        hollow: dict[str, Any] = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "color": SECOND.light}
        filled: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": FIRST.light, "markeredgewidth": 0}
        axes.plot(place.ravel(), first.ravel(), markersize=4.4, **hollow)
        axes.plot(place.ravel(), second.ravel(), markersize=3.6, **filled)
        every = -(-len(names) // MOST_LABELS) if names else 1
        long = max((len(name) for name in names), default=0) * min(len(names), MOST_LABELS) > 90
        turn: dict[str, Any] = {"rotation": 45, "ha": "right", "rotation_mode": "anchor"} if long else {}
        axes.set_xticks(np.arange(len(names))[::every], names[::every], **turn)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        axes.set_xlim(-0.6, max(len(names), 1) - 0.4)
        size = np.abs(np.concatenate([first, second]))
        reach = 1.12 * max(1.25, float(np.nanmax(size)) if np.isfinite(size).any() else 0.0)
        axes.set_ylim(-reach, reach)
        beside = "" if first.shape[1] == 1 else "; accelerometers 1, 2, 3 side by side"
        axes.set_xlabel(f"position that was held out{beside}")
        axes.set_ylabel("error of prediction [σ]")
        handles = [
            Patch(facecolor=BAND.light, label="within ±σ"),
            Line2D([], [], label="before", markersize=4.4, **hollow),
            Line2D([], [], label="with the effect", markersize=3.6, **filled),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handletextpad=0.5)
        if not np.isfinite(size).any():
            say_empty(axes)
        return svg_text(figure, "Errors of prediction at held-out positions, before and after the model was extended")


def _by_position(values: ArrayLike, count: int) -> np.ndarray:
    array = np.asarray(values, dtype=np.float64)
    return column(array).reshape(count, -1) if count and array.size else np.full((count, 1), np.nan)


LEAVES = "largest residual that the best fit leaves [σ]"


def candidates(names: Sequence[str], radius: ArrayLike, label: str = LEAVES) -> str:
    """What each candidate effect leaves of the misfit: the smallest radius of the extended model.

    Parameters
    ----------
    names : sequence of str, length N
        the effects with their places; "none", say, for the model as it is
    radius : array, shape (N,)
        least max |residual| in units of its bound; the data are explained up to 1
    label : str
        of the axis

    Returns
    -------
    str
        SVG; the best stands first
    """
    left = column(radius)
    order = np.argsort(left, kind="stable")
    left = left[order]
    labels = [short(names[k]) for k in order]
    with drawing():
        figure = Figure(figsize=(WIDTH, 1.05 + 0.25 * max(len(labels), 2)), layout="constrained")
        axes = figure.subplots()
        y = np.arange(len(labels))
        explained = left <= 1.0 + ROUNDING
        colours = [FIRST.light if good else QUIET.light for good in explained]
        axes.barh(y, np.nan_to_num(left), height=0.62, color=colours, linewidth=0)
        axes.axvline(1.0, color=ALERT.light, linewidth=1.3)
        most = float(np.nanmax(left)) if np.isfinite(left).any() else 1.0
        axes.set_xlim(0.0, 1.1 * max(most, 1.25))
        for k, value in enumerate(left):
            text = f"{value:.2f}" if np.isfinite(value) else "not possible"
            at = 0.0 if not np.isfinite(value) else 1.0 if explained[k] else value
            axes.annotate(text, (at, k), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
        axes.set_yticks(y, labels)
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.set_ylim(max(len(labels), 2) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(label)
        line = Line2D([], [], color=ALERT.light, linewidth=1.3, label="the data are explained up to here")
        figure.legend(handles=[line], loc="outside upper left", handletextpad=0.6)
        if not labels:
            say_empty(axes)
        return svg_text(figure, "Largest residual that each candidate effect leaves, in units of the noise bound")
