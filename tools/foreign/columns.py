"""Find the columns of a record in a sheet: by the mapping, by names, by units, three at once."""

import re
from collections.abc import Sequence
from itertools import chain
from typing import NoReturn

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError, nearest
from ..records.columns import (
    ANGLES,
    APPROACH,
    FACE,
    FORCE,
    INCREMENT,
    QUATERNION,
    RATE,
    TEXTS,
    UP,
    RecordKind,
    quoted,
)
from .deciding_units import TRUE_SIZE
from .gravity import ask_of_sum
from .mapping import OPEN
from .names import DATE, POSITION, QUANTITY_OF, gyro_of, normal
from .presets import presets
from .ranking import (
    ALIKE,
    MEANING,
    MOST_TRIADS,
    Triad,
    estimates_of_gravity,
    force_units,
    is_derived,
    is_estimate_of_gravity,
    is_without_gravity,
    may_be_channel,
    median_size,
    named_triads,
    quantities_of,
    rising,
    size_of,
    turns_of,
    unnamed_triads,
)
from .understanding import (
    Field,
    UnderstoodTable,
)
from .units import FORCE as FORCE_QUANTITY
from .units import RATE as RATE_QUANTITY
from .units import known_unit

PARTS_OF_ANGLES = ("'", "′", '"', "″", "''", "min", "sec", "s", "m", "arcmin", "arcsec", "minutes", "seconds")
"""Units of minutes and seconds of an arc, beside degrees."""

TREATED, UNTREATED = ("cal", "calibrated"), ("raw", "uncal", "uncalib", "uncalibrated", "uncomp")
"""Words of the columns with and without a unit among several of one instrument."""
INSTRUMENTS = {FORCE_QUANTITY: "accelerometers", RATE_QUANTITY: "gyros"}
TRIADS_OF = {FORCE_QUANTITY: FORCE, RATE_QUANTITY: RATE}
"""Quantity -> its three columns of a record."""
LEAST_PLAIN = 0.5
"""Median |f| below which numbers are gravity in no usual unit."""
STEADY_GRAVITY = 0.1
"""Relative spread of |f| below which its size is gravity: shaking alone spreads more."""
AXIS = re.compile(r"[xyz]\d*\b")
"""Axis at the end of a word of a name."""
MOST_SENSORS = 12
"""Largest number of sensors whose rows may be mixed in a table."""
COLUMNS = QUANTITY_OF.keys() | {"position", DATE} | set(QUATERNION + APPROACH + UP + TEXTS)
"""Columns of a record that a mapping may name."""


def fields_of_columns(table: UnderstoodTable) -> dict[str, Field]:
    """Return column of the record -> field of the row, from the mapping, otherwise by names."""
    mapping, fields = table.mapping, dict[str, Field]()
    for column in mapping.columns:
        if column not in COLUMNS:
            raise InputError(f"columns.{column}: is not a column of a record; {nearest(column, sorted(COLUMNS))}")
        source = mapping.of(column)
        if source.source not in ("", OPEN, "none"):
            fields[column] = _field_named(table, column, source.source)
            table.beside[column] = tuple(_field_named(table, column, name) for name in source.beside)
    mapped = {column for column in mapping.columns if mapping.of(column).source not in ("", OPEN)}
    filled = table.filled
    candidates: dict[str, list[Field]] = {}
    for field in filled:
        column = FACE if field.head.column in ("", POSITION) and are_faces(field.texts) else field.head.column
        if column and column not in mapped and field not in fields.values():
            candidates.setdefault(column, []).append(field)
    if candidates.keys() >= set(FORCE) and candidates.keys().isdisjoint(RATE + ANGLES):
        estimates = estimates_of_gravity(table, [field for field in filled if gyro_of(field.head)])
        for field in filled:
            gyro = gyro_of(field.head)
            if gyro and gyro not in mapped and field not in estimates:
                candidates.setdefault(gyro, []).append(field)
    for quantity, columns in TRIADS_OF.items():
        if (candidates.keys() | fields.keys() | mapped).isdisjoint(columns + INCREMENT):
            _take_triads(table, quantity, [field for field in filled if field not in fields.values()], candidates)
    layout = presets().get(mapping.preset)
    without = layout and layout.without_gravity and re.search(layout.without_gravity, normal(table.sheet.path.stem))
    if layout and without and (candidates.keys() | fields.keys()).isdisjoint(FORCE):
        _refuse_without_gravity(table, f"acceleration without gravity by its name, in {layout.title}")
    fields |= _readings_beside(table, filled, candidates.keys() | fields.keys() | mapped)
    _refuse_parts(table, filled, candidates)
    _ask_of_alike(table, candidates)
    for column, alike in candidates.items():
        if all(field.texts == alike[0].texts and field.head.unit == alike[0].head.unit for field in alike):
            fields[column] = alike[0]
            continue
        names = [field.head.text for field in alike]
        why = f"which is {column}"
        if len(set(names)) < len(names):
            why = f"two columns have the name {names[0]!r}"
            names = [str(field.place + 1) for field in alike]
        table.ask(f"columns.{column}", names[:4], why)
    _ask_of_crossed(table, fields)
    return fields


