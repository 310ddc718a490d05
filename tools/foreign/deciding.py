"""Decide the meaning of a sheet where its content proves it, and ask all other questions at once."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError, nearest
from ..records.columns import (
    ANGLES,
    APPROACH,
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
    UP,
    VELOCITY,
    RecordKind,
    quoted,
)
from .deciding_units import ONE_G, TRUE_SIZE, decide_units
from .layout import COMMENT, layout_of
from .mapping import OPEN, Mapping
from .names import DATE, QUANTITY_OF, SAMPLE, TIMES, gyro_of, normal
from .numbers import (
    Marks,
    bare,
    bits_of_signed,
    date_of,
    date_orders,
    is_clock,
    is_missing,
    parsed_moment,
    parsed_number,
    two_parts,
)
from .presets import preset_of
from .ranking import (
    Triad,
    bits_of_offset,
    force_units,
    likely_of,
    may_be_channel,
    median_size,
    named_triads,
    numbers_in,
    quantities_of,
    rising,
    time_units,
    unnamed_triads,
    zero_of,
)
from .sheet import Sheet, cell
from .understanding import (
    CLOCK,
    MOMENT,
    NAME,
    NUMBER,
    STANDING_DEG,
    Field,
    Origin,
    UnderstoodTable,
    ask_of_senses,
)
from .units import ANGLE, TIME, is_rate, known_unit
from .units import FORCE as FORCE_QUANTITY
from .units import RATE as RATE_QUANTITY

PARTS_OF_ANGLES = ("'", "′", '"', "″", "''", "min", "sec", "s", "m", "arcmin", "arcsec", "minutes", "seconds")
"""Units of minutes and seconds of an arc, beside degrees."""
NO_READING = frozenset(
    ["std", "sigma", "noise", "bias", "error", "offset", "var", "rms", "max", "min", "cov", "gravity"]
)
"""Words in the names of three columns that are not readings in any unit."""
MOST_WORDS = 6
"""Largest number of different words in a column of numbers that a question names."""
MOST_ODD, NOTATION = 2, re.compile(r"\d[.,]\d|^0x|^[\da-fA-F]{4,}$")
"""Largest number of texts in another notation, such as (1.5), 1.5- or 0x1F; more are refused."""
OTHER_MARK = {".": ",", ",": "."}
"""Decimal mark -> mark between thousands beside it."""
TRIADS_OF = {FORCE_QUANTITY: FORCE, RATE_QUANTITY: RATE}
"""Quantity -> its three columns of a record."""
MANY_ROWS = 200
"""Number of rows from which a table is likelier a series than a table of rests."""
LEAST_PLAIN = 0.5
"""Median |f| below which numbers are gravity in no usual unit."""
MOST_SENSORS = 12
"""Largest number of sensors whose rows may be mixed in a table."""
MOST_TRIADS = 3
"""Largest number of answers to a question about columns without names."""
COLUMNS = QUANTITY_OF.keys() | {"position", DATE} | set(QUATERNION + APPROACH + UP + TEXTS)
"""Columns of a record that a mapping may name."""


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
    table = UnderstoodTable(sheet, layout, mapping, given=given)
    _ask_of_instances(table, "" if preset is None else preset.instance)
    if preset is not None:
        units = ", ".join(preset.units.values()) or "as answered"
        table.notes.append(f"columns and units of {preset.name}: {units}")
    # each file is searched for its lines: the next may have more of them
    table.settled = {"encoding": sheet.encoding, "separator": sheet.separator}
    fields = _fields_of_columns(table)
    if fields.keys().isdisjoint((TIMES, DATE, *ANGLES)) and table.mapping.of(TIMES).source != "none":
        fields |= _written_times(table, [field for field in table.filled if field not in fields.values()])
    if role is None:
        _decide_kind(table, fields)
    else:
        _take_role(table, fields, role)
    _decide_marks(table, fields)
    _decide_time(table, fields)
    for column, field in fields.items():
        if column in table.kind.known and column not in (TIMES, SAMPLE, DATE):
            table.origins[column] = _origin(table, column, field)
    decide_units(table)
    _decide_attitude(table)
    _ask_of_words(table)
    _ask_of_integers(table)
    for column, origin in table.origins.items():
        ask_of_senses(table, column, origin.field.texts)
    _decide_readings(table)
    columns = mapping.model_dump(by_alias=True)["columns"]
    for column, origin in sorted(table.origins.items(), key=lambda entry: entry[1].field.place):
        source = mapping.of(column)
        further = [field.label for field in origin.beside]
        settled = source.model_copy(update={"source": source.source or origin.field.label, "beside": further})
        columns[column] = settled.model_dump(by_alias=True)
    table.settled["columns"] = columns
    return table


def _fields_of_columns(table: UnderstoodTable) -> dict[str, Field]:
    """Return column of the record -> field of the row, from the mapping, otherwise by names."""
    mapping, fields = table.mapping, dict[str, Field]()
    for column in mapping.columns:
        if column not in COLUMNS:
            raise InputError(f"columns.{column}: is no column of a record; {nearest(column, sorted(COLUMNS))}")
        source = mapping.of(column)
        if source.source not in ("", OPEN, "none"):
            fields[column] = _field_named(table, column, source.source)
            table.beside[column] = tuple(_field_named(table, column, name) for name in source.beside)
    mapped = {column for column in mapping.columns if mapping.of(column).source not in ("", OPEN)}
    filled = table.filled
    candidates: dict[str, list[Field]] = {}
    for field in filled:
        if field.head.column and field.head.column not in mapped and field not in fields.values():
            candidates.setdefault(field.head.column, []).append(field)
    if candidates.keys() >= set(FORCE) and candidates.keys().isdisjoint(RATE + ANGLES):
        for field in filled:
            gyro = gyro_of(field.head)
            if gyro and gyro not in mapped:
                candidates.setdefault(gyro, []).append(field)
    for quantity, columns in TRIADS_OF.items():
        if (candidates.keys() | fields.keys() | mapped).isdisjoint(columns + INCREMENT):
            _take_triads(table, quantity, [field for field in filled if field not in fields.values()], candidates)
    fields |= _readings_beside(table, filled, candidates.keys() | fields.keys() | mapped)
    _refuse_parts(table, filled, candidates)
    for column, alike in candidates.items():
        if len(alike) == 1:
            fields[column] = alike[0]
            continue
        names = [field.head.text for field in alike]
        why = f"which is {column}"
        if len(set(names)) < len(names):
            why = f"two columns are called {names[0]!r}"
            names = [str(field.place + 1) for field in alike]
        table.ask(f"columns.{column}", names[:4], why)
    _ask_of_crossed(table, fields)
    return fields


def _ask_of_crossed(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Ask for both instruments where the columns named gyros have the size of gravity, those of accelerometers none."""
    if not fields.keys() >= set(FORCE + RATE) or not table.mapping.columns.keys().isdisjoint(FORCE + RATE):
        return
    forces, rates = (Triad(tuple(fields[column] for column in columns)) for columns in (FORCE, RATE))  # type: ignore
    if median_size(table, forces.fields) < LEAST_PLAIN and force_units(median_size(table, rates.fields)):
        table.proposed |= {FORCE_QUANTITY: rates.fields, RATE_QUANTITY: forces.fields}
        why = f"|f| of {forces.answer} is no gravity, that of {rates.answer} is"
        table.ask("columns.force", (rates.answer, forces.answer), why)
        table.ask("columns.rate", (forces.answer, rates.answer), "which columns are the gyros")
        for column in FORCE + RATE:
            del fields[column]


