"""What a record excludes: how large each effect that was not found can be at most."""

from collections.abc import Mapping, Sequence
from typing import Any

from ...models.effects import EffectPlace
from ...models.effects.definition import ACCELEROMETERS, AXES
from ..diagnosis import Diagnosis
from .cells import Cell
from .page import Section, Table
from .rounding import unit_text, upwards


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
