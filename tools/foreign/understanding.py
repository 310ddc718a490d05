"""A sheet as far as it is understood: each column's place, unit and form; and what a person has to say."""

from collections.abc import Sequence
from dataclasses import dataclass, field

from ..records.columns import ANGLES, POSITION, Kind
from .layout import COMMENT, Layout
from .mapping import Mapping, Question
from .numbers import bare, is_missing, number, sexagesimal
from .sheet import Sheet
from .units import Unit

STANDING_DEG = 0.5
"""Rows whose angles differ by no more may have been taken at one rest [deg]."""
CLOCK, MOMENT, NUMBER, NAME = "clock", "moment", "number", "name"
"""Forms of a column: times of day, dates, numbers and angles, names."""


@dataclass(frozen=True)
class Taken:
    """How a column of the record comes from a field of a row: sign × (number - offset), in a unit.

    `beside` are the fields of further readings of the same rest.
    """

    field: int
    form: str = NUMBER
    unit: Unit | None = None
    sign: int = 1
    offset: float = 0.0
    said: str = ""
    beside: tuple[int, ...] = ()


@dataclass
class Understanding:
    """A sheet, its layout, the mapping as far as it is known, and what is asked.

    `taken` is by column of the record, and so is `beside`: fields of further readings of a rest.
    """

    sheet: Sheet
    layout: Layout
    given: Mapping
    taken: dict[str, Taken] = field(default_factory=dict)
    questions: list[Question] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    kind: Kind = POSITION
    decimal: str = "."
    thousands: str = ""
    settled: dict[str, object] = field(default_factory=dict)
    beside: dict[str, tuple[int, ...]] = field(default_factory=dict)

    def ask(self, key: str, answers: Sequence[str], why: str) -> None:
        """Ask once for a key of the mapping."""
        if all(question.key != key for question in self.questions):
            self.questions.append(Question(key, tuple(answers), why))

    def cells(self, place: int) -> list[tuple[int, str]]:
        """Line and text of a field in the rows looked at, what is missing left out."""
        rows = ((line, texts[place].strip()) for line, texts in self.looked_at if place < len(texts))
        return [(line, text) for line, text in rows if not is_missing(text, self.given.missing)]

    @property
    def looked_at(self) -> list[tuple[int, list[str]]]:
        """The first rows of data."""
        last = self.layout.last
        return [row for row in self.layout.looked_at if not last or row[0] <= last]

    @property
    def is_marked(self) -> bool:
        """Whether most rows begin with the mark of a comment: then it is none."""
        rows = [bool(texts) and texts[0].lstrip().startswith(COMMENT) for _, texts in self.looked_at]
        return 2 * sum(rows) > len(rows)

    def value(self, text: str) -> float | None:
        """A number as this file writes it."""
        found = number(text, self.decimal, self.thousands)
        return number(bare(text), self.decimal, self.thousands) if found is None else found

    @property
    def mapping(self) -> Mapping:
        """The mapping with all that is settled filled in."""
        return Mapping.model_validate({**self.given.model_dump(by_alias=True), **self.settled})

    @property
    def left_out(self) -> list[str]:
        """Names of the columns that are not taken."""
        used = {place for taken in self.taken.values() for place in (taken.field, *taken.beside)}
        return [h.text for place, h in enumerate(self.layout.headings) if place not in used and h.text]


def reading(found: Understanding, column: str, text: str) -> float | None:
    """The number of a cell in the file's unit, of an angle also from degrees and minutes; None where it is none."""
    value = found.value(text)
    if value is None and column in ANGLES:
        degrees = sexagesimal(text)
        unit = found.taken[column].unit
        return degrees if degrees is None or unit is None else (degrees - unit.offset) / unit.factor
    return value
