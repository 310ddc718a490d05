"""Pictures of a common set of positions, and of what sets of more positions cost."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import ArrayLike, NDArray

from ...models.bench import up
from .svg import drawing, svg_text
from .theme import FIRST, INK, MUTED, QUIET, SECOND, WIDTH


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
