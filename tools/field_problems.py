"""Files of sections (TOML) and their fields: read, what is wrong with each by its name, in which line it stands.

The libraries that read TOML and JSON do not say where a field stands.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ConfigDict, ValidationError

from .errors import InputError, nearest

Location = tuple[int | str, ...]
"""Keys and indices that lead to a field, indices from 0."""
PATIENT = 64
"""A TOML statement of more lines is looked for at lines that can end one only."""

_BLANK = re.compile(r"[ \t\r\n]*")


class Section(BaseModel):
    """A table of a file: no key beside its fields. Those with ``exclude=True`` are the program's: no file has them."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, arbitrary_types_allowed=True)

    def given(self, *names: str) -> list[str]:
        """Which of these fields are given."""
        return [name for name in names if getattr(self, name) is not None]

    def as_written(self) -> dict[str, Any]:
        """The section with all defaults filled in, as plain values."""
        return self.model_dump(mode="json", by_alias=True, exclude_none=True)


File = TypeVar("File", bound=Section)


def read_sections(content: bytes, path: Path, model: type[File], **origin: Any) -> File:
    """What a TOML file says, whose `schema` is that of the model.

    Parameters
    ----------
    content : bytes
        of the file
    path : Path
        what messages call it
    model : type
    origin
        values of the fields that no file has

    Raises
    ------
    InputError
        not UTF-8, not TOML (with the line), or the first field that is missing, unknown or wrong
    """
    schema = model.model_fields["schema_"].default
    try:
        data = tomllib.loads(content.decode("utf-8-sig").replace("\r\n", "\n"))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is not UTF-8 text (byte {error.start + 1})") from error
    except ValueError as error:
        raise InputError(f"{path}: is not TOML: {error}") from error
    except RecursionError as error:
        what = schema.partition(".")[2].partition("/")[0]
        raise InputError(f"{path}: is not a {what} (nested too deeply)") from error
    if "schema" not in data:
        raise InputError(f'{path}: schema is missing; write schema = "{schema}"')
    for name in origin:
        if name in data:
            raise InputError(f"{path}: {name}: unknown key; it is not for files")
    return checked_sections({**data, **origin}, model, str(path))


def checked_sections(data: Mapping[str, Any], model: type[File], label: str = "") -> File:
    """The same from what would stand in a file, which messages call by its label."""
    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        said = field_problems(error, model)[0].text
        raise InputError(f"{label}: {said}" if label else said) from error


@dataclass(frozen=True)
class FieldProblem:
    """What is wrong with one field.

    Attributes
    ----------
    location : tuple of str and int
    text : str
        one line that begins with the field's dotted name
    """

    location: Location
    text: str


def dotted(location: Location) -> str:
    """`fmus.table.component`, `connections[2].from`: entries of a list are counted from 1."""
    text = ""
    for part in location:
        text += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if text else part
    return text


def field_problems(error: ValidationError, model: type[BaseModel]) -> list[FieldProblem]:
    """Everything that is wrong, in the order of the model that was checked."""
    problems = error.errors()
    unknown = [_location(problem) for problem in problems if problem["type"] == "extra_forbidden"]
    return [_problem(problem, model, unknown) for problem in problems]


def _location(problem: Mapping[str, Any]) -> Location:
    return tuple(part for part in problem["loc"] if part != "[key]")


def _problem(problem: Mapping[str, Any], model: type[BaseModel], unknown: Sequence[Location]) -> FieldProblem:
    where = _location(problem)
    name = dotted(where)
    if problem["type"] == "extra_forbidden":
        return FieldProblem(where, f"{name}: unknown key; {nearest(str(where[-1]), _keys_beside(where, model))}")
    if problem["type"] == "missing":
        beside = [str(other[-1]) for other in unknown if other[:-1] == where[:-1]]
        close = get_close_matches(str(where[-1]), beside, n=1)
        meant = f" (is '{close[0]}' meant?)" if close else ""
        return FieldProblem(where, f"{name}: is missing{meant}")
    message = problem["msg"].removeprefix("Value error, ")
    shown = repr(problem["input"])
    if problem["type"] != "value_error" and len(shown) < 60:
        message += f", not {shown}"
    return FieldProblem(where, " ".join((f"{name}: {message}" if name else message).split()))


