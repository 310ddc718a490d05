"""Decide the unit of each column of a sheet, and ask for those that nothing proves, the likeliest first."""

from collections.abc import Sequence
from dataclasses import replace

from ...fmus.units import STANDARD_GRAVITY
from ..errors import InputError
from ..records.columns import ANGLES, FORCE, POSES, POSITION, RATE
from .gravity import ask_of_sum
from .mapping import OPEN, TRIADS
from .names import QUANTITY_OF, SAMPLE, TIMES, normal
from .numbers import sexagesimal, unit_behind
from .ranking import angle_unit, by_evidence, force_units, likely_units, median_size
from .tables import TABLES
from .understanding import CLOCK, MOMENT, Field, Origin, UnderstoodTable
from .units import (
    COUNTS,
    DOUBTFUL,
    EXAMPLES,
    QUANTITIES,
    TIME,
    LaboratoryUnit,
    is_rate,
    known_unit,
    of_converter,
    scaled_unit,
    sense_behind,
    spelled_unit,
    units_beside_factor,
)

LEAST_SIZE, FEWEST = 0.2, 10
"""Median |f| [g], and number of rows, below which gravity is not in the readings."""
TRUE_SIZE = (0.8, 1.25)
"""Range of the median |f| [g] in the unit of a layout."""
DAYS = (30_000.0, 80_000.0)
"""Range of times that may be dates as a workbook counts them: days since 1900."""


def decide_units(table: UnderstoodTable) -> None:
    """Decide the unit of each column: given for it, given for its quantity, in its head, or asked for."""
    units = table.mapping.units
    agreed: dict[str, set[str]] = {}
    for key in units:
        if key not in QUANTITIES:
            raise InputError(f"units.{key}: is not a quantity; {', '.join(QUANTITIES)}")
    for column, origin in table.origins.items():
        quantity = QUANTITY_OF.get(column)
        if quantity is None or origin.form in (CLOCK, MOMENT):
            continue
        if all(table.reading(column, text) is None for text in origin.field.texts):
            # another question asks for the column
            continue
        counts_samples = column == TIMES and origin.field.head.column == SAMPLE
        unit, text = _unit(table, SAMPLE if counts_samples else column, origin)
        if unit is not None:
            table.origins[column] = replace(origin, unit=unit)
            agreed.setdefault(quantity, set()).add(text)
    stated = {field.quantity for field in table.fields}
    for question in list(table.questions):
        name = question.key.removeprefix("columns.")
        quantity = name if question.key in TRIADS else QUANTITY_OF.get(name, "")
        if quantity and quantity not in stated and quantity not in agreed and quantity not in units:
            _ask_for_unit(table, quantity)
    _check_size(table)
    table.settled["units"] = {quantity: min(texts) for quantity, texts in agreed.items() if len(texts) == 1}
    table.settled["units"] |= {quantity: text for quantity, text in units.items() if text != OPEN}


def _check_size(table: UnderstoodTable) -> None:
    """Ask for the unit of specific force where a layout's contradicts gravity; refuse readings without gravity."""
    origins = [table.origins[column] for column in FORCE if column in table.origins]
    units = {origin.unit for origin in origins}
    unit = next(iter(units), None)
    if len(origins) < 3 or len(units) > 1 or unit is None or unit.raw:
        return
    fields = [origin.field for origin in origins]
    answer = table.mapping.units.get("force", OPEN)
    is_answered = table.given.units.get("force", OPEN) != OPEN
    of_layout = answer != OPEN and not is_answered
    size = median_size(table, fields) * unit.factor / STANDARD_GRAVITY
    if is_answered and not TRUE_SIZE[0] < size < TRUE_SIZE[1]:
        table.notes.append(f"|f| is about {size:.3g} g in the unit that is given, not 1 g")
    if is_answered or table.mapping.integers not in ("", OPEN):
        return
    near: list[str] = []
    if force_units(size * STANDARD_GRAVITY / unit.factor):
        near = likely_units(table, "force", fields, EXAMPLES["force"][:3], None)
    is_linear = all("linear" in normal(field.head.name).split() for field in fields)
    if (of_layout or is_linear) and not TRUE_SIZE[0] < size < TRUE_SIZE[1] and (near or size >= LEAST_SIZE):
        written = answer if of_layout else fields[0].head.unit
        of_what = f"the unit of {table.mapping.preset}" if of_layout else f"{written}: gravity may not be in it"
        table.ask("units.force", near or (written,), f"|f| is about {size:.3g} g in {of_what}")
    elif size < LEAST_SIZE and table.kind not in (POSITION, POSES) and len(fields[0].cells) >= FEWEST:
        if ask_of_sum(table, fields):
            return
        names = ", ".join(field.label for field in fields)
        what = f"{names}: |f| is about {size:.3g} g: these accelerations have another unit, or no gravity"
        raise InputError(f"{table.sheet.path}: {what}; take the columns with gravity, or give --set units.force=UNIT")


