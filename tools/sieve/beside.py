"""A wrong row beside an effect: sought together, because neither alone makes the model fit."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...models.effects import EffectPlace
from ..bounded.programmes import SolverError
from ..bounded.work import CutOff, Work
from ..calibration.model import predicted_reading
from ..errors import InputError
from ..evidence.bench import Bench
from ..evidence.bench_visits import is_linear, signature_columns, untold_readings
from ..evidence.evidence import Evidence
from ..evidence.fit import Fit, contains
from ..rounding import Stated
from .change import ROW, Mending, RowChange
from .removal import Removal, TooMany
from .simple import Simple
from .table import SECOND_ORDER, TableRows

FEWEST_ROWS = 24
"""Records of fewer rows do not tell a row from an effect."""
MOST_PAIRS = 8
"""Where more pairs stand the record does not tell which it is."""
MOST_TRIED = 3
"""Most rows, those with the largest misfit, that are tried beside effects that are not linear."""
MOST_WORK = 6e6
"""Work of the search for effects that are not linear, after which none is named."""
CLEAR = 10.0
"""A change of a row is sought where the row misfits by this multiple of the effect beside it."""
OUTLIER = "outlier"
BREAKS = ("bias-step", "scale-step", "mounting-slip")
"""Effects that are breaks: the search for a break and a wrong row names them."""
OPEN = RowChange(ROW, "The cause stays open.")


def rows_beside_effects(evidence: Evidence) -> tuple[Simple, ...]:
    """Return pairs of a wrong row and an effect that make the model fit; empty if there are too many."""
    table = TableRows.of(evidence)
    if table is None or len(table) < FEWEST_ROWS or not isinstance(evidence.model, Bench):
        return ()
    faults: list[Simple] = []
    for find in (_beside_linear, _beside_bent):
        for fault in find(evidence, table):
            faults.append(fault)
            if len(faults) > MOST_PAIRS:
                return ()
        if faults:
            break
    return tuple(fault for fault in faults if not _is_wider(fault, faults))


def bent_fits(evidence: Evidence, work: Work, excluded: Sequence[str] = ()) -> list[Fit]:
    """Return the fits of single effects that are not linear and make the model fit, the least radius first.

    `excluded` are names of effects that are not tried.
    """
    fits = []
    try:
        for (place,) in evidence.model.candidates(1, work):
            if not is_linear(place) and place.effect not in (OUTLIER, *excluded):
                fits += evidence.model.mended([place], work)
    except (CutOff, SolverError, ValueError):
        return []
    return sorted(fits, key=lambda fit: fit.radius)


def _is_wider(fault: Simple, faults: Sequence[Simple]) -> bool:
    """Return whether another fault of the same row has an effect that this one's contains: it is not a rival."""
    of_row = [rival for rival in faults if rival.rows == fault.rows]
    return any(contains(_places(fault), _places(rival)) for rival in of_row)


def _places(fault: Simple) -> Sequence[EffectPlace]:
    """Return the effects of a fault."""
    return () if fault.fit is None else fault.fit.places


def _beside_linear(evidence: Evidence, table: TableRows) -> Iterator[Simple]:
    """Yield wrong rows beside linear effects."""
    contexts = evidence.model.readings.rows(table.linear.point)
    for place in evidence.model.classes.places:
        if not is_linear(place):
            continue
        columns = signature_columns([place], contexts)
        for row in _rows_beside(table, columns, ~untold_readings([place], contexts)):
            remaining = _without(evidence, row)
            fits = remaining.model.mended([place], Work()) if remaining is not None else ()
            if remaining is None or not fits:
                continue
            fit = fits[0].centred(remaining.model.room)
            own = (columns @ fit.stated).reshape(-1, 3)[row]
            yield from _faults(remaining, fit, int(table.numbers[row]), _change(table, remaining, fit, row, own))


def _beside_bent(evidence: Evidence, table: TableRows) -> Iterator[Simple]:
    """Yield wrong rows beside effects that are not linear."""
    work = Work(MOST_WORK, "wrong rows beside an effect")
    for row in np.argsort(-table.excess, kind="stable")[:MOST_TRIED].tolist():
        remaining = _without(evidence, row)
        for found in bent_fits(remaining, work, BREAKS) if remaining is not None else ():
            assert remaining is not None
            fit = found.centred(remaining.model.room)
            yield from _faults(remaining, fit, int(table.numbers[row]), _change(table, remaining, fit, row, None))


