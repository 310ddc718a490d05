"""What a sheet means, as far as it can be known: decided by what proves it, else asked, all at once."""

import re
from dataclasses import replace

from ..errors import InputError, nearest
from ..records.columns import (
    ANGLES,
    APPROACH,
    FORCE,
    INCREMENT,
    KINDS,
    MOUNTING,
    POSITION,
    QUATERNION,
    RATE,
    RAW,
    STRAPDOWN_INCREMENTS,
    STRAPDOWN_RATES,
    STRAPDOWN_VELOCITIES,
    VELOCITY,
    quoted,
)
from .deciding_units import decide_units
from .layout import COMMENT, layout_of
from .mapping import OPEN, Mapping, Source
from .names import DATE, QUANTITY_OF, SAMPLE, TIMES, gyro_of, normal
from .numbers import (
    Marks,
    bare,
    date_of,
    is_clock,
    is_missing,
    moment,
    number,
    orders_of,
    two_parts,
)
from .sheet import Sheet
from .understanding import CLOCK, MOMENT, NAME, NUMBER, STANDING_DEG, Taken, Understanding, reading
from .units import ANGLE, TIME, known_unit

PARTS_OF_ANGLES = frozenset(
    ("'", "′", '"', "″", "''", "min", "sec", "s", "m", "arcmin", "arcsec", "minutes", "seconds")
)
"""Units of minutes and seconds of an arc, beside degrees."""
NO_READING = frozenset(
    ("std", "sigma", "noise", "bias", "error", "offset", "var", "rms", "max", "min", "cov", "gravity")
)
"""Words in names of three columns that are no readings, whatever their unit."""
MOST_WORDS = 6
"""So many different words in a column of numbers are asked of."""
MOST_ODD, NOTATION = 2, re.compile(r"\d[.,]\d|^0x|^[\da-fA-F]{4,}$")
"""More numbers in another notation, (1.5) or 1.5- or 0x1F, are refused."""


def understood(sheet: Sheet, given: Mapping) -> Understanding:
    """All that can be known of a sheet with what is given; what is not known is asked, all at once."""
    found = Understanding(sheet, layout_of(sheet, given), given)
    layout = found.layout
    # lines are looked for in each file: the next may have more of them
    found.settled = {
        "encoding": sheet.encoding,
        "separator": sheet.separator,
    }
    places = _places(found)
    _decide_kind(found, places)
    _decide_marks(found, places)
    _decide_time(found, places)
    for column, place in places.items():
        if column in found.kind.known and column not in (TIMES, SAMPLE, DATE):
            found.taken[column] = _taken(found, column, place)
    decide_units(found)
    _decide_attitude(found)
    _ask_of_words(found)
    _decide_readings(found)
    columns = {}
    for column, taken in sorted(found.taken.items(), key=lambda item: item[1].field):
        source = given.of(column) or Source.model_validate({"from": ""})
        name = layout.headings[taken.field].text or str(taken.field + 1)
        beside = [layout.headings[place].text or str(place + 1) for place in taken.beside]
        kept = source.model_copy(update={"source": source.source or name, "beside": beside})
        columns[column] = kept.model_dump(by_alias=True)
    found.settled["columns"] = {**found.given.model_dump(by_alias=True)["columns"], **columns}
    return found


def _places(found: Understanding) -> dict[str, int]:
    """Column of the record -> field of the row, by what is given, else by names."""
    headings, places = found.layout.headings, dict[str, int]()
    known = {*QUANTITY_OF, "position", DATE, *QUATERNION, *APPROACH, MOUNTING}
    for column in found.given.columns:
        if column not in known:
            raise InputError(f"columns.{column}: is no column of a record; {nearest(column, sorted(known))}")
        source = found.given.of(column)
        if source is not None and source.source != "none":
            places[column] = _field(found, column, source.source)
            found.beside[column] = tuple(_field(found, column, name) for name in source.beside)
    given = {column for column in found.given.columns if found.given.columns[column] != OPEN}
    meant: dict[str, list[int]] = {}
    for place, head in enumerate(headings):
        # a column with a name and nothing in it, as templates have, is not there
        if head.column and head.column not in given and place not in places.values() and found.cells(place):
            meant.setdefault(head.column, []).append(place)
    if meant.keys() >= {*FORCE} and not meant.keys() & {*RATE, *ANGLES}:
        for place, head in enumerate(headings):
            if gyro_of(head) and gyro_of(head) not in given and found.cells(place):
                meant.setdefault(gyro_of(head), []).append(place)
    for columns in (RATE, FORCE):
        if not {*meant, *places, *given} & {*columns, *INCREMENT}:
            meant |= {column: [place] for column, place in _by_unit(found, columns).items()}
    places |= _readings_beside(found, {*meant, *places, *given})
    _refuse_parts(found, meant)
    for column, fields in meant.items():
        if len(fields) == 1:
            places[column] = fields[0]
        else:
            named = [headings[place].text for place in fields]
            why = f"which is {column}" if len(set(named)) == len(named) else f"two columns are called {named[0]!r}"
            answers = named if len(set(named)) == len(named) else [str(place + 1) for place in fields]
            found.ask(f"columns.{column}", answers[:4], why)
    return places


