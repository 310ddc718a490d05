"""Decide the meaning of a sheet where its content proves it, and ask all other questions at once."""

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

from ..errors import InputError
from ..records.columns import (
    ANGLES,
    FACE,
    FORCE,
    FORCES,
    INCREMENT,
    KINDS,
    POSES,
    POSITION,
    QUATERNION,
    RATE,
    RAW,
    STRAPDOWN_INCREMENTS,
    STRAPDOWN_RATES,
    STRAPDOWN_VELOCITIES,
    TEXTS,
    VELOCITY,
    RecordKind,
    quoted,
)
from .columns import (
    TRIADS_OF,
    ask_for_each,
    ask_of_instances,
    fields_of_columns,
    take_role,
    without_only_triad,
    without_triads,
)
from .deciding_times import decide_time, origin_of, written_times
from .deciding_units import decide_units
from .gravity import ask_of_sign
from .layout import COMMENT, layout_of, with_sums
from .mapping import OPEN, Mapping
from .names import DATE, SAMPLE, TIMES
from .numbers import (
    Marks,
    bare,
    bits_of_signed,
    parsed_number,
)
from .presets import preset_of
from .ranking import (
    MANY_ROWS,
    bits_of_offset,
    estimates_of_gravity,
    may_be_channel,
    numbers_in,
    zero_of,
)
from .sheet import Sheet, cell
from .understanding import (
    NUMBER,
    STANDING_DEG,
    Field,
    Origin,
    UnderstoodTable,
    ask_of_senses,
)
from .units import ANGLE
from .units import FORCE as FORCE_QUANTITY
from .units import RATE as RATE_QUANTITY

MOST_WORDS = 6
"""Largest number of different words in a column of numbers that a question names."""
MOST_ODD, NOTATION = 2, re.compile(r"\d[.,]\d|^0x|^[\da-fA-F]{4,}$")
"""Largest number of texts in another notation, such as (1.5), 1.5- or 0x1F; more are refused."""
SEEN = 50
"""Number of texts of a column that show decimal marks before its meaning is known."""
NEGATED = re.compile(r"[-−](?=\w)")
"""Begin of the head of a column that may hold the opposite of a channel."""
OTHER_MARK = {".": ",", ",": "."}
"""Decimal mark -> mark between thousands beside it."""


def understood(sheet: Sheet, mapping: Mapping, role: RecordKind | None = None) -> UnderstoodTable:
    """Decide the meaning of a sheet with the given mapping; ask all open questions at once.

    `role` is the kind of record if the file is one of two.
    """
    layout = layout_of(sheet, mapping)
    names = [head.text for head in layout.headings]
    preset = preset_of(mapping, names, [*layout.remarks, *layout.remarks.values()])
    given = mapping
    if preset is not None:
        mapping = preset.filled_in(mapping, names)
    sheet, layout = with_sums(sheet, layout, [mapping.of(column).source for column in FORCE])
    table = UnderstoodTable(sheet, layout, mapping, given=given)
    marks = Marks()
    for text in chain(*(field.texts[:SEEN] for field in table.filled)):
        marks.see(bare(text))
    # until the columns are known
    table.decimal = sheet.stated.decimal or ("," if set(marks.decimal) == {","} else ".")
    if len(marks.decimal) == 1 and OTHER_MARK[table.decimal] in marks.thousands | marks.doubtful:
        table.thousands = OTHER_MARK[table.decimal]
    if sheet.stated.remark:
        table.notes.append(sheet.stated.remark)
    ask_of_instances(table, "" if preset is None else preset.instance)
    if preset is not None:
        units = ", ".join(preset.units.values()) or "as answered"
        table.notes.append(f"columns and units of {preset.name}: {units}")
    # each file is searched for its lines: the next may have more of them
    table.settled = {"encoding": sheet.encoding, "separator": sheet.separator}
    fields = fields_of_columns(table)
    if fields.keys().isdisjoint((TIMES, DATE, *ANGLES)) and table.mapping.of(TIMES).source != "none":
        fields |= written_times(table, [field for field in table.filled if field not in fields.values()])
    if role is None:
        _decide_kind(table, fields)
    else:
        take_role(table, fields, role)
    _decide_marks(table, fields)
    decide_time(table, fields)
    for column, field in fields.items():
        if column in table.kind.known and column not in (TIMES, SAMPLE, DATE):
            table.origins[column] = origin_of(table, column, field)
    decide_units(table)
    _decide_attitude(table)
    _ask_of_words(table)
    _ask_of_integers(table)
    if any("+" in origin.field.head.text for column, origin in table.origins.items() if column in FORCE):
        ask_of_sign(table, [table.origins[FORCE[0]].field])
    for column, origin in table.origins.items():
        ask_of_senses(table, column, origin.field.texts)
        if NEGATED.match(origin.field.head.text) and column not in mapping.columns:
            table.ask(f"columns.{column}.sign", ("-1", "1"), f"{origin.name!r} may be the opposite of {column}")
    _decide_readings(table)
    columns = mapping.model_dump(by_alias=True)["columns"]
    for column, origin in sorted(table.origins.items(), key=lambda entry: entry[1].field.place):
        source = mapping.of(column)
        further = [field.label for field in origin.beside]
        settled = source.model_copy(update={"source": source.source or origin.field.label, "beside": further})
        columns[column] = settled.model_dump(by_alias=True)
    table.settled["columns"] = columns
    return table


