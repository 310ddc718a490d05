"""Pictures over time: the table's programme, and the attitude's error."""

from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike

from .svg import column, drawing, say_empty, svg_text, three_columns
from .theme import AXES, DASHES, FIRST, INK, SECOND, WIDTH

MOST_POINTS = 2000
"""A line of more points is drawn through the least and the largest value of each of half as many intervals."""


def thinned(time: np.ndarray, value: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """A line with fewer points that looks the same: least and largest value of each interval, gaps kept."""
    if len(time) <= MOST_POINTS:
        return time, value
    edges = np.linspace(0, len(time), MOST_POINTS // 2 + 1).astype(np.int64)
    kept: set[int] = {0, len(time) - 1}
    for first, last in pairwise(edges):
        part = value[first:last]
        known = np.flatnonzero(np.isfinite(part))
        if known.size:
            kept |= {int(first + known[np.argmin(part[known])]), int(first + known[np.argmax(part[known])])}
        if known.size < len(part):
            kept.add(int(first + np.flatnonzero(~np.isfinite(part))[0]))
    index = np.array(sorted(kept))
    return time[index], value[index]


def _line(axes: Axes, time: np.ndarray, value: np.ndarray, **look: Any) -> None:
    axes.plot(*thinned(time, value), **look)


def _legend(axes: Axes, columns: int) -> None:
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderpad=0.0, borderaxespad=0.35)


def _time_axis(axes: Axes, time: np.ndarray) -> None:
    axes.set_xlabel("time [s]")
    if np.isfinite(time).any() and np.nanmin(time) < np.nanmax(time):
        axes.set_xlim(float(np.nanmin(time)), float(np.nanmax(time)))


def bench_tour(time_s: ArrayLike, alpha_deg: ArrayLike, beta_deg: ArrayLike, readings_g: ArrayLike) -> str:
    """The table's programme over time, and what the three accelerometers read.

    Parameters
    ----------
    time_s : array, shape (N,)
        [s]
    alpha_deg, beta_deg : array, shape (N,)
        angles of the outer and the inner axis [deg]
    readings_g : array, shape (N, 3)
        [g]

    Returns
    -------
    str
        SVG
    """
    time, alpha, beta = column(time_s), column(alpha_deg), column(beta_deg)
    readings = three_columns(readings_g)
    with drawing():
        figure = Figure(figsize=(WIDTH, 4.1), layout="constrained")
        angles, forces = figure.subplots(2, 1, sharex=True, height_ratios=[1.0, 1.15])
        _line(angles, time, alpha, color=FIRST.light, label="α, outer axis")
        _line(angles, time, beta, color=SECOND.light, linestyle=DASHES[1], label="β, inner axis")
        known = np.concatenate([alpha, beta])
        known = known[np.isfinite(known)]
        if known.size and known.min() >= -1.0 and known.max() <= 361.0:
            angles.set_ylim(-12.0, 372.0)
            angles.set_yticks(range(0, 361, 90))
        angles.set_ylabel("angle [deg]")
        angles.set_title("table")
        for k in range(3):
            look: dict[str, Any] = {"color": AXES[k].light, "linestyle": DASHES[k]}
            _line(forces, time, readings[:, k], label=f"accelerometer {k + 1}", **look)
        forces.set_ylabel("reading [g]")
        forces.set_title("block")
        _time_axis(forces, time)
        _legend(angles, 2)
        _legend(forces, 3)
        if not known.size:
            say_empty(angles)
        if not np.isfinite(readings).any():
            say_empty(forces)
        return svg_text(figure, "Angles of the two axes of the table and the three readings, over time")


def attitude_error(time_s: ArrayLike, error_deg: ArrayLike, angle_deg: ArrayLike) -> str:
    """The attitude's error over time.

    Parameters
    ----------
    time_s : array, shape (N,)
        [s]
    error_deg : array, shape (N, 3)
        components of the error's rotation vector in the reference frame [deg]; NaN where it is not known
    angle_deg : array, shape (N,)
        its length [deg]

    Returns
    -------
    str
        SVG
    """
    time, error, angle = column(time_s), three_columns(error_deg), column(angle_deg)
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.1), layout="constrained")
        axes = figure.subplots()
        axes.axhline(0.0, color=INK.light, linewidth=0.7)
        _line(axes, time, angle, color=INK.light, linewidth=2.0, label="angle")
        for k in range(3):
            _line(axes, time, error[:, k], color=AXES[k].light, linestyle=DASHES[k], label=f"about axis {k + 1}")
        axes.set_ylabel("attitude error [deg]")
        _time_axis(axes, time)
        _legend(axes, 4)
        if not np.isfinite(angle).any() and not np.isfinite(error).any():
            say_empty(axes)
        return svg_text(figure, "Error of the computed attitude against the true one, over time")
