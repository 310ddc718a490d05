"""Convert rows of texts to the columns of a record: its units, times from the first row, averaged readings."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...models.arrays import Bools, Floats, Ints
from ..errors import InputError
from ..records.columns import (
    ANGLES,
    FORCE,
    INCREMENT,
    POSES,
    POSITION,
    QUATERNION,
    RATE,
    TEMPERATURE,
    TEXTS,
    Comments,
    FileColumns,
    Layout,
    RecordError,
    faults,
    quoted,
    with_force,
)
from ..records.read import significant_digits, written_resolution
from .converted_times import counted_times, numbered_times, written_times
from .frames import MAY_LACK, ask_of_gaps, numeric_frame, values_of_frame
from .layout import COMMENT
from .mapping import OPEN, plural
from .names import DATE, QUANTITY_OF, SAMPLE, TIMES
from .numbers import (
    BLANKS,
    bare,
    bits_of_signed,
    is_missing,
    numbers_of,
    sexagesimal,
    unit_behind,
)
from .understanding import NAME, NUMBER, STANDING_DEG, UnderstoodTable, ask_of_senses
from .units import DEGREE, OPPOSITE, TIME, is_unknown_behind, known_unit, scaled_unit, sense_behind

DIGITS_OF = 2000
"""Number of rows that decide how finely numbers are written."""
RESOLUTIONS = {"mps2": FORCE, "deg": ANGLES, "degC": (TEMPERATURE,)}
"""LaboratoryUnit in the names of columns -> columns whose last digit is examined."""
FILLERS = (999.0, 9999.0, 99999.0, 999999.0)
"""Sizes of numbers that loggers write for a missing measurement."""


@dataclass
class Conversion:
    """Columns of the record, their lines in the file, and notes on the conversion.

    Attributes
    ----------
    numbers : dict
        column -> values (N,) in the record's units
    words : dict
        column of words, as mounting and face -> its texts
    row : ndarray of int, shape (N,)
        lines of the file; the first line of averaged rows
    left_out : dict
        reason -> lines of the rows left out
    resolution : dict
        column group ("mps2", "deg", "degC") -> half a last digit as written, in the record's unit
    readings : ndarray of int, shape (N,), or None
        readings averaged in each row
    scatter : ndarray, shape (3,), or None
        standard error of a mean of them, pooled over the rests [m/s²]
    """

    numbers: dict[str, Floats] = field(default_factory=dict)
    words: dict[str, list[str]] = field(default_factory=dict)
    row: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    left_out: dict[str, list[int]] = field(default_factory=dict)
    resolution: dict[str, float] = field(default_factory=dict)
    readings: Ints | None = None
    scatter: Floats | None = None
    notes: list[str] = field(default_factory=list)


def converted(table: UnderstoodTable) -> Conversion:
    """Convert the rows of an understood sheet to columns; return no columns if they raise another question.

    Raises InputError with the row and column that cannot be converted.
    """
    frame = numeric_frame(table)
    given: dict[str, Floats] = {}
    lines: Sequence[int] = []
    if frame is not None:
        given, places, left_out = values_of_frame(table, frame)
        texts = {column: origin.field.texts[:DIGITS_OF] for column, origin in table.origins.items()}
    else:
        texts, lines, left_out = _texts(table)
        places = np.array(lines, dtype=np.int_)
    if table.questions:
        return Conversion(left_out=left_out)
    if not len(places):
        raise InputError(f"{table.sheet.path}: no row has all that a {table.kind.name} needs")
    numbers: dict[str, Floats] = {}
    for column, origin in table.origins.items():
        if column == DATE or column in TEXTS:
            continue
        if origin.form == NAME:
            labels = np.array(texts[column])
            numbers[column] = np.cumsum(np.append(True, labels[1:] != labels[:-1]))
        elif origin.form != NUMBER:
            numbers[column] = written_times(table, texts, lines)
        else:
            values = given[column] if given else _values(table, column, texts[column], lines)
            if column != TIMES:
                numbers[column] = _converted(table, column, values)
            elif given:
                numbers[TIMES] = counted_times(table, values)
            else:
                numbers[TIMES] = numbered_times(table, texts[TIMES], values)
    if table.kind is POSES:
        numbers.setdefault("position", np.arange(1.0, len(lines) + 1.0))
    elif TIMES not in numbers:
        period = scaled_unit(table.mapping.units.get(TIME) or table.sheet.stated.time or "1 s")
        # rows that are left out take their time
        before = np.searchsorted(left_out.get("a number is missing", ()), places)
        numbers[TIMES] = (np.arange(len(places), dtype=np.float64) + before) * (
            1.0 if period is None else period.factor
        )
    if QUATERNION[0] in numbers and table.whole_mapping.attitude == "reference to body":
        for column in QUATERNION[1:]:
            numbers[column] = -numbers[column]
    words = {column: [text.strip() for text in texts[column]] for column in TEXTS if column in texts}
    resolutions = _resolutions(table, texts) if table.sheet.frame is None or frame is None else {}
    conversion = Conversion(numbers, words, places, left_out, resolutions)
    if table.kind is POSITION:
        _average(table, conversion)
    return conversion


def _converted(table: UnderstoodTable, column: str, values: Floats) -> Floats:
    """Return numbers of a file (N,) in the unit of a column of the record."""
    origin = table.origins[column]
    _ask_of_fillers(table, column, values)
    values = (_counts(table, column, values) - origin.offset) * origin.sign
    if origin.unit is None:
        return values
    # Units of angle give degrees; only the columns of increments are in radians.
    size = DEGREE if column in INCREMENT else 1.0
    return values * (origin.unit.factor * size) + origin.unit.offset


def _texts(table: UnderstoodTable) -> tuple[dict[str, list[str]], list[int], dict[str, list[int]]]:
    """Return the texts of the columns, row by row, and their lines; leave out rows without a number, by reason."""
    missing, marked, origins = table.mapping.missing, table.is_marked, table.origins
    # readings side by side become rows that are otherwise alike
    places = {column: [field.place for field in (origin.field, *origin.beside)] for column, origin in origins.items()}
    turns = [
        {column: beside[k % len(beside)] for column, beside in places.items()}
        for k in range(max(map(len, places.values()), default=1))
    ]
    numeric = [column for column, origin in origins.items() if origin.form == NUMBER]
    texts: dict[str, list[str]] = {column: [] for column in origins}
    lines: list[int] = []
    left_out: dict[str, list[int]] = {}
    empty: Counter[str] = Counter()
    count = 0
    for line, row in table.sheet.rows(table.layout.first, table.layout.last or None):
        is_comment = not marked and row[0].lstrip().startswith(COMMENT) and not is_missing(row[0], missing)
        for turn in turns:
            count += 1
            cells = {column: row[place] if place < len(row) else "" for column, place in turn.items()}
            lacking, why = [], "comments" if is_comment else ""
            # a text that ends with a digit is not missing
            if not why and (missing or not all(text[-1:].isdigit() for text in cells.values())):
                lacking = [c for c, text in cells.items() if c not in MAY_LACK and is_missing(text, missing)]
                if lacking:
                    why = "a number is missing"
                elif all(table.reading(column, cells[column]) is None for column in numeric):
                    why = "words, no numbers"
            if why:
                left_out.setdefault(why, []).append(line)
                empty.update(lacking)
                continue
            lines.append(line)
            for column, text in cells.items():
                texts[column].append(text)
    if ask_of_gaps(table, empty, len(left_out.get("a number is missing", ())), count):
        return texts, [], left_out
    return texts, lines, left_out


def _values(table: UnderstoodTable, column: str, texts: list[str], lines: Sequence[int]) -> Floats:
    """Return the numbers of a column's cells (N,), in the file's unit.

    Raises InputError if a cell is not a number or has another unit.
    """
    origin, at = table.origins[column], f"{table.sheet.path}: row"
    first = origin.field.unit
    for text, line in zip(texts, lines, strict=True):
        if text[-1:].isdigit() or table.value(text) is None:
            continue
        if is_unknown_behind(text):
            what = f"column {origin.name!r}: {quoted(text.strip())}: {unit_behind(text)!r} is not a known unit"
            raise InputError(f"{at} {line}, {what}; write plain numbers, or --set columns.{column}=none leaves it out")
        if sense_behind(text, QUANTITY_OF.get(column, "")):
            continue
        unit = known_unit(unit_behind(text))
        if first is not None and unit is not None and unit != first:
            what = f"{quoted(text.strip())} is in another unit than {origin.name!r} or the rows before"
            raise InputError(f"{at} {line}: {what}; one unit for a column is needed")
        first = first or unit
    plain = None if column in QUATERNION else numbers_of(texts, table.decimal)
    if plain is not None:
        return np.array(plain)
    values = []
    for text, line in zip(texts, lines, strict=True):
        value = np.nan if column in QUATERNION and is_missing(text) else table.reading(column, text)
        if value is None:
            what = f"{quoted(text.strip())} is not a number with decimal {table.decimal!r}"
            hint = "--set missing=TEXT leaves such rows out"
            raise InputError(f"{at} {line}, column {origin.name!r}: {what}; {hint}")
        values.append(value)
    return np.array(values) * _signs(table, column, texts, lines)


def _signs(table: UnderstoodTable, column: str, texts: Sequence[str], lines: Sequence[int]) -> Floats:
    """Return +1 or -1 for each cell (N,) from the mark behind its number, CW or CCW.

    Raises InputError if some cells have no mark.
    """
    origin, positive = table.origins[column], table.mapping.of(column).positive
    senses = [sense_behind(text, QUANTITY_OF.get(column, "")) for text in texts]
    if positive in ("", OPEN):
        ask_of_senses(table, column, texts)
    if positive in ("", OPEN) or not any(senses):
        return np.ones(len(texts))
    for text, sense, line in zip(texts, senses, lines, strict=True):
        if sense not in (positive, OPPOSITE[positive]) and table.value(text) != 0.0:
            what = f"column {origin.name!r}: {quoted(text.strip())} is neither {positive} nor {OPPOSITE[positive]}"
            raise InputError(f"{table.sheet.path}: row {line}, {what}, but columns.{column}.positive has another sense")
    return np.where(np.array(senses) == OPPOSITE[positive], -1.0, 1.0)


def _ask_of_fillers(table: UnderstoodTable, column: str, values: Floats) -> None:
    """Ask whether numbers as -9999, unlike all others of a column (N,), stand for missing measurements."""
    if "none" in table.mapping.missing:
        return
    is_filler = np.isin(np.abs(values), FILLERS)
    others = values[~is_filler]
    if len(others) in (0, len(values)):
        return
    filler = float(values[is_filler][0])
    if np.mean(others != np.round(others)) > 0.5 or abs(filler) > 2.0 * np.abs(others).max():
        origin = table.origins[column]
        written = (text.strip() for text in origin.field.texts if table.value(text) == filler)
        text, rows = next(written, str(round(filler))), plural(int(is_filler.sum()), "row")
        why = f"{origin.name!r} has {text!r} in {rows}: no measurement, or a number (none)"
        table.ask("missing", (text, "none"), why)


def _counts(table: UnderstoodTable, column: str, values: Floats) -> Floats:
    """Return the counts of a channel (N,); restore the sign of two's complement counts written without one."""
    kind = table.mapping.integers
    if column not in FORCE + RATE:
        return values
    if kind in ("", OPEN):
        bits = bits_of_signed(values.tolist())
        if bits:
            why = f"{table.origins[column].name!r} has counts near both ends of {bits} bits"
            table.ask("integers", (f"signed {bits}", "unsigned"), why)
    is_signed = kind.startswith("signed")
    if not is_signed and (not kind.startswith("offset") or not table.origins[column].offset):
        return values
    size = 2.0 ** int(kind.split()[1])
    if values.min() < 0.0 or values.max() >= size:
        what = f"{table.origins[column].name!r} has numbers from {values.min():g} to {values.max():g}"
        raise InputError(f"{table.sheet.path}: integers = {kind!r}: {what}, not from 0 to {int(size) - 1}")
    if not is_signed:
        return values
    return np.where(values >= 0.5 * size, values - size, values)


