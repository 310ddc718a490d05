"""Repeatability: what each record leaves possible of each parameter, the record taken by itself."""

import numpy as np

from ...calibrated import Calibration, ParameterChange
from . import ALERT, FIRST, MUTED, Drawn, drawn, legend, named_rows, sheet

MOST_ROWS = 30
"""So many parameters are drawn."""


def drawable(alone: Calibration) -> list[ParameterChange]:
    """Return the parameters that two records at least bound, those that surely change first."""
    bounded = []
    for change in alone.changes:
        if sum(p.bounded for p in alone.each(change.symbol).values()) > 1:
            bounded.append(change)
    return sorted(bounded, key=lambda change: (change.at_least == 0.0, change.of == "run"))[:MOST_ROWS]


@drawn
def repeatability_picture(alone: Calibration) -> Drawn:
    """A row for each parameter, a bar for each record in their order; each row in its own scale, about its middle."""
    rows = drawable(alone)
    labels = list(alone.of_record)
    figure, ((axes,),) = sheet(0.9 + 0.34 * len(rows))
    for number, change in enumerate(rows):
        ends = {label: p.ends for label, p in alone.each(change.symbol).items() if p.bounded}
        least, most = np.min(list(ends.values())), np.max(list(ends.values()))
        middle, half = 0.5 * (least + most), 0.5 * (most - least) or 1.0
        colour = (ALERT if change.at_least > 0.0 else FIRST).light
        label = "surely changes" if change.at_least > 0.0 else "may be constant"
        for record, (low, high) in ends.items():
            at = number + 0.6 * ((labels.index(record) + 0.5) / len(labels) - 0.5)
            bar = [(low - middle) / half, (high - middle) / half]
            axes.plot(bar, [at, at], color=colour, linewidth=2.4, solid_capstyle="butt", label=label)
    axes.axvline(0.0, color=MUTED.light, linewidth=0.6)
    axes.set_xticks([])
    axes.set_xlim(-1.05, 1.05)
    named_rows(axes, [change.symbol for change in rows], lines=True)
    legend(figure)
    return (
        figure,
        f"What each record leaves possible of {len(rows)} parameters; records from above: {', '.join(labels)}.",
    )
