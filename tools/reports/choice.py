"""The choice of an attitude algorithm in words and as a chart: error against cost."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...models.attitude_algorithms import ALGORITHMS
from ..motion.choice import ADAPTIVE, ENOUGH, Choice
from ..rounding import digits, exactly
from .pictures import ALERT, FIRST, MUTED, SECOND, THIRD, drawing, power_of_ten, svg_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

KINDS = {
    "formulas": {"color": MUTED.light, "marker": "o", "label": "formulas"},
    "products": {"color": SECOND.light, "marker": "s", "label": "products"},
    "iteration": {"color": THIRD.light, "marker": "^", "label": "iteration"},
}
"""Marks of the algorithms, by the module that they stand in."""
ACROSS, HEIGHT, WIDTH = 3, 2.5, 7.5
"""Panels of the chart beside each other; height of a row, and width of the whole [in]."""


def lines(found: Choice) -> list[str]:
    """What to take, then every algorithm from the cheapest on; those that no cheaper one betters are marked."""
    enough, best, (adaptive, beside) = found.enough, found.best, found.adaptive
    width = max(len(one.algorithm) for one in found.algorithms)
    drawn = f", rms of {found.draws} draws" if found.draws > 1 else ""
    said = [
        f"{found.title}: {exactly(found.rate_hz, 6)} gyro samples a second, {exactly(found.duration_s, 6)} s",
        f"take {enough.algorithm}: the cheapest within {exactly(ENOUGH)} times of the best, {best.algorithm}",
        f"{ADAPTIVE}, which asks for no choice: {digits(beside, 3)} times the error of the best that is no costlier"
        if adaptive.error is not None
        else f"{ADAPTIVE}: cannot be run",
        f"operations for each gyro sample, a division, root, sine or cosine as ten; largest error [deg]{drawn}",
        "",
        f"  {'algorithm':{width}}  order  samples  operations      error",
    ]
    frontier = found.frontier
    said += [
        f"{'*' if one in frontier else ' '} {one.algorithm:{width}}  {one.order:5d}  {one.samples:7d}  "
        f"{exactly(round(one.operations)):>10}  {digits(math.degrees(one.error or 0.0), 3):>9}"
        for one in found.able
    ]
    unable = [one.algorithm for one in found.algorithms if one.error is None]
    return said + ([f"increments too long, or too few, for {', '.join(unable)}"] if unable else [])


def chart(choices: Sequence[Choice]) -> str:
    """Error over operations per gyro sample, a panel for each motion: down and left is better (SVG)."""
    from matplotlib.figure import Figure

    columns = min(ACROSS, len(choices))
    with drawing():
        rows = -(-len(choices) // columns)
        figure = Figure(figsize=(WIDTH, max(3.8, HEIGHT * rows)), layout="constrained")
        panels = figure.subplots(rows, columns, sharex=True, sharey="row", squeeze=False)
        for axes, found in zip(panels.flat, choices, strict=False):
            degrees = {one.algorithm: (one.operations, math.degrees(one.error or 0.0)) for one in found.able}
            x, y = zip(*(degrees[one.algorithm] for one in found.frontier), strict=True)
            axes.plot([*x, 6000.0], [*y, y[-1]], color=FIRST.light, drawstyle="steps-post", linewidth=0.9)
            for kind, look in KINDS.items():
                names = [a.name for a in ALGORITHMS if a.kernel.__module__.endswith(kind) and a.name in degrees]
                places = zip(*(degrees[name] for name in names if name != ADAPTIVE), strict=True)
                axes.plot(*places, linestyle="none", markersize=3.2, **look)
            if len(choices) == 1:
                _name_frontier(axes, found)
            if ADAPTIVE in degrees:
                star = {"color": ALERT.light, "markersize": 8, "label": "adaptive"}
                axes.plot(*degrees[ADAPTIVE], "*", **star)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(25.0, 6000.0)
            axes.yaxis.set_major_formatter(power_of_ten)
            axes.xaxis.set_major_formatter(lambda value, _: exactly(value))
            axes.set_title(found.title.replace(", ", "\n"), fontsize=8)
        panels[0, 0].legend(fontsize=6.5, loc="upper right")
        figure.supxlabel("operations per gyro sample (a division, root, sine or cosine counts as ten)", fontsize=8)
        draws, length = max(found.draws for found in choices), exactly(choices[0].duration_s, 4)
        drawn = f", rms of {draws} draws of quanta or noise" if draws > 1 else ""
        figure.supylabel(f"largest error in {length} s [deg]{drawn}", fontsize=8)
        return svg_text(figure, "Error of all attitude algorithms against their cost, by motion and readings")


def _name_frontier(axes: "Axes", found: Choice) -> None:
    """Names beside those that no cheaper one betters, as far as there is room."""
    named = 0.0
    for one in found.frontier:
        if one.operations > 1.2 * named:
            at = one.operations, math.degrees(one.error or 0.0)
            axes.annotate(
                one.algorithm, at, xytext=(2, -4), textcoords="offset points", fontsize=6, rotation=-30, va="top"
            )
            named = one.operations
