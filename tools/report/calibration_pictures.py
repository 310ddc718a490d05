"""Pictures of a calibration: the targets' intervals, and the residuals over the table's angles."""

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike

from trihedron.report.svg import column, drawing, plain, say_empty, short, svg_text, three_columns
from trihedron.report.theme import ALERT, BAND, FIRST, INK, MUTED, SECOND, WIDTH


class TargetRow(Protocol):
    """What a target's row is drawn from; `trihedron.calibration.result.Estimate` is one."""

    @property
    def symbol(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def estimate(self) -> float | None: ...
    @property
    def guaranteed_error(self) -> float | None: ...
    @property
    def low(self) -> float | None: ...
    @property
    def high(self) -> float | None: ...


def in_words(name: str) -> str:
    """A target's name as a person reads it: "scale-factor-error-plus-1" as "scale factor error (+) 1"."""
    signed = plain(name).replace("-plus-", " (+) ").replace("-minus-", " (−) ")
    return signed.replace("-", " ")


def _number(value: float | None) -> float:
    return float("nan") if value is None or not np.isfinite(value) else float(value)


def target_intervals(rows: Sequence[TargetRow], noise_bound: float, truth: Mapping[str, float] | None = None) -> str:
    """Each target's interval, estimate and guaranteed error, in units of σ.

    A row is drawn about its true value where that is known, else about its estimate.

    Parameters
    ----------
    rows : sequence of TargetRow
        as a calibration gives them; None where a value is not there
    noise_bound : float
        σ, as a fraction of g
    truth : mapping
        symbol -> true value, as far as it is known

    Returns
    -------
    str
        SVG
    """
    truth = {} if truth is None else truth
    sigma = noise_bound if np.isfinite(noise_bound) and noise_bound > 0.0 else float("nan")
    true = np.array([_number(truth.get(row.symbol)) for row in rows])
    estimate = np.array([_number(row.estimate) for row in rows])
    centre = np.where(np.isfinite(true), true, estimate)
    middle = (estimate - centre) / sigma
    error = np.array([_number(row.guaranteed_error) for row in rows]) / sigma
    low = (np.array([_number(row.low) for row in rows]) - centre) / sigma
    high = (np.array([_number(row.high) for row in rows]) - centre) / sigma
    with drawing():
        figure = Figure(figsize=(WIDTH, 1.15 + 0.235 * max(len(rows), 3)), layout="constrained")
        axes = figure.subplots()
        y = np.arange(len(rows))
        known = np.isfinite(true)
        axes.axvline(0.0, color=MUTED.light, linewidth=0.8)
        handles: list[Line2D | Patch] = []
        if np.isfinite(middle + error).any():
            axes.barh(y, 2.0 * error, left=middle - error, height=0.62, color=BAND.light, linewidth=0)
            handles.append(Patch(facecolor=BAND.light, label="estimate ± guaranteed error"))
        if np.isfinite(high - low).any():
            axes.hlines(y, low, high, color=FIRST.light, linewidth=2.6)
            handles.append(Line2D([], [], color=FIRST.light, linewidth=2.6, label="what the data leave possible"))
        axes.plot(middle, y, "o", color=INK.light, markersize=3.8)
        handles.append(Line2D([], [], color=INK.light, marker="o", markersize=3.8, linestyle="none", label="estimate"))
        if known.any():
            look = {"color": SECOND.light, "marker": "|", "markersize": 10, "markeredgewidth": 1.8}
            axes.plot(np.zeros(int(known.sum())), y[known], linestyle="none", **look)
            handles.append(Line2D([], [], linestyle="none", label="true value", **look))
        axes.set_yticks(y, [f"{short(in_words(row.name))} · {short(row.symbol, 16).replace('-', '−')}" for row in rows])
        axes.tick_params(axis="y", length=0, labelcolor=INK.light)
        axes.spines["left"].set_visible(False)
        axes.grid(visible=False, axis="y")
        axes.set_ylim(max(len(rows), 3) - 0.4, -0.6)
        ends = np.concatenate([middle - error, middle + error, low, high, middle, [-1.0, 1.0]])
        axes.set_xlim(1.06 * float(np.nanmin(ends)), 1.06 * float(np.nanmax(ends)))
        about = "true value" if known.any() else "estimate"
        if known.any() and not known.all():
            about += ", where it is known, else of the estimate"
        axes.set_xlabel(f"units of σ, about the {about}")
        figure.legend(handles=handles, loc="outside upper left", ncols=4, handletextpad=0.6)
        if not np.isfinite(middle).any():
            say_empty(axes)
        return svg_text(figure, "Interval, estimate and guaranteed error of each target in units of the noise bound")


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
