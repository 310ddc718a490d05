"""Pictures over time and what changes with it: runs, attitude errors, Allan deviations, moves and windows."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from ...diagnosis.result import OrderOfEffects
from ...document.theme import (
    ALERT,
    AXES,
    DASHES,
    FIRST,
    INK,
    MUTED,
    QUIET,
    SECOND,
    THIRD,
    WIDTH,
    column,
    drawing,
    power_of_ten,
    say_empty,
    svg_text,
    three_columns,
)
from ...evidence.gain import ARCMIN
from ...motion.rests import Rests
from ...motion.sampling import rates_of
from ...records import StrapdownRecord
from ...records.noise import allan_deviation

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


PER_OCTAVE = 4
"""Averaging times in each octave."""
FEWEST_PAIRS = 4
"""Of averages side by side that do not overlap; fewer show chance."""


def allan_curve(values: NDArray, rows: Sequence[slice], period: float) -> tuple[NDArray, NDArray]:
    """Averaging times (m,) [s] and Allan deviations (m, 3) of readings (N, 3), all rests together.

    The longest is the one of which the rests hold four pairs of averages; there is none where they hold too few rows.
    """
    pieces = [values[r] for r in rows]
    longest = max((len(piece) for piece in pieces), default=0) // 2
    octaves = np.arange(0.0, np.log2(longest) + 1e-9, 1.0 / PER_OCTAVE) if longest else np.zeros(0)
    sizes = np.unique(np.round(2.0**octaves).astype(int))
    sizes = [size for size in sizes if sum(len(piece) // (2 * size) for piece in pieces) >= FEWEST_PAIRS]
    found = [(size * period, d) for size in sizes if (d := allan_deviation(pieces, int(size))) is not None]
    if not found:
        return np.zeros(0), np.zeros((0, 3))
    return np.array([time for time, _ in found]), np.array([deviation for _, deviation in found])


def allan_picture(record: StrapdownRecord, rests: Rests, period: float) -> str:
    """Allan deviation over the averaging time, gyros above and accelerometers below; the rests' length is marked.

    Parameters
    ----------
    record : StrapdownRecord
    rests : Rests
        of that record
    period : float
        time between rows [s]

    Returns
    -------
    str
        SVG
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
        panels = figure.subplots(2, 1, sharex=True)
        lengths = [(r.stop - r.start) * period for r in rests.rows]
        shown = ((rates_of(record), "gyros, rad/s"), (record.specific_force, "accelerometers, m/s²"))
        for axes, (values, title) in zip(panels, shown, strict=True):
            times, deviation = allan_curve(values, rests.rows, period)
            axes.set_title(f"Allan deviation of the {title}")
            visible = deviation > 0.0
            if not visible.any():
                say_empty(axes, "no rests")
                continue
            axes.set_xscale("log")
            axes.set_yscale("log")
            for p in range(3):
                some = visible[:, p]
                axes.plot(times[some], deviation[some, p], color=AXES[p].light, linestyle=DASHES[p], label=f"{p + 1}")
            axes.yaxis.set_major_formatter(power_of_ten)
            axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
            axes.minorticks_off()
            dwell = float(np.median(lengths))
            axes.axvline(dwell, color=MUTED.light, linewidth=0.9)
            axes.text(
                dwell,
                0.97,
                f"median rest, {dwell:.2g} s ",
                ha="right",
                transform=axes.get_xaxis_transform(),
                va="top",
                fontsize=8.0,
            )
        panels[1].set_xlabel("averaging time, s")
        handles, labels = panels[0].get_legend_handles_labels()
        if handles:
            panels[0].legend(handles, labels, loc="lower left", ncols=3, title="axis")
        return svg_text(figure, "Allan deviation of the gyros and the accelerometers at rest")


STEP_COLOURS = (FIRST, SECOND, THIRD, ALERT, MUTED)
MARKERS = ("o", "s", "^", "D", "v")


def sizes(errors: NDArray) -> NDArray[np.float64]:
    """Sizes (S,) of errors (S, d), arcminutes."""
    return np.linalg.norm(errors, axis=1) / ARCMIN


def error_axes(axes: Axes, x: NDArray, before: NDArray, after: NDArray | None) -> None:
    """Sizes of errors (S,) against x (S,): hollow without the effects, filled with them."""
    axes.plot(x, before, linestyle="none", marker="o", markersize=3.6, markerfacecolor="none", color=SECOND.light)
    if after is not None:
        axes.plot(x, after, linestyle="none", marker="o", markersize=2.8, color=FIRST.light, markeredgewidth=0)
    axes.set_ylim(0.0, 1.08 * max(float(before.max(initial=0.0)), 1e-9))


def handles_of(*, after: bool, bound: bool) -> list[Line2D]:
    """What the marks mean."""
    hollow = Line2D([], [], linestyle="none", marker="o", markerfacecolor="none", color=SECOND.light, markersize=4.0)
    hollow.set_label("the block without effects")
    found = [hollow]
    if after:
        found.append(Line2D([], [], linestyle="none", marker="o", color=FIRST.light, markersize=3.6, label="with them"))
    if bound:
        found.append(Line2D([], [], color=ALERT.light, linewidth=1.2, label="bound about each axis"))
    return found


