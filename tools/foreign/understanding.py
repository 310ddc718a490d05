"""The understanding of a sheet: each column's place, unit and form, and the questions to the user."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cached_property
from typing import Literal

import polars as pl

from ..records.columns import ANGLES, POSITION, RecordKind
from .layout import COMMENT, SheetLayout
from .mapping import OPEN, SCHEMA, Mapping, Question
from .names import QUANTITY_OF, Heading
from .numbers import bare, is_missing, parsed_number, sexagesimal
from .sheet import Row, Sheet, cell
from .units import OPPOSITE, LaboratoryUnit, known_unit, sense_behind

STANDING_DEG = 0.5
"""Largest difference of angles within one rest [deg]."""
CLOCK, MOMENT, NUMBER, NAME = "clock", "moment", "number", "name"
"""Forms of a column: times of day, dates, numbers and angles, names."""


@dataclass(frozen=True, eq=False)
class Field:
    """A field of the rows: its place from 0, its head, and its examined rows."""

    place: int
    head: Heading
    rows: list[Row]
    missing: Sequence[str]
    is_unique: bool = True

    @property
    def label(self) -> str:
        """The head, or the number from 1 if it has none of its own."""
        return self.head.text if self.head.text and self.is_unique else str(self.place + 1)

    @cached_property
    def cells(self) -> list[tuple[int, str]]:
        """Line and text of each cell that is not missing."""
        cells = ((line, cell(texts, self.place).strip()) for line, texts in self.rows)
        return [(line, text) for line, text in cells if not is_missing(text, self.missing)]

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
        return self.unit.quantity if self.unit else ""


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
    `given` is the user's mapping without a known layout. `proposed` has the likeliest fields of an open quantity,
    `whole` the columns of a large text. `start` [s] is the time of the first row if times count from it.
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
    whole: pl.DataFrame | None = None
    given: Mapping = field(default_factory=lambda: Mapping(schema=SCHEMA))
    proposed: dict[str, tuple[Field, ...]] = field(default_factory=dict)
    start: Decimal = Decimal(0)

    @cached_property
    def rows(self) -> list[Row]:
        """First rows of data."""
        last = self.layout.last
        return [row for row in self.layout.looked_at if not last or row[0] <= last]

    @cached_property
    def fields(self) -> list[Field]:
        """Fields of the rows, in order."""
        names, missing = Counter(head.text for head in self.layout.headings), self.mapping.missing
        return [
            Field(place, head, self.rows, missing, names[head.text] == 1)
            for place, head in enumerate(self.layout.headings)
        ]

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
        used = {field for origin in self.origins.values() for field in (origin.field, *origin.beside)}
        return [field for field in self.fields if field not in used]

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
        sense = "" if text[-1:].isdigit() else sense_behind(text, quantity)
        if sense and table.value(text) is not None:
            why = f"{table.origins[column].name!r} has {text.strip()!r}: which sense is positive"
            table.ask(f"columns.{column}.positive", (sense, OPPOSITE[sense]), why)
            return
