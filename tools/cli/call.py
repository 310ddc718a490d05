"""A command that was carried out, and commands with the same record and options."""

import shlex
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from cyclopts import App

from ..rounding import exactly

SAME_RECORD = (
    *(
        "channels",
        "stamps",
        "trust",
        "without",
        "noise_bound",
        "noise_sd",
        "gravity",
        "mounting",
        "baseline",
        "bounds",
        "rates",
    ),
    *(
        "noise_result",
        "rest_scatter",
        "rests",
        "faces",
        "turns",
        "latitude_deg",
        "azimuth_deg",
        "gyro_noise",
        "encoder_bound",
        "shared",
        "own",
    ),
)
"""Options that stay when another command takes the same record."""


@dataclass(frozen=True)
class Call:
    """A command that was carried out.

    Attributes
    ----------
    app : App
        the command line
    name : str
        the command, as "plan positions"
    arguments : mapping
        parameter -> value, of the typed command
    """

    app: App
    name: str
    arguments: Mapping[str, Any]

    def line(self, command: str, *places: object, **options: object) -> str:
        """Return a command with these arguments and options, and the options of the same record that it takes."""
        kept = {name: value for name, value in self.arguments.items() if name in SAME_RECORD}
        return _written(command, _options(self.app, command), places, {**kept, **options})

    def again(self, **options: object) -> str:
        """Return the same command with further options."""
        known = _options(self.app, self.name)
        places: list[object] = []
        for name, value in self.arguments.items():
            if name not in known:
                places += value if isinstance(value, tuple) else [value]
        return _written(self.name, known, places, {**self.arguments, **options})

    def with_one_more(self, **files: str) -> str:
        """Return the same command with the first of these options that it takes and has not; else its help."""
        known = _options(self.app, self.name)
        for name, file in files.items():
            if name in known and name not in self.arguments:
                return self.again(**{name: file})
        return f"trihedron help {self.name}"


def _written(command: str, known: Mapping[str, str], places: Iterable[object], options: Mapping[str, object]) -> str:
    """Return a command as typed, with those options that it knows."""
    words = ["trihedron", *command.split(), *map(str, places)]
    for name, value in options.items():
        if name in known:
            words += _words(known[name], value)
    return shlex.join(words)


def _options(app: App, command: str) -> dict[str, str]:
    """Return the options of a command, by parameter."""
    for name in command.split():
        app = app[name]
    options = {}
    for argument in app.assemble_argument_collection():
        if argument.names[0].startswith("--"):
            options[argument.field_info.name] = argument.names[0]
    return options


def _words(option: str, value: object) -> list[str]:
    """Return an option with its value as typed; one of several words is repeated, one without a value is none."""
    if value is None:
        return []
    if value is True:
        return [option]
    if isinstance(value, tuple):
        if all(isinstance(part, float | int) for part in value):
            return [option, *map(_word, value)]
        return [word for part in value for word in _words(option, part)]
    word = _word(value)
    return [f"{option}={word}"] if word.startswith("-") else [option, word]


def _word(value: object) -> str:
    return exactly(value) if isinstance(value, float) else str(value)
