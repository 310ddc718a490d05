"""Read lines of labels and numbers as a table: "ax:0.1 ay:0.2", "Accel X = 0.1 | Y = 0.2 g", a heading above x, y, z.

Serial monitors, examples of sensors' libraries and `rostopic echo` write such texts. A row takes one line or several.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError
from .mapping import plural
from .sheet import SERIAL, TRIED, HeaderFacts, Sheet
from .units import known_unit

NUMBER = r"(?:[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?|[+-]?\b(?:nan|inf|ovf)\b)"
_NUMBERS = re.compile(rf"\s*[(\[]?\s*(?P<numbers>{NUMBER}(?:[,;\s]\s*{NUMBER})*)\s*[)\]]?(?P<behind>.*)", re.IGNORECASE)
_CLOCK = re.compile(r"(?<![\w.:])\d{1,3}:\d\d(?::\d\d)?(?:[.,]\d+)?(?![\w.]|:\S)")
_BEFORE = re.compile(r"[\[(]?([\d.,/T\0 -]*\d)[\])]?(?:[|,;\t> ]+(?=[^\W\d])|$)")
_LABEL = re.compile(r"[^\W\d][^:=]{0,40}")
_AXIS = re.compile(r"(?P<stem>.*?)[ _.-]?(?P<axis>[xyzwXYZW])")
_LABELLED = re.compile(r"\s*[^\W\d][^:=]*[:=]")
_WORDS = re.compile(r"[^\W\d][^\W\d ]*(?: [^\W\d]+)* +(?=[+-]?\d)")
"""Words before a number without a mark between them: "Temperature 25.1 deg C"."""
MARKS, AROUND = "|,;\t", " \t|,;'\"{}"
FEWEST = 3
"""Smallest number of labels of a table, and of its rows."""
LONGEST_LINE, LONGEST_UNIT = 1000, 20
"""Largest length of a line with labels, and of a unit [characters]."""
MOST_BEHIND = 0.8
"""Share of the lines behind others, as empty ones, that begin with the first label of a row."""
Form = tuple[tuple[str, str], ...]
"""Labels and units of a line."""
TIME, BEFORE = "time", "column 1"
"""Names of the time that a serial monitor writes before a line, and of another number there."""


@dataclass(frozen=True)
class Reading:
    """A number in a line with its label and unit; `stem` is the label without its axis, None if it has no axis."""

    label: str
    text: str
    unit: str = ""
    stem: str | None = None


@dataclass
class Labels:
    """The labels of a text, line by line: `stem` is the heading or the last label with an axis."""

    stem: str = ""
    is_heading: bool = False

    def readings(self, line: str) -> list[Reading]:
        """Return the readings of a line; none where a part of it is neither a label, a number nor a unit."""
        if len(line) > LONGEST_LINE:
            return []
        if ":" not in line and "=" not in line:
            line = _WORDS.sub(lambda words: f"{words[0].rstrip()}:", line, count=1)
        # Teleplot marks its lines
        line = _CLOCK.sub(lambda time: time[0].replace(":", "\0"), line.strip().removeprefix(">"))
        label, *parts = re.split(r"\s*[:=]+", line)
        readings = list[Reading]()
        before = _BEFORE.match(label)
        if before and parts:
            readings.append(Reading(BEFORE, before[1].replace("\0", ":")))
            label = label[before.end() :]
        for place, part in enumerate(parts, 1):
            label, is_last = label.rpartition("{")[2].strip(AROUND), place == len(parts)
            value, clock = _NUMBERS.fullmatch(part), re.match(r"\s*([\d.,]+\0[\d.,\0]+)(.*)", part)
            if (label and not _LABEL.fullmatch(label)) or (value is None and is_last and part.strip(AROUND)):
                return []
            if clock:
                numbers, behind = [clock[1].replace("\0", ":")], clock[2]
            elif value:
                numbers, behind = _numbers(value["numbers"]), value["behind"]
            else:
                self.stem, self.is_heading, label = label, True, part
                continue
            if not label:
                return []
            unit, following = (_unit(behind), "") if is_last else _divided(behind)
            if not numbers or unit is None:
                return []
            readings += self._named(label, numbers, unit, is_first=place == 1)
            label = following
        return _with_units(readings)

    def _named(self, label: str, numbers: list[str], unit: str, *, is_first: bool) -> list[Reading]:
        """Return the readings of a label; an axis alone belongs to the heading or the label before it."""
        if len(numbers) > 1:
            axes = "xyz" if len(numbers) == len("xyz") else "wxyz"
            return [Reading(f"{label} {axis}", text, unit, label) for axis, text in zip(axes, numbers, strict=True)]
        parts = _AXIS.fullmatch(label)
        if parts is None:
            return [Reading(label, numbers[0], unit)]
        if parts["stem"]:
            self.stem, self.is_heading = parts["stem"], False
            return [Reading(label, numbers[0], unit, self.stem)]
        if is_first and not self.is_heading and label in "xX":
            self.stem = ""
        return [Reading(f"{self.stem} {label}".strip(), numbers[0], unit, self.stem)]


def labelled_sheet(path: Path, lines: Sequence[str], encoding: str) -> Sheet | None:
    """Return a text of labelled numbers as a sheet; None for any other text.

    Lines with other labels or units than usual are left out: they are damaged, or cut short.

    Raises InputError if a label has two units.
    """
    if not _are_labelled(lines[:TRIED]):
        return None
    labels = Labels()
    times = [SERIAL.match(line) for line in lines]
    read = [labels.readings(line[time.end() :] if time else line) for line, time in zip(lines, times, strict=True)]
    usual = _usual(read)
    units: dict[str, str] = {}
    for line, readings in enumerate(read, 1):
        for reading in readings if _form(readings) in usual else ():
            if units.setdefault(reading.label, reading.unit) != reading.unit:
                what = f"{reading.label!r} is in {units[reading.label] or 'no unit'!r} before"
                raise InputError(f"{path}: row {line}: {what}; one unit for a label is needed")
    first = _first_label(read, usual)
    if len(units) < FEWEST or not first:
        return None
    names = list(units)
    at = names.index(first)
    names = names[at:] + names[:at]
    rows, damaged, before, row = dict[int, list[str]](), list[int](), 0, list[str]()
    for line, (time, readings) in enumerate(zip(times, read, strict=True)):
        if readings and _form(readings) not in usual:
            damaged.append(line + 1)
            if readings[0].label == first:
                # an empty row keeps the count of rows
                rows[line], before = ["-"] * (len(names) + 1), len(names)
            continue
        for reading in readings:
            place = names.index(reading.label) + 1
            if place <= before or not rows:
                # a row begins where the place of a label does not increase
                row = rows[line] = [time[1] if time else ""] + [""] * len(names)
            row[place], before = reading.text, place
    begin = min(rows)
    without = 0 if any(times) else 1
    cells = [[line] if place < begin else rows.get(place, [])[without:] for place, line in enumerate(lines)]
    shape = f"labels before the numbers, a row from {first!r} to {names[-1]!r}"
    inside, remark = [line for line in damaged if line > begin], ""
    if inside:
        what = f"{plural(len(inside), 'line')} with other labels or units than usual"
        remark = f"left out: {what}, from row {inside[0]} on"
    heads, below = (TIME, *names), ("", *(units[name] for name in names))
    stated = HeaderFacts(names=heads[without:], units=below[without:], first_row=begin + 1, remark=remark)
    return Sheet(path, cells=cells, encoding=encoding, shape=shape, stated=stated)


def _are_labelled(lines: Sequence[str]) -> bool:
    """Return True if most lines have labels that come again, and few are rows of numbers alone."""
    labels, forms, plain, others = Labels(), Counter[Form](), 0, 0
    for line in lines:
        text = SERIAL.sub("", line)
        form = _form(labels.readings(text))
        forms[form] += bool(form)
        is_row = not form and not _LABELLED.match(text) and len(re.findall(NUMBER, text)) >= FEWEST
        plain += is_row
        # list items and lines between rows have no words
        others += is_row or (not form and re.search(r"[^\W\d_]", text) is not None)
    again = sum(count for count in forms.values() if count >= FEWEST)
    return again > max(others - len(forms), 0) and 2 * plain <= max(forms.values())


def _form(readings: Sequence[Reading]) -> Form:
    return tuple((reading.label, reading.unit) for reading in readings)


def _usual(read: Sequence[Sequence[Reading]]) -> set[Form]:
    """Return the labels and units of lines that come at least half as often as the most frequent ones."""
    forms = Counter(_form(readings) for readings in read if readings)
    most = max(forms.values())
    return {form for form, count in forms.items() if 2 * count >= most and len(dict(form)) == len(form)}


def _first_label(read: Sequence[Sequence[Reading]], usual: set[Form]) -> str:
    """Return the label that begins a row: behind other lines, as empty ones, or the first of the file."""
    behind: Counter[str] = Counter()
    first, is_before = "", False
    for readings in read:
        is_usual = _form(readings) in usual
        if is_usual:
            first = first or readings[0].label
            behind[readings[0].label] += is_before
        is_before = not is_usual
    label, count = max(behind.items(), key=lambda entry: entry[1], default=("", 0))
    return label if count > max(MOST_BEHIND * sum(behind.values()), FEWEST - 1) else first


def _numbers(text: str) -> list[str]:
    """Return one, three or four numbers, also with decimal commas; none for another count."""
    numbers = re.split(r"\s*;\s*|,?\s+", text)
    if len(numbers) == 1 and text.count(",") > 1:
        numbers = text.split(",")
    return numbers if len(numbers) in (1, 3, 4) else []


def _unit(behind: str) -> str | None:
    """Return the unit at the end of a line; None if it is none."""
    unit = behind.strip(AROUND)
    is_unit = len(unit) <= LONGEST_UNIT and not re.match(r"[\d.\0]|.*\s\d", unit)
    return unit if is_unit else None


def _divided(behind: str) -> tuple[str, str]:
    """Return the unit behind a number, and the label of the next one."""
    behind = behind.strip(" ")
    mark = re.search(f"[{re.escape(MARKS)}]", behind)
    if mark:
        return behind[: mark.start()].strip(), behind[mark.end() :]
    words = behind.split()
    for count in range(len(words) - 1, 0, -1):
        if known_unit(" ".join(words[:count])) is not None:
            return " ".join(words[:count]), " ".join(words[count:])
    return "", behind


def _with_units(readings: list[Reading]) -> list[Reading]:
    """Give the unit behind the last of several axes to those before it."""
    united = list[Reading]()
    for reading in reversed(readings):
        if not reading.unit and reading.stem is not None and united and united[-1].stem == reading.stem:
            reading = replace(reading, unit=united[-1].unit)
        united.append(reading)
    return united[::-1]