def _decide_kind(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the kind of record, and ask for its missing columns."""
    of_table = not fields.keys().isdisjoint(ANGLES)
    of_block = not fields.keys().isdisjoint(RATE + INCREMENT) or RATE_QUANTITY in table.proposed
    left = _channels_left(table, fields, [*fields.values(), *chain(*table.beside.values())])
    if of_block and not of_table:
        _refuse_gyros_alone(table, fields, left)
    name = table.mapping.kind.replace(OPEN, "")
    if not name and not of_table and not of_block and len(left) - 3 < 2:
        left = without_only_triad(table, fields, left)
    # one column that is left is neither two angles nor three gyros
    has_forces = fields.keys() >= set(FORCE) or FORCE_QUANTITY in table.proposed
    are_alone = has_forces and len(left) < 2 and not of_table and not of_block
    if not name and are_alone:
        name = _kind_of_forces(table, fields)

    if not name and not of_table and not of_block:
        # two unknown columns can be angles alone, three can be gyros: the question below decides
        angles = sum(field.quantity == ANGLE for field in table.fields)
        if "position" in fields or len(left) == 2 or angles == 2:
            name = POSITION.name
        elif len(left) == 3:
            name = STRAPDOWN_RATES.name
    required: Sequence[str] | None = None
    if not name:
        if are_alone:
            table.ask("kind", _kinds_of_forces(table), "accelerometers alone")
            name = _kinds_of_forces(table)[0]
        elif of_table == of_block:
            kinds = [POSITION.name, STRAPDOWN_RATES.name]
            why = "the file has both angles of a table and gyros"
            if not of_table:
                kinds += [POSES.name, FORCES.name]
                if len(table.rows) >= MANY_ROWS:
                    kinds = [STRAPDOWN_RATES.name, FORCES.name, POSITION.name, POSES.name]
                why = "the file has neither angles of a table nor gyros"
            table.ask("kind", kinds, why)
            required = FORCE
        if of_block and not of_table:
            name = STRAPDOWN_RATES.name
        elif not are_alone:
            name = POSITION.name
    table.kind = next(kind for kind in KINDS if kind.name == name and kind is not STRAPDOWN_VELOCITIES)
    if name == STRAPDOWN_RATES.name and not fields.keys().isdisjoint(INCREMENT):
        table.kind = STRAPDOWN_INCREMENTS if fields.keys().isdisjoint(VELOCITY) else STRAPDOWN_VELOCITIES
    table.settled["kind"] = name
    missing = [column for column in required or table.kind.required if column not in fields]
    missing = [column for column in missing if column not in ("position", TIMES)]
    if required and len(table.rows) >= MANY_ROWS and not of_table and not of_block:
        missing += RATE
    missing = without_triads(table, missing, fields)
    asked = [column for key, triad in TRIADS_OF.items() if table.is_asked(f"columns.{key}") for column in triad]
    ask_for_each(table, [column for column in missing if column not in asked], left)


def _channels_left(table: UnderstoodTable, fields: dict[str, Field], columns: list[Field]) -> list[Field]:
    """Return the columns that may still be channels or angles; `columns` have a meaning."""
    used = set(columns)
    used.update(table.proposed.get(FORCE_QUANTITY, ()))
    has_forces = fields.keys() >= set(FORCE) or FORCE_QUANTITY in table.proposed
    if has_forces:
        used |= {field for field in table.filled if field.quantity == FORCE_QUANTITY}
        used |= estimates_of_gravity(table, [field for field in table.filled if field not in used])
    return [field for field in table.filled if field not in used and may_be_channel(table, field)]


def _refuse_gyros_alone(table: UnderstoodTable, fields: dict[str, Field], left: list[Field]) -> None:
    """Refuse gyros without accelerometers: no kind of record has them alone."""
    proposed = table.proposed.get(RATE_QUANTITY, ())
    further = [field for field in left if field not in proposed]
    if len(further) < 3 and FORCE_QUANTITY not in table.proposed and fields.keys().isdisjoint(FORCE + VELOCITY):
        file = table.sheet.path
        advice = f"if they are in another file, give both: trihedron import ACCELEROMETERS {file.name}"
        raise InputError(f"{file}: holds gyros alone; a record needs three accelerometers; {advice}")


def _kinds_of_forces(table: UnderstoodTable) -> tuple[str, str]:
    """Return the kinds of accelerometers alone, the likelier first."""
    if len(table.rows) >= MANY_ROWS:
        return FORCES.name, POSES.name
    return POSES.name, FORCES.name


def _kind_of_forces(table: UnderstoodTable, fields: dict[str, Field]) -> str:
    """Return the kind of a table of accelerometers alone: averaged poses, or a series; empty where it may be either."""
    if "position" in fields or (FACE in fields and TIMES not in fields and SAMPLE not in fields):
        return POSES.name
    has_time = not fields.keys().isdisjoint((TIMES, SAMPLE, DATE)) or table.sheet.stated.time
    if has_time or table.is_asked(f"columns.{TIMES}"):
        return FORCES.name
    return ""


def _decide_marks(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the decimal mark and the mark between thousands from numbers that prove them."""
    marks = Marks()
    for text in chain(*(field.texts for column, field in fields.items() if column not in (*TEXTS, DATE))):
        marks.see(bare(text))
    answer = table.mapping.decimal.replace(OPEN, "")
    proven = sorted(marks.decimal)
    if answer or table.sheet.stated.decimal:
        table.decimal = answer or table.sheet.stated.decimal
    elif len(proven) == 2:
        table.ask("decimal", (".", ","), f"{marks.decimal['.']!r} and {marks.decimal[',']!r} both occur")
    elif proven:
        table.decimal = proven[0]
    elif len(marks.thousands) == 1:
        table.decimal = OTHER_MARK[next(iter(marks.thousands))]
    elif marks.doubtful:
        table.decimal, text = next(iter(marks.doubtful.items()))
        with_point, without = text.replace(",", "."), text.replace(",", "").replace(".", "")
        table.ask("decimal", (",", "."), f"{text!r} may be {with_point} or {without}")
    second = OTHER_MARK[table.decimal]
    grouped = (marks.thousands | marks.doubtful).get(second)
    table.thousands = table.mapping.thousands
    if not table.thousands and grouped:
        # the question about the decimal mark also named the other mark
        if second not in marks.thousands and not answer and not table.is_asked("decimal"):
            decimal = next(iter(marks.decimal.values()), "others")
            table.ask("thousands", (second,), f"{grouped!r} beside {decimal!r}: are those thousands?")
            table.thousands = second
        elif second in marks.thousands or answer:
            table.thousands = second
    table.settled |= {"decimal": table.decimal, "thousands": table.thousands}


def _ask_of_integers(table: UnderstoodTable) -> None:
    """Ask for the zero of counts: they are all near 0 or near 65535, or in the middle of a converter's range."""
    channels = {column: table.origins[column] for column in FORCE + RATE if column in table.origins}
    of_counts = {column: origin for column, origin in channels.items() if _is_of_counts(origin) and not origin.offset}
    if table.mapping.integers not in ("", OPEN):
        for column, origin in of_counts.items():
            table.origins[column] = replace(origin, offset=zero_of(table.mapping.integers))
        return
    forces = [column for column in FORCE if column in channels]
    fields = [channels[column].field for column in forces] or list(table.proposed.get(FORCE_QUANTITY, ()))
    if len(fields) == 3 and of_counts.keys() >= set(forces):
        counts = numbers_in(table, fields)
        bits = bits_of_offset(counts)
        if bits:
            answer = f"offset {bits}"
            span = f"from {round(counts.min())} to {round(counts.max())} around {round(zero_of(answer))}"
            why = f"the accelerometers have counts {span}: zero is probably the middle of {bits} bits"
            table.ask("integers", (answer, "unsigned"), why)
            return
    for field in (*(origin.field for origin in channels.values()), *chain(*table.proposed.values())):
        values = table.values(field.texts)
        bits = bits_of_signed(values)
        if bits:
            span = f"from {int(min(values))} to {int(max(values))}"
            why = f"column {field.label!r} has counts {span}, near both ends of {bits} bits"
            table.ask("integers", (f"signed {bits}", "unsigned"), why)
            return


def _is_of_counts(origin: Origin) -> bool:
    """Return True if a column may be in counts: its unit is a sensitivity, or not yet known."""
    return origin.unit is None or origin.unit.per is not None


def _decide_attitude(table: UnderstoodTable) -> None:
    """Decide the direction of a quaternion; ask unless the columns are a record's own."""
    present = [column for column in QUATERNION if column in table.origins]
    answer = table.mapping.attitude
    if len(present) < 4 or answer == "none":
        for column in present:
            del table.origins[column]
        return
    has_own_names = all(table.origins[column].field.head.text == column for column in present)
    is_open = answer in ("", OPEN)
    if is_open and not has_own_names:
        table.ask("attitude", ("body to reference", "reference to body", "none"), "what the quaternion turns")
    if is_open:
        answer = "body to reference"
    table.settled["attitude"] = answer


def _ask_of_words(table: UnderstoodTable) -> None:
    """Ask at once about all words in columns of numbers that are not usual words for a missing number.

    Refuses several numbers in another notation: leaving them out would lose readings.
    """
    if table.is_asked("decimal", "thousands"):
        return
    numeric = {column: origin for column, origin in table.origins.items() if origin.form == NUMBER}
    words: dict[str, str] = {}
    for column, origin in numeric.items():
        line_of = {}
        for line, text in reversed(origin.field.cells):
            if table.reading(column, text) is None:
                line_of[text] = line
        _refuse_notation(table, origin, line_of)
        texts = origin.field.texts
        if texts and len(line_of) == len(set(texts)):
            table.ask(f"columns.{column}", ("NAME",), f"{origin.name!r} holds no numbers, but {quoted(texts[0])}")
            continue
        places = [further.field.place for further in numeric.values() if further is not origin]
        for line, text in origin.field.cells:
            if text in line_of and text not in words and _is_reading(table, line, places):
                words[text] = f"row {line}, {origin.name!r}: {quoted(text)} is not a number{_beside(table, text)}"
    if words:
        # a comma separates answers
        answers = [text[:40] for text in words if "," not in text][:MOST_WORDS] or [next(iter(words))[:40]]
        rows = "it" if len(words) == 1 else "such rows"
        table.ask("missing", (",".join(answers),), f"{next(iter(words.values()))}; this answer leaves {rows} out")


def _refuse_notation(table: UnderstoodTable, origin: Origin, line_of: dict[str, int]) -> None:
    """Refuse numbers of a column in another notation; `line_of` has its texts that are not numbers, the first last."""
    written = [text for text in line_of if NOTATION.search(text) and not text.startswith(COMMENT)]
    if len(written) > MOST_ODD:
        first = written[-1]
        what = f"row {line_of[first]}, column {origin.name!r}: {quoted(first)} is not a number{_beside(table, first)}"
        also = f"nor are {len(written) - 1} others; write plain decimal numbers, a minus in front"
        raise InputError(f"{table.sheet.path}: {what}, {also}")


def _is_reading(table: UnderstoodTable, line: int, places: list[int]) -> bool:
    """Return True if a row has a number in one of these fields and is not a comment."""
    texts = next(texts for row, texts in table.rows if row == line)
    is_comment = texts[0].strip().startswith(COMMENT) and not table.is_marked
    return not is_comment and any(table.value(cell(texts, place)) is not None for place in places)


def _beside(table: UnderstoodTable, text: str) -> str:
    if parsed_number(bare(text), OTHER_MARK[table.decimal]) is None:
        return ""
    return f" with decimal {table.decimal!r}"


def _decide_readings(table: UnderstoodTable) -> None:
    """Decide whether rows at one position are readings of one rest, by their numbers; ask if rows are stationary."""
    mapping = table.mapping
    table.settled["readings"] = mapping.readings.replace(OPEN, "")
    if table.kind not in (POSITION, RAW) or mapping.kind == RAW.name or not table.origins.keys() >= set(ANGLES):
        return
    if mapping.readings in ("average", "each") or "position" in table.origins:
        return
    before: list[float] = []
    still = 0
    for _, texts in table.rows:
        origins = [table.origins[column] for column in ANGLES]
        values = [table.reading(c, cell(texts, o.field.place)) for c, o in zip(ANGLES, origins, strict=True)]
        if None not in values:
            angles = [v * (o.unit.factor if o.unit else 1.0) for v, o in zip(values, origins, strict=True)]  # type: ignore
            apart = [abs((a - b + 180.0) % 360.0 - 180.0) for a, b in zip(angles, before, strict=False)]
            still += max(apart, default=math.inf) <= STANDING_DEG
            before = angles
    if still:
        why = f"{still} rows have the position of the row before, and positions have no numbers"
        table.ask("readings", ("average", "each"), f"{why}; a time series with its moves is --set 'kind=raw record'")
