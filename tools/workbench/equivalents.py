"""The command and the lines of Python that give the answer of a page."""

import shlex
from collections.abc import Mapping, Sequence
from typing import Any

from ..rounding import exactly

PLACE = ("latitude_deg", "azimuth_deg", "gyro_noise", "encoder_bound")
"""Options of a bench with gyros."""


def command_line(command: str, paths: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return the command that gives the same answer."""
    words = ["trihedron", command, *map(shlex.quote, paths)]
    for name, value in options.items():
        option = f"--{name.replace('_', '-')}"
        if value is True:
            words.append(option)
            continue
        text = shlex.quote(exactly(value) if isinstance(value, float) else str(value))
        words.append(f"{option}={text}" if text.startswith("-") else f"{option} {text}")
    return " ".join(words)


def python_lines(command: str, paths: Sequence[str], options: Mapping[str, Any]) -> str:
    """Return the lines of Python that give the same answer."""
    words = [repr(path) for path in paths]
    place = []
    for name, value in options.items():
        text = repr([value]) if name == "channels" else repr(value)
        if name in PLACE:
            place.append(f"{name}={text}")
        else:
            words.append(f"{name}={text}")
    lines = ["import trihedron as th"]
    if place:
        lines.append(f"bench = th.bench_at(th.read_record({paths[0]!r}), {', '.join(place)})")
        words.append("bench=bench")
    function = f"{command}_together" if len(paths) > 1 and command != "noise" else command
    return "\n".join([*lines, f"result = th.{function}({', '.join(words)})", "print(result)"])
