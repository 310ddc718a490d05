"""Find the table in a sheet: lines of names and units, first and last row of data, lines around it.

Two other shapes are made upright first: a column for each position, and a block with a heading for each rest.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from decimal import Decimal, InvalidOperation
from itertools import islice, pairwise, zip_longest

from ..errors import InputError
from ..records.columns import ANGLES, FORCE, TEMPERATURE
from .mapping import Mapping, printable
from .names import (
    DATE,
    NOTHING,
    POSITION,
    TIMES,
    Heading,
    from_one,
    heading,
    is_unit,
    is_unit_row,
    joined_head,
    normal,
    of_name,
)
from .numbers import bare, has_degree_mark, is_clock, is_missing, parsed_number, unit_behind
from .sheet import LOOKED_AT, HeaderFacts, Row, Sheet, cell, has_text, is_data, is_value, is_word
from .units import TIME, known_unit

TAIL = 300
"""Number of lines at the end of a file that are searched for the last row of data."""
COMMENT = ("#", "%", "//")
"""Marks before a comment or a line of names that are not part of it."""
MOST_REMARKS = 60
"""Largest number of lines around the table that are kept."""
LONGEST_REMARK = 300
"""Largest number of characters that are kept of such a line."""
PART_DIGITS = {1e-3: 3, 1e-6: 6, 1e-9: 9}
"""Unit of a part of a second [s] -> its digits."""
SECONDS = ("s", "sec", "secs", "seconds")
"""Names of whole seconds."""
OF_A_REST = (POSITION, *ANGLES, TEMPERATURE, TIMES, DATE)
"""Columns that the heading of a block may give for a rest."""
EPOCH, FASTEST_RATE = 1e8, 1000.0
"""Least start of a record since an epoch [s], and largest rate above its columns [Hz]."""
LEAST_BLOCKS = 2
"""Smallest number of headings with angles that make blocks; fewer are lines around a table."""
LONGEST_PAIRS = 400
"""A longer cell [characters] holds no names and values of a rest."""
_PAIR = re.compile(
    r"(?P<name>[^\W\d_][^=:,;\d]*?)\s*[=:]?\s*(?P<value>[+-]?\d+(?:[.,]\d+)?)"
    r"(?:\s*(?P<unit>°C?|(?:deg|degC|rad|mrad|gon|arcmin|arcsec|C|K|s|ms|min|h)\b))?(?![\w.,°'′:]*\s?[\d'′\"])"
)


@dataclass(frozen=True)
class SheetLayout:
    """Lines of a table, as an editor counts; `names` and `units` are 0 if there are none, `last` is 0 for the end.

    `headings` are those of its fields in their order, `looked_at` its first rows, `remarks` key -> text of the lines
    around it; a line without a key is "remark", "remark 2".
    """

    names: int
    units: int
    first: int
    last: int
    headings: tuple[Heading, ...]
    looked_at: list[Row]
    remarks: dict[str, str]

    @property
    def lines_around(self) -> str:
        """The lines around the table as one text."""
        return " ".join(f"{key}: {text};" for key, text in self.remarks.items())


def layout_of(sheet: Sheet, mapping: Mapping) -> SheetLayout:
    """Find the table of a sheet.

    Raises InputError if there is none.
    """
    head = list(islice(sheet.rows(), LOOKED_AT))
    first = _first_data(sheet, head, mapping)
    above = [row for row in head if row[0] < first]
    above, rows = _with_name_of_index(above), head[len(above) :]
    width = Counter(_width(texts) for _, texts in rows).most_common(1)[0][0]
    units, names = mapping.units_row, mapping.names
    if units < 0:
        units = above[-1][0] if above and is_unit_row(above[-1][1]) else 0
    if names < 0:
        names = sheet.stated.header_row or (0 if sheet.stated.names else _names_row(above, units, width))
    lines = dict(above)
    for key, line in (("names", names), ("units_row", units)):
        if line > 0 and line not in lines:
            raise InputError(f"{sheet.path}: {key} = {line}: is not a row above the data, which begin in row {first}")
    cells = lines.get(names) or list(sheet.stated.names)
    fields = max(len(texts) for _, texts in rows)
    if len(cells) == fields + 1 and cells[0].strip() in COMMENT:
        if sheet.separator != "blanks":
            _refuse_fields(sheet, (names, len(cells)), (first, fields))
        cells = cells[1:]
    if mapping.names < 0 and sheet.separator == "blanks" and len(cells) > width:
        # words of a sentence do not show which field they belong to
        names, cells = 0, []
    if names and len(cells) < width:
        _refuse_fields(sheet, (names, len(cells)), (first, width))
    count = max(width, _width(cells))
    under = lines.get(units) or sheet.stated.units
    groups = _groups(lines.get(names - 1, []), count)
    if sheet.frame is not None:
        count = sheet.frame.width
        groups = [""] * count
    headings, inside = [], {names, units}
    for place in range(count):
        unit, name = cell(under, place), cell(cells, place)
        headings.append(_heading(groups[place], name, unit if unit.strip() else _unit_in(rows, place)))
        if headings[-1].text not in ("", " ".join(name.split())):
            # names in two lines
            inside.add(names - 1)
    around = [row for row in above if row[0] not in inside]
    last = mapping.last or _last_data(sheet, first)
    if last:
        around += sheet.rows(last + 1)
    return SheetLayout(names, units, first, last, from_one(headings), rows, _remarks(around))


def with_sums(sheet: Sheet, layout: SheetLayout, sources: Iterable[str]) -> tuple[Sheet, SheetLayout]:
    """Return a table with a further column for each source that is a sum of two of its columns, as "8+11"."""
    heads = [head.text for head in layout.headings]
    sums: dict[str, tuple[int, int]] = {}
    for source in sources:
        places = [_place_of(name, heads) for name in source.split("+")]
        if source not in heads and len(places) == 2 and min(places) >= 0:
            sums[source] = (places[0], places[1])
    if not sums:
        return sheet, layout

    def with_columns(texts: list[str]) -> list[str]:
        further = [_sum_of(cell(texts, first), cell(texts, second)) for first, second in sums.values()]
        return [*texts, *[""] * (len(heads) - len(texts)), *further]

    headings = [*layout.headings]
    for source, (first, second) in sums.items():
        units = {layout.headings[first].unit, layout.headings[second].unit}
        if len(units) > 1:
            raise InputError(f"{sheet.path}: {source}: these columns have the units {' and '.join(sorted(units))}")
        headings.append(Heading(source, source, units.pop()))
    rows = [(line, with_columns(texts)) for line, texts in layout.looked_at]
    layout = replace(layout, headings=tuple(headings), looked_at=rows)
    return sheet.changed(lambda line, texts: with_columns(texts) if line >= layout.first else texts), layout


def _place_of(name: str, heads: Sequence[str]) -> int:
    """Return the place of a column by its name, or by its number from 1; -1 if there is none."""
    name = name.strip()
    if name in heads:
        return heads.index(name)
    return int(name) - 1 if name.isdecimal() and int(name) <= len(heads) else -1


def _sum_of(first: str, second: str) -> str:
    """Return the sum of two numbers to their last digit; "" if one of them is none."""
    mark = "," if "," in first + second else "."
    try:
        return str(Decimal(first.replace(",", ".")) + Decimal(second.replace(",", "."))).replace(".", mark)
    except InvalidOperation:
        return ""


def _with_name_of_index(above: list[Row]) -> list[Row]:
    """Return rows above the data with the name of pandas's index, alone in its row, in the row of names above it."""
    if len(above) > 1 and _width(above[-1][1]) == 1 and not above[-2][1][0].strip() and _width(above[-2][1]) > 2:
        return [*above[:-2], (above[-2][0], [above[-1][1][0], *above[-2][1][1:]])]
    return above


