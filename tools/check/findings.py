"""What a check of a file has found: problems, gathered one after the other, with the lines of their fields."""

import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from pydantic import Field

from ..errors import InputError
from ..field_problems import Location
from ..result import Result
from .lines import line_of

if TYPE_CHECKING:
    from polars import DataFrame

_PART = re.compile(r"\.?([A-Za-z_][\w-]*)|\[(\d+)\]")
_NUMBERED = re.compile(r"^(connections|stimuli)\[\d+\]")


class Problem(Result):
    """Something that is wrong.

    Attributes
    ----------
    line : int or None
        where, as an editor counts lines; None where the file has no lines or the whole is meant
    text : str
        one line that names the field or column and says what would be right
    """

    line: int | None = None
    text: str

    def __init__(self, text: str, line: int | None = None) -> None:
        fields: dict[str, Any] = {"text": text, "line": line}
        super().__init__(**fields)


class Check(Result):
    """A file that was checked: schema trihedron.check/1.

    Attributes
    ----------
    file, kind : str
        its name, and what it is, as "scenario" or "position record"; "unknown" where that cannot be told
    good : bool
        whether nothing is wrong
    problems : tuple of Problem
        everything that is wrong, by line
    not_listed : int
        problems beside these
    warnings, summary : tuple of str
        what may be meant otherwise; what is in it, where nothing is wrong
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
        """One line."""
        if self.good:
            return f"{self.file}: a {self.kind}, nothing is wrong"
        count = len(self.problems) + self.not_listed
        return f"{self.file}: {count} problem{'s' if count > 1 else ''} ({self.kind})"

    def to_polars(self) -> "DataFrame":
        """The problems as a table: line, text."""
        import polars as pl

        rows = [(problem.line, problem.text) for problem in self.problems]
        return pl.DataFrame(rows, schema={"line": pl.Int64, "text": pl.String}, orient="row")


def found_in(
    path: Path,
    kind: str,
    problems: Iterable[Problem] = (),
    warnings: Iterable[str] = (),
    summary: Iterable[str] = (),
    more: int = 0,
) -> Check:
    """What was found in a file."""
    listed = tuple(problems)
    content = {"file": str(path), "kind": kind, "good": not listed, "problems": listed, "not_listed": more}
    return Check(**content, warnings=tuple(warnings), summary=tuple(summary))


class Findings:
    """What was found; `lines` says where each field stands."""

    def __init__(self, lines: Mapping[Location, int]) -> None:
        self._lines = lines
        self._found: dict[str, int | None] = {}

    def add(self, text: str, location: Location) -> None:
        """Note a problem once."""
        self._found.setdefault(text, line_of(self._lines, location))

    @contextmanager
    def of(self, location: Location = (), number: int | None = None) -> Iterator[None]:
        """Note what is refused within the block.

        Parameters
        ----------
        location : tuple
            of the field; without it the message begins with the field's name
        number : int, optional
            of the connection or stimulus, from 1, in place of that in the message
        """
        try:
            yield
        except InputError as error:
            text = str(error)
            if number is not None:
                text = _NUMBERED.sub(rf"\1[{number}]", text)
            self.add(text, location or named_location(text))

    def problems(self) -> tuple[Problem, ...]:
        """All of them, by line; those without a line first."""
        found = [Problem(text, line) for text, line in self._found.items()]
        return tuple(sorted(found, key=lambda problem: problem.line or 0))


def named_location(text: str) -> Location:
    """The location of the dotted name that a message begins with."""
    location: list[int | str] = []
    at = 0
    while found := _PART.match(text, at):
        location.append(found[1] if found[1] is not None else int(found[2]) - 1)
        at = found.end()
    return tuple(location)
