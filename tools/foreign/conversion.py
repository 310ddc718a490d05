"""Rows of texts as the columns of a record: numbers in its units, times from the first row, readings averaged."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..records.columns import (
    ANGLES,
    FORCE,
    INCREMENT,
    MOUNTING,
    POSITION,
    QUATERNION,
    TEMPERATURE,
    Columns,
    Layout,
    RecordError,
    faults,
    quoted,
    with_force,
)
from ..records.comments import Comments
from ..records.read import significant_digits, written_resolution
from .layout import COMMENT
from .mapping import OPEN
from .names import DATE, SAMPLE, TIMES
from .numbers import BLANKS, bare, clock, is_missing, moment, numbers_of, sexagesimal, unit_behind
from .understanding import CLOCK, NAME, NUMBER, STANDING_DEG, Understanding, reading
from .units import DEGREE, TIME, known_unit, unit_of

DIGITS_OF = 2000
"""Rows from which it is seen how finely numbers are written."""
MOST_LEFT_OUT = 0.2
"""Part of the rows that may lack a number before it is asked what to do with them."""
DAY = 86400.0
EPOCH = 1e8
"""Times above that many seconds count from long ago: the first row is taken off, whose digits doubles would lose."""


@dataclass
class Conversion:
    """Columns of the record, the lines they are from, and what was done on the way.

    Attributes
    ----------
    numbers : dict
        column -> values (N,) in the record's units
    names : list of str
        mountings
    row : ndarray of int, shape (N,)
        lines of the file; of averaged rows the first
    left_out : dict
        why -> lines of the rows left out
    resolution : dict
        column group ("mps2", "deg", "degC") -> half a last digit as written, in the record's unit
    readings : ndarray of int, shape (N,), or None
        readings averaged in each row
    scatter : ndarray, shape (3,), or None
        standard error of a mean of them, pooled over the rests [m/s²]
    """

    numbers: dict[str, NDArray[np.float64]]
    names: list[str]
    row: NDArray[np.int_]
    left_out: dict[str, list[int]] = field(default_factory=dict)
    resolution: dict[str, float] = field(default_factory=dict)
    readings: NDArray[np.int_] | None = None
    scatter: NDArray[np.float64] | None = None
    notes: list[str] = field(default_factory=list)


def converted(found: Understanding) -> Conversion:
    """The rows of a sheet that is understood as columns, nothing where they bring up another question.

    An InputError names the row and column that cannot be.
    """
    texts, lines, left_out = _texts(found)
    if found.questions:
        return Conversion({}, [], np.zeros(0, dtype=np.int64), left_out)
    if not lines:
        raise InputError(f"{found.sheet.path}: no row has all that a {found.kind.name} needs")
    numbers: dict[str, NDArray[np.float64]] = {}
    for column, taken in found.taken.items():
        if column in (MOUNTING, DATE):
            continue
        if taken.form == NAME:
            numbers[column] = np.cumsum(
                [k == 0 or text != texts[column][k - 1] for k, text in enumerate(texts[column])]
            )
            continue
        if column == TIMES:
            numbers[column] = _times(found, texts, lines)
            continue
        values, unit = _values(found, column, texts[column], lines), taken.unit
        values = (values - taken.offset) * taken.sign
        # Units of angles give degrees; of all columns those of increments alone are in radians.
        size = DEGREE if column in INCREMENT else 1.0
        numbers[column] = values if unit is None else values * (unit.factor * size) + unit.offset
    if TIMES not in numbers:
        unit = unit_of(found.given.units.get(TIME) or found.sheet.stated.time or "1 s")
        numbers[TIMES] = np.arange(len(lines), dtype=np.float64) * (unit.factor if unit is not None else 1.0)
    if QUATERNION[0] in numbers and found.mapping.attitude == "reference to body":
        numbers |= {column: -numbers[column] for column in QUATERNION[1:]}
    made = Conversion(numbers, [text.strip() for text in texts.get(MOUNTING, [])], np.array(lines), left_out)
    made.resolution = _resolutions(found, texts)
    if found.kind is POSITION:
        _average(found, made)
    return made


def _texts(found: Understanding) -> tuple[dict[str, list[str]], list[int], dict[str, list[int]]]:
    """The texts of the columns taken, row by row, and their lines; rows without a number are left out, by reason."""
    layout, also = found.layout, found.given.missing
    columns = list(found.taken)
    # readings side by side are rows of their own, with all else alike
    every = [(taken.field, *taken.beside) for taken in found.taken.values()]
    turns = [[fields[k % len(fields)] for fields in every] for k in range(max(map(len, every), default=1))]
    numeric = [column for column, taken in found.taken.items() if taken.form == NUMBER]
    rows: list[list[str]] = []
    lines: list[int] = []
    left_out: dict[str, list[int]] = {}
    empty: dict[str, int] = {}
    read = found.sheet.rows(layout.first, layout.last or None)
    marked = found.is_marked
    for line, row, places in ((line, row, places) for line, row in read for places in turns):
        if not marked and row[0].lstrip().startswith(COMMENT) and not is_missing(row[0], also):
            left_out.setdefault("comments", []).append(line)
            continue
        try:
            cells = [row[place] for place in places]
        except IndexError:
            cells = [row[place] if place < len(row) else "" for place in places]
        # what ends with a digit is not missing
        if also or not all(text[-1:].isdigit() for text in cells):
            named = dict(zip(columns, cells, strict=True))
            missing = [c for c, text in named.items() if is_missing(text, also) and c not in QUATERNION]
            if missing:
                left_out.setdefault("a number is missing", []).append(line)
                for column in missing:
                    empty[column] = empty.get(column, 0) + 1
                continue
            if all(reading(found, column, named[column]) is None for column in numeric):
                left_out.setdefault("words, no numbers", []).append(line)
                continue
        lines.append(line)
        rows.append(cells)
    texts = dict(zip(columns, map(list, zip(*rows, strict=True)), strict=True)) if rows else {c: [] for c in columns}
    count = len(lines) + sum(map(len, left_out.values()))
    if len(left_out.get("a number is missing", ())) > MOST_LEFT_OUT * count and found.given.incomplete in ("", OPEN):
        worst = max(empty, key=lambda column: empty[column])
        why = f"{empty[worst]} of {count} rows have no number in {found.taken[worst].said!r}"
        if worst in (*found.kind.optional, DATE):
            found.ask(f"columns.{worst}", ("none",), f"{why}; --set 'incomplete=leave out' leaves out the rows")
        else:
            found.ask("incomplete", ("leave out",), why)
        return texts, [], left_out
    return texts, lines, left_out


def _values(found: Understanding, column: str, texts: list[str], lines: Sequence[int]) -> NDArray[np.float64]:
    """The numbers of a column's cells (N,), in the file's unit."""
    _refuse_units(found, column, texts, lines)
    plain = None if column in QUATERNION else numbers_of(texts, found.decimal)
    if plain is not None:
        return np.array(plain)
    return np.array([_value(found, column, text, line) for text, line in zip(texts, lines, strict=True)])


def _refuse_units(found: Understanding, column: str, texts: list[str], lines: Sequence[int]) -> None:
    """Refuse numbers of a column behind which different units stand, or another than in its head."""
    head, taken = found.layout.headings[found.taken[column].field], found.taken[column]
    first = known_unit(head.unit)
    for text, line in zip(texts, lines, strict=True):
        if text[-1:].isdigit() or found.value(text) is None:
            continue
        unit = known_unit(unit_behind(text))
        if first is not None and unit is not None and unit != first:
            what = f"{quoted(text.strip())} is in another unit than {taken.said!r} or the rows before"
            raise InputError(f"{found.sheet.path}: row {line}: {what}; one unit for a column is needed")
        first = first or unit


def _value(found: Understanding, column: str, text: str, line: int) -> float:
    """The number of a cell; an InputError where it is none."""
    if column in QUATERNION and is_missing(text):
        return np.nan
    value = found.value(text) if column not in ANGLES else reading(found, column, text)
    if value is None:
        said = found.taken[column].said
        what = f"{quoted(text.strip())} is no number with decimal {found.decimal!r}"
        raise InputError(
            f"{found.sheet.path}: row {line}, column {said!r}: {what}; --set missing=TEXT leaves such rows out"
        )
    return value


def _times(found: Understanding, texts: dict[str, list[str]], lines: Sequence[int]) -> NDArray[np.float64]:
    """Times [s]: as written where they are numbers, else from the first row on."""
    taken = found.taken[TIMES]
    form, order = found.mapping.clock, found.mapping.dates or "day-first"
    if taken.form == NUMBER:
        assert taken.unit is not None
        values = _values(found, TIMES, texts[TIMES], lines)
        if np.abs(values * taken.unit.factor).max() > EPOCH:
            values = values - values[0]
            found.notes.append("times count from the first row")
        return values * taken.unit.factor
    read = clock if taken.form == CLOCK else moment
    values = np.zeros(len(lines))
    for k, (text, line) in enumerate(zip(texts[TIMES], lines, strict=True)):
        at = clock(text, form) if read is clock else moment(text, order, form)
        if at is not None and DATE in texts:
            on = moment(texts[DATE][k], order)
            at = None if on is None else at + on
        if at is None:
            shown = quoted(text.strip())
            raise InputError(
                f"{found.sheet.path}: row {line}, column {taken.said!r}: {shown} is no time like those before"
            )
        values[k] = at
    found.notes.append("times count from the first row")
    values = values - values[0]
    if taken.form == CLOCK and DATE not in texts:
        steps = np.diff(values, prepend=values[0])
        nights = np.cumsum(steps < -0.5 * DAY)
        if nights.any():
            found.notes.append(f"midnight passes {int(nights[-1])} time{'s' if nights[-1] > 1 else ''}")
        values = values + DAY * nights
    return values


def _resolutions(found: Understanding, texts: dict[str, list[str]]) -> dict[str, float]:
    """Half a last digit of what was written, in the record's units, by the unit in their names."""
    groups = {"mps2": FORCE, "deg": ANGLES, "degC": (TEMPERATURE,)}
    result = {}
    for name, columns in groups.items():
        sizes = [_resolution(found, column, texts[column]) for column in columns if column in found.taken]
        if sizes and max(sizes) > 0.0:
            result[name] = max(sizes)
    return result