def has_table(sheet: Sheet, mapping: Mapping) -> bool:
    """Return True if a sheet has rows of data."""
    try:
        _first_data(sheet, list(islice(sheet.rows(), LOOKED_AT)), mapping)
    except InputError:
        return False
    return True


def _width(texts: Sequence[str]) -> int:
    """Return the number of fields up to the last non-empty one."""
    return max((k for k, text in enumerate(texts, 1) if text.strip()), default=0)


def _first_data(sheet: Sheet, head: Sequence[Row], mapping: Mapping) -> int:
    """Return the first row of the longest stretch of data."""
    stated = mapping.first if mapping.first > 0 else sheet.stated.first_row
    lines = list(dict(head))
    if stated:
        at = next((line for line in lines if line >= stated), 0)
        if not at:
            raise InputError(f"{sheet.path}: first = {stated}: there are no rows from there on")
        return at
    longest, begin, length, at = 0, 0, 0, 0
    for place, (_, texts) in enumerate([*head, (0, [])]):
        if is_data(texts):
            begin = begin if length else place
            length += 1
        elif not texts or not all(map(is_missing, texts)):
            if length > longest:
                longest, at = length, begin
            length = 0
    if not longest:
        raise InputError(f"{sheet.path}: has no rows of at least three numbers; a table of measured data is needed")
    first, second = head[at][1], head[at + 1][1] if at + 1 < len(head) else []
    names = sum(is_word(name) and is_value(below) for name, below in zip(first, second, strict=False))
    # names, most of them numbers
    return lines[at + (names > 1)]


