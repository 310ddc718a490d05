"""What a command has to say when its work is done: text for a person, an object for a program."""

import json as json_format
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from io import StringIO
from pathlib import Path
from typing import Any

STANDARD_OUTPUT = Path("-")
"""Where `--json -` writes: the object takes the place of the text."""


@dataclass(frozen=True)
class Answer:
    """What a command prints.

    Attributes
    ----------
    text : str
    wanted : bool
        whether it is printed with --quiet too: it was asked for by name
    complaint : str
        one line for standard error, where the work was done and found something wrong
    status : int
        exit status
    """

    text: str
    wanted: bool = False
    complaint: str = ""
    status: int = 0


def answer(
    text: str | Iterable[str],
    json: Path | None,
    content: str | Mapping[str, Any],
    *,
    complaint: str = "",
    status: int = 2,
) -> Answer:
    """Write a command's object where it was asked for, and give what is to be printed.

    Parameters
    ----------
    text : str or lines
        what a person reads
    json : Path or None
        the option `--json`; "-" is standard output
    content : str or mapping
        the object, as JSON text or as plain values
    complaint : str
        one line for standard error
    status : int
        exit status where there is a complaint

    Raises
    ------
    InputError
        when the file cannot be written
    """
    from .writing import write_text

    said = text if isinstance(text, str) else "\n".join(text)
    ended = {"complaint": complaint, "status": status if complaint else 0}
    if json is None:
        return Answer(said, **ended)
    written = content if isinstance(content, str) else json_text(content)
    if json == STANDARD_OUTPUT:
        return Answer(written.rstrip("\n"), wanted=True, **ended)
    write_text(json, written)
    return Answer(said, **ended)


def json_text(content: Mapping[str, Any]) -> str:
    """Plain values as the text of a JSON file."""
    return json_format.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def say(command: Callable[[], object], *, quiet: bool) -> int:
    """Run a command and print its answer.

    Parameters
    ----------
    command : callable
        gives an `Answer`, or prints what it has to say itself
    quiet : bool
        print nothing but what was asked for by name: no text, no bars, no warnings

    Returns
    -------
    int
        exit status
    """
    if quiet:
        with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
            said = command()
    else:
        said = command()
    if not isinstance(said, Answer):
        return 0
    if said.text and (said.wanted or not quiet):
        print(said.text)
    if said.complaint:
        print(f"trihedron: {said.complaint}", file=sys.stderr)
    return said.status
