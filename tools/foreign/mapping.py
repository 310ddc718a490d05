"""The meaning of a file from elsewhere, as a file to fill in and reuse: `RECORD.import.toml`."""

import json
import tomllib
from collections.abc import Mapping as AnyMapping
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal

from pydantic import ConfigDict, Field

from ..errors import LONGEST_MESSAGE, InputError
from ..files import bytes_of
from ..records.columns import FORCE, RATE
from ..result import Section, checked_sections, read_sections

SCHEMA = "trihedron.mapping/1"
OPEN = "?"
"""Placeholder for an open answer in a mapping."""
LARGEST = 1_000_000
"""Largest mapping that is read [bytes]."""
_MARK = "# as proposed: "
TRIADS = {"columns.force": FORCE, "columns.rate": RATE}
"""Keys for three columns at once -> the columns of the record."""
OF_THREE = TRIADS | {f"{key}.sign": tuple(f"{column}.sign" for column in columns) for key, columns in TRIADS.items()}
"""Keys of answers for three columns -> the keys inside `columns` that they stand for."""
MOST_LINES = 5
"""Largest number of lines that show questions on a screen."""
_USUAL = (("unit", ""), ("sign", 1), ("offset", 0.0), ("positive", ""), ("beside", []))
"""Defaults of a source."""


