"""The paper's figure: where each accelerometer's sign is certain, and the optimal positions of a target."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from .svg import column, drawing, plain, svg_text
from .theme import BAND, FIRST, INK, SECOND, WIDTH

STEP_DEG = 2.0


def admissible_positions(
    clearance: Sequence[tuple[int, NDArray]],
    accelerometer: ArrayLike,
    alpha_deg: ArrayLike,
    beta_deg: ArrayLike,
    weight: ArrayLike,
    title: str,
) -> str:
    """Admissible sets and optimal positions over the two angles, a panel for each accelerometer that is used.

    Parameters
    ----------
    clearance : sequence of (int, (n, n) array)
        accelerometer (from 1) and how far (1.9) is fulfilled on a regular grid over [0°, 360°]², α down the rows:
        positive where the position is admissible
    accelerometer, alpha_deg, beta_deg, weight : (N,) array
        of the readings
    title : str
        what is estimated

    Returns
    -------
    str
        SVG
    """
    which = np.array(accelerometer, dtype=int).reshape(-1)
    alpha, beta, weights = column(alpha_deg), column(beta_deg), column(weight)
    shown = [(number, field) for number, field in clearance if (which == number).any()] or list(clearance)[:1]
    with drawing():
        figure = Figure(figsize=(WIDTH, 7.4 if len(shown) == 1 else 0.9 + WIDTH / len(shown)), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(shown), sharey=True))
        largest = max(float(np.abs(weights).max(initial=0.0)), 1e-300)
        for axes, (number, field) in zip(panels, shown, strict=True):
            angle = np.linspace(0.0, 360.0, len(field))
            axes.contourf(angle, angle, field.T, levels=[0.0, np.inf], colors=[BAND.light])
            here = which == number
            for sense, colour, marker in ((1.0, FIRST, "o"), (-1.0, SECOND, "s")):
                part = here & (np.sign(weights) == sense)
                size = 18.0 + 90.0 * np.abs(weights[part]) / largest
                axes.scatter(alpha[part], beta[part], s=size, marker=marker, color=colour.light, linewidth=0, zorder=3)
            if len(shown) == 1:
                for a, b, w in zip(alpha[here], beta[here], weights[here], strict=True):
                    side = -1 if a > 300 else 1
                    axes.annotate(
                        f"{w:+.4f}".replace("-", "−"),
                        (a, b),
                        (8 * side, 6),
                        textcoords="offset points",
                        ha="left" if side > 0 else "right",
                        fontsize=8,
                        color=INK.light,
                    )
            axes.set_title(f"accelerometer {number}")
            axes.set_xlabel("α, outer axis [deg]")
            axes.set(xlim=(-6, 366), ylim=(-6, 366), aspect="equal")
            axes.set_xticks(range(0, 361, 90))
            axes.set_yticks(range(0, 361, 90))
        panels[0].set_ylabel("β, inner axis [deg]")
        handles: list[Line2D | Patch] = [
            Patch(facecolor=BAND.light, label="sign of the input certain"),
            Line2D([], [], linestyle="none", marker="o", color=FIRST.light, label="positive weight"),
            Line2D([], [], linestyle="none", marker="s", color=SECOND.light, label="negative weight"),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handletextpad=0.5)
        return svg_text(figure, f"Admissible positions and optimal plan for {plain(title)}")
