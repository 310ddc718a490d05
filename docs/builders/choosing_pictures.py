"""Pictures that help to choose an attitude algorithm."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from trihedron.tools.reports.pictures import (
    ALERT,
    BAND,
    FIRST,
    INK,
    MUTED,
    SECOND,
    THIRD,
    WIDTH,
    drawing,
    power_of_ten,
    svg_text,
)

LOOKS = (
    {"color": MUTED.light, "marker": "v", "linestyle": "solid"},
    {"color": FIRST.light, "marker": "o", "linestyle": "solid"},
    {"color": SECOND.light, "marker": "s", "linestyle": (0, (5, 1.6))},
    {"color": ALERT.light, "marker": "D", "linestyle": (0, (3, 1.2, 1, 1.2))},
    {"color": THIRD.light, "marker": "^", "linestyle": (0, (1.4, 1.2))},
)
"""Lines of up to five algorithms: they can be told apart without colours."""


class Titled(Protocol):
    """What has a title."""

    @property
    def title(self) -> str:
        """One line."""
        ...


def accuracy_against_cost(
    situations: Sequence[Titled], names: Sequence[str], costs: Sequence[float], errors: Sequence[Sequence[float]]
) -> str:
    """Error over operations for each situation; the further down and left the better.

    Parameters
    ----------
    situations : sequence
        with titles
    names : sequence of str
        short names of the algorithms
    costs : sequence of float
        operations per gyro sample
    errors : sequence of sequence of float
        for each situation the error of each algorithm [rad]

    Returns
    -------
    str
        SVG
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 9.0), layout="constrained")
        for axes, situation, found in zip(figure.subplots(len(situations), 1), situations, errors, strict=True):
            degrees = np.degrees(found)
            best = _best_for_cost(costs, degrees)
            axes.plot(np.array(costs)[best], degrees[best], color=FIRST.light, drawstyle="steps-post", linewidth=0.9)
            axes.plot(costs, degrees, marker="o", linestyle="none", markersize=4, color=INK.light)
            axes.plot(np.array(costs)[best], degrees[best], "o", markersize=4.5, color=FIRST.light)
            axes.set_xscale("log")
            axes.set_yscale("log")
            axes.set_xlim(25.0, 6000.0)
            low, high = float(degrees.min()), float(degrees.max())
            axes.set_ylim(low / 10.0**1.5, high * 10.0**1.5)
            _name_points(axes, names, costs, degrees, np.log10(high / low) + 3.0)
            axes.yaxis.set_major_formatter(power_of_ten)
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.set_title(situation.title)
            axes.set_ylabel("largest error in 60 s [deg]")
        axes.set_xlabel("operations per gyro sample (a division, root, sine or cosine counts as ten)")
        return svg_text(figure, "Error of attitude algorithms against their cost in three situations")


def _name_points(axes: Axes, names: Sequence[str], costs: Sequence[float], degrees: np.ndarray, decades: float) -> None:
    """Names right of the points, moved apart where they would meet."""
    for cheap in (True, False):
        group = [k for k in range(len(names)) if (costs[k] < 400.0) == cheap]
        group.sort(key=lambda k: (degrees[k], -costs[k]))
        x = 1.25 * max(costs[k] for k in group)
        for k, height in zip(group, _apart(np.log10(degrees[group]), 0.07 * decades), strict=True):
            axes.annotate(
                names[k],
                (costs[k], degrees[k]),
                xytext=(x, 10.0**height),
                fontsize=7.5,
                va="center",
                arrowprops={"arrowstyle": "-", "color": MUTED.light, "linewidth": 0.4, "shrinkA": 1.0, "shrinkB": 3.0},
            )


def _apart(heights: np.ndarray, room: float) -> np.ndarray:
    """Ascending heights moved as little as need be until neighbours have `room` between them."""
    # The least squares problem with ordered differences: pools of neighbours about their mean (isotonic regression).
    offset = room * np.arange(len(heights))
    pools: list[list[float]] = []
    for value in heights - offset:
        pools.append([float(value)])
        while len(pools) > 1 and np.mean(pools[-2]) > np.mean(pools[-1]):
            pools[-2:] = [pools[-2] + pools[-1]]
    return np.concatenate([np.full(len(pool), np.mean(pool)) for pool in pools]) + offset


def _best_for_cost(costs: Sequence[float], degrees: np.ndarray) -> list[int]:
    """Those that no cheaper one betters, from the cheapest on."""
    best: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: (costs[k], degrees[k])):
        if not best or degrees[k] < degrees[best[-1]]:
            best.append(k)
    return best


def coning_drift(names: Sequence[str], phases: Sequence[float], drift: Sequence[Sequence[float]]) -> str:
    """Relative drift under coning over the phase of the cone in a gyro sample, as SVG.

    Parameters
    ----------
    names : sequence of str
        of the algorithms
    phases : sequence of float
        Ω Δt [rad]
    drift : sequence of sequence of float
        for each algorithm
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
        axes = figure.subplots()
        for name, values, look in zip(names, drift, LOOKS, strict=False):
            axes.loglog(phases, values, label=name, markersize=3, markevery=4, **look)
        axes.set_ylim(1e-12, 3.0)
        axes.set_xlim(min(phases) / 1.1, 1.1 * max(phases))
        axes.set_xticks([0.05, 0.1, 0.2, 0.5, 1.0, np.pi / 2])
        axes.xaxis.set_major_formatter(lambda value, _: "π/2" if value > 1.5 else f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda _, __: "")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.set_xlabel("Ω Δt: phase of the cone in one gyro sample [rad]")
        axes.set_ylabel("drift left, of the drift to compute")
        axes.legend(loc="lower right", handlelength=3.2)
        return svg_text(figure, "Relative drift of attitude algorithms under coning")


def aliasing(
    names: Sequence[str], rates: Sequence[float], errors: Sequence[Sequence[float]], highest_frequency: float
) -> str:
    """Error over the rate of the gyro samples, as SVG.

    Parameters
    ----------
    names : sequence of str
        of the algorithms
    rates : sequence of float
        [Hz]
    errors : sequence of sequence of float
        for each rate the error of each algorithm [rad]
    highest_frequency : float
        of the motion [Hz]; below twice of it the samples cannot show the motion
    """
    table = np.degrees(errors)
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
        axes = figure.subplots()
        axes.axvspan(min(rates) / 1.2, 2.0 * highest_frequency, color=BAND.light, linewidth=0)
        for k, name in enumerate(names):
            axes.loglog(rates, table[:, k], label=name, markersize=3.5, **LOOKS[k])
        axes.set_xlim(min(rates) / 1.2, 1.2 * max(rates))
        axes.set_xticks([500.0, 1000.0, 2000.0, 4000.0, 8000.0])
        axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        axes.xaxis.set_minor_formatter(lambda _, __: "")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.set_xlabel("gyro samples [Hz]; shaded: fewer than two in a period of the fastest vibration")
        axes.set_ylabel("largest error in 60 s [deg]")
        axes.legend(loc="upper right", handlelength=3.2)
        return svg_text(figure, "Error of attitude algorithms over the rate of the gyro samples")