def _names_row(above: Sequence[Row], units: int, width: int) -> int:
    """Return the nearest row of names above the data (words in two thirds of its fields); 0 if there is none."""
    lines = dict(above)
    line = next((line for line in reversed(lines) if line != units and any(map(is_word, lines[line]))), 0)
    over = lines.get(line - 1, [])
    words = names = 0
    for place, text in enumerate(lines.get(line, [])):
        words += is_word(text)
        # names may take two short lines
        names += is_word(text) or not is_missing(cell(over, place))
    if words >= 3 and names >= width // 2:
        return line
    return 0


def _groups(above: Sequence[str], count: int) -> list[str]:
    """Return the texts of the line above the names for each field; each extends to the right over empty fields.

    A single text at the left is a title, not a name of columns.
    """
    texts = [text.strip() for text in above]
    if sum(map(bool, texts)) < 2 and not any(texts[1:]):
        return [""] * count
    groups = list[str]()
    for place in range(count):
        groups.append(cell(texts, place) or (groups[-1] if groups else ""))
    return groups


def _heading(group: str, text: str, unit: str) -> Heading:
    """Return the head of a column, with the text above it, and the unit from the row of units."""
    alone = _with_unit(heading(text), unit)
    if not group:
        return alone
    grouped = _with_unit(heading(joined_head(group, text)), unit)
    if grouped.column or (grouped.numbered and not alone.column):
        return grouped
    return alone


def _with_unit(head: Heading, unit: str) -> Heading:
    """Return a head with the text below it: its unit, or the second line of its name ("x [g]" below "Acc")."""
    unit = unit.strip()
    if not unit or unit in NOTHING or head.unit:
        return head
    if not is_unit(unit):
        in_two_lines = heading(joined_head(head.text, unit))
        if in_two_lines.means_column:
            return in_two_lines
    with_unit = of_name(head.text, head.name, unit)
    if with_unit.means_column or not head.column:
        return with_unit
    return replace(head, unit=unit)


def _unit_in(rows: Sequence[Row], place: int) -> str:
    """Return the unit behind the first number of a column; "" if there is none."""
    text = next((cell(texts, place) for _, texts in rows if not is_missing(cell(texts, place))), "")
    if has_degree_mark(text) or (parsed_number(bare(text), ".") is None and parsed_number(bare(text), ",") is None):
        return ""
    unit = unit_behind(text)
    return unit if known_unit(unit) else ""


def _refuse_fields(sheet: Sheet, names: tuple[int, int], readings: tuple[int, int]) -> None:
    """Refuse a table whose names may belong to other fields, with the lines and counts of both."""
    what = f"{sheet.path}: row {readings[0]} has {readings[1]} fields where row {names[0]} has {names[1]} names"
    if sheet.separator == "," and names[1] < readings[1]:
        what += ": decimal commas between commas cannot be told apart; save it with semicolons between the fields"
        raise InputError(what)
    raise InputError(f"{what}: which name stands over which field is not known; give every field one in the file")


def _last_data(sheet: Sheet, first: int) -> int:
    """Return the last row of data if words follow it, else 0."""
    if sheet.frame is not None or sheet.whole is not None:
        return 0
    count = len(sheet.cells if sheet.cells is not None else sheet.lines)
    tail = list(sheet.rows(max(first, count - TAIL)))
    last = next((line for line, texts in reversed(tail) if is_data(texts)), 0)
    return 0 if not last or last == tail[-1][0] else last


def _remarks(rows: Sequence[Row]) -> dict[str, str]:
    """Return the lines around a table as key and text: "Serial number: A-17", "Operator;Meier"; others are remarks."""
    remarks: dict[str, str] = {}
    for _, texts in rows[:MOST_REMARKS]:
        parts = list(filter(None, map(_printable, texts)))
        pairs = [re.fullmatch(r"([^\W\d][^:=]{0,60}?)\s*(?:[:=])\s*(\S.*)", part) for part in parts]
        keyed = [pair.groups() for pair in pairs if pair]
        if len(keyed) < len(parts):
            key = parts[0].rstrip(":= ")
            is_key = len(parts) > 1 and key and not key[0].isdigit() and ":" not in key
            keyed = [(key, ", ".join(parts[1:])) if is_key else ("remark", " ".join(parts))]
        for key, text in keyed:
            name, count = key, 1
            while name in remarks:
                count += 1
                name = f"{key} {count}"
            remarks[name] = text
    return remarks