def _by_unit(found: Understanding, columns: tuple[str, ...]) -> dict[str, int]:
    """The only three columns in a unit of these, whose names differ by x, y, z at the end: w_RS_S_x [rad s^-1]."""
    triads: dict[str, dict[str, int]] = {}
    for place, head in enumerate(found.layout.headings):
        unit = known_unit(head.unit)
        if unit is None or unit.quantity != QUANTITY_OF[columns[0]] or not found.cells(place):
            continue
        named = re.fullmatch(r"(.*?) ?([xyz])", normal(head.name))
        stem, axis = (named[1], named[2]) if named else (normal(head.name), "")
        triads.setdefault(stem, {})[axis] = place
    (stem, triad), *others = triads.items() or [("", {})]
    if others or triad.keys() != {*"xyz"} or NO_READING & {*stem.split()}:
        return {}
    return {column: triad[axis] for column, axis in zip(columns, "xyz", strict=True)}


def _refuse_parts(found: Understanding, meant: dict[str, list[int]]) -> None:
    """Refuse an angle whose minutes or seconds stand in a column of their own."""
    headings = found.layout.headings
    for column in (name for name in ANGLES if name in meant):
        whole = headings[meant[column][0]]
        for place, head in enumerate(headings):
            unit = head.unit.strip().casefold()
            alike = normal(head.name) == normal(whole.name) and place not in meant[column][:1]
            if alike and unit != whole.unit.strip().casefold() and unit in PARTS_OF_ANGLES and found.cells(place):
                what = f"columns {whole.text!r} and {head.text!r} are parts of one angle"
                raise InputError(f"{found.sheet.path}: {what}; write it in one, as 12°34'56\" or in degrees")


def _readings_beside(found: Understanding, known: set[str]) -> dict[str, int]:
    """Fields of the first of several readings of each accelerometer, side by side; the others become `beside`.

    Whether columns with numbers are readings or sensors is asked where their names do not say it.
    """
    groups: dict[str, dict[int, int]] = {}
    heads = found.layout.headings
    for place, head in enumerate(heads):
        if head.numbered and found.cells(place):
            groups.setdefault(head.numbered, {}).setdefault(head.number, place)
    numbers = [set(groups.get(column, ())) for column in FORCE]
    fields = [place for group in groups.values() for place in group.values()]
    alike = len(numbers[0]) > 1 and numbers[0] == numbers[1] == numbers[2]
    if not alike or known & {*FORCE, *RATE, *INCREMENT} or found.given.beside == "none":
        return {}
    if len({heads[place].unit for place in fields}) > 1:
        return {}
    if found.given.beside != "average" and not all(heads[place].reading for place in fields):
        names = f"{heads[min(fields)].text!r} to {heads[max(fields)].text!r}"
        found.ask("beside", ("average", "none"), f"whether {names} are readings of one rest, or other sensors (none)")
    found.beside |= {column: tuple(groups[column][k] for k in sorted(numbers[0])[1:]) for column in FORCE}
    return {column: groups[column][min(numbers[0])] for column in FORCE}