def _resolutions(table: UnderstoodTable, texts: dict[str, list[str]]) -> dict[str, float]:
    """Return half a last digit as written, in the record's units, by the unit in the columns' names."""
    resolutions = {}
    for unit, columns in RESOLUTIONS.items():
        sizes = [_resolution(table, column, texts[column]) for column in columns if column in texts]
        if max(sizes, default=0.0) > 0.0:
            resolutions[unit] = max(sizes)
    return resolutions


def _resolution(table: UnderstoodTable, column: str, texts: Sequence[str]) -> float:
    unit = table.origins[column].unit
    first = [bare(text).replace("−", "-") for text in texts[:DIGITS_OF]]
    if any(table.value(text) is None for text in first):
        # seconds of an arc, or minutes if there are none
        decimals = max(len(text.rstrip("\"″”s'′ ").replace(",", ".").partition(".")[2]) for text in first)
        parts = max(len(sexagesimal_parts(text)) for text in first)
        return 0.5 * 10.0**-decimals / 60.0 ** (parts - 1)
    unmarked = str.maketrans(table.decimal, ".", BLANKS + table.thousands)
    digits = max((significant_digits(text.translate(unmarked)) for text in first), default=0)
    largest = max(abs(table.value(text) or 0.0) for text in first)
    return written_resolution(largest, digits) * (unit.factor if unit is not None else 1.0)


