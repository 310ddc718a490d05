"""Repeatability: what each record leaves possible of each parameter, the record taken by itself."""

from collections.abc import Sequence

import numpy as np

from ...diagnosis.result import Repeated
from . import ALERT, FIRST, MUTED, Drawn, drawn, legend, named_rows, sheet

MOST_ROWS = 30
"""So many parameters are drawn."""


def drawable(parameters: Sequence[Repeated]) -> list[Repeated]:
    """Parameters of which two records at least have ends, those that surely change first."""
    bounded = [
        parameter
        for parameter in parameters
        if sum(r.low is not None and r.high is not None for r in parameter.records) > 1
    ]
    return sorted(bounded, key=lambda parameter: (parameter.at_least == 0.0, parameter.of == "run"))[:MOST_ROWS]


@drawn
def repeatability_picture(parameters: Sequence[Repeated]) -> Drawn:
    """A row for each parameter, a bar for each record in their order; each row in its own scale, about its middle."""
    rows = drawable(parameters)
    figure, ((axes,),) = sheet(0.9 + 0.34 * len(rows))
    for number, parameter in enumerate(rows):
        records = [(k, r) for k, r in enumerate(parameter.records) if r.low is not None and r.high is not None]
        ends = np.array([(r.low, r.high) for _, r in records], dtype=float)
        middle, half = 0.5 * (ends.min() + ends.max()), 0.5 * (ends.max() - ends.min()) or 1.0
        colour = (ALERT if parameter.at_least > 0.0 else FIRST).light
        label = "surely changes" if parameter.at_least > 0.0 else "may be constant"
        for (k, _), (low, high) in zip(records, (ends - middle) / half, strict=True):
            at = number + 0.6 * ((k + 0.5) / len(parameter.records) - 0.5)
            axes.plot([low, high], [at, at], color=colour, linewidth=2.4, solid_capstyle="butt", label=label)
    axes.axvline(0.0, color=MUTED.light, linewidth=0.6)
    axes.set_xticks([])
    axes.set_xlim(-1.05, 1.05)
    named_rows(axes, [parameter.name for parameter in rows], lines=True)
    legend(figure)
    records = ", ".join(r.record for r in rows[0].records) if rows else "none"
    return figure, f"What each record leaves possible of {len(rows)} parameters; records from above: {records}."
