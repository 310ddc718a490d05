"""Problems of a file, gathered one after the other, with the lines of their fields."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from ..errors import InputError
from ..field_problems import Location
from .result import Problem
from .source_lines import line_of

_PART = re.compile(r"\.?([A-Za-z_][\w-]*)|\[(\d+)\]")
_NUMBERED = re.compile(r"^(connections|stimuli)\[\d+\]")


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