def _printable(text: str) -> str:
    return " ".join(printable(text).split()).lstrip("# ")[:LONGEST_REMARK]


def parts_of_seconds(names: Sequence[str]) -> Iterator[tuple[int, int, int, bool]]:
    """Yield the places of a time and of a part of a second that may stand beside it, by their names.

    With them come the digits of the part, 0 for a fraction, and whether the time is in seconds by its name.
    """
    words = [normal(re.sub(r"[\[(].*?[\])]", "", name)).split() for name in names]
    plain = [" ".join(all_words) for all_words in words]
    for place, all_words in enumerate(words):
        before, digits = all_words, -1
        if any(word.startswith("frac") for word in all_words):
            before, digits = [word for word in all_words if not word.startswith("frac")], 0
        for count in (1, 2):
            unit = known_unit("".join(all_words[-count:]))
            if len(all_words) >= count and unit is not None and unit.quantity == TIME:
                before, digits = all_words[:-count], PART_DIGITS.get(unit.factor, -1)
        if digits < 0:
            continue
        seconds = [" ".join([*before, word]) for word in SECONDS]
        for whole, name in enumerate(plain):
            is_time = name == " ".join(before) or (not before and heading(names[whole]).column == TIMES)
            if whole != place and (name in seconds or is_time):
                yield whole, place, digits, name in seconds and digits > 0


def of_seconds(whole: str, part: str, digits: int) -> str:
    """Return a time of whole seconds with a part of a second; "" if they are none."""
    whole, part = whole.strip().removesuffix(".0"), part.strip().removesuffix(".0")
    if not digits and part.startswith(("0.", "0,")):
        part, digits = part[2:], len(part) - 2
    is_whole = whole.isdecimal() or (is_clock(whole) and whole.count(":") == 2)
    if is_whole and part.isdecimal() and 0 < len(part) <= digits:
        return f"{whole}.{part.zfill(digits)}"
    return ""


def are_beside(pairs: Iterable[tuple[str, str]], digits: int) -> bool:
    """Return True if parts of a second prove themselves: whole seconds repeat, and in them only the parts grow."""
    times = [(whole.strip(), of_seconds(whole, part, digits)) for whole, part in pairs if whole.strip()]
    repeated = 0
    for (second, time), (next_second, next_time) in pairwise(times):
        if not time or not next_time or (second == next_second and next_time <= time):
            return False
        repeated += second == next_second
    return repeated > 0


def with_exact_seconds(sheet: Sheet) -> Sheet:
    """Return a sheet whose whole seconds and the part of a second beside them are one time."""
    rows = [(0, list(sheet.stated.names)), *islice(sheet.rows(), LOOKED_AT)]
    for k, (line, texts) in enumerate(rows):
        if is_data(texts):
            break
        for whole, part, digits, is_named in parts_of_seconds(texts):
            below = [row for _, row in rows[k + 1 :] if is_data(row)]
            pairs = [(cell(row, whole), cell(row, part)) for row in below]
            if is_named or are_beside(pairs, digits):
                return _with_joined(sheet, line, whole, part, digits)
    return sheet


def _with_joined(sheet: Sheet, head: int, whole: int, part: int, digits: int) -> Sheet:
    """Join two columns below the line of their names to one time; the column of the part goes."""

    def with_time(line: int, texts: list[str]) -> list[str]:
        time = of_seconds(cell(texts, whole), cell(texts, part), digits)
        if line == head:
            texts[whole] = "time [s]"
        elif line > head and time:
            texts[whole] = time
        del texts[part : part + 1]
        return texts

    names, units = list(sheet.stated.names), list(sheet.stated.units)
    if names:
        names[whole], units[whole] = "time", "s"
        names.pop(part)
        units.pop(part)
    stated = replace(sheet.stated, names=tuple(names), units=tuple(units))
    return replace(sheet.changed(with_time), stated=stated)


def with_rate_above(sheet: Sheet) -> Sheet:
    """Return a sheet with its names and rate, where three columns begin with their start and their rate: Empatica."""
    rows = list(islice(sheet.rows(), 2))
    values = [{parsed_number(text) for text in texts} for _, texts in rows]
    if len(rows) < 2 or len(rows[0][1]) != 3 or max(map(len, values)) > 1:
        return sheet
    (start,), (rate,) = values
    if start is None or rate is None or not start > EPOCH or not 1.0 <= rate <= FASTEST_RATE:
        return sheet
    names = tuple(f"acc {axis}" for axis in "xyz")
    return replace(sheet, stated=HeaderFacts(names=names, first_row=rows[1][0] + 1, time=f"{rate:g} Hz"))