def _ask_of_instances(table: UnderstoodTable, name: str) -> None:
    """Ask for the sensor if the rows of several are mixed in one table.

    The column `name` counts them, or a column has the words accelerometer and gyroscope in turn.
    """
    for field in table.fields:
        sensors = sorted(set(field.texts))
        quantities = {quantity for text in sensors[:MOST_SENSORS] for quantity in quantities_of(normal(text).split())}
        is_sensor = len(quantities) > 1 and len(sensors) <= MOST_SENSORS
        if len(sensors) > 1 and (is_sensor or (name and field.head.text == name)):
            answers = [f"{field.label}={sensor}" for sensor in sensors]
            table.ask("part", answers, f"the rows of {len(sensors)} sensors are mixed")


def _take_triads(
    table: UnderstoodTable, quantity: str, fields: list[Field], candidates: dict[str, list[Field]]
) -> None:
    """Take the only three columns of a quantity that have its unit; ask for others whose names have its words."""
    # several numbered columns that mean one are readings beside each other
    triads = [triad for triad in named_triads(fields) if triad.quantity == quantity and not triad.numbered]
    if not triads:
        return
    triads.sort(key=lambda triad: triad.further)
    if len(triads) == 1 and all(field.quantity == quantity for field in triads[0].fields):
        candidates |= {column: [field] for column, field in zip(TRIADS_OF[quantity], triads[0].fields, strict=True)}
        return
    table.proposed[quantity] = triads[0].fields
    instrument = {FORCE_QUANTITY: "accelerometers", RATE_QUANTITY: "gyros"}[quantity]
    table.ask(f"columns.{quantity}", [triad.answer for triad in triads], f"which columns are the {instrument}")


