"""Findings of a check: problems with the lines of their fields.

The libraries that read TOML and JSON do not give the line of a field.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from ..errors import InputError
from ..result import Location, Result

if TYPE_CHECKING:
    from polars import DataFrame

PATIENT = 64
"""Number of lines of a TOML statement beyond which only lines that can end one are tried."""
_BLANK = re.compile(r"[ \t\r\n]*")
_PART = re.compile(r"\.?([A-Za-z_][\w-]*)|\[(\d+)\]")
_NUMBERED = re.compile(r"^(connections|stimuli|fmus\.[\w-]+\.effects)\[\d+\]")


class Problem(Result):
    """A problem of a file.

    Attributes
    ----------
    line : int or None
        line, as an editor counts; None if the file has no lines or all of it is meant
    text : str
        one line with the field or column and the correct form
    """

    line: int | None = None
    text: str


class Check(Result):
    """A checked file: schema trihedron.check/1.

    Attributes
    ----------
    file, kind : str
        its name, and its kind, such as "scenario" or "position record"; "unknown" if it cannot be recognised
    good : bool
        True if there are no problems
    problems : tuple of Problem
        all problems, by line
    not_listed : int
        number of further problems
    warnings, summary : tuple of str
        possible misunderstandings; content of a good file
    """

    schema_: Literal["trihedron.check/1"] = Field(default="trihedron.check/1", alias="schema")
    file: str
    kind: str
    good: bool
    problems: tuple[Problem, ...] = ()
    not_listed: int = 0
    warnings: tuple[str, ...] = ()
    summary: tuple[str, ...] = ()

    @property
    def verdict(self) -> str:
        """Verdict in one line."""
        if self.good:
            article = "a"
            if self.kind[0] in "aeoFS":
                article = "an"
            return f"{self.file}: {article} {self.kind}, nothing is wrong"
        count = len(self.problems) + self.not_listed
        noun = "problem"
        if count > 1:
            noun = "problems"
        return f"{self.file}: {count} {noun} ({self.kind})"

    def to_polars(self) -> "DataFrame":
        """Return the problems as a table: line, text."""
        import polars as pl

        rows = [(problem.line, problem.text) for problem in self.problems]
        return pl.DataFrame(rows, schema={"line": pl.Int64, "text": pl.String}, orient="row")


class Findings:
    """The findings of a file; `lines` has the line of each field."""

    def __init__(self, path: Path, kind: str = "unknown"):
        self.path, self.kind = path, kind
        self.lines: Mapping[Location, int] = {}
        self.problems: list[Problem] = []
        self.warnings: tuple[str, ...] = ()
        self.summary: tuple[str, ...] = ()

    def add(self, text: str, location: Location = (), line: int | None = None) -> None:
        """Note a problem, once for each field."""
        if line is not None or all(text != problem.text for problem in self.problems):
            if line is None:
                line = line_at(self.lines, location)
            self.problems.append(Problem(text=text, line=line))

    @contextmanager
    def of(self, location: Location = (), number: int | None = None) -> Iterator[None]:
        """Note errors of the block as problems of the field at a location; by default the message names the field.

        `number` of the connection, stimulus or effect, from 1, replaces the number in the message.
        """
        try:
            yield
        except InputError as error:
            text = str(error).removeprefix(f"{self.path}: ")
            if number is not None:
                text = _NUMBERED.sub(rf"\1[{number}]", text)
            self.add(text, location or named_location(text))

    def check(self, most: int | None = None) -> Check:
        """Return all findings, the problems by line, those without a line first; list at most `most` of them."""
        problems = sorted(self.problems, key=lambda problem: problem.line or 0)
        not_listed = 0
        if most is not None:
            not_listed = len(problems[most:])
        return Check(
            file=str(self.path),
            kind=self.kind,
            good=not problems,
            problems=tuple(problems[:most]),
            not_listed=not_listed,
            warnings=self.warnings,
            summary=self.summary,
        )


def named_location(text: str) -> Location:
    """Return the location of the dotted name with which a message begins."""
    location: list[int | str] = []
    at = 0
    while match := _PART.match(text, at):
        if match[1] is not None:
            location.append(match[1])
        else:
            location.append(int(match[2]) - 1)
        at = match.end()
    return tuple(location)


def line_at(lines: Mapping[Location, int], location: Location) -> int | None:
    """Return the line of a field, or of the innermost section around it in the file."""
    for length in range(len(location), 0, -1):
        if location[:length] in lines:
            return lines[location[:length]]
    return None


def toml_lines(text: str) -> dict[Location, int]:
    """Return location -> line, from 1, of every table and key of a TOML file that `tomllib` reads, with line feeds."""
    lines = text.split("\n")
    line_at: dict[Location, int] = {}
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
                line_at.setdefault(section[:length], row + 1)
            row += 1
        else:
            after, statement = _statement(lines, row)
            for location in _locations(statement):
                line_at.setdefault(section + location, row + 1)
            row = after
    return line_at


def _header(written: str, tables: dict[Location, int]) -> Location:
    """Return the location of `[a.b]` or `[[a.b]]`; `tables` counts the entries of arrays of tables."""
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
    """Return the row behind the statement that begins at `row`, and its content: the fewest lines that are TOML."""
    for after in range(row + 1, len(lines) + 1):
        if after - row > PATIENT and not lines[after - 1].rstrip().endswith(("]", "}", '"', "'")):
            continue
        try:
            return after, tomllib.loads("\n".join(lines[row:after]))
        except tomllib.TOMLDecodeError:
            continue
    return len(lines), {}


def _locations(value: object) -> Iterator[Location]:
    """Yield the locations of everything inside a value."""
    inner: Iterator[tuple[int | str, object]]
    if isinstance(value, dict):
        inner = iter(value.items())
    elif isinstance(value, list):
        inner = iter(enumerate(value))
    else:
        return
    for key, item in inner:
        yield (key,)
        for rest in _locations(item):
            yield (key, *rest)


def json_lines(text: str) -> dict[Location, int]:
    """Return location -> line, from 1, of every member and element of a JSON text that `json` reads."""
    line_at: dict[Location, int] = {}
    counted = [0, 1]

    def line(at: int) -> int:
        counted[1] += text.count("\n", counted[0], at)
        counted[0] = at
        return counted[1]

    def blank(at: int) -> int:
        space = _BLANK.match(text, at)
        if space is None:
            return at
        return space.end()

    def walk(at: int, location: Location) -> int:
        at = blank(at)
        if location:
            line_at.setdefault(location, line(at))
        if text[at] not in "{[":
            return json.JSONDecoder().raw_decode(text, at)[1]
        is_object, number = text[at] == "{", 0
        at = blank(at + 1)
        while text[at] not in "}]":
            inside: Location = (*location, number)
            if is_object:
                key, at = json.JSONDecoder().raw_decode(text, at)
                inside = (*location, str(key))
                line_at[inside] = line(at)
                at = blank(at) + 1
            at = blank(walk(at, inside))
            if text[at] == ",":
                at = blank(at + 1)
            number += 1
        return at + 1

    walk(0, ())
    return line_at
