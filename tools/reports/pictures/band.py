"""The picture of a function that is in no catalogue: what the record leaves possible, the laws in it, the readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import AFTER, AXES, BAND, DASHES, INK, MUTED, QUIET, Drawn, drawn, legend, one_turn, sheet

MOST_LINES = 3
"""So many laws are drawn."""


@dataclass(frozen=True, eq=False)
class BandDrawn:
    """What the picture shows; functions in units of one `unit` at `at`, in the quantity's own unit.

    `at` (k,), `low`, `high` (k,) of all functions; `readings` are values (n,) of the quantity and what readings say of
    the function there (n,); `lines` are names with a function (K,) at `knots` (K,); `steps`: functions jump.
    """

    at: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]
    knots: NDArray[np.float64]
    readings: tuple[NDArray[np.float64], NDArray[np.float64]]
    lines: Sequence[tuple[str, NDArray[np.float64]]]
    quantity: str
    error: str
    steps: bool = False
    circle: bool = False


@drawn
def band_picture(shown: BandDrawn) -> Drawn:
    """The band with the laws in it and the readings; SVG."""
    figure, ((axes,),) = sheet(3.6)
    axes.fill_between(shown.at, shown.low, shown.high, color=BAND.light, linewidth=0, label="possible")
    for end in (shown.low, shown.high):
        axes.plot(shown.at, end, color=QUIET.light, linewidth=0.8)
    axes.axhline(0.0, color=MUTED.light, linewidth=0.6)
    axes.plot(*shown.readings, **{**AFTER, "color": INK.light}, label="readings")
    for (name, values), colour, dash in zip(shown.lines[:MOST_LINES], AXES, DASHES, strict=False):
        axes.plot(shown.knots, values, color=colour.light, linestyle=dash, label=name)
    axes.set(xlabel=shown.quantity, ylabel=shown.error)
    if shown.circle:
        one_turn(axes, shown.at)
    # A reading that tells little may lie far off: the band and the laws fill the picture.
    ends = np.concatenate([shown.low, shown.high, *(values for _, values in shown.lines[:MOST_LINES])])
    reach = 0.35 * float(np.ptp(ends))
    axes.set_ylim(float(ends.min()) - reach, float(ends.max()) + reach)
    legend(figure, 3)
    return figure, f"Functions of {shown.quantity} that the record leaves possible, with laws among them"
