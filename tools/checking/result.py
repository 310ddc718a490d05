"""What a check of a file has found."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..shown import Shown

if TYPE_CHECKING:
    from polars import DataFrame

SCHEMA = "trihedron.check/1"


@dataclass(frozen=True)
class Problem:
    """Something that is wrong.

    Attributes
    ----------
    text : str
        one line that names the field or column and says what would be right
    line : int or None
        where, as an editor counts lines; None where the file has no lines or the whole is meant
    """

    text: str
    line: int | None = None


@dataclass(frozen=True, repr=False)
class Check(Shown):
    """A file that was checked.

    Attributes
    ----------
    path : Path
    kind : str
        what it is, as "scenario" or "position record"; "unknown" where that cannot be told
    problems : tuple of Problem
        everything that is wrong, by line
    warnings : tuple of str
        what may be meant otherwise
    summary : tuple of str
        what is in it, where nothing is wrong
    more : int
        problems that are not listed
    """

    path: Path
    kind: str
    problems: tuple[Problem, ...] = ()
    warnings: tuple[str, ...] = ()
    summary: tuple[str, ...] = ()
    more: int = 0

    @property
    def good(self) -> bool:
        """Whether nothing is wrong."""
        return not self.problems

    @property
    def verdict(self) -> str:
        """One line."""
        if self.good:
            return f"{self.path}: a {self.kind}, nothing is wrong"
        count = len(self.problems) + self.more
        return f"{self.path}: {count} problem{'s' if count > 1 else ''} ({self.kind})"

    def lines(self) -> list[str]:
        """What a person reads: the verdict, then every problem as `file:line: what`."""
        said = [self.verdict]
        for problem in self.problems:
            place = "" if problem.line is None else f":{problem.line}"
            said.append(f"{self.path}{place}: {problem.text}")
        if self.more:
            said.append(f"... and {self.more} more")
        said += [f"  {line}" for line in self.summary]
        return said + [f"warning: {warning}" for warning in self.warnings]

    def to_json(self) -> dict[str, Any]:
        """The object of schema trihedron.check/1."""
        return {
            "schema": SCHEMA,
            "file": str(self.path),
            "kind": self.kind,
            "good": self.good,
            "problems": [{"line": problem.line, "text": problem.text} for problem in self.problems],
            "not_listed": self.more,
            "warnings": list(self.warnings),
            "summary": list(self.summary),
        }

    def to_polars(self) -> "DataFrame":
        """The problems as a table: line, text."""
        import polars as pl

        rows = [(problem.line, problem.text) for problem in self.problems]
        return pl.DataFrame(rows, schema={"line": pl.Int64, "text": pl.String}, orient="row")
