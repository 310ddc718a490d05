"""Choose the table of a file that holds several, and list them."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from ..errors import InputError, nearest
from ..records.columns import FORCE, RATE
from ..records.read import table_in_memory
from .array_reader import UNNAMED
from .containers import (
    Part,
    array_channels,
    channels_of,
    frame_of,
    joined_stamps,
    labelled_channels,
    parts_of,
    read_begin,
    table_channels,
)
from .names import TIMES, from_one, heading
from .presets import presets
from .ranking import named_triads
from .sheet import HeaderFacts, Sheet, cell
from .understanding import Field

WHOLE = "(all)"
"""Name of the table of all columns of a file."""
GUESSES = ("numbers", "gyros", "accelerometers", "gyros and accelerometers")
"""Meanings of a table's columns by their names, by rank."""


@dataclass(frozen=True)
class TableInFile:
    """A table in a file: its name, its size, and the meaning of its columns by their names."""

    name: str
    rows: int
    columns: int
    guess: str

    def __str__(self) -> str:
        return f"{self.name or WHOLE}: {self.rows} rows, {self.columns} columns, {self.guess}"


def tables_in(file: Path) -> list[TableInFile]:
    """Return the tables of a file that holds several, those with gyros and accelerometers first."""
    parts = parts_of(file, read_begin(file))
    ranked = sorted(parts, key=lambda part: (-rank_of(part.names), part.name))
    return [TableInFile(part.name, part.rows, len(part.names), GUESSES[rank_of(part.names)]) for part in ranked]


def rank_of(names: tuple[str, ...]) -> int:
    """Return the index of the guess of what columns mean by their names."""
    heads = from_one([heading(name) for name in names])
    columns = {head.column for head in heads}
    for preset in presets().values():
        if preset.is_layout_of(names, ()):
            columns |= preset.columns.keys()
    fields = [Field(place, head, [], ()) for place, head in enumerate(heads)]
    quantities = {triad.quantity for triad in named_triads(fields)}
    has_force = columns >= set(FORCE) or "force" in quantities
    has_rate = columns >= set(RATE) or "rate" in quantities
    return 2 * has_force + has_rate


def sheet_of_part(file: Path, name: str) -> Sheet:
    """Return the table of a name, or the only one with the most instruments; the sheet names all others that may be.

    Raises InputError if there is no such table.
    """
    parts = parts_of(file, read_begin(file))
    if name:
        best = 0
        chosen = [part for part in parts if (part.name or WHOLE) == (name.strip("/") or WHOLE)]
        if not chosen:
            raise InputError(
                f"{file}: --from {name}: is not a table in it; {nearest(name, [part.name or WHOLE for part in parts])}"
            )
    else:
        best = max(rank_of(part.names) for part in parts)
        chosen = [part for part in parts if rank_of(part.names) == best]
    chosen.sort(key=lambda part: (not _has_time(part), not part.name, -part.rows, part.name))
    names = [part.name or WHOLE for part in chosen]
    gyros = (
        []
        if name or best != GUESSES.index("accelerometers")
        else [one.name for one in parts if rank_of(one.names) == 1]
    )
    pairs = [f"{one},{gyro}" for one in names for gyro in gyros if one.rpartition("/")[0] == gyro.rpartition("/")[0]]
    others = (*pairs, *names) if len(names) + len(pairs) > 1 else ()
    return _sheet(file, chosen[0], others)


def sheet_in_memory(source: object) -> Sheet:
    """Return a table in memory of any library as a sheet; an array without names has columns without names."""
    path = Path("table")
    if isinstance(source, np.ndarray) and source.dtype.names is None:
        channels = array_channels(source)
    elif hasattr(source, "dims") and hasattr(source, "coords"):
        channels = labelled_channels(source)
    else:
        channels = table_channels(table_in_memory(source))
    return _sheet(path, Part("", len(channels[0].values), (), partial(list, channels)), ())


def of_instance(sheet: Sheet, part: str) -> Sheet:
    """Return a text's rows of one sensor, as I=0: those whose column I holds 0; other rows are empty.

    Raises InputError if there is no such column or no such row.
    """
    name, _, value = part.partition("=")
    place, count = int(name) - 1 if name.isdecimal() else -1, 0

    def of_sensor(_: int, texts: list[str]) -> list[str]:
        nonlocal place, count
        if place < 0:
            place = texts.index(name) if name in texts else -1
            return texts
        if cell(texts, place).strip() != value:
            return []
        count += 1
        return texts

    rows = sheet.changed(of_sensor)
    if not count or sheet.whole is not None:
        raise InputError(f"{sheet.path}: --from {part}: there is no such row; give the column and its value, as I=0")
    return rows


def _has_time(part: Part) -> bool:
    return any(heading(name).column == TIMES for name in part.names)


def _sheet(file: Path, part: Part, others: tuple[str, ...]) -> Sheet:
    channels = joined_stamps(channels_of(file, part))
    likely = f"{part.rate:g} Hz" if part.rate else ""
    units = tuple(channel.unit for channel in channels)
    named = int(not all(channel.name.startswith(UNNAMED) for channel in channels))
    stated = HeaderFacts(
        header_row=named, first_row=named + 1, units=units, likely_rate=likely, parts=others, remark=part.remark
    )
    return Sheet(file, name=part.name, stated=stated, frame=frame_of(file, channels))
