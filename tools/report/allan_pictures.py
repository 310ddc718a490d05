"""Allan deviation of gyros and accelerometers over the rests of a strapdown record, as a picture."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..motion.rests import Rests
from ..motion.sampling import rates_of
from ..records import StrapdownRecord
from ..records.noise import allan_deviation
from .svg import drawing, power_of_ten, say_empty, svg_text
from .theme import AXES, DASHES, MUTED, WIDTH

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
