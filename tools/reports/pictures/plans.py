"""Pictures of plans: weights over the angles, common positions, cost against their number."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch
from numpy.typing import ArrayLike, NDArray

from ....models.bench import up
from ...document.theme import BAND, FIRST, INK, MUTED, QUIET, SECOND, WIDTH, column, drawing, plain, svg_text

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


def positions_picture(alpha_deg: ArrayLike, beta_deg: ArrayLike, programme: Sequence[int]) -> str:
    """The positions in the plane of the two angles, and where they put the vertical in the inner frame.

    Parameters
    ----------
    alpha_deg, beta_deg : (N,) array
        commands [deg]
    programme : sequence of int
        the positions in the order of measurement

    Returns
    -------
    str
        SVG
    """
    alpha, beta = np.asarray(alpha_deg, dtype=float), np.asarray(beta_deg, dtype=float)
    number = {row: place for place, row in enumerate(dict.fromkeys(programme), start=1)}
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.9), layout="constrained")
        grid = figure.add_gridspec(2, 2, width_ratios=(2.0, 1.0))
        plane = figure.add_subplot(grid[:, 0])
        plane.plot(alpha[list(programme)], beta[list(programme)], color=QUIET.light, linewidth=0.8, zorder=1)
        plane.scatter(alpha, beta, s=22, color=FIRST.light, linewidth=0, zorder=3)
        for row, place in number.items():
            plane.annotate(
                str(place), (alpha[row], beta[row]), (4, 4), textcoords="offset points", fontsize=8, color=INK.light
            )
        plane.set_xlabel("α, outer axis [deg]")
        plane.set_ylabel("β, inner axis [deg]")
        plane.set_title("positions in their order")
        s = up(np.radians(alpha), np.radians(beta))
        for row, (sense, title) in enumerate(((1.0, "vertical, axis 3 up"), (-1.0, "vertical, axis 3 down"))):
            disc = figure.add_subplot(grid[row, 1])
            disc.add_patch(Circle((0.0, 0.0), 1.0, fill=False, edgecolor=MUTED.light, linewidth=0.7))
            here = sense * s[:, 2] >= 0.0
            disc.scatter(s[here, 0], s[here, 1], s=18, color=SECOND.light, linewidth=0, zorder=3)
            disc.set(xlim=(-1.08, 1.08), ylim=(-1.08, 1.08), aspect="equal", xticks=(-1, 0, 1), yticks=(-1, 0, 1))
            disc.set_title(title)
        return svg_text(figure, f"The {len(alpha)} positions of a plan in their order")


def curve_picture(count: ArrayLike, worst: ArrayLike, mean: ArrayLike, bound: ArrayLike) -> str:
    """Cost above the optimum against the number of positions, with the proven bound, as SVG."""
    n, columns = np.asarray(count), [np.asarray(column, dtype=float) - 1.0 for column in (worst, mean, bound)]
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
        axes = figure.subplots()
        looks = (("worst target", FIRST, "o"), ("mean of the targets", SECOND, "s"), ("proven on the pool", MUTED, "_"))
        for column, (label, colour, marker) in zip(columns, looks, strict=True):
            shown: NDArray = np.where(column > 0.0, column, np.nan)
            axes.semilogy(n, 100.0 * shown, color=colour.light, marker=marker, markersize=4, label=label)
        axes.set_xlabel("positions")
        axes.set_ylabel("cost above the optimum [%]")
        axes.legend()
        return svg_text(figure, "Cost above the optimum against the number of positions")
