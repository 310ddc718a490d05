"""Options of commands: from the library's functions with their words, and what only a command line needs."""

import inspect
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

from cyclopts import Parameter

from .. import document
from ..errors import InputError
from ..files import ordinary_file, ordinary_folder

Command = TypeVar("Command", bound=Callable[..., object])


def json_file(_: object, path: Path | None) -> None:
    """Refuse an option where the name of a file for JSON should stand; "-" is standard output."""
    if path is not None and str(path).startswith("-") and str(path) != "-":
        raise InputError(f"--json {path}: is an option; give the name of a file, or - for standard output")
    if str(path) != "-":
        ordinary_file(None, path)


def distinct_files(files: dict[str, Path | None]) -> None:
    """Refuse a result that would be written over the record or over another result."""
    given = [(name, path) for name, path in files.items() if path is not None]
    for k, (name, path) in enumerate(given):
        for other, before in given[:k]:
            if os.path.realpath(path) == os.path.realpath(before):
                raise InputError(f"{name} {path}: is {other} too; give another name")


def report_file(_: object, path: Path | None) -> None:
    """Check the name of a report before anything is computed."""
    if path is not None:
        document.report_file(path)


File = Annotated[Path | None, Parameter(validator=ordinary_file)]
Folder = Annotated[Path | None, Parameter(name="--out", validator=ordinary_folder)]
JsonFile = Annotated[
    Path | None,
    Parameter(
        name="--json",
        allow_leading_hyphen=True,
        help="Write the result as JSON to this file; - is standard output, in place of the text.",
        validator=json_file,
    ),
]
ReportFile = Annotated[
    Path | None,
    Parameter(name="--report", help="Write a page with pictures to this file, .html or .pdf.", validator=report_file),
]
Number = Annotated[float, Parameter(allow_leading_hyphen=True)]

Whole = Annotated[int, Parameter(allow_leading_hyphen=True)]

TYPES: dict[str, Any] = {
    "bounds": Annotated[tuple[float, float], Parameter(allow_leading_hyphen=True)],
    "cuts": Whole,
    "detect": tuple[str, ...],
    "effects": Annotated[tuple[str, ...], Parameter(name="--effect")],
    "extra": Whole,
    "fmi": Literal["2", "3"],
    "gravity": Number,
    "grid": Annotated[float | None, Parameter(allow_leading_hyphen=True)],
    "jobs": Annotated[int | None, Parameter(allow_leading_hyphen=True)],
    "keep_out": tuple[str, ...],
    "mounting": str,
    "mountings": Annotated[tuple[str, ...], Parameter(consume_multiple=(1, None), show_default=False)],
    "noise_bound": Annotated[float | None, Parameter(allow_leading_hyphen=True)],
    "out": Folder,
    "positions": Whole,
    "priors": Annotated[tuple[str, ...], Parameter(name="--prior", allow_leading_hyphen=True)],
    "repeat": Whole,
    "reserve_deg": Annotated[float, Parameter(name="--reserve", allow_leading_hyphen=True)],
    "resolution_deg": Annotated[float | None, Parameter(name="--resolution", allow_leading_hyphen=True)],
    "seed": Whole,
    "starts": Whole,
    "targets": Annotated[tuple[str, ...], Parameter(name="--target", allow_leading_hyphen=True)],
}
"""How options of the library are typed at a terminal, where that is not how Python has them."""
NOT_TYPED = ("progress", "gyro_bias")
"""What a terminal does not give: a command shows its progress, and a terminal has no arrays."""


def takes(*functions: Callable[..., Any]) -> Callable[[Command], Command]:
    """Give a command the options of functions of the library: names, types, defaults, words.

    The command has its own parameters first, by position, and its own options last; ``**options`` are those of the
    functions that were given. Its docstring holds the examples; the sentence is the first function's, and the
    parameters' words are those of the first function that has such a parameter.

    Parameters
    ----------
    functions : callable
        of `trihedron.tools.library`, documented by numpydoc
    """

    def given(command: Command) -> Command:
        own = [p for p in inspect.signature(command).parameters.values() if p.kind is not p.VAR_KEYWORD]
        without = {*(p.name for p in own), *NOT_TYPED}
        taken: dict[str, inspect.Parameter] = {}
        for p in (p for function in functions for p in inspect.signature(function).parameters.values()):
            if p.kind is p.KEYWORD_ONLY and p.name not in without:
                taken.setdefault(p.name, p.replace(annotation=TYPES.get(p.name, p.annotation)))
        by_position = [p for p in own if p.kind is not p.KEYWORD_ONLY]
        signature = inspect.Signature([*by_position, *taken.values(), *(p for p in own if p.kind is p.KEYWORD_ONLY)])
        command.__signature__ = signature  # type: ignore[attr-defined]
        words = {name: text for function in reversed(functions) for name, text in described(function)[1].items()}
        kept = {name: text for name, text in words.items() if name in signature.parameters}
        examples, own_words = described(command)
        lines = [f"{name}\n    {text}" for name, text in (kept | own_words).items()]
        section = ["Parameters\n----------\n" + "\n".join(lines)] if lines else []
        command.__doc__ = "\n\n".join([described(functions[0])[0], examples, *section])
        return command

    return given


def described(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """What stands before the sections of a numpydoc docstring, and the text of each parameter."""
    head, *sections = re.split(r"\n\n(?=\w+\n-{3,}\n)", inspect.getdoc(function) or "")
    body = next((text.split("\n", 2)[2] for text in sections if text.startswith("Parameters\n")), "")
    words: dict[str, str] = {}
    for name, text in re.findall(r"(?m)^(\w+)(?: :.*)?\n((?:    .*\n?)+)", body):
        words[name] = " ".join(text.split())
    return head, words