def _refuse_parts(table: UnderstoodTable, filled: list[Field], candidates: dict[str, list[Field]]) -> None:
    """Refuse an angle whose minutes or seconds have a column of their own."""
    for column in ANGLES:
        if column not in candidates:
            continue
        degrees = candidates[column][0]
        for field in filled:
            unit = field.head.unit.strip().casefold()
            is_part = unit in PARTS_OF_ANGLES and unit != degrees.head.unit.strip().casefold()
            if is_part and field is not degrees and normal(field.head.name) == normal(degrees.head.name):
                what = f"columns {degrees.head.text!r} and {field.head.text!r} are parts of one angle"
                raise InputError(f"{table.sheet.path}: {what}; write it in one, as 12°34'56\" or in degrees")


def _readings_beside(table: UnderstoodTable, filled: list[Field], columns: set[str]) -> dict[str, Field]:
    """Return the first field of several side-by-side readings of each accelerometer; the others become `beside`.

    If the names do not tell, ask whether numbered columns are readings or sensors.
    """
    groups: dict[str, dict[int, Field]] = {column: {} for column in FORCE}
    units, texts, are_readings = set[str](), list[str](), True
    for field in filled:
        head = field.head
        if head.numbered and head.number not in groups[head.numbered]:
            groups[head.numbered][head.number] = field
            units.add(head.unit)
            texts.append(head.text)
            are_readings = are_readings and head.reading
    x, y, z = groups.values()
    if len(x) < 2 or not x.keys() == y.keys() == z.keys() or not columns.isdisjoint(FORCE + RATE + INCREMENT):
        return {}
    if table.mapping.beside == "none" or len(units) > 1:
        return {}
    if table.mapping.beside != "average" and not are_readings:
        why = f"whether {texts[0]!r} to {texts[-1]!r} are readings of one rest, or other sensors (none)"
        table.ask("beside", ("average", "none"), why)
    first = {}
    for column, group in groups.items():
        first[column], *further = (group[number] for number in sorted(group))
        table.beside[column] = tuple(further)
    return first


def _field_named(table: UnderstoodTable, column: str, name: str) -> Field:
    """Return the field with a name, or with a number from 1."""
    fields, spelled = table.fields, " ".join(name.split())
    for names in ([field.head.text for field in fields], [field.head.name for field in fields]):
        if name and names.count(spelled) == 1:
            return fields[names.index(spelled)]
    if name.isascii() and name.isdigit() and 1 <= int(name) <= len(fields):
        return fields[int(name) - 1]
    heads = []
    for field in fields:
        if field.head.text:
            heads.append(field.head.text)
    raise InputError(f"{table.sheet.path}: columns.{column}: there is no column {quoted(name)}; {nearest(name, heads)}")