def sexagesimal_parts(text: str) -> list[str]:
    """Return degrees, minutes and seconds of an angle, as texts."""
    if sexagesimal(text) is None:
        return [text]
    return "".join(c if c.isdigit() or c in ".," else " " for c in text).split()


def _average(table: UnderstoodTable, conversion: Conversion) -> None:
    """Average to one row for each rest: consecutive rows with the same number, or at the same angles."""
    numbers = conversion.numbers
    numbered, readings = "position" in numbers, table.mapping.readings
    if numbered and readings != "each":
        new = np.diff(numbers["position"], prepend=np.nan) != 0.0
    elif readings == "average" and not numbered:
        new = _moved(numbers)
    else:
        new = np.diff(conversion.row, prepend=-1) != 0
    begins = np.flatnonzero(new)
    sizes = np.diff(np.append(begins, len(new)))
    wrong = np.flatnonzero(_moved(numbers) & ~new)
    if numbered and len(wrong):
        line = int(conversion.row[wrong[0]])
        what = "the angles differ from the row before, which has the same number of a position"
        raise InputError(f"{table.sheet.path}: row {line}: {what}; --set readings=each takes every row for a rest")
    means = {name: _means(name, values, begins, sizes) for name, values in numbers.items()}
    positions = means.get("position", np.zeros(1))
    if np.any(np.diff(positions) <= 0) or np.any((positions < 1) | (positions != np.floor(positions))):
        means["position"] = np.arange(1.0, len(begins) + 1)
        conversion.notes.append("positions are numbered in the order of the rows")
    if sizes.max() > 1:
        conversion.readings = sizes
        conversion.scatter = _scatter(numbers, means, sizes)
    conversion.numbers, conversion.row = means, conversion.row[begins]
    for column, texts in conversion.words.items():
        conversion.words[column] = np.array(texts)[begins].tolist()


