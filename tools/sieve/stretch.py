"""A stretch of rows that does not belong to the rest: the shortest one without which the model fits."""

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..evidence.evidence import Evidence
from .exchange import Exchange, WrongRows
from .removal import Parts, Removal, TooMany
from .rows import MOST_ROWS
from .simple import Simple
from .table import TableRows

PART = 5
"""A stretch that nothing mends is claimed up to this part of the rows."""
MENDED_PART = 3
"""A stretch that one change mends, up to this part."""
MENDED = 4
"""Numbers of a stretch that one change mends: its beginning and end, the kind of the change, and its value."""


def wrong_stretches(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the shortest stretch without which the model fits, longer than single wrong rows."""
    table = TableRows.of(evidence)
    if table is None:
        return ()
    window = shortest_stretch(table.removal(), len(table), MOST_ROWS + 1, len(table) // MENDED_PART)
    if window is None:
        return ()
    about = table.about(window)
    if not about.keeps_rank(window) or about.radius_without(window) > table.limit:
        return ()
    mended = next(WrongRows(about, window, window).exchanges(), None)
    if mended is None and len(window) > len(table) // PART:
        return ()
    return _fault(evidence, window, mended)


def shortest_stretch(removal: Removal, count: int, least: int, most: int) -> NDArray[np.int_] | None:
    """Return the rows (from 0) of the shortest stretch without which the model fits; None if there is none."""
    conflicts: list[Parts] = []
    try:
        for length in range(least, most + 1):
            for first in range(count - length + 1):
                window = frozenset(range(first, first + length))
                if all(conflict & window for conflict in conflicts):
                    conflict = removal.conflict(window)
                    if conflict is None:
                        return np.arange(first, first + length)
                    conflicts.append(conflict)
    except TooMany:
        pass
    return None


def _fault(evidence: Evidence, window: NDArray, mended: Exchange | None) -> tuple[Simple, ...]:
    """Return the stretch as a fault, with its remedy."""
    assert evidence.source is not None
    record, sigma = evidence.source.record, evidence.model.calibration.noise_bound
    kept = np.setdiff1d(np.arange(len(record)), window)
    try:
        remaining = evidence.source.again(record.selected(kept), noise_bound=sigma)
    except InputError:
        return ()
    if remaining.model.falsified:
        return ()
    numbers = tuple(record.numbers[window].tolist())
    first, last = numbers[0], numbers[-1]
    sentence = f"Rows {first} to {last} do not belong to the rest, which fits."
    if mended is not None:
        sentence += f" They fit with {mended.words}."
    fault = Simple(
        kind="stretch",
        numbers=3 * len(window) + 2 if mended is None else MENDED,
        where=(f"rows-{first}-to-{last}",),
        sentence=sentence,
        radius=remaining.model.radius,
        evidence=remaining,
        rows=numbers,
        change={} if mended is None else mended.keys,
    )
    return (fault,)
