"""Pictures of what is left: residuals over angles, inputs and directions, rests, sets of targets, held-out readings."""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Polygon
from numpy.typing import ArrayLike

from ....fmus.units import STANDARD_GRAVITY
from ...document.theme import (
    ALERT,
    AXES,
    BAND,
    DASHES,
    FIRST,
    INK,
    MUTED,
    QUIET,
    SECOND,
    WIDTH,
    column,
    drawing,
    plain,
    say_empty,
    short,
    svg_text,
    three_columns,
)
from ...records import RawRecord
from ...records.rests import Rest, without_turns


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


def residuals_over_inputs(
    inputs: ArrayLike, before: ArrayLike, after: ArrayLike | None = None, witness: ArrayLike | None = None
) -> str:
    """Residuals of each accelerometer against its own input.

    Parameters
    ----------
    inputs : array, shape (N, 3)
        [g]
    before, after, witness
        as for `trihedron.tools.reports.pictures.residuals.residuals`

    Returns
    -------
    str
        SVG
    """
    n, first = three_columns(inputs), three_columns(before)
    second = None if after is None else three_columns(after)
    proof = np.zeros(first.shape, dtype=bool)
    if witness is not None:
        proof |= np.asarray(witness, dtype=bool).reshape(-1, 3)
    looks: dict[str, dict[str, Any]] = {
        "before" if second is not None else "residual": {
            "marker": "o",
            "markerfacecolor": "none",
            "color": SECOND.light,
            "markersize": 4.0,
        },
        "with the effect": {"marker": "o", "color": FIRST.light, "markersize": 3.2, "markeredgewidth": 0},
        "proves that no fit exists": {
            "marker": "D",
            "markerfacecolor": "none",
            "color": ALERT.light,
            "markersize": 7.6,
            "markeredgewidth": 1.2,
        },
    }
    series = [first, second, np.where(proof, first, np.nan) if proof.any() else None]
    shown = [(label, look, values) for (label, look), values in zip(looks.items(), series, strict=True)
             if values is not None]  # fmt: skip
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
        panels = figure.subplots(1, 3, sharey=True)
        for p, axes in enumerate(panels):
            axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0)
            axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
            for _, look, values in shown:
                axes.plot(n[:, p], values[:, p], linestyle="none", **look)
            axes.set_title(f"accelerometer {p + 1}")
            axes.set_xlabel("its input [g]")
            axes.set_xlim(-1.12, 1.12)
            if not np.isfinite(first[:, p] + n[:, p]).any():
                say_empty(axes)
        panels[0].set_ylabel("residual [σ]")
        handles = [
            Patch(facecolor=BAND.light, label="within ±σ"),
            *(Line2D([], [], linestyle="none", label=label, **look) for label, look, _ in shown),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=4, handletextpad=0.5)
        return svg_text(figure, "Residuals of each accelerometer against its own input")


def next_directions(
    alpha: ArrayLike, beta: ArrayLike, next_alpha: ArrayLike, next_beta: ArrayLike, labels: Sequence[str] = ()
) -> str:
    """Directions of the vertical in the inner frame: measured, and proposed; areas on the sphere are as on paper.

    Parameters
    ----------
    alpha, beta : array, shape (N,)
        measured angles [rad]
    next_alpha, next_beta : array, shape (K,)
        proposed ones [rad]
    labels : sequence of str
        beside the proposed ones

    Returns
    -------
    str
        SVG
    """
    with drawing():
        figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
        axes = figure.subplots()
        looks: list[dict[str, Any]] = [
            {"marker": "o", "color": QUIET.light, "markersize": 4.4, "markeredgewidth": 0, "label": "measured"},
            {"marker": "D", "color": ALERT.light, "markersize": 5.5, "markeredgewidth": 0, "label": "measure next"},
        ]
        if not len(labels):
            looks[0]["color"] = FIRST.light
        shown = []
        for look, a, b in ((looks[0], alpha, beta), (looks[1], next_alpha, next_beta)):
            a, b = column(a), column(b)
            if not a.size:
                continue
            shown.append(look)
            around = np.degrees(np.arctan2(np.sin(a) * np.cos(b), np.sin(a) * np.sin(b)))
            axes.plot(around, np.cos(a), linestyle="none", **look)
            if look is looks[1]:
                for x, y, text in zip(around, np.cos(a), labels, strict=False):
                    axes.annotate(text, (x, y), (5, 4), textcoords="offset points", fontsize=7.5)
        axes.set_xlim(-185.0, 185.0)
        axes.set_ylim(-1.12, 1.12)
        axes.set_xticks(range(-180, 181, 90))
        axes.set_xlabel("direction about the third axis of the inner frame, from the first [deg]")
        axes.set_ylabel("along the third axis")
        handles = [Line2D([], [], linestyle="none", **look) for look in shown]
        figure.legend(handles=handles, loc="outside upper left", ncols=2, handletextpad=0.4)
        return svg_text(figure, "Directions of the vertical in the inner frame: measured positions and proposed ones")


