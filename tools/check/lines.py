"""In which line of a TOML or JSON file a field stands; the libraries that read these files do not say."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from ..field_problems import Location

PATIENT = 64
"""A TOML statement of more lines is looked for at lines that can end one only."""

_BLANK = re.compile(r"[ \t\r\n]*")


def line_of(lines: Mapping[Location, int], location: Location) -> int | None:
    """The line of a field, or of the innermost section around it that the file has."""
    for length in range(len(location), 0, -1):
        if location[:length] in lines:
            return lines[location[:length]]
    return None


def toml_lines(text: str) -> dict[Location, int]:
    """Location -> line, counted from 1, of every table and every key of a TOML file.

    Parameters
    ----------
    text : str
        a file that `tomllib` reads; lines end with a line feed
    """
    lines = text.split("\n")
    found: dict[Location, int] = {}
    tables: dict[Location, int] = {}
    section: Location = ()
    row = 0
    while row < len(lines):
        written = lines[row].strip()
        if not written or written.startswith("#"):
            row += 1
        elif written.startswith("["):
            section = _header(written, tables)
            for length in range(1, len(section) + 1):
                found.setdefault(section[:length], row + 1)
            row += 1
        else:
            after, statement = _statement(lines, row)
            for location in _locations(statement):
                found.setdefault((*section, *location), row + 1)
            row = after
    return found


def _header(written: str, tables: dict[Location, int]) -> Location:
    """The location of `[a.b]` or `[[a.b]]`; `tables` counts the entries of arrays of tables."""
    inner, is_entry = tomllib.loads(written), written.startswith("[[")
    names: list[str] = []
    while isinstance(inner, dict) and inner:
        ((name, inner),) = inner.items()
        names.append(name)
    location: Location = ()
    for place, name in enumerate(names):
        location = (*location, name)
        if is_entry and place == len(names) - 1:
            tables[location] = tables.get(location, -1) + 1
        if location in tables:
            location = (*location, tables[location])
    return location


def _statement(lines: list[str], row: int) -> tuple[int, dict[str, Any]]:
    """The row behind the statement that begins at `row`, and what it says: the fewest lines that are TOML."""
    for after in range(row + 1, len(lines) + 1):
        if after - row > PATIENT and not lines[after - 1].rstrip().endswith(("]", "}", '"', "'")):
            continue
        try:
            return after, tomllib.loads("\n".join(lines[row:after]))
        except tomllib.TOMLDecodeError:
            continue
    return len(lines), {}


def _locations(value: object) -> Iterator[Location]:
    """Everything inside a value, by its location."""
    inner: Iterator[tuple[int | str, object]]
    if isinstance(value, dict):
        inner = iter(value.items())
    elif isinstance(value, list):
        inner = iter(enumerate(value))
    else:
        return
    for key, item in inner:
        yield (key,)
        yield from ((key, *rest) for rest in _locations(item))


def json_lines(text: str) -> dict[Location, int]:
    """Location -> line, counted from 1, of every member and element of a JSON text that `json` reads."""
    found: dict[Location, int] = {}
    counted = [0, 1]

    def line(at: int) -> int:
        counted[1] += text.count("\n", counted[0], at)
        counted[0] = at
        return counted[1]

    def blank(at: int) -> int:
        space = _BLANK.match(text, at)
        return space.end() if space else at

    def walk(at: int, location: Location) -> int:
        at = blank(at)
        if location:
            found.setdefault(location, line(at))
        if text[at] not in "{[":
            return json.JSONDecoder().raw_decode(text, at)[1]
        is_object, number = text[at] == "{", 0
        at = blank(at + 1)
        while text[at] not in "}]":
            key: int | str = number
            if is_object:
                found_key, at = json.JSONDecoder().raw_decode(text, at)
                key = str(found_key)
                found[(*location, key)] = line(at)
                at = blank(at) + 1
            at = blank(walk(at, (*location, key)))
            at = blank(at + 1) if text[at] == "," else at
            number += 1
        return at + 1

    walk(0, ())
    return found