def _propose(table: UnderstoodTable, quantity: str, triads: Sequence[Triad], why: str = "") -> None:
    """Ask which three columns are an instrument; the first are taken for it in further questions."""
    table.proposed[quantity] = triads[0].fields
    answers = [triad.answer for triad in triads]
    table.ask(f"columns.{quantity}", answers, why or f"which columns are the {INSTRUMENTS[quantity]}")


def ask_for_each(table: UnderstoodTable, columns: Sequence[str], fields: Sequence[Field]) -> None:
    """Ask for columns one by one; each question has another first answer, none a column that is proposed already."""
    proposed = {*chain(*table.proposed.values())}
    free = [field.label for field in fields if field not in proposed]
    for k, column in enumerate(columns):
        first = k % max(len(free), 1)
        answers = [*free[first:], *free[:first]][:3]
        table.ask(f"columns.{column}", answers or ("NAME",), f"which column is {column}")


def _ask_of_alike(table: UnderstoodTable, candidates: dict[str, list[Field]]) -> None:
    """Ask at once for three channels that several columns each may be, those with the size of gravity first."""
    for quantity, columns in TRIADS_OF.items():
        groups = [candidates.get(column, []) for column in columns]
        names = {field.head.text for group in groups for field in group}
        if not len(groups[0]) == len(groups[1]) == len(groups[2]) > 1 or len(names) < 3 * len(groups[0]):
            continue
        triads = [Triad((x, y, z), quantity) for x, y, z in zip(*groups, strict=True)]
        plain = [triad for triad in triads if "linear" not in normal(triad.fields[0].head.name).split()]
        triads = sorted(plain or triads, key=lambda triad: _unlikeliness(table, triad))
        if len(triads) == 1:
            for column, field in zip(columns, triads[0].fields, strict=True):
                candidates[column] = [field]
            continue
        _propose(table, quantity, triads[: MOST_TRIADS + 1])
        for column in columns:
            del candidates[column]


def _unlikeliness(table: UnderstoodTable, triad: Triad) -> tuple[bool, ...]:
    """Return the order of three columns among several: with gravity, with a unit, calibrated, not raw before others."""
    words = set(normal(triad.fields[0].head.name).split())
    has_unit = triad.fields[0].quantity in TRIADS_OF
    has_gravity = triad.quantity == RATE_QUANTITY or bool(force_units(median_size(table, triad.fields)))
    return not has_gravity, not has_unit, words.isdisjoint(TREATED), not words.isdisjoint(UNTREATED)


def are_faces(texts: Sequence[str]) -> bool:
    """Return true where each text is a face with its sense and the letter of its axis, as +X or y-."""
    return bool(texts) and all(re.fullmatch(r"[+-][xyz]|[xyz][+-]", text.strip().lower()) for text in texts)