MOST_LABELS = 32
"""So many labels stand beside each other; of more, every second, third, ... is shown."""

ROUNDING = 1e-6
"""How far beyond 1 a radius still counts as 1: the digits of a linear programme."""


def held_out(before: ArrayLike, after: ArrayLike, labels: Sequence[object]) -> str:
    """Errors of prediction at positions that were not used, before and after the model was extended.

    Parameters
    ----------
    before, after : array, shape (N,) or (N, 3)
        errors in units of σ, for one or for each of the three accelerometers
    labels : sequence, length N
        names of the positions

    Returns
    -------
    str
        SVG
    """
    names = [short(label, 24) for label in labels]
    first, second = (_by_position(values, len(names)) for values in (before, after))
    spread = np.linspace(-0.24, 0.24, first.shape[1]) if first.shape[1] > 1 else np.zeros(1)
    with drawing():
        figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
        axes = figure.subplots()
        axes.axhspan(-1.0, 1.0, color=BAND.light, linewidth=0, zorder=0)
        axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
        place = np.arange(len(names))[:, None] + spread
        axes.vlines(place.ravel(), first.ravel(), second.ravel(), color=MUTED.light, linewidth=0.7)
        hollow: dict[str, Any] = {"linestyle": "none", "marker": "o", "markerfacecolor": "none", "color": SECOND.light}
        filled: dict[str, Any] = {"linestyle": "none", "marker": "o", "color": FIRST.light, "markeredgewidth": 0}
        axes.plot(place.ravel(), first.ravel(), markersize=4.4, **hollow)
        axes.plot(place.ravel(), second.ravel(), markersize=3.6, **filled)
        every = -(-len(names) // MOST_LABELS) if names else 1
        long = max((len(name) for name in names), default=0) * min(len(names), MOST_LABELS) > 90
        turn: dict[str, Any] = {"rotation": 45, "ha": "right", "rotation_mode": "anchor"} if long else {}
        axes.set_xticks(np.arange(len(names))[::every], names[::every], **turn)
        axes.tick_params(axis="x", length=0)
        axes.grid(visible=False, axis="x")
        axes.set_xlim(-0.6, max(len(names), 1) - 0.4)
        size = np.abs(np.concatenate([first, second]))
        reach = 1.12 * max(1.25, float(np.nanmax(size)) if np.isfinite(size).any() else 0.0)
        axes.set_ylim(-reach, reach)
        beside = "" if first.shape[1] == 1 else "; accelerometers 1, 2, 3 side by side"
        axes.set_xlabel(f"position that was held out{beside}")
        axes.set_ylabel("error of prediction [σ]")
        handles = [
            Patch(facecolor=BAND.light, label="within ±σ"),
            Line2D([], [], label="before", markersize=4.4, **hollow),
            Line2D([], [], label="with the effect", markersize=3.6, **filled),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handletextpad=0.5)
        if not np.isfinite(size).any():
            say_empty(axes)
        return svg_text(figure, "Errors of prediction at held-out positions, before and after the model was extended")


def _by_position(values: ArrayLike, count: int) -> np.ndarray:
    array = np.asarray(values, dtype=np.float64)
    return column(array).reshape(count, -1) if count and array.size else np.full((count, 1), np.nan)


LEAVES = "largest residual that the best fit leaves [σ]"


def candidates(names: Sequence[str], radius: ArrayLike, label: str = LEAVES) -> str:
    """What each candidate effect leaves of the misfit: the smallest radius of the extended model.

    Parameters
    ----------
    names : sequence of str, length N
        the effects with their places; "none", say, for the model as it is
    radius : array, shape (N,)
        least max |residual| in units of its bound; the data are explained up to 1
    label : str
        of the axis

    Returns
    -------
    str
        SVG; the best stands first
    """
    left = column(radius)
    order = np.argsort(left, kind="stable")
    left = left[order]
    labels = [short(names[k]) for k in order]
    with drawing():
        figure = Figure(figsize=(WIDTH, 1.05 + 0.25 * max(len(labels), 2)), layout="constrained")
        axes = figure.subplots()
        y = np.arange(len(labels))
        explained = left <= 1.0 + ROUNDING
        colours = [FIRST.light if good else QUIET.light for good in explained]
        axes.barh(y, np.nan_to_num(left), height=0.62, color=colours, linewidth=0)
        axes.axvline(1.0, color=ALERT.light, linewidth=1.3)
        most = float(np.nanmax(left)) if np.isfinite(left).any() else 1.0
        axes.set_xlim(0.0, 1.1 * max(most, 1.25))
        for k, value in enumerate(left):
            text = f"{value:.2f}" if np.isfinite(value) else "not possible"
            at = 0.0 if not np.isfinite(value) else 1.0 if explained[k] else value
            axes.annotate(text, (at, k), (4, 0), textcoords="offset points", va="center", fontsize=8.5)
        axes.set_yticks(y, labels)
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.set_ylim(max(len(labels), 2) - 0.4, -0.6)
        axes.grid(visible=False, axis="y")
        axes.set_xlabel(label)
        line = Line2D([], [], color=ALERT.light, linewidth=1.3, label="the data are explained up to here")
        figure.legend(handles=[line], loc="outside upper left", handletextpad=0.6)
        if not labels:
            say_empty(axes)
        return svg_text(figure, "Largest residual that each candidate effect leaves, in units of the noise bound")


class Named(Protocol):
    """A target's symbol."""

    @property
    def symbol(self) -> str: ...


class Pair(Protocol):
    """Two targets and what is left possible of them; `trihedron.tools.calibration.estimates.PairSet` is one."""

    @property
    def first(self) -> Named: ...
    @property
    def second(self) -> Named: ...
    @property
    def vertices(self) -> np.ndarray: ...


def joint_set(
    pairs: Sequence[Pair], estimates: Mapping[str, float], noise_bound: float, truth: Mapping[str, float] | None = None
) -> str:
    """Pairwise projections of the set of all parameters that the readings leave possible.

    Parameters
    ----------
    pairs : sequence of Pair
        of one group: every pair once
    estimates : mapping
        symbol -> estimate; the panels are about these
    noise_bound : float
        σ, the unit of the axes
    truth : mapping
        symbol -> true value, as far as it is known

    Returns
    -------
    str
        SVG; rows and columns are the targets
    """
    across = list(dict.fromkeys(pair.first.symbol for pair in pairs))
    down = list(dict.fromkeys(pair.second.symbol for pair in pairs))
    with drawing():
        side = min(1.5, (WIDTH - 0.6) / max(len(across), 3))
        figure = Figure(figsize=(max(WIDTH, 0.6 + side * len(across)), 0.9 + side * len(down)), layout="constrained")
        panels = figure.subplots(len(down), len(across), squeeze=False, sharex="col", sharey="row")
        for axes in panels.flat:
            axes.set_visible(False)
        for pair in pairs:
            row, column = down.index(pair.second.symbol), across.index(pair.first.symbol)
            axes = panels[row, column]
            axes.set_visible(True)
            about = np.array([estimates.get(pair.first.symbol, 0.0), estimates.get(pair.second.symbol, 0.0)])
            corners = (pair.vertices - about) / noise_bound
            low, high = corners.min(axis=0), corners.max(axis=0)
            least, most = np.minimum(low, 0.0), np.maximum(high, 0.0)
            axes.add_patch(Polygon([low, [high[0], low[1]], high, [low[0], high[1]]], color=BAND.light, linewidth=0))
            axes.add_patch(Polygon(corners, closed=True, facecolor=FIRST.light, alpha=0.35, linewidth=0))
            axes.add_patch(Polygon(corners, closed=True, fill=False, edgecolor=FIRST.light, linewidth=1.0))
            axes.plot(0.0, 0.0, "o", color=INK.light, markersize=2.6)
            if truth is not None and pair.first.symbol in truth and pair.second.symbol in truth:
                true = (np.array([truth[pair.first.symbol], truth[pair.second.symbol]]) - about) / noise_bound
                axes.plot(*true, "+", color=MUTED.light, markersize=6)
            margin = 0.08 * np.maximum(most - least, 1e-6)
            axes.dataLim.update_from_data_xy(np.array([least - margin, most + margin]))
            axes.autoscale_view()
            axes.tick_params(labelsize=7)
            axes.locator_params(nbins=4)
            if row == len(down) - 1:
                axes.set_xlabel(f"{plain(pair.first.symbol).replace('-', '−')} [σ]")
            if column == 0:
                axes.set_ylabel(f"{plain(pair.second.symbol).replace('-', '−')} [σ]")
        handles: list[Line2D | Patch] = [
            Patch(facecolor=FIRST.light, alpha=0.35, label="possible together"),
            Patch(facecolor=BAND.light, label="each by itself"),
            Line2D([], [], color=INK.light, marker="o", markersize=2.6, linestyle="none", label="estimates"),
        ]
        figure.legend(handles=handles, loc="outside upper left", ncols=3, handletextpad=0.6)
        return svg_text(figure, "Pairs of targets: what the readings leave possible, in units of the noise bound")


IN_ONE_PICTURE = 6
MOST_POINTS = 400
"""More rows than that are thinned out: a line has no more places in print."""


def refused_rests(raw: RawRecord, rests: Sequence[Rest]) -> list[str]:
    """Each refused rest with what was read during it, a few to a picture.

    Parameters
    ----------
    raw : RawRecord
    rests : sequence of Rest
        all of the record; those that are not refused are left out

    Returns
    -------
    list of str
        SVG each; angles and readings are shown less their medians over the rest
    """
    refused = [rest for rest in rests if rest.refused is not None]
    parts = [refused[k : k + IN_ONE_PICTURE] for k in range(0, len(refused), IN_ONE_PICTURE)]
    return [_picture(raw, part) for part in parts]


def _picture(raw: RawRecord, rests: Sequence[Rest]) -> str:
    with drawing():
        figure = Figure(figsize=(WIDTH, 0.7 + 1.75 * len(rests)), layout="constrained")
        panels = figure.subplots(len(rests), 2, squeeze=False)
        for (left, right), rest in zip(panels, rests, strict=True):
            rows = slice(rest.first, rest.last + 1, max(1, (rest.last + 1 - rest.first) // MOST_POINTS))
            since = raw.time_s[rows] - raw.time_s[rest.first]
            angles = [np.degrees(without_turns(angle[rest.first : rest.last + 1])) for angle in (raw.alpha, raw.beta)]
            for k, angle in enumerate(angles):
                shown = 3600.0 * (angle - np.median(angle))[:: rows.step]
                left.plot(since, shown, color=AXES[k].light, linestyle=DASHES[k])
            force = raw.specific_force[rows] / STANDARD_GRAVITY
            for k in range(3):
                shown = 1e6 * (force[:, k] - np.median(force[:, k]))
                right.plot(since, shown, color=AXES[k].light, linestyle=DASHES[k])
            kept = raw.specific_force[rest.kept_first : rest.kept_last + 1] / STANDARD_GRAVITY
            shown = 1e6 * (kept - np.median(force, axis=0))
            low, high = float(shown.min()), float(shown.max())
            if high > low:
                # what was dropped as unsettled would hide what is left
                right.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))
            for axes in (left, right):
                axes.axvspan(0.0, float(raw.time_s[rest.kept_first] - raw.time_s[rest.first]), color=BAND.light, lw=0)
            what = plain(f"rows {raw.row[rest.first]} to {raw.row[rest.last]}: {rest.refused}")
            left.set_title("\n".join(textwrap.wrap(what, 100)), fontsize=8)
            left.set_ylabel("angle [arcsec]")
            right.set_ylabel("reading [µg]")
        for axes in panels[-1]:
            axes.set_xlabel("time in the rest [s]")
        names = ("α, accelerometer 1", "β, accelerometer 2", "accelerometer 3")
        handles = [
            Line2D([], [], color=colour.light, linestyle=dash, label=name)
            for colour, dash, name in zip(AXES, DASHES, names, strict=True)
        ]
        figure.legend(
            handles=[*handles, Patch(facecolor=BAND.light, label="not settled")], loc="outside upper left", ncols=4
        )
        return svg_text(figure, "Angles and readings, less their medians, during rests that were refused")