class ColumnSource(Section):
    """Source of a column of the record.

    Attributes
    ----------
    source : str
        name of the column in the file, or its number from 1 ("from" in a file); "" if its name is understood
    unit : str
        its unit, if it differs from the other columns of its quantity
    sign : int
        -1 reverses the sign
    offset : float
        subtracted first, in the file's unit
    positive : str
        CW or CCW, E or W, N or S, L or R: the mark behind numbers that counts as positive
    beside : list of str
        columns with further readings of the same rest
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, populate_by_name=True)

    source: str = Field(default="", alias="from")
    unit: str = ""
    sign: Literal[1, -1] = 1
    offset: float = 0.0
    positive: Literal["CW", "CCW", "E", "W", "N", "S", "L", "R", "?", ""] = ""
    beside: list[str] = Field(default_factory=list)


class Mapping(Section):
    """The format of a file and the meaning of its columns; "?" is still open, and "" needs no answer.

    Attributes
    ----------
    preset : str
        name of a known layout of columns and units, as px4
    part : str
        part of a file that holds several tables, as imu/data_raw
    kind : str
        position record, raw record or strapdown record
    sheet, encoding, separator : str
        sheet of a workbook; encoding and separator of a text
    decimal, thousands : str
        marks in numbers
    names, units_row, first, last : int
        lines, as an editor counts: of the names, of the units (0: none), of the first and last data (last 0: the end)
    dates, clock : str
        day-first, month-first or year-first; meaning of a time of two parts, h:m or m:s
    readings : str
        several rows at one position: "average" them, or "each" is a rest
    beside : str
        columns that differ only by a number: "average" readings of one rest, or "none": they are other sensors
    incomplete : str
        "leave out" rows with an empty cell, if they are many
    attitude : str
        direction of a quaternion: body to reference, reference to body, or none
    time : str
        "order": no times were written, rows count as 1 s apart
    integers : str
        meaning of large counts: "signed 16" (two's complement of 16 bits), 24, 32; "offset 10" (zero in the middle of
        the range of 10 bits), 12, 14, 16, 18, 20, 24; or "unsigned"
    clock_changes : str
        jumps of local times by an hour: "corrected", or "none" is a change of the clock
    lag : float or "?"
        time of the gyros behind the accelerometers that is removed where two files are joined [s]
    missing : tuple of str
        further texts for a missing measurement; "none": numbers as -9999 are readings
    units : dict
        quantity (force, rate, angle, time, temperature) -> unit, or a sensitivity as "16384 LSB/g"
    columns : dict
        column of the record -> ColumnSource
    """

    schema_: Literal["trihedron.mapping/1"] = Field(alias="schema", default=SCHEMA)
    preset: str = ""
    part: str = ""
    kind: Literal[
        "position record", "raw record", "strapdown record", "accelerometer record", "pose record", "?", ""
    ] = ""
    sheet: str = ""
    encoding: str = ""
    separator: str = ""
    decimal: Literal[".", ",", "?", ""] = ""
    thousands: str = ""
    names: int = Field(default=-1, ge=-1)
    units_row: int = Field(default=-1, ge=-1)
    first: int = Field(default=-1, ge=-1)
    last: int = Field(default=0, ge=0)
    dates: Literal["day-first", "month-first", "year-first", "?", ""] = ""
    clock: Literal["h:m", "m:s", "?", ""] = ""
    readings: Literal["average", "each", "?", ""] = ""
    beside: Literal["average", "none", "?", ""] = ""
    incomplete: Literal["leave out", "?", ""] = ""
    attitude: Literal["body to reference", "reference to body", "none", "?", ""] = ""
    time: Literal["order", "?", ""] = ""
    integers: Literal[
        "signed 16",
        "signed 24",
        "signed 32",
        "offset 10",
        "offset 12",
        "offset 14",
        "offset 16",
        "offset 18",
        "offset 20",
        "offset 24",
        "unsigned",
        "?",
        "",
    ] = ""
    clock_changes: Literal["corrected", "none", "?", ""] = ""
    lag: float | Literal["?", ""] = ""
    missing: list[str] = Field(default_factory=list)
    units: dict[str, str] = Field(default_factory=dict)
    columns: dict[str, ColumnSource | str] = Field(default_factory=dict)

    def of(self, column: str) -> ColumnSource:
        """Return the source of a column; one without a name if the user gave none."""
        source = self.columns.get(column, OPEN)
        if isinstance(source, str):
            return ColumnSource.model_validate({"from": "" if source == OPEN else source})
        return source


@dataclass(frozen=True)
class Question:
    """A fact that a file leaves open: the key of the mapping, possible answers, and the reason for the question."""

    key: str
    answers: tuple[str, ...]
    why: str

    def __str__(self) -> str:
        options = " or ".join(f"--set {shell_word(f'{self.key}={answer}')}" for answer in self.answers)
        return f"{options} ({self.why})"


class OpenQuestions(InputError):
    """Questions about a file; the message is one line, `lines` shows a question on each.

    `header` and `rows` are the names and the first rows of the file as read.
    """

    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()

    def __init__(self, what: str, questions: Sequence[Question], advice: str = ""):
        super().__init__(printable(f"{what}: {'; '.join(map(str, questions))}{advice}"))
        self.questions = tuple(questions)
        rows = [str(question) for question in questions]
        if len(rows) > MOST_LINES:
            rows = [*rows[: MOST_LINES - 1], "; ".join(rows[MOST_LINES - 1 :])]
        self.lines = [what, *(f"  {row}" for row in rows)]
        if len(questions) > 1:
            ready = [f"--set {shell_word(f'{question.key}={question.answers[0]}')}" for question in questions]
            answers = f"the likeliest answers: {' '.join(ready)}"
            # A command that is cut short would answer other questions.
            if len(answers) <= LONGEST_MESSAGE:
                self.lines.append(answers)
        if advice:
            self.lines.append(advice.removeprefix("; "))


def channels_of(text: str, option: str) -> list[str]:
    """Return the three columns of an answer: names or numbers between commas.

    Raises InputError if they are not three.
    """
    names = [name.strip() for name in text.split(",")]
    if len(names) != 3:
        raise InputError(f"{option}: three columns are needed, as 2,3,4")
    return names


def plural(count: int, noun: str) -> str:
    """Return a number and its noun: "1 row", "2 rows"."""
    return f"{count} {noun}{'s' * (count > 1)}"


def printable(text: str) -> str:
    """Return a text in one line without control characters, for foreign names and cells."""
    return "".join(character if character.isprintable() else " " for character in text)


def shell_word(text: str) -> str:
    """Return a word quoted for a shell."""
    plain = all(c.isalnum() or c in "=.,/+-_:%@" for c in text)
    if plain:
        return text
    return "'" + text.replace("'", "'\\''") + "'"


def read_mapping(path: Path) -> dict[str, Any]:
    """Return the content of a mapping file, checked field by field.

    Raises InputError with the field, or with the line that is not TOML.
    """
    content = bytes_of(path, "a mapping (.toml) is needed")
    if len(content) > LARGEST:
        raise InputError(f"{path}: is larger than {LARGEST} bytes; a mapping is needed")
    read_sections(content, path, Mapping)
    return tomllib.loads(content.decode("utf-8-sig").replace("\r\n", "\n"))


def with_answers(content: AnyMapping[str, Any], answers: AnyMapping[str, str]) -> Mapping:
    """Return a mapping with answers (dotted key -> text) filled in.

    Raises InputError with the answer that is impossible.
    """
    filled = json.loads(json.dumps(dict(content)))
    columns = filled.get("columns", {})
    # a file that is filled in has answers for three columns, too
    for_three = {f"columns.{key}": columns.pop(key) for key in list(columns) if f"columns.{key}" in OF_THREE}
    answers = {key: str(text) for key, text in for_three.items() if text != OPEN} | dict(answers)
    for key, text in answers.items():
        option = f"--set {key}={text}"
        name, _, inner = key.partition(".")
        value: Any = text
        try:
            if name in ("names", "units_row", "first", "last") or inner.endswith(".sign"):
                value = int(text)
            elif name == "missing":
                value = filled.get("missing", []) + text.split(",")
            elif inner.endswith(".offset") or name == "lag":
                value = float(text)
        except ValueError as error:
            raise InputError(f"{option}: a number is needed") from error
        if key in OF_THREE:
            values = [value] * 3 if inner.endswith(".sign") else channels_of(text, option)
            for column, value in zip(OF_THREE[key], values, strict=True):
                _put_inside(filled.setdefault(name, {}), name, column, value, option)
        elif name in ("units", "columns"):
            _put_inside(filled.setdefault(name, {}), name, inner, value, option)
        elif inner:
            raise InputError(f"{option}: unknown key; {name} has none inside")
        else:
            filled[name] = value
        checked_sections(filled, Mapping, option)
    return checked_sections(filled, Mapping)


def _put_inside(section: dict[str, Any], name: str, inner: str, value: Any, option: str) -> None:
    """Set `key` or `key.part` of the units or columns of a mapping."""
    if not inner:
        example = {"units": "force", "columns": "f1_mps2"}[name]
        raise InputError(f"{option}: name one of the {name}, as {name}.{example}")
    key, _, part = inner.partition(".")
    before = section.get(key, OPEN)
    if not isinstance(before, dict) and part:
        before = {} if before == OPEN else {"from": before}
    section[key] = before | {part or "from": value} if isinstance(before, dict) else value


def mapping_text(mapping: Mapping, questions: Sequence[Question], notes: Sequence[str]) -> str:
    """Return the text of a mapping's file: open keys with their answers, `notes` as comments at the end."""
    open_keys = {question.key: question for question in questions}
    lines = ["# What a file means to Trihedron: edit what is wrong, and use it again with --mapping."]
    if questions:
        lines.append(f'# Fill in the {plural(len(open_keys), "line")} with "?".')
    sections = mapping.as_written()
    units, columns = sections.pop("units"), sections.pop("columns")
    for prefix, section in (("", sections), ("units", units), ("columns", columns)):
        if prefix:
            inside = (key.partition(".")[2] for key in open_keys if key.startswith(f"{prefix}."))
            section = section | dict.fromkeys((key for key in inside if key not in section), OPEN)
            if section:
                lines += ["", f"[{prefix}]"]
        for key, value in section.items():
            question = open_keys.get(f"{prefix}.{key}" if prefix else key)
            if question is not None:
                lines.append(f"{_key(key)} = {_value(OPEN)}  # {' or '.join(question.answers)}: {question.why}")
            elif value not in ("", [], -1) and (key, value) != ("last", 0):
                lines.append(f"{_key(key)} = {_value(value)}")
    lines.append("")
    for note in notes:
        lines.append(f"# {note}")
    text = "\n".join(lines).rstrip() + "\n"
    return f"{text}{_MARK}{sha256(text.encode()).hexdigest()[:16]}\n"


def _key(name: str) -> str:
    if name.replace("_", "").replace("-", "").isalnum() and name.isascii():
        return name
    return json.dumps(name)


def _value(value: Any) -> str:
    """Return a value in TOML."""
    if isinstance(value, AnyMapping):
        fields = {key: inner for key, inner in value.items() if (key, inner) not in _USUAL}
        if list(fields) == ["from"]:
            return _value(fields["from"])
        return "{ " + ", ".join(f"{key} = {_value(inner)}" for key, inner in fields.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    # TOML and JSON write strings and numbers alike, except for one character
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def refuse_edited(path: Path) -> None:
    """Refuse to overwrite a mapping that a person has edited: use it, or remove it."""
    try:
        if not path.exists():
            return
        text, mark, digest = path.read_text(encoding="utf-8").rpartition(_MARK)
    except (OSError, UnicodeDecodeError):
        text, mark, digest = "", "", ""
    if not mark or sha256(text.encode()).hexdigest()[:16] != digest.strip():
        raise InputError(f"{path}: was edited; use it with --mapping {shell_word(str(path))}, or remove it")