def errors_over_time(time: NDArray, before: NDArray, after: NDArray | None, bound: NDArray, label: str) -> str:
    """Errors of each piece over time.

    Parameters
    ----------
    time : (S,) array
        middles of the pieces [s]
    before, after : (S, d) array
        errors [rad]; None: nothing was found
    bound : (S, d) array
        [rad]
    label : str
        what the pieces are

    Returns
    -------
    str
        SVG
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.8), layout="constrained")
        axes = figure.subplots()
        shown = sizes(before)
        error_axes(axes, time, shown, None if after is None else sizes(after))
        limit = bound.max(axis=1) / ARCMIN
        axes.plot(time, limit, color=ALERT.light, linewidth=1.2, drawstyle="steps-mid")
        reach = float(shown.max(initial=0.0))
        # All of the bound is shown, unless the errors would then be dots at the bottom.
        highest = float(limit.max(initial=0.0))
        axes.set_ylim(0.0, 1.08 * max(reach, highest if highest < 6.0 * reach else float(np.median(limit))))
        axes.set_xlabel("time, s")
        axes.set_ylabel("error, arcmin")
        figure.legend(handles=handles_of(after=after is not None, bound=True), loc="outside upper left", ncols=3)
        if not len(time):
            say_empty(axes)
        return svg_text(figure, f"Error of the carried attitude over each of the {label} of the record")


def quantity_axes(quantities: Mapping[str, NDArray]) -> list[tuple[str, NDArray]]:
    """What the errors are drawn against: name with unit, values (S,)."""
    found = [
        ("mean rate, deg/s", np.degrees(np.linalg.norm(quantities["rate"], axis=1))),
        ("turn, deg", np.degrees(np.linalg.norm(quantities["turn"], axis=1))),
        ("axis 3 from the vertical, deg", np.degrees(np.arccos(np.clip(quantities["orientation"][:, 2], -1.0, 1.0)))),
    ]
    if "temperature" in quantities:
        found.append(("temperature, °C", quantities["temperature"][:, 0]))
    return found


def errors_over_quantities(quantities: Mapping[str, NDArray], before: NDArray, after: NDArray | None) -> str:
    """Errors of each piece against mean rate, turn, orientation and, where the record has it, temperature (SVG)."""
    shown = quantity_axes(quantities)
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.6), layout="constrained")
        panels = np.atleast_1d(figure.subplots(1, len(shown), sharey=True))
        for axes, (name, values) in zip(panels, shown, strict=True):
            error_axes(axes, values, sizes(before), None if after is None else sizes(after))
            axes.set_xlabel(name)
        panels[0].set_ylabel("error, arcmin")
        figure.legend(handles=handles_of(after=after is not None, bound=False), loc="outside upper left", ncols=2)
        return svg_text(figure, "Error of the carried attitude against rate, turn, orientation and temperature")


def order_picture(orders: Sequence[tuple[str, OrderOfEffects]]) -> str:
    """What is left of errors that were left out, effect after effect, for each length (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
        axes = figure.subplots()
        names = list(dict.fromkeys(step.effect for _, order in orders for step in order.steps))
        for k, (label, order) in enumerate(orders):
            left = [order.held_out_rms_arcmin, *(step.held_out_rms_arcmin for step in order.steps)]
            colour, dash = STEP_COLOURS[k % 5].light, DASHES[k % 3]
            axes.plot(range(len(left)), left, color=colour, linestyle=dash, label=label)
            for number, step in enumerate(order.steps, start=1):
                marker = MARKERS[names.index(step.effect) % 5]
                axes.plot([number], [step.held_out_rms_arcmin], marker=marker, markersize=4.5, color=colour)
        most = max((len(order.steps) for _, order in orders), default=0)
        axes.set_xticks(range(most + 1), ["none", *(str(k) for k in range(1, most + 1))])
        axes.set_xlim(-0.15, max(most, 1) + 0.15)
        axes.set_ylim(bottom=0.0)
        axes.set_xlabel("effects that are taken in, in the order in which they help most")
        axes.set_ylabel("rms error left out, arcmin")
        marks = [
            Line2D([], [], linestyle="none", marker=MARKERS[k % 5], color=INK.light, markersize=4.5, label=name)
            for k, name in enumerate(names)
        ]
        lines, _ = axes.get_legend_handles_labels()
        figure.legend(handles=[*lines, *marks], loc="outside right upper")
        if not orders:
            say_empty(axes)
        return svg_text(figure, "Errors that were left out, after each effect, for each length of windows or moves")


def gain_picture(before: NDArray, after: NDArray, label: str) -> str:
    """Shares of the pieces that were not used whose error is at most so large, without the effects and with (SVG)."""
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
        axes = figure.subplots()
        for errors, colour, dash, name in (
            (before, SECOND, DASHES[1], "the block without effects"),
            (after, FIRST, DASHES[0], "with them"),
        ):
            found = np.sort(sizes(errors))
            share = np.arange(1, len(found) + 1) / max(len(found), 1)
            axes.plot(found, share, color=colour.light, linestyle=dash, drawstyle="steps-post", label=name)
        axes.set_xlim(left=0.0)
        axes.set_ylim(0.0, 1.02)
        axes.axhline(0.5, color=QUIET.light, linewidth=0.7)
        axes.set_xlabel(f"error over {label}, arcmin")
        axes.set_ylabel("part of the pieces")
        figure.legend(loc="outside upper left", ncols=2)
        return svg_text(figure, "Part of the pieces that were not used whose error is at most so large")
