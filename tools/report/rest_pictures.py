"""Pictures of rests that were refused: what the encoders and the accelerometers read, and why it was no rest."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from ...fmus.units import STANDARD_GRAVITY
from ..records import RawRecord
from ..records.rests import Rest, without_turns
from .svg import drawing, plain, svg_text
from .theme import AXES, BAND, DASHES, WIDTH

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
