"""Intervals drawn in a table's cells: every bar of a column on one scale, about its estimate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .cells import Drawn


@dataclass(frozen=True)
class Bar:
    """An interval about its estimate, in units of σ.

    Attributes
    ----------
    error : float or None
        the guaranteed error: the band reaches from −error to +error
    low, high : float or None
        what is possible, less the estimate
    truth : float or None
        less the estimate, where it is known
    """

    error: float | None
    low: float | None
    high: float | None
    truth: float | None = None


def bars(rows: Sequence[Bar]) -> tuple[list[Drawn | None], float]:
    """The cells, and how far [σ] the scale of all of them reaches to either side.

    Rows without a number are None.
    """
    sizes = [abs(v) for row in rows for v in (row.error, row.low, row.high, row.truth) if v is not None]
    reach = float(np.max(sizes, initial=0.0)) * 1.02
    if not np.isfinite(reach) or reach <= 0.0:
        return [None] * len(rows), 0.0
    return [None if row.error is None and row.low is None else _drawn(row, reach) for row in rows], reach


def _drawn(row: Bar, reach: float) -> Drawn:
    def at(value: float) -> str:
        return f"{100.0 * value / reach:.1f}"

    said = []
    parts = ['<path class="axis" d="M0 -7V7"/>']
    if row.error is not None:
        width = 200.0 * row.error / reach
        parts.append(f'<rect class="band" x="{at(-row.error)}" y="-6" width="{width:.1f}" height="12"/>')
        said.append(f"guaranteed error {row.error:.2g}")
    if row.low is not None and row.high is not None:
        parts.append(f'<path class="possible" d="M{at(row.low)} 0H{at(row.high)}"/>')
        said.append(f"possible from {row.low:.2g} to {row.high:.2g}")
    if row.truth is not None:
        parts.append(f'<path class="truth" d="M{at(row.truth)} -6V6"/>')
        said.append(f"truth {row.truth:.2g}")
    parts.append('<circle class="middle" r="2.6"/>')
    label = ", ".join(said) + " in units of σ about the estimate"
    head = f'<svg class="bar" viewBox="-104 -8 208 16" role="img" aria-label="{label}">'
    return Drawn(head + "".join(parts) + "</svg>")
