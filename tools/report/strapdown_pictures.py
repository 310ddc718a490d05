"""Pictures of the diagnosis of a strapdown record: errors over time and over what they may depend on, order, gain."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from numpy.typing import NDArray

from ..diagnosis.result import OrderOfEffects
from ..evidence.gain import ARCMIN
from .svg import drawing, say_empty, svg_text
from .theme import ALERT, DASHES, FIRST, INK, MUTED, QUIET, SECOND, THIRD, WIDTH

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