def _resolution(found: Understanding, column: str, texts: Sequence[str]) -> float:
    unit = found.taken[column].unit
    factor = unit.factor if unit is not None else 1.0
    some = [bare(text).replace("−", "-") for text in islice(texts, DIGITS_OF)]
    values = [found.value(text) for text in some]
    if any(value is None for value in values):
        # seconds of an arc, or minutes where there are none
        decimals = [len(text.rstrip("\"″”s'′ ").replace(",", ".").partition(".")[2]) for text in some]
        parts = [len([p for p in sexagesimal_parts(text) if p]) for text in some]
        return 0.5 * 10.0 ** -max(decimals, default=0) / 60.0 ** (max(parts, default=1) - 1)
    plain = ["".join(c for c in text if c not in BLANKS + found.thousands).replace(found.decimal, ".") for text in some]
    digits = max(map(significant_digits, plain), default=0)
    return written_resolution(max(abs(value) for value in values if value is not None), digits) * factor


def sexagesimal_parts(text: str) -> list[str]:
    """Degrees, minutes and seconds of an angle, as texts."""
    if sexagesimal(text) is None:
        return [text]
    return "".join(c if c.isdigit() or c in ".," else " " for c in text).split()


def _average(found: Understanding, made: Conversion) -> None:
    """One row for each rest: rows that follow one another with the same number, or at the same angles, are averaged."""
    numbers, count = made.numbers, len(made.row)
    numbered = "position" in numbers
    rows = np.diff(made.row, prepend=-1) != 0
    if numbered:
        new = rows if found.given.readings == "each" else np.diff(numbers["position"], prepend=np.nan) != 0.0
    elif found.given.readings == "average":
        new = _moved(numbers)
    else:
        new = rows
    begins = np.flatnonzero(new)
    sizes = np.diff(np.append(begins, count))
    if numbered:
        _refuse_moves(found, made, new)
    means = {name: _means(name, values, begins, sizes) for name, values in numbers.items()}
    kept = means.get("position", np.zeros(0))
    if not numbered or np.any(np.diff(kept) <= 0) or np.any((kept < 1) | (kept != np.floor(kept))):
        means["position"] = np.arange(1.0, len(begins) + 1)
        made.notes.append("positions are numbered in the order of the rows")
    if sizes.max() > 1:
        made.readings = sizes
        made.scatter = _scatter(numbers, means, sizes)
    made.numbers = means
    made.row, made.names = made.row[begins], [made.names[k] for k in begins] if made.names else []


