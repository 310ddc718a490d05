"""The understanding of a sheet: each column's place, unit and form, and the questions to the user."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal

from ..errors import InputError
from ..records.columns import ANGLES, FORCE, POSITION, RecordKind
from .layout import COMMENT, SheetLayout
from .mapping import OPEN, Mapping, Question
from .names import QUANTITY_OF, SAMPLE, TIMES, Heading
from .numbers import (
    COUNTS,
    DOUBTFUL,
    EXAMPLES,
    OPPOSITE,
    QUANTITIES,
    TIME,
    LaboratoryUnit,
    bare,
    is_missing,
    known_unit,
    of_converter,
    parsed_number,
    scaled_unit,
    sense_behind,
    sexagesimal,
    spelled_unit,
    unit_behind,
)
from .sheet import Row, Sheet, cell

STANDING_DEG = 0.5
"""Largest difference of angles within one rest [deg]."""
CLOCK, MOMENT, NUMBER, NAME = "clock", "moment", "number", "name"
"""Forms of a column: times of day, dates, numbers and angles, names."""
SENSITIVITIES = {
    "force": ("0.5 g", "16384 LSB/g"),
    "rate": ("0.01 (deg/s)", "131 LSB/(deg/s)"),
    "angle": ("0.01 deg", ""),
    "velocity": ("0.001 m/s", ""),
    "time": ("0.001 s", ""),
    "temperature": ("0.01 degC", ""),
}
"""Quantity -> an example of one volt or count, and a sensitivity as data sheets write it."""
DAYS = (30_000.0, 80_000.0)
"""Range of times that may be dates as a workbook counts them: days since 1900."""


@dataclass(frozen=True, eq=False)
class Field:
    """A field of the rows: its place from 0, its head, and its examined rows."""

    place: int
    head: Heading
    rows: list[Row]
    missing: Sequence[str]

    @property
    def label(self) -> str:
        """The head, or the number from 1 if it has none."""
        return self.head.text or str(self.place + 1)

    @cached_property
    def cells(self) -> list[tuple[int, str]]:
        """Line and text of each cell that is not missing."""
        filled = []
        for line, texts in self.rows:
            text = cell(texts, self.place).strip()
            if not is_missing(text, self.missing):
                filled.append((line, text))
        return filled

    @cached_property
    def texts(self) -> list[str]:
        """Texts of the cells."""
        return [text for _, text in self.cells]

    @cached_property
    def unit(self) -> LaboratoryUnit | None:
        """Unit in the head."""
        return known_unit(self.head.unit)

    @property
    def quantity(self) -> str:
        """Quantity of that unit; "" if there is none."""
        if self.unit:
            return self.unit.quantity
        return ""


@dataclass(frozen=True)
class Origin:
    """Conversion of a field of a row to a column of the record: sign × (number - offset), in a unit.

    `beside` are the fields of further readings of the same rest.
    """

    field: Field
    form: str = NUMBER
    unit: LaboratoryUnit | None = None
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    beside: tuple[Field, ...] = ()

    @property
    def name(self) -> str:
        """The column's head in words."""
        return self.field.head.text or f"field {self.field.place + 1}"