def _field(found: Understanding, column: str, name: str) -> int:
    """The field with a name, or with a number from 1."""
    headings = found.layout.headings
    for spelled in (lambda h: h.text, lambda h: h.name):
        fields = [place for place, head in enumerate(headings) if spelled(head) == " ".join(name.split()) and name]
        if len(fields) == 1:
            return fields[0]
    if name.isascii() and name.isdigit() and 1 <= int(name) <= len(headings):
        return int(name) - 1
    meant = nearest(name, [head.text for head in headings if head.text])
    raise InputError(f"{found.sheet.path}: columns.{column}: there is no column {quoted(name)}; {meant}")


def _decide_kind(found: Understanding, places: dict[str, int]) -> None:
    """Which kind of record it is, and which columns of that are missing."""
    of_table = [column for column in ANGLES if column in places]
    of_block = [column for column in (*RATE, *INCREMENT) if column in places]
    named = found.given.kind if found.given.kind != OPEN else ""
    headings = found.layout.headings
    used = {*places.values(), *(place for fields in found.beside.values() for place in fields)}
    free = [
        headings[place].text or str(place + 1)
        for place in range(len(headings))
        if place not in used and found.cells(place)
    ]
    angles = sum((unit := known_unit(head.unit)) is not None and unit.quantity == ANGLE for head in headings)
    if not named and not of_table and not of_block and ("position" in places or len(free) in (2, 3) or angles == 2):
        # two unknown columns can be angles alone, three gyros: which they are is asked below
        named = POSITION.name if "position" in places or len(free) == 2 or angles == 2 else STRAPDOWN_RATES.name
    is_asked = False
    if not named:
        is_asked = bool(of_table) == bool(of_block)
        if is_asked:
            why = (
                "angles of a table and gyros are both there"
                if of_table
                else "neither angles of a table nor gyros are known"
            )
            found.ask("kind", ("position record", "strapdown record"), why)
        named = STRAPDOWN_RATES.name if of_block and not of_table else POSITION.name
    kinds = [kind for kind in KINDS if kind.name == named and kind is not STRAPDOWN_VELOCITIES]
    if len(kinds) > 1 and any(column in places for column in INCREMENT):
        kinds = [STRAPDOWN_VELOCITIES if any(column in places for column in VELOCITY) else STRAPDOWN_INCREMENTS]
    found.kind = kinds[0]
    found.settled["kind"] = named
    asked = {question.key for question in found.questions}
    for column in FORCE if is_asked else found.kind.required:
        open_ = column not in places and f"columns.{column}" not in asked
        if open_ and column not in ("position", TIMES):
            found.ask(f"columns.{column}", free[:3] or ("NAME",), f"which column is {column}")


def _decide_marks(found: Understanding, places: dict[str, int]) -> None:
    """The decimal mark and that between thousands, from what the numbers prove."""
    marks = Marks()
    for column, place in places.items():
        if column not in (MOUNTING, DATE):
            for _, text in found.cells(place):
                marks.see(bare(text))
    stated = found.sheet.stated.decimal
    decided = found.given.decimal if found.given.decimal != OPEN else ""
    found.thousands = found.given.thousands
    proven = sorted(marks.decimal)
    if decided or stated:
        found.decimal = decided or stated
    elif len(proven) == 2:
        found.ask("decimal", (".", ","), f"{marks.decimal['.']!r} and {marks.decimal[',']!r} are both there")
    elif proven:
        found.decimal = proven[0]
    elif marks.thousands and len(marks.thousands) == 1:
        found.decimal = "," if "." in marks.thousands else "."
    elif marks.doubtful:
        text = next(iter(marks.doubtful.values()))
        shown = text.replace(",", "").replace(".", "")
        found.ask("decimal", (",", "."), f"{text!r} may be {text.replace(',', '.')} or {shown}")
        found.decimal = next(iter(marks.doubtful))
    other = "," if found.decimal == "." else "."
    if not found.thousands and other in {*marks.thousands, *marks.doubtful}:
        text = (marks.thousands | marks.doubtful)[other]
        # who says what the decimal mark is was told what the other would be
        if other in marks.thousands or decided:
            found.thousands = other
        elif not any(question.key == "decimal" for question in found.questions):
            found.ask(
                "thousands",
                (other,),
                f"{text!r} beside {next(iter(marks.decimal.values()), 'others')!r}: are those thousands?",
            )
            found.thousands = other
    found.settled |= {"decimal": found.decimal, "thousands": found.thousands}


