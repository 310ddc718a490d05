"""Pictures of records: runs, attitude errors, Allan deviations, rests, positions of the table."""

import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ....fmus.units import STANDARD_GRAVITY
from ....models.bench import up
from ...document.blocks import Picture
from ...document.notation import plain
from ...motion.rests import rates_of
from ...planning.forms import clearance, sheets
from ...planning.request import parsed_keep_out
from ...records import RawRecord
from ...records.noise import allan_deviation
from ...records.rests import Rest, without_turns
from ...rounding import digits, exactly
from . import (
    AXES,
    BAND,
    DASHES,
    FIRST,
    INK,
    MUTED,
    QUIET,
    SECOND,
    WIDTH,
    Drawn,
    drawn,
    legend,
    legend_beside,
    one_turn,
    power_of_ten,
    say_empty,
    sheet,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...motion.attitude import AttitudeRun
    from ...motion.inspect import Inspection
    from ...planning.positions import Curve, PositionPlan
    from ...planning.targets import Plan


MOST_POINTS = 2000
"""Largest number of points of a line; longer ones show the least and the largest value of intervals."""


def thinned(time: NDArray, value: NDArray) -> tuple[NDArray, NDArray]:
    """Return a line with fewer points that looks the same: least and largest value of each interval, gaps kept."""
    if len(time) <= MOST_POINTS:
        return time, value
    edges = np.linspace(0, len(time), MOST_POINTS // 2 + 1).astype(np.int64)
    rows: set[int] = {0, len(time) - 1}
    for first, last in pairwise(edges):
        part = value[first:last]
        finite = np.flatnonzero(np.isfinite(part))
        if finite.size:
            rows |= {int(first + finite[np.argmin(part[finite])]), int(first + finite[np.argmax(part[finite])])}
        if finite.size < len(part):
            rows.add(int(first + np.flatnonzero(~np.isfinite(part))[0]))
    index = np.array(sorted(rows))
    return time[index], value[index]


def _three_lines(axes: "Axes", time: NDArray, values: NDArray, label: str) -> None:
    for k in range(3):
        look = {"color": AXES[k].light, "linestyle": DASHES[k], "label": f"{label} {k + 1}"}
        axes.plot(*thinned(time, values[:, k]), **look)
    axes.set_xlabel("time [s]")
    if time[0] < time[-1]:
        axes.set_xlim(float(time[0]), float(time[-1]))
    if not np.isfinite(values).any():
        say_empty(axes)


@drawn
def bench_tour(time: NDArray, angles_deg: Sequence[NDArray], readings_g: NDArray) -> Drawn:
    """Draw the table's programme over time, and the readings of the three accelerometers; SVG, as in all functions
    here.

    Times (N,) [s], angles (N,) of the outer and of the inner axis [deg], readings (N, 3) [g].
    """
    figure, ((angles,), (forces,)) = sheet(4.1, 2, sharex=True, height_ratios=[1.0, 1.15])
    _two_angles(angles, time, angles_deg)
    angles.set_title("table")
    _three_lines(forces, time, readings_g, "accelerometer")
    forces.set(ylabel="reading [g]", title="block")
    legend_beside(forces, 3)
    return figure, "Angles of the two axes of the table and the three readings, over time"


def _two_angles(axes: "Axes", time: NDArray, angles_deg: Sequence[NDArray]) -> None:
    axes.plot(*thinned(time, angles_deg[0]), color=FIRST.light, label="α, outer axis")
    axes.plot(*thinned(time, angles_deg[1]), color=SECOND.light, linestyle=DASHES[1], label="β, inner axis")
    one_turn(axes, np.concatenate(angles_deg), "y", 12.0)
    axes.set_ylabel("angle [deg]")
    legend_beside(axes, 2)


@drawn
def programme_tour(minutes: NDArray, angles_deg: Sequence[NDArray]) -> Drawn:
    """Draw a table's programme: angles (N,) of both axes [deg] over time (N,) [min]."""
    figure, ((axes,),) = sheet(2.6)
    _two_angles(axes, minutes, angles_deg)
    axes.set(xlabel="time [min]", xlim=(float(minutes[0]), float(minutes[-1])))
    return figure, "Angles of the two axes of the table over the programme's time"


@drawn
def attitude_picture(run: "AttitudeRun") -> Drawn:
    """Draw the attitude's error over time, its angle and about each axis [deg]."""
    figure, ((axes,),) = sheet(3.1)
    axes.axhline(0.0, color=INK.light, linewidth=0.7)
    axes.plot(*thinned(run.time_s, np.degrees(run.error_angle)), color=INK.light, linewidth=2.0, label="angle")
    _three_lines(axes, run.time_s, np.degrees(run.error_rad), "about axis")
    axes.set_ylabel("attitude error [deg]")
    legend_beside(axes, 4)
    return figure, "Error of the computed attitude against the true one, over time"


PER_OCTAVE = 4
"""Averaging times in each octave."""
FEWEST_PAIRS = 4
"""Smallest number of pairs of neighbouring averages without overlap; fewer show chance."""


def allan_points(values: NDArray, rows: Sequence[slice], period: float) -> tuple[NDArray, NDArray]:
    """Return averaging times (m,) [s] and Allan deviations (m, 3) of readings (N, 3), all rests together.

    The longest time has four pairs of averages in the rests; there is none if the rests have too few rows.
    """
    pieces = [values[r] for r in rows]
    longest = max((len(piece) for piece in pieces), default=0) // 2
    octaves = np.arange(0.0, np.log2(longest) + 1e-9, 1.0 / PER_OCTAVE) if longest else np.zeros(0)
    sizes = np.unique(np.round(2.0**octaves).astype(int))
    times, deviations = [], []
    for size in sizes:
        pairs = sum(len(piece) // (2 * size) for piece in pieces)
        deviation = allan_deviation(pieces, int(size)) if pairs >= FEWEST_PAIRS else None
        if deviation is not None:
            times.append(size * period)
            deviations.append(deviation)
    return np.array(times), np.array(deviations).reshape(-1, 3)


@drawn
def allan_picture(inspection: "Inspection") -> Drawn:
    """Draw the Allan deviation over the averaging time, gyros above and accelerometers below; mark the rests'
    length."""
    record, rests, period = inspection.record, inspection.rests, inspection.sampling.period
    figure, panels = sheet(5.2, 2, sharex=True)
    sensors = ((rates_of(record), "gyros, rad/s"), (record.specific_force, "accelerometers, m/s²"))
    for axes, (values, title) in zip(panels.flat, sensors, strict=True):
        times, deviation = allan_points(values, rests.rows, period)
        axes.set_title(f"Allan deviation of the {title}")
        visible = deviation > 0.0
        if not visible.any():
            say_empty(axes, "no rests")
            continue
        axes.set(xscale="log", yscale="log")
        for p in range(3):
            some = visible[:, p]
            axes.plot(times[some], deviation[some, p], color=AXES[p].light, linestyle=DASHES[p], label=f"{p + 1}")
        axes.yaxis.set_major_formatter(power_of_ten)
        axes.xaxis.set_major_formatter(lambda value, _: exactly(value))
        axes.minorticks_off()
        dwell = float(np.median([(r.stop - r.start) * period for r in rests.rows]))
        axes.axvline(dwell, color=MUTED.light, linewidth=0.9)
        words = {"ha": "right", "va": "top", "fontsize": 8.0, "transform": axes.get_xaxis_transform()}
        axes.text(dwell, 0.97, f"median rest, {digits(dwell, 2)} s ", **words)
    panels[1, 0].set_xlabel("averaging time, s")
    if panels[0, 0].lines:
        panels[0, 0].legend(loc="lower left", ncols=3, title="axis")
    return figure, "Allan deviation of the gyros and the accelerometers at rest"


IN_ONE_PICTURE = 6
MOST_OF_A_REST = 400
"""Largest number of points; more rows are thinned out to the resolution of print."""


def refused_rests(raw: RawRecord, rests: Sequence[Rest]) -> list[Picture]:
    """Draw each refused rest of a record, a few to a picture: angles and readings, less their medians."""
    refused = [rest for rest in rests if rest.refused is not None]
    return [_refused(raw, refused[k : k + IN_ONE_PICTURE]) for k in range(0, len(refused), IN_ONE_PICTURE)]


@drawn
def _refused(raw: RawRecord, rests: Sequence[Rest]) -> Drawn:
    names = ("α, accelerometer 1", "β, accelerometer 2", "accelerometer 3")
    figure, panels = sheet(0.7 + 1.75 * len(rests), len(rests), 2)
    for (angle_axes, reading_axes), rest in zip(panels, rests, strict=True):
        rest_rows = slice(rest.first, rest.last + 1)
        rows = slice(rest.first, rest.last + 1, max(1, (rest.last + 1 - rest.first) // MOST_OF_A_REST))
        since = raw.time_s[rows] - raw.time_s[rest.first]
        angles = [3600.0 * np.degrees(without_turns(angle[rest_rows])) for angle in (raw.alpha, raw.beta)]
        force = 1e6 * raw.specific_force[rows] / STANDARD_GRAVITY
        middle = np.median(force, axis=0)
        for k, angle in enumerate(angles):
            values = (angle - np.median(angle))[:: rows.step]
            angle_axes.plot(since, values, color=AXES[k].light, linestyle=DASHES[k], label=names[k])
        for k in range(3):
            values = force[:, k] - middle[k]
            reading_axes.plot(since, values, color=AXES[k].light, linestyle=DASHES[k], label=names[k])
        settled = 1e6 * raw.specific_force[rest.kept_first : rest.kept_last + 1] / STANDARD_GRAVITY - middle
        low, high = float(settled.min()), float(settled.max())
        if high > low:
            # the unsettled part that was dropped would hide the rest
            reading_axes.set_ylim(low - 0.25 * (high - low), high + 0.25 * (high - low))
        unsettled = float(raw.time_s[rest.kept_first] - raw.time_s[rest.first])
        for axes, name in ((angle_axes, "angle [arcsec]"), (reading_axes, "reading [µg]")):
            axes.axvspan(0.0, unsettled, color=BAND.light, lw=0, label="not settled")
            axes.set_ylabel(name)
        what = plain(f"rows {raw.row[rest.first]} to {raw.row[rest.last]}: {rest.refused}")
        angle_axes.set_title("\n".join(textwrap.wrap(what, 100)), fontsize=8)
    for axes in panels[-1]:
        axes.set_xlabel("time in the rest [s]")
    legend(figure)
    return figure, "Angles and readings, less their medians, during rests that were refused"


STEP_DEG = 2.0
"""Step of the grid of certain signs [deg]."""


@drawn
def plan_picture(plan: "Plan") -> Drawn:
    """Draw the paper's figure for any target and mounting: certain signs, and the plan's readings with weights."""
    best = plan.optimum
    which, alpha, beta, weights = best.accelerometer + 1, best.alpha_deg, best.beta_deg, best.weights
    grid = np.radians(np.arange(0.0, 360.0 + STEP_DEG / 2, STEP_DEG))
    fields: dict[int, NDArray] = {}
    for region in sheets(plan.parametrisation, bounds=plan.bounds, rule=plan.admissible):
        inside = clearance(region, grid[:, None], grid[None, :])
        # Either sign of the input counts if it is certain.
        fields[region.accelerometer + 1] = np.maximum(fields.get(region.accelerometer + 1, -np.inf), inside)
    accelerometers = [number for number in sorted(fields) if (which == number).any()]
    count = len(accelerometers)
    height = 7.4 if count == 1 else 0.9 + WIDTH / count
    figure, (panels,) = sheet(height, 1, count, sharey=True)
    largest = max(float(np.abs(weights).max(initial=0.0)), 1e-300)
    for axes, number in zip(panels, accelerometers, strict=True):
        field = fields[number]
        angle = np.linspace(0.0, 360.0, len(field))
        axes.contourf(angle, angle, field.T, levels=[0.0, np.inf], colors=[BAND.light])
        axes.fill([], [], color=BAND.light, linewidth=0, label="sign of the input certain")
        of_panel = which == number
        for sense, look, label in (
            (1.0, {"color": FIRST.light, "marker": "o"}, "positive weight"),
            (-1.0, {"color": SECOND.light, "marker": "s"}, "negative weight"),
        ):
            part = of_panel & (np.sign(weights) == sense)
            size = 18.0 + 90.0 * np.abs(weights[part]) / largest
            axes.scatter(alpha[part], beta[part], s=size, linewidth=0, zorder=3, **look)
            axes.plot([], [], linestyle="none", label=label, **look)
        for a, b, w in zip(alpha[of_panel], beta[of_panel], weights[of_panel], strict=True) if count == 1 else ():
            side, text = -1 if a > 300 else 1, digits(w, 5).replace("-", "−")
            words = {"ha": "left" if side > 0 else "right", "fontsize": 8, "color": INK.light}
            axes.annotate(text, (a, b), (8 * side, 6), textcoords="offset points", **words)
        axes.set(title=f"accelerometer {number}", xlabel="α, outer axis [deg]", aspect="equal")
        for of in "xy":
            one_turn(axes, np.zeros(0), of, 6.0)
    panels[0].set_ylabel("β, inner axis [deg]")
    legend(figure, 3)
    return figure, f"Admissible positions and optimal plan for {plain(plan.target)}"


@drawn
def positions_picture(plan: "PositionPlan") -> Drawn:
    """Draw the positions in the plane of the two angles, and their directions of the vertical in the inner frame."""
    alpha = np.array([position.alpha_deg for position in plan.positions])
    beta = np.array([position.beta_deg for position in plan.positions])
    programme = [at - 1 for at in plan.programme]
    number = {row: place for place, row in enumerate(dict.fromkeys(programme), start=1)}
    from matplotlib.patches import Circle

    figure, _ = sheet(4.9, 0, 0)
    grid = figure.add_gridspec(2, 2, width_ratios=(2.0, 1.0))
    plane = figure.add_subplot(grid[:, 0])
    plane.plot(alpha[programme], beta[programme], color=QUIET.light, linewidth=0.8, zorder=1)
    plane.scatter(alpha, beta, s=22, color=FIRST.light, linewidth=0, zorder=3)
    for row, place in number.items():
        words = {"fontsize": 8, "color": INK.light}
        plane.annotate(str(place), (alpha[row], beta[row]), (4, 4), textcoords="offset points", **words)
    limits = plane.get_xlim(), plane.get_ylim()
    for axis, low, high in map(parsed_keep_out, plan.keep_out):
        span = (plane.axvspan, plane.axhspan)[axis]
        for turn in (-360.0, 0.0, 360.0):
            first, last = np.degrees([low, high]) + turn
            span(first, last, color=QUIET.light, alpha=0.35, linewidth=0, zorder=0)
    plane.set(xlim=limits[0], ylim=limits[1])
    plane.set(xlabel="α, outer axis [deg]", ylabel="β, inner axis [deg]", title="positions in their order")
    s = up(np.radians(alpha), np.radians(beta))
    for row, (sense, title) in enumerate(((1.0, "vertical, axis 3 up"), (-1.0, "vertical, axis 3 down"))):
        disc = figure.add_subplot(grid[row, 1])
        disc.add_patch(Circle((0.0, 0.0), 1.0, fill=False, edgecolor=MUTED.light, linewidth=0.7))
        half = sense * s[:, 2] >= 0.0
        disc.scatter(s[half, 0], s[half, 1], s=18, color=SECOND.light, linewidth=0, zorder=3)
        disc.set(xlim=(-1.08, 1.08), ylim=(-1.08, 1.08), aspect="equal", xticks=(-1, 0, 1), yticks=(-1, 0, 1))
        disc.set_title(title)
    return figure, f"The {len(alpha)} positions of a plan in their order"


@drawn
def curve_picture(curve: "Curve") -> Drawn:
    """Draw the cost above the optimum against the number of positions, with the proven bound."""
    figure, ((axes,),) = sheet(3.6)
    count = [point.positions for point in curve.points]
    for ratio, label, colour, marker in (
        ("worst", "worst target", FIRST, "o"),
        ("mean", "mean of the targets", SECOND, "s"),
        ("bound", "proven on the pool", MUTED, "_"),
    ):
        above = np.array([100.0 * (getattr(point, ratio) - 1.0) for point in curve.points])
        drawable = np.where(above > 0.0, above, np.nan)
        axes.semilogy(count, drawable, color=colour.light, marker=marker, markersize=4, label=label)
    axes.set(xlabel="positions", ylabel="cost above the optimum [%]")
    axes.legend()
    return figure, "Cost above the optimum against the number of positions"


LOOKS = [(colour, dash) for dash in DASHES[:2] for colour in AXES]
MOST_LINES = len(LOOKS)
"""Largest number of lines in a panel that can be told apart, by colour and by dashes."""
LETTERS, MARK = 88, 9
"""Number of letters that fit in a line above a panel, and the width of a marker in letters."""
TRUTH = "Flags"
"""Text in place of a unit for flags."""
LARGEST_DRAWN = 1e300
"""Largest value with ticks on an axis: beyond it a line has a gap, with its ends written beside it."""


@dataclass(frozen=True)
class DrawnLine:
    """A line with the points that are drawn; `ends` are its first, least, largest and last value."""

    name: str
    time: NDArray
    value: NDArray
    ends: tuple[float, float, float, float]

    @classmethod
    def of(cls, name: str, time: NDArray, value: NDArray) -> "DrawnLine":
        """Return the line of values (N,) at times (N,) [s]; it has a gap at an unknown value."""
        finite = value[np.isfinite(value)]
        least, largest = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
        drawable = np.where(np.abs(value) < LARGEST_DRAWN, value, np.nan)
        times, values = thinned(time, drawable)
        return cls(name, times, values, (float(value[0]), least, largest, float(value[-1])))

    @property
    def constant(self) -> bool:
        """Whether the line has one value throughout, or none."""
        return np.isnan(self.ends[1]) or len(set(self.ends)) == 1


@drawn
def lines_picture(panels: Sequence[Sequence[DrawnLine]], unit: str) -> Drawn:
    """Draw a panel for each group of lines, one above the other, all over the same time; SVG."""
    columns_of, names, rows_of_names = [], [], 0
    for lines in panels:
        of_panel = [line.name for line in lines]
        columns = max(1, min(len(lines), LETTERS // (MARK + len(max(of_panel, key=len)))))
        columns_of.append(columns)
        names += of_panel
        rows_of_names += -(-len(lines) // columns)
    figure, axes = sheet(0.5 + 1.5 * len(panels) + 0.19 * rows_of_names, len(panels), sharex=True)
    for axis, lines, columns in zip(axes.flat, panels, columns_of, strict=True):
        for line, (colour, dash) in zip(lines, LOOKS, strict=False):
            axis.plot(line.time, line.value, color=colour.light, linestyle=dash, label=line.name)
        axis.set_ylabel(unit if unit != TRUTH else "")
        # Left of the axis the power of ten does not cover the legend.
        axis.yaxis.get_offset_text().set_horizontalalignment("right")
        if unit == TRUTH:
            axis.set(ylim=(-0.1, 1.1), yticks=(0, 1), yticklabels=("false", "true"))
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderpad=0.0, borderaxespad=0.35)
        if all(not np.isfinite(line.value).any() for line in lines):
            say_empty(axis)
    first = panels[0][0].time
    if first[0] < first[-1]:
        axes.flat[-1].set_xlim(float(first[0]), float(first[-1]))
    axes.flat[-1].set_xlabel("time [s]")
    return figure, f"{', '.join(names)} over time, {f'in {unit}' if unit else 'without unit'}"
