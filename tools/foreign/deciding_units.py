"""What the numbers of a sheet are in: as given, as heads and cells say it, else asked."""

from dataclasses import replace

from ..errors import InputError
from ..records.columns import ANGLES, FORCE
from .mapping import OPEN
from .names import QUANTITY_OF, SAMPLE, TIMES
from .numbers import sexagesimal, unit_behind
from .understanding import CLOCK, MOMENT, Taken, Understanding, reading
from .units import ANGLE, COUNTS, DOUBTFUL, EXAMPLES, QUANTITIES, TIME, Unit, known_unit, of_converter, unit_of, written

SENSITIVITIES = {
    "force": "0.5 g",
    "rate": "0.01 (deg/s)",
    "angle": "0.01 deg",
    "velocity": "0.001 m/s",
    "time": "0.001 s",
    "temperature": "0.01 degC",
}
"""What one volt or count could be, as an example."""
COUNTED = {"force": "16384 LSB/g", "rate": "131 LSB/(deg/s)"}
"""The same as data sheets say it."""
DAYS = (30_000.0, 80_000.0)
"""Times between these may be dates as a workbook counts them: days since 1900."""


def decide_units(found: Understanding) -> None:
    """The unit of each column: as given for it, as given for its quantity, as its head says, or asked."""
    agreed: dict[str, set[str]] = {}
    for key in found.given.units:
        if key not in QUANTITIES:
            raise InputError(f"units.{key}: is no quantity; {', '.join(QUANTITIES)}")
    for column, taken in found.taken.items():
        key = SAMPLE if column == TIMES and found.layout.headings[taken.field].column == SAMPLE else column
        quantity = QUANTITY_OF.get(column)
        if quantity is None or taken.form in (CLOCK, MOMENT):
            continue
        if all(reading(found, column, text) is None for _, text in found.cells(taken.field)):
            # it is asked which column is meant
            continue
        unit, text = _unit(found, key, quantity, taken)
        if unit is not None:
            found.taken[column] = replace(taken, unit=unit)
            agreed.setdefault(quantity, set()).add(text)
    stated = {unit.quantity for head in found.layout.headings if (unit := known_unit(head.unit))}
    for question in list(found.questions):
        quantity = QUANTITY_OF.get(question.key.removeprefix("columns."), "")
        if quantity and quantity not in stated and not {quantity} & {*agreed, *found.given.units}:
            used = {taken.field for taken in found.taken.values()}
            free = [head.unit for place, head in enumerate(found.layout.headings) if place not in used]
            raw = next((text for text in free if (unit := known_unit(text)) and unit.raw), "")
            answers = (sensitivity(quantity, raw),) if raw else EXAMPLES[quantity][:3]
            why = f"what one {raw} is, as here" if raw else f"no unit of {quantity} is written"
            found.ask(f"units.{quantity}", answers, why)
    settled = {quantity: next(iter(texts)) for quantity, texts in agreed.items() if len(texts) == 1}
    found.settled["units"] = {**settled, **{k: v for k, v in found.given.units.items() if v != OPEN}}


def _unit(found: Understanding, column: str, quantity: str, taken: Taken) -> tuple[Unit | None, str]:
    """The unit of a column and its text; None where it has to be asked for."""
    source, head = found.given.of(column), found.layout.headings[taken.field]
    cells = found.cells(taken.field)
    stated_text = head.unit or next((unit_behind(text) for _, text in cells if unit_behind(text)), "")
    stated = known_unit(stated_text) if stated_text and written(stated_text).lower() not in DOUBTFUL else None
    given = (source.unit if source else "") or found.given.units.get(quantity, "")
    key = f"columns.{column}.unit" if source and source.unit else f"units.{quantity}"
    if given and given != OPEN:
        unit = unit_of(given)
        if unit is not None and unit.per is not None:
            unit = of_converter(unit, stated if stated is not None and stated.raw else None)
        if unit is None or unit.raw or unit.quantity != quantity:
            raise InputError(
                f"{key} = {given!r}: is no unit of {quantity}; as {', '.join(EXAMPLES[quantity])} or '16384 LSB/g'"
            )
        return unit, given
    if stated is not None and stated.quantity == quantity:
        return stated, stated_text
    if quantity == ANGLE and column in ANGLES and cells and all(_is_sexagesimal(found, text) for _, text in cells):
        return unit_of("deg"), "deg"
    if stated is not None and stated.raw:
        example = sensitivity(quantity, stated_text)
        found.ask(key, (example,), f"{head.text!r} is in {stated_text}: what one {stated_text} is, as here")
    elif stated_text and written(stated_text).lower() in DOUBTFUL:
        found.ask(
            key, DOUBTFUL[written(stated_text).lower()].split(" or "), f"what {stated_text!r} of {head.text!r} is"
        )
    elif stated_text and stated_text != head.text:
        found.ask(
            key, EXAMPLES[quantity][:3], f"{stated_text!r} of {head.text!r} is no unit of {quantity} that is known"
        )
    elif column == SAMPLE:
        found.ask(key, ("100 Hz",), f"{head.text!r} counts samples: at which rate")
    else:
        values = [value for _, text in cells if (value := found.value(text)) is not None]
        # as a workbook counts days since 1900
        days = quantity == TIME and bool(values) and all(DAYS[0] < value < DAYS[1] for value in values)
        answers = ("d", "s", "ms") if days else EXAMPLES[quantity][:3]
        found.ask(key, answers, f"no unit of {head.text or taken.said!r}{_size(found, quantity)} is written")
    return None, ""


def sensitivity(quantity: str, text: str) -> str:
    """What one volt or count of a quantity could be, as an example; `text` is the converter's unit."""
    unit = known_unit(text)
    if unit is not None and unit.quantity == COUNTS and quantity in COUNTED:
        return COUNTED[quantity].replace("LSB", written(text))
    return f"{SENSITIVITIES[quantity]}/{written(text)}"


def _is_sexagesimal(found: Understanding, text: str) -> bool:
    return found.value(text) is None and sexagesimal(text) is not None


def _size(found: Understanding, quantity: str) -> str:
    """What the numbers of specific forces are: a person knows by them what they are in."""
    if quantity != "force":
        return ""
    places = [found.taken[column].field for column in FORCE if column in found.taken]
    squares = []
    for _, texts in found.looked_at:
        values = [found.value(texts[place]) for place in places if place < len(texts)]
        if len(values) == 3 and None not in values:
            squares.append(sum(value * value for value in values if value is not None))
    return f", |f| about {sorted(squares)[len(squares) // 2] ** 0.5:.4g}," if squares else ""