@dataclass
class UnderstoodTable:
    """A sheet, its layout, the user's mapping, and all further answers and questions.

    The keys of `origins` and `beside` are columns of the record; `beside` has the fields of further readings of a rest.
    """

    sheet: Sheet
    layout: SheetLayout
    mapping: Mapping
    origins: dict[str, Origin] = field(default_factory=dict)
    questions: list[Question] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    kind: RecordKind = POSITION
    decimal: str = "."
    thousands: str = ""
    settled: dict[str, object] = field(default_factory=dict)
    beside: dict[str, tuple[Field, ...]] = field(default_factory=dict)

    @cached_property
    def rows(self) -> list[Row]:
        """First rows of data."""
        last = self.layout.last
        rows = []
        for row in self.layout.looked_at:
            if not last or row[0] <= last:
                rows.append(row)
        return rows

    @cached_property
    def fields(self) -> list[Field]:
        """Fields of the rows, in order."""
        missing = self.mapping.missing
        return [Field(place, head, self.rows, missing) for place, head in enumerate(self.layout.headings)]

    @cached_property
    def filled(self) -> list[Field]:
        """Fields with content: a named but empty column of a template does not count."""
        return [field for field in self.fields if field.cells]

    @cached_property
    def is_marked(self) -> bool:
        """True if most rows begin with the mark of a comment: then it does not mark one."""
        marked = sum(bool(texts) and texts[0].lstrip().startswith(COMMENT) for _, texts in self.rows)
        return 2 * marked > len(self.rows)

    @property
    def whole_mapping(self) -> Mapping:
        """Return the mapping with all answers filled in."""
        return Mapping.model_validate({**self.mapping.model_dump(by_alias=True), **self.settled})

    @property
    def free_fields(self) -> list[Field]:
        """Return the fields that no column of the record uses."""
        origins = set[Field]()
        for origin in self.origins.values():
            origins |= {origin.field, *origin.beside}
        return [field for field in self.fields if field not in origins]

    def ask(self, key: str, answers: Sequence[str], why: str) -> None:
        """Ask once for a key of the mapping."""
        if not self.is_asked(key):
            self.questions.append(Question(key, tuple(answers), why))

    def is_asked(self, *keys: str) -> bool:
        """Return True if one of these keys is an open question."""
        return any(question.key in keys for question in self.questions)

    def value(self, text: str) -> float | None:
        """Return a number as this file writes it."""
        value = parsed_number(text, self.decimal, self.thousands)
        if value is None:
            return parsed_number(bare(text), self.decimal, self.thousands)
        return value

    def values(self, texts: Iterable[str]) -> list[float]:
        """Return the numbers among some texts."""
        return [value for value in map(self.value, texts) if value is not None]

    def reading(self, column: str, text: str) -> float | None:
        """Return the number of a cell in the file's unit, also from degrees and minutes; None if it is not a number."""
        value = self.value(text)
        if value is not None or column not in ANGLES:
            return value
        degrees = sexagesimal(text)
        unit = self.origins[column].unit
        if degrees is None or unit is None:
            return degrees
        return (degrees - unit.offset) / unit.factor


def ask_of_senses(table: UnderstoodTable, column: str, texts: Sequence[str]) -> None:
    """Ask for the positive sense if numbers have marks such as CW and CCW behind them."""
    if table.mapping.of(column).positive not in ("", OPEN):
        return
    quantity = QUANTITY_OF.get(column, "")
    for text in texts:
        sense = ""
        if not text[-1:].isdigit():
            sense = sense_behind(text, quantity)
        if sense and table.value(text) is not None:
            why = f"{table.origins[column].name!r} has {text.strip()!r}: which sense is positive"
            table.ask(f"columns.{column}.positive", (sense, OPPOSITE[sense]), why)
            return


def decide_units(table: UnderstoodTable) -> None:
    """Decide the unit of each column: given for it, given for its quantity, in its head, or asked for."""
    units = table.mapping.units
    agreed: dict[str, set[str]] = {}
    for key in units:
        if key not in QUANTITIES:
            raise InputError(f"units.{key}: is no quantity; {', '.join(QUANTITIES)}")
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
        quantity = QUANTITY_OF.get(question.key.removeprefix("columns."), "")
        if quantity and quantity not in stated and quantity not in agreed and quantity not in units:
            _ask_for_unit(table, quantity)
    table.settled["units"] = {quantity: min(texts) for quantity, texts in agreed.items() if len(texts) == 1}
    table.settled["units"] |= {quantity: text for quantity, text in units.items() if text != OPEN}


