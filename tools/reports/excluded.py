"""How large each effect that was not found can be at most, and what the record cannot show."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ...models.effects import EffectPlace
from ...models.effects.definition import ACCELEROMETERS, AXES
from ..diagnosis.result import Diagnosis, Excluded
from ..document.blocks import Section, Table
from ..document.numbers import Cell, unit_text, upwards


def excluded_sections(result: Diagnosis) -> list[Section]:
    """Upper bounds, a column for each accelerometer or axis; a section, or none."""
    if not result.excluded:
        return []
    wide = [entry for entry in result.excluded if entry["where"] in ACCELEROMETERS]
    turning = [entry for entry in result.excluded if entry["where"] not in ACCELEROMETERS]
    sections = []
    said = ["Larger sizes of these effects contradict the record. Bounds are rounded up."]
    for name, entries, places in (("accelerometers", wide, ACCELEROMETERS), ("table", turning, (*AXES, "base"))):
        if entries:
            title = f"Excluded: effects of the {name}"
            sections.append(Section(title, said if not sections else [], table=excluded_table(entries, places)))
    return sections


def excluded_table(entries: Sequence[Mapping[str, Any]], places: tuple[str, ...]) -> Table:
    """A row for each effect and parameter, a column for each place."""
    found: dict[tuple[str, str, str], dict[str, Cell]] = {}
    for entry in entries:
        place = EffectPlace(entry["effect"], entry["where"], entry.get("order"), tuple(entry.get("axes", ())))
        words = place.title.replace(f" {place.where}", "")
        found.setdefault((words, entry["parameter"], entry["unit"]), {})[place.where] = upwards(entry["above"])
    rows = [[*key[:2], *(cells.get(where) for where in places), unit_text(key[2])] for key, cells in found.items()]
    return Table(["effect", "parameter", *(where.replace("-", " ") for where in places), "unit"], rows)


GYROS = ("1", "2", "3")
_OF_A_GYRO = re.compile(r"(?P<name>[a-z]+)_(?P<gyro>[123])_?(?P<axes>[123]{0,2})")
SAID = "Larger sizes of these effects contradict the record. Bounds are rounded up."


def carried_excluded_sections(result: Diagnosis) -> list[Section]:
    """Upper bounds for gyros and accelerometers, and the effects that cannot be seen."""
    of_gyros = [entry for entry in result.excluded or () if entry["where"] not in ACCELEROMETERS]
    others = [entry for entry in result.excluded or () if entry["where"] in ACCELEROMETERS]
    sections = []
    if of_gyros:
        sections.append(Section("Excluded: effects of the gyros", [SAID], table=gyro_table(of_gyros)))
    if others:
        said = [] if sections else [SAID]
        sections.append(
            Section("Excluded: effects of the accelerometers", said, table=excluded_table(others, ACCELEROMETERS))
        )
    if result.cannot_be_seen or ():
        names = ", ".join(dict.fromkeys(place.effect for place in result.cannot_be_seen or ()))
        said = f"No possible size of these effects would show in this record, and they were not searched: {names}."
        sections.append(Section("What the record cannot show", [said]))
    return sections


def gyro_table(entries: Sequence[Excluded]) -> Table:
    """A row for each effect and direction, a column for each gyro, one for what is of the block as a whole."""
    found: dict[tuple[str, str, str], dict[str, Cell]] = {}
    for entry in entries:
        words, column = in_words(entry["parameter"])
        found.setdefault((entry["effect"], words, unit_text(entry["unit"])), {})[column] = upwards(entry["above"])
    columns = [name for name in (*GYROS, "") if any(name in cells for cells in found.values())]
    rows = [[*key[:2], *(cells.get(name) for name in columns), key[2]] for key, cells in found.items()]
    return Table(["effect", "parameter", *(f"gyro {name}" if name else "block" for name in columns), "unit"], rows)


def in_words(parameter: str) -> tuple[str, str]:
    """A parameter without its gyro, and the gyro's number: "gamma_12" is "gamma, axis 2" of gyro 1."""
    match = _OF_A_GYRO.fullmatch(parameter)
    if match is None:
        return parameter, ""
    axes = match["axes"]
    if not axes:
        return match["name"], match["gyro"]
    return f"{match['name']}, {'axis' if len(axes) == 1 else 'axes'} {' '.join(axes)}", match["gyro"]