def _without(evidence: Evidence, row: int) -> Evidence | None:
    """Return the evidence without a row, if the model does not fit it without an effect."""
    assert evidence.source is not None
    record = evidence.source.record
    kept = np.delete(np.arange(len(record)), row)
    try:
        remaining = evidence.source.again(record.selected(kept), noise_bound=evidence.model.calibration.noise_bound)
    except InputError:
        return None
    return remaining if remaining.model.falsified else None


def _rows_beside(table: TableRows, columns: NDArray, told: NDArray) -> list[int]:
    """Return the rows (from 0) whose removal makes the model fit, next to an effect of these columns (3 N, K).

    `told` (3 N,) marks the readings that the record lets the effect determine.
    """
    matrix = np.hstack((table.matrix, columns / table.linear.bound[:, None]))[told]
    removal = Removal(matrix, table.target[told], table.belongs[told], table.excess, table.limit + SECOND_ORDER)
    try:
        standing = removal.of_size(1)
    except TooMany:
        return []
    return [row for rows in standing for row in rows]


def _faults(remaining: Evidence, fit: Fit, number: int, change: RowChange) -> Iterator[Simple]:
    """Yield the pair of a wrong row, by its number, and the effect of a fit; nothing if one reading alone is wrong."""
    if change.reading is not None:
        # The catalogue's own search names a reading that is off beside an effect.
        return
    (place,) = fit.places
    values, intervals = fit.values()[0], fit.intervals(remaining.model.room)[0]
    stated = {}
    for parameter, value, (low, high) in zip(place.definition.parameters, values, intervals, strict=True):
        stated[parameter.name] = Stated(value, low, high)
    effect = place.definition.sentence(place, stated)
    yield Simple(
        kind="rows",
        numbers=change.numbers + _numbers(place) + 1,
        where=(f"row-{number}", place.where),
        sentence=f"Row {number} is wrong. {change.words} Beside that {effect}.",
        radius=fit.radius,
        evidence=remaining,
        rows=(number,),
        change=change.keys,
        fit=fit,
    )


def _change(table: TableRows, remaining: Evidence, fit: Fit, row: int, own: NDArray | None) -> RowChange:
    """Return the change that makes the row fit.

    `fit` is that of the other rows. `own` (3,) is the effect's part of the row's readings at the written angles [g];
    None where it is not known.
    """
    linear, wrong = table.linear, np.array([row])
    copied = next(Mending(table, row, wrong).copied(), None)
    if copied is not None and "readings_of_row" in copied.keys:
        return copied
    model = remaining.model
    predicted = predicted_reading(model.here.parametrisation, fit.point, model.here.positions)
    of_others = model.here.reading - fit.residual.reshape(-1, 3) - predicted
    added = np.insert(of_others, row, 0.0 if own is None else own, axis=0)
    # An effect may also widen the bounds of readings.
    bound = np.insert(fit.allowed.reshape(-1, 3), row, linear.bound.reshape(-1, 3)[row], axis=0)
    reading, residual = linear.reading - added, linear.residual - added.ravel()
    about = replace(table, linear=replace(linear, reading=reading, residual=residual, bound=bound.ravel())).about(wrong)
    if own is not None:
        exact = Mending(about, row, wrong).best
        if exact.numbers < ROW and exact.keys:
            return exact
    # At other angles the effect may be as large as in any row.
    bound[row] = bound.max(axis=0) + np.abs(added).max(axis=0)
    loose = Mending(replace(about, linear=replace(about.linear, bound=bound.ravel())), row, wrong)
    if own is None:
        readings = list(loose.readings())
        if len(readings) == 1:
            return readings[0]
    misfit = np.abs(loose.reading - loose.predicted(loose.written[None])[0]).max()
    if misfit < CLEAR * bound[row].max():
        return OPEN
    for changes in (loose.discrete(), loose.angles()):
        for change in changes:
            return change
    return OPEN


def _numbers(place: EffectPlace) -> int:
    """Numbers of an effect."""
    return len(place.definition.parameters) + (place.order is not None)