def _decide_time(found: Understanding, places: dict[str, int]) -> None:
    """What the time of a row is taken from: numbers, times of day, dates, sample numbers, or the order of the rows."""
    place, date_place = places.get(TIMES), places.get(DATE)
    if place is None and SAMPLE in places and found.kind is not POSITION:
        found.taken[TIMES] = _taken(found, SAMPLE, places[SAMPLE])
        return
    if place is None and date_place is not None:
        place, date_place = date_place, None
    if place is None:
        if found.given.time != "order" and not any(question.key == "kind" for question in found.questions):
            rate = ("1 s",) if found.kind is POSITION else ("100 Hz",)
            timed = [
                head.text
                for field, head in enumerate(found.layout.headings)
                if (unit := known_unit(head.unit)) and unit.quantity == TIME and found.cells(field)
            ]
            if timed and TIME not in found.given.units:
                why = "which column is the time"
                why += "; rows in their order: --set time=order" if found.kind is POSITION else ""
                found.ask("columns.time_s", timed[:3], why)
            elif found.kind is POSITION or not (found.sheet.stated.time or TIME in found.given.units):
                key = "time" if found.kind is POSITION else "units.time"
                answers = ("order",) if found.kind is POSITION else rate
                said = "rows in their order" if key == "time" else "rows at which rate"
                found.ask(key, answers, f"no column is known as a time: {said}; else columns.time_s=NAME says which")
        return
    cells = [text for _, text in found.cells(place)]
    if cells and all(is_clock(text) for text in cells):
        found.taken[TIMES] = replace(_taken(found, TIMES, place), form=CLOCK)
        if any(two_parts(text) for text in cells) and found.given.clock in ("", OPEN):
            found.ask("clock", ("h:m", "m:s"), f"what {next(filter(two_parts, cells))!r} is")
        if date_place is not None:
            found.taken[DATE] = _taken(found, DATE, date_place)
            found.taken[DATE] = replace(found.taken[DATE], form=MOMENT)
            _decide_dates(found, [(date_place, place)])
    elif any(found.value(text) is None for text in cells) and any(date_of(text) for text in cells):
        found.taken[TIMES] = replace(_taken(found, TIMES, place), form=MOMENT)
        _decide_dates(found, [(place, None)])
    else:
        found.taken[TIMES] = _taken(found, TIMES, place)


def _decide_dates(found: Understanding, fields: list[tuple[int, int | None]]) -> None:
    """In which order day, month and year stand: asked where it matters for the times."""
    (place, _), layout = fields[0], found.layout
    texts: dict[str, None] = {}
    for _, row in found.sheet.rows(layout.first, layout.last or None):
        if place < len(row) and not is_missing(row[place], found.given.missing):
            part = date_of(row[place])
            if part:
                texts.setdefault(part)
    orders = orders_of(texts)
    times = {
        order: tuple((moment(text, order) or 0.0) - (moment(next(iter(texts)), order) or 0.0) for text in texts)
        for order in orders
    }
    chosen = found.given.dates if found.given.dates != OPEN else ""
    if not chosen and len(set(times.values())) > 1:
        different = next(text for k, text in enumerate(texts) if len({times[order][k] for order in orders}) > 1)
        found.ask("dates", orders, f"what {different!r} is")
    found.settled["dates"] = chosen or (orders[0] if orders else "")
    if not chosen and len(times) > 1 and len(set(times.values())) == 1:
        # all the same day: which it is does not matter
        found.notes.append("the order of day and month does not matter: all rows are of one day")


def _taken(found: Understanding, column: str, place: int) -> Taken:
    """A column as far as its own head and what is given say it."""
    source = found.given.of(column)
    said = found.layout.headings[place].text or f"field {place + 1}"
    form = NAME if column == MOUNTING or (column == "position" and _are_labels(found, place)) else NUMBER
    beside = found.beside.get(column, ())
    if source is None:
        return Taken(place, form, said=said, beside=beside)
    return Taken(place, form, sign=source.sign, offset=source.offset, said=said, beside=beside)


def _are_labels(found: Understanding, place: int) -> bool:
    """Whether positions are named and not numbered: P1, P2, ..., all alike but for their numbers."""
    patterns = {re.sub(r"\d+", "0", text) for _, text in found.cells(place)}
    return len(patterns) == 1 and not patterns & {"0", "-0", "0.0", "0,0"} and "0" in patterns.copy().pop()


