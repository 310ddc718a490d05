"""Where the table stands in a sheet: lines of names and units, first and last row of data, what stands around it."""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..errors import InputError
from .mapping import Mapping, printable
from .names import Heading, from_one, heading, is_unit_row, joined, of_name
from .numbers import bare, has_degree_mark, is_missing, number, unit_behind
from .sheet import LOOKED_AT, Row, Sheet, is_data, is_value
from .units import known_unit

TAIL = 300
"""Lines at the end of a file among which the last row of data is looked for."""
COMMENT = ("#", "%", "//")
"""Marks before a comment, or a line of names, that are no name."""
MOST_REMARKS = 60
"""Lines around the table that are kept."""
LONGEST_REMARK = 300
"""Characters of such a line that are kept."""


@dataclass(frozen=True)
class Layout:
    """Lines of a table, as an editor counts; `names` and `units` are 0 where there are none, `last` 0 for the end.

    `headings` are those of its fields, in their order, `looked_at` its first rows, `remarks` key -> text of the lines
    around it; a line without a key is "remark", "remark 2".
    """

    names: int
    units: int
    first: int
    last: int
    headings: tuple[Heading, ...]
    looked_at: list[Row]
    remarks: dict[str, str]


def layout_of(sheet: Sheet, given: Mapping) -> Layout:
    """Find the table of a sheet; an InputError where there is none."""
    head = [row for _, row in zip(range(LOOKED_AT), sheet.rows(), strict=False)]
    first = _first_data(sheet, head, given)
    above = [row for row in head if row[0] < first]
    data = [row for row in head if row[0] >= first]
    width = Counter(_width(texts) for _, texts in data).most_common(1)[0][0]
    units, names = given.units_row, given.names
    if units < 0:
        units = above[-1][0] if above and is_unit_row(above[-1][1]) else 0
    if names < 0:
        names = sheet.stated.header_row or _names_row(above, units, width)
    texts = dict(above)
    for key, line in (("names", names), ("units_row", units)):
        if line > 0 and line not in texts:
            raise InputError(f"{sheet.path}: {key} = {line}: is no row above the data, which begin in row {first}")
    named = texts.get(names, [])
    fields = max(len(row) for _, row in data)
    if len(named) == fields + 1 and named[0].strip() in COMMENT:
        if sheet.separator != "blanks":
            _refuse_fields(sheet, (names, len(named)), (first, fields))
        named = named[1:]
    if given.names < 0 and sheet.separator == "blanks" and len(named) > width:
        # words of a sentence: which stands over which field cannot be known
        names, named = 0, []
    if names and len(named) < width:
        _refuse_fields(sheet, (names, len(named)), (first, width))
    count = max(width, _width(named))
    named = (named + [""] * count)[:count]
    under = (list(texts.get(units) or sheet.stated.units) + [""] * count)[:count]
    under = [unit if unit.strip() else _unit_in(data, place) for place, unit in enumerate(under)]
    groups = _groups(texts.get(names - 1, []), count)
    headings = from_one([_heading(*head) for head in zip(groups, named, under, strict=True)])
    last = given.last or _last_data(sheet, first)
    inside = {names, units}
    if any(found.text not in ("", " ".join(name.split())) for found, name in zip(headings, named, strict=True)):
        inside.add(names - 1)
    around = [row for row in above if row[0] not in inside]
    if last:
        around += sheet.rows(last + 1)
    return Layout(names, units, first, last, headings, data, remarks_of(around))


def has_table(sheet: Sheet, given: Mapping) -> bool:
    """Whether a sheet has rows of data."""
    try:
        _first_data(sheet, [row for _, row in zip(range(LOOKED_AT), sheet.rows(), strict=False)], given)
    except InputError:
        return False
    return True


def _width(texts: Sequence[str]) -> int:
    """Fields up to the last that is not empty."""
    return max((k for k, text in enumerate(texts, 1) if text.strip()), default=0)


def _first_data(sheet: Sheet, head: Sequence[Row], given: Mapping) -> int:
    """The first row of the longest stretch of data."""
    stated = given.first if given.first > 0 else sheet.stated.first_row
    if stated:
        if not any(line >= stated for line, _ in head):
            raise InputError(f"{sheet.path}: first = {stated}: there are no rows from there on")
        return next(line for line, _ in head if line >= stated)
    best, begin, length = (0, 0), 0, 0
    for line, texts in [*head, (0, [])]:
        if is_data(texts):
            begin, length = (line, 1) if not length else (begin, length + 1)
        elif sum(is_missing(text) for text in texts) < len(texts) or not texts:
            best, length = max(best, (length, -begin)), 0
    if not best[0]:
        raise InputError(f"{sheet.path}: has no rows of at least three numbers; a table of measured data is needed")
    begin = -best[1]
    first, second, *_ = [*(texts for line, texts in head if line >= begin), [], []]
    words = [not is_missing(text) and not is_value(text) for text in first]
    if sum(word and is_value(text) for word, text in zip(words, second, strict=False)) > 1:
        # names of which most are numbers
        return next(line for line, _ in head if line > begin)
    return begin


