"""Wrong rows: the fewest whose removal makes the model fit, and the change that makes each of them fit."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.arrays import Ints
from ...models.effects.last_stage import place_of
from ..bounded.work import Work
from ..errors import InputError
from ..evidence.evidence import Evidence
from .change import Mending, RowChange
from .exchange import Exchange, WrongRows
from .removal import Parts, Removal, TooMany
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


def shortest_stretch(removal: Removal, count: int, least: int, most: int) -> Ints | None:
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


MOST_ROWS = 3
MOST_SETS = 6
"""Most sets of rows, the smallest first, that are shown; where more stand the record does not tell which rows are
wrong."""
FREED = 5
"""Readings that are left out are at most this part of those that the parameters leave over."""
AGAIN = 2
"""Most searches; the second begins about a fit without the rows that miss most."""


def wrong_rows(evidence: Evidence) -> tuple[Simple, ...]:
    """Return the smallest sets of rows without which the model fits."""
    table = TableRows.of(evidence)
    if table is None:
        return ()
    most = most_rows(table)
    if most < 1:
        return ()
    faults = []
    for wrong in standing_sets(table, most)[:MOST_SETS]:
        faults += _faults(evidence, wrong, _changes_of(table, wrong))
    return tuple(faults)


def fault_of_row(evidence: Evidence, row: int) -> Simple | None:
    """Return the fault of a row (from 0) that is wrong for other reasons; None if the others do not fit."""
    table = TableRows.of(evidence)
    if table is None:
        return None
    wrong = np.array([row])
    return _of_whole_rows(evidence, wrong, _changes_of(table, wrong))


def _changes_of(table: TableRows, wrong: Ints) -> list[RowChange]:
    """Return the change that makes each of the rows fit."""
    about = table.about(wrong)
    return [Mending(about, int(row), wrong).best for row in wrong]


def most_rows(table: TableRows) -> int:
    """Return the number of rows that may be removed so that the others still prove something."""
    spare = len(table.target) - table.matrix.shape[1]
    return min(MOST_ROWS, spare // (3 * FREED))


def standing_sets(table: TableRows, most: int) -> list[Ints]:
    """Return the smallest sets of rows (from 0) whose removal makes the exact model fit."""
    for _ in range(AGAIN):
        standing = []
        for parts in table.removal().smallest(most):
            wrong = np.array(sorted(parts))
            about = table.about(wrong)
            if about.keeps_rank(wrong) and about.radius_without(wrong) <= table.limit:
                standing.append((about.radius_without(wrong), wrong))
        if standing:
            standing.sort(key=lambda one: one[0])
            return [wrong for _, wrong in standing]
        # The rows that miss most may have drawn even the robust fit.
        table = table.about(np.argsort(-table.excess)[:most])
    return []


def _faults(evidence: Evidence, wrong: NDArray, changes: Sequence[RowChange]) -> list[Simple]:
    """Return the fault of these rows, and, for several of one accelerometer, an error of it near these inputs."""
    assert evidence.source is not None
    channels = [change.reading for change in changes if change.reading is not None]
    if len(channels) == len(changes):
        return _of_readings(evidence, wrong, changes, channels)
    fault = _of_whole_rows(evidence, wrong, changes)
    return [] if fault is None else [fault, *_near_inputs(fault, changes)]


def _of_whole_rows(evidence: Evidence, wrong: NDArray, changes: Sequence[RowChange]) -> Simple | None:
    """Return rows that are set aside; None if the others do not fit."""
    assert evidence.source is not None
    record = evidence.source.record
    kept = np.setdiff1d(np.arange(len(record)), wrong)
    try:
        sigma = evidence.model.calibration.noise_bound
        remaining = evidence.source.again(record.selected(kept), noise_bound=sigma)
    except InputError:
        return None
    if remaining.model.falsified:
        return None
    numbers = tuple(record.numbers[wrong].tolist())
    unit = _unit(evidence)
    return Simple(
        kind="rows",
        numbers=sum(change.numbers for change in changes),
        where=tuple(f"{unit}-{number}" for number in numbers),
        sentence=_sentence(unit.capitalize(), numbers, changes, "; all others fit"),
        radius=remaining.model.radius,
        evidence=remaining,
        rows=numbers,
        change=_changes(numbers, changes),
    )


def _unit(evidence: Evidence) -> str:
    """Return the word for a row of a file, or of a series."""
    assert evidence.source is not None
    return "row" if evidence.source.record.raw is None else "rest"


def _of_readings(
    evidence: Evidence, wrong: NDArray, changes: Sequence[RowChange], channels: Sequence[int]
) -> list[Simple]:
    """Single readings that do not fit, as effects."""
    places = [place_of(int(row) + 1, channel) for row, channel in zip(wrong, channels, strict=True)]
    fits = evidence.model.mended(places, Work())
    if not fits:
        return []
    assert evidence.source is not None
    numbers, unit = tuple(evidence.source.record.numbers[wrong].tolist()), _unit(evidence)
    labels = [f"f{channel} of {unit} {number}" for number, channel in zip(numbers, channels, strict=True)]
    fault = Simple(
        kind="rows",
        numbers=2 * len(numbers),
        where=tuple(evidence.reader.named(place).where for place in places),
        sentence=f"{_listed(labels)} not fit; all others do.",
        radius=fits[0].radius,
        evidence=evidence,
        rows=numbers,
        fit=fits[0],
    )
    return [fault, *_near_inputs(fault, changes)]


def _near_inputs(fault: Simple, changes: Sequence[RowChange]) -> list[Simple]:
    """Return wrong readings of one accelerometer as an equally possible error of it near these inputs.

    Other wrong rows remain wrong.
    """
    faults, unit = [], _unit(fault.evidence).capitalize()
    for channel, count in sorted(Counter(change.reading for change in changes if change.reading is not None).items()):
        if count < 2:
            continue
        others = {row: change for row, change in zip(fault.rows, changes, strict=True) if change.reading != channel}
        near = [str(row) for row in fault.rows if row not in others]
        sentence = f"Accelerometer {channel} errs near its inputs in {unit.lower()}s {_and(near)}."
        where = (f"accelerometer-{channel}",)
        if others:
            sentence = f"{_sentence(unit, tuple(others), list(others.values()), '')} Beside that a{sentence[1:]}"
            where = (*(f"{unit.lower()}-{row}" for row in others), *where)
        kind, rows = "function", tuple(others)
        faults.append(replace(fault, kind=kind, where=where, sentence=sentence, rows=rows, change={}))
    return faults


def _sentence(unit: str, numbers: Sequence[int], changes: Sequence[RowChange], ending: str) -> str:
    """Describe the wrong rows or rests, and the changes with which each of them fits."""
    if len(numbers) == 1:
        return f"{unit} {numbers[0]} is wrong{ending}. {changes[0].words}"
    head = f"{unit}s {_and([str(number) for number in numbers])} are wrong{ending}."
    words = [f"{change.words[0].lower()}{change.words[1:]}" for change in changes]
    if len(set(words)) == 1:
        return f"{head} Of each: {words[0]}"
    return " ".join([head, *(f"{unit} {row}: {text}" for row, text in zip(numbers, words, strict=True))])


def _changes(numbers: Sequence[int], changes: Sequence[RowChange]) -> Mapping[str, Any]:
    """Return the change of the only row, or the changes of each row by its number."""
    if len(numbers) == 1:
        return changes[0].keys
    return {str(row): dict(change.keys) for row, change in zip(numbers, changes, strict=True) if change.keys}


def _listed(labels: Sequence[str]) -> str:
    """The labels with the verb: "The reading f3 of row 2 does", "The readings f3 of row 2 and f3 of row 8 do"."""
    return f"The reading {labels[0]} does" if len(labels) == 1 else f"The readings {_and(labels)} do"


def _and(labels: Sequence[str]) -> str:
    """Return labels in a list: "6, 18 and 30"."""
    return " and ".join([", ".join(labels[:-1]), labels[-1]]) if len(labels) > 1 else labels[0]
