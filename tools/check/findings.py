"""What a check of a file has found: problems, gathered one after the other, with the lines of their fields."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from ..errors import InputError
from ..field_problems import Location, line_of
from ..result import Result

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


class Findings:
    """What is found in a file, gathered one after the other; `lines` says where each field stands."""

    def __init__(self, path: Path, kind: str = "unknown"):
        self.path, self.kind = path, kind
        self.lines: Mapping[Location, int] = {}
        self.problems: list[Problem] = []
        self.warnings: tuple[str, ...] = ()
        self.summary: tuple[str, ...] = ()

    def add(self, text: str, location: Location = (), line: int | None = None) -> None:
        """Note a problem, of a field once."""
        if line is not None or all(text != known.text for known in self.problems):
            self.problems.append(Problem(text=text, line=line_of(self.lines, location) if line is None else line))

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
            text = str(error).removeprefix(f"{self.path}: ")
            if number is not None:
                text = _NUMBERED.sub(rf"\1[{number}]", text)
            self.add(text, location or named_location(text))

    def check(self, most: int | None = None) -> Check:
        """All of it, the problems by line, those without a line first; at most so many of them are listed."""
        problems = sorted(self.problems, key=lambda problem: problem.line or 0)
        return Check(
            file=str(self.path),
            kind=self.kind,
            good=not problems,
            problems=tuple(problems[:most]),
            not_listed=len(problems[most:]) if most is not None else 0,
            warnings=self.warnings,
            summary=self.summary,
        )


def named_location(text: str) -> Location:
    """The location of the dotted name that a message begins with."""
    location: list[int | str] = []
    at = 0
    while found := _PART.match(text, at):
        location.append(found[1] if found[1] is not None else int(found[2]) - 1)
        at = found.end()
    return tuple(location)
