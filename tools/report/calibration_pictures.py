"""The picture of residuals over the table's angles."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from .svg import column, drawing, say_empty, svg_text, three_columns
from .theme import ALERT, BAND, FIRST, MUTED, SECOND, WIDTH


def residuals(
    alpha_deg: ArrayLike,
    beta_deg: ArrayLike,
    before: ArrayLike,
    after: ArrayLike | None = None,
    witness: ArrayLike | None = None,
) -> str:
    """Residuals of the three accelerometers over the two angles of the table.

    Parameters
    ----------
    alpha_deg, beta_deg : array, shape (N,)
        angles of the outer and the inner axis [deg]
    before : array, shape (N, 3)
        residuals of the model in units of σ; NaN where a reading is not used
    after : array, shape (N, 3), or None
        those of the extended model
    witness : array of bool, shape (N, 3), or None
        the measurements that prove that no parameters fit the model

    Returns
    -------
    str
        SVG
    """
    angles = (column(alpha_deg), column(beta_deg))
    first = three_columns(before)
    second = None if after is None else three_columns(after)
    proof = np.zeros(first.shape, dtype=bool)
    if witness is not None:
        proof |= np.asarray(witness, dtype=bool).reshape(-1, 3)
    with drawing():
        figure = Figure(figsize=(WIDTH, 5.4), layout="constrained")
        panels = figure.subplots(3, 2, sharex="col", sharey=True)
        size = np.abs(first if second is None else np.concatenate([first, second]))
        reach = 1.2 * max(1.25, float(np.nanmax(size)) if np.isfinite(size).any() else 0.0)
        for row in range(3):
            for side in range(2):
                axes = panels[row, side]
                after_here = None if second is None else second[:, row]
                _residual_panel(axes, angles[side], first[:, row], after_here, proof[:, row])
                axes.set_ylim(-reach, reach)
                if not np.isfinite(first[:, row]).any():
                    say_empty(axes)
            panels[row, 0].set_ylabel("residual [σ]")
            panels[row, 0].set_title(f"accelerometer {row + 1}")
        for side, name in enumerate(("α, outer axis [deg]", "β, inner axis [deg]")):
            panels[2, side].set_xlabel(name)
            known = angles[side][np.isfinite(angles[side])]
            if not known.size or (known.min() >= -1.0 and known.max() <= 361.0):
                panels[2, side].set_xlim(-8.0, 368.0)
                panels[2, side].set_xticks(range(0, 361, 90))
        figure.legend(
            handles=_residual_handles(second is not None, bool(proof.any())),
            loc="outside upper left",
            ncols=4,
            handletextpad=0.5,
        )
        return svg_text(figure, "Residuals in units of the noise bound over the two angles of the table")


def _look(kind: str) -> dict[str, Any]:
    common: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "none"}
    return {
        "before": {**common, "marker": "o", "markersize": 4.2, "color": SECOND.light, "markeredgewidth": 1.0},
        "after": {"linestyle": "none", "marker": "o", "markersize": 2.8, "color": FIRST.light, "markeredgewidth": 0},
        "witness": {**common, "marker": "D", "markersize": 7.6, "color": ALERT.light, "markeredgewidth": 1.2},
    }[kind]


def _residual_panel(
    axes: Axes, angle: np.ndarray, before: np.ndarray, after: np.ndarray | None, proof: np.ndarray
) -> None:
    axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0)
    axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
    axes.plot(angle, before, **_look("before"))
    if after is not None:
        axes.plot(angle, after, **_look("after"))
    axes.plot(angle[proof], before[proof], **_look("witness"))


def _residual_handles(both: bool, proof: bool) -> list[Line2D | Patch]:
    first = "before" if both else "residual"
    handles: list[Line2D | Patch] = [
        Patch(facecolor=BAND.light, label="within ±σ"),
        Line2D([], [], label=first, **_look("before")),
    ]
    if both:
        handles.append(Line2D([], [], label="with the effect", **_look("after")))
    if proof:
        handles.append(Line2D([], [], label="proves that no fit exists", **_look("witness")))
    return handles