def _ask_for_unit(table: UnderstoodTable, quantity: str) -> None:
    """Ask for the unit of a quantity whose columns are unknown; a free field may hold a converter's output."""
    sources = {origin.field for origin in table.origins.values()}
    for free in table.fields:
        if free not in sources and free.unit and free.unit.raw:
            raw = free.head.unit
            table.ask(f"units.{quantity}", (example_sensitivity(quantity, raw),), f"the size of one {raw}, for example")
            return
    fields = table.proposed.get(quantity, ())
    answers = likely_units(table, quantity, fields, EXAMPLES[quantity][:3], None)
    table.ask(f"units.{quantity}", answers, _without_unit(table, quantity, quantity, fields))


def _without_unit(table: UnderstoodTable, what: str, quantity: str, fields: Sequence[Field]) -> str:
    """Return the reason for a question about a unit, with the size of specific force."""
    size = f"; |f| is about {median_size(table, fields):.4g}" if fields and quantity == "force" else ""
    return f"{what} has no unit{size}"


def _unit(table: UnderstoodTable, column: str, origin: Origin) -> tuple[LaboratoryUnit | None, str]:
    """Return the unit of a column and its text; None if the user must be asked for it."""
    quantity, head, texts = QUANTITY_OF[column], origin.field.head, origin.field.texts
    source = table.mapping.of(column)
    key = f"columns.{column}.unit" if source.unit else f"units.{quantity}"
    behind = (unit_behind(written) for written in texts if not sense_behind(written, quantity))
    text = head.unit or next(filter(None, behind), "")
    doubtful = DOUBTFUL.get(spelled_unit(text).lower(), ())
    stated = None if doubtful else known_unit(text)
    is_raw = stated is not None and stated.raw
    answer = source.unit or table.mapping.units.get(quantity, "")
    if answer not in ("", OPEN):
        unit = scaled_unit(answer)
        if unit is not None and unit.per is not None:
            unit = of_converter(unit, stated if is_raw else None)
        if unit is None or unit.raw or unit.quantity != quantity:
            examples = f"{', '.join(EXAMPLES[quantity])} or '16384 LSB/g'"
            raise InputError(f"{key} = {answer!r}: is not a unit of {quantity}; as {examples}")
        return unit, answer
    if stated is not None and stated.quantity == quantity:
        return stated, text
    if column in ANGLES and texts and all(table.value(t) is None and sexagesimal(t) is not None for t in texts):
        return known_unit("deg"), "deg"
    by_gravity = angle_unit(table) if column in ANGLES and not text else ""
    if by_gravity:
        table.notes.append(f"{origin.name!r} is in {by_gravity}: in this unit alone the readings follow the vertical")
        return known_unit(by_gravity), by_gravity
    columns = {"force": FORCE, "rate": RATE, "time": (TIMES,)}.get(quantity, ())
    fields = [table.origins[name].field for name in columns if name in table.origins]
    usual = [example_sensitivity(quantity, text)] if is_raw else EXAMPLES[quantity][:3]
    answers = likely_units(table, quantity, fields, usual, stated)
    if is_raw:
        answers = [answer for answer in answers if _is_sensitivity(answer)] or usual
        why = f"{head.text!r} is in {text}: the size of one {text}, for example"
    elif doubtful:
        answers, why = doubtful, f"what {text!r} of {head.text!r} is"
    elif text and text != head.text:
        answers = [*by_evidence(table, quantity, fields, units_beside_factor(text, quantity)), *answers]
        why = f"{text!r} of {head.text!r} is not a known unit of {quantity}"
    elif column == SAMPLE:
        rates = [answer for answer in answers if is_rate(answer)]
        answers, why = rates or ["100 Hz"], f"{head.text!r} counts samples; at which rate"
    else:
        values = table.values(texts)
        # as a workbook counts days since 1900
        if quantity == TIME and values and DAYS[0] < min(values) and max(values) < DAYS[1]:
            answers = ["d", "s", "ms"]
        why = _without_unit(table, repr(head.text or origin.name), quantity, fields)
    table.ask(key, answers, why)
    return None, ""


def _is_sensitivity(text: str) -> bool:
    """Return True if a unit is a sensitivity of a converter, as 16384 LSB/g."""
    unit = scaled_unit(text)
    return unit is not None and unit.per is not None


def example_sensitivity(quantity: str, text: str) -> str:
    """Return an example of one volt or count of a quantity; `text` is the converter's unit."""
    volt, count = TABLES["sensitivities"][quantity]
    unit = known_unit(text)
    if count and unit is not None and unit.quantity == COUNTS:
        return count.replace("LSB", spelled_unit(text))
    return f"{volt}/{spelled_unit(text)}"