def _moved(numbers: dict[str, Floats]) -> Bools:
    """Return a mask of the rows (N,) whose angles differ from the previous row's."""
    moved = np.zeros(len(numbers[ANGLES[0]]), dtype=bool)
    moved[0] = True
    for name in ANGLES:
        steps = (np.diff(numbers[name]) + 180.0) % 360.0 - 180.0
        moved[1:] |= np.abs(steps) > STANDING_DEG
    return moved


def _means(name: str, values: Floats, begins: Ints, sizes: Ints) -> Floats:
    """Return means over the rests; an angle's mean is taken about its first reading, in case it passes 0 or ±180."""
    first = values[begins]
    if sizes.max() == 1 or name == "position":
        return first
    apart = values - np.repeat(first, sizes)
    if name in ANGLES:
        apart = (apart + 180.0) % 360.0 - 180.0
    return first + np.add.reduceat(apart, begins) / sizes


def _scatter(numbers: dict[str, Floats], means: dict[str, Floats], sizes: Ints) -> Floats:
    """Return the standard error of a rest's mean for each accelerometer (3,) [m/s²]: scatter pooled over all rests."""
    squares = [np.sum((numbers[name] - np.repeat(means[name], sizes)) ** 2) for name in FORCE]
    return np.sqrt(np.array(squares) / np.sum(sizes - 1) * np.mean(1.0 / sizes))


def record_columns(table: UnderstoodTable, conversion: Conversion) -> FileColumns:
    """Return the columns as a record's; refuse the first that no record of its kind can have, with the file's row."""
    numbers, kind, sizes = conversion.numbers, table.kind, conversion.resolution
    present = [name for name in kind.known if name in numbers or name in conversion.words]
    scatter = () if conversion.scatter is None else tuple(conversion.scatter.tolist())
    columns = with_force(
        FileColumns(
            table.sheet.path,
            Layout(kind, tuple(present), ()),
            {name: numbers[name] for name in present if name not in conversion.words},
            {name: tuple(conversion.words[name]) for name in present if name in conversion.words},
            conversion.row,
            sizes.get("mps2", 0.0),
            sizes.get("deg", 0.0),
            sizes.get("degC", 0.0),
            Comments(scatter=scatter),
        )
    )
    for fault in faults(columns):
        raise RecordError(fault.path, fault.row, fault.column, fault.what + _hint(table, fault))
    return columns


def _hint(table: UnderstoodTable, fault: RecordError) -> str:
    """Return advice on a fault of a column: another unit, or times from another source."""
    origin = table.origins.get(TIMES)
    if fault.column == TIMES and origin is not None and origin.field.head.column == SAMPLE:
        return "; where the counter begins again or stands: --set columns.sample=none and --set 'units.time=100 Hz'"
    if fault.column == TIMES and "repeats" in fault.what:
        instead = "time=order" if table.kind is POSITION else "'units.time=100 Hz'"
        return f"; where times are written too coarsely: --set columns.time_s=none and --set {instead}"
    if "gravity" in fault.what:
        return "; --set units.force=UNIT states their unit"
    return ""
