"""The page of a table of columns: what is numbers in it as lines over time, a picture for each unit."""

import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

import polars as pl

from ...fmus.units import UNITS, column_units
from ..document.blocks import Page, Section, Table
from ..document.notation import plain, short, unit_text
from ..document.page import write_page
from ..orchestrator import Simulation
from ..orchestrator.interface import suffix_for
from ..rounding import digits
from .makers import versions
from .pictures.lines import MOST_LINES, TRUTH, Line, lines_picture

MOST_PANELS = 60
"""So many panels of lines are drawn, the first ones."""


def split(column: str, units: Mapping[str, str]) -> tuple[str, str]:
    """The name of a column without the suffix of its unit, and the unit; "" for a pure number.

    `units` are those of columns whose suffix is none of ours.
    """
    stem, _, suffix = column.rpartition("_")
    found = column_units().get(suffix)
    if found is None or not stem:
        unit = units.get(column, "")
        return column.removesuffix(f"_{suffix_for(unit)}"), unit_text(unit)
    unit, factor = found
    displayed = (name for name, scale in UNITS[unit].display.items() if scale == factor)
    return stem, unit_text(unit if factor == 1.0 else next(displayed, unit))


def lines_page(title: str, said: str, table: pl.LazyFrame, units: Mapping[str, str]) -> Page:
    """The page of a table whose first column is `time_s`; its columns are read one by one."""
    schema = table.collect_schema()
    times = table.select("time_s").collect()["time_s"].to_numpy()
    by_unit: dict[str, dict[str, list[str]]] = {}
    left = []
    for name, kind in schema.items():
        if name == "time_s":
            continue
        if kind.is_numeric() or kind == pl.Boolean:
            stem, unit = split(name, units)
            # What is numbered stands together.
            array = by_unit.setdefault(TRUTH if kind == pl.Boolean else unit, {})
            array.setdefault(re.sub(r"(\[\d+\]|\d+)$", "", stem), []).append(name)
        else:
            left.append(name)
    sections, rows, room = [], [], MOST_PANELS
    for unit, arrays in by_unit.items():
        groups = _panels(arrays.values())
        left += [name for group in groups[room:] for name in group]
        drawn = []
        for group in groups[:room]:
            drawn.append([])
            for name in group:
                values = table.select(pl.col(name).cast(pl.Float64)).collect()[name].to_numpy()
                line = Line.of(short(split(name, units)[0]), times, values)
                drawn[-1].append(line)
                rows.append([name, *(digits(value, 6) for value in line.ends)])
        room -= len(drawn)
        if drawn:
            title_of = unit if unit == TRUTH else f"In {unit}" if unit else "Pure numbers"
            sections.append(Section(title_of, svg=lines_picture(drawn, unit)))
    if rows:
        sections.append(Section("Columns", table=Table(["column", "first", "least", "largest", "last"], rows)))
    if left:
        sections.append(Section("Not drawn", f"{', '.join(left)}: texts, or beyond {MOST_PANELS} panels of lines."))
    return Page(plain(title), said, sections, provenance=versions())


def _panels(arrays: Iterable[Sequence[str]]) -> list[list[str]]:
    """Columns by panels: arrays whole where they fit."""
    panels: list[list[str]] = []
    for names in arrays:
        for k in range(0, len(names), MOST_LINES):
            part = list(names[k : k + MOST_LINES])
            if panels and len(panels[-1]) + len(part) <= MOST_LINES:
                panels[-1] += part
            else:
                panels.append(part)
    return panels


def write_plot(
    path: Path, title: str, said: str, table: pl.LazyFrame | pl.DataFrame, units: Mapping[str, str] | None = None
) -> None:
    """Write a table of columns over `time_s` as a page of lines, by unit.

    Parameters
    ----------
    path : Path
        .html or .pdf
    title, said : str
        what it is, in a few words and in a sentence
    table : polars.LazyFrame or DataFrame
        units are the suffixes of its columns' names
    units : mapping, optional
        column -> unit, of those whose suffix is none of ours

    Raises
    ------
    InputError
        where the file cannot be written, or the page not be printed
    """
    write_page(path, lines_page(title, said, table.lazy(), units or {}))


def write_plot_of_run(path: Path, run: Simulation) -> None:
    """Write what a simulation has recorded as lines over time; an InputError where it cannot be written."""
    said = f"{run.rows} rows up to {digits(run.final_time_s, 9)} s. {run.ended}".strip()
    write_plot(path, run.title or "A run without a title", said, run.rows_of_file(), run.units)