def _decide_attitude(found: Understanding) -> None:
    """What a quaternion turns: asked for, but of a record's own columns."""
    present = [column for column in QUATERNION if column in found.taken]
    chosen = found.given.attitude
    if present and (len(present) < 4 or chosen == "none"):
        for column in present:
            del found.taken[column]
        return
    own = all(found.layout.headings[found.taken[column].field].text == column for column in present)
    if present and chosen in ("", OPEN) and not own:
        found.ask("attitude", ("body to reference", "reference to body", "none"), "what the quaternion turns")
    if present:
        found.settled["attitude"] = chosen if chosen not in ("", OPEN) else "body to reference"


def _ask_of_words(found: Understanding) -> None:
    """Ask of words in columns of numbers that are no usual words for a missing number, of all at once.

    Several that are numbers in another notation are refused: who left them out would lose those readings.
    """
    if any(question.key in ("decimal", "thousands") for question in found.questions):
        return
    words: dict[str, str] = {}
    for column, taken in found.taken.items():
        cells = [text for _, text in found.cells(taken.field)]
        if taken.form != NUMBER or not cells:
            continue
        wrong = {
            text: line for line, text in reversed(found.cells(taken.field)) if reading(found, column, text) is None
        }
        written = [text for text in wrong if NOTATION.search(text) and not text.startswith(COMMENT)]
        if len(written) > MOST_ODD:
            line = wrong[written[-1]]
            what = f"row {line}, column {taken.said!r}: {quoted(written[-1])} is no number{_beside(found, written[-1])}"
            also = f"nor are {len(written) - 1} others; write plain decimal numbers, a minus in front"
            raise InputError(f"{found.sheet.path}: {what}, {also}")
        if len(wrong) == len(set(cells)):
            found.ask(f"columns.{column}", ("NAME",), f"{taken.said!r} holds no numbers, but {quoted(cells[0])}")
            continue
        others = [other.field for other in found.taken.values() if other.form == NUMBER and other is not taken]
        for line, text in found.cells(taken.field):
            if text not in wrong or text in words:
                continue
            texts = next(texts for row, texts in found.looked_at if row == line)
            if texts[0].strip().startswith(COMMENT) and not found.is_marked:
                continue
            if any(place < len(texts) and found.value(texts[place]) is not None for place in others):
                words[text] = f"row {line}, {taken.said!r}: {quoted(text)} is no number{_beside(found, text)}"
    if words:
        # a comma stands between answers
        shown = [text[:40] for text in words if "," not in text][:MOST_WORDS] or [next(iter(words))[:40]]
        left = "this leaves it out" if len(words) == 1 else "this leaves such rows out"
        found.ask("missing", (",".join(shown),), f"{next(iter(words.values()))}; {left}")


def _beside(found: Understanding, text: str) -> str:
    other = "," if found.decimal == "." else "."
    return f" with decimal {found.decimal!r}" if number(bare(text), other) is not None else ""


def _decide_readings(found: Understanding) -> None:
    """Whether rows at one position are readings of one rest: as positions are numbered, else asked where rows stand."""
    found.settled["readings"] = found.given.readings if found.given.readings != OPEN else ""
    if found.kind not in (POSITION, RAW) or found.given.kind == RAW.name or not all(a in found.taken for a in ANGLES):
        return
    if found.given.readings in ("average", "each") or "position" in found.taken:
        return
    before: list[float] | None = None
    still = 0
    for _, texts in found.looked_at:
        angles = [
            reading(found, column, texts[found.taken[column].field])
            for column in ANGLES
            if found.taken[column].field < len(texts)
        ]
        values = [value for value in angles if value is not None]
        if len(values) < 2:
            continue
        factor = [unit.factor if (unit := found.taken[column].unit) else 1.0 for column in ANGLES]
        values = [value * size for value, size in zip(values, factor, strict=True)]
        if before is not None and all(
            abs((a - b + 180.0) % 360.0 - 180.0) <= STANDING_DEG for a, b in zip(values, before, strict=True)
        ):
            still += 1
        before = values
    if still:
        why = f"{still} rows stand where the row before stands and positions have no numbers"
        found.ask("readings", ("average", "each"), f"{why}; a time series with its moves is --set 'kind=raw record'")
