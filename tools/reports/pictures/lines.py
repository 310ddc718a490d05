"""Pictures of lines over time, in panels."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from . import AXES, DASHES, Drawn, drawn, say_empty, sheet
from .records import thinned

LOOKS = [(colour, dash) for dash in DASHES[:2] for colour in AXES]
MOST_LINES = len(LOOKS)
"""So many lines of a panel can be told apart, by colour and by dashes."""
LETTERS, MARK = 88, 9
"""So many letters of names stand beside each other above a panel; the mark before each takes the room of so many."""
TRUTH = "True or false"
"""What stands in place of a unit."""
LARGEST_DRAWN = 1e300
"""Beyond it there are no ticks of an axis that are numbers: a line has a gap there, its ends stand beside it."""


@dataclass(frozen=True)
class Line:
    """A line with the points that are drawn; `ends` are its first, least, largest and last value."""

    name: str
    time: np.ndarray
    value: np.ndarray
    ends: tuple[float, float, float, float]

    @classmethod
    def of(cls, name: str, time: np.ndarray, value: np.ndarray) -> "Line":
        """Of values (N,) at times (N,) [s]; where one is not known the line has a gap."""
        finite = value[np.isfinite(value)]
        least, largest = (float(finite.min()), float(finite.max())) if finite.size else (np.nan, np.nan)
        drawable = np.where(np.abs(value) < LARGEST_DRAWN, value, np.nan)
        return cls(name, *thinned(time, drawable), (float(value[0]), least, largest, float(value[-1])))


@drawn
def lines_picture(panels: Sequence[Sequence[Line]], unit: str) -> Drawn:
    """A panel for each group of lines, one above the other, all over the same time; SVG."""
    columns_of = [max(1, min(3, LETTERS // (MARK + max(len(line.name) for line in lines)))) for lines in panels]
    rows_of_names = [-(-len(lines) // count) for lines, count in zip(panels, columns_of, strict=True)]
    figure, axes = sheet(0.5 + 1.5 * len(panels) + 0.19 * sum(rows_of_names), len(panels), sharex=True)
    for axis, lines, columns in zip(axes.flat, panels, columns_of, strict=True):
        for line, (colour, dash) in zip(lines, LOOKS, strict=False):
            axis.plot(line.time, line.value, color=colour.light, linestyle=dash, label=line.name)
        axis.set_ylabel(unit if unit != TRUTH else "")
        if unit == TRUTH:
            axis.set(ylim=(-0.1, 1.1), yticks=(0, 1), yticklabels=("false", "true"))
        axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderpad=0.0, borderaxespad=0.35)
        if all(not np.isfinite(line.value).any() for line in lines):
            say_empty(axis)
    first = panels[0][0].time
    if first[0] < first[-1]:
        axes.flat[-1].set_xlim(float(first[0]), float(first[-1]))
    axes.flat[-1].set_xlabel("time [s]")
    names = ", ".join(line.name for lines in panels for line in lines)
    return figure, f"{names} over time, {f'in {unit}' if unit else 'pure numbers'}"
