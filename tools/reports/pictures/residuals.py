"""Pictures of residuals: of readings and pieces, of unused parts, of targets; of a function outside the catalogue."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
import scipy
from numpy.typing import NDArray

from ....fmus.units import ARCMIN
from ....models.arrays import Floats
from ...calibrated import Calibration, ParameterChange
from ...calibration.estimates import PairSet
from ...calibration.model import Positions
from ...document.notation import minus, plain, short
from ...rounding import downwards, exactly, interval, residual
from . import (
    AFTER,
    ALERT,
    AXES,
    BAND,
    BEFORE,
    CARD,
    DASHES,
    FIRST,
    INK,
    MUTED,
    PROOF,
    QUIET,
    SECOND,
    THIRD,
    WIDTH,
    Drawn,
    drawn,
    farthest,
    legend,
    named_rows,
    one_turn,
    say_empty,
    sheet,
    zero_line,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...diagnosis.result import OrderOfEffects


MOST_LINES = 3
"""Largest number of laws that are drawn."""
FINE = 201
"""Points of a smooth law."""


@drawn
def residuals(positions: Positions, before: NDArray, after: NDArray | None, proof: NDArray) -> Drawn:
    """Draw residuals (N, 3) of the three accelerometers over the two angles of N positions; SVG, as in all functions
    here.

    They are in units of σ, NaN for an unused reading. `after` are those of the extended model; `proof` (N, 3) of bool
    are the measurements that prove that no parameters fit the model.
    """
    angles = np.degrees([positions.alpha, positions.beta]) % 360.0
    figure, panels = sheet(5.4, 3, 2, sharex="col", sharey=True)
    reach = 1.2 * max(1.25, farthest(before, after))
    for (row, side), axes in np.ndenumerate(panels):
        _readings(axes, angles[side], row, before, after, proof)
        axes.set_ylim(-reach, reach)
    for row in range(3):
        panels[row, 0].set(ylabel="residual [σ]", title=f"accelerometer {row + 1}")
    for side, name in enumerate(("α, outer axis [deg]", "β, inner axis [deg]")):
        panels[2, side].set_xlabel(name)
        one_turn(panels[2, side], angles[side])
    legend(figure)
    return figure, "Residuals in units of the noise bound over the two angles of the table"


@drawn
def truth_in_intervals(low: NDArray, high: NDArray) -> Drawn:
    """Draw the interval of each of N parameters, by its ends (N,) less the true value, in units of its half width."""
    figure, ((axes,),) = sheet(3.0, width=CARD)
    number = np.arange(1, len(low) + 1)
    axes.vlines(number, low, high, color=FIRST.light, linewidth=2.6, label="guaranteed interval")
    axes.axhline(0.0, color=SECOND.light, linewidth=1.3, label="truth")
    axes.set(xlabel="parameter", ylabel="value less truth, in half widths")
    axes.grid(visible=False, axis="x")
    legend(figure)
    return figure, f"Intervals of {len(low)} parameters about their true values"


@drawn
def residuals_over_inputs(inputs: NDArray, before: NDArray, after: NDArray | None, proof: NDArray) -> Drawn:
    """Draw residuals of each accelerometer against its own input (N, 3) [g]; the others as for `residuals`."""
    figure, (panels,) = sheet(2.7, 1, 3, sharey=True)
    for p, axes in enumerate(panels):
        _readings(axes, inputs[:, p], p, before, after, proof)
        axes.set(title=f"accelerometer {p + 1}", xlabel="its input [g]", xlim=(-1.12, 1.12))
    panels[0].set_ylabel("residual [σ]")
    legend(figure)
    return figure, "Residuals of each accelerometer against its own input"


def _readings(axes: "Axes", x: NDArray, p: int, before: NDArray, after: NDArray | None, proof: NDArray) -> None:
    """Draw residuals of accelerometer p over x (N,)."""
    zero_line(axes)
    axes.plot(x, before[:, p], **BEFORE, label="residual" if after is None else "before")
    if after is not None:
        axes.plot(x, after[:, p], **AFTER, label="with the effect")
    if proof[:, p].any():
        axes.plot(x[proof[:, p]], before[proof[:, p], p], **PROOF, label="proves that no fit exists")
    if not np.isfinite(before[:, p] + x).any():
        say_empty(axes)


@drawn
def additions(
    titles: Sequence[str], on: str, values: Sequence[NDArray], parts: Sequence[tuple[NDArray, NDArray]]
) -> Drawn:
    """Draw what an explanation adds (n,) to the readings of some channels over one quantity (n,).

    `parts` are the errors without the explanation and what it adds, in units of the bound.
    """
    figure, (panels,) = sheet(2.9, 1, len(titles), sharey=True)
    for axes, title, x, (without, added) in zip(panels, titles, values, parts, strict=True):
        zero_line(axes)
        order = np.argsort(x, kind="stable")
        axes.plot(x, without, **BEFORE, label="readings without it")
        axes.plot(x[order], added[order], color=FIRST.light, marker=".", markersize=4.0, label="what it adds")
        axes.set(title=title, xlabel=on)
    panels[0].set_ylabel("over the bound [σ]")
    legend(figure)
    return figure, f"What the explanation adds to {', '.join(titles)} over {on}"


Residuals: TypeAlias = tuple[str, Mapping[str, NDArray], NDArray, NDArray]
"""Title of a channel, its quantities (n,) by label, its errors (n,) over their bounds before and after."""


@drawn
def residuals_by_quantity(channels: Sequence[Residuals]) -> Drawn:
    """Draw the residuals of channels against each of their quantities, before and after; NaN for unused ones.

    All channels have the same quantities.
    """
    names = list(channels[0][1])
    figure, panels = sheet(0.9 + 1.5 * len(channels), len(channels), len(names), sharex="col", sharey="row")
    for of_channel, (title, quantities, before, after) in zip(panels, channels, strict=True):
        for axes, values in zip(of_channel, quantities.values(), strict=True):
            zero_line(axes)
            axes.plot(values, before, **BEFORE, label="before")
            axes.plot(values, after, **AFTER, label="with it")
        of_channel[0].set(title=title, ylabel="residual [σ]")
    for axes, name in zip(panels[-1], names, strict=True):
        axes.set_xlabel(name)
    legend(figure)
    return figure, "Residuals against each quantity, before and after"


@drawn
def next_directions(
    alpha: NDArray, beta: NDArray, next_alpha: NDArray, next_beta: NDArray, labels: Sequence[str] = ()
) -> Drawn:
    """Draw directions of the vertical in the inner frame, for angles [rad]; areas on the sphere are as on paper.

    They were measured (N,), or are proposed (K,), with labels beside them.
    """
    figure, ((axes,),) = sheet(2.9)
    measured = {"marker": "o", "color": QUIET.light if len(labels) else FIRST.light, "markersize": 4.4}
    proposed = {"marker": "D", "color": ALERT.light, "markersize": 5.5}
    for a, b, words, label, look in (
        (alpha, beta, (), "measured", measured),
        (next_alpha, next_beta, labels, "measure next", proposed),
    ):
        if not len(a):
            continue
        around, along = np.degrees(np.arctan2(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b))), np.cos(a)
        axes.plot(around, along, linestyle="none", markeredgewidth=0, label=label, **look)
        for x, y, text in zip(around, along, words, strict=False):
            axes.annotate(text, (x, y), (5, 4), textcoords="offset points", fontsize=7.5)
    axes.set(xlim=(-185.0, 185.0), ylim=(-1.12, 1.12), xticks=range(-180, 181, 90), ylabel="along the third axis")
    axes.set_xlabel("direction about the third axis of the inner frame, from the first [deg]")
    legend(figure, 2)
    return figure, "Directions of the vertical in the inner frame: measured positions and proposed ones"


MOST_LABELS = 32
"""Largest number of labels beside each other; of more, every second, third, ... is shown."""


@drawn
def held_out(before: NDArray, after: NDArray, labels: Sequence[object], width: float = WIDTH) -> Drawn:
    """Draw prediction errors (N, 3) in units of σ at N unused positions, without the effects and with them.

    `labels` are the names of the positions.
    """
    names = [short(label, 24) for label in labels]
    place = (np.arange(len(names))[:, None] + np.array([-0.24, 0.0, 0.24])).ravel()
    figure, ((axes,),) = sheet(3.0, width=width)
    zero_line(axes)
    axes.vlines(place, before.ravel(), after.ravel(), color=MUTED.light, linewidth=0.7)
    axes.plot(place, before.ravel(), **BEFORE, label="before")
    axes.plot(place, after.ravel(), **AFTER, label="with the effect")
    every = -(-len(names) // MOST_LABELS)
    long = max(map(len, names)) * min(len(names), MOST_LABELS) > 90
    turn: dict[str, Any] = {"rotation": 45, "ha": "right", "rotation_mode": "anchor"} if long else {}
    axes.set_xticks(np.arange(len(names))[::every], names[::every], **turn)
    axes.tick_params(axis="x", length=0)
    axes.grid(visible=False, axis="x")
    reach = 1.12 * max(1.25, farthest(before, after))
    axes.set(xlim=(-0.6, len(names) - 0.4), ylim=(-reach, reach), ylabel="error of prediction [σ]")
    axes.set_xlabel("held-out position" + ("; accelerometers 1, 2, 3 side by side" if width == WIDTH else ""))
    legend(figure)
    return figure, "Errors of prediction at held-out positions, before and after the model was extended"


@drawn
def errors_of_turns(time: NDArray, before: NDArray, after: NDArray | None) -> Drawn:
    """Draw the largest error (S,) of each turn over its bound at the time (S,) of its middle [s].

    `after` is None if nothing was found.
    """
    figure, ((axes,),) = sheet(2.8)
    axes.axhspan(0.0, 1.0, color=BAND.light, linewidth=0, label="within the bound")
    if after is not None:
        axes.vlines(time, before, after, color=MUTED.light, linewidth=0.7)
    axes.plot(time, before, **BEFORE, label="error" if after is None else "before")
    if after is not None:
        axes.plot(time, after, **AFTER, label="with the effect")
    axes.set(xlabel="time [s]", ylabel="error over its bound", ylim=(0.0, 1.08 * max(1.25, farthest(before))))
    legend(figure)
    return figure, "Error of each turn over its bound, before and after"


@drawn
def errors_over_time(time: NDArray, before: NDArray, after: NDArray | None, bound: NDArray, label: str) -> Drawn:
    """Draw errors (S, d) [rad] of each piece over the time (S,) of its middle [s], with their bounds (S, d) [rad].

    `after` is None if nothing was found; `label` names the pieces.
    """
    figure, ((axes,),) = sheet(2.8)
    _pieces(axes, time, before, after)
    limit = bound.max(axis=1) / ARCMIN
    axes.plot(time, limit, color=ALERT.light, linewidth=1.2, drawstyle="steps-mid", label="bound about each axis")
    # Show the whole bound, unless the errors would then be dots at the bottom.
    reach, highest = farthest(sizes(before)), farthest(limit)
    axes.set_ylim(0.0, 1.08 * max(reach, highest if highest < 6.0 * reach else 1.5 * float(np.median(limit))))
    axes.set(xlabel="time, s", ylabel="error, arcmin")
    legend(figure)
    return figure, f"Error of the carried attitude over each of the {label} of the record"


@drawn
def errors_over_quantities(quantities: Mapping[str, NDArray], before: NDArray, after: NDArray | None) -> Drawn:
    """Draw errors of each piece against mean rate, turn, orientation and, if the record has it, temperature."""
    quantities_drawn = [
        ("mean rate, deg/s", np.degrees(np.linalg.norm(quantities["rate"], axis=1))),
        ("turn, deg", np.degrees(np.linalg.norm(quantities["turn"], axis=1))),
        ("axis 3 from the vertical, deg", np.degrees(np.arccos(np.clip(quantities["orientation"][:, 2], -1.0, 1.0)))),
    ]
    if "temperature" in quantities:
        quantities_drawn.append(("temperature, °C", quantities["temperature"][:, 0]))
    figure, (panels,) = sheet(2.6, 1, len(quantities_drawn), sharey=True)
    for axes, (name, values) in zip(panels, quantities_drawn, strict=True):
        _pieces(axes, values, before, after)
        axes.set_xlabel(name)
    panels[0].set_ylabel("error, arcmin")
    legend(figure)
    return figure, "Error of the carried attitude against rate, turn, orientation and temperature"


def sizes(errors: NDArray) -> Floats:
    """Return sizes (S,) of errors (S, d), arcminutes."""
    return np.linalg.norm(errors, axis=1) / ARCMIN


def _pieces(axes: "Axes", x: NDArray, before: NDArray, after: NDArray | None) -> None:
    """Draw sizes of errors (S, d) [rad] against x (S,)."""
    axes.plot(x, sizes(before), **BEFORE, label="the block without effects")
    if after is not None:
        axes.plot(x, sizes(after), **AFTER, label="with them")
    axes.set_ylim(0.0, 1.08 * max(farthest(sizes(before)), 1e-9))


@drawn
def shares_of_pieces(before: NDArray, after: NDArray, label: str) -> Drawn:
    """Draw the cumulative shares of unused pieces over their error, without the effects and with them."""
    figure, ((axes,),) = sheet(2.7)
    for errors, colour, dash, name in (
        (before, SECOND, DASHES[1], "the block without effects"),
        (after, FIRST, DASHES[0], "with them"),
    ):
        ordered = np.sort(sizes(errors))
        share = np.arange(1, len(ordered) + 1) / max(len(ordered), 1)
        axes.plot(ordered, share, color=colour.light, linestyle=dash, drawstyle="steps-post", label=name)
    axes.axhline(0.5, color=QUIET.light, linewidth=0.7)
    axes.set_xlim(left=0.0)
    axes.set(ylim=(0.0, 1.02), xlabel=f"error over {label}, arcmin", ylabel="part of the pieces")
    legend(figure)
    return figure, "Part of the pieces that were not used whose error is at most so large"


MARKERS = ("o", "s", "^", "D", "v")


@drawn
def order_picture(orders: Sequence[tuple[str, "OrderOfEffects"]]) -> Drawn:
    """Draw the held-out errors that remain, effect after effect, for each length."""
    figure, ((axes,),) = sheet(2.9)
    names: list[str] = []
    most = 0
    for k, (label, order) in enumerate(orders):
        most = max(most, len(order.steps))
        errors = [order.held_out_rms_arcmin]
        for step in order.steps:
            errors.append(step.held_out_rms_arcmin)
            if step.effect not in names:
                names.append(step.effect)
        colour = RECORDS[k % len(RECORDS)].light
        axes.plot(range(len(errors)), errors, color=colour, linestyle=DASHES[k % 3], label=label)
        for number, step in enumerate(order.steps, start=1):
            axes.plot(
                number, errors[number], marker=MARKERS[names.index(step.effect) % 5], markersize=4.5, color=colour
            )
    for k, name in enumerate(names):
        axes.plot([], [], linestyle="none", marker=MARKERS[k % 5], color=INK.light, markersize=4.5, label=name)
    ticks = ["none"]
    for k in range(1, most + 1):
        ticks.append(str(k))
    axes.set_xticks(range(most + 1), ticks)
    axes.set(xlim=(-0.15, max(most, 1) + 0.15), ylabel="rms error left out, arcmin")
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("effects that are taken in, in the order in which they help most")
    legend(figure, 1, loc="outside right upper")
    return figure, "Errors that were left out, after each effect, for each length of windows or moves"


ROUNDING = 1e-6
"""Margin above 1 within which a radius counts as 1: the precision of a linear programme."""


@drawn
def candidates(names: Sequence[str], radius: Sequence[float]) -> Drawn:
    """Draw the misfit that remains with each of N candidate effects, by name and place; the best is first.

    `radius` (N,) is the least max |residual| in units of its bound; the data are explained up to 1.
    """
    order = np.argsort(radius, kind="stable")
    radii, labels = np.array(radius)[order], [short(names[k]) for k in order]
    explained = radii <= 1.0 + ROUNDING
    figure, ((axes,),) = sheet(1.05 + 0.25 * max(len(labels), 2))
    colours = [FIRST.light if good else QUIET.light for good in explained]
    axes.barh(np.arange(len(labels)), np.where(np.isfinite(radii), radii, 0.0), height=0.62, color=colours, linewidth=0)
    axes.axvline(1.0, color=ALERT.light, linewidth=1.3, label="the data are explained up to here")
    for k, value in enumerate(radii):
        text = residual(value) if np.isfinite(value) else "not possible"
        at = 0.0 if not np.isfinite(value) else 1.0 if explained[k] else value
        axes.annotate(text, (at, k), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
    axes.set(xlim=(0.0, 1.1 * max(farthest(radii), 1.25)), xlabel="largest residual over its bound")
    named_rows(axes, labels)
    legend(figure)
    return figure, "Largest residual that each candidate effect leaves, in units of the noise bound"


@drawn
def shares(entries: Sequence[Mapping[str, Any]], of: str) -> Drawn:
    """Draw the share of a residual that each quantity predicts, before the share that is predictable at all."""
    figure, ((axes,),) = sheet(1.05 + 0.24 * max(len(entries), 2))
    y = np.arange(len(entries))
    possible = [entry["explainable"] for entry in entries]
    axes.barh(y, possible, height=0.86, color=BAND.light, linewidth=0, label="more than noise")
    colours = [AXES[int(entry[of]) - 1].light for entry in entries]
    axes.barh(y, [entry["explained"] for entry in entries], height=0.52, color=colours, linewidth=0)
    axes.set(xlim=(0.0, 1.0), xlabel="part of the residual's sum of squares")
    named_rows(axes, [short(f"{of} {entry[of]}: {entry['on']}") for entry in entries])
    legend(figure)
    return figure, f"How much of the residual of each {of} each quantity predicts"


SHOWN_FROM = 0.005
CLOSE = 0.9
"""Likeness from which a field is marked: the two are hard to tell apart."""


@drawn
def likeness_picture(labels: Sequence[str], alike: NDArray) -> Drawn:
    """Draw the lower half of a symmetric matrix (K, K), from 0 to 1: the likeness of each two of K effects."""
    count = len(labels)
    from matplotlib.patches import Rectangle

    figure, ((axes,),) = sheet(0.7 + 0.3 * count)
    for i, j in np.argwhere(np.tri(count, k=-1)).tolist():
        axes.add_patch(Rectangle((j - 0.46, i - 0.44), 0.92, 0.88, facecolor=BAND.light, linewidth=0))
        if alike[i, j] >= CLOSE:
            edge = {"facecolor": "none", "edgecolor": FIRST.light, "linewidth": 1.4}
            axes.add_patch(Rectangle((j - 0.46, i - 0.44), 0.92, 0.88, **edge))
        if alike[i, j] >= SHOWN_FROM:
            text = downwards(alike[i, j]) if alike[i, j] < 1 - 1e-9 else "1"
            axes.text(j, i, text, ha="center", va="center", fontsize=8.0, color=INK.light)
    for k in range(count):
        axes.text(k, k, str(k + 1), ha="center", va="center", fontsize=8.5, color=INK.light, fontweight="bold")
    named_rows(axes, [f"{k} · {short(label, 46)}" for k, label in enumerate(labels, start=1)])
    axes.set(xlim=(-0.6, count - 0.4), xticks=[])
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    return figure, "How alike effects look at the positions of the record"


@drawn
def joint_set(pairs: Sequence[PairSet], estimates: Mapping[str, float], noise_bound: float) -> Drawn:
    """Draw pairwise projections of the set of possible parameters: every pair of a group once.

    The panels are about the targets' estimates, by symbol; σ is the unit of their axes.
    """
    across = list(dict.fromkeys(pair.first.symbol for pair in pairs))
    down = list(dict.fromkeys(pair.second.symbol for pair in pairs))
    side = min(1.5, (WIDTH - 0.6) / max(len(across), 3))
    from matplotlib.patches import Polygon

    figure, panels = sheet(0.9 + side * len(down), len(down), len(across), sharex="col", sharey="row")
    for axes in panels.flat:
        axes.set_visible(False)
    for pair in pairs:
        row, at = down.index(pair.second.symbol), across.index(pair.first.symbol)
        axes = panels[row, at]
        axes.set_visible(True)
        about = np.array([estimates.get(target.symbol, 0.0) for target in (pair.first, pair.second)])
        corners = (pair.vertices - about) / noise_bound
        low, high = corners.min(axis=0), corners.max(axis=0)
        box = [low, (high[0], low[1]), high, (low[0], high[1])]
        looks: list[tuple[Any, dict[str, Any]]] = [
            (corners, {"facecolor": FIRST.light, "alpha": 0.35, "linewidth": 0, "label": "possible together"}),
            (box, {"color": BAND.light, "linewidth": 0, "zorder": 0.9, "label": "each by itself"}),
            (corners, {"fill": False, "edgecolor": FIRST.light, "linewidth": 1.0}),
        ]
        for ends, look in looks:
            axes.add_patch(Polygon(ends, closed=True, **look))
        axes.plot(0.0, 0.0, "o", color=INK.light, markersize=2.6, label="estimates")
        least, most = np.minimum(low, 0.0), np.maximum(high, 0.0)
        margin = 0.08 * np.maximum(most - least, 1e-6)
        axes.dataLim.update_from_data_xy(np.array([least - margin, most + margin]))
        axes.autoscale_view()
        axes.tick_params(labelsize=7)
        axes.locator_params(nbins=4)
        if row == len(down) - 1:
            axes.set_xlabel(f"{plain(pair.first.symbol).replace('-', '−')} [σ]")
        if at == 0:
            axes.set_ylabel(f"{plain(pair.second.symbol).replace('-', '−')} [σ]")
    legend(figure)
    return figure, "Pairs of targets: what the readings leave possible, in units of the noise bound"


@dataclass(frozen=True, eq=False)
class BandDrawn:
    """The possible functions for a drawing: in units of one `unit` at `at`, in the quantity's own unit.

    `at` (k,), `low`, `high` (k,) are those of all functions. `readings` are values (n,) of the quantity and the
    readings of the function there (n,). `lines` are names with a function (K,) at `knots` (K,), and `whole` the same
    with the part that the model imitates. `steps`: functions jump.
    """

    at: Floats
    low: Floats
    high: Floats
    knots: Floats
    readings: tuple[Floats, Floats]
    lines: Sequence[tuple[str, Floats]]
    whole: Sequence[tuple[str, Floats]]
    quantity: str
    error: str
    steps: bool = False
    circle: bool = False


@drawn
def band_picture(band: BandDrawn, width: float = WIDTH) -> Drawn:
    """Draw the band with the laws in it and the readings, beside the whole laws; SVG."""
    beside = width == WIDTH and len(band.whole) > 0
    figure, (panels,) = sheet(3.4 if width == WIDTH else 3.0, 1, 1 + beside, width=width)
    if beside:
        _laws(panels[0], band, band.whole)
        panels[0].set(title="whole", ylabel=band.error)
        panels[1].set_title("nominal model subtracted")
    axes = panels[-1]
    axes.fill_between(band.at, band.low, band.high, color=BAND.light, linewidth=0, label="possible")
    for end in (band.low, band.high):
        axes.plot(band.at, end, color=QUIET.light, linewidth=0.8)
    if len(band.readings[0]):
        axes.plot(*band.readings, **{**AFTER, "color": INK.light}, label="readings")
    _laws(axes, band, band.lines)
    axes.set_ylabel("" if beside else band.error)
    # A reading with a large error may lie far off: the band and the laws fill the picture.
    ends = np.concatenate([band.low, band.high, *(values for _, values in band.lines[:MOST_LINES])])
    reach = 0.1 * float(np.ptp(ends))
    axes.set_ylim(float(ends.min()) - reach, float(ends.max()) + reach)
    legend(figure)
    return figure, f"Functions of {band.quantity} that the record leaves possible, with laws among them"


def _laws(axes: "Axes", band: BandDrawn, lines: Sequence[tuple[str, NDArray]]) -> None:
    """Draw the first laws, by name, over the quantity."""
    axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
    is_smooth = lines is band.whole and not band.steps
    for (name, values), colour, dash in zip(lines[:MOST_LINES], AXES, DASHES, strict=False):
        known = np.isfinite(values)
        x, y = band.knots[known], values[known]
        if is_smooth and len(x) > 2:
            between = np.linspace(x[0], x[-1], FINE)
            x, y = between, scipy.interpolate.PchipInterpolator(x, y)(between)
        axes.plot(x, y, color=colour.light, linestyle=dash, label=name)
    axes.set_xlabel(band.quantity)
    if band.circle:
        one_turn(axes, band.at)


@drawn
def matrix_picture(values: NDArray, low: NDArray, high: NDArray, columns: Sequence[str], unit: str) -> Drawn:
    """Draw a matrix (3, 3) of the gyros with its intervals: framed where zero is not possible."""
    from matplotlib.patches import Rectangle

    figure, ((axes,),) = sheet(2.2)
    for (row, column), value in np.ndenumerate(values):
        least, most = float(low[row, column]), float(high[row, column])
        is_sure = least > 0.0 or most < 0.0
        edge = FIRST if is_sure else BAND
        box = Rectangle((column - 0.47, row - 0.42), 0.94, 0.84, facecolor=BAND.light, edgecolor=edge.light)
        axes.add_patch(box)
        estimate, *ends = interval(value, least, most)
        axes.text(column, row - 0.1, minus(estimate), ha="center", va="center", weight="bold" if is_sure else "normal")
        words = {"ha": "center", "va": "center", "fontsize": 7.5, "color": MUTED.light}
        axes.text(column, row + 0.22, minus(" to ".join(ends)), **words)
    named_rows(axes, ("gyro 1", "gyro 2", "gyro 3"))
    axes.set_xticks(range(3), columns)
    axes.tick_params(axis="x", length=0, top=False, labelcolor=INK.light)
    axes.grid(visible=False)
    axes.set(xlim=(-0.55, 2.55), ylim=(2.5, -0.5), xlabel=f"[{unit}]" if unit else "")
    for side in axes.spines.values():
        side.set_visible(False)
    return figure, "Matrix of the gyros with its intervals"


MOST_ROWS = 30
"""Largest number of parameters that are drawn."""
RECORDS = (FIRST, SECOND, THIRD, ALERT, MUTED)
"""Colours of records."""
RELATIVE = ("g", "rad", "1")
"""Units of parameters that σ, a fraction of g, measures."""
LINEAR = 10.0
"""Largest change on the linear part of an axis of changes."""


def drawable(alone: Calibration) -> list[ParameterChange]:
    """Return the parameters that two records at least bound, those that surely change first."""
    bounded = []
    for change in alone.changes:
        if sum(p.bounded for p in alone.each(change.symbol).values()) > 1:
            bounded.append(change)
    return sorted(bounded, key=lambda change: (change.at_least == 0.0, change.of == "run"))[:MOST_ROWS]


@drawn
def repeatability_picture(alone: Calibration, sigma: float | None, names: Mapping[str, str]) -> Drawn:
    """Draw the possible values of each parameter for each record, in units of σ about the middle of the records.

    Parameters
    ----------
    alone : Calibration
        each record by itself
    sigma : float or None
        σ, for parameters in g, radians or pure numbers; others, and all without it, are in half widths of the
        narrowest interval
    names : mapping
        symbol -> name of the row
    """
    rows = drawable(alone)
    labels = list(alone.of_record)
    figure, ((axes,),) = sheet(1.3 + 0.36 * len(rows))
    for number, change in enumerate(rows):
        parameters = {label: p for label, p in alone.each(change.symbol).items() if p.bounded}
        ends = np.array([p.ends for p in parameters.values()])
        middle, narrowest = 0.5 * (ends.min() + ends.max()), 0.5 * float(np.ptp(ends, axis=1).min())
        unit = sigma if sigma is not None and change.unit in RELATIVE else narrowest or 1.0
        if change.at_least > 0.0:
            axes.axhspan(number - 0.5, number + 0.5, color=BAND.light, linewidth=0, zorder=0, label="surely changes")
        for record, (low, high) in zip(parameters, (ends - middle) / unit, strict=True):
            place = labels.index(record)
            at = number + 0.7 * ((place + 0.5) / len(labels) - 0.5)
            colour = RECORDS[place % len(RECORDS)].light
            ends_of_bar: dict[str, Any] = {"marker": "|", "markersize": 5.0, "markeredgewidth": 1.6}
            axes.plot([low, high], [at, at], color=colour, linewidth=3.0, label=short(record, 24), **ends_of_bar)
    axes.axvline(0.0, color=MUTED.light, linewidth=0.6)
    reach = 1.3 * max(np.abs(axes.dataLim.intervalx).max(), 1.0)
    axes.set_xscale("symlog", linthresh=LINEAR)
    axes.set_xlim(-reach, reach)
    powers = 10.0 ** np.arange(1 if reach > LINEAR else 0, 9)
    ticks = np.concatenate([-powers[powers < reach], [0.0], powers[powers < reach]])
    axes.set_xticks(ticks, [minus(exactly(tick)) for tick in ticks.tolist()])
    axes.minorticks_off()
    axes.set_xlabel(f"value less the middle of the records [{'half widths' if sigma is None else 'σ'}]")
    named_rows(axes, [short(names[change.symbol], 44) for change in rows])
    legend(figure)
    return figure, f"Possible values of {len(rows)} parameters by each record"