def _moved(numbers: dict[str, NDArray[np.float64]]) -> NDArray[np.bool_]:
    """Rows (N,) whose angles are others than those of the row before."""
    moved = np.zeros(len(numbers[ANGLES[0]]), dtype=bool)
    moved[0] = True
    for name in ANGLES:
        steps = (np.diff(numbers[name]) + 180.0) % 360.0 - 180.0
        moved[1:] |= np.abs(steps) > STANDING_DEG
    return moved


def _refuse_moves(found: Understanding, made: Conversion, new: NDArray[np.bool_]) -> None:
    """Refuse readings of one number whose angles differ: they are no readings of one rest."""
    wrong = np.flatnonzero(_moved(made.numbers) & ~new)
    if len(wrong):
        line = int(made.row[wrong[0]])
        what = "the angles differ from the row before, which has the same number of a position"
        raise InputError(f"{found.sheet.path}: row {line}: {what}; --set readings=each takes every row for a rest")


def _means(
    name: str, values: NDArray[np.float64], begins: NDArray[np.int_], sizes: NDArray[np.int_]
) -> NDArray[np.float64]:
    """Means over the rests; angles about that of the first reading, where they pass 0 or ±180."""
    first = values[begins]
    if sizes.max() == 1 or name == "position":
        return first
    apart = values - np.repeat(first, sizes)
    if name in ANGLES:
        apart = (apart + 180.0) % 360.0 - 180.0
    return first + np.add.reduceat(apart, begins) / sizes