def _keys_beside(location: Location, model: type[BaseModel]) -> list[str]:
    """The keys that are known where the last part of a location stands."""
    at: type[BaseModel] | None = model
    for part in location[:-1]:
        if at is None:
            break
        for name, field in at.model_fields.items():
            if part in (name, field.alias):
                at = _model_in(field.annotation)
                break
    return [] if at is None else [field.alias or name for name, field in at.model_fields.items() if not field.exclude]


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The model that an annotation holds: alone, in a list or as the values of a dictionary."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((found for inner in get_args(annotation) if (found := _model_in(inner)) is not None), None)


def line_of(lines: Mapping[Location, int], location: Location) -> int | None:
    """The line of a field, or of the innermost section around it that the file has."""
    for length in range(len(location), 0, -1):
        if location[:length] in lines:
            return lines[location[:length]]
    return None


def toml_lines(text: str) -> dict[Location, int]:
    """Location -> line, counted from 1, of every table and every key of a TOML file.

    Parameters
    ----------
    text : str
        a file that `tomllib` reads; lines end with a line feed
    """
    lines = text.split("\n")
    found: dict[Location, int] = {}
    tables: dict[Location, int] = {}
    section: Location = ()
    row = 0
    while row < len(lines):
        written = lines[row].strip()
        if not written or written.startswith("#"):
            row += 1
        elif written.startswith("["):
            section = _header(written, tables)
            for length in range(1, len(section) + 1):
                found.setdefault(section[:length], row + 1)
            row += 1
        else:
            after, statement = _statement(lines, row)
            for location in _locations(statement):
                found.setdefault((*section, *location), row + 1)
            row = after
    return found


def _header(written: str, tables: dict[Location, int]) -> Location:
    """The location of `[a.b]` or `[[a.b]]`; `tables` counts the entries of arrays of tables."""
    inner, is_entry = tomllib.loads(written), written.startswith("[[")
    names: list[str] = []
    while isinstance(inner, dict) and inner:
        ((name, inner),) = inner.items()
        names.append(name)
    location: Location = ()
    for place, name in enumerate(names):
        location = (*location, name)
        if is_entry and place == len(names) - 1:
            tables[location] = tables.get(location, -1) + 1
        if location in tables:
            location = (*location, tables[location])
    return location


def _statement(lines: list[str], row: int) -> tuple[int, dict[str, Any]]:
    """The row behind the statement that begins at `row`, and what it says: the fewest lines that are TOML."""
    for after in range(row + 1, len(lines) + 1):
        if after - row > PATIENT and not lines[after - 1].rstrip().endswith(("]", "}", '"', "'")):
            continue
        try:
            return after, tomllib.loads("\n".join(lines[row:after]))
        except tomllib.TOMLDecodeError:
            continue
    return len(lines), {}


def _locations(value: object) -> Iterator[Location]:
    """Everything inside a value, by its location."""
    inner: Iterator[tuple[int | str, object]]
    if isinstance(value, dict):
        inner = iter(value.items())
    elif isinstance(value, list):
        inner = iter(enumerate(value))
    else:
        return
    for key, item in inner:
        yield (key,)
        yield from ((key, *rest) for rest in _locations(item))


def json_lines(text: str) -> dict[Location, int]:
    """Location -> line, counted from 1, of every member and element of a JSON text that `json` reads."""
    found: dict[Location, int] = {}
    counted = [0, 1]

    def line(at: int) -> int:
        counted[1] += text.count("\n", counted[0], at)
        counted[0] = at
        return counted[1]

    def blank(at: int) -> int:
        space = _BLANK.match(text, at)
        return space.end() if space else at

    def walk(at: int, location: Location) -> int:
        at = blank(at)
        if location:
            found.setdefault(location, line(at))
        if text[at] not in "{[":
            return json.JSONDecoder().raw_decode(text, at)[1]
        is_object, number = text[at] == "{", 0
        at = blank(at + 1)
        while text[at] not in "}]":
            key: int | str = number
            if is_object:
                found_key, at = json.JSONDecoder().raw_decode(text, at)
                key = str(found_key)
                found[(*location, key)] = line(at)
                at = blank(at) + 1
            at = blank(walk(at, (*location, key)))
            at = blank(at + 1) if text[at] == "," else at
            number += 1
        return at + 1

    walk(0, ())
    return found