def _decide_kind(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the kind of record, and ask for its missing columns."""
    of_table = not fields.keys().isdisjoint(ANGLES)
    of_block = not fields.keys().isdisjoint(RATE + INCREMENT)
    columns = list(fields.values())
    for further in table.beside.values():
        columns += further
    of_block = of_block or RATE_QUANTITY in table.proposed
    left = _channels_left(table, fields, columns)
    if of_block and not of_table:
        _refuse_gyros_alone(table, fields, left)
    name = table.mapping.kind.replace(OPEN, "")
    if not name and not of_table and not of_block and len(left) - 3 < 2:
        left = _without_only_triad(table, fields, left)
    # one column that is left is neither two angles nor three gyros
    has_forces = fields.keys() >= set(FORCE) or FORCE_QUANTITY in table.proposed
    are_alone = has_forces and len(left) < 2 and not of_table and not of_block
    if not name and are_alone:
        name = _kind_of_forces(table, fields)
    free = [field.label for field in left]
    if not name and not of_table and not of_block:
        # two unknown columns can be angles alone, three can be gyros: the question below decides
        angles = sum(field.quantity == ANGLE for field in table.fields)
        if "position" in fields or len(free) == 2 or angles == 2:
            name = POSITION.name
        elif len(free) == 3:
            name = STRAPDOWN_RATES.name
    required: Sequence[str] | None = None
    if not name:
        if are_alone:
            table.ask("kind", _kinds_of_forces(table), "accelerometers alone")
            name = _kinds_of_forces(table)[0]
        elif of_table == of_block:
            kinds = [POSITION.name, STRAPDOWN_RATES.name]
            why = "angles of a table and gyros are both there"
            if not of_table:
                kinds += [POSES.name, FORCES.name]
                if len(table.rows) >= MANY_ROWS:
                    kinds = [STRAPDOWN_RATES.name, FORCES.name, POSITION.name, POSES.name]
                why = "neither angles of a table nor gyros are known"
            table.ask("kind", kinds, why)
            required = FORCE
        if of_block and not of_table:
            name = STRAPDOWN_RATES.name
        elif not are_alone:
            name = POSITION.name
    table.kind = next(kind for kind in KINDS if kind.name == name and kind is not STRAPDOWN_VELOCITIES)
    if name == STRAPDOWN_RATES.name and not fields.keys().isdisjoint(INCREMENT):
        if fields.keys().isdisjoint(VELOCITY):
            table.kind = STRAPDOWN_INCREMENTS
        else:
            table.kind = STRAPDOWN_VELOCITIES
    table.settled["kind"] = name
    missing = [column for column in required or table.kind.required if column not in fields]
    missing = [column for column in missing if column not in ("position", TIMES)]
    if required and len(table.rows) >= MANY_ROWS and not of_table and not of_block:
        missing += RATE
    missing = _without_triads(table, missing, fields)
    for column in missing:
        if not any(column in triad and table.is_asked(f"columns.{key}") for key, triad in TRIADS_OF.items()):
            table.ask(f"columns.{column}", free[:3] or ("NAME",), f"which column is {column}")
            # each question has another first answer
            free = free[1:] + free[:1]


def _channels_left(table: UnderstoodTable, fields: dict[str, Field], columns: list[Field]) -> list[Field]:
    """Return the columns that may still be channels or angles; `columns` have a meaning."""
    used = set(columns)
    used.update(table.proposed.get(FORCE_QUANTITY, ()))
    has_forces = fields.keys() >= set(FORCE) or FORCE_QUANTITY in table.proposed
    is_series = len(table.rows) >= MANY_ROWS
    left = []
    for field in table.filled:
        is_force = has_forces and field.quantity == FORCE_QUANTITY
        if field not in used and not is_force and may_be_channel(table, field, is_series=is_series):
            left.append(field)
    return left


def _refuse_gyros_alone(table: UnderstoodTable, fields: dict[str, Field], left: list[Field]) -> None:
    """Refuse gyros without accelerometers: no kind of record has them alone."""
    proposed = table.proposed.get(RATE_QUANTITY, ())
    further = [field for field in left if field not in proposed]
    if len(further) < 3 and FORCE_QUANTITY not in table.proposed and fields.keys().isdisjoint(FORCE + VELOCITY):
        file = table.sheet.path
        advice = f"if they are in another file, give both: trihedron import ACCELEROMETERS {file.name}"
        raise InputError(f"{file}: holds gyros alone; a record needs three accelerometers; {advice}")


def _without_only_triad(table: UnderstoodTable, fields: dict[str, Field], left: list[Field]) -> list[Field]:
    """Take the only three columns x, y, z for accelerometers where nothing else can be; return what is left.

    They are asked for, unless a certain unit makes their size gravity.
    """
    triads = [triad for triad in named_triads(left) if not triad.quantity and triad.further < 2]
    if len(left) == 3 and not any(field.head.text for field in left):
        triads = [Triad((left[0], left[1], left[2]))]
    if len(triads) != 1 or not fields.keys().isdisjoint(FORCE) or FORCE_QUANTITY in table.proposed:
        return left
    (triad,) = triads
    if _is_gravity(table, triad):
        fields.update(zip(FORCE, triad.fields, strict=True))
        table.notes.append(f"{triad.answer} are taken as accelerometers: the size of their readings is gravity")
    else:
        table.proposed[FORCE_QUANTITY] = triad.fields
        why = "which columns are the accelerometers"
        if not force_units(median_size(table, triad.fields)):
            why += "; gyros alone make no record"
        table.ask("columns.force", [triad.answer], why)
    return [field for field in left if field not in triad.fields]


def _is_gravity(table: UnderstoodTable, triad: Triad) -> bool:
    """Return True if the readings of three columns, in a certain unit, have the size of gravity."""
    unit = known_unit(table.mapping.units.get(FORCE_QUANTITY, ""))
    is_estimate = not NO_READING.isdisjoint(normal(table.sheet.path.stem).split())
    if unit is None or unit.raw or is_estimate:
        return False
    size = median_size(table, triad.fields) * unit.factor / ONE_G
    return TRUE_SIZE[0] < size < TRUE_SIZE[1]


def _take_role(table: UnderstoodTable, fields: dict[str, Field], role: RecordKind) -> None:
    """Take a file for accelerometers or gyros alone; three columns x, y, z are then those of its instrument."""
    table.kind = role
    quantity, columns = (RATE_QUANTITY, RATE) if RATE[0] in role.required else (FORCE_QUANTITY, FORCE)
    if not fields.keys() & set(columns):
        free = [field for field in table.filled if field not in fields.values()]
        triads = [triad for triad in named_triads(free) if not triad.further]
        if len(triads) == 1 and triads[0].quantity in ("", quantity):
            fields.update(zip(columns, triads[0].fields, strict=True))
    missing = [column for column in columns if column not in fields]
    for column in _without_triads(table, missing, fields):
        table.ask(f"columns.{column}", [field.label for field in table.filled][:3], f"which column is {column}")


def _without_triads(table: UnderstoodTable, missing: list[str], fields: dict[str, Field]) -> list[str]:
    """Ask for all three channels at once where none is known; return the columns that are still missing."""
    used = set(fields.values())
    for proposed in table.proposed.values():
        used.update(proposed)
    free = []
    for field in table.filled:
        if field not in used and field.texts and table.values(field.texts):
            free.append(field)
    triads = [triad for triad in named_triads(free) if not triad.further and not triad.quantity]
    times = rising(table, free)[:1]
    triads = triads or unnamed_triads(table, [field for field in free if not field.head.text and field not in times])
    left_over = list(missing)
    for quantity, columns in TRIADS_OF.items():
        if not set(missing).issuperset(columns) or table.is_asked(f"columns.{quantity}") or not triads:
            continue
        table.proposed[quantity] = triads[0].fields
        instrument = {FORCE_QUANTITY: "accelerometers", RATE_QUANTITY: "gyros"}[quantity]
        answers = [triad.answer for triad in triads[:MOST_TRIADS]]
        table.ask(f"columns.{quantity}", answers, f"which columns are the {instrument}")
        left_over = [column for column in left_over if column not in columns]
        triads = [triad for triad in triads if set(triad.fields).isdisjoint(table.proposed[quantity])]
    return left_over


def _kinds_of_forces(table: UnderstoodTable) -> tuple[str, str]:
    """Return the kinds of accelerometers alone, the likelier first."""
    if len(table.rows) >= MANY_ROWS:
        return FORCES.name, POSES.name
    return POSES.name, FORCES.name


def _kind_of_forces(table: UnderstoodTable, fields: dict[str, Field]) -> str:
    """Return the kind of a table of accelerometers alone: averaged poses, or a series; empty where it may be either."""
    if "position" in fields or (FACE in fields and TIMES not in fields and SAMPLE not in fields):
        return POSES.name
    if not fields.keys().isdisjoint((TIMES, SAMPLE, DATE)) or table.is_asked(f"columns.{TIMES}"):
        return FORCES.name
    return ""


def _decide_marks(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the decimal mark and the mark between thousands from numbers that prove them."""
    marks = Marks()
    for column, field in fields.items():
        if column not in (*TEXTS, DATE):
            for text in field.texts:
                marks.see(bare(text))
    answer = table.mapping.decimal.replace(OPEN, "")
    proven = sorted(marks.decimal)
    if answer or table.sheet.stated.decimal:
        table.decimal = answer or table.sheet.stated.decimal
    elif len(proven) == 2:
        table.ask("decimal", (".", ","), f"{marks.decimal['.']!r} and {marks.decimal[',']!r} are both there")
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


def _decide_time(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Decide the source of times: numbers, times of day, dates, sample numbers, or the order of the rows."""
    time, date = fields.get(TIMES), fields.get(DATE)
    if time is None and SAMPLE in fields and table.kind is not POSITION:
        _refuse_period(table, f"{fields[SAMPLE].label!r} counts samples")
        table.origins[TIMES] = _origin(table, SAMPLE, fields[SAMPLE])
        return
    if time is None:
        time, date = date, None
    if time is None:
        _ask_for_time(table)
        return
    origin = _origin(table, TIMES, time)
    if time.cells and all(map(is_clock, time.texts)):
        origin = replace(origin, form=CLOCK)
        ambiguous = next(filter(two_parts, time.texts), None)
        if ambiguous and table.mapping.clock in ("", OPEN):
            table.ask("clock", ("h:m", "m:s"), f"what {ambiguous!r} is")
    elif any(table.value(text) is None for text in time.texts) and any(map(date_of, time.texts)):
        origin = replace(origin, form=MOMENT)
        _decide_dates(table, time)
    table.origins[TIMES] = origin
    if origin.form == CLOCK and date is not None:
        table.origins[DATE] = replace(_origin(table, DATE, date), form=MOMENT)
        _decide_dates(table, date)


def _written_times(table: UnderstoodTable, free: list[Field]) -> dict[str, Field]:
    """Return the only column of dates, times of day or numbers in a unit of time that goes from row to row."""
    dates = [field for field in free if field.texts and all(map(date_of, field.texts))]
    going = [field for field in free if len(field.texts) > 2 and len(set(field.texts)) == len(field.texts)]
    moments = [field for field in dates if field in going and ":" in field.texts[0]]
    clocks = [field for field in going if all(map(is_clock, field.texts))]
    if len(moments) == 1:
        return {TIMES: moments[0]}
    if len(clocks) == 1 and len(dates) < 2:
        return dict(zip((TIMES, DATE), (clocks[0], *dates), strict=False))
    timed = [field for field in free if field.quantity == TIME]
    if len(timed) == 1 and rising(table, timed):
        return {TIMES: timed[0]}
    return {}


def _ask_for_time(table: UnderstoodTable) -> None:
    """Ask for the source of times in a table without a known column of times."""
    if table.mapping.time == "order" or table.kind is POSES:
        return
    if table.is_asked("kind"):
        _ask_which_time(table)
        return
    _refuse_period(table, "no column is known as a time")
    if table.kind is POSITION and not any(field.quantity == TIME for field in table.filled):
        table.settled["time"] = "order"
        table.notes.append("no time is written: the rows count in their order")
        return
    is_position, has_unit = table.kind is POSITION, TIME in table.mapping.units
    timed = []
    for field in table.filled:
        if field.quantity == TIME:
            timed.append(field.head.text)
    if timed and not has_unit:
        in_order = ""
        if is_position:
            in_order = "; rows in their order: --set time=order"
        table.ask("columns.time_s", timed[:3], f"which column is the time{in_order}")
        return
    why = "no column is known as a time: {}; else columns.time_s=NAME says which"
    if not table.sheet.stated.time and not has_unit:
        likely = table.sheet.stated.likely_rate or likely_of(table.mapping).get(TIME, "100 Hz")
        table.ask("units.time", (likely,), why.format("rows at which rate"))


def _ask_which_time(table: UnderstoodTable) -> None:
    """Ask for the time of a series whose kind is open: a column that rises, or the rate of its rows."""
    if len(table.rows) < MANY_ROWS or TIME in table.mapping.units:
        return
    risen = rising(table, table.filled)
    if not risen:
        table.ask("units.time", ("100 Hz",), "no column is known as a time: rows at which rate")
        return
    labels = [field.label for field in risen]
    table.ask("columns.time_s", labels[:3], "which column is the time")
    answers = dict.fromkeys([*time_units(table, risen[0]), "s", "ms", "us"])
    table.ask("units.time", list(answers), "no unit of time is written")


def _refuse_period(table: UnderstoodTable, where: str) -> None:
    """Refuse a unit of time if there are no times: counted rows need their rate."""
    answer = table.mapping.units.get(TIME, OPEN)
    if answer != OPEN and not is_rate(answer):
        advice = "give the rate, as '100 Hz', or the column of the time by columns.time_s=NAME"
        raise InputError(f"{table.sheet.path}: units.time = {answer!r}: {where}; {advice}")


def _ask_of_integers(table: UnderstoodTable) -> None:
    """Ask for the zero of counts: they are all near 0 or near 65535, or in the middle of a converter's range."""
    zero = zero_of(table.mapping.integers)
    for column in FORCE + RATE:
        origin = table.origins.get(column)
        if zero and origin is not None and _is_of_counts(origin) and not origin.offset:
            table.origins[column] = replace(origin, offset=zero)
    if table.mapping.integers not in ("", OPEN):
        return
    forces = [table.origins[column] for column in FORCE if column in table.origins]
    fields = [origin.field for origin in forces] or list(table.proposed.get(FORCE_QUANTITY, ()))
    if len(fields) == 3 and all(_is_of_counts(origin) and not origin.offset for origin in forces):
        counts = numbers_in(table, fields)
        bits = bits_of_offset(counts)
        if bits:
            answer = f"offset {bits}"
            span = f"from {round(counts.min())} to {round(counts.max())} around {round(zero_of(answer))}"
            why = f"the accelerometers have counts {span}: zero is probably the middle of {bits} bits"
            table.ask("integers", (answer, "unsigned"), why)
            return
    channels = [origin.field for column, origin in table.origins.items() if column in FORCE + RATE]
    for proposed in table.proposed.values():
        channels += proposed
    for channel in channels:
        values = table.values(channel.texts)
        bits = bits_of_signed(values)
        if bits:
            span = f"from {int(min(values))} to {int(max(values))}"
            why = f"column {channel.label!r} has counts {span}, near both ends of {bits} bits"
            table.ask("integers", (f"signed {bits}", "unsigned"), why)
            return


def _is_of_counts(origin: Origin) -> bool:
    """Return True if a column may be in counts: its unit is a sensitivity, or not yet known."""
    return origin.unit is None or origin.unit.per is not None


def _decide_dates(table: UnderstoodTable, field: Field) -> None:
    """Decide the order of day, month and year; ask if it matters for the times."""
    texts: dict[str, None] = {}
    for _, row in table.sheet.rows(table.layout.first, table.layout.last or None):
        text = cell(row, field.place)
        date = None
        if not is_missing(text, table.mapping.missing):
            date = date_of(text)
        if date:
            texts.setdefault(date)
    orders = date_orders(texts)
    times: dict[str, list[float]] = {}
    for order in orders:
        moments = np.array([parsed_moment(text, order) or 0.0 for text in texts])
        times[order] = (moments - moments[:1]).tolist()
    answer = table.mapping.dates.replace(OPEN, "")
    differing = [text for text, *at in zip(texts, *times.values(), strict=True) if len(set(at)) > 1]
    if not answer and differing:
        table.ask("dates", orders, f"what {differing[0]!r} is")
    table.settled["dates"] = answer or (orders[0] if orders else "")
    if not answer and len(orders) > 1 and not differing:
        # all on the same day: the order does not matter
        table.notes.append("the order of day and month does not matter: all rows are of one day")


def _origin(table: UnderstoodTable, column: str, field: Field) -> Origin:
    """Return a column's origin as far as its own head and the mapping define it."""
    is_name = column in TEXTS or (column == "position" and _are_labels(field))
    source = table.mapping.of(column)
    beside = table.beside.get(column, ())
    return Origin(field, NAME if is_name else NUMBER, sign=source.sign, offset=source.offset, beside=beside)


def _are_labels(field: Field) -> bool:
    """Return True if positions have names instead of numbers: P1, P2, ..., alike except for their numbers."""
    patterns = set()
    for text in field.texts:
        patterns.add(re.sub(r"\d+", "0", text))
    return len(patterns) == 1 and "0" in min(patterns) and patterns.isdisjoint(("0", "-0", "0.0", "0,0"))


def _decide_attitude(table: UnderstoodTable) -> None:
    """Decide the direction of a quaternion; ask unless the columns are a record's own."""
    present = []
    for column in QUATERNION:
        if column in table.origins:
            present.append(column)
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
    numeric = {}
    for column, origin in table.origins.items():
        if origin.form == NUMBER:
            numeric[column] = origin
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
        places = []
        for further in numeric.values():
            if further is not origin:
                places.append(further.field.place)
        for line, text in origin.field.cells:
            if text in line_of and text not in words and _is_reading(table, line, places):
                words[text] = f"row {line}, {origin.name!r}: {quoted(text)} is no number{_beside(table, text)}"
    if words:
        # a comma separates answers
        answers = [text[:40] for text in words if "," not in text][:MOST_WORDS] or [next(iter(words))[:40]]
        rows = "such rows"
        if len(words) == 1:
            rows = "it"
        table.ask("missing", (",".join(answers),), f"{next(iter(words.values()))}; this leaves {rows} out")


def _refuse_notation(table: UnderstoodTable, origin: Origin, line_of: dict[str, int]) -> None:
    """Refuse numbers of a column in another notation; `line_of` has its texts that are not numbers, the first last."""
    written = []
    for text in line_of:
        if NOTATION.search(text) and not text.startswith(COMMENT):
            written.append(text)
    if len(written) > MOST_ODD:
        first = written[-1]
        what = f"row {line_of[first]}, column {origin.name!r}: {quoted(first)} is no number{_beside(table, first)}"
        also = f"nor are {len(written) - 1} others; write plain decimal numbers, a minus in front"
        raise InputError(f"{table.sheet.path}: {what}, {also}")


def _is_reading(table: UnderstoodTable, line: int, places: list[int]) -> bool:
    """Return True if a row has a number in one of these fields and is not a comment."""
    texts = next(texts for row, texts in table.rows if row == line)
    if texts[0].strip().startswith(COMMENT) and not table.is_marked:
        return False
    return any(table.value(cell(texts, place)) is not None for place in places)


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
        angles = []
        for column in ANGLES:
            origin = table.origins[column]
            value = table.reading(column, cell(texts, origin.field.place))
            if value is not None:
                angles.append(value * origin.unit.factor if origin.unit else value)
        if len(angles) == 2:
            apart = []
            for a, b in zip(angles, before, strict=False):
                apart.append(abs((a - b + 180.0) % 360.0 - 180.0))
            still += bool(apart) and max(apart) <= STANDING_DEG
            before = angles
    if still:
        why = f"{still} rows stand where the row before stands and positions have no numbers"
        table.ask("readings", ("average", "each"), f"{why}; a time series with its moves is --set 'kind=raw record'")