def _scatter(
    numbers: dict[str, NDArray[np.float64]], means: dict[str, NDArray[np.float64]], sizes: NDArray[np.int_]
) -> NDArray[np.float64]:
    """Standard error of a rest's mean for each accelerometer (3,) [m/s²]: scatter pooled over all rests."""
    squares = np.array([np.sum((numbers[name] - np.repeat(means[name], sizes)) ** 2) for name in FORCE])
    return np.sqrt(squares / np.sum(sizes - 1) * np.mean(1.0 / sizes))


def record_columns(found: Understanding, made: Conversion) -> Columns:
    """The columns as a record's; the first that no record of its kind could have is refused, with the file's row."""
    kind = found.kind
    present = tuple(name for name in kind.known if name in made.numbers or (name == MOUNTING and made.names))
    sizes = made.resolution
    columns = with_force(
        Columns(
            found.sheet.path,
            Layout(kind, present, ()),
            {name: made.numbers[name] for name in present if name != MOUNTING},
            tuple(made.names) if MOUNTING in present else None,
            made.row,
            sizes.get("mps2", 0.0),
            sizes.get("deg", 0.0),
            sizes.get("degC", 0.0),
            Comments(scatter=() if made.scatter is None else tuple(made.scatter.tolist())),
        )
    )
    for fault in faults(columns):
        hint = "; --set units.force=UNIT says what readings are in" if "gravity" in fault.what else ""
        if fault.column == TIMES and "repeats" in fault.what:
            hint = "; where times are written too coarsely: --set columns.time_s=none and "
            hint += "--set time=order" if kind is POSITION else "--set 'units.time=100 Hz'"
        counted = TIMES in found.taken and found.layout.headings[found.taken[TIMES].field].column == SAMPLE
        if fault.column == TIMES and counted:
            hint = "; where the counter begins again or stands: --set columns.sample=none and --set 'units.time=100 Hz'"
        raise RecordError(fault.path, fault.row, fault.column, fault.what + hint)
    return columns