def _names_row(above: Sequence[Row], units: int, width: int) -> int:
    """The nearest row above the data that has names: two thirds as many words as there are fields; 0 without one."""
    for line, texts in reversed(above):
        if line == units:
            continue
        over = next((cells for row, cells in above if row == line - 1), []) + [""] * len(texts)
        words = [not is_missing(text) and not is_value(text) for text in texts]
        # names may stand in two lines, each of which is short
        both = [word or not is_missing(text) for word, text in zip(words, over, strict=False)]
        return line if sum(words) >= 3 and sum(both) >= width // 2 else 0
    return 0


def _groups(above: Sequence[str], count: int) -> list[str]:
    """What stands over each field in the line above the names, to the right as far as that is empty there.

    A single text at the left is a title, and no name of columns.
    """
    texts = [text.strip() for text in above]
    if sum(map(bool, texts)) < 2 and not any(texts[1:]):
        return [""] * count
    groups, group = list[str](), ""
    for text in (texts + [""] * count)[:count]:
        group = text or group
        groups.append(group)
    return groups


def _heading(group: str, text: str, unit: str) -> Heading:
    """What the head of a column says, with what stands over it, and the unit from the row of units."""
    own = _with_unit(heading(text), unit)
    if not group:
        return own
    whole = _with_unit(heading(joined(group, text)), unit)
    return whole if whole.column or (whole.numbered and not own.column) else own


def _with_unit(found: Heading, unit: str) -> Heading:
    if not unit.strip() or unit.strip() in ("-", "--", "#") or found.unit:
        return found
    if known_unit(unit) is None:
        # a second line of the name: "x [g]" below "Acc"
        whole = heading(joined(found.text, unit))
        if whole.column or whole.numbered:
            return whole
    said = of_name(found.text, found.name, unit.strip())
    return said if said.column or said.numbered or not found.column else replace(found, unit=unit.strip())


def _unit_in(data: Sequence[Row], place: int) -> str:
    """The unit behind the first number of a column; "" where there is none."""
    cells = (texts[place] for _, texts in data if place < len(texts))
    text = next((text for text in cells if not is_missing(text)), "")
    written = not has_degree_mark(text) and any(number(bare(text), mark) is not None for mark in ".,")
    unit = unit_behind(text) if written else ""
    return unit if known_unit(unit) else ""


def _refuse_fields(sheet: Sheet, names: tuple[int, int], data: tuple[int, int]) -> None:
    """Refuse a table whose names may stand over other fields, by the lines and counts of both."""
    what = f"{sheet.path}: row {data[0]} has {data[1]} fields where row {names[0]} has {names[1]} names"
    if sheet.separator == "," and names[1] < data[1]:
        what += ": decimal commas between commas cannot be told apart; save it with semicolons between the fields"
        raise InputError(what)
    raise InputError(f"{what}: which name stands over which field is not known; give every field one in the file")


def _last_data(sheet: Sheet, first: int) -> int:
    """The last row of data where words stand below it, else 0."""
    count = len(sheet.cells if sheet.cells is not None else sheet.lines)
    tail = list(sheet.rows(max(first, count - TAIL)))
    data = [line for line, texts in tail if is_data(texts)]
    return data[-1] if data and tail and data[-1] != tail[-1][0] else 0


def remarks_of(rows: Sequence[Row]) -> dict[str, str]:
    """The lines around a table as key and text: "Serial number: A-17", "Operator;Meier"; others are remarks."""
    found: dict[str, str] = {}

    def keep(key: str, text: str) -> None:
        name, count = key, 1
        while name in found:
            count += 1
            name = f"{key} {count}"
        found[name] = text

    for _, texts in rows[:MOST_REMARKS]:
        parts = [part for part in map(_printable, texts) if part]
        keyed = [pair for pair in map(_keyed, parts) if pair]
        key = parts[0].rstrip(":= ") if parts else ""
        if parts and len(keyed) == len(parts):
            for pair in keyed:
                keep(*pair)
        elif len(parts) > 1 and key and not key[0].isdigit() and ":" not in key:
            keep(key, ", ".join(parts[1:]))
        elif parts:
            keep("remark", " ".join(parts))
    return found


def _keyed(text: str) -> tuple[str, str] | None:
    """Key and text of "key: value" or "key = value"."""
    found = re.fullmatch(r"([^\W\d][^:=]{0,60}?)\s*(?:[:=])\s*(\S.*)", text)
    return (found[1], found[2]) if found else None


def _printable(text: str) -> str:
    text = " ".join(printable(text).split()).lstrip("# ")
    return text[:LONGEST_REMARK]
