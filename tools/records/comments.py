"""What stands in the comment lines of a record: `# key: value`, who measured what with which instrument.

Here, and nowhere else, such lines are read and written. Some keys are the record's own: what its numbers cannot say, as
once they are averaged or in other units.
"""

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

RESOLUTION = {"resolution_mps2": "resolution", "resolution_deg": "angle", "resolution_degC": "temperature"}
"""Half a last digit of what was written, where numbers come from another file: key -> field of `Comments`."""
SCATTER = "scatter_mps2"
"""Standard error of a row's mean of each accelerometer, where several readings were averaged: three numbers."""
INERTIAL = ("attitude_reference", "inertial")
"""Key and value that say of a true attitude that it is against inertial space: Earth's rotation is in it."""
MOST = 200
"""Lines that are kept."""
LONGEST = 400
"""Characters of a line that are kept."""
_LINE = re.compile(r"#+\s*([^:#][^:]{0,79}?)\s*:\s+(\S.*?)\s*")


@dataclass(frozen=True)
class Comments:
    """Key -> value of the comment lines, and what the record's own keys say [m/s², deg, K], 0 or empty without."""

    about: Mapping[str, str] = field(default_factory=dict)
    resolution: float = 0.0
    angle: float = 0.0
    temperature: float = 0.0
    scatter: tuple[float, ...] = ()


def comments_of(lines: Iterable[tuple[int, str]]) -> tuple[Comments, tuple[int, str, str] | None]:
    """Read comment lines, given with their rows; beside it row, key and what is wrong of the first own key that is."""
    about: dict[str, str] = {}
    values: dict[str, float] = {}
    scatter: tuple[float, ...] = ()
    for row, line in lines:
        match = _LINE.fullmatch(line[:LONGEST])
        if match is None or len(about) >= MOST:
            continue
        key, text = match[1], match[2]
        about.setdefault(key, text)
        if key not in RESOLUTION and key != SCATTER:
            continue
        numbers = [_number(part) for part in text.split()]
        count = 1
        if key == SCATTER:
            count = 3
        if len(numbers) != count or not all(0.0 <= number < math.inf for number in numbers):
            needed = "a number"
            if count == 3:
                needed = "three numbers"
            return Comments(), (row, key, f"{text[:40]!r}: {needed} not below 0 must stand there")
        if key == SCATTER:
            scatter = tuple(numbers)
        else:
            values[RESOLUTION[key]] = numbers[0]
    return Comments(about, scatter=scatter, **values), None


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return math.nan


def comment_lines(about: Mapping[str, str]) -> str:
    """Keys and values as the lines that begin a file; what could not be read again as such is written as a remark."""
    lines = []
    for key, text in about.items():
        words = []
        for part in (key.replace(":", " "), text):
            words.append(" ".join(part.split()))
        key, text = words
        lines.append(f"# {key[:80] or 'remark'}: {text[: LONGEST - 90] or '-'}\n")
    return "".join(lines[:MOST])