def _ask_for_unit(table: UnderstoodTable, quantity: str) -> None:
    """Ask for the unit of a quantity whose columns are unknown; a free field may hold a converter's output."""
    sources = {origin.field for origin in table.origins.values()}
    for free in table.fields:
        if free not in sources and free.unit and free.unit.raw:
            raw = free.head.unit
            table.ask(f"units.{quantity}", (example_sensitivity(quantity, raw),), f"what one {raw} is, as here")
            return
    table.ask(f"units.{quantity}", EXAMPLES[quantity][:3], f"no unit of {quantity} is written")


def _unit(table: UnderstoodTable, column: str, origin: Origin) -> tuple[LaboratoryUnit | None, str]:
    """Return the unit of a column and its text; None if the user must be asked for it."""
    quantity, head, texts = QUANTITY_OF[column], origin.field.head, origin.field.texts
    source = table.mapping.of(column)
    if source.unit:
        key = f"columns.{column}.unit"
    else:
        key = f"units.{quantity}"
    text = head.unit
    for written in texts:
        if not text and not sense_behind(written, quantity):
            text = unit_behind(written)
    doubtful = DOUBTFUL.get(spelled_unit(text).lower(), ())
    stated = None
    if not doubtful:
        stated = known_unit(text)
    is_raw = stated is not None and stated.raw
    answer = source.unit or table.mapping.units.get(quantity, "")
    if answer not in ("", OPEN):
        unit = scaled_unit(answer)
        if unit is not None and unit.per is not None:
            unit = of_converter(unit, stated if is_raw else None)
        if unit is None or unit.raw or unit.quantity != quantity:
            examples = f"{', '.join(EXAMPLES[quantity])} or '16384 LSB/g'"
            raise InputError(f"{key} = {answer!r}: is no unit of {quantity}; as {examples}")
        return unit, answer
    if stated is not None and stated.quantity == quantity:
        return stated, text
    if column in ANGLES and texts and all(table.value(t) is None and sexagesimal(t) is not None for t in texts):
        return known_unit("deg"), "deg"
    answers: Sequence[str] = EXAMPLES[quantity][:3]
    if is_raw:
        answers, why = (
            (example_sensitivity(quantity, text),),
            f"{head.text!r} is in {text}: what one {text} is, as here",
        )
    elif doubtful:
        answers, why = doubtful, f"what {text!r} of {head.text!r} is"
    elif text and text != head.text:
        why = f"{text!r} of {head.text!r} is no unit of {quantity} that is known"
    elif column == SAMPLE:
        answers, why = ("100 Hz",), f"{head.text!r} counts samples: at which rate"
    else:
        values = table.values(texts)
        # as a workbook counts days since 1900
        if quantity == TIME and values and DAYS[0] < min(values) and max(values) < DAYS[1]:
            answers = ("d", "s", "ms")
        size = ""
        if quantity == "force":
            size = _size(table)
        why = f"no unit of {head.text or origin.name!r}{size} is written"
    table.ask(key, answers, why)
    return None, ""


def example_sensitivity(quantity: str, text: str) -> str:
    """Return an example of one volt or count of a quantity; `text` is the converter's unit."""
    volt, count = SENSITIVITIES[quantity]
    unit = known_unit(text)
    if count and unit is not None and unit.quantity == COUNTS:
        return count.replace("LSB", spelled_unit(text))
    return f"{volt}/{spelled_unit(text)}"


def _size(table: UnderstoodTable) -> str:
    """Return the median size of the specific forces, which shows their unit to a person."""
    fields = []
    for column in FORCE:
        if column in table.origins:
            fields.append(table.origins[column].field)
    squares = []
    for _, texts in table.rows:
        values = table.values(cell(texts, field.place) for field in fields)
        if len(values) == 3:
            squares.append(sum(value * value for value in values))
    if squares:
        return f", |f| about {sorted(squares)[len(squares) // 2] ** 0.5:.4g},"
    return ""