def _ask_of_crossed(table: UnderstoodTable, fields: dict[str, Field]) -> None:
    """Ask for both instruments where the columns named gyros have the size of gravity, those of accelerometers none."""
    if not fields.keys() >= set(FORCE + RATE) or not table.mapping.columns.keys().isdisjoint(FORCE + RATE):
        return
    forces, rates = (Triad(tuple(fields[column] for column in columns)) for columns in (FORCE, RATE))  # type: ignore
    if not force_units(median_size(table, forces.fields)) and ask_of_sum(table, forces.fields):
        for column in FORCE:
            del fields[column]
        return
    if median_size(table, forces.fields) < LEAST_PLAIN and force_units(median_size(table, rates.fields)):
        why = f"|f| of {forces.answer} is not a gravity, that of {rates.answer} is"
        _propose(table, FORCE_QUANTITY, [rates, forces], why)
        _propose(table, RATE_QUANTITY, [forces, rates])
        for column in FORCE + RATE:
            del fields[column]


def ask_of_instances(table: UnderstoodTable, name: str) -> None:
    """Ask for the sensor if the rows of several are mixed in one table.

    The column `name` counts them, or a column has the words accelerometer and gyroscope in turn.
    """
    for field in table.fields:
        sensors = sorted(set(field.texts))
        quantities = {quantity for text in sensors[:MOST_SENSORS] for quantity in _quantities_in(text)}
        is_sensor = len(quantities) > 1 and len(sensors) <= MOST_SENSORS
        if len(sensors) > 1 and (is_sensor or (name and field.head.text == name)):
            forces, rates = ([text for text in sensors if quantity in _quantities_in(text)] for quantity in TRIADS_OF)
            forces.sort(key=lambda text: "total" not in normal(text))
            pairs = [f"{field.label}={force},{field.label}={rate}" for force in forces for rate in rates]
            answers = [*pairs[:MOST_TRIADS], *(f"{field.label}={sensor}" for sensor in sensors)]
            table.ask("part", answers, f"the rows of {len(sensors)} sensors are mixed")


def _quantities_in(text: str) -> list[str]:
    """Return the quantities of instruments that the words of a text mean."""
    return quantities_of(normal(text).split())


def _take_triads(
    table: UnderstoodTable, quantity: str, fields: list[Field], candidates: dict[str, list[Field]]
) -> None:
    """Take the only three columns of a quantity that have its unit; ask for others whose names have its words."""
    # several numbered columns that mean one are readings beside each other
    triads = [triad for triad in named_triads(fields) if triad.quantity == quantity and not triad.numbered]
    if not triads:
        return
    triads.sort(key=lambda triad: (_unlikeliness(table, triad), triad.further))
    if len(triads) == 1 and all(field.quantity == quantity for field in triads[0].fields):
        candidates |= {column: [field] for column, field in zip(TRIADS_OF[quantity], triads[0].fields, strict=True)}
        return
    _propose(table, quantity, triads)


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
    for field in filled:
        if field.head.numbered:
            groups[field.head.numbered].setdefault(field.head.number, field)
    x, y, z = groups.values()
    if len(x) < 2 or not x.keys() == y.keys() == z.keys() or not columns.isdisjoint(FORCE + RATE + INCREMENT):
        return {}
    heads = [field.head for field in filled if field in {*x.values(), *y.values(), *z.values()}]
    if table.mapping.beside == "none" or len({head.unit for head in heads}) > 1:
        return {}
    if table.mapping.beside != "average" and not all(head.reading for head in heads):
        why = f"whether {heads[0].text!r} to {heads[-1].text!r} are readings of one rest, or other sensors (none)"
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
    heads = [field.head.text for field in fields if field.head.text]
    raise InputError(f"{table.sheet.path}: columns.{column}: there is no column {quoted(name)}; {nearest(name, heads)}")