def upright(sheet: Sheet) -> Sheet:
    """Return a sheet with a row for each reading, unchanged if it has this shape already.

    Rows of a sheet with a block for each rest keep their lines; columns of a table on its side become rows.
    """
    head = list(islice(sheet.rows(), LOOKED_AT))
    if len(head) < LOOKED_AT:
        return _turned(sheet, head) or _flat(sheet, head) or sheet
    return (_flat(sheet, head) and _flat(sheet, list(sheet.rows()))) or sheet


def _turned(sheet: Sheet, rows: list[Row]) -> Sheet | None:
    """Turn a table with names at the left and a column for each position; return None for any other table."""
    row_of: dict[str, int] = {}
    for k, (_, texts) in enumerate(rows):
        filled = [text for text in texts if text.strip()]
        column = "" if is_value(filled[0]) else heading(filled[0]).column
        if column and sum(map(is_value, filled)) + 3 > len(filled) > 2:
            if column in row_of:
                return None
            row_of[column] = k
    if not row_of.keys() >= set(FORCE + ANGLES):
        return None
    first, last = min(row_of.values()), max(row_of.values()) + 1
    cells = [texts for _, texts in rows]
    columns = list(zip_longest(*cells[first:last], fillvalue=""))
    while not has_text(columns[0]):
        columns.pop(0)
    cells[first:last] = []
    cells += [[], *map(list, columns)]
    return replace(sheet, cells=cells, shape="a column for each position, turned")


def _flat(sheet: Sheet, rows: list[Row]) -> Sheet | None:
    """Join blocks, each with a heading that gives the angles, to one table; return None for any other table.

    Raises InputError if a block has no heading: its readings belong to an unknown rest.
    """
    readings: list[tuple[int, dict[str, tuple[str, str]], list[str]]] = []
    rest: dict[str, tuple[str, str]] = {}
    names, title, blocks, before, unheaded, is_inside = [""], 0, 0, 0, 0, False
    for line, texts in rows:
        measured = is_data(texts)
        pairs = {} if measured else _pairs(texts)
        if is_inside and (not measured or line > before + 1):
            # a block ends, and its heading does not apply below it
            rest, is_inside = {}, False
        if pairs:
            rest |= pairs
            title = title or line
        elif measured and rest:
            blocks += not is_inside
            is_inside = True
            readings.append((line, {POSITION: ("Position", str(blocks))} | rest, texts))
        elif measured:
            unheaded = unheaded or line
        elif title and sum(bool(text.strip()) and not is_value(text) for text in texts) > 2:
            names = texts
        before = line
    if blocks < LEAST_BLOCKS or any(heading(name).column in ANGLES for name in names):
        return None
    name_of = _names_of(readings[0][1])
    if not name_of.keys() >= set(ANGLES):
        return None
    for line, rest, _ in readings:
        if _names_of(rest) != name_of:
            what = f"row {line}: its heading differs from those before; give all headings one form"
            raise InputError(f"{sheet.path}: {what}")
    if unheaded:
        raise InputError(f"{sheet.path}: row {unheaded}: these readings have no heading with their angles")
    cells: list[list[str]] = [[] for _ in range(readings[-1][0])]
    for line, texts in rows:
        if line < title:
            cells[line - 1] = texts
    width = max(len(texts) for _, _, texts in readings)
    cells[readings[0][0] - 2] = [*name_of.values(), *names] + [""] * (width - len(names))
    for line, rest, texts in readings:
        cells[line - 1] = [value for _, value in rest.values()] + texts
    return replace(sheet, cells=cells, shape="a block for each rest")


def _names_of(rest: dict[str, tuple[str, str]]) -> dict[str, str]:
    return {column: name for column, (name, _) in rest.items()}


def _pairs(texts: list[str]) -> dict[str, tuple[str, str]]:
    """Return column of the record -> name, with its unit, and value: of "alpha = 20 deg" or "alpha [°];20"."""
    column_of: dict[str, tuple[str, str]] = {}
    cells = [" ".join(text.split()) for text in texts if text.strip() and len(text) <= LONGEST_PAIRS]
    for text, behind in pairwise([*cells, ""]):
        pairs = [pair.group("name", "value", "unit") for pair in _PAIR.finditer(text)]
        if not pairs and is_value(behind):
            pairs = [(text.rstrip(":= "), behind, "")]
        for name, value, unit in pairs:
            head = heading(name)
            if head.column in OF_A_REST:
                has_unit = unit and not head.unit and known_unit(unit)
                column_of.setdefault(head.column, (f"{name} [{unit}]" if has_unit else name, value))
    return column_of
