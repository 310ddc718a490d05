"""A wrong row beside an effect: sought together, because neither alone makes the model fit."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.sets import Work
from ..errors import InputError
from ..evidence.bench import Bench
from ..evidence.bench_visits import is_linear, signature_columns
from ..evidence.evidence import Evidence
from ..evidence.fit import contains
from ..rounding import Stated
from .change import Change, Mending
from .removal import Removal, TooMany
from .simple import Simple
from .table import SECOND_ORDER, Table

FEWEST_ROWS = 24
"""Records of fewer rows do not tell a row from an effect."""
MOST_PAIRS = 8
"""Where more pairs stand the record does not tell which it is."""


def rows_beside_effects(evidence: Evidence) -> tuple[Simple, ...]:
    """Return pairs of a wrong row and an effect that make the model fit; empty if there are too many."""
    table = Table.of(evidence)
    if table is None or len(table) < FEWEST_ROWS or not isinstance(evidence.model, Bench):
        return ()
    pairs = []
    contexts = evidence.model.readings.rows(table.linear.point)
    for place in evidence.model.classes.places:
        if not is_linear(place):
            continue
        columns = signature_columns([place], contexts)
        pairs += [(place, columns, row) for row in _rows_beside(table, columns)]
        if len(pairs) > MOST_PAIRS:
            return ()
    faults = [_fault(evidence, table, *pair) for pair in pairs]
    standing = [fault for fault in faults if fault is not None]
    return tuple(fault for fault in standing if not _is_wider(fault, standing))


def _is_wider(fault: Simple, faults: Sequence[Simple]) -> bool:
    """Return whether another fault of the same row has an effect that this one's contains: it is no rival."""
    of_row = [rival for rival in faults if rival.rows == fault.rows]
    return any(contains(_places(fault), _places(rival)) for rival in of_row)


def _places(fault: Simple) -> Sequence[EffectPlace]:
    """Return the effects of a fault."""
    return () if fault.fit is None else fault.fit.places


def _rows_beside(table: Table, columns: NDArray) -> list[int]:
    """Return the rows (from 0) whose removal makes the model fit, next to an effect of these columns (3 N, K)."""
    matrix = np.hstack((table.matrix, columns / table.linear.bound[:, None]))
    removal = Removal(matrix, table.target, table.belongs, table.excess, table.limit + SECOND_ORDER)
    try:
        standing = removal.of_size(1)
    except TooMany:
        return []
    return [row for rows in standing for row in rows]


def _fault(evidence: Evidence, table: Table, place: EffectPlace, columns: NDArray, row: int) -> Simple | None:
    """Return the pair if the exact model fits; None if it does not, or if one reading alone is wrong."""
    assert evidence.source is not None
    record = evidence.source.record
    kept = np.delete(np.arange(len(record)), row)
    try:
        remaining = evidence.source.again(record.selected(kept), noise_bound=evidence.model.calibration.noise_bound)
    except InputError:
        return None
    fits = remaining.model.mended([place], Work()) if remaining.model.falsified else ()
    if not fits:
        return None
    fit = fits[0].centred(remaining.model.room)
    change = _change(table, columns @ fit.stated, row)
    if change.reading is not None:
        # The catalogue's own search names a reading that is off beside an effect.
        return None
    values, intervals = fit.values()[0], fit.intervals(remaining.model.room)[0]
    stated = {}
    for parameter, value, (low, high) in zip(place.definition.parameters, values, intervals, strict=True):
        stated[parameter.name] = Stated(value, low, high)
    effect = place.definition.sentence(place, stated)
    return Simple(
        kind="rows",
        numbers=change.numbers + _numbers(place) + 1,
        where=(f"row-{row + 1}", place.where),
        sentence=f"Row {row + 1} is wrong. {change.words} Beside that {effect}.",
        radius=fit.radius,
        evidence=remaining,
        rows=(row + 1,),
        change=change.keys,
        fit=fit,
    )


def _change(table: Table, added: NDArray, row: int) -> Change:
    """Return the change that makes the row fit, after removal of the effect's part of the readings (3 N,)."""
    linear, wrong = table.linear, np.array([row])
    copied = next(Mending(table, row, wrong).copied(), None)
    if copied is not None and "readings_of_row" in copied.keys:
        return copied
    taken_out = replace(linear, reading=linear.reading - added.reshape(-1, 3), residual=linear.residual - added)
    return Mending(replace(table, linear=taken_out).about(wrong), row, wrong).best


def _numbers(place: EffectPlace) -> int:
    """Numbers of an effect."""
    return len(place.definition.parameters) + (place.order is not None)
