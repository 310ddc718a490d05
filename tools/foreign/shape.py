"""Tables of other shapes as upright ones: a column for each position, or a block with a heading for each rest."""

import re
from dataclasses import replace
from itertools import islice

from ..errors import InputError
from ..records.columns import ANGLES, FORCE
from .names import DATE, TIMES, heading
from .sheet import LOOKED_AT, Row, Sheet, is_data, is_value
from .units import known_unit

POSITION, TEMPERATURE = "position", "temperature_degC"
OF_A_REST = (POSITION, *ANGLES, TEMPERATURE, TIMES, DATE)
"""What a heading may say of a rest."""
LEAST_BLOCKS = 2
"""Fewer headings with angles are lines around a table."""

_PAIR = re.compile(
    r"(?P<name>[^\W\d_][^=:,;\d]*?)\s*[=:]?\s*(?P<value>[+-]?\d+(?:[.,]\d+)?)"
    r"(?:\s*(?P<unit>°C?|(?:deg|degC|rad|mrad|gon|arcmin|arcsec|C|K|s|ms|min|h)\b))?(?![\w.,°'′:]*\s?[\d'′\"])"
)


def upright(sheet: Sheet) -> Sheet:
    """A sheet with a row for each reading, whatever its shape; one that has such rows as it is.

    In one with a block for each rest rows keep their lines; one that lies on its side has its columns as rows.
    """
    head = list(islice(sheet.rows(), LOOKED_AT))
    if len(head) < LOOKED_AT:
        return _turned(sheet, head) or _flat(sheet, head) or sheet
    return (_flat(sheet, head) and _flat(sheet, list(sheet.rows()))) or sheet


def _turned(sheet: Sheet, rows: list[Row]) -> Sheet | None:
    """A table with names at the left and a column for each position, turned; None where it is none."""
    found: dict[str, int] = {}
    for k, (_, texts) in enumerate(rows):
        label = next((text for text in texts if text.strip()), "")
        column = "" if is_value(label) else heading(label).column
        if column and sum(map(is_value, texts)) + 3 > len([text for text in texts if text.strip()]) > 2:
            if column in found:
                return None
            found[column] = k
    if not {*FORCE, *ANGLES} <= found.keys():
        return None
    first, last = min(found.values()), max(found.values())
    inside = [texts for _, texts in rows[first : last + 1]]
    left = min(next(k for k, text in enumerate(texts) if text.strip()) for texts in inside)
    width = max(map(len, inside))
    columns = [[texts[k] if k < len(texts) else "" for texts in inside] for k in range(left, width)]
    around = [texts for _, texts in [*rows[:first], *rows[last + 1 :]]]
    return replace(sheet, cells=[*around, [], *columns], shape="a column for each position, turned")


def _flat(sheet: Sheet, rows: list[Row]) -> Sheet | None:
    """A table in blocks, each with a heading that says the angles, as one; None where it is none.

    An InputError where a block has no heading: nothing says to which rest its readings belong.
    """
    made: list[tuple[int, dict[str, tuple[str, str]], list[str]]] = []
    said: dict[str, tuple[str, str]] = {}
    names, title, is_inside, blocks, before, without = [""], 0, False, 0, 0, 0
    for line, texts in rows:
        measured = is_data(texts)
        pairs = {} if measured else _pairs(texts)
        if is_inside and (not measured or line > before + 1):
            # a block ends, and what it was said to be does not hold below
            said, is_inside = {}, False
        if pairs:
            said |= pairs
            title = title or line
        elif measured and said:
            blocks += not is_inside
            is_inside = True
            made.append((line, {POSITION: ("Position", str(blocks)), **said}, texts))
        elif measured:
            without = without or line
        elif title and sum(bool(text.strip()) and not is_value(text) for text in texts) > 2:
            names = texts
        before = line
    whole = {column: name for column, (name, _) in made[0][1].items()} if made else {}
    alike = all({column: name for column, (name, _) in of_rest.items()} == whole for _, of_rest, _ in made)
    if blocks < LEAST_BLOCKS or not {*ANGLES} <= whole.keys():
        return None
    if any(heading(name).column in ANGLES for name in names):
        return None
    if not alike:
        line = next(line for line, of_rest, _ in made if {key: name for key, (name, _) in of_rest.items()} != whole)
        raise InputError(
            f"{sheet.path}: row {line}: its heading says other things than those before; say the same in all"
        )
    if without:
        raise InputError(f"{sheet.path}: row {without}: readings below no heading that says their angles")
    cells: list[list[str]] = [[] for _ in range(made[-1][0])]
    for line, texts in rows:
        if line < title:
            cells[line - 1] = texts
    width = max(len(texts) for _, _, texts in made)
    at = made[0][0] - 2
    cells[at] = [*whole.values(), *(names + [""] * width)[: max(width, len(names))]]
    for line, of_rest, texts in made:
        cells[line - 1] = [*(value for _, value in of_rest.values()), *texts]
    return replace(sheet, cells=cells, shape="a block for each rest")


def _pairs(texts: list[str]) -> dict[str, tuple[str, str]]:
    """Column of the record -> name, with its unit, and value: of "alpha = 20 deg" or "alpha [°];20"."""
    found: dict[str, tuple[str, str]] = {}
    cells = [" ".join(text.split()) for text in texts if text.strip()]
    for k, text in enumerate(cells):
        behind = cells[k + 1] if k + 1 < len(cells) else ""
        told = [(part["name"], part["value"], part["unit"] or "") for part in _PAIR.finditer(text)]
        if not told and is_value(behind):
            told = [(text.rstrip(":= "), behind, "")]
        for name, value, unit in told:
            head = heading(name)
            if head.column in OF_A_REST:
                known = unit if not head.unit and known_unit(unit) is not None else ""
                found.setdefault(head.column, (f"{name} [{known}]" if known else name, value))
    return found