def without_only_triad(table: UnderstoodTable, fields: dict[str, Field], left: list[Field]) -> list[Field]:
    """Take the only three columns x, y, z for accelerometers where nothing else can be; return the other fields.

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
        has_gravity = bool(force_units(median_size(table, triad.fields)))
        why = "which columns are the accelerometers; gyros alone are not a record"
        _propose(table, FORCE_QUANTITY, [triad], "" if has_gravity else why)
    return [field for field in left if field not in triad.fields]


def _is_gravity(table: UnderstoodTable, triad: Triad) -> bool:
    """Return True if most readings of three columns, in a certain unit, have the size of gravity."""
    unit = known_unit(table.mapping.units.get(FORCE_QUANTITY, ""))
    is_estimate = not MEANING["no_reading"].isdisjoint(normal(table.sheet.path.stem).split())
    if unit is None or unit.raw or is_estimate:
        return False
    size, spread = size_of(table, triad.fields)
    return TRUE_SIZE[0] < size * unit.factor / STANDARD_GRAVITY < TRUE_SIZE[1] and spread < STEADY_GRAVITY


def _refuse_without_gravity(table: UnderstoodTable, what: str) -> NoReturn:
    """Refuse accelerations that are no readings of accelerometers."""
    advice = "a record needs what the accelerometers read: export that too, or give --set columns.force=NAMES"
    raise InputError(f"{table.sheet.path}: {what}; {advice}")


def take_role(table: UnderstoodTable, fields: dict[str, Field], role: RecordKind) -> None:
    """Take a file for accelerometers or gyros alone; three columns x, y, z are then those of its instrument."""
    table.kind = role
    quantity, columns = (RATE_QUANTITY, RATE) if RATE[0] in role.required else (FORCE_QUANTITY, FORCE)
    if not fields.keys() & set(columns):
        free = [field for field in table.filled if field not in fields.values()]
        triads = [triad for triad in named_triads(free) if not triad.further]
        if len(triads) == 1 and triads[0].quantity in ("", quantity):
            fields.update(zip(columns, triads[0].fields, strict=True))
    missing = without_triads(table, [column for column in columns if column not in fields], fields)
    used, times = set(fields.values()), rising(table, table.filled)
    free = [field for field in table.filled if field not in used and field not in times]
    free = [field for field in free if field.quantity in ("", quantity)]
    if missing and len(free) < len(missing):
        raise InputError(
            f"{table.sheet.path}: none of its columns can be {INSTRUMENTS[quantity]}; of two files one has the "
            "accelerometers and the other the gyros: give that file, or import this one alone"
        )
    ask_for_each(table, missing, free)


def without_triads(table: UnderstoodTable, missing: list[str], fields: dict[str, Field]) -> list[str]:
    """Ask for all three channels at once where none is known; return the columns that are still missing."""
    used = {*fields.values(), *chain(*table.proposed.values())}
    without = [field for field in table.filled if is_without_gravity(field)]
    others = (field for field in table.filled if field not in used and field not in without)
    free = [field for field in others if table.values(field.texts) and may_be_channel(table, field)]
    triads = [triad for triad in named_triads(free) if not triad.quantity and not is_derived(triad)]
    triads.sort(key=lambda triad: (triad.further, not force_units(median_size(table, triad.fields))))
    if not triads:
        times = rising(table, free)[:1]
        without_axis = [field for field in free if field not in times and not AXIS.search(normal(field.head.name))]
        triads = unnamed_triads(table, without_axis)
    left_over = list(missing)
    for quantity, columns in TRIADS_OF.items():
        if not set(missing).issuperset(columns) or table.is_asked(f"columns.{quantity}"):
            continue
        if quantity == FORCE_QUANTITY and ask_of_sum(table, without):
            left_over = [column for column in left_over if column not in columns]
            continue
        if quantity == FORCE_QUANTITY and without:
            size, spread = size_of(table, without[:3])
            if len(without) != 3 or not force_units(size) or spread > STEADY_GRAVITY:
                labels = ", ".join(field.label for field in without[:3])
                _refuse_without_gravity(table, f"{labels}: acceleration without gravity")
            triads.insert(0, Triad((without[0], without[1], without[2])))
        for triad in triads if quantity == FORCE_QUANTITY else ():
            if is_estimate_of_gravity(table, triad):
                _refuse_without_gravity(
                    table, f"columns {triad.answer}: an estimate of gravity, equal to its last digit"
                )
        if not triads:
            continue
        forces = table.proposed.get(FORCE_QUANTITY) or [fields[column] for column in FORCE if column in fields]
        if quantity == RATE_QUANTITY and len(forces) == 3:
            triads.sort(key=lambda triad: turns_of(table, forces, triad.fields)[1] < ALIKE)
        _propose(table, quantity, triads[:MOST_TRIADS])
        left_over = [column for column in left_over if column not in columns]
        triads = [triad for triad in triads if set(triad.fields).isdisjoint(table.proposed[quantity])]
    return left_over
