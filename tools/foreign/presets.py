"""Known layouts of columns, as data: the names by which each is recognised, and the units that its tool documents."""

import re
import tomllib
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from ..errors import InputError, nearest
from .mapping import OPEN, Mapping

FILE = Path(__file__).with_name("presets.toml")
"""The layouts."""


@dataclass(frozen=True)
class Preset:
    """A layout of columns.

    Attributes
    ----------
    name, title, source : str
        name for --as; the tool that writes it; where the tool documents it
    header : tuple of str
        columns by which it is recognised; empty: only by `--as` or its marker
    marker : str
        pattern of a line above the table by which it is recognised
    units, likely : dict
        quantity -> unit that is certain; unit that is the first answer to a question
    columns : dict
        column of the record -> column of the file
    scales : dict
        quantity -> sensitivities of the instruments that write it, in one order
    instance : str
        column that counts several sensors in one table
    without_gravity : str
        pattern of the names of its files that have acceleration without gravity
    """

    name: str
    title: str
    source: str
    header: tuple[str, ...] = ()
    marker: str = ""
    units: dict[str, str] = field(default_factory=dict)
    likely: dict[str, str] = field(default_factory=dict)
    columns: dict[str, str] = field(default_factory=dict)
    scales: dict[str, list[str]] = field(default_factory=dict)
    instance: str = ""
    without_gravity: str = ""

    def is_layout_of(self, names: Iterable[str], above: Iterable[str]) -> bool:
        """Return True if a table with these names, below these lines, has this layout."""
        spelled = {_spelled(name) for name in names}
        if self.header and not spelled.issuperset(map(_spelled, self.header)):
            return False
        if self.marker:
            return any(re.search(self.marker, line) for line in above)
        return bool(self.header)

    def filled_in(self, mapping: Mapping, names: Iterable[str]) -> Mapping:
        """Return a mapping with the units and columns of the layout where the user gave none."""
        spelled = {_spelled(name): name for name in names}
        columns = dict(mapping.columns)
        for column, name in self.columns.items():
            source = spelled.get(_spelled(name), name if name.isdigit() else "")
            if source and mapping.of(column).source in ("", OPEN):
                unit = mapping.of(column)
                columns[column] = unit.model_copy(update={"source": source})
        units = self.units | {quantity: unit for quantity, unit in mapping.units.items() if unit != OPEN}
        return mapping.model_copy(update={"units": units, "columns": columns, "preset": self.name})


def _spelled(name: str) -> str:
    return " ".join(name.split()).casefold()


@cache
def presets() -> dict[str, Preset]:
    """Return all layouts by name."""
    layouts = {}
    for name, facts in tomllib.loads(FILE.read_text(encoding="utf-8")).items():
        layouts[name] = Preset(name, **facts | {"header": tuple(facts.get("header", ()))})
    return layouts


def preset_of(mapping: Mapping, names: list[str], above: list[str]) -> Preset | None:
    """Return the layout that the mapping names, or the first that the table has; None if there is none.

    Raises InputError for an unknown name.
    """
    if mapping.preset == "none":
        return None
    if mapping.preset:
        if mapping.preset not in presets():
            raise InputError(
                f"--as {mapping.preset}: is not a known layout; {nearest(mapping.preset, list(presets()))}"
            )
        return presets()[mapping.preset]
    return next((preset for preset in presets().values() if preset.is_layout_of(names, above)), None)
